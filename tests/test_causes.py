"""What states show where a check failed, and that right ones show nothing."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

import bathed as baths
import springcheck
from springcheck import checks, driver, schemes
from springcheck.bath import THERMOSTATS
from springcheck.bath.catalogue import HALF, Act
from springcheck.bath.draws import Reading
from springcheck.checks import Case, causes
from springcheck.engines import Arithmetic
from springcheck.identify import files
from springcheck.physics import scenefile
from springcheck.physics.bath import Bath
from springcheck.physics.builders import spring
from springcheck.physics.distance import RadialSpring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, WallSpring
from springcheck.physics.trajectory import Trajectory, of_scene
from textbook import Case as Broken

STAGES = {name: one.acts for name, one in THERMOSTATS.items()}


@pytest.mark.parametrize("well", [False, True])
@pytest.mark.parametrize(
    ("scheme", "runs", "said"),
    [("baoab", (*STAGES["baoab"][:4], Act("held", HALF)), "kick 2 of 2, which has the force of the"),
     ("gj-i", STAGES["gj-i"][:4], "kick 2 of 2, which is left out"),
     ("baoab", (*(x for x in STAGES["baoab"] if x.kind != "exchange"), STAGES["baoab"][2]), "its noise with"),
     ("euler-maruyama", (STAGES["euler-maruyama"][4], *STAGES["euler-maruyama"][:4]), "acts at its start"),
     ("bbk", tuple(x._replace(draw=0) for x in STAGES["bbk"]), "each acts in both halves of one step"),
     ("bbk", (*STAGES["bbk"][:6], STAGES["bbk"][6]._replace(kind="damp")), "its last friction")],
)  # fmt: skip
def test_a_stage_that_is_another_is_named(scheme: str, runs: Any, said: str, well: bool) -> None:
    """Whatever the force is: the scheme with that stage explains every step to rounding."""
    scene = baths.springs(2, steps=80)
    if well:
        scene = scene.derived(
            terms=(*scene.terms, Quartic(i=np.arange(2), b=np.array([0.7, 1.9]), at=np.zeros(2)))
        )
    of = Broken(scene=scene, scheme=THERMOSTATS[scheme], seed=4, x=0.0)
    shown = causes.found(Case(trajectory=baths.played(of, runs=runs), scene=scene))
    assert shown.startswith("each step is the scheme's own but for ")
    assert said in shown


@pytest.mark.parametrize("scheme", ["baoab", "obabo", "bbk", "lammps-langevin"])
def test_noise_that_adds_up_to_0_is_named(scheme: str) -> None:
    scene = baths.springs(3, steps=300)
    of = Broken(scene=scene, scheme=THERMOSTATS[scheme], seed=4, x=0.0)

    def balanced(right: Any) -> Any:
        pushes = np.sqrt(scene.m) * right[-1]
        return (pushes - np.mean(pushes)) / np.sqrt(scene.m)

    run = baths.played(of, balanced)
    assert checks.status(checks.judge(scene, run)) == 1
    assert causes.found(Case(trajectory=run, scene=scene)).startswith(
        "the noise of all particles adds up to 0"
    )


def test_noise_without_the_root_of_the_mass_is_told_of_each_coordinate() -> None:
    """Draws of unequal size are correlated beyond what those of variance 1 may be, and share nothing."""
    scene = baths.springs(3)
    m = scene.m
    of = Broken(scene=scene, scheme=THERMOSTATS["baoab"], seed=4, x=0.0)
    run = baths.played(of, baths.by(40 * np.sqrt(m)))
    assert checks.bath.draws_variance(Case(trajectory=run, scene=scene)).passed is False
    assert "the noise of the coordinates is " in causes.found(Case(trajectory=run, scene=scene))


@pytest.mark.parametrize(("scheme", "off"), [("gj-i-half", 1e-12)])
def test_what_is_off_by_little_more_than_its_bound_has_no_momentum_taken_away(
    scheme: str, off: float
) -> None:
    """What a draw or a chain carries on tells nothing of other momenta: the same step is no sign of them."""
    scene = baths.springs(3, steps=60)
    assert scene.bath is not None
    other = replace(scene.bath, friction=scene.bath.friction * (1 + off))
    run = springcheck.simulate(scene.replace(bath=other), f"own:{scheme}", seed=5)
    (found,) = checks.judge(scene, run, [checks.bath.noise_direction])
    assert 1 < found.value / found.bound < 4
    assert causes.found(Case(trajectory=run, scene=scene)) == ""


def test_states_in_single_precision_that_none_declares_are_said_to_be_so() -> None:
    def step(q, p, h, force, mass):  # type: ignore[no-untyped-def]
        p = np.float32(p + h * force(q))
        return np.float32(q + h * p / mass), p

    scene = scenefile.load_scene("spring-uneven")
    run = springcheck.simulate(scene, step)
    assert "double arithmetic, stored in single, explains every step" in said(scene, run)
    declared = replace(run, arithmetic=Arithmetic(name="single", state=2.0**-24, force=2.0**-24))
    assert said(scene, declared) == ""


@pytest.mark.parametrize("name", ["baoab", "lammps-langevin", "bussi"])
def test_right_thermostats_show_nothing_and_a_wrong_temperature_shows(name: str) -> None:
    scene = baths.springs(2, steps=800)
    run = driver.run(scene, f"own:{name}", seed=5)
    assert causes.found(Case(trajectory=run, scene=scene)) == ""
    bath = replace(scene.bath, temperature=2.25 * scene.bath.temperature)  # type: ignore[union-attr, type-var]
    shown = causes.found(Case(trajectory=run, scene=scene.derived(bath=bath)))
    assert "noise" in shown
    if name == "baoab":
        size = float(shown.split(" +- ")[0].split()[-1])
        assert np.isclose(size, 2 / 3, rtol=0.1)


def other(scene: Scene, number: int, field: str, row: int, value: float) -> Scene:
    """The scene with one number of a term's other than it is there."""
    terms = list(scene.terms)
    numbers = getattr(terms[number], field).copy()
    numbers[row] = value
    terms[number] = replace(terms[number], **{field: numbers})
    return scene.derived(terms=tuple(terms))


