"""Files that libraries read: ASE, MDAnalysis, pandas, SciPy.  In a child process (see `store.apart`).

Each in its own units: ASE's in Angstrom, fs and u, GROMACS' in nm, ps and u, Amber's in Angstrom and ps.
"""

from __future__ import annotations

import warnings
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from springcheck.errors import StoreError, plain
from springcheck.formats.columns import Fixed, Floats, States
from springcheck.formats.lines import MOST_NUMBERS
from springcheck.formats.molecular import clock, of_frames
from springcheck.formats.numbers import of_table, shortened, states_of
from springcheck.formats.tables import fixed, roundoff

MOST_FRAMES = 1 << 20
VELOCITIES = "velocities", "velocity", "vel", "velo"
"""Names of the velocities in extended XYZ: it fixes those of ASE's momenta alone."""
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


def read_ase(path: Path, columns: list[str], step: float | None) -> States:
    """Files that ASE reads: extended XYZ with velocities or momenta, and .traj."""
    with _library(path, "ASE", "ase"):
        import ase.io
        from ase import units

        with path.open("rb") as file:
            kind = "traj" if file.read(4) == b"- of" else "extxyz"
        found = ase.io.read(str(path), index=f":{MOST_FRAMES}", format=kind)
        if len({len(atoms) for atoms in found}) != 1:
            raise StoreError(f"{path}: the number of atoms changes")
        v = []
        for i, atoms in enumerate(found):
            wide = {k: x for k, x in atoms.arrays.items() if x.shape == atoms.positions.shape}
            bare = next((x for name, x in wide.items() if name.lower() in VELOCITIES), None)
            if bare is not None or atoms.has("momenta"):
                v.append(bare if bare is not None else atoms.get_velocities() * units.fs)
            if len(v) not in (0, i + 1):
                raise StoreError(f"{path}: some frames have velocities, and others have none")
        t = clock(path, [atoms.info.get("time", atoms.info.get("t")) for atoms in found], step, "fs")
        q, m = [atoms.positions for atoms in found], found[0].get_masses()
        told: tuple[Any, ...] = ()
        if kind == "extxyz":
            told = _written(path.read_text().splitlines(), np.repeat(units.fs / m, 3))
        left = [] if v else [name for name in wide if name[0] in "vV"]
        notes = tuple(f"the column {name} was not taken: named vel it is velocities" for name in left)
        return replace(of_frames(path, t, q, v or None, m, *told), notes=notes)


def _written(lines: list[str], of_momenta: Floats) -> tuple[float, Fixed | None]:
    """Precision of an extended XYZ file, whose atoms are rows of a name and numbers; `of_momenta` are the
    velocities of momenta of 1 (3 n,)."""
    rows: list[list[str]] = []
    i = 0
    while i < len(lines) and lines[i].strip():
        n = int(lines[i])
        rows += [line.split() for line in lines[i + 2 : i + 2 + n]]
        i += n + 2
    if len({len(row) for row in rows}) != 1:
        return 2.0**-53, None
    places, end = dict[str, range](), 0
    # Properties=species:S:1:pos:R:3
    said = lines[1].partition("Properties=")[2].split()[:1]
    words = said[0].strip('"').split(":") if said else []
    for name, width in zip(words[::3], words[2::3], strict=False):
        places[name.lower()] = range(end, end := end + int(width))
    bare = next((x for name, x in places.items() if name in VELOCITIES), None)
    v = bare or places.get("momenta", range(0))
    found = fixed(rows, places.get("pos", range(0)), v)
    if found and not bare and v:
        found = found._replace(v=found.v * of_momenta)
    return roundoff(rows, [i for i, cell in enumerate(rows[0]) if "." in cell]), found


def read_xtc(path: Path, columns: list[str], step: float | None) -> States:
    """A GROMACS .xtc file by MDAnalysis: positions alone [nm], rounded to the decimals of the file."""
    with _analysed(path, "lib.formats.libmdaxdr", "XTCFile") as file:
        found = [(frame.time, np.array(frame.x)) for frame in islice(file, MOST_FRAMES)]
    return of_frames(path, [t for t, _ in found], [q for _, q in found], None, None, 2.0**-24)


