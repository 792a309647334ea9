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
from springcheck.formats import digits, libraries, molecular, tables
from springcheck.formats.columns import Fixed, Reader, States, fitting, moving
from springcheck.formats.hdf5 import read_hdf5
from springcheck.store import apart, checking, files

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


def _is_json(head: bytes, path: Path) -> bool:
    """Whether a text is an object, or a list of rows: without commas it is a table that NumPy has printed."""
    text = head.lstrip()
    row = text.partition(b"]")[0]
    more = text[1:].lstrip()[:1] in (b"[", b"{") or b"[" in text[len(row) :]
    return text[:1] == b"{" or (text[:1] == b"[" and b"," in row and more)


def _not_read(what: str) -> Reader:
    def refuse(path: Path, columns: list[str], step: float | None) -> States:
        raise StoreError(f"{path}: is {what}")

    return refuse


FORMATS: tuple[Format, ...] = (
    Format("NPY", _starts(b"\x93NUMPY"), libraries.read_numpy),
    Format(".xlsx", lambda head, path: re.search(XLSX, head) is not None,
           partial(libraries.read_pandas, "read_excel"), LIBRARY),
    Format("NPZ", _starts(b"PK\x03\x04"), libraries.read_numpy),
    Format("Parquet", _starts(b"PAR1"), partial(libraries.read_pandas, "read_parquet"), LIBRARY),
    Format("Feather", _starts(b"ARROW1", b"FEA1"), partial(libraries.read_pandas, "read_feather"), LIBRARY),
    Format("MATLAB .mat", _starts(b"MATLAB 5.0"), libraries.read_mat, LIBRARY),
    Format("JSON", _is_json, libraries.read_json, LIBRARY),
    Format("LAMMPS dump", _starts(b"ITEM: "), molecular.read_lammps, LINES),
    Format("", lambda head, path: head[4:8] == b"CORD", _not_read("a DCD file, which holds positions alone")),
    Format("", _starts(b"\0\0\x07\xcb", b"\0\0\x07\xe7"), _not_read("an .xtc file: use .trr instead")),
    Format(".trr", _starts(b"\0\0\x07\xc9"), molecular.read_trr),
    Format("", _starts(b"CDF\x01", b"CDF\x02"), _not_read("NetCDF: write its arrays as NPZ or HDF5")),
    Format("ASE .traj", _starts(b"- of Ulm"), libraries.read_ase, LIBRARY),
    Format(".xyz", lambda head, path: molecular.is_xyz(head), molecular.read_xyz, LINES),
    Format("", _starts(b"LAMMPS ("), _not_read("a log of LAMMPS: dump x y z vx vy vz instead"), LINES),
    Format("", _starts(b"# Created by Octave"), _not_read("a text of Octave: save -v7 instead"), LINES),
    Format("", lambda head, path: ".gro" in path.suffixes, _not_read("a .gro file: use .trr instead"), LINES),
    Format("", _starts(b"REMARK ", b"CRYST1", b"HEADER ", b"MODEL ", b"ATOM  ", b"HETATM"),
           _not_read("a PDB file, which holds positions alone, of 3 decimals: write velocities too"), LINES),
    Format("text tables", lambda head, path: True, tables.read_table, LINES),
)  # fmt: skip
"""In the order in which they are tried; a file that no other format matches is a text table."""

PARTS, OF_DECIMALS = ("t", "q", "p", "v", "mass"), ("half_q", "half_v")
"""Arrays of states that a child process has read, and of their `Fixed`."""

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
    return is_hdf5(path) and checking.is_store(path)


def read(
    path: Path, columns: Sequence[str] = (), step: float | None = None, most: int | None = None
) -> dict[str, States]:
    """The trajectories of any program's file, by name; one except in HDF5 (see `hdf5.read_hdf5`).

    `columns` names columns without names, as t, q, v; `step` is the time step of files that count steps
    alone.  Raises StoreError, in one line, where the file cannot be read, or lacks times or positions.
    """
    columns = list(columns)
    found = (
        _apart("", path, columns, step, most) if is_hdf5(path) else {path.name: _read(path, columns, step)}
    )
    return {name: fitting(path, digits.as_written(states)) for name, states in found.items()}


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
        if bounded:
            return _apart(found.name, path, columns, step)[""]
        return found.read(path, columns, step)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise StoreError(f"{path}: what gzip has packed is damaged or cut off ({error})") from error
    except UnicodeDecodeError as error:
        raise StoreError(
            f"{path}: is of no format that is known here, and no text in UTF-8; {KNOWN}"
        ) from error


def _apart(
    name: str, path: Path, columns: list[str], step: float | None, most: int | None = None
) -> dict[str, States]:
    """What a child process reads by the format of a name, or as HDF5 where this is ""."""
    try:
        said = apart.read(__name__, "packed", path, name, json.dumps([columns, step, most]))
    except apart.EndedError as error:
        kind = name or "HDF5"
        raise StoreError(
            f"cannot read {path}: it is damaged, or no {kind} file: reading it {error}"
        ) from error
    with np.load(BytesIO(said), allow_pickle=False) as arrays:
        found = {}
        for i, (label, roundoff, beside, units, notes) in enumerate(json.loads(str(arrays["head"]))):
            parts = {part: arrays.get(f"{part}{i}") for part in (*PARTS, *OF_DECIMALS)}
            halves = [parts.pop(part) for part in OF_DECIMALS]
            fixed = None if beside is None else Fixed(halves[0], halves[1], beside)
            found[label] = States(**parts, roundoff=roundoff, fixed=fixed, units=units, notes=tuple(notes))
        return found


def packed(path: Path, name: str, given: str) -> bytes:
    """The states that a format's reader finds, as NPZ."""
    columns, step, most = json.loads(given)
    found = {"": BY_NAME[name].read(path, columns, step)} if name else read_hdf5(path, columns, step, most)
    heads = [
        [label, one.roundoff, one.fixed and one.fixed.beside, dict(one.units), one.notes]
        for label, one in found.items()
    ]
    arrays: dict[str, Any] = {"head": json.dumps(heads)}
    for i, one in enumerate(found.values()):
        parts = {part: getattr(one, part) for part in PARTS} | dict(
            zip(OF_DECIMALS, one.fixed or (), strict=False)
        )
        arrays |= {f"{part}{i}": x for part, x in parts.items() if x is not None}
    out = BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()
