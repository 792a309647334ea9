"""Runs of cells: many of one step in one run, as far as an engine that stops allows it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from springcheck import engines
from springcheck.engines.contract import Label, Stopped
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.studies.extremes import grid, judging
from springcheck.studies.extremes.grid import Spec
from springcheck.studies.extremes.judging import Cell


def raw(scene: Scene, label: Label) -> tuple[Floats, Floats, Stopped | None]:
    """Every frame as the engine left it, from the start on, finite or not, and how the engine stopped, if it
    did: the frame that it did not reach is then the last, NaN.

    The driver ends a run at the first non-finite number; here that is one cell among many.
    """
    with np.errstate(all="ignore"):
        started = engines.load(label.engine).start(scene, engines.method(label), label, scene.step)
        q, p = np.full((scene.frames, scene.n), np.nan), np.full((scene.frames, scene.n), np.nan)
        q[0], p[0] = scene.q, scene.p
        try:
            started.advance(scene.every, q[1:], p[1:])
        except Stopped as stop:
            q[stop.rows + 1 :] = p[stop.rows + 1 :] = np.nan
            return q[: stop.rows + 2], p[: stop.rows + 2], stop
    return q, p, None


def cells(label: Label, specs: Sequence[Spec]) -> list[Cell]:
    """Run and judge cells of one step and one length, in as few runs as the engine allows."""
    half = len(specs) // 2
    scene = grid.scene(list(specs), engines.method(label).requires)
    try:
        q, p, stop = raw(scene, label)
    except MethodError as error:
        if half:
            # the engine may refuse all because of one
            return cells(label, specs[:half]) + cells(label, specs[half:])
        return [judging.cell(label, specs[0], "engine's limit", f"it refuses: {error}")]
    found = judging.judge(label, specs, scene, q, p, stop)
    if len(specs) == 1:
        return found
    if stale := engines.arithmetic(label).stale:
        # beside a larger motion an engine recomputes forces that it would reuse for the cell alone
        with np.errstate(invalid="ignore"):
            # a state that has overflowed (inf or nan) does not count as slow
            slow = np.any(np.abs(np.diff(q, axis=0)) <= 2 * stale, axis=0)
        found = [
            cells(label, [spec])[0] if alone else cell
            for spec, cell, alone in zip(specs, found, slow, strict=True)
        ]
    if not stop:
        return found
    # the engine stopped: cells with a reason are done, the others run again
    over = [x.outcome not in ("silently wrong", "right") and bool(x.reason) for x in found]
    if not any(over) or all(over):
        return cells(label, specs[:half]) + cells(label, specs[half:])
    rest = iter(cells(label, [spec for spec, done in zip(specs, over, strict=True) if not done]))
    return [cell if done else next(rest) for cell, done in zip(found, over, strict=True)]
