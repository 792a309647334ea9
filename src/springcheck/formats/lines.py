"""Lines of a text file, gzipped or not, and the numbers in their cells."""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from pathlib import Path

from springcheck.errors import StoreError

MOST_NUMBERS = 1 << 24
"""Numbers of one trajectory."""


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


BARE_EXPONENT = re.compile(r"^([+-]?\d*\.\d*)([+-]\d{3})$")
"""Fortran omits the letter of an exponent of three digits."""


def number(cell: str) -> float:
    """The number in a cell, also with Fortran's exponents (1.5D+00, 1.5-100).  ValueError where there is
    none."""
    if "_" in cell:
        # Python's own way to write a number
        raise ValueError(f"could not convert string to float: {cell!r}")
    try:
        return float(cell)
    except ValueError:
        if len(cell) < 64:
            return float(BARE_EXPONENT.sub(r"\1e\2", cell).replace("d", "e").replace("D", "e"))
        raise
