"""The sha256 of every array, group, table and document of a store, listed in its table `digests`.

A recorded array carries the sha256 of its numbers as an attribute, which `Draft` computes while it writes
them; its digest here is of its attributes, shape and type, and so covers that one.  Digests can be written
without a key: they find accidents and careless edits, not a forger.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import h5py

from springcheck.errors import StoreError
from springcheck.store import access, tables
from springcheck.store.layout import QUANTITIES

NAME = "digests"
DEEPEST = 10
BLOCK = 1 << 20
"""Bytes that are hashed at a time."""
HOLES = 64
"""Largest ratio of the bytes that arrays claim to those that their file takes on the disk."""
SCALES = {"CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST"}
"""Attributes of dimension scales: addresses in the file, which a copy changes."""


class Extent(NamedTuple):
    """The bytes of a recorded array: its path, offset and size [B], and its sha256."""

    name: str
    offset: int
    size: int
    sha256: str


def blocks(file: BinaryIO, start: int, size: int) -> Iterator[bytes]:
    """The bytes of a range, block by block; stops early where the file ends."""
    file.seek(start)
    while size > 0 and (block := file.read(min(BLOCK, size))):
        size -= len(block)
        yield block


def sha256(file: BinaryIO, start: int, size: int) -> str:
    """sha256 of a range of bytes, in bounded memory."""
    total = hashlib.sha256()
    for block in blocks(file, start, size):
        total.update(block)
    return total.hexdigest()


def broken(path: Path, extents: Iterable[Extent]) -> list[str]:
    """Names of the arrays whose bytes do not match their sha256."""
    with path.open("rb") as file:
        return [one.name for one in extents if sha256(file, one.offset, one.size) != one.sha256]


def combined(digests: Mapping[str, str], arrays: Mapping[str, Any]) -> str:
    """Digest of a trajectory: sha256 over the sha256 of its times and quantities, with their shapes.

    Little-endian float64, without clock or machine: equal exactly when two runs agree bit for bit.
    """
    lines = [
        f"{name} {arrays[name].shape} {digests[name]}" for name in ("time", *QUANTITIES) if name in digests
    ]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def contents(file: Any) -> tuple[dict[str, str], list[Extent]]:
    """sha256 of every object of a file by its path, and its recorded arrays.

    An object that is refused has none.  StoreError where arrays claim the same bytes twice.
    """
    found = {"/": _sha256(file, b"")}
    extents: list[Extent] = []
    known: dict[int, str] = {}
    for place, at, node in access.walk(file, DEEPEST, lambda place, node: place != NAME):
        # times and steps are one array under many names
        if at not in known and place != NAME:
            try:
                known[at] = _of(file, place, file[place] if node is None else node, extents)
            except StoreError as error:
                known[at] = f"none: {error}"
        found |= {f"/{place}": known[at]} if at in known else {}
    end = 0
    for one in sorted(extents, key=lambda one: one.offset):
        if one.offset < end:
            raise StoreError(f"cannot read {file.filename}: {one.name} overlaps another array")
        end = one.offset + one.size
    # a file of holes would be hashed for hours
    blocks = getattr(Path(file.filename).stat(), "st_blocks", end) if file.mode == "r" else end
    if end > HOLES * 512 * blocks:
        raise StoreError(f"cannot read {file.filename}: its arrays are holes, which take no room on the disk")
    return found, extents


def _of(file: Any, place: str, node: Any, extents: list[Extent]) -> str:
    """The digest of an object; a recorded array is also appended to `extents`."""
    if not isinstance(node, h5py.Dataset):
        return _sha256(node, b"")
    how, recorded = access.storage(node), access.attribute(node, "sha256")
    # of a fill value alone nothing is stored
    if node.size and (node.id.get_storage_size() or how.layout == access.VIRTUAL):
        node = access.dataset_at(file, place, packed=True)
    about = f"{node.shape} {node.dtype.str} {how.layout} {how.views}".encode("utf-8", "surrogatepass")
    if isinstance(recorded, str) and how.layout == access.CONTIGUOUS:
        size = node.size * node.dtype.itemsize
        extents.append(Extent(f"/{place}", node.id.get_offset() or 0, size, recorded))
    elif how.layout not in (access.CHUNKED, access.VIRTUAL):
        values = access.column(node)
        words = "\0".join(map(str, values.ravel())).encode("utf-8", "surrogatepass")
        about += words if values.dtype == object else values.tobytes()
    return _sha256(node, about)


def _sha256(node: Any, content: bytes) -> str:
    known = {name: x for name, x in access.attributes(node).items() if name not in SCALES}
    return hashlib.sha256(repr(sorted(known.items())).encode("utf-8", "surrogatepass") + content).hexdigest()


def write(file: Any) -> tuple[dict[str, str], list[Extent]]:
    """Add the table of digests to a complete file -> what it lists, and the recorded arrays."""
    found, extents = contents(file)
    about = {"about": "sha256 of the attributes and content of every object; of arrays see their attribute"}
    columns = {"path": [*found], "sha256": [*found.values()]}
    tables.write(file, tables.Table(name=NAME, columns=columns, attributes=about))
    return found, extents


def read(file: Any) -> dict[str, str]:
    """The digests that a file lists.  StoreError where it has no such table."""
    group = access.group_at(file, NAME)
    if group is None:
        raise StoreError(f"cannot read {file.filename}: the list of its digests is missing")
    found = tables.read(group, NAME).columns
    return dict(zip(map(str, found.get("path", ())), map(str, found.get("sha256", ())), strict=False))
