"""Stiff joined masses taken implicitly: every way in which engines write the step passes, and the momenta of
the stiff pair are judged all the same."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clean
import textbook as steppers
from springcheck import checks, schemes
from springcheck.physics.arrays import WIDE, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Spring, Term, WallSpring
from springcheck.physics.trajectory import Trajectory

VALIDATION = Path(__file__).parent.parent / "validation"
_spec = importlib.util.spec_from_file_location("implicit_forms", VALIDATION / "implicit_forms.py")
assert _spec is not None
assert _spec.loader is not None
forms = importlib.util.module_from_spec(_spec)
sys.modules["implicit_forms"] = forms
_spec.loader.exec_module(forms)

pytestmark = pytest.mark.skipif(not WIDE, reason="the reference's own rounding is as large as an engine's")
WRITTEN = ("textbook", *forms.FORMS)


def pair(ratio: float, rng: np.random.Generator | None = None, turn: float = 0.35) -> Scene:
    """Two masses, the first on a soft wall spring, joined by a stiff one; `turn` is h omega of the soft."""
    m, q, p, soft, rest = np.array([1.3, 0.9]), np.array([0.3, 1.1]), np.array([0.2, 0.4]), 1.7, 0.9
    if rng is not None:
        m = 10 ** rng.uniform(-1, 1, 2)
        q, p = rng.normal(size=2), m * rng.normal(size=2)
        soft, rest = float(10 ** rng.uniform(-1, 1)), float(abs(rng.normal()))
    terms = (
        WallSpring(i=np.array([0]), k=np.array([soft]), at=np.zeros(1)),
        Spring(a=np.array([0]), b=np.array([1]), k=np.array([ratio * soft]), rest=np.array([rest])),
    )
    step = turn / np.sqrt(soft / np.sum(m))
    return replace(clean.scene(m, terms, q, p, step=step, steps=60), quantities=("q", "p"))


def written(scene: Scene, name: str, form: str, *, per_row: bool = True) -> Trajectory:
    """The run of an engine that writes an implicit step in this way."""
    scheme = schemes.SCHEMES[name]
    if form == "textbook":
        step = steppers.textbook(scene, scheme)
    else:
        step = forms.step(scene, scheme, form, per_row=per_row)
    return replace(steppers.record(scene, scheme, step), rebuilds_velocity=form in forms.REBUILDS)


def alarms(scene: Scene, run: Trajectory) -> list[str]:
    found = checks.judge(scene, run)
    return [f"{v.check} {v.value:.3g} of {v.bound:.3g}: {v.why}" for v in found if v.passed is False]


FAULTS: dict[str, Callable[[Floats], list[float] | Floats]] = {
    "p of the second is nothing": lambda p: [p[0], 0.0],
    "all of p goes to the first": lambda p: [p[0] + p[1], 0.0],
    "p in whole numbers": np.round,
}


@pytest.mark.campaign
@pytest.mark.parametrize("name", forms.THETA)
@pytest.mark.parametrize("ratio", [1e6, 1e7, 1e8, 1e9, 1e10])
def test_the_momenta_of_a_stiff_pair_are_judged(name: str, ratio: float) -> None:
    scene, scheme = pair(ratio), schemes.SCHEMES[name]
    right = steppers.textbook(scene, scheme)
    for fault, change in FAULTS.items():

        def step(
            i: int, q: Floats, p: Floats, change: Callable[[Floats], list[float] | Floats] = change
        ) -> tuple[Floats, Floats]:
            q, p = right(i, q, p)
            return q, np.asarray(change(p), np.float64)

        (found,) = checks.judge(scene, steppers.record(scene, scheme, step), [checks.step_defect])
        assert found.passed is False, fault
        assert found.value > 1e3 * found.bound, fault


@pytest.mark.campaign
@pytest.mark.parametrize("name", forms.THETA)
@pytest.mark.parametrize("form", WRITTEN)
def test_every_way_to_write_an_implicit_step_of_a_stiff_pair_passes(name: str, form: str) -> None:
    for seed in range(2):
        rng = np.random.default_rng([5, seed])
        for i, ratio in enumerate((1.0, 1e2, 1e4, 1e6, 1e8, 1e10)):
            scene = pair(ratio, rng, float(10 ** rng.uniform(-1, 0.5)))
            # at every ratio both ways, each from a start of its own
            run = written(scene, name, form, per_row=(seed + i) % 2 == 0)
            assert alarms(scene, run) == [], (seed, ratio)


def soft_body(rng: np.random.Generator, hw: float) -> Scene:
    """A chain or a star of particles with friction, one of them at a wall; stiffnesses over 8 decades."""
    n = int(rng.integers(2, 6))
    m, ends = 10 ** rng.uniform(-1, 1, n), np.arange(n - 1)
    at = ends if rng.random() < 0.5 else 0 * ends
    terms: tuple[Term, ...] = (
        WallSpring(i=np.array([0]), k=np.ones(1), at=rng.normal(size=1)),
        Spring(a=at, b=ends + 1, k=10 ** rng.uniform(-2, 6, n - 1), rest=rng.uniform(0, 2, n - 1)),
        Damping(i=np.arange(n), c=m * 10 ** rng.uniform(-3, 2, n)),
    )
    made = clean.scene(m, terms, rng.normal(size=n), m * rng.normal(size=n), step=1.0, steps=200)
    w = float(np.sqrt(np.max(made.system.gershgorin(made.q) / m)))
    return replace(made, step=hw / w, quantities=("q", "p"))


@pytest.mark.parametrize("form", ["change of velocity", "positions first", "change of position"])
def test_cloth_and_position_based_dynamics_pass_on_soft_bodies(form: str) -> None:
    """From h omega of 20 on the change of velocity adds up what the neighbours' momenta do to the force;
    velocities taken from solved positions have noise that is no friction."""
    for seed in range(24):
        rng = np.random.default_rng([6, seed])
        scene = soft_body(rng, float(10 ** rng.uniform(0, 5)))
        assert alarms(scene, written(scene, "implicit-euler", form, per_row=seed % 2 == 0)) == [], seed


def test_a_single_stiff_spring_is_seen_as_well_as_before() -> None:
    """A stiffness off by 1e-13 shows at h omega of 1, by all the forms that engines write."""
    for name in forms.THETA:
        wall = WallSpring(i=np.array([0]), k=np.array([2.9]), at=np.zeros(1))
        one = np.ones(1)
        scene = clean.scene(
            3.7 * one, (wall,), 0.3 * one, 0.7 * one, step=float(np.sqrt(3.7 / 2.9)), steps=100
        )
        for form in WRITTEN:
            wrong = written(replace(scene, terms=(wall.scaled(1 + 1e-12),)), name, form)
            rebuilds = form in forms.REBUILDS
            assert alarms(scene, replace(wrong, energy=None, rebuilds_velocity=rebuilds)), (name, form)


@pytest.mark.parametrize("name", ["implicit-euler", "implicit-midpoint"])
def test_a_momentum_that_belongs_to_no_position_is_seen_below_what_the_solver_may_leave(name: str) -> None:
    """q' = q + x P/m has no force in it, and holds to the rounding of q however stiff the springs are."""
    stiff = WallSpring(i=np.arange(2), k=np.array([2.9, 1.7]), at=np.array([-6.5, 455.3]))
    start = np.array([-4.9, 455.4]), np.array([0.8, -0.7])
    scene = clean.scene(np.array([0.4, 0.9]), (stiff,), *start, step=7e3, steps=20)
    scene = replace(scene, quantities=("q", "p"))
    for form in WRITTEN:
        assert alarms(scene, written(scene, name, form)) == []
    run = written(scene, name, "textbook")
    p = run.p.copy()
    p[1, 1] *= 1 + 1e-9
    assert "step-defect" in {v.check for v in checks.judge(scene, replace(run, p=p)) if v.passed is False}


