"""Text tables: columns of numbers between commas, semicolons, tabs or blanks, with or without names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import States, named, split

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
    chosen = list(names) or header
    if not chosen:
        raise StoreError(f"{path}: its {len(rows[0])} columns have no names; give them, as --columns t,q,v")
    values = np.array([[float(cell) for cell in row] for row in rows])
    return split(path, named(path, values, chosen), _roundoff(rows))


def _cells(line: str) -> list[str]:
    text = line.strip().lstrip("#").strip()
    # a name may hold a blank, as in "t [s]", where something else lies between the columns
    parts = re.split(r"\s*[,;\t]\s*", text) if re.search(r"[,;\t]", text) else text.split()
    return [part for part in parts if part]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _roundoff(rows: Sequence[Sequence[str]]) -> float:
    """Half a unit of the last digit that is written, relative; that of a double from 17 digits on."""
    digits = 0
    for row in rows[:1000]:
        for cell in row:
            plain = re.sub(r"[eEdD].*$", "", cell).lstrip("+-").replace(".", "").lstrip("0")
            digits = max(digits, len(plain))
    return max(2.0**-53, 0.5 * 10.0 ** (1 - digits)) if digits < 16 else 2.0**-53