def said(scene: Scene, run: Trajectory) -> str:
    """What a failed judgement says that the states show; "" of one that did not fail."""
    verdicts = checks.explained(scene, run, checks.judge(scene, run), files.shown)
    why = next((v.why for v in verdicts if v.passed is False and v.check in checks.TELLING), "")
    return why.partition(checks.DIAGNOSIS)[2]


VERLET = "own:velocity-verlet"
SPRING = "the stiffness of the spring of particle"


@pytest.mark.parametrize(
    ("name", "number", "field", "row", "value", "method", "words"),
    [
        ("chain", 1, "k", 0, 1.1 + 1.1e-6, VERLET, f"{SPRING}s 0 and 1: 1.1000011, not 1.1"),
        (
            "chain",
            1,
            "rest",
            1,
            1.0 + 1e-10,
            VERLET,
            "rest of the spring of particles 1 and 2: 1.0000000001,",
        ),
        ("chain", 0, "k", 1, 0.0, "own:rk4", f"{SPRING} 2: 0, not 0.9"),
        ("spring-uneven", 0, "at", 0, 1e-6, VERLET, "place of the spring of particle 0: 1e-06, not 0"),
        (
            "pendulum",
            0,
            "depth",
            2,
            7.9 * (1 + 1e-9),
            VERLET,
            "depth of the cosine of particle 2: 7.9000000079,",
        ),
        ("morse-bond", 0, "rest", 0, 0.12747, VERLET, "rest of the morse of particles 0 and 1: 0.12747,"),
        ("driven-spring", 1, "c", 0, 0.11 * 3.7, "own:euler", "damping of particle 0: 0.407, not 0.11"),
        (
            "driven-spring",
            2,
            "amplitude",
            0,
            0.43 * (1 + 1e-8),
            "own:rk4",
            "of particle 0: 0.4300000043, not",
        ),
    ],
)
def test_one_number_that_is_another_is_named(
    name: str, number: int, field: str, row: int, value: float, method: str, words: str
) -> None:
    """Each step then is the scheme's own with another number: the sentence names it and both its values."""
    scene = scenefile.load_scene(name)
    run = driver.run(other(scene, number, field, row, value), method)
    assert words in said(scene, run)


