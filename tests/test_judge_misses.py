"""Faults that are large beside rounding and must be seen: stiff implicit steps, frames many steps apart,
one light body among heavy ones, a trajectory that is not the one that the scene asks for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import clean
import springcheck
import textbook as steppers
from springcheck import checks, schemes
from springcheck.checks import sight, stretch
from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile
from springcheck.physics.arrays import WIDE
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Cosine, Damping, Quartic, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory

EXTENDED = pytest.mark.skipif(not WIDE, reason="so sharp are references of more digits than a double")


def plain(scene: Scene, name: str, moved: Scene | None = None) -> Trajectory:
    """The textbook engine's run of a scene, or of another one under its name."""
    scheme = schemes.SCHEMES[name]
    other = moved or scene
    return steppers.record(scene, scheme, steppers.textbook(other, scheme))


def failed(scene: Scene, run: Trajectory) -> list[str]:
    return [v.check for v in checks.judge(scene, run) if v.passed is False]


def wall(k: float, i: int = 0) -> WallSpring:
    return WallSpring(i=np.array([i]), k=np.array([k]), at=np.zeros(1))


def two_masses(soft: float) -> Scene:
    bond = Spring(a=np.array([0]), b=np.array([1]), k=np.array([1.7e6]), rest=np.array([0.9]))
    step = 500 / np.sqrt(2 * 1.7e6 / 1.3)
    return clean.scene(
        np.array([1.3, 1.3]),
        (wall(soft), bond),
        np.array([0.3, 1.1]),
        np.array([0.2, 0.4]),
        step=step,
        steps=60,
    )


def test_a_soft_spring_beside_a_stiff_one_is_judged_by_implicit_euler() -> None:
    scene = two_masses(1.7)
    assert failed(scene, plain(scene, "implicit-euler")) == []
    assert "step-defect" in failed(scene, plain(scene, "implicit-euler", two_masses(3.4)))
    assert "step-defect" in failed(scene, plain(scene, "implicit-euler", two_masses(1.7 * (1 + 1e-5))))


@pytest.mark.parametrize("name", ["implicit-euler", "implicit-midpoint", "trapezoidal"])
def test_a_stiff_spring_is_judged_to_rounding_by_implicit_schemes(name: str) -> None:
    def scene(k: float) -> Scene:
        return clean.scene(np.array([3.7]), (wall(k),), np.array([0.3]), np.array([0.7]), step=1.0, steps=40)

    # h w = 1e6 where a step forgets the phase, 500 where it keeps it
    stiff = 3.7e12 if name == "implicit-euler" else 3.7 * 500**2
    right = scene(stiff)
    assert failed(right, plain(right, name)) == []
    assert failed(right, plain(right, name, scene(11 * stiff)))
    right = scene(3.7 * 500**2)
    wrong = 1e-7 if name == "implicit-euler" else 1e-2
    assert failed(right, plain(right, name, scene(3.7 * 500**2 * (1 + wrong))))


def fast_and_slow(slow: float) -> Scene:
    fast = WallSpring(i=np.array([0]), k=np.array([290.0]), at=np.zeros(1), fast=True)
    return clean.scene(
        np.array([3.7]), (wall(slow), fast), np.array([0.3]), np.array([0.7]), step=0.05, steps=1000
    )


@pytest.mark.campaign
@pytest.mark.parametrize("every", [20, 100, 500])
def test_a_slow_stiffness_of_multiple_time_steps_is_judged_however_far_apart_frames_are(every: int) -> None:
    scene = replace(fast_and_slow(2.9), every=every)
    assert failed(scene, plain(scene, "respa8")) == []
    assert "step-defect" in failed(scene, plain(scene, "respa8", fast_and_slow(2.9 * (1 + 1e-9))))


