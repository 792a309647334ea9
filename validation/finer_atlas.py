"""A finer atlas of extreme cases: every decade of force from 1e-300 to 1e300, at as many h w as it takes.

Command: python validation/finer_atlas.py CELLS [FILE] [METHOD ...]  (default: finer-extremes.h5, all methods)

The plane of forces of `springcheck extremes` is made finer until there are about so many cells in all.  They
are kept as they are finished: the same command goes on where it was interrupted, and `springcheck plot`,
`inspect` and `report` take the file as one of `extremes`.

Printed of 100000: 103410 extreme cases, no cell is silently wrong; OpenMM's methods on Reference and CPU are
right for forces from 1e-158 to 1e152, `openmm:mts` from 1e-155.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from arguments import arguments, script
from springcheck import engines
from springcheck.engines.contract import Label
from springcheck.studies import keeper
from springcheck.studies.extremes import STUDY, grid, measure, running
from springcheck.studies.extremes.grid import Spec
from springcheck.studies.extremes.result import CELLS, Atlas
from springcheck.studies.keeper import Piece
from springcheck.text.lines import as_text

EVERY_DECADE = range(grid.FORCE_DECADES[0], grid.FORCE_DECADES[-1] + 1)

ROWS, GOLDEN = 8, (5**0.5 - 1) / 2
"""h w of a part; the golden section, whose fractions fill an interval evenly (Weyl 1916)."""


def finer(count: int) -> Iterator[list[Spec]]:
    """At least so many more cells of the plane of forces, every decade of force, in parts of `ROWS` h w.

    First those of `grid.CELL_TURNS`, then h w that lie evenly in their logarithm however many there are.
    """
    low, high = np.log(grid.CELL_TURNS[0]), np.log(grid.CELL_TURNS[-1])
    part: list[Spec] = []
    for j in itertools.count() if count > 0 else ():
        done = count <= 0 and j >= len(grid.CELL_TURNS)
        if part and (done or j % ROWS == 0):
            yield part
            part = []
        if done:
            return
        new = j - len(grid.CELL_TURNS)
        turn = grid.CELL_TURNS[j] if new < 0 else float(np.exp(low + (high - low) * ((new + 1) * GOLDEN % 1)))
        with np.errstate(over="ignore", under="ignore"):
            row = [grid.force_cell(turn, x) for x in EVERY_DECADE if new >= 0 or x not in grid.FORCE_DECADES]
        row = [x for x in row if x.finite]
        count -= len(row)
        part += row


def pieces(labels: Sequence[Label], cells: int) -> list[Piece]:
    """Pieces of so many more cells, as many for each method of fixed step."""
    fixed = [label for label in labels if not engines.method(label).adaptive]
    more = -(-cells // len(fixed)) if fixed else 0
    return [
        Piece(
            key=f"{label} {j:04d}",
            what=f"{label}, part {j} of a finer plane",
            measure=partial(running.cells, label, specs),
            form=CELLS,
        )
        for j, specs in enumerate(finer(more), 1)
        for label in fixed
    ]


def record(path: str | Path | None, methods: Sequence[str], cells: int) -> Atlas:
    """The atlas of these labels or globs with about so many cells, kept in a store as it goes."""
    labels = engines.match(tuple(methods) or measure.everything())
    with keeper.kept(path, keeper.command("extremes", labels, f"{cells} cells")) as kept:
        usual = measure.measure(labels, kept)
        here = [engines.parse(name) for name in dict.fromkeys(cell.method for cell in usual.cells)]
        more = pieces(here, cells - len(usual.cells))
        found = [cell for part in kept.results(more) for cell in part]
        every = (*usual.cells, *found)
        atlas = replace(usual, cells=every, windows=tuple(measure.windows(every)))
        # a piece's table is named by its cells, too, and not by its method alone
        tables = [*usual.kept_document()["tables"], *(piece.name for piece in more)]
        kept.commit("extremes", {**atlas.kept_document(), "tables": tables})
    return atlas


def main() -> int:
    """Measure and report; 1 where a cell is silently wrong."""
    given = arguments(__doc__, cells=int, file="finer-extremes.h5", methods=list[str]())
    atlas = record(given.file, given.methods, given.cells or 0)
    print(as_text(STUDY.lines(atlas)))
    return atlas.status


if __name__ == "__main__":
    script(main)