def test_masses_and_steps_that_are_others_are_named() -> None:
    scene = scenefile.load_scene("chain")
    m = scene.m * np.array([1, 1 + 1e-6, 1])
    run = driver.run(scene.derived(m=m), "own:velocity-verlet")
    assert "the mass of particle 1: 0.7000007, not 0.7" in said(scene, run)
    # a program that keeps velocities, of which the judge makes momenta by the scene's masses
    kept = driver.run(scene.derived(m=m, p=scene.p * m / scene.m), "own:velocity-verlet")
    run = replace(kept, p=kept.p * scene.m / m)
    assert "the mass that divides the force on particle 1: 0.7000007, not 0.7" in said(scene, run)
    run = driver.run(scene.derived(m=scene.m * 1.0001), "own:velocity-verlet")
    assert "a factor to each mass: 1.0001, not 1" in said(scene, run)
    pendulum = scenefile.load_scene("pendulum")
    run = driver.run(pendulum.derived(step=float(np.float32(0.05))), "own:velocity-verlet")
    run = replace(run, step=0.05, t=pendulum.step * np.arange(len(run.t)))
    assert "the step: 0.050000000745, not 0.05, as in single precision" in said(pendulum, run)


@pytest.mark.parametrize("name", ["chain", "pendulum"])
def test_a_frame_that_is_there_twice_or_lost_is_named(name: str) -> None:
    """Of joined masses a repeated frame was called a thermostat's noise; of pendulums nothing was said."""
    scene = replace(scenefile.load_scene(name), quantities=("q", "p"))
    run = driver.run(scene, "own:velocity-verlet")
    at = np.arange(len(run.t))
    twice, lost = np.sort(np.append(at[:-1], 80)), np.delete(np.append(at, at[-1]), 80)[: len(at) - 1]
    assert "frame 81 is the one before it once more" in said(
        scene, replace(run, q=run.q[twice], p=run.p[twice])
    )
    fewer = replace(run, q=run.q[lost], p=run.p[lost], t=run.t[:-1])
    shorter = scene.derived(steps=scene.steps - 1)
    assert "a frame is missing before frame 80" in said(shorter, fewer)


@pytest.mark.parametrize(
    ("name", "words"), [("van-der-pol", "another number"), ("driven-spring", "drive is taken")]
)
def test_noise_of_a_few_roundings_is_no_number_and_no_time(name: str, words: str) -> None:
    """A number that roundings of one sign would move as far explains nothing."""
    scene = replace(scenefile.load_scene(name), quantities=("q", "p"), steps=300, every=1)
    run = driver.run(scene, "own:rk4")
    for seed, size in product(range(4), (3e-15, 6e-15)):
        rng = np.random.default_rng(seed)
        q, p = (x * (1 + size * rng.normal(size=x.shape)) for x in (run.q, run.p))
        assert words not in said(scene, replace(run, q=q, p=p))


def test_what_no_number_explains_is_not_said_to_be_the_scheme() -> None:
    """A verdict that failed ended in: velocity Verlet, double arithmetic explains every step."""
    for name in ("chain", "spring-uneven", "pendulum"):
        scene = scenefile.load_scene(name)
        run = driver.run(scene, "own:velocity-verlet")
        p = run.p.copy()
        p[77] *= 1 + 1e-13
        assert "every step" not in said(scene, replace(run, p=p)).lower()


def test_of_several_springs_the_one_that_is_off_is_said() -> None:
    """The first of them was: "stiffer by -1.1e-16"."""
    scene = scenefile.load_scene("orbit")
    run = driver.run(other(scene, 0, "k", 1, 2.9 * (1 + 1e-8)), "own:velocity-verlet")
    words = "the stiffness of the spring of particle 0 along y: 2.900000029, not 2.9"
    assert said(scene, run) == f"each step is the scheme's own with another number, {words}"


@pytest.mark.parametrize(("name", "factor"), [("chain", -1.0), ("anharmonic", -1.0), ("anharmonic", 1.0001)])
def test_a_factor_to_the_forces_of_all_terms_is_named(name: str, factor: float) -> None:
    """A sign that is wrong in every force was no cause: each term by itself explains no step."""
    scene = scenefile.load_scene(name).derived(steps=100)
    shown = said(scene, driver.run(scene.system.scaled(factor), VERLET))
    assert f"a factor to every force: {factor:g}, not 1" in shown


def loop(
    scene: Scene, draws: np.ndarray, c: float = 1.0, size: object = 1.0, *, force: Any = None,
    starts: Any = lambda _, p: p, ends: Any = lambda _, p: p,
) -> Trajectory:  # fmt: skip
    """BAOAB by a loop of these draws (steps, n), of `size`, with `c` times the friction, another force, and
    momenta that are changed at the start and at the end of a step by its number."""
    h, m, force = scene.step, scene.m, force or (lambda q: scene.system.potential_force(q, 0 * q))
    left = np.exp(-c * scene.bath.friction * h) if scene.bath else 1.0
    q, p = [scene.q], [scene.p]
    for i, x in enumerate(draws):
        v = starts(i, p[-1])
        v = v + h / 2 * force(q[-1])
        y = q[-1] + h / 2 * v / m
        v = left * v + size * np.sqrt((1 - left * left) * m * scene.thermal) * x
        q.append(y + h / 2 * v / m)
        p.append(ends(i + 1, v + h / 2 * force(q[-1])))
    return of_scene(scene, np.array(q), np.array(p), label="a loop", scheme="baoab").of_scene(scene)


