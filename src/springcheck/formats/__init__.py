"""Trajectories of others: text tables and NumPy files, told by what is in them, not by their names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from springcheck.errors import StoreError
from springcheck.formats.columns import Columns, States, split
from springcheck.formats.numbers import read_npy, read_npz
from springcheck.formats.tables import read_table

__all__ = ["Columns", "States", "is_hdf5", "read", "split"]

HDF5 = b"\x89HDF\r\n\x1a\n"


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(8)
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror or error}") from error


def is_hdf5(path: Path) -> bool:
    """Whether a file begins as HDF5 does."""
    return _head(path) == HDF5


def read(path: Path, columns: Sequence[str] = ()) -> States:
    """The states of a text table, an NPY or an NPZ file; `columns` names what has no names, as t, q, v.

    Raises StoreError, in one line, where it cannot be read, or lacks times, positions or velocities.
    """
    head = _head(path)
    if not head:
        raise StoreError(f"{path}: is empty")
    try:
        if head.startswith(b"\x93NUMPY"):
            return read_npy(path, columns)
        if head.startswith(b"PK\x03\x04"):
            return read_npz(path)
        return read_table(path, columns)
    except UnicodeDecodeError as error:
        raise StoreError(f"{path}: is neither a text table nor a NumPy file") from error
