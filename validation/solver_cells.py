"""The atlas of extreme cases for solvers that choose their own steps, as SUNDIALS' CVODE counts them.

Claim: no cell is silently wrong.  Each is a run of 20 outputs, judged by its end against the exact motion;
one that is off needs a reason: a state, a weight, a rate beyond CVODE's numbers, or a tolerance too tight.

Command: python validation/solver_cells.py [METHOD ...]       (default: every default method that is adaptive)

`validation/extreme.py` counts these cells among its own.

Printed: 560 cells: 474 right, 86 at an engine's limit; right for forces from 1e-200 to 1e300 by both methods.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from arguments import arguments, script
from cvode_steps import internal_steps
from springcheck import checks, engines
from springcheck.engines.contract import Label, Stopped
from springcheck.physics import exact
from springcheck.physics.scene import Scene
from springcheck.studies.extremes import grid, judging, measure
from springcheck.studies.extremes.grid import Spec
from springcheck.studies.extremes.judging import Cell, Outcome
from springcheck.studies.stability.propagators import MASS, STEP


def specs(*, quick: bool = False) -> list[Spec]:
    """Cells of adaptive solvers, each a run of its own: 20 outputs."""
    found: list[Spec] = []
    with np.errstate(over="ignore", under="ignore"):
        for decade, tolerance in itertools.product(
            (-300, -200, -150, -100, -30, -10, 0, 10, 30, 100, 150, 200, 300),
            (1e-3, 1e-6, 1e-9, 1e-12, 1e-15),
        ):
            q = 10.0**decade
            found.append(Spec(block="force", m=3.7, k=2.9, q=q, p=0.0, h=0.3, tolerance=tolerance))
        found += [x for x in grid.sizes() if x.finite][:: 4 if quick else 1]
        found += [x for x in grid.steps() if x.finite]
        found += [x for x in grid.special() if x.finite]
        for turn in grid.CELL_TURNS:
            k = MASS * (turn / STEP) ** 2
            found.append(Spec(block="turn", m=MASS, k=k, q=0.3, p=0.7, h=STEP))
    return [x for x in found if x.finite]


TIGHT = 1e-14
"""A tolerance below this asks a step of a solver for less than a hundred roundings."""


MOST = 20_000
"""Internal steps that a cell may take: a tenth of a second."""


def solve(label: Label, spec: Spec) -> Cell:
    """One cell by an adaptive solver, judged at its end."""
    scene = grid.scene([spec], frozenset())
    said, value, bound, whole, unmeasured = "", np.nan, np.nan, False, ""
    with np.errstate(all="ignore"):
        try:
            done = internal_steps(scene, engines.method(label), most=MOST)
        except Stopped as stop:
            said = f"; it says: {stop}"
        else:
            whole = abs(done.t) >= abs(scene.step * scene.steps)
            said = "" if whole else f"; {MOST} internal steps end at t = {done.t:.3g}"
            if whole:
                value, bound, unmeasured = _distance(label, scene, done)
        reason = _reason(scene, spec)
    outcome: Outcome = "silently wrong"
    why = f"off by {value:.3g} where {bound:.3g} is allowed"
    if whole and value <= bound:
        outcome, why = "right", ""
    elif reason or not whole:
        outcome, why = "engine's limit", (reason or "it gives up") + said
    elif unmeasured:
        outcome, why = "not measured", unmeasured
    return judging.cell(label, spec, outcome, why, value, bound, tolerance=spec.tolerance)


def _distance(label: Label, scene: Scene, done: Any) -> tuple[float, float, str]:
    """Global error at the end and its bound, over the initial energy norm, and why there are none."""
    q, p = np.stack([scene.q, done.q]), np.stack([scene.p, done.p])
    if scene.p[0] == 0 and (scene.q[0] == 0 or not np.any(scene.system.rigidity)):
        # nothing moves, and nothing may
        return float(np.abs(q[1, 0] - q[0, 0]) + np.abs(p[1, 0])), scene.tolerance * abs(float(q[0, 0])), ""
    ends = replace(scene, every=scene.steps)
    run = judging.as_trajectory(label, ends, q, p, engines.arithmetic(label))
    run = replace(run, tolerance=scene.tolerance, force_calls=done.force_calls)
    found = checks.tolerance(checks.Case(trajectory=run, scene=ends))
    return found.value, found.bound, found.why if found.passed is None else ""


def _reason(scene: Scene, spec: Spec) -> str | None:
    """What is outside of CVODE's numbers: a state, a weight, a rate, or a tolerance too tight."""
    low, high = judging.RANGES["double"]
    steps = np.arange(scene.steps + 1)
    q, p = exact.true_motion(scene, steps, scene.step)
    m, k = np.longdouble(spec.m), abs(np.longdouble(spec.k))
    h = abs(np.longdouble(spec.h))
    x, y = np.max(np.abs(q)), np.max(np.abs(p))
    if not max(x, y) <= high:
        return f"the motion itself leaves {high:.1e}"
    parts = [x, y, k * x, y / m, 1 / m, k, k / m, h, h * scene.steps, k * x * x, y * y / m]
    parts += [part * spec.tolerance for part in (x, y)]
    parts += [1 / (part * spec.tolerance) for part in (x, y) if part > 0]
    # the weighted norm squares rates over weights
    parts += [(k * x / (y * spec.tolerance)) ** 2 if y > 0 else np.longdouble(0)]
    parts += [(y / m / (x * spec.tolerance)) ** 2 if x > 0 else np.longdouble(0)]
    sizes = np.array([part for part in parts if part > 0], dtype=np.longdouble)
    if sizes.size and np.max(sizes) > high:
        return f"its right-hand side or its weighted norm forms numbers beyond {high:.1e}"
    if sizes.size and np.min(sizes) < low:
        return f"its right-hand side or its weights are below {low:.1e}"
    if spec.tolerance < TIGHT:
        return f"a tolerance of {spec.tolerance:g} a step is too tight for double precision"
    return None


def cells(methods: Sequence[str] = (), *, quick: bool = False) -> list[Cell]:
    """Cells of every adaptive method that these labels or globs name."""
    labels = engines.match(tuple(methods) or ("*",))
    return [solve(label, spec) for label in labels if _serves(label) for spec in specs(quick=quick)]


def _serves(label: Label) -> bool:
    method = engines.method(label)
    springs = "particles" in method.kinds and "wall-spring" in method.terms
    return method.adaptive and springs and not engines.absence(label.engine)


def main() -> int:
    """Print how many cells came out how, and windows of force; 1 where a cell is silently wrong."""
    found = cells(arguments(__doc__, methods=list[str]()).methods)
    wrong = [cell for cell in found if cell.outcome == "silently wrong"]
    print(f"{len(found)} cells: {dict(Counter(cell.outcome for cell in found))}")
    for window in measure.windows(found):
        print(window.sentence)
    for cell in wrong:
        print(f"silently wrong: {cell}")
    return int(bool(wrong) or not found)


if __name__ == "__main__":
    script(main)
