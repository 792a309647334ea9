"""Guarded access to an HDF5 file of unknown origin: every object is validated before any of it is read.

Only what lies in the file itself is read: external storage, external and soft links and views of other files
are refused, and so are filters that would load a library.  Sizes, counts, depths and lengths are bounded.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import msgspec
import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.scenefile import LONGEST_TEXT as LONGEST_SCENE
from springcheck.store import files

Scalar: TypeAlias = str | float | int | bool

MOST_MEMBERS = 2_000
"""Members of a group: runs or tables of one file.  Ours have tens; every command slows down with them."""
MOST_ATTRIBUTES = 2_000
LONGEST_NAME = 200
"""Characters of a name."""
LONGEST_TEXT = LONGEST_SCENE
"""Bytes of all texts of one dataset, and of all attributes of one object."""
LONGEST_DOCUMENT = 1 << 24
"""Bytes of a JSON document: parsed into Python objects it takes some twenty times as much memory."""
LARGEST_TABLE = 1 << 28
"""Bytes of the numbers of a table."""
MOST_TEXTS = 1 << 21
"""Texts of a column."""
MOST_ITEMS = 10_000
"""Items of an attribute."""
MOST_DIMENSIONS = 4
MOST_VIEWS = 1_000
"""Source datasets of a virtual dataset."""
LARGEST_CHUNK = 1 << 28
"""Bytes."""
EXPANSION = 1100
"""Ratio of sizes beyond what deflate can reach (1032): an array that claims more is damaged."""

_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32, 32000}
"""Built into h5py; 32000 is its LZF."""


@contextlib.contextmanager
def for_reading(path: Path) -> Iterator[Any]:
    """Open a file for reading that libhdf5 is known to survive (see `trust`); else StoreError."""
    with files.told(path, "read"), opened(path) as file:
        yield file


def opened(path: Path) -> Any:
    """Open a file for reading; errors are libhdf5's own."""
    try:
        return h5py.File(path, "r", locking="best-effort")
    except OSError as error:
        # on a file system without locks, of which libhdf5 itself knows one
        if "lock file" not in str(error) or files.number_of(error) not in files.UNSUPPORTED:
            raise
        return h5py.File(path, "r", locking=False)


def refuse(node: Any, why: str) -> StoreError:
    """An error that names the file and the object in it."""
    return StoreError(f"cannot read {node.file.filename}: {node.name} {why}")


def is_group(node: Any) -> bool:
    """Whether an object is a group, and no dataset or nothing."""
    return isinstance(node, h5py.Group)


def is_name(name: str) -> bool:
    """Whether a group or dataset may have this name: printable, not too long, and no mathtext in a figure."""
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
    """Whether a member is a hard link, so that it lies in the file itself."""
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


def _has_one_name(node: Any) -> Any:
    """The object if it has one hard link, as ours have; an object with more would be read once for each."""
    if h5py.h5o.get_info(node.id).rc > 1:
        raise refuse(node, "has more than one name, as none of ours has")
    return node


def walk(
    group: Any, most: int, deepest: int, into: Callable[[str, Any], bool] = lambda place, node: True
) -> Iterator[tuple[str, int, Any]]:
    """Yield path, address and object of everything below a group.

    A group is visited once.  A dataset is yielded under each of its names, with the object at the first of
    them alone (later None).  `into(path, object)` decides whether a group is entered.  StoreError where there
    are more than `most`.
    """
    seen, count = {h5py.h5o.get_info(group.id).addr}, 0

    def below(node: Any, before: str, depth: int) -> Iterator[tuple[str, int, Any]]:
        nonlocal count
        for name in members(node):
            place, at = before + name, node.id.links.get_info(name.encode()).u
            child = None if at in seen else node[name]
            is_group = isinstance(child, h5py.Group)
            if child is None and h5py.h5o.get_info(node.id, name.encode()).type == h5py.h5o.TYPE_GROUP:
                continue
            seen.add(at)
            count += 1
            if count > most:
                raise refuse(node, "is one of more groups and datasets than can be looked at")
            yield place, at, child
            if is_group and depth < deepest and into(place, child):
                yield from below(child, f"{place}/", depth + 1)

    yield from below(group, "", 0)


