"""Trajectories of other programs, recognised by their content, not by their names.

What a library reads, packed texts and long files are read in a child process (see `springcheck.store.apart`);
short texts and arrays here, in time that grows with their length alone.  A new format is a row of `FORMATS`
and a function that returns its `States`.
"""

from __future__ import annotations

import gzip
import json
import re
import zlib
from codecs import BOM_UTF8
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats import libraries, molecular, numbers, tables
from springcheck.formats.columns import Fixed, Reader, States, fitting, moving
from springcheck.formats.hdf5 import is_foreign, read_hdf5
from springcheck.store import apart, files

__all__ = ["BY_NAME", "FORMATS", "States", "is_hdf5", "is_store", "moving", "read"]

HDF5 = b"\x89HDF\r\n\x1a\n"
SHORT = 1 << 20
"""Bytes of a file that our own code reads within this process: a second's work at most."""
BEGINNING = 1 << 12
"""Bytes at the beginning of a file by which its format is recognised."""


@dataclass(frozen=True, slots=True)
class Format:
    """A format: how its beginning is recognised, and its reader."""

    name: str
    recognise: Callable[[bytes, Path], bool]
    read: Reader
    by: str = ""
    """LIBRARY, read by a library in a child process; or LINES, line by line, gzipped or not."""


LIBRARY, LINES = "library", "lines"
XLSX = rb"(?s)\APK\x03\x04.*(\[Content_Types\]\.xml|xl/)"
"""A ZIP archive of these among its first members."""


def _starts(*with_: bytes) -> Callable[[bytes, Path], bool]:
    return lambda head, path: head.startswith(with_)


def _matches(pattern: bytes) -> Callable[[bytes, Path], bool]:
    return lambda head, path: re.search(pattern, head, re.MULTILINE) is not None


def _not_read(what: str) -> Reader:
    def refuse(path: Path, columns: list[str], step: float | None) -> States:
        raise StoreError(f"{path}: is {what}")

    return refuse


FORMATS: tuple[Format, ...] = (
    Format("NPY", _starts(b"\x93NUMPY"), numbers.read_npy),
    Format(".xlsx", _matches(XLSX), partial(libraries.read_pandas, "read_excel"), LIBRARY),
    Format("NPZ", _starts(b"PK\x03\x04"), numbers.read_npz),
    Format("Parquet", _starts(b"PAR1"), partial(libraries.read_pandas, "read_parquet"), LIBRARY),
    Format("Feather", _starts(b"ARROW1", b"FEA1"), partial(libraries.read_pandas, "read_feather"), LIBRARY),
    Format("MATLAB .mat", _starts(b"MATLAB 5.0"), libraries.read_mat, LIBRARY),
    Format("JSON", _matches(rb"\A\s*(\{|\[\s*[\[{]|\[[^][]*\]\s*\[)"), libraries.read_json, LIBRARY),
    Format("LAMMPS dump", _starts(b"ITEM: "), molecular.read_lammps, LINES),
    Format("DCD", lambda head, path: head[4:8] == b"CORD", libraries.read_dcd, LIBRARY),
    Format("GROMACS .xtc", _starts(b"\0\0\x07\xcb", b"\0\0\x07\xe7"), libraries.read_xtc, LIBRARY),
    Format(".trr", _starts(b"\0\0\x07\xc9"), molecular.read_trr),
    Format("Amber NetCDF", _starts(b"CDF\x01", b"CDF\x02"), libraries.read_amber, LIBRARY),
    Format("ASE .traj", _starts(b"- of Ulm"), libraries.read_ase, LIBRARY),
    Format("extended .xyz", lambda head, path: b"Properties=" in head[:1000], libraries.read_ase, LIBRARY),
    Format(".xyz", lambda head, path: molecular.is_xyz(head), molecular.read_xyz, LINES),
    Format("", _starts(b"LAMMPS ("), _not_read("a log of LAMMPS: dump x y z vx vy vz instead"), LINES),
    Format("", _starts(b"# Created by Octave"), _not_read("a text of Octave: save -v7 instead"), LINES),
    Format("", lambda head, path: ".gro" in path.suffixes, _not_read("a .gro file: use .trr instead"), LINES),
    Format("text tables", lambda head, path: True, tables.read_table, LINES),
)
"""In the order in which they are tried; a file that no other format matches is a text table."""

