"""The cells of the atlas that make a plane of force and h w, by method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from springcheck.studies.extremes.judging import Cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane:
    """Cells over decades of force and over h w."""

    method: str
    decades: tuple[int, ...]
    """Of the force, ascending."""
    turns: tuple[float, ...]
    """h w, ascending."""
    cells: tuple[tuple[Cell | None, ...], ...]
    """A row for each h w; None where nothing was tried."""


def planes(cells: Sequence[Cell]) -> list[Plane]:
    """One for each method of fixed step; a solver, whose step is its own, has no such plane."""
    found = []
    for method in dict.fromkeys(cell.method for cell in cells):
        mine = [cell for cell in cells if cell.method == method and cell.block == "force"]
        steps, springs = ({cell.parameters[name] for cell in mine} for name in ("h", "k"))
        if len(steps) == 1 and len(springs) > 1:
            found.append(_plane(method, mine))
    return found


def _plane(method: str, cells: Sequence[Cell]) -> Plane:
    placed = {(_turn(cell), decade(cell)): cell for cell in cells}
    turns = sorted({turn for turn, _ in placed})
    decades = sorted({x for _, x in placed})
    return Plane(
        method=method,
        decades=tuple(decades),
        turns=tuple(
            next(cell.parameters["h_w"] for (of, _), cell in placed.items() if of == turn) for turn in turns
        ),
        cells=tuple(tuple(placed.get((turn, x)) for x in decades) for turn in turns),
    )


def _turn(cell: Cell) -> float:
    """log10 of h w, rounded: the same h w from another stiffness differs in its last digit."""
    return round(float(np.log10(cell.parameters["h_w"])), 3)


def decade(cell: Cell) -> int:
    """Power of ten of the largest force at the start."""
    # of the logarithms: the product itself may leave the range
    return int(np.round(np.log10(cell.parameters["k"]) + np.log10(cell.parameters["q"])))
