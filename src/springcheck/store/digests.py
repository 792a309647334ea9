"""The sha256 of every array, group, table and document of a collection, and the list of them.

The seal (see `seal`) ends with the first edit by another program.  These digests stay, and show what was
changed and what was not.  They can be written without a key: they find accidents and careless edits, not a
forger.

A recorded array carries the sha256 of its numbers as an attribute, which `Draft` computes while it writes
them and the seal repeats.  The digest here is of its attributes, shape, type and storage, and so covers that
one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import h5py

from springcheck.store import access, tables
from springcheck.store.layout import QUANTITIES
from springcheck.store.seal import Extent

KEY = "digests"
"""The attribute of the root that keeps the digests."""

LAID_OUT = ("h5md", "observables", "particles")
"""Groups of the root whose members have a digest each; stores of earlier formats list none of them."""
MOST_OBJECTS = 64 * access.MOST_MEMBERS
DEEPEST = 4
"""Bounds on the objects below these groups, and on their depth: the needs of a store with the most
trajectories."""


def combined(digests: Mapping[str, str], arrays: Mapping[str, Any]) -> str:
    """Digest of a trajectory: sha256 over the sha256 of its times and quantities, with their shapes.

    Little-endian float64, without clock or machine: equal exactly when two runs agree bit for bit.
    """
    lines = [
        f"{name} {arrays[name].shape} {digests[name]}" for name in ("time", *QUANTITIES) if name in digests
    ]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def of_table(group: Any) -> str:
    """sha256 of a table: its columns with names, shapes, values and attributes, and its own attributes."""
    total = hashlib.sha256(_attributes(group, "sha256"))
    for name, dataset in sorted(access.columns(group).items()):
        text = access.is_text(dataset)
        kind = "|O" if text else dataset.dtype.str
        total.update(f"{name} {dataset.shape} {kind}\n".encode() + _attributes(dataset))
        values = access.column(dataset)
        if text:
            total.update("\0".join(map(str, values.ravel())).encode("utf-8", "surrogatepass"))
        else:
            total.update(values.tobytes())
    return total.hexdigest()


def of_run(file: Any, label: str) -> str:
    """sha256 of everything known of a trajectory: metadata, the digest of its numbers, and its masses."""
    total = hashlib.sha256(_attributes(access.group_at(file, f"parameters/{label}")))
    mass = f"particles/{label}/mass"
    if access.find(file, mass) is not None:
        total.update(access.column(access.dataset_at(file, mass)).tobytes())
    return total.hexdigest()


def contents(file: Any) -> tuple[dict[str, str], list[Extent]]:
    """sha256 of every object of a collection by its path, and its recorded arrays as the seal lists them."""
    found = {"/": hashlib.sha256(_attributes(file, KEY)).hexdigest()}
    extents: list[Extent] = []
    known: dict[int, str] = {}
    for below, at, node in access.walk(file, MOST_OBJECTS, DEEPEST, lambda place, node: _is_laid_out(place)):
        if _is_laid_out(below):
            # times and steps are one array under many names
            if at not in known:
                known[at] = _of_object(below, file[below] if node is None else node, extents)
            found[f"/{below}"] = known[at]
    for label in access.children(file, "parameters"):
        found[f"/parameters/{label}"] = of_run(file, label)
    every_store_has = {"comparison", "verdicts"} & {*access.members(file)}
    for name in (*tables.names(file), *sorted(every_store_has)):
        found[f"/{name}"] = of_table(access.group_at(file, name))
    for name in access.children(file, "documents"):
        text = access.text(file, f"documents/{name}")
        found[f"/documents/{name}"] = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    return found, extents


def _is_laid_out(place: str) -> bool:
    return place.partition("/")[0] in LAID_OUT


def _of_object(place: str, node: Any, extents: list[Extent]) -> str:
    """The digest of a group or dataset; a recorded array is also appended to `extents`."""
    attributes = access.attributes(node)
    total = hashlib.sha256(_listed(attributes))
    if isinstance(node, h5py.Dataset):
        how, said = access.StoredAs.of(node), attributes.get("sha256")
        text = f"{node.shape} {node.dtype.str} {how.layout} {how.chunk} {how.views}"
        total.update(text.encode("utf-8", "surrogatepass"))
        if how.layout == h5py.h5d.CONTIGUOUS and isinstance(said, str):
            size = node.size * node.dtype.itemsize
            extents.append(Extent(name=f"/{place}", offset=node.id.get_offset() or 0, size=size, sha256=said))
    return total.hexdigest()


def _attributes(node: Any, *left_out: str) -> bytes:
    return _listed({key: value for key, value in access.attributes(node).items() if key not in left_out})


def _listed(attributes: Mapping[str, Any]) -> bytes:
    return repr(sorted(attributes.items())).encode("utf-8", "surrogatepass")
