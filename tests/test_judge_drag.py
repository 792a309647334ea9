"""Velocities rebuilt from positions are noisy by eps q/h: that raises no alarm, and hides no friction."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import clean
import textbook as steppers
from springcheck import checks, driver, schemes
from springcheck.checks.drag import drag
from springcheck.physics.arrays import WIDE, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, Term
from springcheck.physics.trajectory import Trajectory

pytestmark = pytest.mark.skipif(not WIDE, reason="the reference's own rounding is as large as a velocity's")
SCHEME = schemes.SCHEMES["semi-implicit-euler"]


def rebuilt(scene: Scene, friction: float = 0.0) -> Trajectory:
    """A kick, a drift, and the velocity from the way times the rounded reciprocal of the step."""
    h, m = scene.step, scene.m
    inverse = 1 / h

    def step(i: int, q: Floats, p: Floats) -> tuple[Floats, Floats]:
        v = p / m + h * (scene.system.force(q, p) / m - friction * p / m)
        new = q + h * v
        return new, np.asarray(m * ((new - q) * inverse), np.float64)

    return replace(steppers.record(scene, SCHEME, step), rebuilds_velocity=True)


def four(seed: int, step: float, steps: int, *, well: bool = False, every: int = 1) -> Scene:
    rng = np.random.default_rng([9, seed])
    terms: tuple[Term, ...] = (clean.walls(rng.uniform(0.5, 4, 4), np.zeros(4)),)
    if well:
        terms += (Quartic(i=np.arange(4), b=rng.uniform(0.5, 2, 4), at=np.zeros(4)),)
    scene = clean.scene(
        rng.uniform(1, 4, 4), terms, rng.uniform(0.8, 1.2, 4), rng.uniform(1, 2, 4), step=step, steps=steps
    )
    return replace(scene, every=every, quantities=("q", "p"))


@pytest.mark.parametrize("well", [False, True])
def test_a_friction_below_the_noise_of_a_velocity_is_seen_in_many_steps(well: bool) -> None:
    scene = four(1, 1e-5, 6000, well=well)
    (right,) = checks.judge(scene, rebuilt(scene), [checks.step_defect])
    assert right.passed is True
    (wrong,) = checks.judge(scene, rebuilt(scene, 1e-7), [checks.step_defect])
    assert wrong.passed is False
    found = re.search(r"the steps gain (\S+) a unit of time, with a standard error of ([^\s;]+)", wrong.why)
    assert found is not None
    rate, error = map(float, found.groups())
    assert abs(rate + 1e-7) < 5 * error < 1e-7
    # by a single step it could not be: it is a tenth of a rounding of that velocity
    case = checks.Case(trajectory=rebuilt(scene), scene=scene)
    assert case.ahead is not None
    assert np.all(1e-7 * scene.step * np.abs(scene.p) < 0.5 * np.median(case.ahead.allowance[1], axis=0))


def test_frames_several_steps_apart_show_it_too() -> None:
    scene = four(2, 1e-5, 6000, every=10)
    assert checks.judge(scene, rebuilt(scene), [checks.step_defect])[0].passed is True
    assert checks.judge(scene, rebuilt(scene, 1e-6), [checks.step_defect])[0].passed is False


@pytest.mark.parametrize("seed", range(10))
def test_the_noise_of_rebuilt_velocities_raises_no_alarm(seed: int) -> None:
    rng = np.random.default_rng([10, seed])
    scene = four(seed, float(10 ** rng.uniform(-6.5, -0.5)), int(10 ** rng.uniform(2.2, 3.3)))
    run = rebuilt(scene)
    assert [v.why for v in checks.judge(scene, run) if v.passed is False] == []
    found = drag(checks.Case(trajectory=run, scene=scene), np.ones(len(run.t) - 1, dtype=bool))
    assert found is None or found[0] < 0.6 * found[1]


@pytest.mark.parametrize("step", [1e-7, 1e-5, 1e-3])
def test_openmm_s_velocities_raise_none(step: float, need: Callable[[str], None]) -> None:
    need("openmm:verlet")
    scene = four(3, step, 4000)
    found = checks.judge(scene, driver.run(scene, "openmm:verlet"))
    assert [v.why for v in found if v.passed is False] == []


def test_a_rounding_that_comes_back_only_after_long_is_no_noise() -> None:
    scene = four(4, 3e-8, 600)
    case = checks.Case(trajectory=rebuilt(scene), scene=scene)
    assert drag(case, np.ones(len(case.trajectory.t) - 1, dtype=bool)) is None
