"""Is a store what it was when it was written?  Every byte against the seal, then the structure."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from springcheck.errors import StoreError
from springcheck.store import files, layout, reading, seal, tables, trust
from springcheck.store.draft import combined
from springcheck.store.layout import Column

PIECE = 1 << 20

NO_STORE = "no store of springcheck"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something wrong with a store: an HDF5 path or a file, and what is wrong there."""

    place: str
    what: str


def check(path: str | Path) -> list[Finding]:
    """Everything wrong with a store and its journal; an empty list where all is well.

    Bytes against the seal, digests, missing and misshapen datasets, H5MD structure.  Raises StoreError
    when there is nothing to check: no such file, or one that cannot be opened at all.
    """
    path = Path(path)
    parts = reading.Parts.of(path, None)
    everything = ([path] if path.is_file() else []) + parts.parts
    if not everything:
        with files.told(path, "read"), path.open("rb"):
            pass
    found: list[Finding] = []
    for part in everything:
        where = "" if part == path else f"{part.name}: "
        found += [Finding(place=where + f.place, what=f.what) for f in check_file(part)]
    return found


def check_file(path: Path) -> list[Finding]:
    """The same for one file."""
    found: list[Finding] = []
    with files.told(path, "read"):
        known = seal.find(path)
        if not h5py.is_hdf5(path):
            return [Finding(place="/", what="is no HDF5 file")]
        if known is None:
            found.append(
                Finding(place="/", what="no seal at the end: cut off, or changed by another program")
            )
        else:
            found += [
                Finding(place=name, what="its bytes have changed since it was written")
                for name in seal.broken(path, known)
            ]
            if seal.is_whole(path, known):
                named = {finding.place for finding in found}
                return found + [finding for finding in structure(path) if finding.place not in named]
            found.append(
                Finding(
                    place="/", what="bytes of groups, attributes or tables have changed since it was written"
                )
            )
    try:
        said = trust.guarded(path, trust.OURS)
        said_of = [Finding(place=place, what=what) for place, what in json.loads(said)]
        # of what is no store nothing else needs to be said
        found = said_of if said_of and NO_STORE in said_of[0].what else found + said_of
    except StoreError as error:
        found.append(Finding(place="/", what=str(error)))
    return found


def structure(path: Path) -> Iterator[Finding]:
    """What libhdf5 finds: H5MD, one complete set of arrays per label, digests, tables."""
    try:
        with files.told(path, "read"), h5py.File(path, "r", locking="best-effort") as file:
            marked = file.attrs.get("format")
            if marked == layout.EXPORTED:
                yield Finding(place="/", what=f"is an exported trajectory, {NO_STORE}")
                return
            if marked != layout.FORMAT:
                yield Finding(place="/", what=f"is not marked as {layout.FORMAT!r}: {NO_STORE}")
                return
            if "h5md" not in file or file["h5md"].attrs.get("version", np.zeros(2)).tolist() != [1, 1]:
                yield Finding(place="/h5md", what="missing, or not version 1.1")
            for name in ("author", "creator"):
                if f"h5md/{name}" not in file or "name" not in file[f"h5md/{name}"].attrs:
                    yield Finding(place=f"/h5md/{name}", what="missing")
            labels = set(file.get("parameters", ())) | set(file.get("observables", ()))
            for label in sorted(labels | set(file.get("particles", ()))):
                yield from _each(file, label)
            for name in [*tables.names(file), *({"comparison", "verdicts"} & set(file))]:
                if tables.digest(file[name]) != file[name].attrs.get("sha256"):
                    yield Finding(place=f"/{name}", what="does not match its sha256")
    except StoreError as error:
        yield Finding(place="/", what=str(error))


def _each(file: Any, label: str) -> Iterator[Finding]:
    """One trajectory; whatever cannot be read is a finding of its own."""
    try:
        yield from _trajectory(file, label)
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError, MemoryError) as error:
        yield Finding(place=f"/observables/{label}", what=f"cannot be read: {files.cause(error)}")


def _trajectory(file: Any, label: str) -> Iterator[Finding]:
    place = f"/parameters/{label}"
    if place not in file:
        yield Finding(place=place, what="missing")
        return
    known = file[place].attrs
    for name in ("sha256", "frames", "particles", "scene", "kind", "quantities"):
        if name not in known:
            yield Finding(place=place, what=f"attribute {name} is missing")
            return
    frames, n = int(known["frames"]), int(known["particles"])
    quantities = str(known["quantities"]).split()
    digests: dict[str, str] = {}
    whole = True
    columns: dict[str, Column] = {}
    for name in quantities:
        shape = (frames,) if name == "energy" else (frames, n)
        wanted = {"value": shape, "time": (frames,), "step": (frames,)}
        for kind, expected in wanted.items():
            at = f"/observables/{label}/{name}/{kind}"
            if not isinstance(file.get(at), h5py.Dataset):
                yield Finding(place=at, what="missing")
            elif file[at].shape != expected:
                yield Finding(place=at, what=f"has shape {file[at].shape}, not {expected}")
            elif file[at].dtype.kind not in "fi":
                yield Finding(place=at, what=f"is of type {file[at].dtype}, not numbers")
            elif kind == "value" or (kind == "time" and "time" not in digests):
                key = "time" if kind == "time" else name
                digests[key] = _digest(file[at])
                columns[key] = Column(path=at, shape=expected)
                if file[at].attrs.get("sha256") != digests[key]:
                    whole = False
                    yield Finding(place=at, what="does not match its sha256")
    if whole and len(digests) == len(quantities) + 1 and combined(digests, columns) != known["sha256"]:
        yield Finding(place=place, what="its sha256 is not that of the numbers")
    if known["kind"] == "particles":
        yield from _particles(file, label, quantities, frames, n)


def _particles(file: Any, label: str, quantities: list[str], frames: int, n: int) -> Iterator[Finding]:
    base = f"/particles/{label}"
    for name, source in (("position", "q"), ("velocity", "p")):
        if source not in quantities:
            continue
        for kind, expected in (("value", (frames, n, 3)), ("time", (frames,)), ("step", (frames,))):
            at = f"{base}/{name}/{kind}"
            if not isinstance(file.get(at), h5py.Dataset):
                yield Finding(place=at, what="missing")
            elif file[at].shape != expected:
                yield Finding(place=at, what=f"has shape {file[at].shape}, not {expected}")
            elif kind != "step" and "unit" not in file[at].attrs:
                yield Finding(place=at, what="attribute unit is missing")
    if {"q", "p"} & set(quantities):
        box = file.get(f"{base}/box")
        if box is None or not {"dimension", "boundary"} <= set(box.attrs):
            yield Finding(place=f"{base}/box", what="missing, or without dimension and boundary")


def _digest(dataset: Any) -> str:
    total = hashlib.sha256()
    rows = max(1, PIECE // max(1, int(np.prod(dataset.shape[1:]))))
    for start in range(0, len(dataset), rows):
        total.update(np.ascontiguousarray(dataset[start : start + rows], dtype="<f8").data)
    return total.hexdigest()
