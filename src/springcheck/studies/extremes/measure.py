"""The atlas of extreme cases: every method over the decades, every cell with an outcome and its reason.

A cell is right (each step within its bound), unstable as theory predicts, or at the engine's limit (a
deviation with a named reason).  A deviation without a reason makes a cell silently wrong, and fails the
study.  Many cells of one step share a run, as far as an engine that stops allows it.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Unpack

import numpy as np

from springcheck import engines
from springcheck.engines.contract import Label, Stopped
from springcheck.errors import MethodError, SpringcheckError
from springcheck.physics.arrays import WIDE, Floats
from springcheck.physics.scene import Scene
from springcheck.schemes import scheme
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import sorted_out
from springcheck.studies.extremes import grid, judging, stiff
from springcheck.studies.extremes.grid import Spec
from springcheck.studies.extremes.judging import Cell
from springcheck.studies.extremes.result import CELLS, Atlas
from springcheck.studies.keeper import How, Keeper, each
from springcheck.studies.stability import propagators

ON_PLATFORM = (1e-12, 1e12)
"""Forces and amplitudes of cells on a platform where every run takes a context: they share a single one."""


def everything() -> tuple[str, ...]:
    """Every method on its first platform, and the platforms that engines declare for the atlas."""
    places = (f"{name}:{place}" for name in engines.names() for place in engines.engine(name).atlas)
    return ("*", *places)


def record(
    path: str | Path | None = None, methods: Sequence[str] = (), *, quick: bool = False, **how: Unpack[How]
) -> Atlas:
    """Run the atlas for these labels or globs; by default for every method, and for OpenMM's platforms.

    A store has a table for each method, and the document (see `keeper.kept`).

    Raises:
        MethodError: a label names nothing, or none of the methods is here.
        SpringcheckError: long double has no range beyond double's, by which to judge numbers at its ends.
    """
    if not WIDE:
        raise SpringcheckError(
            "extremes judges numbers from 1e-300 to 1e300 by wider ones, and long double is no wider than "
            "double on this machine: run it on Linux on x86-64"
        )
    labels = engines.match(methods or everything(), every=bool(methods))
    cells = partial(measure, labels, quick=quick)
    return keeper.study("extremes", path, labels, cells, "quick" if quick else "whole", **how)


def measure(labels: Sequence[Label], kept: Keeper, *, quick: bool = False) -> Atlas:
    """The cells of these methods; those that an earlier call has saved are not measured again."""
    usable, left_out = sorted_out(labels, absence, "has extreme cases here")
    pieces = each(usable, "", lambda label: partial(of_method, label, quick=quick), CELLS)
    found = [cell for piece in kept.results(pieces) for cell in piece]
    return Atlas(cells=tuple(found), left_out=tuple(left_out))


def on_platform(label: Label) -> bool:
    """Whether a run of a method takes a context of a platform that compiles its code."""
    return label.platform not in ("", "Reference", "CPU")


def absence(label: Label) -> str | None:
    """Why a method has no cells, or None."""
    method = engines.method(label)
    if "wall-spring" not in method.terms or "particles" not in method.kinds:
        return "it moves no particles on springs"
    if not scheme(method.scheme).has("named"):
        return "its scheme is not known; --scheme NAME states it, and its steps are then judged"
    return propagators.absence(label, 0.5)


def perform(options: Namespace, progress: Progress | None) -> Atlas:
    """Carry out `springcheck extremes`."""
    how = keeper.how(options, progress)
    return record(options.output or "extremes.h5", options.method, quick=options.quick, **how)


def of_method(label: Label, *, quick: bool = False) -> list[Cell]:
    """All cells of one method; of one that chooses its steps the stiff ones alone."""
    plane = [] if engines.method(label).adaptive else groups(label, quick=quick)
    found = [cell for specs in plane for cell in cells(label, specs)]
    return found if on_platform(label) else [*found, *stiff.cells(label)]


def groups(label: Label, *, quick: bool = False) -> list[list[Spec]]:
    """Groups of cells of one method of fixed step that can run side by side."""

    def together(spec: Spec) -> tuple[str, float]:
        return spec.block, spec.h

    # sorted by force: where an engine stops over some, halves are soon of those alone
    specs = grid.specs(quick=quick and not on_platform(label))
    every = sorted(sorted(specs, key=lambda spec: spec.force), key=together)
    found = [list(group) for _, group in groupby(every, together)]
    if on_platform(label):
        low, high = ON_PLATFORM
        return [[x for x in found[0] if x.h_w < 2 and all(low < y < high for y in (x.force, x.q))]]
    return found


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
