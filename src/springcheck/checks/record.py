"""Facts of the record, to the bit: the start, the times, the grid and the energies."""

from __future__ import annotations

import numpy as np

from springcheck.checks.case import REPEATED, Case, too_strong
from springcheck.checks.check import Finding, check
from springcheck.physics import exact
from springcheck.physics.arrays import AS_WRITTEN
from springcheck.physics.trajectory import Trajectory
from springcheck.text.wording import count


@check("start", family="record", requires={"start"})
def start(case: Case) -> Finding:
    """The first frame is the initial state, exactly or rounded once to the precision of the file."""
    run, scene = case.trajectory, case.scene
    off = np.abs([run.q[0] - scene.q, run.p[0] - scene.p])
    recorded = run.arithmetic.name == AS_WRITTEN and not run.arithmetic.is_double
    # momenta that are made of velocities have two roundings of a double more
    most = (run.arithmetic.state + 2.0**-51) * recorded * np.abs([scene.q, scene.p])
    worst = np.unravel_index(np.argmax(off - most), off.shape)
    return Finding(float(off[worst]), float(most[worst]), "", "the start is recorded, not computed")


@check("times", family="record")
def times(case: Case) -> Finding:
    """Times are n h, rounded once, up to the stated end of the run."""
    run = case.trajectory
    off = np.abs(run.t - case.steps * run.step)
    missing = abs(float(case.steps[-1]) - run.outcome.step) * abs(run.step)
    value = float(np.max([*off, missing]))
    return Finding(value, 0.0, "T", "one product, no accumulation; the last frame is the end")


@check("grid", family="record")
def grid(case: Case) -> Finding:
    """Step, frames, quantities and tolerance are those of the scene."""
    run, scene = case.trajectory, case.scene
    wrong = []
    if run.step != scene.step:
        wrong.append(f"the step is {run.step:g} instead of {scene.step:g}")
    if run.every != scene.every:
        wrong.append(f"frames are {count(run.every, 'step')} apart instead of {scene.every}")
    if case.law.has("adaptive") and run.tolerance != scene.tolerance:
        wrong.append(f"the tolerance is {run.tolerance} instead of {scene.tolerance:g}")
    if run.energy is None and "energy" in scene.quantities:
        wrong.append("there are no energies")
    wrong += beyond(run)
    if run.outcome.status == "continued" and not case.piece:
        wrong.append("it is a piece of a run that goes on")
    last, asked = int(case.steps[-1]), (scene.frames - 1) * scene.every
    status = run.outcome.status
    if last > asked or (status == "complete" and last != asked):
        wrong.append(f"{last} of {count(asked, 'step')}, and the run is called {status}")
    elif status in ("stopped", "diverged") and not (
        case.law.has("random") or _gives_up(case) or _ends_beyond(case)
    ):
        wrong.append(f"{status} after {last} of {count(asked, 'step')} for no reason that is known here")
        if status == "stopped" and run.outcome.message:
            wrong[-1] += f"; the engine says: {run.outcome.message}"
    why = "; ".join(wrong) or "every fact of the grid is the scene's own"
    if not wrong and run.outcome.fastest < np.inf:
        why += f"; the next step would exceed its declared limit of speed, {run.outcome.fastest:g}"
    return Finding(len(wrong), 0.0, "facts", why)


MOST_DECLARED = {
    "state": (2.0**-20, "single precision of positions stored with an origin 16 times as far away"),
    "force": (2.0**-20, "single precision with 16 roundings is the coarsest force of any engine known"),
    "quantum": (2.0**-32, "the unit of 64-bit fixed point, half of it behind the point"),
    "excess": (2.0**-31, "2**32 for 2**32 - 1 in 64-bit fixed point"),
    "cancels": (2, "a difference of 1 and what is itself taken from a difference"),
}
"""The coarsest arithmetic that an engine may declare, and why: bounds follow from it, and a coarser one would
excuse any force."""

