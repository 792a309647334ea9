"""The seal at the end of every file of ours accounts for every byte, and is checked without libhdf5.

A file is HDF5 (libhdf5 ignores what follows its end), then a line of JSON, then a line with its length and
sha256.  The JSON lists the recorded arrays, which lie contiguous in the file, as name, offset, length and
sha256, and the sha256 of all other bytes: groups, attributes, small tables.  So a reader knows within
milliseconds that the structure of a file of many gigabytes is as it was written, before libhdf5 follows any
address in it, and which array a flipped byte lies in.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO

import msgspec

BLOCK = 1 << 22
LONGEST = 1 << 24
"""Bytes of the line of JSON."""
LARGEST_REST = 1 << 30
"""Bytes of groups, attributes and tables."""
_FOOT_SIZE = len("springcheck seal 1 ") + 16 + 1 + 64 + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """One recorded array in a file: offset and size [B], sha256 of its bytes in hexadecimal."""

    name: str
    offset: int
    size: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Seal:
    """Digests of a file's bytes as they were written, and the run.  `end` is where HDF5 ends [B]."""

    end: int
    extents: tuple[Extent, ...]
    rest: str
    run: str = ""


def digest(file: BinaryIO, *pieces: tuple[int, int]) -> str:
    """sha256 of ranges of bytes, each given by its offset and size, in bounded memory."""
    total = hashlib.sha256()
    for start, size in pieces:
        for block in blocks(file, start, size):
            total.update(block)
    return total.hexdigest()


def blocks(file: BinaryIO, start: int, size: int) -> Iterator[bytes]:
    """The bytes of a range, block by block; stops early where the file ends."""
    file.seek(start)
    while size > 0:
        block = file.read(min(BLOCK, size))
        if not block:
            return
        size -= len(block)
        yield block


def gaps(extents: Iterable[Extent], end: int) -> Iterator[tuple[int, int]]:
    """Offset and size of the ranges between the arrays."""
    position = 0
    for extent in sorted(extents, key=lambda extent: extent.offset):
        if extent.offset > position:
            yield position, extent.offset - position
        position = max(position, extent.offset + extent.size)
    if end > position:
        yield position, end - position


def attach(path: Path, extents: Iterable[Extent], run: str = "") -> None:
    """Seal a complete HDF5 file of a run."""
    kept = tuple(extents)
    with path.open("rb+") as file:
        end = file.seek(0, 2)
        seal = Seal(end=end, extents=kept, rest=digest(file, *gaps(kept, end)), run=run)
        file.seek(end)
        file.write(encoded(seal))


def sealed(body: bytes, run: str = "") -> bytes:
    """A file without arrays, with its seal."""
    return body + encoded(Seal(end=len(body), extents=(), rest=hashlib.sha256(body).hexdigest(), run=run))


def encoded(seal: Seal) -> bytes:
    """The seal as bytes: the last two lines of a file."""
    line = b"\n" + json.dumps(asdict(seal), separators=(",", ":")).encode() + b"\n"
    return line + _foot(line)


def _foot(line: bytes) -> bytes:
    return b"springcheck seal 1 %016d %s\n" % (len(line), hashlib.sha256(line).hexdigest().encode())


def find(path: Path) -> Seal | None:
    """The seal of a file; None where there is none that can be read.  OSError where the file cannot be."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        if size < _FOOT_SIZE:
            return None
        file.seek(size - _FOOT_SIZE)
        foot = file.read()
        try:
            length = int(foot[19:35])
            if not 0 < length <= min(LONGEST, size - _FOOT_SIZE):
                return None
            file.seek(size - _FOOT_SIZE - length)
            line = file.read(length)
            if foot != _foot(line):
                return None
            seal = msgspec.json.decode(line, type=Seal)
        except (ValueError, msgspec.MsgspecError, RecursionError):
            return None
    # arrays one after the other, as they must be to be read in no more time than the file takes
    position = 0
    for extent in sorted(seal.extents, key=lambda extent: extent.offset):
        if extent.size < 0 or extent.offset < position:
            return None
        position = extent.offset + extent.size
    return seal if position <= seal.end == size - _FOOT_SIZE - length else None


def is_whole(path: Path, seal: Seal) -> bool:
    """Whether everything but the arrays matches the seal. Takes milliseconds, however long the arrays."""
    if seal.end - sum(extent.size for extent in seal.extents) > LARGEST_REST:
        return False
    with path.open("rb") as file:
        return digest(file, *gaps(seal.extents, seal.end)) == seal.rest


def broken(path: Path, extents: Iterable[Extent]) -> list[str]:
    """Names of the arrays whose bytes do not match their sha256."""
    with path.open("rb") as file:
        return [e.name for e in extents if digest(file, (e.offset, e.size)) != e.sha256]
