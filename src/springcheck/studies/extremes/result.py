"""Result of the atlas of extreme cases: plain data, its text, and its stored form."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck.studies.extremes.judging import Cell, Outcome
from springcheck.studies.keeper import document
from springcheck.studies.study import Studied
from springcheck.studies.tables import Rows
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, plain, table
from springcheck.text.wording import count

OUTCOME_LOOKS: Mapping[Outcome, tuple[str, str]] = {
    "right": ("right", "good"),
    "unstable, as theory says": ("unstable", "wild"),
    "engine's limit": ("limit", "limit"),
    "silently wrong": ("wrong", "wrong"),
    "not measured": ("", "#8c6bb1"),
}
"""Of each outcome the title of its column, "" for none, and its shade on a map."""
OUTCOMES = tuple(OUTCOME_LOOKS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Range of forces in which a method is right at all h w of `CALM_TURNS`, in decades of the unit."""

    method: str
    sentence: str
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
        titles = {outcome: title for outcome, (title, _) in OUTCOME_LOOKS.items() if title}
        rows = []
        for method in dict.fromkeys(cell.method for cell in self.cells):
            counts = self.counts(method)
            rows.append((method, str(sum(counts.values())), *(str(counts[outcome]) for outcome in titles)))
        wrong = self.wrong
        verdict = f"{count(len(wrong), 'cell')} silently wrong" if wrong else "no cell is silently wrong"
        return [
            plain(f"{len(self.cells)} extreme cases", "bold"),
            *resumed(self.resumed, "table"),
            plain(),
            table(("method", "cells", *titles.values()), rows),
            plain(),
            *(plain(window.sentence) for window in self.windows),
            *(
                plain(f"silently wrong: {cell.method} {cell.parameters}: {cell.reason}", "bold red")
                for cell in wrong[:20]
            ),
            plain(verdict, "bold red" if wrong else "bold green"),
            *left_out(self.left_out),
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
