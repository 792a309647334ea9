"""Files that libraries read: NumPy, ASE, msgspec, pandas, SciPy; all but the first in a child process."""

from __future__ import annotations

import warnings
import zipfile
from codecs import BOM_UTF8
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from springcheck.errors import StoreError, plain
from springcheck.formats.columns import MOST_NUMBERS, States
from springcheck.formats.molecular import clock, of_frames
from springcheck.formats.numbers import of_table, states_of

MOST_FRAMES = 1 << 20
LARGEST = 16 * MOST_NUMBERS
"""Bytes of all arrays of a file of NumPy, unpacked."""
LONGEST_JSON = 1 << 25
"""Bytes of a JSON file: parsed into Python objects it takes some twenty times as much memory."""


@contextmanager
def _library(path: Path, name: str, install: str = "") -> Iterator[None]:
    """Turn a library's error into a StoreError of one line that names it, or says how to install it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except StoreError:
        raise
    except ImportError as error:
        how = f", which is not installed: python -m pip install {install or name}"
        raise StoreError(f"{path}: {name} reads it{how} ({plain(error, 100)})") from error
    except Exception as error:
        said = plain(" ".join(str(error).split()), 200)
        raise StoreError(f"{path}: {name} cannot read it: {said or type(error).__name__}") from error


def read_numpy(path: Path, columns: list[str], step: float | None) -> States:
    """NPY and NPZ: arrays by their names or fields, or a table (f, c) whose columns are named."""
    with _library(path, "NumPy"):
        size = path.stat().st_size
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as packed:
                size = sum(member.file_size for member in packed.infolist())
        if size > LARGEST:
            what = f"{size / 1e6:.0f} MB of arrays, {LARGEST / 1e6:.0f} can be read: keep fewer frames"
            raise StoreError(f"{path}: {what}")
        # NumPy leaves a damaged file open; this one is in memory
        found: Any = np.load(BytesIO(path.read_bytes()), allow_pickle=False)
        found = dict(found) if hasattr(found, "files") else found
    if isinstance(found, dict) or found.dtype.names:
        arrays = found if isinstance(found, dict) else {name: found[name] for name in found.dtype.names}
        return states_of(path, arrays, columns, step)
    if found.ndim != 2 or found.dtype.kind not in "fiu":
        raise StoreError(f"{path}: an array of {found.dtype} and shape {found.shape} is no table of numbers")
    return of_table(path, found, columns, step)


def read_ase(path: Path, columns: list[str], step: float | None) -> States:
    """ASE's .traj, with velocities where it has momenta, in Angstrom, fs and u."""
    with _library(path, "ASE", "ase"):
        import ase.io
        from ase import units

        found = ase.io.read(str(path), index=f":{MOST_FRAMES}", format="traj")
        v = [atoms.get_velocities() * units.fs for atoms in found if atoms.has("momenta")]
        if len(v) not in (0, len(found)):
            raise StoreError(f"{path}: some frames have velocities, and others have none")
        said = [atoms.info.get("time", atoms.info.get("t")) for atoms in found]
        t, q = clock(path, said, step, unit="fs"), [atoms.positions for atoms in found]
        return replace(of_frames(path, t, q, v), mass=found[0].get_masses())


def read_mat(path: Path, columns: list[str], step: float | None) -> States:
    """Arrays of a MATLAB file up to version 7, of its structs too, by SciPy."""
    with _library(path, "SciPy", "scipy"):
        from scipy.io import loadmat

        found = {name: np.asarray(x) for name, x in loadmat(str(path)).items() if not name.startswith("__")}
    while structs := [name for name, x in found.items() if x.dtype.names and x.size == 1]:
        for name in structs:
            struct = found.pop(name)
            found |= {f"{name}.{own}": np.asarray(struct[own].item()) for own in struct.dtype.names or ()}
    # by their own names, t for run.t, where these are unique
    own = {name.rpartition(".")[2]: a for name, a in found.items()}
    return states_of(path, own if len(own) == len(found) else found, columns, step)


def read_json(path: Path, columns: list[str], step: float | None) -> States:
    """Lists by name, or rows, named or not, in a list or on lines; values by row or split, as pandas writes
    them."""
    if path.stat().st_size > LONGEST_JSON:
        raise StoreError(f"{path}: more than {LONGEST_JSON >> 20} MiB of JSON; store it as NPZ or HDF5")
    with _library(path, "msgspec", "msgspec"):
        said = path.read_bytes().removeprefix(BOM_UTF8)
        try:
            found = msgspec.json.decode(said)
        except msgspec.DecodeError:
            if b"\n" not in said.strip():
                raise
            found = msgspec.json.Decoder().decode_lines(said)
    if isinstance(found, dict) and isinstance(found.get("data"), list):
        names = found.get("columns")
        columns = columns or ([*map(str, names)] if isinstance(names, list) else [])
        found = found["data"]
    if isinstance(found, list) and found and all(isinstance(row, dict) for row in found):
        found = {
            name: [row.get(name) for row in found] for name in dict.fromkeys(x for row in found for x in row)
        }
    if isinstance(found, list):
        try:
            rows = np.asarray(found, np.float64)
        except (ValueError, TypeError, OverflowError):
            rows = np.empty(0)
        if rows.ndim == 2 and rows.size:
            return of_table(path, rows, columns, step)
    if not isinstance(found, dict):
        raise StoreError(f"{path}: no lists by name, and no list of rows of as many numbers each")
    arrays = {}
    for name, column in found.items():
        one = [column] if isinstance(column, float | int) else column
        values = [*column.values()] if isinstance(column, dict) else one
        if isinstance(values, list):
            try:
                arrays[str(name)] = np.asarray(values, np.float64)
            except (ValueError, TypeError, OverflowError):
                arrays[str(name)] = np.array([*values, None], object)[:-1]
    return states_of(path, arrays, columns, step)


def read_pandas(call: str, path: Path, columns: list[str], step: float | None) -> States:
    """A table that pandas reads by this function, its columns named in the file."""
    with _library(path, "pandas", "'springcheck[tables]'"):
        table = getattr(import_module("pandas"), call)(str(path))
        if table.index.name is not None:
            table = table.reset_index()
        if table.size > MOST_NUMBERS:
            raise StoreError(f"{path}: more than {MOST_NUMBERS:,} numbers: choose among the columns")
        found = {str(name): table[name].to_numpy() for name in table.columns}
    return states_of(path, found, columns, step)
