"""Text tables: columns of numbers separated by commas, semicolons, tabs or blanks, with or without names."""

from __future__ import annotations

import gzip
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import BARE, Floats, States, counts_steps, kinds, listed, named, split, times
from springcheck.formats.digits import SHOWN, fixed, number, roundoff

COMMENT = ("#", "%", "!", "//")
"""Prefix of a comment, which may name the columns and holds no row of numbers."""
MOST_LABELS = 1000
"""Characters of a row in which labels stand next to numbers, as in ``t=0.1 x=0.2``."""


class Lines:
    """The lines of a text, counted; how long it may be is a matter of the process that reads it."""

    def __init__(self, path: Path) -> None:
        with path.open("rb") as raw:
            opened = gzip.open if raw.read(2) == b"\x1f\x8b" else open
        self.path, self.number = path, 0
        self._file = opened(path, "rt", encoding="utf-8-sig")

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line = next(self._file)
        self.number += 1
        return line.rstrip("\r\n")

    def take(self) -> str:
        """The next line of a frame.  StoreError at the end of the file."""
        for line in self:
            return line
        raise self.wrong("is damaged or cut off")

    def wrong(self, what: str) -> StoreError:
        """An error that names file and line."""
        return StoreError(f"{self.path}, line {self.number}: {what}")

    def __enter__(self) -> Lines:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


def read_table(path: Path, columns: list[str], step: float | None) -> States:
    """The states of a text table; the last line before the numbers names the columns, or has their units."""
    header: list[str] = []
    legends: list[str] = []
    units = ""
    first: list[list[str]] = []
    numbers, width = array("d"), 0
    unlike: StoreError | None = None
    with Lines(path) as lines:
        for line in lines:
            if len(first) == SHOWN and width > 1 and (row := _plain(line)) and len(row) == width:
                numbers.extend(row)
                continue
            if width == 1 and len(first) == SHOWN:
                break  # the message is the same, however many follow
            if not width and line.lstrip().startswith("@"):
                legends += _legend(line)
                continue
            names, cells = _labelled(line) if "=" in line[:MOST_LABELS] else ([], _cells(line))
            if names:
                legends = legends or names
                if names != legends:
                    raise lines.wrong(f"columns {listed(names)}, before it {listed(legends)}")
            is_comment = line.lstrip().startswith(COMMENT)
            row = _numbers(cells)
            if not cells or (is_comment and (width or row)):
                continue
            if row is None:
                bad = [cell for cell in cells if _numbers([cell]) is None]
                wrong = lines.wrong(f"{bad[0][:40]!r} is no number")
                if width:
                    raise wrong
                # the first row: as many numbers as the rows that follow, or names of columns
                unlike = wrong if not is_comment and 2 * len(bad) <= len(cells) else None
                of_names, here = (kinds(names).values() for names in (header, cells))
                if not unlike and len(cells) == len(header) and "t" in of_names and "t" not in here:
                    units = f"line {lines.number} left out as units ({listed(cells)}): no number is converted"
                    continue
                header, units = cells, ""
                continue
            if not width and unlike and len(header) == len(row):
                raise unlike
            width = width or len(row)
            if len(row) != width:
                raise lines.wrong(f"numbers in this row: {len(row)}, in the first: {width}")
            numbers.extend(row)
            if len(first) < SHOWN:
                first.append(cells)
    if not width:
        # a row with some numbers in it was meant to be one
        raise wrong if header and len(bad) < len(header) else StoreError(f"{path}: holds no row of numbers")
    states = of_rows(path, np.frombuffer(numbers).reshape(-1, width), first, columns, legends or header, step)
    return replace(states, notes=(*states.notes, *([units] if units else [])))


def _legend(line: str) -> list[str]:
    """Name of the next column in a line of a Grace file (.xvg of GROMACS); most lines with @ name none."""
    words = line[:1000].replace("@", " ", 1).split(None, 2)
    axis = words[:2] == ["xaxis", "label"]
    curve = len(words) == 3 and words[0][:1] == "s" and words[0][1:].isdecimal() and words[1] == "legend"
    return [_bare(words[2])] if len(words) == 3 and (axis or curve) else []


def _labelled(line: str) -> tuple[list[str], list[str]]:
    """Names and numbers of a row such as ``t=0.1 x=0.2`` or ``t = 0.1, x = 0.2``; of others no names."""
    words = line.replace("=", " ").replace(",", " ").replace(";", " ").split()
    names, cells = words[::2], words[1::2]
    whole = len(names) == len(cells) and _numbers(cells) is not None
    return (names, cells) if whole and not any(_numbers([name]) for name in names) else ([], _cells(line))


def of_rows(
    path: Path, values: Floats, first: Sequence[Sequence[str]], names: list[str], header: list[str],
    step: float | None = None,
) -> States:  # fmt: skip
    """The states in the rows of a table, the first of which are also given as text."""
    width = values.shape[1]
    # an index that numbers the rows is written without a name
    if (
        not names
        and len(header) == width - 1
        and values[0, 0] in (0, 1)
        and np.all(np.diff(values[:, 0]) == 1)
    ):
        header = ["", *header]
    columns = named(path, values, names or header)
    chosen = [*columns]
    counted = [i for i, name in enumerate(chosen) if counts_steps(name)]
    if counted and "t" not in kinds(chosen).values() and "q" in kinds(chosen).values():
        i = counted[0]
        chosen[i] = "t"
        columns = {**columns, "t": times(path, values[:, i], step)}
    meant = kinds(chosen)
    of = {what: [i for i, name in enumerate(chosen) if meant.get(name) == what] for what in "qpv"}
    states = split(path, columns, roundoff(first, [*of["q"], *of["p"], *of["v"]]), step)
    notes = (*states.notes, *([] if names or header else [BARE]))
    return replace(states, fixed=fixed(first, of["q"], of["p"] or of["v"]), notes=notes)


def _cells(line: str) -> list[str]:
    text = line.strip(" ").lstrip("#%!/").strip(" ")
    if text[:1] == "[" and not {"[", "]"} & {*(row := text.strip("[] "))}:
        # as NumPy prints a row
        text = row
    if ";" in text or "\t" in text:
        # there a comma stands for a decimal point
        parts = [re.sub(r"^([+-]?\d*),(\d+)(?![\d.,])", r"\1.\2", _bare(x)) for x in re.split(r"[;\t]", text)]
    else:
        # a name may contain a blank, as in "t [s]", where columns have another separator
        parts = [*map(_bare, text.split(","))] if "," in text else text.split()
    while parts and not parts[-1]:
        parts.pop()
    return parts


def _bare(cell: str) -> str:
    """A cell without surrounding blanks and quotes."""
    return cell.strip().removeprefix('"').removesuffix('"').strip()


def _plain(line: str) -> list[float] | None:
    """The numbers of a row that `float` can parse, as most are: four times as fast."""
    if ";" in line or "\t" in line or "_" in line:
        return None
    try:
        return [*map(float, line.split("," if "," in line else None))]
    except ValueError:
        return None


def _numbers(cells: Iterable[str]) -> list[float] | None:
    """The numbers of a row; None where one of its cells is not a number."""
    try:
        return [number(cell) for cell in cells]
    except ValueError:
        return None
