"""Trajectories of molecular programs: extended XYZ, ASE's .traj, LAMMPS dumps, DCD, GROMACS .gro, .trr, .xtc.

Each in its own units: ASE's in Angstrom, fs and u, GROMACS' in nm, ps and u, LAMMPS' in those of its dump.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import ALONE, States
from springcheck.formats.tables import roundoff
from springcheck.physics.arrays import Floats

MOST_FRAMES = 1 << 20


def _times(path: Path, steps: Any, step: float | None) -> Floats:
    if step is None:
        raise StoreError(f"{path}: counts steps and knows no times; give its time step, as --step H")
    return np.asarray(np.asarray(steps, np.float64) * step)


def _made(path: Path, t: Any, q: Any, v: Any, mass: Any, roundoff: float = 2.0**-53) -> States:
    times, positions = (np.asarray(x, np.float64) for x in (t, q))
    frames = len(times)
    if frames < 2:
        raise StoreError(f"{path}: holds {frames} frame; two are needed")
    m = None if mass is None else np.repeat(np.asarray(mass, np.float64), positions.shape[2])
    velocities = None if v is None else np.asarray(v, np.float64).reshape(frames, -1)
    return States(t=times, q=positions.reshape(frames, -1), p=None, v=velocities, mass=m, roundoff=roundoff)


def read_ase(path: Path, step: float | None) -> States:
    """What ASE reads: extended XYZ with velocities or momenta, and .traj."""
    try:
        import ase.io
        from ase import units
    except ModuleNotFoundError as error:
        raise StoreError(
            f"{path}: ASE reads it, which is not installed: python -m pip install ase"
        ) from error
    kind = "traj" if path.read_bytes()[:4] == b"- of" else "extxyz"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = ase.io.read(str(path), index=f":{MOST_FRAMES}", format=kind)
    except Exception as error:
        raise StoreError(f"{path}: ASE cannot read it: {' '.join(str(error).split())[:200]}") from error
    if len({len(atoms) for atoms in found}) != 1:
        raise StoreError(f"{path}: the number of atoms changes")
    v = []
    for atoms in found:
        plain = atoms.arrays.get("velocities", atoms.arrays.get("vel"))
        if plain is not None or atoms.has("momenta"):
            v.append(plain if plain is not None else atoms.get_velocities() * units.fs)
    named = [atoms.info.get("time", atoms.info.get("t")) for atoms in found]
    t = named if all(x is not None for x in named) else _times(path, range(len(found)), step)
    written = 2.0**-53 if kind == "traj" else _written(path.read_text().splitlines())
    moving = v if len(v) == len(found) else None
    return _made(path, t, [atoms.positions for atoms in found], moving, found[0].get_masses(), written)


def _written(lines: list[str]) -> float:
    """How finely an extended XYZ file is written, whose atoms are rows of a name and numbers."""
    rows: list[list[str]] = []
    i = 0
    while i < len(lines) and lines[i].strip():
        n = int(lines[i])
        rows += [line.split() for line in lines[i + 2 : i + 2 + n]]
        i += n + 2
    if len({len(row) for row in rows}) != 1:
        return 2.0**-53
    return roundoff(rows, [i for i, cell in enumerate(rows[0]) if "." in cell])


def read_lammps(path: Path, step: float | None) -> States:
    """A text dump with id, positions (x or xu) and velocities (vx), and perhaps the mass."""
    steps: list[int] = []
    q: list[Floats] = []
    v: list[Floats] = []
    mass = None
    cells: list[list[str]] = []
    lines = path.read_text().splitlines()
    i = 0
    try:
        while i < len(lines):
            if not lines[i].startswith("ITEM: TIMESTEP"):
                raise StoreError(f"{path}, line {i + 1}: ITEM: TIMESTEP is expected")
            steps.append(int(lines[i + 1]))
            i += 2
            n = 0
            while not lines[i].startswith("ITEM: ATOMS"):
                if lines[i].startswith("ITEM: NUMBER OF ATOMS"):
                    n = int(lines[i + 1])
                i += 1
            names = lines[i].split()[2:]
            wanted = [["xu" if "xu" in names else "x", "vx"], ["yu" if "yu" in names else "y", "vy"]]
            wanted.append(["zu" if "zu" in names else "z", "vz"])
            lacking = [x for pair in wanted for x in pair if x not in names]
            if lacking:
                raise StoreError(f"{path}: its atoms have no {', '.join(lacking)}; dump x y z vx vy vz")
            rows = [line.split() for line in lines[i + 1 : i + 1 + n]]
            table = np.array([[float(x) for x in row] for row in rows])
            cells += rows
            if "id" in names:
                table = table[np.argsort(table[:, names.index("id")])]
            q.append(table[:, [names.index(pair[0]) for pair in wanted]])
            v.append(table[:, [names.index(pair[1]) for pair in wanted]])
            mass = table[:, names.index("mass")] if "mass" in names else mass
            i += 1 + n
    except (ValueError, IndexError) as error:
        raise StoreError(f"{path}, line {min(i + 1, len(lines))}: is damaged or cut off: {error}") from error
    if len({len(x) for x in q}) != 1:
        raise StoreError(f"{path}: the number of atoms changes")
    # LAMMPS writes 6 digits unless dump_modify asks for more
    read = [names.index(name) for pair in wanted for name in pair]
    return _made(path, _times(path, steps, step), q, v, mass, roundoff(cells, read))


def read_gro(path: Path, step: float | None) -> States:
    """Frames of a .gro file with velocities; their titles hold the times."""
    lines = path.read_text().splitlines()
    t: list[float] = []
    q: list[Any] = []
    v: list[Any] = []
    i = wide = thin = 0
    try:
        while i < len(lines) and lines[i].strip():
            title, n = lines[i], int(lines[i + 1])
            t.append(float(title.rsplit("t=", 1)[1].split()[0]) if "t=" in title else float(len(t)))
            rows = lines[i + 2 : i + 2 + n]
            # columns are as wide as the distance between decimal points
            points = [j for j, c in enumerate(rows[0]) if c == "."]
            if len(points) < 6:
                raise StoreError(f"{path}: holds no velocities; {ALONE}")
            wide, thin = points[1] - points[0], points[4] - points[3]
            q.append([[float(row[20 + k * wide : 20 + (k + 1) * wide]) for k in range(3)] for row in rows])
            at = 20 + 3 * wide
            v.append([[float(row[at + k * thin : at + (k + 1) * thin]) for k in range(3)] for row in rows])
            i += n + 3
    except (ValueError, IndexError) as error:
        raise StoreError(f"{path}, line {min(i + 1, len(lines))}: is no .gro frame: {error}") from error
    # decimals are fixed: 3 of positions and 4 of velocities unless GROMACS is told otherwise
    sizes = (float(np.max(np.abs(q))), float(np.max(np.abs(v))))
    halves = (0.5 * 10.0 ** (5 - wide), 0.5 * 10.0 ** (4 - thin))
    written = max([half / size for half, size in zip(halves, sizes, strict=True) if size > 0], default=1.0)
    return _made(path, t, q, v, None, written)


def read_trr(path: Path, step: float | None) -> States:
    """A GROMACS .trr file, in single precision, by MDAnalysis."""
    with _opened(path, "lib.formats.libmdaxdr", "TRRFile") as file:
        both = (frame for frame in file if frame.hasx and frame.hasv)
        found = [(frame.time, np.array(frame.x), np.array(frame.v)) for frame in both]
    if not found:
        raise StoreError(f"{path}: has no frame with both positions and velocities")
    t, q, v = zip(*found, strict=True)
    return _made(path, t, q, v, None, 2.0**-24)


def read_xtc(path: Path, step: float | None) -> States:
    """A GROMACS .xtc file by MDAnalysis: positions alone [nm], to the decimals that were asked for."""
    with _opened(path, "lib.formats.libmdaxdr", "XTCFile") as file:
        found = [(frame.time, np.array(frame.x)) for frame in file]
    return _made(path, [t for t, _ in found], [q for _, q in found], None, None, 2.0**-24)


def read_dcd(path: Path) -> States:
    """A DCD file by MDAnalysis: positions alone [Angstrom], in single precision, as is its time step [ps]."""
    with _opened(path, "coordinates.DCD", "DCDReader") as file:
        found = [(frame.time, np.array(frame.positions)) for frame in file]
    times = np.array([t for t, _ in found]).astype(np.float32)
    return _made(path, times, [q for _, q in found], None, None, 2.0**-24)


@contextmanager
def _opened(path: Path, module: str, name: str) -> Iterator[Any]:
    """A file opened by a class of MDAnalysis.  StoreError where it is not installed or cannot read it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader = getattr(import_module(f"MDAnalysis.{module}"), name)
    except ModuleNotFoundError as error:
        raise StoreError(
            f"{path}: MDAnalysis reads it, which is not installed: python -m pip install 'springcheck[md]'"
        ) from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with reader(str(path)) as file:
                yield file
    except Exception as error:
        raise StoreError(f"{path}: cannot be read: {' '.join(str(error).split())[:200]}") from error
