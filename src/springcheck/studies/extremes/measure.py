"""The atlas of extreme cases: every method over the decades, every cell with an outcome and its reason.

A cell is right (each step within its bound), unstable as theory says, at the engine's limit (off, and we
say why), or refused.  A cell that is off without a named reason is silently wrong, and fails the study.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import engines, store
from springcheck.engines.contract import Label
from springcheck.errors import MethodError, StoreError
from springcheck.provenance import command
from springcheck.studies.extremes import grid, keeping, refusals, running, solving
from springcheck.studies.extremes.judging import Cell
from springcheck.studies.pieces import Pieces, Progress
from springcheck.studies.stability import propagators

__all__ = ["Atlas", "Cell", "Window", "document", "measure", "record", "windows", "stored"]

DOCUMENT = "extremes"
"""Name of the atlas in a store."""

ALL = ("*", "openmm:verlet@CPU", "openmm:verlet@OpenCL-single", "openmm:verlet@OpenCL-mixed",
       "openmm:verlet@OpenCL-double")  # fmt: skip
"""Every method on its first platform, and the platforms."""

CALM = (0.01, 1.9)
"""h w that count for a window: below, amplitudes decide and hardly any force shows; beyond, stability."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """The forces between which a method is right at every h w in `CALM`, as decades of the scene's unit."""

    method: str
    sentence: str
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Atlas:
    """All cells, the windows, and the methods that are not here."""

    cells: tuple[Cell, ...]
    windows: tuple[Window, ...]
    left_out: tuple[tuple[str, str], ...]
    taken_up: int = 0
    """Methods that an interrupted call had finished."""

    @property
    def wrong(self) -> tuple[Cell, ...]:
        """Cells that are silently wrong."""
        return tuple(cell for cell in self.cells if cell.outcome == "silently wrong")

    @property
    def passed(self) -> bool:
        """Whether anything was measured and no cell is silently wrong."""
        return bool(self.cells) and not self.wrong

    def counts(self, method: str | None = None) -> Counter[str]:
        """Cells by outcome, of one method or of all."""
        return Counter(cell.outcome for cell in self.cells if method in (None, cell.method))


def measure(
    methods: Sequence[str] = (),
    *,
    quick: bool = False,
    progress: Progress | None = None,
    pieces: Pieces | None = None,
) -> Atlas:
    """Run the atlas for these labels or globs; left out: every method, and OpenMM's platforms.

    What an earlier call has finished (`pieces`) is taken up.

    Raises:
        MethodError: a label names nothing, or none of the methods is here.
    """
    usable = []
    left_out = []
    for label in engines.match(tuple(methods) or ALL):
        reason = _absence(label)
        if reason is None:
            usable.append(label)
        else:
            left_out.append((str(label), reason))
    if not usable:
        raise MethodError("none of these methods is here: " + "; ".join(map(": ".join, left_out)))
    work: list[tuple[str, Callable[[], list[Cell]]]] = [
        (str(label), partial(of_method, label, quick=quick)) for label in usable
    ]
    if not methods:
        work.append(("refusals", refusals.cells))
    pieces = pieces or Pieces()
    pieces.expect(len(work), progress)
    cells: list[Cell] = []
    for what, measured in work:
        name = f"{keeping.CELLS}{what}"
        cells += pieces.piece(name, what, measured, partial(keeping.of_cells, name), keeping.to_cells)
    return Atlas(
        cells=tuple(cells),
        windows=tuple(windows(cells)),
        left_out=tuple(left_out),
        taken_up=len(pieces.taken_up),
    )


def _absence(label: Label) -> str | None:
    """Why a method has no cells, or None."""
    method = engines.method(label)
    if "wall-spring" not in method.terms or "particles" not in method.kinds:
        return "it moves no particles on springs"
    return engines.absence(label.engine) or (None if method.adaptive else propagators.absence(label))