def group_at(file: Any, path: str) -> Any:
    """The group at a path, or None; StoreError where something else stands there."""
    node = find(file, path)
    if node is not None and not isinstance(node, h5py.Group):
        raise refuse(node, "is no group")
    return None if node is None else _has_one_name(node)


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
    if not isinstance(node, h5py.Dataset) or node.shape is None:
        raise refuse(node, "is no dataset of any size")
    how = StoredAs.of(node)
    size = node.file.id.get_filesize()
    claimed = int(np.prod(node.shape, dtype=object)) * node.dtype.itemsize
    if node.ndim > MOST_DIMENSIONS:
        raise refuse(node, f"has {node.ndim} dimensions")
    if how.external:
        raise refuse(node, "lies outside the file: what other files hold is not read")
    is_packed = how.layout in (h5py.h5d.VIRTUAL, h5py.h5d.CHUNKED)
    if (is_packed and not packed) or how.filters - _FILTERS:
        raise refuse(node, "is stored in a way that is not read")
    if how.layout == h5py.h5d.VIRTUAL:
        _look_at_views(node, how.views)
    elif how.layout == h5py.h5d.CHUNKED:
        chunk = int(np.prod(how.chunk, dtype=object)) * node.dtype.itemsize
        stored = node.id.get_storage_size()
        # libhdf5 makes room for as many bytes as a chunk says that it takes in the file
        if chunk > LARGEST_CHUNK or stored > size or claimed > EXPANSION * stored:
            raise refuse(node, f"claims {claimed} bytes, more than the file holds")
    elif how.layout == h5py.h5d.CONTIGUOUS and claimed:
        offset = node.id.get_offset()
        if offset is None or offset + claimed > size:
            raise refuse(node, f"claims {claimed} bytes, more than the file holds")
    return node


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredAs:
    """How a dataset is stored, as plain data.

    libhdf5 2.0 crashes at the program's end where the creation properties of a virtual dataset are still
    held, as an exception's traceback would hold them, or h5py's own Dataset once it was asked for its views.
    """

    layout: int
    external: int
    chunk: tuple[int, ...]
    filters: frozenset[int]
    views: tuple[tuple[str, str], ...]
    """File and dataset of each source of a virtual dataset, up to `MOST_VIEWS`."""

    @classmethod
    def of(cls, node: Any) -> StoredAs:
        how = node.id.get_create_plist()
        layout = how.get_layout()
        return cls(
            layout=layout,
            external=how.get_external_count(),
            chunk=how.get_chunk() if layout == h5py.h5d.CHUNKED else (),
            filters=frozenset(how.get_filter(i)[0] for i in range(how.get_nfilters())),
            views=tuple(
                (how.get_virtual_filename(i), how.get_virtual_dsetname(i))
                for i in range(min(how.get_virtual_count(), MOST_VIEWS))
            )
            if layout == h5py.h5d.VIRTUAL
            else (),
        )


def _look_at_views(node: Any, shown: tuple[tuple[str, str], ...]) -> None:
    """StoreError unless all sources of a virtual dataset are plain datasets of the same file, as ours are."""
    if len(shown) == MOST_VIEWS:
        raise refuse(node, "is put together of more pieces than can be looked at")
    for file, name in shown:
        if file != ".":
            raise refuse(node, f"shows another file, {file}: what other files hold is not read")
        source = find(node.file, name)
        if isinstance(source, h5py.Dataset) and StoredAs.of(source).views:
            raise refuse(node, "shows a view of a view: only plain arrays are read")
        dataset_at(node.file, name, packed=True)


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
    """Strings of a dataset, their lengths summed before any is read: all may refer to one long string."""
    if dataset.ndim > 1:
        raise refuse(dataset, "is no list of texts")
    if dataset.size > MOST_TEXTS or _length(dataset) > LONGEST_TEXT:
        raise refuse(dataset, "holds more text than any of ours")
    found = dataset.asstr(errors="backslashreplace")[()]
    return np.asarray(found, object) if dataset.ndim == 0 else np.array([*found, None], dtype=object)[:-1]


def _length(dataset: Any) -> int:
    """Bytes of all strings of a dataset, from the lengths and heap addresses that are stored in its place."""
    size = dataset.size
    if not size or dataset.dtype.kind != "O":
        return int(size * dataset.dtype.itemsize)
    if dataset.file.mode != "r":
        # this process is writing it
        return 0
    offset = dataset.id.get_offset()
    if offset is None or dataset.file.userblock_size:
        raise refuse(dataset, "is stored in a way that is not read")
    each = dataset.id.get_storage_size() // size
    with open(dataset.file.filename, "rb") as raw:
        raw.seek(offset)
        listed = np.frombuffer(raw.read(size * each), np.uint8).reshape(size, each)
    return int(np.ascontiguousarray(listed[:, :4]).view("<u4").sum(dtype=np.int64))