@pytest.mark.parametrize("step", [0.05, 0.4])
def test_multiple_time_steps_of_fast_springs_alone_with_friction_are_judged_by_their_closed_form(
    step: float,
) -> None:
    def scene(c: float) -> Scene:
        terms = (*fast_and_slow(0.0).terms[1:], Damping(i=np.array([0]), c=np.array([c])))
        return fast_and_slow(0.0).derived(terms=terms, step=step, steps=100)

    right = scene(0.85)
    made = plain(right, "respa8")
    assert {v.check for v in checks.judge(right, made) if v.passed} >= {"closed-form", "shadow-energy"}
    assert failed(right, made) == []
    assert "closed-form" in failed(right, plain(right, "respa8", scene(0.85 * (1 + 1e-10))))


@pytest.mark.parametrize("every", [10, 200])
def test_an_anharmonic_coefficient_is_judged_however_far_apart_frames_are(every: int) -> None:
    def scene(b: float) -> Scene:
        well = Quartic(i=np.array([0]), b=np.array([b]), at=np.zeros(1))
        return clean.scene(
            np.array([1.3]), (wall(1.1), well), np.array([0.9]), np.array([0.4]), step=0.05, steps=1000
        )

    right = replace(scene(2.3), every=every)
    assert failed(right, plain(right, "velocity-verlet")) == []
    assert "step-defect" in failed(right, plain(right, "velocity-verlet", scene(2.3 * (1 + 1e-9))))


def test_another_scheme_is_seen_at_every_400_steps_where_friction_couples_the_modes() -> None:
    bond = Spring(a=np.array([0]), b=np.array([1]), k=np.array([2.9]), rest=np.array([0.9]))
    m = np.array([1.3, 2.1])
    brake = Damping(i=np.array([0, 1]), c=np.array([0.002, 0.0071]))
    scene = clean.scene(
        m,
        (wall(1.7), bond, brake),
        np.array([0.3, 1.1]),
        np.array([0.2, 0.4]),
        step=0.05,
        steps=1200,
        every=400,
    )
    assert failed(scene, plain(scene, "velocity-verlet")) == []
    wrong = steppers.record(
        scene,
        schemes.SCHEMES["velocity-verlet"],
        steppers.textbook(scene, schemes.SCHEMES["position-verlet"]),
    )
    assert "step-defect" in failed(scene, wrong)


def test_a_light_body_is_not_hidden_by_a_heavy_one() -> None:
    def scene(k: float) -> Scene:
        walls = clean.walls(np.array([2.9e12, k]), np.zeros(2))
        start = np.array([3e5, 3e-6]), np.array([2e11, 1e-7])
        return clean.scene(np.array([3.7e12, 1.3]), (walls,), *start, step=0.1, steps=400, every=10)

    right = scene(1.1)
    assert failed(right, plain(right, "velocity-verlet")) == []
    assert "step-defect" in failed(right, plain(right, "velocity-verlet", scene(1.1 * (1 + 1e-10))))


def test_a_body_that_freezes_far_below_its_start_is_seen_at_every_10() -> None:
    brake = Damping(i=np.array([0]), c=np.array([2.0]))
    scene = clean.scene(
        np.array([3.7]), (wall(2.9), brake), np.array([0.3]), np.array([0.7]), step=0.1, steps=2000, every=10
    )
    run = plain(scene, "rk4")
    assert failed(scene, run) == []
    small = np.abs(run.q[:, 0]) + np.abs(run.p[:, 0]) < 1e-13
    q, p = run.q.copy(), run.p.copy()
    q[small], p[small] = q[np.argmax(small)], p[np.argmax(small)]
    frozen = replace(run, q=q, p=p, energy=steppers.energies(scene, q, p))
    assert "step-defect" in failed(scene, frozen)


def test_a_pendulum_far_out_is_judged_by_the_positions_that_it_records() -> None:
    def scene(depth: float) -> Scene:
        swing = Cosine(i=np.array([0]), depth=np.array([depth]), wave=np.ones(1), at=np.zeros(1))
        return clean.scene(np.array([1.3]), (swing,), np.array([1e9]), np.array([2.0]), step=0.05, steps=200)

    right = scene(2.3)
    assert failed(right, plain(right, "velocity-verlet")) == []
    assert failed(right, plain(right, "velocity-verlet", scene(2.3 * (1 + 1e-7))))


