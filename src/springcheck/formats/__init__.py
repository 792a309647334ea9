"""Trajectories of others, told by what is in them, not by their names; the store opens those in HDF5."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from springcheck import store
from springcheck.errors import StoreError
from springcheck.formats.columns import ALONE, States, kind
from springcheck.formats.molecular import read_ase, read_dcd, read_gro, read_lammps, read_trr, read_xtc
from springcheck.formats.numbers import read_npy, read_npz, states_of
from springcheck.formats.tables import read_table

__all__ = ["States", "is_hdf5", "read", "read_hdf5"]

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


def read(
    path: Path, columns: Sequence[str] = (), step: float | None = None, *, alone: bool = False
) -> States:
    """The states of a file that is no HDF5; `columns` names what has no names, as t, q, v.

    Text tables, NPY, NPZ, extended XYZ, ASE's .traj, LAMMPS dumps, DCD, GROMACS .gro, .trr and .xtc.
    `step` is the time step of files that count steps alone.  Raises StoreError, in one line, where it cannot
    be read, or lacks times, positions or, unless these may be `alone`, velocities.
    """
    return _moving(path, _read(path, columns, step), alone=alone)


def _read(path: Path, columns: Sequence[str], step: float | None) -> States:
    head = _head(path)
    if not head:
        raise StoreError(f"{path}: is empty")
    try:
        if head.startswith(b"\x93NUMPY"):
            return read_npy(path, columns)
        if head.startswith(b"PK\x03\x04"):
            return read_npz(path, columns)
        if head.startswith(b"ITEM: "):
            return read_lammps(path, step)
        if head.startswith((b"\x00\x00\x07\xcb", b"\x00\x00\x07\xe7")) or head[4:8] == b"CORD":
            return read_dcd(path) if head[4:8] == b"CORD" else read_xtc(path, step)
        if head.startswith(b"\x00\x00\x07\xc9"):
            return read_trr(path, step)
        if head.startswith(b"- of Ulm") or _is_extended_xyz(path):
            return read_ase(path, step)
        return read_gro(path, step) if path.suffix == ".gro" else read_table(path, columns)
    except UnicodeDecodeError as error:
        raise StoreError(f"{path}: is of no format that is known here") from error


def read_hdf5(path: Path, columns: Sequence[str] = (), *, alone: bool = False) -> dict[str, States]:
    """The trajectories of an HDF5 file that is neither a store nor H5MD, by name.

    Every group with datasets of times, positions, and momenta or velocities (unless positions may be `alone`)
    is one; or `columns` name the datasets, as ``t=run/clock,q=run/x,v=run/dx``.  Raises StoreError where
    there is none.
    """
    if columns:
        wanted = {text.rpartition("=")[2].strip("/") for text in columns}
        groups = store.read_arrays(path, lambda place: place in wanted)
        flat = {
            f"{group}/{name}".strip("/"): a for group, found in groups.items() for name, a in found.items()
        }
        names = [x.replace("=/", "=").removeprefix("/") for x in columns]
        return {path.name: _moving(path, states_of(path, flat, names), alone=alone)}
    groups = store.read_arrays(path, lambda place: kind(place.rpartition("/")[2]) is not None)
    made: dict[str, States] = {}
    said = StoreError(
        f"{path} has no /particles as H5MD has, and no datasets of times, positions and velocities by their "
        "names; give these, as --columns t=clock,q=run/x,v=run/dx"
    )
    for name, arrays in groups.items():
        try:
            made[name or path.name] = _moving(path, states_of(path, arrays), alone=alone)
        except StoreError as error:
            said = error if ALONE in str(error) else said
    if not made:
        raise said
    return made


def _moving(path: Path, found: States, *, alone: bool) -> States:
    if found.p is None and found.v is None and not alone:
        raise StoreError(f"{path}: holds no momenta or velocities; {ALONE}")
    return found


def _is_extended_xyz(path: Path) -> bool:
    with path.open("rb") as file:
        first, second = file.readline(200), file.readline(2000)
    return first.strip().isdigit() and b"Properties=" in second