def text(file: Any, path: str) -> str:
    """The string of a scalar dataset."""
    node = dataset_at(file, path)
    if node.shape != () or h5py.check_string_dtype(node.dtype) is None:
        raise refuse(node, "is no text")
    return str(texts(node)[()])


def json(text: str, kind: Any = Any) -> Any:
    """Parse a text of a file as JSON. ValueError where it is not JSON, or longer than any text of ours."""
    if len(text) > LONGEST_DOCUMENT:
        raise ValueError(f"has {len(text)} characters, more than any of ours")
    try:
        return msgspec.json.decode(text.encode("utf-8", "surrogatepass"), type=kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ValueError(str(error)) from error


def is_text(dataset: Any) -> bool:
    """Whether a column holds strings."""
    return h5py.check_string_dtype(dataset.dtype) is not None


def columns(group: Any) -> dict[str, Any]:
    """Datasets of a table by name, each with one hard link; StoreError beyond `LARGEST_TABLE` bytes in
    all."""
    found = {name: _has_one_name(dataset_at(group, name)) for name in members(group)}
    if sum(dataset.size * dataset.dtype.itemsize for dataset in found.values()) > LARGEST_TABLE:
        raise refuse(group, f"has more than {LARGEST_TABLE >> 20} MiB, more than any table of ours")
    return found


def column(dataset: Any) -> np.ndarray:
    """Values of a table's column: numbers, booleans or strings."""
    if is_text(dataset):
        return texts(dataset)
    if dataset.dtype.kind not in "fiub":
        raise refuse(dataset, f"is of type {dataset.dtype}, no column of ours")
    return np.asarray(dataset[()])


def attributes(node: Any) -> dict[str, Any]:
    """The attributes of a node: scalars, and lists of them.  A value of a type that we never write is
    replaced by the type's name."""
    count = h5py.h5a.get_num_attrs(node.id)
    if count > MOST_ATTRIBUTES:
        raise refuse(node, f"has {count} attributes, more than any of ours")
    # opening an object by its index makes libhdf5 build a table of all of them each time
    names: list[bytes] = []
    h5py.h5a.iterate(node.id, names.append)
    found: dict[str, Any] = {}
    length = 0
    for raw in names:
        name = raw.decode("utf-8", "backslashreplace")
        if not is_name(name):
            raise refuse(node, "has an attribute whose name is no text, or too long")
        found[name] = value = _value(node, h5py.h5a.open(node.id, raw), name)
        # however often they refer to the same text
        length += len(value) if isinstance(value, str) else 0
        if length > LONGEST_TEXT:
            raise refuse(node, f"has attributes of more than {LONGEST_TEXT >> 20} MiB of text")
    return found


def attribute(node: Any, name: str) -> Any:
    """One attribute of a node, or None."""
    known = name.encode()
    return _value(node, h5py.h5a.open(node.id, known), name) if h5py.h5a.exists(node.id, known) else None


def _value(node: Any, known: Any, name: str) -> Any:
    shape = known.shape
    kind, memory = _types(known.get_type().encode())
    if shape is None:
        return "<nothing>"
    if memory is None:
        return f"<{kind}>"
    items = int(np.prod(shape, dtype=object)) if shape else 1
    if items > MOST_ITEMS or known.get_storage_size() > LONGEST_TEXT:
        raise refuse(node, f"has an attribute {name} of {items} items")
    values = np.empty(shape, kind)
    known.read(values, memory)
    if kind.kind == "O" and sum(len(x or "") for x in values.ravel()) > LONGEST_TEXT:
        raise refuse(node, f"has an attribute {name} of more than {LONGEST_TEXT >> 20} MiB of text")
    return [scalar(value) for value in values.ravel()] if shape else scalar(values[()])


@lru_cache(maxsize=64)
def _types(encoded: bytes) -> tuple[np.dtype, Any]:
    """NumPy dtype and in-memory HDF5 type of an encoded type, the latter None for types that we never write.

    Cached: a file has thousands of attributes of a handful of types, and h5py creates each anew.
    """
    kind = h5py.h5t.decode(encoded).dtype
    if kind.kind not in "fiubSO" or (kind.kind == "O" and h5py.check_string_dtype(kind) is None):
        return kind, None
    return kind, h5py.h5t.py_create(kind)


def scalar(value: Any) -> Scalar:
    """A stored value as a plain Python value."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "backslashreplace")
    if isinstance(value, np.generic):
        value = value.item()
    return value if isinstance(value, str | int | float) else str(value)
