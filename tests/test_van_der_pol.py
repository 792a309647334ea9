"""Van der Pol's oscillator: the exact motion against 25 digits by another route, and every method's own step.

The references were made without springcheck: Gauss collocation in Lienard's plane in 60 digits, and
Taylor series up to mu = 30.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import checks
from springcheck.physics import builders, exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import VanDerPol, WallSpring
from springcheck.schemes import scheme
from springcheck.studies.stability import longest

FOLDER = Path(__file__).parents[1] / "data" / "reference" / "stiff"
STATES = json.loads((FOLDER / "van-der-pol.json").read_text(encoding="utf-8"))["states"]


def of(mu: float, **changes: Any) -> Scene:
    """The shipped scene with another mu."""
    scene = scenes.load_scene("van-der-pol")
    spring, brake = scene.terms
    assert isinstance(spring, WallSpring)
    c = mu * np.sqrt(spring.k * scene.m)
    return replace(scene, terms=(spring, replace(brake, c=c)), **changes)  # type: ignore[type-var]


@pytest.mark.parametrize("mu", sorted({x["mu"] for x in STATES}))
def test_the_exact_motion_has_the_digits_of_another_route(mu: float) -> None:
    rows = [row for row in STATES if row["mu"] == mu]
    scene = of(mu)
    brake = replace(scene.terms[1], c=[rows[0]["coefficient"]])  # type: ignore[type-var]
    scene = replace(scene, terms=(scene.terms[0], brake), step=rows[-1]["time"], steps=1)
    if mu > 2e4:
        # a rounding before a jump decides when it comes
        assert "of the motion" in exact.no_reference(scene)
        return
    assert scene.system.solution is not None
    for row in rows:
        # any step: the path is one for all times
        q, p = (x[0, 0] for x in exact.true_motion(scene, np.array([1]), row["time"]))
        stated = scene.system.solution.doubt(row["time"])
        assert abs(q - np.longdouble(row["q"])) <= stated[0][0]
        assert abs(p - np.longdouble(row["p"])) <= stated[1][0]
    # on the slow arcs, where it stands still beside a jump, all digits are there
    assert abs(q - np.longdouble(row["q"])) <= 2e-14 * abs(q)


@pytest.mark.parametrize("mu", [0.3, 1e3])
@pytest.mark.parametrize("label", ["own:implicit-euler", "own:implicit-midpoint", "own:trapezoidal"])
def test_every_implicit_method_makes_its_schemes_own_steps_through_the_jumps(mu: float, label: str) -> None:
    scene = of(mu, step=6.0 if mu > 1 else 0.11, steps=200)
    run = springcheck.simulate(scene, label)
    found = {v.check: v for v in checks.judge(scene, run)}
    assert np.ptp(np.sign(run.q)) == 2
    assert found["step-defect"].passed is True
    assert not [v.check for v in found.values() if v.passed is False]
    # friction that the place decides contracts no area by a known factor
    assert found["closed-form"].passed is None
    assert found["shadow-energy"].passed is None


@pytest.mark.parametrize("label", ["own:rk4", "own:velocity-verlet", "own:euler", "own:implicit-midpoint"])
def test_frames_several_steps_apart_are_judged_by_the_tangent_of_the_step(label: str) -> None:
    scene = of(1.3, step=0.04, steps=240, every=6)
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, label))}
    assert found["step-defect"].passed is True


@pytest.mark.parametrize("label", ["scipy:dop853", "scipy:radau", "sundials:bdf"])
def test_solvers_keep_their_tolerance_and_a_looser_one_does_not(label: str, need: Any) -> None:
    need(label)
    scene = of(2.0, step=0.1, steps=50, tolerance=1e-8)
    run = springcheck.simulate(scene, label)
    found = {v.check: v for v in checks.judge(scene, run)}
    assert found["tolerance"].passed is True
    loose = springcheck.simulate(replace(scene, tolerance=1e-2), label)
    found = {v.check: v for v in checks.judge(scene, replace(loose, tolerance=1e-8))}
    assert found["tolerance"].passed is False


M, K, C, WIDTH = 1.3, 2.9, 7.1, 0.8


def implicit(rate: Callable[[float, float], float], iterations: int = 60) -> Any:
    """Implicit Euler with a friction rate of the end and the start of the step."""

    def step(q: Floats, p: Floats, h: float, force: Any, mass: Floats) -> tuple[Floats, Floats]:
        start, end = float(q[0]), float(q[0])
        for _ in range(iterations):
            slowed = 1 + h * rate(end, start) / M
            lacks = (end - start) * slowed - h * (float(p[0]) - h * K * end) / M
            e = 1e-6
            steep = slowed + h * (rate(end + e, start) - rate(end - e, start)) / (2 * e) / M * (end - start)
            end -= lacks / (steep + h * h * K / M)
        p = (float(p[0]) - h * K * end) / (1 + h * rate(end, start) / M)
        return np.array([end]), np.array([p])

    return step


FAULTS = {
    "the width off by 1e-9": implicit(lambda end, start: C * ((end / WIDTH / (1 + 1e-9)) ** 2 - 1)),
    "the friction of where the step starts": implicit(lambda end, start: C * ((start / WIDTH) ** 2 - 1)),
    "one iteration": implicit(lambda end, start: C * ((end / WIDTH) ** 2 - 1), 1),
    "the place not squared": implicit(lambda end, start: C * (abs(end / WIDTH) - 1)),
    "no width": implicit(lambda end, start: C * (end**2 - 1)),
    "it never feeds": implicit(lambda end, start: C * max((end / WIDTH) ** 2 - 1, 0)),
}


@pytest.mark.parametrize("name", [*FAULTS, ""])
def test_faults_of_such_a_friction_fail_the_step_and_the_right_one_passes(name: str) -> None:
    scene = scenes.load_scene("van-der-pol")
    brake = replace(scene.terms[1], c=[C])  # type: ignore[type-var]
    scene = replace(scene, terms=(scene.terms[0], brake), step=0.05, steps=120)
    right = implicit(lambda end, start: C * ((end / WIDTH) ** 2 - 1))
    run = springcheck.simulate(scene, FAULTS.get(name, right), scheme="implicit-euler")
    found = {v.check: v for v in checks.judge(scene, run)}
    assert found["step-defect"].passed is (not name)


def test_the_longest_explicit_step_is_that_of_the_strongest_friction() -> None:
    scene = of(1e3)
    rate = 3 * scene.terms[1].parameters[0][0] / scene.m[0]
    # RK4 on the negative axis
    assert longest.longest(scheme("rk4"), scene) * rate == pytest.approx(2.785293563, rel=1e-4)
    assert longest.longest(scheme("implicit-euler"), scene) == np.inf


def test_the_derivatives_of_the_force_are_those_of_its_differences() -> None:
    scene = of(5.0)
    q, p, e = np.array([0.93]), np.array([0.41]), 1e-6
    found = scene.system.jacobian(q, p)
    by_q = (scene.system.force(q + e, p) - scene.system.force(q - e, p)) / (2 * e)
    by_p = (scene.system.force(q, p + e) - scene.system.force(q, p - e)) / (2 * e)
    assert found[1] == pytest.approx([by_q[0], by_p[0]], rel=1e-8)


def test_a_scene_with_it_is_written_and_read_back_the_same() -> None:
    scene = of(5.0)
    assert scenes.parse(scene.to_toml(), name="again").digest == scene.digest
    assert any(term.key == "van-der-pol" for term in scene.terms)
    assert scene.system.is_damped
    assert not scene.system.is_linear


@pytest.mark.parametrize("every", [1, 7])
def test_an_implicit_step_of_joined_masses_is_judged_where_friction_depends_on_the_place(every: int) -> None:
    """Newton's matrix has a factor of its own in each row, whatever axes stand before the rows."""
    chain = builders.chain(3, [0.7, 0.28, 0.1], [6.7, 4.3, 5.0, 4.6], q=[0.1, -0.2, 0.3], step=0.05, steps=14)
    brake = VanDerPol(i=[0, 2], c=[1.3, 0.4], width=[0.2, 0.3], at=[0.04, 0.0])
    joined = replace(chain, terms=(*chain.terms, brake), every=every)
    for method in ("own:implicit-euler", "own:implicit-midpoint"):
        found = springcheck.judge(joined, springcheck.simulate(joined, method))
        (step,) = (v for v in found if v.check == "step-defect")
        assert step.passed, step.why


@pytest.mark.parametrize("label", ["own:implicit-euler", "own:implicit-midpoint", "own:trapezoidal"])
def test_a_jump_in_which_the_implicit_equation_divides_by_almost_nothing_keeps_its_digits(label: str) -> None:
    """1 + h rate of 0.03 took 1,300 roundings of the velocity; the way of the step has them all."""
    k, m, mu, at, width = 1.9, 2.7, 40.0, 0.25, 0.6
    c = mu * np.sqrt(k * m)
    scene = Scene(
        m=[m], q=[at + 1.7 * width], p=[0.0], step=float(1.76 * c / k / 220), steps=70,
        terms=(WallSpring(i=[0], k=[k], at=[at]), VanDerPol(i=[0], c=[c], width=[width], at=[at])),
    )  # fmt: skip
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, label))}
    assert found["step-defect"].passed is True
    assert found["step-defect"].value < 6