def uneven(**changes: Any) -> Scene:
    return replace(scenefile.load_scene("spring-uneven"), steps=200, **changes)


def test_the_trajectory_is_held_against_the_grid_of_the_scene() -> None:
    scene = uneven()
    assert failed(scene, springcheck.simulate(scene, "own:semi-implicit-euler")) == []
    whole = springcheck.simulate(scene, "own:semi-implicit-euler")
    assert whole.energy is not None
    short = replace(
        whole,
        t=whole.t[:101],
        q=whole.q[:101],
        p=whole.p[:101],
        energy=whole.energy[:101],
        outcome=replace(whole.outcome, step=100),
    )
    wrong = {
        "half the step": springcheck.simulate(replace(scene, step=scene.step / 2), "own:semi-implicit-euler"),
        "every second step": springcheck.simulate(replace(scene, every=2), "own:semi-implicit-euler"),
        "more steps": springcheck.simulate(replace(scene, steps=300), "own:semi-implicit-euler"),
        "no energies": replace(whole, energy=None),
        "half of the steps, called complete": short,
        "half of the steps, stopped for no reason": replace(
            short, outcome=replace(short.outcome, status="stopped")
        ),
        "only the start": replace(
            whole, t=whole.t[:1], q=whole.q[:1], p=whole.p[:1], energy=whole.energy[:1],
            outcome=replace(whole.outcome, step=0),
        ),
    }  # fmt: skip
    for name, run in wrong.items():
        assert "grid" in failed(scene, run), name


def test_what_an_adaptive_method_says_of_itself_is_not_believed() -> None:
    scene = uneven(tolerance=1e-10)
    run = springcheck.simulate(scene, "sundials:bdf")
    assert failed(scene, run) == []
    assert "grid" in failed(scene, replace(run, tolerance=1e-4))
    off = replace(run, q=run.q * (1 + 1e-2), force_calls=10**12)
    off = replace(off, energy=scene.system.energy(off.q, off.p))
    assert "tolerance" in failed(scene, off)


def test_a_trajectory_without_its_first_frame_is_none_of_the_scene() -> None:
    """Of a well every later frame may be right although the motion began elsewhere."""
    well = Quartic(i=np.array([0]), b=np.array([2.3]), at=np.zeros(1))
    scene = clean.scene(np.array([1.3]), (well,), np.array([0.9]), np.array([0.4]), step=0.05, steps=30)
    scheme = schemes.SCHEMES["velocity-verlet"]
    run = steppers.record(scene, scheme, steppers.textbook(scene, scheme), start=(scene.q + 1, scene.p))
    cut = replace(run, t=run.t[1:], q=run.q[1:], p=run.p[1:], energy=None)
    asked = replace(scene, quantities=("q", "p"))
    assert [v.check for v in springcheck.judge(asked, cut) if v.passed is False] == ["start"]
    # a later piece of a long run says so
    later = {v.check: v.passed for v in checks.judge(asked, cut, piece=True)}
    assert later["start"] is None
    # nor is a piece of a run that goes on the whole of it
    whole = steppers.record(asked, scheme, steppers.textbook(asked, scheme))
    some = replace(whole, t=whole.t[:9], q=whole.q[:9], p=whole.p[:9])
    some = replace(some, outcome=replace(whole.outcome, status="continued", step=8))
    assert [v.check for v in springcheck.judge(asked, some) if v.passed is False] == ["grid"]
    assert all(v.passed is not False for v in checks.judge(asked, some, piece=True))


