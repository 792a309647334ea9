"""Objects of an HDF5 file that anyone may have made: each is looked at before any of it is read.

Only what lies in the file itself is read: external storage, external and soft links and virtual datasets
are refused, and so are filters that would load a library.  Sizes, counts, depths and lengths are bounded.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import numpy as np

from springcheck.errors import StoreError
from springcheck.store import files

Scalar: TypeAlias = str | float | int | bool

MOST_MEMBERS = 2_000
"""Members of a group: runs or tables of one file.  Ours have tens; every command slows down with them."""
MOST_ATTRIBUTES = 2_000
LONGEST_NAME = 200
"""Characters of a name."""
LONGEST_TEXT = 1 << 26
"""Bytes of all texts of one dataset, and of one attribute."""
MOST_ITEMS = 10_000
"""Items of an attribute."""
MOST_DIMENSIONS = 4
LARGEST_CHUNK = 1 << 28
"""Bytes."""
EXPANSION = 1100
"""More than deflate can expand (1032): a compressed array that claims more is damaged."""

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32, 32000}
"""Built into h5py; 32000 is its LZF."""


@contextlib.contextmanager
def for_reading(path: Path) -> Iterator[Any]:
    """A file open for reading, whatever it does to libhdf5 (see `trust`).  StoreError where it cannot be."""
    with files.told(path, "read"), h5py.File(path, "r", locking="best-effort") as file:
        yield file


def refuse(node: Any, why: str) -> StoreError:
    """An error that names the file and the object in it."""
    return StoreError(f"cannot read {node.file.filename}: {node.name} {why}")


def is_name(name: str) -> bool:
    """Whether a group or dataset may be called so: printable, not too long, no formula to a figure."""
    return 0 < len(name) <= LONGEST_NAME and name.isprintable() and "$" not in name


def members(group: Any) -> list[str]:
    """Names of what a group links to, the soft and external links left out."""
    count = group.id.get_num_objs()
    if count > MOST_MEMBERS:
        raise refuse(group, f"has {count} members, more than any of ours")
    names = list(group)
    if not all(map(is_name, names)):
        raise refuse(group, f"has members whose names are no text, or longer than {LONGEST_NAME} characters")
    return [name for name in names if _is_hard(group, name)]


def _is_hard(group: Any, name: str) -> bool:
    """Whether what a group has under this name lies in the file itself."""
    return bool(group.id.links.get_info(name.encode()).type == h5py.h5l.TYPE_HARD)


def find(group: Any, path: str) -> Any:
    """The group or dataset at a path below a group; None where there is none.  No other file is opened."""
    node = group
    for name in path.strip("/").split("/"):
        if not isinstance(node, h5py.Group) or not node.id.links.exists(name.encode()):
            return None
        if not _is_hard(node, name):
            raise refuse(
                node, f"has a link {name!r} that leads elsewhere: only what lies in the file is read"
            )
        node = node[name]
    return node


def group_at(file: Any, path: str) -> Any:
    """The group at a path, or None; StoreError where something else stands there."""
    node = find(file, path)
    if node is not None and not isinstance(node, h5py.Group):
        raise refuse(node, "is no group")
    return node


def children(file: Any, path: str) -> list[str]:
    """Names below the group at a path; none where there is no group."""
    group = group_at(file, path)
    return [] if group is None else members(group)


def dataset_at(file: Any, path: str, *, packed: bool = False) -> Any:
    """The dataset at a path, its storage looked at; `packed` allows chunks and compression.

    StoreError where there is none, where its numbers do not lie in the file, or where it claims more
    than the file holds.
    """
    node = find(file, path)
    if node is None:
        raise StoreError(f"cannot read {file.file.filename}: {path} is missing")
    if not isinstance(node, h5py.Dataset):
        raise refuse(node, "is no dataset")
    how = node.id.get_create_plist()
    layout = how.get_layout()
    if how.get_external_count() or layout == h5py.h5d.VIRTUAL:
        raise refuse(node, "lies outside the file: what other files hold is not read")
    if node.ndim > MOST_DIMENSIONS:
        raise refuse(node, f"has {node.ndim} dimensions")
    size = node.file.id.get_filesize()
    claimed = int(np.prod(node.shape, dtype=object)) * node.dtype.itemsize
    if layout == h5py.h5d.CHUNKED:
        used = {how.get_filter(i)[0] for i in range(how.get_nfilters())}
        chunk = int(np.prod(how.get_chunk(), dtype=object)) * node.dtype.itemsize
        if not packed or used - _FILTERS:
            raise refuse(node, "is stored in a way that is not read")
        stored = node.id.get_storage_size()
        # libhdf5 makes room for as many bytes as a chunk says that it takes in the file
        if chunk > LARGEST_CHUNK or stored > size or claimed > EXPANSION * stored:
            raise refuse(node, f"claims {claimed} bytes, more than the file holds")
    elif layout == h5py.h5d.CONTIGUOUS and claimed:
        offset = node.id.get_offset()
        if offset is None or offset + claimed > size:
            raise refuse(node, f"claims {claimed} bytes, more than the file holds")
    return node


def array(file: Any, path: str, shape: tuple[int, ...], kinds: str = "f") -> Any:
    """A recorded array: contiguous, of this shape, float64 ("f") or integer ("i")."""
    node = dataset_at(file, path)
    if node.shape != shape:
        raise refuse(node, f"has shape {node.shape}, not {shape}")
    wanted = {"f": ("<f8",), "i": ("<i4", "<i8")}[kinds]
    if node.dtype.str not in wanted:
        raise refuse(node, f"is of type {node.dtype}, not numbers as we write them")
    return node


def texts(dataset: Any) -> np.ndarray:
    """The texts of a dataset, bounded however often it refers to the same one."""
    if dataset.ndim > 1:
        raise refuse(dataset, "is no list of texts")
    shown = dataset.asstr(errors="backslashreplace")
    if dataset.ndim == 0:
        return np.asarray(shown[()], dtype=object)
    rows = max(1, LONGEST_TEXT // dataset.file.id.get_filesize())
    found: list[str] = []
    length = 0
    for start in range(0, len(dataset), rows):
        found.extend(shown[start : start + rows])
        length += sum(map(len, found[start:]))
        if length > LONGEST_TEXT:
            raise refuse(dataset, "holds more text than any of ours")
    return np.array([*found, None], dtype=object)[:-1]


def text(file: Any, path: str) -> str:
    """The one text of a dataset."""
    node = dataset_at(file, path)
    if node.shape != () or h5py.check_string_dtype(node.dtype) is None:
        raise refuse(node, "is no text")
    return str(texts(node)[()])


def is_text(dataset: Any) -> bool:
    """Whether a column holds texts."""
    return h5py.check_string_dtype(dataset.dtype) is not None


def column(dataset: Any, rows: Any = ()) -> np.ndarray:
    """Numbers, truth values or texts of a table's column; of numbers some rows, if told."""
    if is_text(dataset):
        return texts(dataset)
    if dataset.dtype.kind not in "fiub" or dataset.shape is None:
        raise refuse(dataset, f"is of type {dataset.dtype}, no column of ours")
    return np.asarray(dataset[rows])


