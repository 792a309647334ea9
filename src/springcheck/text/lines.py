"""Lines and tables of text, by rich: numbers, labels and names are never cut, however narrow the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from io import StringIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.measure import Measurement
from rich.text import Text

from springcheck import errors

Lines = list[RenderableType]
Cell = str | Text
Row = Sequence[Cell] | Text

PROSE = 30
"""Fewest columns that a cell of prose is broken into."""
GAP = 2


def plain(text: str = "", style: str = "") -> Text:
    """A line of text from any file: nothing in it is markup, nothing a control character."""
    return Text(errors.plain(text), style=style)


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table without lines, as narrow as its cells; `prose` alone is broken to fit the width.

    Columns that do not fit beside each other stand below each other, each block beside the first column:
    nothing is cut, and no terminal has to fold a number.
    """

    titles: tuple[str, ...]
    rows: tuple[Row, ...]
    """A row that is a Text is a heading over all columns."""
    left: frozenset[str]
    prose: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        head: Row = tuple(map(plain, self.titles))
        cells = [row for row in (head, *self.rows) if not isinstance(row, Text)]
        widths = [
            max((len(row[j]) for row in cells if j < len(row)), default=0) for j in range(len(self.titles))
        ]
        if self.prose in self.titles:
            j = self.titles.index(self.prose)
            words = [len(word) for row in cells if j < len(row) for word in str(row[j]).split()]
            widths[j] = min(widths[j], max(self._free(widths, j, options.max_width), *words, 1))
        for i, block in enumerate(_blocks(widths, options.max_width)):
            if i:
                yield plain()
            for row in (head, *self.rows):
                if isinstance(row, Text):
                    yield row
                else:
                    yield from self._lines(row, widths, block)

    def _free(self, widths: Sequence[int], j: int, width: int) -> int:
        """Columns for the prose: what the others leave, or what the first does where that is too little."""
        others = width - sum(widths) + widths[j] - GAP * (len(widths) - 1)
        return others if others >= PROSE or j == 0 else width - widths[0] - GAP

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(1, options.max_width)

    def _lines(self, row: Sequence[Cell], widths: Sequence[int], block: Sequence[int]) -> Iterator[Text]:
        parts = []
        for j in block:
            title, width, cell = self.titles[j], widths[j], row[j] if j < len(row) else ""
            whole = plain(cell) if isinstance(cell, str) else cell
            pieces = [whole]
            if title == self.prose and len(whole) > width:
                broken = textwrap.wrap(whole.plain, width, break_long_words=False, break_on_hyphens=False)
                pieces = [plain(piece, str(whole.style)) for piece in broken]
            parts.append((title in self.left or title == self.prose, width, pieces))
        for i in range(max(len(pieces) for _, _, pieces in parts)):
            out = plain()
            for left, width, pieces in parts:
                piece = pieces[i] if i < len(pieces) else plain()
                blank = " " * (width - len(piece))
                out.append_text(piece.copy() if left else plain(blank).append_text(piece))
                out.append(blank + " " * GAP if left else " " * GAP)
            out.rstrip()
            yield _line(out)


def _blocks(widths: Sequence[int], width: int) -> list[list[int]]:
    """Columns that fit beside each other, the first one in each block."""
    blocks, used = [[0]], widths[0]
    for j in range(1, len(widths)):
        if used + GAP + widths[j] > width and len(blocks[-1]) > 1:
            blocks.append([0])
            used = widths[0]
        blocks[-1].append(j)
        used += GAP + widths[j]
    return blocks


def _line(text: Text) -> Text:
    text = text.copy()
    text.no_wrap, text.overflow = True, "ignore"
    return text


def table(
    titles: Sequence[str], rows: Iterable[Row], *, left: Collection[str] = ("method",), prose: str = ""
) -> TextTable:
    """A table; the columns `left` start at their left edge, numbers end at their right one."""
    return TextTable(tuple(titles), tuple(rows), frozenset(left), prose)


def as_text(lines: Sequence[RenderableType], width: int = 100) -> str:
    """Lines without colours, as `str` of a result."""
    console = Console(file=StringIO(), width=width, highlight=False, color_system=None, record=True)
    for line in lines:
        console.print(line, crop=False)
    return "\n".join(line.rstrip() for line in console.export_text().splitlines())


def as_html(lines: Sequence[RenderableType]) -> str:
    """The same with its colours, for notebooks."""
    console = Console(file=StringIO(), width=120, highlight=False, record=True)
    for line in lines:
        console.print(line, crop=False)
    return console.export_html(inline_styles=True, code_format="<pre>{code}</pre>")


def hanging(head: str, text: str) -> Lines:
    """Text of 80 columns, its further lines indented as far as its head is long."""
    broken = textwrap.wrap(text, 80 - len(head), break_long_words=False, break_on_hyphens=False)
    return [plain((head if i == 0 else " " * len(head)) + line) for i, line in enumerate(broken)]