@pytest.mark.parametrize(
    "change",
    [{"q": np.zeros((7, 2))}, {"p": np.zeros((6, 1))}, {"energy": np.zeros(3)}, {"every": 0}, {"step": 0.0}],
    ids=lambda change: next(iter(change)),
)
def test_frames_of_another_shape_are_refused_in_one_line(change: dict[str, Any]) -> None:
    scene = clean.scene(np.ones(1), (), np.zeros(1), np.ones(1), step=0.1, steps=6)
    run = steppers.record(scene, schemes.SCHEMES["rk4"], steppers.textbook(scene, schemes.SCHEMES["rk4"]))
    with pytest.raises(SpringcheckError, match=r"^plain: [^\n]*$"):
        springcheck.judge(scene, replace(run, **change))


def lattice(n: int, every: int, *, link: float = 1.3, light: float = 1.0) -> Scene:
    """A chain of n particles, each with a site of its own that hardens; the first one's numbers times
    `light`."""
    rng, each = np.random.default_rng(n), np.arange(n)
    own = np.where(each == 0, light, 1.0)
    m = own * 10 ** rng.uniform(-0.3, 0.3, n)
    joins = link * np.where(each[1:] == 1, light, 1.0)
    terms = (
        WallSpring(i=each, k=0.5 * own, at=each.astype(float)),
        Spring(a=each[:-1], b=each[1:], k=joins, rest=np.ones(n - 1)),
        Quartic(i=each, b=own, at=each.astype(float)),
    )
    start = each + 0.3 * rng.normal(size=n), m * rng.normal(size=n)
    made = clean.scene(m, terms, *start, step=0.1, steps=6 * every, every=every)
    return replace(made, quantities=("q", "p"))


@EXTENDED
@pytest.mark.parametrize("every", [2, 50])
def test_more_joined_particles_than_have_tangent_matrices_are_judged_by_tangent_vectors(every: int) -> None:
    scene = lattice(33, every)
    assert failed(scene, plain(scene, "velocity-verlet")) == []
    wrong = plain(scene, "velocity-verlet", lattice(33, every, link=1.3 * (1 + 2e-12)))
    assert "step-defect" in failed(scene, wrong)
    # as many as have them are seen a little more sharply
    few = lattice(32, every)
    known = [checks.Case(trajectory=plain(x, "velocity-verlet"), scene=x).ahead for x in (scene, few)]
    assert all(ahead is not None for ahead in known)
    many, exact = (float(np.median(ahead.allowance)) for ahead in known if ahead is not None)
    assert exact < many < 4 * exact


@pytest.mark.campaign
@EXTENDED
@pytest.mark.parametrize("name", ["velocity-verlet", "rk4", "implicit-midpoint"])
@pytest.mark.parametrize("every", [20, 700])
def test_a_step_is_judged_as_sharply_between_frames_far_apart_as_by_itself(name: str, every: int) -> None:
    def scene(k: float) -> Scene:
        start = np.ones(1), np.array([0.3])
        made = clean.scene(np.array([3.7]), (wall(k),), *start, step=0.1, steps=2 * every, every=every)
        return replace(made, quantities=("q", "p"))

    right = plain(scene(2.9), name)
    assert failed(scene(2.9), right) == []
    assert failed(scene(2.9), plain(scene(2.9), name, scene(2.9 * (1 + 1.2e-14)))) != []


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["semi-implicit-euler", "rk4", "implicit-euler"])
@pytest.mark.parametrize("wander", [0.3, 3e-5, 1e-6])
def test_roundings_to_one_side_at_every_step_are_no_fault(name: str, wander: float) -> None:
    """A place far from 0 that moves by few last digits a step loses the same part of one each time."""
    far = WallSpring(i=np.zeros(1, dtype=int), k=np.array([1e-7]), at=np.array([1e9]))
    start = np.array([1e9 + wander]), np.array([1.3 * wander])
    made = clean.scene(np.array([1.3]), (far,), *start, step=0.1, steps=1500, every=500)
    scene = replace(made, quantities=("q", "p"))
    assert failed(scene, plain(scene, name)) == []