def test_positions_of_the_trapezoidal_rule_are_judged_by_the_momenta_at_both_ends() -> None:
    """q' = q + h (p + p')/2m holds to what the forces that p' adds up are rounded by, whatever A^-1 does."""
    rng, n = np.random.default_rng(3), 5
    ends = np.arange(n - 1)
    terms = (
        WallSpring(i=np.zeros(1, dtype=int), k=np.array([1.7]), at=np.zeros(1)),
        Spring(a=ends, b=ends + 1, k=1.7 * 10.0 ** np.array([0, 9, 1, 7]), rest=rng.uniform(0, 2, n - 1)),
    )
    m = 10 ** rng.uniform(-1, 1, n)
    scene = clean.scene(m, terms, rng.normal(size=n), rng.normal(size=n), step=9.0, steps=20)
    scene = replace(scene, quantities=("q", "p"))
    for form in WRITTEN:
        assert alarms(scene, written(scene, "trapezoidal", form)) == [], form
    run = written(scene, "trapezoidal", "textbook")
    case = checks.Case(trajectory=run, scene=scene)
    assert case.ahead is not None
    assert case.residual is not None
    alone, both = case.ahead.allowance[0], case.residual[1]
    frame, j = np.unravel_index(np.argmax(alone / both), both.shape)
    q = run.q.copy()
    q[frame + 1, j] += case.roundings * np.sqrt(float(alone[frame, j] * both[frame, j]))
    assert alone[frame, j] > 100 * both[frame, j]
    assert "step-defect" in {v.check for v in checks.judge(scene, replace(run, q=q)) if v.passed is False}
