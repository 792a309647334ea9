"""The atlas of extreme cases: every method over the decades, every cell with an outcome and its reason.

A cell is right (each step within its bound), unstable as theory predicts, or at the engine's limit (a
deviation with a named reason).  A deviation without a reason makes a cell silently wrong, and fails the
study.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Unpack

from springcheck import engines
from springcheck.engines.contract import Label
from springcheck.errors import SpringcheckError
from springcheck.physics.arrays import WIDE
from springcheck.schemes import scheme
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import sorted_out
from springcheck.studies.extremes import grid, running, stiff
from springcheck.studies.extremes.judging import Cell
from springcheck.studies.extremes.result import CALM_TURNS, CELLS, Atlas, Window
from springcheck.studies.keeper import How, Keeper, each
from springcheck.studies.stability import propagators


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
    work = [replace(x, cost=100.0 * on_platform(y) + 1.0) for x, y in zip(pieces, usable, strict=True)]
    found = [cell for piece in kept.results(work) for cell in piece]
    return Atlas(cells=tuple(found), windows=tuple(windows(found)), left_out=tuple(left_out))


def on_platform(label: Label) -> bool:
    """Whether a run of a method takes a context of a platform other than the reference."""
    return label.platform not in ("", "Reference")


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


@keeper.restoring("extremes")
def stored(kept: keeper.Kept) -> Atlas:
    """The atlas that `record` has saved.  StoreError where the file holds none."""
    known = kept.document
    return Atlas(
        cells=tuple(cell for name in known["tables"] for cell in CELLS.found(kept.tables[name])),
        windows=tuple(Window(**window) for window in known["windows"]),
        left_out=kept.left_out,
    )


def of_method(label: Label, *, quick: bool = False) -> list[Cell]:
    """All cells of one method; of one that chooses its steps the stiff ones alone."""
    plane = [] if engines.method(label).adaptive else groups(label, quick=quick)
    found = [cell for specs in plane for cell in running.cells(label, specs)]
    return found if on_platform(label) else [*found, *stiff.cells(label)]


def groups(label: Label, *, quick: bool = False) -> list[list[grid.Spec]]:
    """Groups of cells of one method of fixed step that can run side by side."""

    def together(spec: grid.Spec) -> tuple[str, float]:
        return spec.block, spec.h

    found = [list(group) for _, group in groupby(sorted(grid.specs(quick=quick), key=together), together)]
    if on_platform(label):
        # a context of such a platform takes a quarter of a second: only the groups of most cells
        found = sorted(found, key=len)[-3 if quick else -24 :]
    return found


def windows(cells: Sequence[Cell]) -> list[Window]:
    """Decades of force around 1 to 1e6 in which a method's cells within `CALM_TURNS` are all right."""
    found = []
    for method in dict.fromkeys(cell.method for cell in cells):
        calm: dict[int, bool] = {}
        for cell in cells:
            within = CALM_TURNS[0] * 0.999 < cell.parameters["h_w"] < CALM_TURNS[1] * 1.001
            if cell.method == method and cell.block == "force" and within:
                calm[cell.decade] = calm.get(cell.decade, True) and cell.outcome in RIGHT
        spans = [list(span) for right, span in groupby(sorted(calm), calm.__getitem__) if right]
        span = next((span for span in spans if any(0 <= x <= 6 for x in span)), None)
        if span is not None:
            found.append(Window(method=method, low=10.0 ** span[0], high=10.0 ** span[-1]))
    return found


RIGHT = ("right", "unstable, as theory says")
"""Outcomes that are no fault of an engine's arithmetic."""
