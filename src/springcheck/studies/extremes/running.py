"""Running cells: many of one step in one run, as far as an engine that gives up lets them; those of adaptive
solvers one by one, each judged by its end against the exact motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from springcheck import checks, engines
from springcheck.engines.contract import Label, Stopped
from springcheck.errors import MethodError
from springcheck.physics import exact
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.studies.extremes import grid, judging
from springcheck.studies.extremes.grid import Spec
from springcheck.studies.extremes.judging import Cell, Outcome


def raw(scene: Scene, label: Label) -> tuple[Floats, Floats, str]:
    """Every frame as the engine leaves it, the start first, finite or not, and what it said if it stopped.

    The driver ends a run at the first number that is not finite; here that is one cell among many.
    """
    with np.errstate(all="ignore"):
        started = engines.load(label.engine).start(scene, engines.method(label), label, scene.step)
        q, p = np.empty((scene.frames, scene.n)), np.empty((scene.frames, scene.n))
        q[0], p[0] = scene.q, scene.p
        try:
            started.advance(scene.every, q[1:], p[1:])
        except Stopped as stop:
            return q[: stop.rows + 1], p[: stop.rows + 1], str(stop)
    return q, p, ""


def cells(label: Label, specs: Sequence[Spec]) -> list[Cell]:
    """Run and judge cells of one step and one length, in as few runs as the engine allows."""
    requires = engines.method(label).requires
    scene = grid.scene(list(specs), label, requires)
    try:
        q, p, said = raw(scene, label)
    except MethodError as error:
        return [judging.cell(label, spec, "engine's limit", f"it refuses: {error}") for spec in specs]
    found = judging.judge(label, specs, scene, q, p, said)
    if len(specs) == 1:
        return found
    if stale := engines.arithmetic(label).stale:
        # in company of a larger motion an engine computes forces anew that it would keep for the cell alone
        with np.errstate(invalid="ignore"):
            # a state that has left all numbers is not slow
            slow = np.any(np.abs(np.diff(q, axis=0)) <= 2 * stale, axis=0)
        found = [
            cells(label, [spec])[0] if alone else cell
            for spec, cell, alone in zip(specs, found, slow, strict=True)
        ]
    if not said:
        return found
    # the engine gave up over some: those that had left its numbers are done, the others run again
    over = [x.outcome not in ("silently wrong", "right") and bool(x.reason) for x in found]
    if not any(over) or all(over):
        half = len(specs) // 2
        return cells(label, specs[:half]) + cells(label, specs[half:])
    rest = iter(cells(label, [spec for spec, done in zip(specs, over, strict=True) if not done]))
    return [cell if done else next(rest) for cell, done in zip(found, over, strict=True)]


TIGHT = 1e-14
"""A tolerance below this asks a step of a solver for less than a hundred roundings."""


MOST = 20_000
"""Internal steps that a cell may take: a tenth of a second."""


def solve(label: Label, spec: Spec) -> Cell:
    """One cell by an adaptive solver, judged at its end."""
    scene = grid.scene([spec], label, frozenset())
    solver = engines.internal_steps(label)
    said, value, bound, whole, unmeasured = "", np.nan, np.nan, False, ""
    with np.errstate(all="ignore"):
        try:
            done = solver(scene, engines.method(label), most=MOST)
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
