"""The atlas in figures and in the report page: every cell with its outcome and its reason."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from springcheck.figures.charts import Bank, Chart, Scale, Tiles
from springcheck.studies.extremes.judging import Cell
from springcheck.studies.extremes.result import OUTCOME_LOOKS, OUTCOMES, Atlas
from springcheck.text.wording import count


def _filled(row: list[int]) -> list[int]:
    """A row of outcomes, each cell extended half-way to the next one tried: a coarse grid has other forces in
    every row."""
    tried = np.flatnonzero(np.asarray(row) >= 0)
    if len(tried) < 2:
        return row
    apart = np.abs(np.arange(len(row))[:, None] - tried)
    near = np.min(apart, axis=1) <= (np.median(np.diff(tried)) + 1) // 2
    nearest = tried[np.argmin(apart, axis=1)]
    return [row[int(i)] if close else -1 for i, close in zip(nearest, near, strict=True)]


def banks(atlas: Atlas) -> list[Bank]:
    """A map for each method; solvers, whose cells are of one h w, have none."""
    methods = dict.fromkeys(cell.method for cell in atlas.cells)
    planes = {x: [c for c in atlas.cells if c.method == x and c.block == "force"] for x in methods}
    turns = {method: {cell.parameters["h_w"] for cell in cells} for method, cells in planes.items()}
    charts = [_chart(method, cells) for method, cells in planes.items() if len(turns[method]) > 1]
    if not charts:
        return []
    wrong = f"{count(len(atlas.wrong), 'case')} silently wrong" if atlas.wrong else "none silently wrong"
    others = ", ".join(
        f"{n} {name}" for name, n in atlas.counts().most_common(3) if n and name != "silently wrong"
    )
    heading = f"Of {len(atlas.cells)} extreme cases {wrong}: {others}"
    return [Bank(name="extremes", heading=heading, title="Methods drawn", charts=charts)]


def _chart(method: str, cells: Sequence[Cell]) -> Chart:
    """A row for each h w, a column for each decade of force; nothing where nothing was tried."""
    # rounded: the same h w from another stiffness differs in its last digit
    placed = {(round(float(np.log10(x.parameters["h_w"])), 3), x.decade): x for x in cells}
    turns = {turn: cell.parameters["h_w"] for (turn, _), cell in reversed(placed.items())}
    decades = sorted({decade for _, decade in placed})
    rows = [[placed.get((turn, decade)) for decade in decades] for turn in sorted(turns)]
    return Chart(
        title=method,
        short=method,
        x=Scale(name="log10 of the force", values=decades),
        y=Scale(name="h \N{GREEK SMALL LETTER OMEGA}", values=[turns[turn] for turn in sorted(turns)]),
        tiles=Tiles(
            kinds=[(outcome, shade) for outcome, (_, shade) in OUTCOME_LOOKS.items()],
            rows=[_filled([-1 if x is None else OUTCOMES.index(x.outcome) for x in row]) for row in rows],
            notes=[["" if x is None else x.reason for x in row] for row in rows],
        ),
    )
