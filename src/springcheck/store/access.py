"""Reading of HDF5: what lies in the file itself, as plain values.

External storage, external and soft links and views of other files are refused, and so are filters that would
load a library.  How much is read is bounded by the trial that comes first (see `apart`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import h5py
import msgspec
import numpy as np

from springcheck.errors import StoreError
from springcheck.store import files

Scalar: TypeAlias = str | float | int | bool

MOST_MEMBERS = 2_000
"""Members of a group: runs or tables of one file.  Ours have tens; every command slows down with them."""
LONGEST_NAME = 200
"""Characters of a name."""
LONGEST_DOCUMENT, LONGEST_ATTRIBUTE = 1 << 24, 1 << 22
"""Bytes: parsed into Python objects they take some twenty times as much memory."""
EXPANSION = 1100
"""Ratio of sizes beyond what deflate can reach (1032): an array that claims more is damaged."""
CONTIGUOUS, CHUNKED, VIRTUAL = h5py.h5d.CONTIGUOUS, h5py.h5d.CHUNKED, h5py.h5d.VIRTUAL
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32, 32000}
"""Built into h5py; 32000 is its LZF."""


@contextlib.contextmanager
def for_reading(path: Path) -> Iterator[Any]:
    """Open a file for reading, of which a trial has shown that libhdf5 survives it (`apart.trust`)."""
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
    """Names of what a group holds, the soft and external links left out."""
    if group.id.get_num_objs() > MOST_MEMBERS:
        raise refuse(group, f"has more than {MOST_MEMBERS} members")
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
        if not is_group(node) or not node.id.links.exists(name.encode()):
            return None
        if not _is_hard(node, name):
            raise refuse(
                node, f"has a link {name!r} that leads elsewhere: only what lies in the file is read"
            )
        node = node[name]
    return node


def walk(
    group: Any, deepest: int, into: Callable[[str, Any], bool] = lambda place, node: True
) -> Iterator[tuple[str, int, Any]]:
    """Yield path, address and object of everything below a group.

    A group is visited once.  A dataset is yielded under each of its names, with the object at the first of
    them alone (later None).  `into(path, object)` decides whether a group is entered.
    """
    seen = {h5py.h5o.get_info(group.id).addr}

    def below(node: Any, before: str, depth: int) -> Iterator[tuple[str, int, Any]]:
        for name in members(node):
            place, at = before + name, node.id.links.get_info(name.encode()).u
            child = None if at in seen else node[name]
            if child is None and h5py.h5o.get_info(node.id, name.encode()).type == h5py.h5o.TYPE_GROUP:
                continue
            seen.add(at)
            yield place, at, child
            if is_group(child) and depth < deepest and into(place, child):
                yield from below(child, f"{place}/", depth + 1)

    yield from below(group, "", 0)


def group_at(file: Any, path: str) -> Any:
    """The group at a path, or None; StoreError where something else stands there."""
    node = find(file, path)
    if node is not None and not is_group(node):
        raise refuse(node, "is no group")
    return node


def children(file: Any, path: str) -> list[str]:
    """Names below the group at a path; none where there is no group."""
    group = group_at(file, path)
    return [] if group is None else members(group)


class Storage(NamedTuple):
    """How a dataset is stored, as plain data.

    libhdf5 2.0 crashes at the program's end where the creation properties of a virtual dataset are still
    held, as an exception's traceback would hold them, or h5py's own Dataset once it was asked for its views.
    """

    layout: int
    external: int
    filters: frozenset[int]
    views: tuple[tuple[str, str], ...]
    """File and dataset of each source of a virtual dataset."""


def storage(node: Any) -> Storage:
    """How a dataset is stored."""
    how = node.id.get_create_plist()
    layout = how.get_layout()
    views = range(how.get_virtual_count() if layout == VIRTUAL else 0)
    return Storage(
        layout,
        how.get_external_count(),
        frozenset(how.get_filter(i)[0] for i in range(how.get_nfilters())),
        tuple((how.get_virtual_filename(i), how.get_virtual_dsetname(i)) for i in views),
    )


def dataset_at(file: Any, path: str, *, packed: bool = False) -> Any:
    """The dataset at a path; `packed` allows chunks, compression and views.

    StoreError where there is none, where its numbers do not lie in the file, or where it claims more
    than the file holds.
    """
    node = find(file, path)
    if node is None:
        raise StoreError(f"cannot read {file.file.filename}: {path} is missing")
    if not isinstance(node, h5py.Dataset) or node.shape is None:
        raise refuse(node, "is no dataset of any size")
    how = storage(node)
    if how.external:
        raise refuse(node, "lies outside the file: what other files hold is not read")
    if (how.layout in (VIRTUAL, CHUNKED) and not packed) or how.filters - _FILTERS:
        raise refuse(node, "is stored in a way that is not read")
    if others := [name for name, _ in how.views if name != "."]:
        raise refuse(node, f"shows another file, {others[0]}: what other files hold is not read")
    claimed = int(np.prod(node.shape, dtype=object)) * node.dtype.itemsize
    size, stored = node.file.id.get_filesize(), node.id.get_storage_size()
    there = node.id.get_offset() if how.layout == CONTIGUOUS else 0
    too_much = claimed > EXPANSION * stored if how.layout == CHUNKED else claimed and there is None
    if how.layout != VIRTUAL and (too_much or stored > size or (there or 0) + stored > size):
        raise refuse(node, f"claims {claimed} bytes, more than the file holds")
    return node


def array(file: Any, path: str, shape: tuple[int, ...], kinds: str = "f") -> Any:
    """A recorded array: contiguous, of this shape, float64 ("f") or integer ("i")."""
    node = dataset_at(file, path)
    if node.shape != shape or node.dtype.str not in {"f": ("<f8",), "i": ("<i4", "<i8")}[kinds]:
        raise refuse(node, f"is {node.dtype} of shape {node.shape}, not numbers of shape {shape}")
    return node


def text(file: Any, path: str) -> str:
    """The string of a scalar dataset."""
    node = dataset_at(file, path)
    if node.shape != () or h5py.check_string_dtype(node.dtype) is None:
        raise refuse(node, "is no text")
    return str(column(node)[()])


def json(text: str, kind: Any = Any) -> Any:
    """Parse a text of a file as JSON. ValueError where it is not JSON, or too long."""
    if len(text) > LONGEST_DOCUMENT:
        raise ValueError(f"has {len(text)} characters, more than springcheck writes")
    try:
        return msgspec.json.decode(text.encode("utf-8", "surrogatepass"), type=kind)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ValueError(str(error)) from error


def column(dataset: Any) -> np.ndarray:
    """Values of a table's column: numbers, booleans or strings."""
    if h5py.check_string_dtype(dataset.dtype) is not None:
        found = np.ravel(dataset.asstr(errors="backslashreplace")[()])
        return np.array([*found, None], dtype=object)[:-1].reshape(dataset.shape)
    if dataset.dtype.kind not in "fiub":
        raise refuse(dataset, f"is of type {dataset.dtype}, no column of ours")
    return np.asarray(dataset[()])


