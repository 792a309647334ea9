"""Text tables: columns of numbers between commas, semicolons, tabs or blanks, with or without names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import States, kind, named, split

LARGEST = 1 << 30
"""Bytes of a text file that are read at once."""


def read_table(path: Path, names: Sequence[str]) -> States:
    """The states of a text table; the last line before the numbers names the columns."""
    if path.stat().st_size > LARGEST:
        raise StoreError(f"{path}: is larger than {LARGEST >> 30} GiB of text; store it in HDF5 or NPZ")
    header: list[str] = []
    rows: list[list[str]] = []
    for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1):
        cells = _cells(line)
        if not cells or (line.lstrip().startswith("#") and rows):
            continue
        if all(_is_number(cell) for cell in cells):
            if rows and len(cells) != len(rows[0]):
                raise StoreError(
                    f"{path}, line {number}: {len(cells)} numbers where there were {len(rows[0])}"
                )
            rows.append(cells)
        elif rows:
            wrong = next(cell for cell in cells if not _is_number(cell))
            raise StoreError(f"{path}, line {number}: {wrong[:40]!r} is no number")
        else:
            header = cells
    if not rows:
        raise StoreError(f"{path}: holds no row of numbers")
    if not names and len(header) == len(rows[0]) - 1 and _are_counted(rows):
        header = ["", *header]
    chosen = list(names) or header
    if not chosen:
        raise StoreError(f"{path}: its {len(rows[0])} columns have no names; give them, as --columns t,q,v")
    values = np.array([[float(cell) for cell in row] for row in rows])
    states = [i for i, name in enumerate(chosen[: len(rows[0])]) if kind(name) in ("q", "p", "v")]
    return split(path, named(path, values, chosen), roundoff(rows, states))


def _cells(line: str) -> list[str]:
    text = line.strip(" \r\n").lstrip("#").strip(" ")
    if re.search(r"[;\t]", text):
        # there a comma stands for a decimal point
        parts = [re.sub(r"^([+-]?\d*),(\d+)", r"\1.\2", x.strip()) for x in re.split(r"[;\t]", text)]
    else:
        # a name may hold a blank, as in "t [s]", where something else lies between the columns
        parts = [x.strip() for x in text.split(",")] if "," in text else text.split()
    while parts and not parts[-1]:
        parts.pop()
    return parts


def _are_counted(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first column numbers the rows, as tables do that are written with their index."""
    first = float(rows[0][0])
    return first in (0, 1) and all(float(row[0]) == first + i for i, row in enumerate(rows))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def roundoff(rows: Sequence[Sequence[str]], columns: Iterable[int]) -> float:
    """Half a unit of the last digit, relative to the largest number, of the column that is written coarsest.

    That of a double from 16 digits on.  A column that does not change, or is 0, says nothing.
    """
    found = 2.0**-53
    for i in columns:
        cells = {row[i] for row in rows[:1000]}
        digits = max(map(_digits, cells))
        if len(cells) > 1 and 0 < digits < 16:
            found = max(found, 0.5 * 10.0 ** (1 - digits))
    return found


def _digits(cell: str) -> int:
    return len(re.sub(r"[eEdD].*$", "", cell).lstrip("+-").replace(".", "").lstrip("0"))
