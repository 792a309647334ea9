"""Baths far from the usual: friction next to nothing or huge, next to no heat, free particles, divergence.

What is right there passes, or says why it is not judged.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from springcheck import checks, driver, engines
from springcheck.checks.seeds import Seeded, noise_map, noise_matrix, noise_size
from springcheck.errors import MethodError
from springcheck.physics.arrays import WIDE
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.physics.trajectory import Trajectory


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
    assert any("forces are reused while no position moves" in v.why for v in verdicts)


def seeded(where: Scene, label: str, seed: int) -> Seeded:
    return Seeded(scene=where, label=label, seed=seed, play=driver.run)


def test_a_scheme_without_a_noise_of_real_size_is_refused() -> None:
    with pytest.raises(
        MethodError, match=r"from friction \* step = 2 it is no thermostat, and friction \* step is 2.5"
    ):
        driver.run(scene(x=2.5), "own:gj-iii", seed=1)


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