def read_dcd(path: Path, columns: list[str], step: float | None) -> States:
    """A DCD file by MDAnalysis: positions alone [Angstrom], in single precision, as is its time step [ps]."""
    with _analysed(path, "coordinates.DCD", "DCDReader") as file:
        found = [(frame.time, np.array(frame.positions)) for frame in islice(file, MOST_FRAMES)]
    at = np.array([t for t, _ in found]).astype(np.float32)
    return of_frames(path, at, [q for _, q in found], None, None, 2.0**-24)


@contextmanager
def _analysed(path: Path, module: str, name: str) -> Iterator[Any]:
    """A file opened by a class of MDAnalysis."""
    with (
        _library(path, "MDAnalysis", "'springcheck[md]'"),
        getattr(import_module(f"MDAnalysis.{module}"), name)(str(path)) as file,
    ):
        yield file


def read_amber(path: Path, columns: list[str], step: float | None) -> States:
    """An Amber trajectory in NetCDF 3 by SciPy: Angstrom and ps, in single precision; frames of atoms."""
    with _library(path, "SciPy", "scipy"):
        from scipy.io import netcdf_file

        with netcdf_file(str(path), "r", mmap=False, maskandscale=True) as file:
            known: dict[str, Any] = file.variables
            found = {name: np.ma.filled(one[:], np.nan) for name, one in known.items()}
            kinds = [known[name].data.dtype for name in ("coordinates", "velocities") if name in found]
            coarse = max([2.0**-53, *(np.finfo(x).eps / 2 for x in kinds)])
    if not {"time", "coordinates"} <= found.keys():
        raise StoreError(f"{path}: NetCDF without time and coordinates, which Amber's trajectories have")
    v = found.get("velocities")
    return of_frames(path, found["time"], found["coordinates"], v, None, coarse)


def read_mat(path: Path, columns: list[str], step: float | None) -> States:
    """Arrays of a MATLAB file up to version 7, of its structs too, by SciPy."""
    with _library(path, "SciPy", "scipy"):
        from scipy.io import loadmat

        found = {name: np.asarray(x) for name, x in loadmat(str(path)).items() if not name.startswith("__")}
    while structs := [name for name, x in found.items() if x.dtype.names and x.size == 1]:
        for name in structs:
            struct = found.pop(name)
            found |= {f"{name}.{own}": np.asarray(struct[own].item()) for own in struct.dtype.names or ()}
    return states_of(path, shortened(found), columns)


def read_json(path: Path, columns: list[str], step: float | None) -> States:
    """Lists by name, or values by row as pandas writes them; or rows, named or not, in a list or on lines."""
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
    if isinstance(found, list) and found and all(isinstance(row, dict) for row in found):
        names = dict.fromkeys(name for row in found for name in row)
        found = {name: [row.get(name) for row in found] for name in names}
    if isinstance(found, list):
        try:
            rows = np.asarray(found, np.float64)
        except (ValueError, TypeError, OverflowError):
            rows = np.empty(0)
        if rows.ndim == 2 and rows.size:
            return of_table(path, rows, columns)
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
    return states_of(path, arrays, columns)


def read_pandas(call: str, path: Path, columns: list[str], step: float | None) -> States:
    """A table that pandas reads by this function, its columns named in the file."""
    with _library(path, "pandas", "'springcheck[tables]'"):
        pandas = import_module("pandas")

        table = getattr(pandas, call)(str(path))
        if table.index.name is not None:
            table = table.reset_index()
        if table.size > MOST_NUMBERS:
            raise StoreError(f"{path}: more than {MOST_NUMBERS:,} numbers: choose among the columns")
        found: Mapping[str, Any] = {str(name): table[name].to_numpy() for name in table.columns}
    return states_of(path, found, columns)
