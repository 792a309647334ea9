"""Bugs that users of simulators reported, rebuilt as steppers: the first sentence names the cause.

Each case quotes the thread that it is taken from.  `step(q, p, h, force, mass)` is what the code did, on one
particle; it is driven as `springcheck identify --stepper` drives it, or recorded over one spring.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import identify_strange
from springcheck.identify import identify, identify_stepper, record
from springcheck.identify.fit import fit
from springcheck.identify.judged import judged

Stepper = Callable[..., tuple[Any, Any]]
M, K, H = 3.7, 2.9, 0.1


def halves_swapped(q, p, h, force, mass):
    """headmyshoulder/odeint-v2#150."""
    a = force(q) / mass
    q = q + h / 2 * p / mass + h * h * a
    return q, p + h / 2 * (a + force(q) / mass) * mass


def half_drift(q, p, h, force, mass):
    """erf-model/ERF#3594."""
    p = p + h / 2 * force(q)
    q = q + h / 2 * p / mass
    return q, p + h / 2 * force(q)


def decayed(q, p, h, force, mass):
    """chaos-polymtl/lethe#2082: velocity Verlet had become the symplectic Euler method."""
    p = p + h * force(q)
    return q + h * p / mass, p


def not_symplectic(q, p, h, force, mass):
    """SciML/OrdinaryDiffEq.jl#577: SymplecticEuler was the explicit one; openai/gym#907 and #1018."""
    return q + h * p / mass, p + h * force(q)


def absolute_step(q, p, h, force, mass):
    """ben-cassese/jorbit#85: abs(dt)."""
    h = abs(h)
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return q, p + h / 2 * force(q)


def fourth_from_second(q, p, h, force, mass):
    """f1tenth/f1tenth_gym#52: the fourth stage took the second's slope instead of the third's."""
    k1 = p / mass, force(q)
    k2 = (p + h / 2 * k1[1]) / mass, force(q + h / 2 * k1[0])
    k3 = (p + h / 2 * k2[1]) / mass, force(q + h / 2 * k2[0])
    k4 = (p + h * k2[1]) / mass, force(q + h * k2[0])
    return tuple(x + h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]) for i, x in enumerate((q, p)))


def equal_weights(q, p, h, force, mass):
    """GeomScale/volesti#375: the stages' weights were wrong."""
    k1 = p / mass, force(q)
    k2 = (p + h / 2 * k1[1]) / mass, force(q + h / 2 * k1[0])
    k3 = (p + h / 2 * k2[1]) / mass, force(q + h / 2 * k2[0])
    k4 = (p + h * k3[1]) / mass, force(q + h * k3[0])
    return tuple(x + h / 4 * (k1[i] + k2[i] + k3[i] + k4[i]) for i, x in enumerate((q, p)))


def implicit_velocity_only(q, p, h, force, mass):
    """gbionics/jaxsim#68: an implicit velocity, but the position moved by the old one."""
    k = -force(1.0)
    new = (p + h * force(q)) / (1 + h * h * k / mass)
    return q + h * p / mass, new


def mean_velocity(q, p, h, force, mass):
    """bulletphysics/bullet3#1446, proposed there: P += (Vi + Vf) / 2."""
    new = p + h * force(q)
    return q + h * (p + new) / 2 / mass, new


def old_force(q, p, h, force, mass):
    """Both half kicks of velocity Verlet with the force of the old position."""
    f = force(q)
    p = p + h / 2 * f
    return q + h * p / mass, p + h / 2 * f


def loses_energy(q, p, h, force, mass):
    """dartsim/dart#846 and phys-sim-book/solid-sim-tutorial#2: a spring without damping that decays."""
    a = h * h * -force(1.0) / mass
    return (q + h * p / mass) / (1 + a), (p + h * force(q)) / (1 + a)


def friction_added(q, p, h, force, mass):
    """slembcke/Chipmunk2D#248: the damping is added instead of subtracted."""
    p = p + h * (force(q) + 0.1 * p / mass)
    return q + h * p / mass, p


