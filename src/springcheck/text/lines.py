"""Lines and tables of text: numbers, labels and names are never truncated, however narrow the terminal.

Rich prints them on a terminal and wraps lines; a pipe gets them unwrapped, without Rich.
"""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
from typing import TYPE_CHECKING

from springcheck import errors

if TYPE_CHECKING:
    from rich.console import Console

FEWEST_PROSE_COLUMNS = 30
"""Fewest columns into which prose is wrapped."""
COLUMN_GAP = 2
WHOLE_FROM = 80
"""Columns of a terminal from which on no table is split."""


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text: its parts, each with a style as Rich names it; nothing in it is markup."""

    parts: tuple[tuple[str, str], ...]
    whole: bool = False
    """Whether it must not be broken between its words."""

    def __str__(self) -> str:
        return "".join(text for text, _ in self.parts)

    def __len__(self) -> int:
        return sum(len(text) for text, _ in self.parts)

    @property
    def style(self) -> str:
        """That of its first part; the page's template reads it."""
        return self.parts[0][1]


def plain(text: str = "", style: str = "") -> Text:
    """A line of text from any file, without control characters."""
    return Text(((errors.plain(text), style),))


Cell = str | Text
Row = Sequence[Cell] | Text


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table without rules, as narrow as its cells; only `prose` is wrapped to fit the width.

    Columns that do not fit the width are stacked in blocks, each with the first column: nothing is
    truncated, and no terminal has to fold a number.
    """

    titles: tuple[str, ...]
    rows: tuple[Row, ...]
    """Rows; a row that is a Text is a heading over all columns."""
    left: frozenset[str]
    prose: str
    drop: tuple[str, ...] = ()
    """Columns that are left out, the first one first, where all do not fit in `WHOLE_FROM` columns or more;
    a narrower terminal has them in blocks."""

    def lines(self, wide: int) -> Iterator[Text]:
        """Its lines on a terminal of so many columns."""
        head: Row = tuple(map(plain, self.titles))
        cells = [row for row in (head, *self.rows) if not isinstance(row, Text)]
        widths = [
            max((len(row[j]) for row in cells if j < len(row)), default=0) for j in range(len(self.titles))
        ]
        if self.prose and self.prose in self.titles:
            j = self.titles.index(self.prose)
            words = [len(word) for row in cells if j < len(row) for word in str(row[j]).split()]
            widths[j] = min(widths[j], max(self._free(widths, j, wide), *words, 1))
        kept = list(range(len(widths)))
        for title in self.drop if wide >= WHOLE_FROM else ():
            if sum(widths[j] for j in kept) + COLUMN_GAP * (len(kept) - 1) > wide:
                kept.remove(self.titles.index(title))
        for i, block in enumerate(_blocks(widths, kept, wide)):
            if i:
                yield plain()
            for row in (head, *self.rows):
                if isinstance(row, Text):
                    yield row
                else:
                    yield from self._lines(row, widths, block)

    def _free(self, widths: Sequence[int], j: int, width: int) -> int:
        """Columns for the prose: the rest of the width, or all but the first column where that is little."""
        others = width - sum(widths) + widths[j] - COLUMN_GAP * (len(widths) - 1)
        return others if others >= FEWEST_PROSE_COLUMNS or j == 0 else width - widths[0] - COLUMN_GAP

    def _lines(self, row: Sequence[Cell], widths: Sequence[int], block: Sequence[int]) -> Iterator[Text]:
        parts = []
        for j in block:
            title, width, cell = self.titles[j], widths[j], row[j] if j < len(row) else ""
            whole = plain(cell) if isinstance(cell, str) else cell
            pieces = [whole]
            if title == self.prose and len(whole) > width:
                broken = textwrap.wrap(str(whole), width, break_long_words=False, break_on_hyphens=False)
                pieces = [plain(piece, whole.style) for piece in broken]
            parts.append((title in self.left or title == self.prose, width, pieces))
        for i in range(max(len(pieces) for _, _, pieces in parts)):
            out: list[tuple[str, str]] = []
            for left, width, pieces in parts:
                piece = pieces[i] if i < len(pieces) else plain()
                blank = (" " * (width - len(piece)), "")
                out += [*piece.parts, blank] if left else [blank, *piece.parts]
                out.append((" " * COLUMN_GAP, ""))
            yield Text(tuple(out), whole=True)


def _blocks(widths: Sequence[int], kept: Sequence[int], width: int) -> list[list[int]]:
    """Blocks of columns that fit the width, the first one in each block."""
    blocks, used = [[0]], widths[0]
    for j in kept[1:]:
        if used + COLUMN_GAP + widths[j] > width and len(blocks[-1]) > 1:
            blocks.append([0])
            used = widths[0]
        blocks[-1].append(j)
        used += COLUMN_GAP + widths[j]
    return blocks


def table(
    titles: Sequence[str], rows: Iterable[Row], *, left: Collection[str] = ("method",), prose: str = "",
    drop: Sequence[str] = (),
) -> TextTable:  # fmt: skip
    """A table; the columns `left` are left-aligned, numbers right-aligned."""
    return TextTable(tuple(titles), tuple(rows), frozenset(left), prose, tuple(drop))


Lines = list[Text | TextTable]


def shown(lines: Sequence[Text | TextTable], wide: int) -> Iterator[Text]:
    """Every line, those of tables too, on a terminal of so many columns."""
    for line in lines:
        yield from line.lines(wide) if isinstance(line, TextTable) else (line,)


def drawn(lines: Sequence[Text | TextTable], console: Console) -> None:
    """Print lines in their styles, as wide as the console."""
    from rich.text import Text as Styled

    for line in shown(lines, console.width):
        styled = Styled.assemble(*line.parts)
        if line.whole:
            styled.rstrip()
            console.print(styled, crop=False, no_wrap=True, overflow="ignore")
        else:
            console.print(styled, crop=False)


def as_text(lines: Sequence[Text | TextTable], width: int = 100) -> str:
    """Lines without colours, as in `str` of a result."""
    return "\n".join(line.rstrip() for line in _recorded(lines, width).export_text().splitlines())


def as_html(lines: Sequence[Text | TextTable]) -> str:
    """Lines with their colours, for notebooks."""
    return _recorded(lines, 120).export_html(inline_styles=True, code_format="<pre>{code}</pre>")


def _recorded(lines: Sequence[Text | TextTable], width: int) -> Console:
    from rich.console import Console

    console = Console(file=StringIO(), width=width, highlight=False, record=True)
    drawn(lines, console)
    return console


def hanging(head: str, text: str) -> Lines:
    """Text in 80 columns, continuation lines indented by the length of its head."""
    broken = textwrap.wrap(text, 80 - len(head), break_long_words=False, break_on_hyphens=False)
    return [plain((head if i == 0 else " " * len(head)) + line) for i, line in enumerate(broken)]
