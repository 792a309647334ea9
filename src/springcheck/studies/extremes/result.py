"""Result of the atlas of extreme cases: plain data, its text, its maps, and its stored form."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck.figures.charts import Bank, Chart, Scale, Tiles
from springcheck.studies.extremes.grid import MOST_CALLS, RATIOS
from springcheck.studies.extremes.judging import Cell, Outcome
from springcheck.studies.keeper import document
from springcheck.studies.study import Studied
from springcheck.studies.tables import Rows
from springcheck.text.lines import Lines, Row, Text, plain, table
from springcheck.text.wording import count, number

OUTCOME_LOOKS: Mapping[Outcome, tuple[str, str]] = {
    "right": ("right", "good"),
    "unstable, as theory says": ("unstable", "wild"),
    "engine's limit": ("limit", "limit"),
    "silently wrong": ("wrong", "wrong"),
    "not measured": ("", "refused"),
}
"""Of each outcome the title of its column, "" for none, and its shade on a map."""
OUTCOMES = tuple(OUTCOME_LOOKS)

RIGHT = ("right", "unstable, as theory says")
"""Outcomes that are no fault of an engine's arithmetic."""

CALM_TURNS = (0.01, 1.9)
"""h w that count for a window: below, hardly any force shows; beyond, stability decides."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Range of forces in which a method is right, or unstable in theory, at all h w of `CALM_TURNS`."""

    method: str
    low: float
    high: float


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


def _for_viewers(cells: Sequence[Cell]) -> dict[str, np.ndarray]:
    """Outcomes as numbers over decades of force and of h w, for viewers."""
    found = {"outcome_number": np.array([OUTCOMES.index(cell.outcome) for cell in cells], np.int8)}
    for name in ("force", "h_w"):
        values = np.array([cell.parameters.get(name, np.nan) for cell in cells], np.float64)
        found[f"log10_{name}"] = np.log10(np.where(np.isfinite(values) & (values > 0), values, np.nan))
    return found


def _line(cells: Sequence[Cell]) -> str:
    """The cells of one method in a line."""
    counts = Counter(OUTCOME_LOOKS[cell.outcome][0] or cell.outcome for cell in cells)
    return f"{cells[0].method}: {', '.join(f'{n} {what}' for what, n in counts.items())}" if cells else ""