def record(
    path: str | Path,
    methods: Sequence[str] = (),
    *,
    quick: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> Atlas:
    """Like `measure`, kept in a store: one table of cells for each method as it is finished, the document.

    An unfinished atlas of the same command is taken up.  Raises StoreError, before anything is measured,
    when the file exists or cannot be written.
    """
    labels = engines.match(tuple(methods) or ALL)
    size = "quick" if quick else "whole"
    with store.open_new(path, command("extremes", labels, size), force=force) as journal:
        pieces = Pieces(journal)
        atlas = measure(methods, quick=quick, progress=progress, pieces=pieces)
        known = {"tables": pieces.names, **document(atlas)}
        # the tables hold the cells, and hold them exactly
        del known["cells"]
        journal.commit(documents={DOCUMENT: json.dumps(known, allow_nan=False)})
    return atlas


def stored(path: str | Path) -> Atlas:
    """The atlas that `record` has kept.  StoreError where the file holds none."""
    known = json.loads(store.document(path, DOCUMENT))
    tables = store.read_tables(path)
    try:
        return Atlas(
            cells=tuple(cell for name in known["tables"] for cell in keeping.to_cells(tables[name])),
            windows=tuple(Window(**window) for window in known["windows"]),
            left_out=tuple((one["method"], one["reason"]) for one in known["left_out"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise StoreError(f"{path}: its atlas of extremes lacks {error}; measure it anew") from error


def of_method(label: Label, *, quick: bool = False) -> list[Cell]:
    """All cells of one method."""
    if engines.method(label).adaptive:
        return [solving.solve(label, spec) for spec in grid.solver_specs(quick=quick)]

    def together(spec: grid.Spec) -> tuple[str, float]:
        return spec.block, spec.h

    found: list[Cell] = []
    groups = [list(group) for _, group in groupby(sorted(grid.specs(quick=quick), key=together), together)]
    if label.platform not in ("", "Reference"):
        # a context costs such a platform a quarter of a second: the groups with the most cells
        groups = sorted(groups, key=len)[-3 if quick else -24 :]
    for specs in groups:
        found += running.cells(label, specs)
    return found + solving.last(label, grid.lengths(label, quick=quick))


def windows(cells: Sequence[Cell]) -> list[Window]:
    """For each method the decades of force around 1 to 1e6 in which every calm cell is right."""
    found = []
    for method in dict.fromkeys(cell.method for cell in cells):
        calm: dict[int, list[bool]] = {}
        for cell in cells:
            if (
                cell.method == method
                and cell.block == "force"
                and CALM[0] * 0.999 < cell.parameters["h_w"] < CALM[1] * 1.001
            ):
                calm.setdefault(_decade(cell), []).append(cell.outcome in RIGHT)
        decades = sorted(calm)
        middle = [j for j, decade in enumerate(decades) if 0 <= decade <= 6 and all(calm[decade])]
        if not middle:
            continue
        low = high = middle[0]
        while low > 0 and all(calm[decades[low - 1]]):
            low -= 1
        while high < len(decades) - 1 and all(calm[decades[high + 1]]):
            high += 1
        whole = low == 0 and high == len(decades) - 1
        name = engines.engine(method.partition(":")[0]).title
        span = f"1e{decades[low]} and 1e{decades[high]}"
        sentence = f"{name} ({method}): right for forces between {span}, in the scene's unit of force"
        if whole:
            sentence += ", all that was tried"
        found.append(
            Window(method=method, sentence=sentence, low=10.0 ** decades[low], high=10.0 ** decades[high])
        )
    return found


RIGHT = ("right", "unstable, as theory says")
"""Outcomes that are no fault of an engine's arithmetic."""


def _decade(cell: Cell) -> int:
    k, q = cell.parameters["k"], cell.parameters["q"]
    return int(np.round(np.log10(k) + np.log10(q)))


def document(atlas: Atlas) -> dict[str, Any]:
    """Plain data for JSON; what is not a finite number is None."""
    return {
        "passed": atlas.passed,
        "counts": dict(atlas.counts()),
        "cells": [
            {
                "method": cell.method,
                "block": cell.block,
                "parameters": {name: _finite(value) for name, value in cell.parameters.items()},
                "outcome": cell.outcome,
                "reason": cell.reason,
                "value": _finite(cell.value),
                "bound": _finite(cell.bound),
            }
            for cell in atlas.cells
        ],
        "windows": [
            {"method": w.method, "sentence": w.sentence, "low": _finite(w.low), "high": _finite(w.high)}
            for w in atlas.windows
        ],
        "left_out": [{"method": method, "reason": reason} for method, reason in atlas.left_out],
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
