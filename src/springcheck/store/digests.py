"""What a collection holds, under sha256: numbers, attributes, tables, documents, and that none is missing.

The seal (see `seal`) ends with the first edit by another program.  These digests stay, and tell what was
changed and what was not.  Nobody needs a key to write them: they find accidents and careless edits, not
a forger.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from springcheck.store import access
from springcheck.store.layout import QUANTITIES, Column

PIECE = 1 << 20
"""Numbers that are read at a time."""

KEY = "digests"
"""The attribute of the root that keeps them."""


def combined(digests: Mapping[str, str], columns: Mapping[str, Column]) -> str:
    """The digest of a trajectory: sha256 over the sha256 of its times and quantities, with their shapes.

    Little-endian float64, nothing of clock or machine: equal exactly when two runs agree bit for bit.
    """
    lines = [
        f"{name} {columns[name].shape} {digests[name]}" for name in ("time", *QUANTITIES) if name in digests
    ]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def of_array(dataset: Any) -> str:
    """sha256 of a recorded array, in bounded memory."""
    total = hashlib.sha256()
    for values in blocks(dataset):
        total.update(np.ascontiguousarray(values).data)
    return total.hexdigest()


def of_table(group: Any) -> str:
    """sha256 of a table: its columns with names, shapes, values and attributes, and its own attributes."""
    total = hashlib.sha256(_attributes(group, "sha256"))
    for name, dataset in sorted(access.columns(group).items()):
        text = access.is_text(dataset)
        kind = "|O" if text else dataset.dtype.str
        total.update(f"{name} {dataset.shape} {kind}\n".encode() + _attributes(dataset))
        if text:
            total.update("\0".join(map(str, access.column(dataset).ravel())).encode("utf-8", "surrogatepass"))
            continue
        for values in blocks(dataset):
            total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()


def blocks(dataset: Any) -> Iterator[np.ndarray]:
    """A column piece by piece, in bounded memory where it holds numbers."""
    rows = max(1, PIECE // max(1, int(np.prod(dataset.shape[1:]))))
    if access.is_text(dataset) or dataset.ndim == 0 or len(dataset) <= rows:
        yield access.column(dataset)
        return
    for start in range(0, len(dataset), rows):
        yield access.column(dataset, slice(start, start + rows))


def of_run(file: Any, label: str) -> str:
    """sha256 of what is known of a trajectory, the digest of its numbers in it, and of its masses."""
    total = hashlib.sha256(_attributes(access.group_at(file, f"parameters/{label}")))
    mass = f"particles/{label}/mass"
    if access.find(file, mass) is not None:
        total.update(access.column(access.dataset_at(file, mass)).tobytes())
    return total.hexdigest()


def contents(file: Any, tables: Iterable[str]) -> dict[str, str]:
    """Everything in a collection by its place -> sha256."""
    found = {"/": hashlib.sha256(_attributes(file, KEY)).hexdigest()}
    for label in access.children(file, "parameters"):
        found[f"/parameters/{label}"] = of_run(file, label)
    for name in tables:
        found[f"/{name}"] = of_table(access.group_at(file, name))
    for name in access.children(file, "documents"):
        text = access.text(file, f"documents/{name}")
        found[f"/documents/{name}"] = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    return found


def _attributes(node: Any, *left_out: str) -> bytes:
    kept = sorted((key, value) for key, value in access.attributes(node).items() if key not in left_out)
    return repr(kept).encode("utf-8", "surrogatepass")