def massless(q, p, h, force, mass):
    p = p + h / 2 * force(q)
    q = q + h * p
    return q, p + h / 2 * force(q)


def velocity_is_momentum(q, p, h, force, mass):
    p = p + h / 2 * force(q) / mass
    q = q + h * p
    return q, p + h / 2 * force(q) / mass


def kcal(q, p, h, force, mass):
    """openmm/openmm#1486, a comment: kJ to kcal as 4.814; here forces in kcal taken for kJ."""
    f = lambda x: force(x) / 4.184  # noqa: E731
    p = p + h / 2 * f(q)
    q = q + h * p / mass
    return q, p + h / 2 * f(q)


def drag_by_default(q, p, h, force, mass):
    """Users of pybullet: energy is lost although no damping was asked for (0.04 a second by default)."""
    p = (p + h * force(q)) * (1 - 0.04 * h)
    return q + h * p / mass, p


def one_fixed_point(q, p, h, force, mass):
    """Implicit Euler by a single fixed-point iteration."""
    new = q + h * p / mass
    p = p + h * force(new)
    return q + h * p / mass, p


def reciprocal(q, p, h, force, mass):
    """ThomasLengeling/traerphysics#2: divides by the step instead of multiplying."""
    p = p + force(q) / h
    return q + p / mass / h, p


STEPPERS: dict[str, tuple[Stepper, str]] = {
    "halves swapped": (halves_swapped, r"halves swapped|h/2 v \+ h"),
    "drift of half a step": (half_drift, "drift of half|drift.* 0.5 "),
    "Verlet decayed to symplectic Euler": (decayed, "semi-implicit Euler"),
    "SymplecticEuler was Euler": (not_symplectic, "explicit Euler"),
    "abs(dt)": (absolute_step, "sign of the step"),
    "fourth stage from the second": (fourth_from_second, "RK4.*stage"),
    "equal weights": (equal_weights, "RK4.*weights"),
    "implicit velocity, old position": (implicit_velocity_only, "implicit.*old velocity"),
    "mean velocity": (mean_velocity, "old force|held"),
    "old force in the second half kick": (old_force, "old force|held"),
    "energy lost without damping": (loses_energy, "implicit Euler"),
    "friction added": (friction_added, "negative friction|friction.*wrong sign"),
    "mass left out": (massless, "mass is left out"),
    "p treated as a velocity": (velocity_is_momentum, "treated as a velocity"),
    "kcal": (kcal, "kcal"),
    "drag by default": (drag_by_default, "friction"),
    "one fixed-point iteration": (one_fixed_point, "fixed-point|old velocity|not solved"),
    "divided by the step": (reciprocal, "step taken is 1/h"),
}
RIGHT = {"Verlet decayed to symplectic Euler", "SymplecticEuler was Euler", "energy lost without damping"}
"""The bug is the scheme itself: it fits, and its name is the diagnosis."""


@pytest.mark.parametrize("name", STEPPERS)
def test_the_first_sentence_names_the_cause(name: str) -> None:
    stepper, words = STEPPERS[name]
    found = identify_stepper(stepper)
    assert re.search(words, found.statement, re.IGNORECASE), (found.statement, found.notes)
    assert found.fits == (name in RIGHT)


def run(stepper: Stepper, frames: int = 401) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    states = [(0.3, 0.7)]
    for _ in range(frames - 1):
        states.append(stepper(*states[-1], H, lambda q, p=0.0: -K * q, M))
    q, p = np.array(states).T
    return H * np.arange(frames), q, p


def right(q, p, h, force, mass):
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return q, p + h / 2 * force(q)


def lagging(t, q, p):
    """NVIDIA-Omniverse/PhysX#308: a lag in the velocity compared to the position."""
    return t, q[1:], p[:-1]


