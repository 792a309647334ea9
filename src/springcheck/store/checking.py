"""Verification of a store: every byte against the seal, then every object against its digest."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from springcheck.errors import StoreError
from springcheck.store import access, digests, files, layout, reading, seal, trust
from springcheck.store.parts import Parts

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

    Bytes are held against the seal, then every object against its digest.  In a file of more than `most`
    bytes the recorded arrays are not read, which is a finding.  Raises StoreError when there is nothing to
    check: no such file, or one that cannot be opened at all.
    """
    path = Path(path)
    everything = Parts.of(path, None).everything
    if not everything:
        with files.told(path, "read"), path.open("rb"):
            pass
        raise StoreError(f"cannot read {path}: it is a device or a pipe, a store is a file")
    found: list[Damage] = []
    for part in everything:
        where = "" if part == path else f"{part.name}: "
        found += [Damage(where + f.place, f.what) for f in check_file(part, most)]
    return found


def doubts(path: str | Path) -> list[Damage]:
    """Damage of a store whose numbers are about to be shown; none for a file of another program."""
    found = check(path, most=LONGEST_CHECK)
    return [] if any(NO_STORE in finding.what for finding in found) else found


def check_file(path: Path, most: int | None = None) -> list[Damage]:
    """The same for one file."""
    found: list[Damage] = []
    with files.told(path, "read"):
        known = seal.find(path)
        if not h5py.is_hdf5(path):
            return [Damage("/", "is no HDF5 file")]
        if known is None:
            found.append(Damage("/", "no seal at the end: cut off, or changed by another program"))
        else:
            if most is None or known.end <= most:
                found += [
                    Damage(name, "its bytes have changed since it was written")
                    for name in seal.broken(path, known.extents)
                ]
            else:
                size = files.readable(known.end)
                found.append(Damage("/observables", f"not checked, {size} long: check does it"))
            if seal.is_whole(path, known):
                return found + list(structure(path, arrays=False))
            found.append(
                Damage("/", "bytes of groups, attributes or tables have changed since it was written")
            )
    said, harmless = trust.tried(path, trust.OURS)
    if not harmless:
        return [*found, Damage("/", said)]
    there = [Damage(place, what) for place, what in json.loads(said)]
    # where the file is no store, no other finding matters
    return there if there and NO_STORE in there[0].what else found + there


def structure(path: Path, *, arrays: bool = True) -> list[Damage]:
    """Objects that are missing, were added, or differ from their digest, as libhdf5 finds them.

    Without `arrays` the numbers themselves are left to the seal.
    """
    found: list[Damage] = []
    try:
        with access.for_reading(path) as file:
            for finding in _structure(file, arrays=arrays):
                found.append(finding)
                if len(found) == MOST_FINDINGS:
                    break
    except StoreError as error:
        found.append(Damage("/", str(error).removeprefix(f"cannot read {files.shown(path)}: ")))
    return found


def tried(path: Path) -> bytes:
    """The findings of `structure` as JSON, computed in a process of its own (see `trust`).  MemoryError where
    libhdf5 could not allocate: elsewhere it could, and would fill the memory."""
    said = json.dumps([(finding.place, finding.what) for finding in structure(path)])
    if re.search(r"allocation failed|(unable to|can't) allocate", said):
        raise MemoryError
    return said.encode()


def _structure(file: Any, *, arrays: bool) -> Iterator[Damage]:
    root = access.attributes(file)
    if root.get("format") != layout.FORMAT:
        older = root.get("format") == layout.OLDER
        what = "was written by an older springcheck" if older else f"is not marked as {layout.FORMAT!r}"
        yield Damage("/", f"{what}, {NO_STORE}")
        return
    now, extents = digests.contents(file)
    try:
        kept = access.json(str(root.get(digests.KEY)), dict[str, str])
    except ValueError:
        kept = {}
        if "part" not in root:
            yield Damage("/", "the list of its digests is missing")
    found = [*_differences(kept, now)] if "/h5md" in kept else [*_before(file, kept, now)]
    yield from found
    if arrays:
        # arrays of another layout may claim any length
        places = {finding.place for finding in found}
        as_laid_out = [x for x in extents if not {x.name, x.name.rsplit("/", 2)[0]} & places]
        for name in seal.broken(Path(file.filename), as_laid_out):
            yield Damage(name, "does not match its sha256")
        if kept and "/h5md" not in kept:
            what = "its list of digests is of before: changes of groups, units and views are not told"
            yield Damage("/", what)


def _before(file: Any, kept: dict[str, str], now: dict[str, str]) -> Iterator[Damage]:
    """Damage that is known without a list of arrays: of a store of an earlier format, or of a part."""
    for label in access.children(file, "parameters"):
        try:
            reading.run_and_arrays(file, label)
        except StoreError as error:
            yield Damage(f"/observables/{label}", str(error))
    if kept:
        tops = digests.LAID_OUT
        yield from _differences(kept, {x: y for x, y in now.items() if x.split("/")[1] not in tops})


def _differences(kept: dict[str, str], now: dict[str, str]) -> Iterator[Damage]:
    """Arrays that are missing, added or differ from their digest."""
    for place in sorted(kept.keys() | now.keys()):
        if place not in now:
            yield Damage(place, "missing")
        elif place not in kept:
            yield Damage(place, "was added after it was written")
        elif kept[place] != now[place]:
            bare = place == "/" or place.split("/")[1] in (*digests.LAID_OUT, "parameters")
            whole = "attributes" if bare else "content"
            yield Damage(place, f"its {whole} changed since it was written (sha256)")
