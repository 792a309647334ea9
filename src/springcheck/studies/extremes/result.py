"""Result of the atlas of extreme cases: plain data, its text, and its stored form."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck.studies.extremes.grid import MOST_CALLS, RATIOS
from springcheck.studies.extremes.judging import Cell, Outcome
from springcheck.studies.keeper import document
from springcheck.studies.study import Studied
from springcheck.studies.tables import Rows
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, Row, Text, TextTable, plain, table
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


CALM_TURNS = (0.01, 1.9)
"""h w that count for a window: below, hardly any force shows; beyond, stability decides."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Range of forces in which a method is right, or unstable in theory, at all h w of `CALM_TURNS`."""

    method: str
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Atlas(Studied):
    """All cells, the windows, and the methods left out; a row of its table is a cell."""

    table_of: ClassVar[str] = "cells"

    cells: tuple[Cell, ...]
    windows: tuple[Window, ...]

    def __repr__(self) -> str:
        return f"Atlas({', '.join(f'{number} {outcome}' for outcome, number in self.counts().items())})"

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

    @property
    def status(self) -> Literal[0, 1]:
        """Exit status: 0 where `passed`."""
        return 0 if self.passed else 1

    def lines(self, options: Namespace | None = None) -> Lines:
        wrong = self.wrong
        verdict = f"{count(len(wrong), 'case')} silently wrong" if wrong else "none silently wrong"
        of = f"Right for forces from and to, at h w from {CALM_TURNS[0]:g} to {CALM_TURNS[1]:g}"
        return [
            plain(f"{len(self.cells)} extreme cases: {verdict}", "bold red" if wrong else "bold green"),
            *resumed(self.resumed, "table"),
            *(
                plain(f"silently wrong: {cell.method} {cell.parameters}: {cell.reason}", "bold red")
                for cell in wrong[:20]
            ),
            plain(),
            plain(f"{of}, in the scene's unit of force; all cases by outcome"),
            self._ranges(),
            *self._stiff(),
            *left_out(self.left_out),
        ]

    @property
    def alike(self) -> dict[tuple[float, float], list[str]]:
        """Methods by the range in which they are right; NaN where there is none."""
        found: dict[tuple[float, float], list[str]] = {}
        known = {x.method: (x.low, x.high) for x in self.windows}
        for method in dict.fromkeys(cell.method for cell in self.cells if cell.block == "force"):
            found.setdefault(known.get(method, (np.nan, np.nan)), []).append(method)
        return found

    def _ranges(self) -> TextTable:
        titles = {outcome: title for outcome, (title, _) in OUTCOME_LOOKS.items() if title}
        rows: list[Row] = []
        for (low, high), methods in self.alike.items():
            counts = sum((self.counts(method) for method in methods), Counter())
            ends = [number(x, ".0e") for x in (low, high)]
            rows.append((named(methods), *ends, *(str(counts[outcome]) for outcome in titles)))
        return table(("methods", "from", "to", *titles.values()), rows, left=("methods",), prose="methods")

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

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return document(
            passed=self.passed, counts=self.counts(), cells=self.cells, windows=self.windows,
            left_out=self.left_out,
        )  # fmt: skip

    def kept_document(self) -> dict[str, Any]:
        """The document with the names of tables in place of the cells, which these hold exactly."""
        tables = dict.fromkeys(CELLS.beginning + cell.method for cell in self.cells)
        return {"tables": [*tables], **{key: x for key, x in self.document().items() if key != "cells"}}


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


def _for_viewers(cells: Sequence[Cell]) -> dict[str, np.ndarray]:
    """Outcomes, numbered, over decades of force and of h w, where cells have both."""
    found = {"outcome_number": np.array([OUTCOMES.index(cell.outcome) for cell in cells], np.int8)}
    for name in ("force", "h_w"):
        values = np.array([cell.parameters.get(name, np.nan) for cell in cells], np.float64)
        found[f"log10_{name}"] = np.log10(np.where(np.isfinite(values) & (values > 0), values, np.nan))
    return found


CELLS: Rows[Cell] = Rows(
    kind=Cell,
    beginning="extremes/",
    named="",
    signal="outcome_number",
    axes=("log10_force", "log10_h_w"),
    about="outcome_number: " + ", ".join(f"{i} {text}" for i, text in enumerate(OUTCOMES)),
    extra=_for_viewers,
)
"""A table for each method."""