def half_step_late(t, q, p):
    """openmm/openmm#1474 and #4929: velocities are half a step from the positions."""
    return t, q, p + H / 2 * K * q


def doubled_time(t, q, p):
    """OPALX-project/OPAL#1375: the time is doubled."""
    return 2 * t, q, p


def missing(t, q, p):
    return t[:-1], np.delete(q, 272), np.delete(p, 272)


def repeated(t, q, p):
    return t, np.r_[q[:101], q[100:-1]], np.r_[p[:101], p[100:-1]]


def degrees(t, q, p):
    return t, np.degrees(q), p


RECORDS: dict[str, tuple[Callable, str]] = {
    "velocity one step behind": (
        lagging,
        "velocit.* (one|a) (step|frame) (behind|late|early)|one frame behind",
    ),
    "velocities half a step early": (half_step_late, "half a step early"),
    "time doubled": (doubled_time, "times are 2 times"),
    "a frame is missing": (missing, "frame 27[12].*missing|missing.*frame 27[12]"),
    "a step is repeated": (repeated, "repeated at frame 10[01]|frame 10[01].*repeat"),
    "degrees": (degrees, "degrees|57.29"),
}


@pytest.mark.parametrize("name", RECORDS)
def test_a_wrong_record_of_a_right_motion_is_told_as_that(name: str) -> None:
    change, words = RECORDS[name]
    t, q, p = change(*run(right))
    found = identify(t[: len(q)], q, p, mass=M, stiffness=K)
    assert re.search(words, found.statement, re.IGNORECASE), (found.statement, found.notes)


def test_no_explanation_is_without_a_remedy() -> None:
    for name in ("halves swapped", "mass left out", "friction added", "drag by default"):
        stepper, _ = STEPPERS[name]
        found = identify_stepper(stepper).explanations
        assert found
        for one in found:
            assert one.cause
            assert one.remedy
            assert math.isfinite(one.misfit)


def test_a_trajectory_that_failed_says_what_its_states_are() -> None:
    import springcheck
    from springcheck.identify.files import sentence

    scene = springcheck.load_scene("spring")
    for label, begins in (("own:euler", "Explicit Euler"), ("own:semi-implicit-euler", "Semi-implicit")):
        right = springcheck.simulate(scene, label)
        assert sentence(dataclasses.replace(right, scheme="rk4"), scene.m).startswith(begins)
        # that the states are of the scheme which they failed to be explains nothing
        assert sentence(right, scene.m) == ""