def attributes(node: Any) -> dict[str, Any]:
    """The attributes of a node: scalars, and lists of them.  What we never write is named by its type."""
    count = h5py.h5a.get_num_attrs(node.id)
    if count > MOST_ATTRIBUTES:
        raise refuse(node, f"has {count} attributes, more than any of ours")
    # to open one by its number, libhdf5 makes a table of all of them each time
    names: list[bytes] = []
    h5py.h5a.iterate(node.id, names.append)
    found: dict[str, Any] = {}
    for raw in names:
        name = raw.decode("utf-8", "backslashreplace")
        if not is_name(name):
            raise refuse(node, "has an attribute whose name is no text, or too long")
        found[name] = _value(node, h5py.h5a.open(node.id, raw), name)
    return found


def attribute(node: Any, name: str) -> Any:
    """One attribute of a node, or None."""
    known = name.encode()
    return _value(node, h5py.h5a.open(node.id, known), name) if h5py.h5a.exists(node.id, known) else None


def _value(node: Any, known: Any, name: str) -> Any:
    shape, kind = known.shape, known.dtype
    if shape is None:
        return "<nothing>"
    if kind.kind not in "fiubSO" or (kind.kind == "O" and h5py.check_string_dtype(kind) is None):
        return f"<{kind}>"
    items = int(np.prod(shape, dtype=object)) if shape else 1
    if items > MOST_ITEMS or known.get_storage_size() > LONGEST_TEXT:
        raise refuse(node, f"has an attribute {name} of {items} items")
    values = np.empty(shape, kind)
    known.read(values)
    if kind.kind == "O" and sum(len(x or "") for x in values.ravel()) > LONGEST_TEXT:
        raise refuse(node, f"has an attribute {name} of more than {LONGEST_TEXT >> 20} MiB of text")
    return [scalar(value) for value in values.ravel()] if shape else scalar(values[()])


def scalar(value: Any) -> Scalar:
    """A stored value as a plain Python value."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "backslashreplace")
    if isinstance(value, np.generic):
        value = value.item()
    return value if isinstance(value, str | int | float) else str(value)