def failed_and_said(scene: Scene, run: Trajectory) -> tuple[list[str], str]:
    verdicts = checks.explained(scene, run, checks.judge(scene, run), files.shown)
    return [x.check for x in verdicts if x.passed is False], checks.cause_of(verdicts)


def test_draws_that_come_again_late_in_a_run_are_seen_and_said() -> None:
    """A restart with the same seed after the middle of a run passed, and one at its half all but passed."""
    scene = baths.springs(3, steps=3000)
    x = np.random.default_rng(3).standard_normal((3000, 3))
    assert failed_and_said(scene, loop(scene, x)) == ([], "")
    for at in (1500, 2400, 2900):
        again = np.concatenate([x[:at], x[: 3000 - at]])
        failed, said = failed_and_said(scene, loop(scene, again))
        assert "draws-differ" in failed
        assert said == f"the random numbers from row {at} on are those from row 0 on, again"


@pytest.mark.parametrize(("i", "j", "sign"), [(299, 4, 1), (150, 149, -1), (1, 0, 1)])
def test_two_of_three_hundred_coordinates_that_share_draws_are_named(
    i: int, j: int, sign: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    x = np.random.default_rng(5).standard_normal((60, 300))
    # alike to 1e-6 of the size, and in the first row to nothing more
    x[:, i] = sign * x[:, j] + 0.9 * causes.SAME_DRAWS
    seen = Reading(draws=x, across=None, roundings=0, error=np.zeros_like(x))
    monkeypatch.setattr(causes, "reading", lambda _: seen)
    words = "the same as" if sign > 0 else "the opposite of"
    case: Any = None
    assert (
        causes._of_bath(case) == f"the random numbers of coordinate {i} are {words} those of coordinate {j}"
    )
    x[-1, i] += 10 * causes.SAME_DRAWS
    assert causes._of_bath(case) == ""


def test_noise_of_other_masses_is_said_of_each_coordinate() -> None:
    scene = baths.springs(3, steps=3000)
    x = np.random.default_rng(4).standard_normal((3000, 3))
    size = np.sqrt(scene.m[[1, 0, 2]] / scene.m)
    _, said = failed_and_said(scene, loop(scene, x, size=size))
    told = [float(part.split()[-1]) for part in said.split(" +- ")[:3]]
    assert np.allclose(told, size, rtol=0.05), said


def test_a_friction_that_is_halved_with_its_noise_is_said_to_be_one() -> None:
    scene = baths.springs(3, steps=3000)
    x = np.random.default_rng(6).standard_normal((3000, 3))
    failed, said = failed_and_said(scene, loop(scene, x, c=0.5))
    assert "draws-variance" in failed
    assert "go with the momentum before them" in said
    assert "the noise is" not in said


def maruyama(scene: Scene, force: Any, *, late: bool = False, c: float = 1.0) -> Trajectory:
    """A loop of another force, taken after the drift if `late`, or with `c` times the drag."""
    h, m, rng, q, p = scene.step, scene.m, np.random.default_rng(3), [scene.q], [scene.p]
    x = h * scene.bath.friction  # type: ignore[union-attr]
    for _ in range(scene.steps):
        q.append(q[-1] + h * p[-1] / m)
        noise = np.sqrt(2 * x * m * scene.thermal) * rng.standard_normal(scene.n)
        p.append(p[-1] + h * force(q[-1 if late else -2]) - c * x * p[-1] + noise)
    return of_scene(scene, np.array(q), np.array(p), label="a loop", scheme="euler-maruyama").of_scene(scene)


def hot(m: list[float], k: list[float], step: float = 0.2, steps: int = 3000) -> Scene:
    start = {"q": np.full(len(m), 0.3), "p": np.full(len(m), 0.2)}
    scene = spring(m=np.array(m), k=np.array(k), step=step, steps=steps, **start)
    return replace(scene, bath=Bath(temperature=2.2, friction=0.7))


def test_momenta_that_change_in_every_step_are_no_collisions() -> None:
    """It was a ZeroDivisionError: all of them had collided."""
    scene = baths.springs(3, steps=120)
    run = driver.run(scene, "own:andersen", seed=4)
    failed, said = failed_and_said(
        scene, replace(run, p=run.p * (1 + 1e-9 * np.sin(np.arange(121)))[:, None])
    )
    assert "collisions" in failed
    assert "times as often" not in said


LATE = "the force is that at the end of the step where the scheme takes that at its start"
DRAG = "the drag is not the one that the friction asks for"


@pytest.mark.parametrize(("m", "k"), [([0.6], [1.9]), ([0.6, 3.1], [1.9, 2.7])])
def test_a_force_after_the_drift_is_no_wrong_drag(m: list[float], k: list[float]) -> None:
    """`judge --scheme euler-maruyama` of such a loop ended in: the drag is not the one that the friction asks
    for.  On one spring a drag does the same; on unlike ones it does not."""
    scene = hot(m, k)
    run = maruyama(scene, lambda q: -np.array(k) * q, late=True)
    failed, said = failed_and_said(scene, run)
    assert "draws-independent" in failed
    assert said.endswith(f": {LATE}, or {DRAG}" if len(m) == 1 else f": {LATE}")
    _, said = failed_and_said(scene, maruyama(scene, lambda q: -np.array(k) * q, c=1.6))
    assert said.endswith(DRAG)


def test_a_force_that_is_cut_off_in_a_bath_is_no_other_thermostat() -> None:
    """It was: a thermostat, bussi-after or one that is not known here; or nothing, of BAOAB."""
    k, far = np.array([1.9, 2.7]), 1.4

    def force(q: np.ndarray) -> np.ndarray:
        return np.where(np.abs(q) < far, -k * q, 0.0)

    scene = hot([0.6, 3.1], [1.9, 2.7], steps=1500)
    _, said = failed_and_said(scene, maruyama(scene, force))
    assert said.endswith("the force is not that of the scene")
    x = np.random.default_rng(7).standard_normal((scene.steps, 2))
    _, said = failed_and_said(scene, loop(scene, x, force=force))
    within, beyond = (float(part.split()[0]) for part in said.partition("within ")[2].split("beyond "))
    assert within < far < beyond
    assert said.endswith("the force is another there, as where it is cut off")


def test_an_error_that_grows_with_the_distance_is_no_cut_off() -> None:
    scene = hot([3.1], [2.7], steps=1500)
    x = np.random.default_rng(7).standard_normal((scene.steps, 1))
    _, said = failed_and_said(scene, loop(scene, x, force=lambda q: -2.7 * q * (1 + 1e-19 * q**24)))
    assert said == ""


@pytest.mark.parametrize(("every", "after"), [(1, True), (1, False), (10, True), (10, False)])
@pytest.mark.parametrize("scheme", ["velocity-verlet", "baoab"])
def test_a_centre_of_mass_that_is_held_is_said_to_be_so(scheme: str, every: int, *, after: bool) -> None:
    """It was "a scheme with memory", "one map of all coordinates, but not from frame 0 to 1", or nothing."""
    scene = hot([1.7, 0.6, 2.9], [2.3, 1.9, 0.8], step=0.11, steps=300)
    x = np.random.default_rng(8).standard_normal((scene.steps, 3))
    if scheme != "baoab":
        scene, x = replace(scene, bath=None), np.zeros_like(x)

    def removed(step: int, p: np.ndarray) -> np.ndarray:
        return p - scene.m * np.sum(p) / np.sum(scene.m) if step % every == 0 else p

    run = loop(scene, x, **{"ends" if after else "starts": removed})
    where, first = ("after", 10) if after else ("before", 1)
    often = "every step" if every == 1 else f"step {first}, and so every 10 steps"
    expected = (
        f"the total momentum is taken away {where} {often}: the motion of the centre of mass is removed"
    )
    assert said(scene, replace(run, scheme=scheme)) == expected


@pytest.mark.parametrize(
    ("made", "claimed"), [("baoa", "baoab"), ("baoab", "obabo"), ("bbk", "lammps-langevin")]
)
def test_a_right_thermostat_is_named_and_not_said_to_be_noisy(made: str, claimed: str) -> None:
    """BAOA judged as BAOAB had noise "1.46 times as large as the temperature asks"."""
    scene = baths.springs(3, steps=3000)
    run = replace(driver.run(scene, f"own:{made}", seed=2), scheme=claimed)
    failed, said = failed_and_said(scene, run)
    assert failed
    assert THERMOSTATS[made].title in said or f"{made} or" in said
    assert "the noise is" not in said


def test_what_a_scheme_may_be_is_no_cause_of_its_failure() -> None:
    scene = baths.springs(3, steps=3000)
    x = np.random.default_rng(8).uniform(-np.sqrt(3), np.sqrt(3), (3000, 3))
    failed, said = failed_and_said(scene, loop(scene, x))
    assert "draws-shape" in failed
    assert said == ""


def halves(draws: np.ndarray) -> tuple[Scene, Trajectory]:
    """OBABO of one spring by a loop with these draws (steps, 2), and its scene."""
    scene = baths.springs(1, steps=len(draws))
    h, m, force = scene.step, scene.m, scene.system.force
    c = np.exp(-scene.bath.friction * h / 2)  # type: ignore[union-attr]
    q, p, size = [scene.q], [scene.p], np.sqrt((1 - c * c) * m * scene.thermal)
    for a, b in draws:
        v = c * p[-1] + size * a
        v = v + h / 2 * force(q[-1], v)
        q.append(q[-1] + h * v / m)
        p.append(c * (v + h / 2 * force(q[-1], v)) + size * b)
    like = driver.run(scene, "own:obabo", seed=1)
    z = np.array(q), np.array(p)
    return scene, replace(like, q=z[0], p=z[1], energy=scene.system.energy(*z))


def test_coordinates_without_noise_are_named_and_share_no_random_numbers() -> None:
    scene = baths.springs(3, steps=1000)
    x = np.random.default_rng(3).standard_normal((1000, 3))
    said = failed_and_said(scene, loop(scene, x, size=np.array([1, 0, 0])))[1]
    assert said.startswith("no noise acts on coordinate 1, 2,")
    # nor do momenta that each step sets to 0
    one = baths.springs(1, steps=1000)
    still = failed_and_said(one, loop(one, x[:, :1], c=1e3, size=0.0))[1]
    assert still.startswith("no noise acts on coordinate 0,")


def test_rows_of_which_some_come_again_are_not_said_to_do_so_from_one_on() -> None:
    scene = baths.springs(3, steps=3000)
    x = np.random.default_rng(3).standard_normal((3000, 3))
    x[1000:1300] = x[:300]
    said = failed_and_said(scene, loop(scene, x))[1]
    assert said == "300 of 2000 rows of random numbers are those 1000 rows before, again"


def claims_another_friction(scheme: str, friction: float, steps: int) -> str:
    """What is said of a run whose friction is twice that of its scene."""
    scene = baths.springs(3, steps=steps)
    made, claimed = (Bath(temperature=scene.thermal, friction=x) for x in (friction, friction / 2))
    run = driver.run(scene.derived(bath=made), f"own:{scheme}", seed=4)
    return failed_and_said(scene.derived(bath=claimed), run)[1]


def test_collisions_twice_as_often_are_said_to_be_so() -> None:
    said = claims_another_friction("andersen", 0.8, 1500)
    times, error = (float(x) for x in said.split(" times as often")[0].split("come ")[1].split(" +- "))
    assert abs(times - 2) < 4 * error < 0.5


def test_a_factor_of_another_friction_is_not_said_to_have_its_noise_alone() -> None:
    """Where little is lost in a step its noise is known better: the loss is within the errors of both."""
    said = claims_another_friction("bussi", 0.15, 3000)
    assert "as the friction asks" not in said
    times, error = (float(x) for x in said.split("or the friction is ")[1].split(" times")[0].split(" +- "))
    assert abs(times - 2) < 4 * error < 1


@pytest.mark.parametrize("method", ["own:velocity-verlet", "own:rk4"])
def test_two_numbers_that_are_exchanged_are_named(method: str) -> None:
    scene = scenefile.load_scene("chain").derived(steps=60)
    words = "each step is the scheme's own with the "
    for i, j in ((0, 1), (0, 2), (1, 2)):
        order = np.arange(3)
        order[[i, j]] = j, i
        run = driver.run(scene.derived(m=scene.m[order]), method)
        which = f"{words}mass of particle {i} and that of particle {j} exchanged"
        assert which in said(scene, run)
        # velocities of a program, of which a reader makes momenta by the scene's masses
        kept = replace(run, p=run.p / scene.m[order] * scene.m)
        begun = scene.derived(p=kept.p[0])
        assert which in said(begun, kept)
    walls, springs = scene.terms
    turned = scene.derived(terms=(walls, replace(springs, k=springs.k[::-1])))  # type: ignore[call-arg, attr-defined]
    assert (
        f"{words}stiffness of the spring of particles 0 and 1 and that of particles 1 and 2 exchanged"
        in said(scene, driver.run(turned, method))
    )


def molecule(**changes: Any) -> Scene:
    """Four unlike masses in space on three bonds, their numbers those of a force field but for `changes`."""
    k, rest = np.array([2.8e5, 4.5e5, 3.3e5]), np.array([0.109, 0.1229, 0.1335])
    given = {"k": k, "rest": rest} | changes
    bonds = RadialSpring(
        a=np.tile(np.arange(3), 3), b=np.repeat(3 * np.arange(1, 4), 3) + np.tile(np.arange(3), 3),
        number=np.repeat(np.arange(3), 3), **{name: np.repeat(x, 3) for name, x in given.items()},
    )  # fmt: skip
    q = [0.0, 0.0, 0.0, 0.11, 0.02, 0.01, -0.05, 0.13, 0.02, 0.03, -0.1, 0.09]
    m = np.repeat([12.011, 1.008, 15.999, 14.007], 3)
    p = np.sqrt(2.5 * m) * np.cos(np.arange(12) * 1.7)
    return Scene(
        m=m, q=np.array(q), p=p, terms=(bonds,), places=np.arange(12), units="md", step=0.0005, steps=40
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"k": [2.8e5, 4.55e5, 3.3e5]}, "stiffness of the bond of particles 0 and 2: 455000, not 450000"),
        ({"rest": [0.109, 0.1229, 0.1336]}, "rest of the bond of particles 0 and 3: 0.1336, not 0.1335"),
        ({"k": [2.8e5, 3.3e5, 4.5e5]},
         "stiffness of the bond of particles 0 and 2 and that of particles 0 and 3 exchanged"),
    ],
)  # fmt: skip
def test_a_number_of_one_bond_in_space_is_named(changes: dict[str, Any], words: str) -> None:
    """A bond has one stiffness along all axes; each axis by itself explains nothing."""
    right = molecule()
    wrong = molecule(**{name: np.array(x) for name, x in changes.items()})
    assert words in said(right, driver.run(wrong, "own:velocity-verlet"))


