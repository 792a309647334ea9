"""The cells of one method as a table of a store, and the same read back: every number, bit for bit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from springcheck.store import Table
from springcheck.studies.extremes.judging import Cell

CELLS = "extremes/"
"""Beginning of the tables' names; the method follows."""

_TEXTS = ("method", "block", "outcome", "reason")
_PARAMETERS = ("m", "k", "q", "p", "h", "steps", "h_w", "force", "tolerance")


def of_cells(name: str, cells: Sequence[Cell]) -> Table:
    """A table of this name; a parameter that a cell has not is NaN."""
    numbers = {x: np.array([cell.parameters.get(x, np.nan) for cell in cells], float) for x in _PARAMETERS}
    judged = {x: np.array([getattr(cell, x) for cell in cells], float) for x in ("value", "bound")}
    texts = {x: [str(getattr(cell, x)) for cell in cells] for x in _TEXTS}
    return Table(name=name, columns={**texts, **numbers, **judged})


def to_cells(table: Table) -> list[Cell]:
    """The cells of such a table.  KeyError where it is another's."""
    rows = {name: np.asarray(table.columns[name]).tolist() for name in (*_TEXTS, "value", "bound")}
    numbers = {name: np.asarray(table.columns[name], float) for name in _PARAMETERS}
    return [
        Cell(
            **{name: column[row] for name, column in rows.items()},
            parameters={
                name: float(column[row]) for name, column in numbers.items() if not np.isnan(column[row])
            },
        )
        for row in range(len(rows["method"]))
    ]
