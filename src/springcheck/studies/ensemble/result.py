"""Result of an ensemble: columns of numbers, one row a cell, and its text."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from springcheck.physics.scene import Scene
from springcheck.studies.keeper import Table, document, tables
from springcheck.studies.study import Studied
from springcheck.studies.tables import Form
from springcheck.studies.text import left_out, of_energy, resumed
from springcheck.text.lines import Lines, plain, table
from springcheck.text.wording import count

QUANTITIES = ("max_error", "energy_drift", "steps")
"""Numbers of each cell that are summarised and drawn: largest distance from the exact solution relative to
the initial energy norm (NaN where it is unknown), H - H0 over the square of its unit where that is largest
(with friction the exact solution's H for H0), and steps with finite numbers."""

CELL_SCALE = "initial T + |V|"
"""The energy to which those of a cell are relative: its own, or where that is 0 what it may gain."""

Columns = Mapping[str, np.ndarray]


class Chunk(Form[Columns]):
    """Columns of a chunk: the fields that were varied, and the results."""

    def _split(self, found: Columns) -> tuple[dict[str, Any], dict[str, Any]]:
        return dict(found), {}

    def found(self, table: Table) -> Columns:
        """The columns of such a table."""
        return {name: np.asarray(column) for name, column in table.columns.items()}


CELLS = Chunk(
    kind=dict,
    beginning="ensemble/",
    named="",
    about="a row a cell: the fields that were varied; outcome 0: complete, 1: diverged, 2: stopped; "
    "q0, p0: the state at the end of the first particle",
    joined=True,
)
"""The table ``ensemble/<label>`` of each method, measured and saved chunk by chunk."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Summary of the cells of one method."""

    method: str
    cells: int = 0
    complete: int = 0
    smallest: Mapping[str, float]
    largest: Mapping[str, float]
    """Extremes of each of the `QUANTITIES` over the complete cells."""

    def plus(self, found: Columns) -> Tally:
        """Copy with the cells of another chunk added."""
        good = found["outcome"] == 0
        low, high = dict(self.smallest), dict(self.largest)
        for name in QUANTITIES:
            values = found[name][good & np.isfinite(found[name])]
            if len(values):
                low[name] = float(min(low.get(name, np.inf), np.min(values)))
                high[name] = float(max(high.get(name, -np.inf), np.max(values)))
        complete = self.complete + int(np.count_nonzero(good))
        return replace(self, cells=self.cells + len(good), complete=complete, smallest=low, largest=high)

    def span(self, name: str) -> tuple[str, str]:
        """The extremes of a quantity, for a table."""
        if name not in self.smallest:
            return "-", "-"
        return f"{self.smallest[name]:.1e}", f"{self.largest[name]:.1e}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Ensemble(Studied):
    """One scene over many parameters; a row of its table is a cell of a method."""

    scene: Scene
    fields: tuple[str, ...]
    """The fields that were varied."""
    grid: bool
    tallies: tuple[Tally, ...]
    columns: Mapping[str, Columns] = field(default_factory=dict)
    """The cells of each method, in order, of an ensemble without a store."""

    def __repr__(self) -> str:
        cells = f"{count(len(self.tallies), 'method')}, {count(sum(x.cells for x in self.tallies), 'cell')}"
        return f"Ensemble({self.scene.name!r} over {', '.join(self.fields)}: {cells})"

    def of(self, method: str) -> Columns:
        """All cells of a method, in their order, from memory or from their store."""
        if self.path is None:
            return self.columns[method]
        return CELLS.found(tables(self.path)[CELLS.beginning + method])

    def rows(self) -> list[dict[str, Any]]:
        found = []
        for tally in self.tallies:
            cells = {name: np.asarray(values).tolist() for name, values in self.of(tally.method).items()}
            found += [
                {"method": tally.method, **dict(zip(cells, row, strict=True))}
                for row in zip(*cells.values(), strict=True)
            ]
        return found

    @property
    def status(self) -> Literal[0, 2]:
        """Exit status: 2 where no cell is complete."""
        return 0 if any(tally.complete for tally in self.tallies) else 2

    def lines(self, options: Namespace | None = None) -> Lines:
        """One line a method."""
        cells = max((tally.cells for tally in self.tallies), default=0)
        how = "a grid" if self.grid else "random samples"
        rows = [
            (x.method, str(x.cells), str(x.complete), *x.span("max_error"), *x.span("energy_drift"))
            for x in self.tallies
        ]
        titles = ("method", "cells", "complete", "error from", "to", "energy from", "to")
        energy = of_energy(self.scene, CELL_SCALE)
        return [
            plain(f"{self.scene.title}: {count(cells, 'cell')}, {how} over {', '.join(self.fields)}", "bold"),
            *resumed(self.resumed, "chunk"),
            plain(),
            table(titles, rows),
            plain(f"error: largest distance from the exact solution; energy: {energy}", "dim"),
            plain("no cell is judged: `springcheck run SCENE --set FIELD=NUMBER` judges one of them", "dim"),
            *left_out(self.left_out),
        ]

    def document(self) -> dict[str, Any]:
        """Plain data for JSON; the cells are in the tables."""
        return document(
            scene=self.scene.name,
            fields=self.fields,
            grid=self.grid,
            methods=self.tallies,
            left_out=self.left_out,
        )