def test_the_mass_of_one_particle_in_space_is_named() -> None:
    right = molecule()
    heavy = right.derived(m=right.m * np.where(np.arange(12) // 3 == 1, 2, 1))
    words = "each step is the scheme's own with another number, the mass of particle 1: 2.016, not 1.008"
    assert words in said(right, driver.run(heavy, "own:velocity-verlet"))


def test_velocities_are_not_scaled_away_to_explain_them() -> None:
    """Momenta made of velocities by tiny masses are tiny, and so is what they miss."""
    scene = molecule().derived(steps=20)
    run = driver.run(scene, "own:velocity-verlet")
    p = run.p + 1e-6 * np.sin(np.outer(np.arange(21), np.arange(12) + 1.3)) * np.arange(21)[:, None]
    assert "factor to each mass" not in said(scene, replace(run, p=p))


def test_one_number_of_many_particles_is_found_where_steps_are_farthest_off() -> None:
    """Of more than 16 particles none was looked at by itself, nor in pairs."""
    n = 30
    i, x = np.arange(n), np.linspace(0.7, 1.9, n)
    walls = WallSpring(i=i, k=2.9 * x, at=np.zeros(n))
    scene = Scene(m=x[::-1], q=np.cos(i), p=np.sin(i), terms=(walls,), step=0.05, steps=30)
    order = i.copy()
    order[[19, 27]] = 27, 19
    exchanged = said(scene, driver.run(scene.derived(m=scene.m[order]), VERLET))
    assert "the mass of particle 19 and that of particle 27 exchanged" in exchanged
    springs = (replace(walls, k=walls.k[order]),)
    words = "the stiffness of the spring of particle 19 and that of particle 27 exchanged"
    assert words in said(scene, driver.run(scene.derived(terms=springs), VERLET))
    run = driver.run(other(scene, 0, "k", 23, 4.9), VERLET)
    assert f"{SPRING} 23: 4.9, not" in said(scene, run)


def test_the_rows_of_a_bond_in_space_are_one_and_their_number_is_none_of_the_motion() -> None:
    scene = scenefile.load_scene("diatomic").derived(steps=60)
    case = Case(trajectory=driver.run(scene, VERLET), scene=scene)
    assert not [name for name, *_ in causes.other._numbers(case) if "number" in name]
    (bond,) = scene.terms
    stiffer = scene.derived(terms=(replace(bond, k=2.9029 + 0 * bond.arrays["k"]),))  # type: ignore[call-arg]
    shown = said(scene, driver.run(stiffer, VERLET))
    assert "the stiffness of the bond of particles 0 and 1: 2.9029, not 2.9" in shown
    assert "to each stiffness" not in shown


@pytest.mark.parametrize(
    ("name", "made", "claimed", "every"),
    [("driven-spring", "rk4", "position-verlet", 1),
     ("overdamped", "velocity-verlet", "rk4", 10), ("van-der-pol", "implicit-euler", "implicit-midpoint", 1)],
)  # fmt: skip
def test_the_scheme_that_takes_each_step_is_named_whatever_acts(
    name: str, made: str, claimed: str, every: int
) -> None:
    scene = replace(scenefile.load_scene(name), steps=60 * every, every=every)
    shown = said(scene, replace(driver.run(scene, f"own:{made}"), scheme=claimed))
    assert shown.partition(" of ")[2].removeprefix("velocities").startswith(schemes.title(made)), shown
    assert shown.startswith("Every ")


def test_a_step_that_is_hardly_another_is_no_rescaling() -> None:
    """It was said to be one, by a factor from 1 to 1."""
    one = scenefile.load_scene("chain")
    scene = replace(one, quantities=("q", "p"))
    for change in 10.0 ** np.arange(-14.5, -12, 0.25):
        run = driver.run(scene.derived(step=scene.step * (1 + change)), "own:ruth3")
        run = replace(run, step=scene.step, t=scene.step * np.arange(len(run.t)))
        assert "rescaling" not in said(scene, run)


@pytest.mark.parametrize("method", ["own:baoab", "own:obabo"])
def test_a_wrong_temperature_is_said(method: str) -> None:
    scene = baths.springs(3).derived(steps=200)
    run = driver.run(scene, method, seed=3)
    assert scene.bath is not None
    claimed = scene.derived(bath=replace(scene.bath, temperature=4 * scene.bath.temperature))
    _, said = failed_and_said(claimed, replace(run, scene=claimed))
    assert np.isclose(float(said.removeprefix("the noise is ").split()[0]), 1 / 2, rtol=0.1), said


def test_draws_that_are_nothing_but_rounding_do_not_come_again() -> None:
    """A motion without noise that comes to rest had random numbers "from 826 rows before, again"."""
    scene = baths.springs(1, steps=1200)
    _, said = failed_and_said(scene, loop(scene, np.zeros((1200, 1))))
    assert said.startswith("no noise acts on coordinate 0,")


def test_draws_that_hold_those_before_them_hold_no_momentum() -> None:
    """Both were "the drag is not the one that the friction asks for"."""
    scene, x = baths.springs(3, steps=3000), np.random.default_rng(3).standard_normal((3001, 3))
    opposite = x[:3000].copy()
    opposite[1::2] = -opposite[::2]
    _, said = failed_and_said(scene, loop(scene, opposite))
    assert said == "1500 of 2999 rows of random numbers are the opposite of those 1 rows before, again"
    _, said = failed_and_said(scene, loop(scene, 0.8 * x[1:] + 0.6 * x[:-1]))
    assert "go with those a step before, with a correlation of +0.4" in said or "+0.5" in said


def test_a_factor_at_another_place_in_the_step_is_no_other_factor() -> None:
    """It was "a step leaves 0.73 +- 0.02 of the kinetic energy where the friction asks for 0.57"."""
    scene = baths.springs(40)
    run = replace(driver.run(scene, "own:bussi-after", seed=3), scheme="bussi")
    shown = causes.found(Case(trajectory=run, scene=scene))
    assert "a step leaves" not in shown


def test_velocities_that_are_right_are_not_said_to_be_differences() -> None:
    """Those of velocity Verlet are central differences, and were so where single precision was declared."""
    scene = scenefile.load_scene("spring-uneven")
    single = Arithmetic(name="single", state=2.0**-24, force=2.0**-24)
    run = replace(driver.run(scene, VERLET), arithmetic=single)
    assert checks.steps.arithmetic(Case(trajectory=run, scene=scene)).passed is False
    assert "differences" not in said(scene, run)
