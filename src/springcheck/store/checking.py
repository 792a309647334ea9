"""Verification of a store: every object against its digest, every array against its sha256."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from springcheck.errors import StoreError
from springcheck.store import access, apart, collection, digests, files, layout, parts, reading

NO_STORE = "no store of springcheck"
MOST_FINDINGS = 1000
LONGEST_CHECK = 1 << 31
"""Bytes of a file that a command verifies before it shows its numbers; `check` verifies all."""


@dataclass(frozen=True, slots=True)
class Damage:
    """Damage of a store: an HDF5 path or a file, and what is wrong there."""

    place: str
    what: str


def check(path: str | Path, *, most: int | None = None) -> list[Damage]:
    """All damage of a store and its journal; an empty list where there is none.

    In a file of more than `most` bytes the recorded arrays are not read, which is a finding.  Raises
    StoreError when there is nothing to check: no such file, or one that cannot be opened at all.
    """
    path = Path(path)
    everything = parts.Parts.of(path).everything
    if not everything:
        with files.told(path, "read"), path.open("rb"):
            pass
        raise StoreError(f"cannot read {path}: it is a device or a pipe, a store is a file")
    found: list[Damage] = []
    for part in everything:
        where = "" if part == path else f"{part.name}: "
        found += [Damage(where + f.place, f.what) for f in check_file(part, most)]
    return found


def is_store(path: Path) -> bool:
    """Whether an HDF5 file is a store of ours, not one of another program."""
    if not files.is_marked(path):
        return False
    apart.trust(path, parts.TRIAL)
    with access.for_reading(path) as file:
        return access.attribute(file, "format") in (layout.FORMAT, *layout.OLDER)


def doubts(path: str | Path) -> list[Damage]:
    """Damage of a store whose numbers are about to be shown; none for a file of another program."""
    path = Path(path)
    if path.is_file() and not files.is_marked(path):
        return []
    found = check(path, most=LONGEST_CHECK)
    return [] if any(NO_STORE in finding.what for finding in found) else found


def check_file(path: Path, most: int | None = None) -> list[Damage]:
    """The same for one file, of which the first findings are given."""
    with files.told(path, "read"), path.open("rb"):
        size = path.stat().st_size
    try:
        apart.trust(path, parts.TRIAL)
        with access.for_reading(path) as file:
            return [*islice(_structure(file, arrays=most is None or size <= most), MOST_FINDINGS)]
    except StoreError as error:
        return [Damage("/", str(error).removeprefix(f"cannot read {path}: "))]


def tried(path: Path) -> bytes:
    """Read a store, or every part of a journal, in a child process (see `apart`).

    StoreError where not all of it can be looked at; MemoryError where libhdf5 could not allocate: elsewhere
    it could, and would fill the memory.
    """
    for part in [one for listed in parts.parts_in(path) for one in listed] if path.is_dir() else [path]:
        try:
            with access.for_reading(part) as file:
                for _ in islice(_structure(file, arrays=False), MOST_FINDINGS):
                    pass
        except StoreError as error:
            if re.search(r"allocation failed|(unable to|can't) allocate|more memory", str(error)):
                raise MemoryError from error
            raise
    return b""


def _structure(file: Any, *, arrays: bool) -> Iterator[Damage]:
    """Objects that are missing, were added, or differ from their digest."""
    try:
        collection.is_ours(file)
    except StoreError as error:
        said = str(error).partition(": ")[2]
        yield Damage("/", said if NO_STORE in said else f"{said}, {NO_STORE} that can be read here")
        return
    now, extents = digests.contents(file)
    for label in access.children(file, "parameters"):
        try:
            reading.run_and_arrays(file, label)
        except StoreError as error:
            yield Damage(f"/observables/{label}", str(error).partition(": ")[2])
    listed = digests.read(file) if access.attribute(file, "format") == layout.FORMAT else now
    for place in sorted(listed.keys() | now.keys()):
        if place not in now:
            yield Damage(place, "missing")
        elif place not in listed:
            yield Damage(place, "was added after it was written")
        elif listed[place] != now[place]:
            yield Damage(place, "changed since it was written (sha256)")
    if not arrays:
        yield Damage("/observables", "arrays not checked, they are long: check does it")
        return
    for name in digests.broken(Path(file.filename), extents):
        yield Damage(name, "its numbers changed since they were written (sha256)")
