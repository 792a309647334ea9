"""Baths far from the usual: friction next to nothing or huge, next to no heat, free particles, divergence.

What is right there passes, or says why it is not judged; no file of it gets a wrong name.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from springcheck import checks, driver, engines
from springcheck.checks.seeds import Seeded, noise_map, noise_matrix, noise_size, seed_kept
from springcheck.errors import MethodError
from springcheck.identify.thermal import of_bath
from springcheck.physics.arrays import WIDE
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, WallSpring
from springcheck.physics.trajectory import Trajectory

needs_lammps = pytest.mark.skipif(bool(engines.absence("lammps")), reason="needs LAMMPS")


def scene(*, x: float = 0.3, turn: float = 0.4, thermal: float = 1.7, steps: int = 60, **more: Any) -> Scene:
    """Two unlike particles on springs of their own, of gamma h = x and h omega = turn."""
    m, w = np.array([3.7, 0.4]), 1.3
    size = np.sqrt(thermal / m) / w
    given = {
        "q": np.array([0.7, -0.4]) * size, "p": np.array([0.3, 1.1]) * m * w * size, "step": turn / w,
        "terms": (WallSpring(i=np.arange(2), k=m * w * w, at=np.zeros(2)),),
        "bath": Bath(temperature=thermal, friction=x * w / turn),
    }  # fmt: skip
    return Scene(m=m, steps=steps, name="extreme", **{**given, **more})


RIGHT: tuple[tuple[str, dict[str, float]], ...] = (
    ("own:gj-i", {"x": 900.0}),
    ("own:gj-viii", {"x": 900.0}),
    ("own:lammps-langevin", {"x": 12.0}),
    ("own:lammps-langevin", {"x": 2.0}),
    ("ase:langevin", {"thermal": 1e-60}),
    ("ase:langevin-baoab", {"thermal": 1e-60}),
    ("ase:bussi", {"x": 1e-13}),
    ("ase:andersen", {"thermal": 1e-60}),
    *((f"lammps:gjf-{number}", {"x": x}) for number in range(1, 9) for x in (1e-10, 1e-3)),
    ("lammps:gjf-4-half", {"x": 0.01}),
    ("lammps:gjf-1", {"x": 700.0}),
    ("lammps:gjf-8-half", {"x": 70.0}),
    # the second draw is next to nothing beside what the first makes of the momentum
    *(("own:" + name, {"turn": turn}) for name in ("obabo", "oabao", "bbk") for turn in (4e4, 4e6)),
)


@pytest.mark.campaign
@pytest.mark.skipif(not WIDE, reason="bounds are those of 80-bit long double")
@pytest.mark.parametrize(("label", "given"), RIGHT)
def test_a_right_thermostat_passes_however_far_its_numbers_are(label: str, given: dict[str, float]) -> None:
    if engines.absence(label.partition(":")[0]):
        pytest.skip("not installed")
    where = scene(**given)
    verdicts = checks.judge(where, driver.run(where, label, seed=5)) + checks.judge_thoroughly(
        where, label, driver.run, seed=5
    )
    assert [
        f"{v.check}: {v.value} of {v.bound}, {v.why}" for v in checks.shared(verdicts) if v.passed is False
    ] == []


def test_an_engine_that_takes_its_forces_again_is_not_judged_by_its_draws_and_says_why() -> None:
    where = scene(thermal=1e-60)
    verdicts = checks.judge(where, driver.run(where, "ase:langevin-baoab", seed=5))
    assert any("forces are kept while no position moves" in v.why for v in verdicts)


def seeded(where: Scene, label: str, seed: int) -> Seeded:
    return Seeded(scene=where, label=label, seed=seed, play=driver.run)


def test_draws_whose_sum_is_next_to_nothing_are_held_against_their_own_roundings() -> None:
    for seed in range(40):
        found = noise_size(seeded(scene(x=0.2459, turn=0.05), "own:gj-vi-half", seed + 1))
        assert found.passed, found


def test_seeds_of_a_run_that_diverges_before_its_first_collision_are_not_said_to_be_ignored() -> None:
    quartic = Quartic(i=np.arange(2), b=np.full(2, 900.0), at=np.zeros(2))
    where = scene(x=0.05)
    found = seed_kept(seeded(replace(where, terms=(*where.terms, quartic)), "own:andersen", 1))
    assert found.passed is None
    assert "diverges" in found.why


def test_a_scheme_without_a_noise_of_real_size_is_refused() -> None:
    with pytest.raises(
        MethodError, match=r"from friction \* step = 2 on it is no thermostat, and here that is 2.5"
    ):
        driver.run(scene(x=2.5), "own:gj-iii", seed=1)


LISTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("gj-iii", {"x": 4e-6}),
    ("gj-vi", {"x": 2e-6}),
    ("gj-i", {"x": 4.5}),
    ("gj-viii", {"x": 2.5}),
    ("gj-viii-half", {"x": 2.6}),
    ("bussi", {"x": 3e-6}),
    ("bussi-unsigned", {"x": 2.5e-5}),
    ("andersen-leapfrog", {"x": 12.0}),
    ("gj-ii", {"x": 96.0}),
    *((name, {"terms": ()}) for name in ("baoab", "baoa", "aboba", "gj-i", "gj-iii", "gj-v", "bussi-after")),
    # of little friction a mean velocity is not 0 in so few frames
    *((name, {"terms": (), "x": 0.05}) for name in ("obabo", "oabao", "boaob", "bbk")),
    *(
        (name, {"x": 0.01, "turn": 0.02})
        for name in ("obabo", "vanden-eijnden-ciccotti", "andersen-leapfrog")
    ),
    # without a spring that shows, positions follow the velocities of these too
    *((name, {"terms": (), "x": 1.7}) for name in ("andersen", "andersen-after", "bussi", "gj-iii-half")),
    ("bussi-unsigned", {"terms": (), "x": 1.7}),
    ("andersen-after", {"terms": (), "x": 12.0}),
    *((name, {"turn": 1e-5, "x": 0.3}) for name in ("andersen", "andersen-after", "bussi-unsigned")),
    # what a collision leaves of a momentum changes its sign beyond h omega = 2**0.5
    *((name, {"turn": 1.9}) for name in ("andersen", "bussi", "bussi-unsigned")),
)


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "given"), LISTS)
def test_a_file_is_given_every_scheme_that_may_have_made_it(name: str, given: dict[str, Any]) -> None:
    where = scene(steps=1000, **given)
    run = driver.run(where, f"own:{name}", seed=3)
    for j in (0, 1):
        found = of_bath(run.t, run.q[:, [j]], run.p[:, [j]], None, where.m[[j]])
        assert found is None or name in [one.scheme for one in found.candidates], found.statement


@pytest.mark.parametrize(
    ("name", "seed", "steps", "digits"),
    [("bbk", 1, 260, 17), ("andersen", 1, 1000, 7), ("andersen-leapfrog", 1, 1000, 7)],
)
def test_a_bath_that_hardly_acts_is_not_taken_for_another(
    name: str, seed: int, steps: int, digits: int
) -> None:
    """Few collisions that digits hide are no draws carried on, and a friction may be too small to show."""
    run = driver.run(scene(steps=steps, x=0.01, turn=0.02), f"own:{name}", seed=seed)
    q, p = (np.array([float(f"{y:.{digits}g}") for y in x[:, 0]])[:, None] for x in (run.q, run.p))
    found = of_bath(run.t, q, p, None, scene().m[:1])
    assert found is None or name in [one.scheme for one in found.candidates], found.statement


@pytest.mark.parametrize("name", ["lammps-langevin", "bbk"])
def test_draws_in_a_well_that_is_no_spring_name_no_other_scheme(name: str) -> None:
    where = scene(x=0.62, turn=0.45, steps=1000)
    quartic = Quartic(i=np.arange(2), b=np.array([3.0, 1.0]), at=np.zeros(2))
    run = driver.run(replace(where, terms=(*where.terms, quartic)), f"own:{name}", seed=4)
    found = of_bath(run.t, run.q[:, :1], run.p[:, :1], None, where.m[:1])
    assert found is None or found.scheme in (None, name), found.statement


@pytest.mark.parametrize(("name", "turn"), [("bussi", 0.93), ("andersen", 0.93), ("baoab", 0.2)])
def test_few_digits_leave_every_scheme_in_the_list_that_they_cannot_exclude(name: str, turn: float) -> None:
    run = driver.run(scene(x=0.1, turn=turn, steps=1000), f"own:{name}", seed=4)
    q, p = (x[:, :1].astype(np.float16).astype(float) for x in (run.q, run.p))
    found = of_bath(run.t, q, p, None, scene().m[:1])
    assert found is None or name in [one.scheme for one in found.candidates], found.statement


def test_velocities_in_another_unit_name_no_scheme() -> None:
    run = driver.run(scene(x=0.25, turn=0.2, steps=1000), "own:baoab", seed=4)
    found = of_bath(run.t, 0.6 * run.q[:, :1], run.p[:, :1], None, scene().m[:1])
    assert found is None or found.verdict != "named", found.statement


def published(number: str, at: Scene, *, half: bool) -> Trajectory:
    """A GJ scheme as its authors write it, by c1 = (1 + c2)/2 and c3 = (1 - c2)/x of a c2 that is rounded."""
    assert at.bath is not None
    rng, x, h, m = np.random.default_rng(7), at.bath.friction * at.step, at.step, at.m
    c2 = {"i": (1 - x / 2) / (1 + x / 2), "iv": (np.sqrt(1 + 4 * x) - 1) / (2 * x), "v": 1 / (1 + x)}[number]
    c1, c3, force = (1 + c2) / 2, (1 - c2) / x, at.system.potential_force
    q, v, last = at.q, at.p / m, rng.standard_normal(2)
    states = [(q, m * v)]
    for draw in rng.standard_normal((at.steps, 2)):
        shot = np.sqrt(2 * x * at.thermal / m) * draw
        if half:
            v = c2 * v + np.sqrt(c3) * (
                h * force(q, 0 * q) / m + (np.sqrt(2 * x * at.thermal / m) * last + shot) / 2
            )
            q, last = q + np.sqrt(c3) * h * v, draw
        else:
            u = np.sqrt(c1) * v + np.sqrt(c3) / 2 * (h * force(q, 0 * q) / m + shot)
            q = q + np.sqrt(c3) * h * u
            v = c2 / np.sqrt(c1) * u + np.sqrt(c3 / c1) / 2 * (h * force(q, 0 * q) / m + shot)
        states.append((q, m * v))
    t, (q, p) = np.arange(at.steps + 1) * h, np.array(states).transpose(1, 0, 2)
    return Trajectory.from_arrays(t, q, p, scene=at, scheme=f"gj-{number}" + "-half" * half)


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("number", ["i", "iv", "v"])
def test_a_loop_by_published_coefficients_passes_at_small_friction(number: str, half: bool) -> None:
    """1 - c2 of a rounded c2 keeps 1e-16/x of itself; a spring off by 1e-9 is seen all the same."""
    at = scene(x=1e-3, turn=0.1)
    assert checks.status(checks.judge(at, published(number, at, half=half))) == 0
    wrong = published(number, at.derived(terms=at.system.scaled(1 + 1e-9).terms), half=half)
    assert checks.status(checks.judge(at, replace(wrong, scene=at))) == 1


def test_a_momentum_that_is_no_number_passes_no_experiment_with_a_seed() -> None:
    def play(*where: Any, seed: Any) -> Trajectory:
        run = driver.run(*where, seed=seed)
        return replace(run, p=np.where(run.t[:, None] > 0, np.nan, run.p))

    for one in (noise_map, noise_size, noise_matrix):
        subject = replace(seeded(scene(), "own:baoab", 1), play=play)
        assert one(subject).passed is False
