"""Is a store what it was when it was written?  Every byte against the seal, then the structure."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from springcheck.errors import StoreError
from springcheck.store import access, digests, files, layout, records, seal, space, tables, trust
from springcheck.store.layout import Column
from springcheck.store.parts import Parts

NO_STORE = "no store of springcheck"
MOST_FINDINGS = 1000
LONGEST_CHECK = 1 << 31
"""Bytes of a file that a command checks before it shows numbers of it; `check` reads them all."""


@dataclass(frozen=True, slots=True)
class Damage:
    """Something wrong with a store: an HDF5 path or a file, and what is wrong there."""

    place: str
    what: str


def check(path: str | Path, *, most: int | None = None) -> list[Damage]:
    """Everything wrong with a store and its journal; an empty list where all is well.

    Bytes against the seal, digests, missing and misshapen datasets, H5MD structure.  Of a file of more
    than `most` bytes the recorded arrays are left out, and that is a finding.  Raises StoreError when
    there is nothing to check: no such file, or one that cannot be opened at all.
    """
    path = Path(path)
    everything = Parts.of(path, None).everything
    if not everything:
        with files.told(path, "read"), path.open("rb"):
            pass
        if not path.is_dir():
            raise StoreError(f"cannot read {path}: it is a device or a pipe, a store is a file")
    found: list[Damage] = []
    for part in everything:
        where = "" if part == path else f"{part.name}: "
        found += [Damage(where + f.place, f.what) for f in check_file(part, most)]
    return found


def doubts(path: str | Path) -> list[Damage]:
    """What cannot be trusted of a store whose numbers are about to be shown; none of a file of others."""
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
                    for name in seal.broken(path, known)
                ]
            else:
                size = files.readable(known.end)
                found.append(Damage("/observables", f"not checked, {size} long: check does it"))
            if seal.is_whole(path, known):
                return found + list(structure(path, arrays=False))
            found.append(
                Damage("/", "bytes of groups, attributes or tables have changed since it was written")
            )
    try:
        said = [Damage(place, what) for place, what in json.loads(trust.guarded(path, trust.OURS))]
        # of what is no store nothing else needs to be said
        found = said if said and NO_STORE in said[0].what else found + said
    except StoreError as error:
        found.append(Damage("/", str(error)))
    except ValueError:
        found.append(Damage("/", "it is damaged, reading it crashes the HDF5 library"))
    return found


def structure(path: Path, *, arrays: bool = True) -> list[Damage]:
    """What libhdf5 finds: H5MD, one complete set of arrays per label, digests, tables.

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
        found.append(Damage("/", str(error)))
    return found


def _structure(file: Any, *, arrays: bool) -> Iterator[Damage]:
    root = access.attributes(file)
    if root.get("format") != layout.FORMAT:
        what = {
            layout.EXPORTED: "is an exported trajectory",
            layout.OLDER: "was written by an older springcheck",
        }.get(str(root.get("format")), f"is not marked as {layout.FORMAT!r}")
        yield Damage("/", f"{what}, {NO_STORE}")
        return
    head = access.group_at(file, "h5md")
    if head is None or access.attributes(head).get("version") != [1, 1]:
        yield Damage("/h5md", "missing, or not version 1.1")
    for name in ("author", "creator"):
        group = access.group_at(file, f"h5md/{name}")
        if group is None or "name" not in access.attributes(group):
            yield Damage(f"/h5md/{name}", "missing")
    trees = ("parameters", "observables", "particles")
    for label in sorted({label for tree in trees for label in access.children(file, tree)}):
        try:
            yield from _trajectory(file, label, arrays=arrays)
        except files.BROKEN as error:
            yield Damage(f"/observables/{label}", f"cannot be read: {files.cause(error)}")
        except StoreError as error:
            yield Damage(f"/observables/{label}", str(error))
    if "part" in root:
        return
    yield from _contents(file, root)


