"""Lines of a text file, gzipped or not, read one by one and bounded by the size of a trajectory."""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from pathlib import Path

from springcheck.errors import StoreError

LONGEST_LINE = 1 << 24
"""Characters."""
MOST_NUMBERS = 1 << 24
"""Numbers of one trajectory."""
LONGEST_TEXT, MOST_BARE = 1 << 30, 1 << 20
"""Characters of a text, unpacked, and lines beyond two for each of its numbers: a few kilobytes of gzip
unpack to gigabytes of comments."""


class Lines:
    """A cursor over the lines of a text; StopIteration at its end."""

    def __init__(self, path: Path) -> None:
        with path.open("rb") as raw:
            zipped = raw.read(2) == b"\x1f\x8b"
        self.path, self.number, self._numbers, self._size = path, 0, 0, 0
        self._file = (
            gzip.open(path, "rt", encoding="utf-8-sig") if zipped else path.open(encoding="utf-8-sig")  # noqa: SIM115
        )

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line = self._file.readline(LONGEST_LINE)
        if not line:
            raise StopIteration
        self.number += 1
        if len(line) == LONGEST_LINE:
            raise self.wrong(f"is longer than {LONGEST_LINE >> 20} MiB")
        self._size += len(line)
        if self._size > LONGEST_TEXT or self.number > MOST_BARE + 2 * self._numbers:
            raise self.wrong(f"{self.number:,} lines with {self._numbers:,} numbers: leave out the rest")
        return line.rstrip("\r\n")

    def take(self) -> str:
        """The next line of a frame.  StoreError at the end of the file."""
        for line in self:
            return line
        raise self.wrong("is damaged or cut off")

    def wrong(self, what: str) -> StoreError:
        """An error that names file and line."""
        return StoreError(f"{self.path}, line {self.number}: {what}")

    def count(self, numbers: int) -> None:
        """Count numbers that were read.  StoreError where there are more than a trajectory may have."""
        self._numbers += numbers
        if self._numbers > MOST_NUMBERS:
            raise self.wrong(
                f"more than {MOST_NUMBERS:,} numbers: keep fewer frames, or choose among the columns"
            )

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