CELLS: Rows[Cell] = Rows(
    kind=Cell, beginning="extremes/", named="", signal="outcome_number", axes=("log10_force", "log10_h_w"),
    about="outcome_number: " + ", ".join(f"{i} {text}" for i, text in enumerate(OUTCOMES)),
    extra=_for_viewers, line=_line,
)  # fmt: skip
"""A table for each method."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Atlas(Studied):
    """All cells, and the methods left out; a row of its table is a cell."""

    table_of: ClassVar[str] = "cells"
    forms: ClassVar = {"cells": CELLS}
    piece: ClassVar[str] = "table"

    cells: tuple[Cell, ...]

    def __repr__(self) -> str:
        return f"Atlas({', '.join(f'{number} {outcome}' for outcome, number in self.counts().items())})"

    @property
    def windows(self) -> tuple[Window, ...]:
        """The range of forces of each method that has one."""
        return tuple(windows(self.cells))

    @property
    def wrong(self) -> tuple[Cell, ...]:
        """Cells that are silently wrong."""
        return tuple(cell for cell in self.cells if cell.outcome == "silently wrong")

    @property
    def passed(self) -> bool:
        """Whether anything was measured and no cell is silently wrong."""
        return bool(self.cells) and not self.wrong

    def counts(self, *methods: str) -> Counter[str]:
        """Cells by outcome, of some methods or of all."""
        return Counter(cell.outcome for cell in self.cells if not methods or cell.method in methods)

    @property
    def status(self) -> Literal[0, 1]:
        """Exit status: 0 where `passed`."""
        return 0 if self.passed else 1

    @property
    def title(self) -> str:
        wrong = f"{count(len(self.wrong), 'case')} silently wrong" if self.wrong else "none silently wrong"
        return f"{len(self.cells):,} extreme cases: {wrong}"

    def answer(self) -> Lines:
        said = (f"silently wrong: {x.method} {x.parameters}: {x.reason}" for x in self.wrong[:20])
        return [plain(line, "bold red") for line in said]

    def tables(self) -> Lines:
        titles = {outcome: title for outcome, (title, _) in OUTCOME_LOOKS.items() if title}
        alike: dict[tuple[float, float], list[str]] = {}
        known = {x.method: (x.low, x.high) for x in self.windows}
        for method in dict.fromkeys(cell.method for cell in self.cells if cell.block == "force"):
            alike.setdefault(known.get(method, (np.nan, np.nan)), []).append(method)
        rows: list[Row] = []
        for (low, high), methods in alike.items():
            counts = self.counts(*methods)
            ends = [number(x, ".0e") for x in (low, high)]
            rows.append((named(methods), *ends, *(str(counts[outcome]) for outcome in titles)))
        of = f"Right for forces from and to, at h w from {CALM_TURNS[0]:g} to {CALM_TURNS[1]:g}"
        return [
            plain(f"{of}, in the scene's unit of force; all cases by outcome"),
            table(("methods", "from", "to", *titles.values()), rows, left=("methods",), prose="methods"),
            *self._stiff(),
        ]

    def _stiff(self) -> Lines:
        """The stiff cells: how each method does at each ratio of stiffnesses."""
        rows: dict[str, list[Cell]] = {}
        for cell in self.cells:
            if cell.block == "stiff":
                rows.setdefault(cell.method, []).append(cell)
        if not rows:
            return []
        ratios = [f"{ratio:.0e}" for ratio in RATIOS]
        return [
            plain(),
            plain("A soft and a stiff spring, stepped for the soft one, at ratios of stiffness of"),
            table(("method", *ratios), [(x, *map(_stiff_word, cells)) for x, cells in rows.items()]),
            plain("grows: as in theory, its step is beyond the stiff spring's limit", "dim"),
            plain(f"slow: over {MOST_CALLS:,} force calls, as it follows the stiff spring", "dim"),
        ]

    def banks(self, **chosen: Any) -> list[Bank]:
        """A map for each kind of outcome: methods of one map share it."""
        alike: dict[str, list[str]] = {}
        charts: dict[str, Chart] = {}
        for method in dict.fromkeys(cell.method for cell in self.cells if cell.block == "force"):
            chart = _chart([x for x in self.cells if x.method == method and x.block == "force"])
            assert chart.tiles is not None
            key = repr(chart.tiles.rows)
            charts.setdefault(key, chart)
            alike.setdefault(key, []).append(method)
        if not charts:
            return []
        drawn = [replace(chart, title=name, short=name) for key, chart in charts.items()
                 for name in [named(alike[key])]]  # fmt: skip
        return [Bank(name="extremes", heading=self.title, title="Methods drawn", charts=drawn)]

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return document(
            passed=self.passed, counts=self.counts(), cells=self.cells, windows=self.windows,
            left_out=self.left_out,
        )  # fmt: skip


def named(methods: Sequence[str]) -> str:
    """Methods in few words: how many of an engine where there are several."""
    by_engine: dict[str, list[str]] = {}
    for method in methods:
        engine, _, rest = method.partition(":")
        place = rest.partition("@")[2].partition("-")[0]
        by_engine.setdefault(engine + f"@{place}" * bool(place), []).append(method)
    return ", ".join(x[0] if len(x) == 1 else f"{name} ({len(x)})" for name, x in by_engine.items())


def _stiff_word(cell: Cell) -> Text:
    """The outcome of a stiff cell in a word."""
    if cell.outcome == "engine's limit":
        return plain("slow" if "force calls" in cell.reason else "stops", "yellow")
    words = {"right": ("right", ""), "unstable, as theory says": ("grows", "yellow")}
    return plain(*words.get(cell.outcome, ("WRONG", "bold red")))


def _chart(cells: Sequence[Cell]) -> Chart:
    """A row for each h w, a column for each decade of force; nothing where nothing was tried."""
    # rounded: the same h w from another stiffness differs in its last digit
    placed = {(round(float(np.log10(x.parameters["h_w"])), 3), x.decade): x for x in cells}
    turns = {turn: cell.parameters["h_w"] for (turn, _), cell in reversed(placed.items())}
    decades = sorted({decade for _, decade in placed})
    rows = [[placed.get((turn, decade)) for decade in decades] for turn in sorted(turns)]
    return Chart(
        title="", x=Scale(name="log10 of the force", values=decades),
        y=Scale(name="h \N{GREEK SMALL LETTER OMEGA}", values=[turns[turn] for turn in sorted(turns)]),
        tiles=Tiles(
            kinds=[(outcome, shade) for outcome, (_, shade) in OUTCOME_LOOKS.items()],
            rows=[_filled([-1 if x is None else OUTCOMES.index(x.outcome) for x in row]) for row in rows],
            notes=[["" if x is None else x.reason for x in row] for row in rows],
        ),
    )  # fmt: skip


def _filled(row: list[int]) -> list[int]:
    """A row of outcomes; each cell extends half-way to its neighbours, since rows of coarse grids differ in
    their forces."""
    tried = np.flatnonzero(np.asarray(row) >= 0)
    if len(tried) < 2:
        return row
    apart = np.abs(np.arange(len(row))[:, None] - tried)
    near = np.min(apart, axis=1) <= (np.median(np.diff(tried)) + 1) // 2
    nearest = tried[np.argmin(apart, axis=1)]
    return [row[int(i)] if close else -1 for i, close in zip(nearest, near, strict=True)]