def test_a_light_one_among_many_joined_particles_is_seen() -> None:
    scene = lattice(40, 2, light=1e-9)
    run = plain(scene, "velocity-verlet")
    assert failed(scene, run) == []
    p = run.p.copy()
    p[3:, 0] *= 1 + 1e-9
    assert "step-defect" in failed(scene, replace(run, p=p))


@EXTENDED
@pytest.mark.parametrize("scheme", ["velocity-verlet", "rk4", "implicit-midpoint"])
def test_tangents_in_doubles_bound_what_extended_ones_do(scheme: str) -> None:
    """Of the same random signs; the ends are the same, and no allowance differs but in its last digits."""
    scene = lattice(40, 1, light=0.3)
    run = plain(scene, scheme)
    case = checks.Case(trajectory=run, scene=scene)
    start = run.q[:3].astype(np.longdouble), run.p[:3].astype(np.longdouble)
    coarse, told = stretch._in_width(case, *start, 30, np.float64)
    fine, _ = stretch._in_width(case, *start, 30, np.longdouble)
    assert told
    assert np.array_equal(coarse.end, fine.end)
    assert np.all(np.abs(coarse.allowance / fine.allowance - 1) < 1e-9)
    # numbers that leave the range of doubles are followed in extended precision
    with np.errstate(all="ignore"):
        assert not stretch._in_width(case, 1e306 * start[0], 1e306 * start[1], 30, np.float64)[1]


@pytest.mark.parametrize("scheme", ["semi-implicit-euler", "rk4", "implicit-midpoint"])
def test_derivatives_are_those_of_differences(scheme: str) -> None:
    """By the step, and by one spring of several: their limits of detection follow from these."""
    scene = lattice(5, 1, light=0.3)
    case = checks.Case(trajectory=replace(plain(scene, scheme), every=7), scene=scene)
    at, change = np.arange(3), 2.0**-20
    term, number = scene.terms[0], 2
    part = replace(term, **{name: x[number : number + 1] for name, x in term.arrays.items()})
    found = stretch.derivatives(case, case.trajectory.q[at], case.trajectory.p[at], 7, [{term: part}])
    right = sight.ends(case, at)
    rows = 0, slice(number, number + 1)
    for j, one in enumerate(
        (sight.changed(case, "step", change), sight.changed(case, "stiffness", change, rows))
    ):
        for by, here, there in zip(found, right, sight.ends(one, at), strict=True):
            assert np.max(np.abs((there - here) / change - by[j])) < 1e-4 * np.max(np.abs(by[j]))


SHARP = [("rk4", 3), ("forest-ruth", 3), ("yoshida4", 3)]
SHARP += [(name, 1) for name in ("rk2-heun", "rk4", "ruth3", "forest-ruth", "langevin-middle", "trapezoidal")]


@EXTENDED
@pytest.mark.parametrize(("name", "every"), SHARP)
def test_a_kick_below_the_worst_that_all_roundings_could_do_together_is_seen(name: str, every: int) -> None:
    """As good as random, they stay far below."""
    terms = (WallSpring(i=np.array([0, 1]), k=np.array([2.9, 1.1]), at=np.zeros(2)),)
    start = np.array([0.31, -0.7]), np.array([1.23, 2.1])
    grid = {"step": 0.003, "steps": 30 * every}
    scene = replace(clean.scene(np.array([3.7, 1.3]), terms, *start, **grid), every=every)
    run = plain(scene, name)
    assert failed(scene, run) == []
    (right,) = checks.judge(scene, run, [checks.step_defect])
    assert right.value < right.bound / 2
    most = checks.Case(trajectory=run, scene=scene).roundings * 2.0**-53
    p = run.p.copy()
    p[7, 1] *= 1 + 0.8 * most
    (wrong,) = checks.judge(scene, replace(run, p=p), [checks.step_defect])
    assert wrong.passed is False
