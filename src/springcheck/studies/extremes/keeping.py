"""The cells of one method as a table of a store, and the same read back: every number, bit for bit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np

from springcheck.store import Table
from springcheck.studies.extremes.judging import Cell, Outcome

CELLS = "extremes/"
"""Beginning of the tables' names; the method follows."""

OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)

_TEXTS = ("method", "block", "outcome", "reason")
_PARAMETERS = ("m", "k", "q", "p", "h", "steps", "h_w", "force", "tolerance")


def of_cells(name: str, cells: Sequence[Cell]) -> Table:
    """A table of this name; a parameter that a cell has not is NaN.

    Viewers draw the outcomes, numbered, over decades of force and of h w, where cells have both.
    """
    numbers = {x: np.array([cell.parameters.get(x, np.nan) for cell in cells], float) for x in _PARAMETERS}
    judged = {x: np.array([getattr(cell, x) for cell in cells], float) for x in ("value", "bound")}
    texts = {x: [str(getattr(cell, x)) for cell in cells] for x in _TEXTS}
    decades = {f"log10_{x}": _decades(numbers[x]) for x in ("force", "h_w")}
    shown = np.any(np.all(np.isfinite(list(decades.values())), axis=0))
    outcome = np.array([OUTCOMES.index(cell.outcome) for cell in cells], np.int8)
    return Table(
        name=name,
        columns={**texts, **numbers, **judged, **decades, "outcome_number": outcome},
        attributes={
            "about": "outcome_number: " + ", ".join(f"{i} {text}" for i, text in enumerate(OUTCOMES))
        },
        signal="outcome_number" if shown else "",
        axes=tuple(decades) if shown else (),
    )


def _decades(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.log10(np.where(np.isfinite(values) & (values > 0), values, np.nan)))


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