OF_DECIMALS = "half_q", "half_v", "beside"
"""Names of the parts of `Fixed` in what a library has read."""

BY_NAME = {one.name: one for one in FORMATS if one.name}
KNOWN = f"read are HDF5, {', '.join(BY_NAME)}, texts gzipped too"


def _beginning(path: Path) -> bytes:
    with files.told(path, "read"), path.open("rb") as file:
        return file.read(BEGINNING)


def is_hdf5(path: Path) -> bool:
    """Whether a file begins as HDF5 does, perhaps after another program's user block, such as MATLAB's."""
    head = _beginning(path)
    return any(head[at : at + 8] == HDF5 for at in (0, 512, 1024, 2048))


def is_store(path: Path) -> bool:
    """Whether a file is a store of ours, not one of another program."""
    return is_hdf5(path) and not is_foreign(path)


def read(
    path: Path, columns: Sequence[str] = (), step: float | None = None, most: int | None = None
) -> dict[str, States]:
    """Trajectories of any program's file by name: one, except from HDF5 (see `read_hdf5`, for `most` too).

    `columns` names columns without names, as t, q, v; `step` is the time step of files that count steps
    alone.  Raises StoreError, in one line, where the file cannot be read, or lacks times or positions.
    """
    found = read_hdf5(path, columns, most) if is_hdf5(path) else {path.name: _read(path, list(columns), step)}
    return {name: fitting(path, tables.as_written(states)) for name, states in found.items()}


def _read(path: Path, columns: list[str], step: float | None) -> States:
    head = _beginning(path)
    if not head:
        raise StoreError(f"{path}: is empty")
    try:
        zipped = head.startswith(b"\x1f\x8b")
        if zipped:
            with gzip.open(path) as file:
                head = file.read(BEGINNING)
        head = head.removeprefix(BOM_UTF8)
        found = next(one for one in FORMATS if one.recognise(head, path) and (one.by == LINES or not zipped))
        bounded = found.by == LIBRARY or zipped or path.stat().st_size > SHORT
        return _apart(found, path, columns, step) if bounded else found.read(path, columns, step)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise StoreError(f"{path}: what gzip has packed is damaged or cut off ({error})") from error
    except UnicodeDecodeError as error:
        raise StoreError(
            f"{path}: is of no format that is known here, and no text in UTF-8; {KNOWN}"
        ) from error


def _apart(found: Format, path: Path, columns: list[str], step: float | None) -> States:
    """What a library reads."""
    given = (found.name, json.dumps(columns), "" if step is None else repr(step))
    try:
        said = apart.read(__name__, "packed", path, *given)
    except apart.EndedError as error:
        raise StoreError(f"{path}: is damaged, or no {found.name} file: reading it {error}") from error
    with np.load(BytesIO(said), allow_pickle=False) as arrays:
        known = {name: arrays.get(name) for name in ("p", "v", "mass")}
        decimals = Fixed(*(arrays[part] for part in OF_DECIMALS)) if OF_DECIMALS[0] in arrays else None
        known |= {"roundoff": float(arrays["roundoff"]), "notes": tuple(arrays["notes"].tolist())}
        return States(t=arrays["t"], q=arrays["q"], fixed=decimals, **known)


def packed(path: Path, name: str, columns: str, step: str) -> bytes:
    """The states that a format's reader finds, as NPZ."""
    found = BY_NAME[name].read(path, json.loads(columns), float(step) if step else None)
    known: dict[str, Any] = {part: getattr(found, part) for part in ("t", "q", "p", "v", "mass", "roundoff")}
    known["notes"] = np.array(found.notes, dtype=str)
    known |= dict(zip(OF_DECIMALS, found.fixed or (), strict=False))
    out = BytesIO()
    np.savez(out, **{part: x for part, x in known.items() if x is not None})
    return out.getvalue()