def test_a_failed_verdict_says_where_and_what_the_states_show(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import springcheck
    from springcheck.engines.own import simulation
    from springcheck.identify import files
    from springcheck.studies.run import measure

    scene, start = springcheck.load_scene("spring-uneven"), simulation.start
    path = tmp_path / "run.h5"

    def asked(*_: object, **__: object) -> str:
        raise AssertionError("a run that passes pays nothing")

    with monkeypatch.context() as patch:
        patch.setattr(files, "sentence", asked)
        measure.run(scene, path, methods=["own:velocity-verlet"])

    def longer(scene, method, label, step):  # type: ignore[no-untyped-def]
        return start(scene, method, label, step * (1 + 1e-9))

    monkeypatch.setattr(simulation, "start", longer)
    report = measure.run(scene, path, methods=["own:velocity-verlet"], force=True)
    failed = next(v for v in report.verdicts if v.check == "step-defect")
    assert failed.passed is False
    assert "the first of 200 frames off is at step 1." in failed.why
    assert "What the states show: Velocity Verlet, but times are not what was stepped: " in failed.why
    assert "longer than theirs by 1e-09 of it" in failed.why
    assert failed in measure.stored(path).verdicts


def test_one_bad_frame_is_found_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import springcheck
    from springcheck.engines.own.simulation import Own
    from springcheck.studies.run import measure

    advance = Own.advance
    before = 0

    def wrong(self: Own, every: int, q: Any, p: Any) -> None:
        nonlocal before
        advance(self, every, q, p)
        if before <= 136 < before + len(p):
            p[136 - before] *= 1 + 1e-6
        before += len(p)

    monkeypatch.setattr(Own, "advance", wrong)
    scene = springcheck.load_scene("spring-uneven")
    report = measure.run(scene, tmp_path / "run.h5", methods=["own:position-verlet"])
    failed = next(v for v in report.verdicts if v.check == "step-defect")
    assert failed.passed is False
    assert "the first of 2 frames off is at step 137." in failed.why, failed.why
    whose = "Position Verlet or Implicit midpoint"
    assert f"The motion is one of {whose}, but frame 137 is wrong: its velocity" in failed.why, failed.why


@pytest.mark.parametrize(("sign", "word"), [(1, "before"), (-1, "after")])
def test_a_restart_from_velocities_of_half_a_step_before_is_named(sign: int, word: str) -> None:
    """ClickFF/MAPLE#47, openmm/openmm#4948."""
    frame = iter(range(121))

    def restarted(q, p, h, force, mass, share=1.0):  # type: ignore[no-untyped-def]
        q, p = right(q, p, h, force, mass)
        return q, p - share * sign * h / 2 * force(q) if next(frame) == 59 else p

    found = identify(*run(restarted, 121), mass=M, stiffness=K)
    assert f"from frame 60 on its velocity is that of half a step {word}" in found.statement
    frame = iter(range(121))
    found = identify(*run(partial(restarted, share=0.9), 121), mass=M, stiffness=K)
    assert "but for one kick of" in found.statement
    assert "at frame 60" in found.statement


def test_a_motion_forwards_at_falling_times_is_told_from_velocities_of_the_wrong_sign() -> None:
    """ben-cassese/jorbit#85, recorded with the times that were asked for."""
    t, q, p = run(right, 121)
    assert identify(-t, q, p, mass=M, step=-H).statement.startswith(
        "The motion runs forwards while its times"
    )
    assert identify(t, q, -p, mass=M).statement.startswith("The velocities of all coordinates have the wrong")


@pytest.mark.parametrize("friction", [0.4, None])
def test_an_implicit_friction_of_the_wrong_sign_is_told_by_the_stated_stiffness(
    friction: float | None,
) -> None:
    """google-deepmind/mujoco_warp#1662, with a joint's friction in place of the Coriolis force."""
    c = 0.4

    def subtracted(q, p, h, force, mass):  # type: ignore[no-untyped-def]
        p = p + h * (force(q) - c * p / mass) / (1 - h * c / mass)
        return q + h * p / mass, p

    t, q, p = run(subtracted, 121)
    found = identify(t, q, p, mass=M, stiffness=K, friction=friction)
    assert not found.fits
    assert "implicit friction of the wrong sign" in found.statement
    # another friction is not that fault, and neither is a spring that is as stiff as it looks
    assert "wrong sign" not in identify(t, q, p, mass=M, stiffness=K, friction=2 * c).statement
    assert identify(t, q, p, mass=M, stiffness=K / (1 - H * c / M)).fits


def test_positions_that_all_lie_on_one_number_are_explained_without_a_warning() -> None:
    """A wall 1e9 away: the momentum moves, and the position stands still by a fault."""
    far = 1e9

    def held(q, p, h, force, mass):  # type: ignore[no-untyped-def]
        p = p + h / 2 * force(q)
        return q, p + h / 2 * force(q + h * p / mass)

    q, p, states = far + 1e-5, 0.0, []
    for _ in range(201):
        states.append((q, p))
        q, p = held(q, p, H, lambda x: -K * (x - far), M)
    found = identify(H * np.arange(201), *np.array(states).T, mass=M, stiffness=K)
    assert not found.fits
    assert "velocity" in found.statement


def test_states_that_follow_no_map_are_not_conditioned_however_well_they_span_their_plane() -> None:
    """Else they would be one more oscillator whose map is known, and not what is wrong beside a clean one."""
    rng, h, k, m = np.random.default_rng(7), 0.13, 2.3, 1.7
    q, v = rng.normal(size=(2, 60, 2))
    for i in range(59):
        v[i + 1, 0] = v[i, 0] - h * k / m * q[i, 0]
        q[i + 1, 0] = q[i, 0] + h * v[i + 1, 0]
    found = record.read(h * np.arange(60), q, None, v=v, mass=[m, m])
    clean, scattered = (fit(found, j) for j in range(2))
    assert clean.conditioned
    assert scattered.spans
    assert not scattered.conditioned
    assert judged(found, None, None, None).moving[0] == 1


@pytest.mark.parametrize("form", ["velocities", "single precision", "momenta", "wrong kicks"])
def test_a_stated_stiffness_of_0_is_another_spring(form: str) -> None:
    """It was divided by."""
    rows, q, v = [(1.0, 0.6)], 1.0, 0.6
    for _ in range(60):
        old = v - 0.05 * q / 3
        q, v = q + 0.1 * old, old - 0.05 * q / 3
        if form != "wrong kicks":
            v = old - 0.05 * q / 3
        rows.append((q, v))
    q_, v_ = np.array(rows).T
    if form == "single precision":
        q_, v_ = (x.astype(np.float32).astype(float) for x in (q_, v_))
    states: dict[str, Any] = {"p": v_} if form == "momenta" else {"v": v_, "mass": 3.0}
    found = identify(0.1 * np.arange(61), q_, stiffness=0.0, **states)
    assert not found.fits
    if form == "wrong kicks":
        assert "old force" not in found.statement
    else:
        assert found.explanations[0].cause.endswith("where 0 is stated")


@pytest.mark.parametrize("k", [1.0, 0.09])
def test_velocities_of_the_wrong_sign_give_no_frequency(k: float) -> None:
    """The motion turned round was read as one of 40 times the frequency, and that stood beside the cause."""
    q, v, h, frames = 1.0, 0.3, 0.1, []
    for _ in range(60):
        frames.append((q, v))
        v -= h / 2 * k * q
        q += h * v
        v -= h / 2 * k * q
    q, v = np.array(frames).T
    found = identify(h * np.arange(60), q, v=-v, mass=1.0)
    assert "wrong sign" in found.statement
    assert np.isnan(found.omega).all()
    assert found.stiffness is None
    assert found.nearest is None


# 60 to 3526 ended in an exception of NumPy or SciPy
STRANGE = (
    *range(10), 60, 214, 602, 970, 1148, 1216, 1438, 1546, 1679, 1874, 2021, 2026, 2300, 3293, 3413, 3526,
)  # fmt: skip


@pytest.mark.parametrize("number", STRANGE)
def test_whatever_is_recorded_is_answered_or_refused(number: int) -> None:
    assert identify_strange.said(number) in ("answered", "refused")


def test_a_position_that_stands_still_is_told_alone_and_beside_others() -> None:
    found = identify_stepper(lambda q, p, h, force, mass: (q, p + h * force(q)))
    assert "the position by 0 h p/m" in found.statement
    beside = identify(**identify_strange.drawn(1216))
    assert (beside.scheme, beside.fits, beside.candidates) == (None, False, ())


def test_a_state_that_changes_once_and_stands_still_after_is_told() -> None:
    """Without its first frame nothing moves, and no map is fitted to that."""
    q, v = np.full(15, 1.9), np.full(15, -0.5)
    q[0], v[0] = 2.1, -0.3
    found = identify(0.3 * np.arange(15), q, v=v, mass=1.3)
    assert not found.fits


def test_two_runs_in_one_file_are_said_to_be_two() -> None:
    """The second begins at the start again; it was called a restart from numbers of 1 digit."""
    _, q, p = run(right, 120)
    found = identify(H * np.arange(240), np.tile(q, 2), np.tile(p, 2), mass=M, stiffness=K)
    assert "between frames 119 and 120, as where another run begins" in found.statement