def _contents(file: Any, root: dict[str, Any]) -> Iterator[Damage]:
    """What is missing, added or another than its digest."""
    try:
        kept = access.json(str(root.get(digests.KEY)), dict[str, str])
    except ValueError:
        yield Damage("/", "the list of its digests is missing")
        return
    now = digests.contents(file, tables.all_names(file))
    for place in sorted(kept.keys() | now.keys()):
        if place not in now:
            yield Damage(place, "missing")
        elif place not in kept:
            yield Damage(place, "was added after it was written")
        elif kept[place] != now[place]:
            whole = "attributes" if place == "/" or place.startswith("/parameters/") else "content"
            yield Damage(place, f"its {whole} changed since it was written (sha256)")


def _trajectory(file: Any, label: str, *, arrays: bool) -> Iterator[Damage]:
    place = f"/parameters/{label}"
    group = access.group_at(file, place)
    if group is None:
        yield Damage(place, "missing")
        return
    try:
        known = records.record(place, access.attributes(group))
    except StoreError as error:
        yield Damage(place, str(error))
        return
    found: dict[str, str] = {}
    whole = True
    columns: dict[str, Column] = {}
    for name in known.kept:
        shape = layout.shape(name, known.frames, known.particles)
        for kind, expected in (("value", shape), ("time", shape[:1]), ("step", shape[:1])):
            at = f"/observables/{label}/{name}/{kind}"
            try:
                dataset = access.array(file, at, expected, "i" if kind == "step" else "f")
            except StoreError as error:
                whole = False
                yield Damage(at, str(error))
                continue
            key = name if kind == "value" else kind
            if not arrays or key in found or kind == "step":
                continue
            found[key] = digests.of_array(dataset)
            columns[key] = Column(path=at, shape=expected)
            if access.attributes(dataset).get("sha256") != found[key]:
                whole = False
                yield Damage(at, "does not match its sha256")
    # reduced numbers had those of H5MD in earlier files
    every = layout.recorded(known.kind, known.units), layout.UNITS[known.kind, known.units]
    for name in (*known.kept, "time"):
        at = f"/observables/{label}/" + (f"{name}/value" if name in known.kept else f"{known.kept[0]}/time")
        node = access.find(file, at)
        said = {} if node is None else access.attributes(node)
        if not any(said.get("unit") == said.get("units") == units[name] for units in every):
            yield Damage(at, f"its unit is not {every[0][name]}")
    if arrays and whole and digests.combined(found, columns) != known.sha256:
        yield Damage(place, "its sha256 is not that of the numbers")
    if known.kind == "particles":
        yield from _particles(file, label, known)


def _particles(file: Any, label: str, known: records.RunRecord) -> Iterator[Damage]:
    base = f"/particles/{label}"
    try:
        shape = (known.frames, int(np.max(space.places_of(known.axes, known.particles))) // 3 + 1, 3)
    except StoreError as error:
        yield Damage(f"/parameters/{label}", f"its {error}")
        return
    for name, source in (("position", "q"), ("velocity", "p")):
        if source not in known.kept:
            continue
        at = f"{base}/{name}/value"
        view = access.find(file, at)
        whose = name if name in access.children(file, f"observables/{label}") else source
        inside = {(".", f"/observables/{label}/{whose}/value")}
        if not isinstance(view, h5py.Dataset):
            yield Damage(at, "missing")
        elif set(access.views(view) or ()) != inside:
            yield Damage(at, f"is no view of the recorded {whose}")
        elif view.shape != shape:
            yield Damage(at, f"has shape {view.shape}, not {shape}")
        elif "unit" not in access.attributes(view):
            yield Damage(at, "attribute unit is missing")
        for kind in ("time", "step"):
            if access.find(file, f"{base}/{name}/{kind}") is None:
                yield Damage(f"{base}/{name}/{kind}", "missing")
    if {"q", "p"} & set(known.kept):
        box = access.group_at(file, f"{base}/box")
        if box is None or not {"dimension", "boundary"} <= access.attributes(box).keys():
            yield Damage(f"{base}/box", "missing, or without dimension and boundary")
