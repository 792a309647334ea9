"""Stiff cells: a soft and a stiff spring in one chain, stepped for the soft one.

Only the slow mode moves at the start.  A method of fixed step is judged by its steps against its scheme's
own, and may grow where theory says so.  One that chooses its steps is judged by its error.  Its force calls
grow with the root of the stiffness ratio where it follows the stiff spring; a ratio at which they would be
too many is not run.
"""

from __future__ import annotations

import numpy as np

from springcheck import checks, driver, engines, schemes
from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics import exact
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.extremes.grid import MOST_CALLS, RATIOS, Spec
from springcheck.studies.extremes.judging import Cell, cell
from springcheck.studies.stability.longest import longest

H_W, STEPS, TOLERANCE, MOST_ERROR = 0.1, 40, 1e-6, 1e-3
"""h w of the soft spring, steps, the tolerance of solvers, and their largest error that counts as right."""

M, SOFT = np.array([1.3, 0.9]), 1.7


def scene(ratio: float) -> Scene:
    """The chain at this ratio of stiffnesses."""
    wall = WallSpring(i=np.array([0]), k=np.array([SOFT]), at=np.zeros(1))
    stiff = Spring(a=np.array([0]), b=np.array([1]), k=np.array([ratio * SOFT]), rest=np.zeros(1))
    h = H_W / float(np.sqrt(SOFT / np.sum(M)))
    # the slow mode: the stiff spring is stretched as far as it accelerates the second mass
    slow = np.array([1.0, 1.0 + M[1] / np.sum(M) / ratio])
    return Scene(
        m=M, q=0.3 * slow, p=0.4 * M * slow, terms=(wall, stiff), step=h, steps=STEPS, name="stiff",
        tolerance=TOLERANCE, quantities=("q", "p"),
    )  # fmt: skip


def cells(label: Label) -> list[Cell]:
    """A cell for each ratio; none where the method does not serve such a chain."""
    if engines.refusal(scene(1.0), label):
        return []
    found: list[Cell] = []
    calls: list[int] = []
    for ratio in RATIOS:
        here = scene(ratio)
        spec = Spec(
            block="stiff", m=float(M[1]), k=ratio * SOFT, q=0.3, p=0.4, h=here.step, steps=STEPS,
            tolerance=TOLERANCE,
        )  # fmt: skip
        grown = calls[-1] / calls[-2] if len(calls) > 1 else 0.0
        if engines.method(label).adaptive and grown > 2 and calls[-1] * grown > MOST_CALLS:
            calls.append(round(calls[-1] * grown))
            reason = f"about {calls[-1]:.0e} force calls: it follows the stiff spring"
            found.append(cell(label, spec, "engine's limit", reason))
            continue
        try:
            run = driver.run(here, label)
        except MethodError as error:
            found.append(cell(label, spec, "engine's limit", f"it refuses: {error}"))
            continue
        calls.append(max(1, run.force_calls))
        found.append(_judged(label, spec, here, run))
    return found


def _judged(label: Label, spec: Spec, here: Scene, run: Trajectory) -> Cell:
    method = engines.method(label)
    with np.errstate(all="ignore"):
        if method.adaptive:
            q, _ = exact.true_motion(here, np.array([STEPS]), here.step)
            lost = run.outcome.status != "complete"
            error = np.inf if lost else float(np.max(np.abs(run.q[-1] - q[0]) / np.max(here.q)))
            if lost:
                return cell(label, spec, "engine's limit", run.outcome.message)
            right = error <= MOST_ERROR
            return cell(label, spec, "right" if right else "silently wrong", f"error {error:.1e}", error)
        limit = longest(schemes.scheme(method.scheme), here)
        grown = run.outcome.status != "complete" or np.max(np.abs(run.q)) > 10
        verdict = checks.step_defect(checks.Case(trajectory=run, scene=here))
    if verdict.passed is False:
        return cell(label, spec, "silently wrong", verdict.reason, verdict.value, verdict.bound)
    if grown and limit < here.step:
        reason = f"the step is {here.step / limit:.0e} times the limit" if limit else "no step is stable"
        return cell(label, spec, "unstable, as theory says", reason, verdict.value, verdict.bound)
    if grown:
        return cell(label, spec, "silently wrong", "it grows, and theory does not say so", verdict.value)
    return cell(label, spec, "right", "", verdict.value, verdict.bound)