def attributes(node: Any) -> dict[str, Any]:
    """The attributes of a node: scalars, and lists of them.  A value of a type that we never write is
    replaced by the type's name."""
    # opening an object by its index makes libhdf5 build a table of all of them each time
    names: list[bytes] = []
    h5py.h5a.iterate(node.id, names.append)
    found = {raw.decode("utf-8", "backslashreplace"): _value(node, raw) for raw in names}
    if not all(map(is_name, found)):
        raise refuse(node, "has an attribute whose name is no text, or too long")
    return found


def attribute(node: Any, name: str) -> Any:
    """One attribute of a node, or None."""
    return _value(node, name.encode()) if h5py.h5a.exists(node.id, name.encode()) else None


_PLAIN = {h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.STRING, h5py.h5t.ENUM}
_TYPES: dict[bytes, tuple[np.dtype, Any]] = {}
"""NumPy dtype and in-memory HDF5 type of an encoded type, the latter None for types that we never write: a
file has thousands of attributes of a handful of types, and h5py creates each anew."""


def _value(node: Any, name: bytes) -> Any:
    known = h5py.h5a.open(node.id, name)
    of = known.get_type()
    # of references libhdf5 cannot decode the type again
    if of.get_class() not in _PLAIN or known.shape is None:
        return "<reference>" if of.get_class() not in _PLAIN else f"<{of.dtype}>"
    if (code := of.encode()) not in _TYPES:
        kind = h5py.h5t.decode(code).dtype
        plain = kind.kind in "fiubS" or h5py.check_string_dtype(kind) is not None
        _TYPES[code] = kind, h5py.h5t.py_create(kind) if plain else None
    kind, memory = _TYPES[code]
    if memory is None:
        return f"<{kind}>"
    if known.get_storage_size() > LONGEST_ATTRIBUTE:
        raise refuse(node, f"has an attribute of more than {LONGEST_ATTRIBUTE >> 20} MiB")
    values = np.empty(known.shape, kind)
    known.read(values, memory)
    return [scalar(value) for value in values.ravel()] if known.shape else scalar(values[()])


def scalar(value: Any) -> Scalar:
    """A stored value as a plain Python value."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "backslashreplace")
    if isinstance(value, np.generic):
        value = value.item()
    return value if isinstance(value, str | int | float) else str(value)
