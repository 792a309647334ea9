"""The atlas in figures and in the report page: every cell with its outcome and its reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from springcheck.figures.charts import Bank, Chart, Scale, Tiles
from springcheck.studies.extremes.judging import Cell
from springcheck.studies.extremes.result import OUTCOME_LOOKS, OUTCOMES, Atlas, named


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
    """A map for each kind of outcome: methods of one map share it."""
    alike: dict[str, list[str]] = {}
    charts: dict[str, Chart] = {}
    for method in dict.fromkeys(cell.method for cell in atlas.cells if cell.block == "force"):
        chart = _chart(method, [x for x in atlas.cells if x.method == method and x.block == "force"])
        assert chart.tiles is not None
        key = repr(chart.tiles.rows)
        charts.setdefault(key, chart)
        alike.setdefault(key, []).append(method)
    if not charts:
        return []
    drawn = [replace(chart, title=name, short=name) for key, chart in charts.items()
             for name in [named(alike[key])]]  # fmt: skip
    wrong = f"{len(atlas.wrong)} silently wrong" if atlas.wrong else "none silently wrong"
    heading = f"Of {len(atlas.cells):,} extreme cases {wrong}"
    return [Bank(name="extremes", heading=heading, title="Methods drawn", charts=drawn)]


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
