"""Whether this process may open a file with libhdf5, which can crash or hang on a damaged one.

A file that carries our seal is checked against it, in milliseconds.  Any other is first read in a child
process with limited memory and time, and here only if that process ends normally.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import h5py

from springcheck.errors import StoreError
from springcheck.store import apart, files, seal

OURS = "springcheck.store.checking"
"""The module whose `tried` reads a store of ours on trial."""


def trust(path: Path, module: str) -> None:
    """Return if this process can read a file without harm; raise StoreError otherwise.

    A file without a seal is read on trial by the function `tried` of a module.
    """
    with files.told(path, "read"):
        said = _against(path.absolute(), module, _state(path))
    if said:
        raise StoreError(f"cannot read {path}: {said}")


@lru_cache(maxsize=4096)
def _against(path: Path, module: str, state: tuple[int, ...]) -> str:
    """The reason not to read a file, "" where it can be read; computed once for each state of the file."""
    found = seal.find(path)
    if not h5py.is_hdf5(path):
        return "it is no HDF5 file"
    if found is None:
        said, harmless = _tried(path, module, state)
        return "" if harmless else said
    if not seal.is_whole(path, found):
        return "it is damaged, it has changed since it was written; springcheck check names the places"
    return ""


def _state(path: Path) -> tuple[int, ...]:
    state = path.stat()
    return state.st_dev, state.st_ino, state.st_mtime_ns, state.st_size


def tried(path: Path, module: str) -> tuple[str, bool]:
    """The answer of a child process that reads a file, and whether it ended normally; if not, how it
    ended."""
    return _tried(path.absolute(), module, _state(path))


@lru_cache(maxsize=4096)
def _tried(path: Path, module: str, state: tuple[int, ...]) -> tuple[str, bool]:
    try:
        return apart.read(module, "tried", path).decode(), True
    except StoreError as error:
        return str(error), True
    except apart.EndedError as error:
        return f"it is damaged, reading it {error}", False