MOST_REBUILT = (2.0**-24, "single precision is the coarsest known to rebuild velocities")
"""The same for `state` where velocities are differences of positions, whose roundings they have over h."""


def beyond(run: Trajectory) -> list[str]:
    """The parts of a declared arithmetic that are coarser than any known one."""
    how, most_declared = run.arithmetic, MOST_DECLARED
    if run.rebuilds_velocity and not how.keeps_displacement:
        most_declared = most_declared | {"state": MOST_REBUILT}
    return [
        f"the engine declares {name} = {value:.3g} of its arithmetic, and at most {most:.3g} is taken: {why}"
        for name, (most, why) in most_declared.items()
        # decimals of a file are read off it, and not declared
        if not 0 <= (value := getattr(how, name)) <= most and (name, how.name) != ("state", AS_WRITTEN)
    ]


def _gives_up(case: Case) -> bool:
    """Whether the engine may give up, and says why: a solver that cannot meet its tolerance of a step."""
    outcome, solves = case.trajectory.outcome, not case.law.has("one-step")
    return solves and outcome.status == "stopped" and bool(outcome.message)


HALF_RANGE, SINGLE_RANGE = (float(np.sqrt(np.finfo(x).max)) for x in (np.float64, np.float32))
"""Sizes from which a product of two numbers of a step may leave the range of a double, or of a number of
single precision, as the squared length of a bond does."""


def _ends_beyond(case: Case) -> bool:
    """Whether the motion itself comes near the engine's overflow between the last frame and the next, or to
    its declared limit of speed, which no frame has exceeded."""
    run, scene = case.trajectory, case.judged
    q, p = (x[-1:].astype(np.longdouble) for x in (run.q, run.p))
    limit = SINGLE_RANGE if run.arithmetic.force >= np.finfo(np.float32).eps / 2 else HALF_RANGE
    limit = min(limit, run.arithmetic.overflow)
    if not case.law.has("one-step"):
        if not exact.has_true_motion(case.scene):
            return True
        ends = exact.true_motion(case.scene, case.steps[-1:] + run.every, run.step)
        return not max(float(np.max(np.abs(x))) for x in (*ends, q, p)) <= limit
    kept = bool(np.max(np.abs(run.p / scene.m)) <= run.outcome.fastest)
    for step in range(min(run.every, REPEATED) + 1):
        sizes = scene.system.magnitude(None if case.system.is_linear else q)
        largest = max(float(np.max(np.abs(x))) for x in (q, p, p / scene.m, sizes(np.abs(q), np.abs(p))))
        slow = np.max(np.abs(p / scene.m)) < OF_FASTEST * run.outcome.fastest
        if not largest <= limit or (kept and step and not slow):
            return True
        q, p = case.step(q, p)
    return False


OF_FASTEST = 0.998
"""Part of a declared limit of speed to which a step comes that may exceed it: engines in single precision
stop at 0.999 of it, so as not to take a speed that was cut down to the limit for the scheme's own."""


@check("line", family="record", requires={"three-dimensions"})
def line(case: Case) -> Finding:
    """Nothing moves along the axes that the scene leaves out, exactly."""
    off = case.trajectory.off_axis
    assert off is not None
    # of a start whose forces overflow there may be no second frame, whose step would tell it
    limit = too_strong(case) if off else ""
    return Finding(abs(off), 0.0, "L", limit or "every force along another axis is a product with 0")


@check("energy", family="record", requires={"energies"})
def energies(case: Case) -> Finding:
    """Stored energies are those of the stored states, bit for bit."""
    run = case.trajectory
    assert run.energy is not None
    again = np.asarray(case.scene.system.energy(run.q, run.p), np.float64)
    stored = np.asarray(run.energy, np.float64)
    same = (again == stored) | (np.isnan(again) & np.isnan(stored))
    # the energy of finite states may overflow; states that are no numbers have none
    same &= np.isfinite(run.q).all(axis=1) & np.isfinite(run.p).all(axis=1)
    value = float(np.count_nonzero(~same))
    return Finding(value, 0.0, "frames", "one formula, one order of operations")
