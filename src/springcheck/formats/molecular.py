"""Files of molecular programs: LAMMPS dumps and logs, GROMACS .gro and .trr, plain .xyz.

Each in its own units: GROMACS' are nm, ps and u, those of a dump are LAMMPS' own.
"""

from __future__ import annotations

import re
import struct
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import ALONE, Fixed, Floats, States, kind, listed, times
from springcheck.formats.lines import MOST_NUMBERS, Lines, number
from springcheck.formats.tables import SHOWN, fixed, of_rows, roundoff


def clock(path: Path, said: Sequence[float | None], step: float | None, unit: str = "") -> Floats:
    """The times that the frames state, or where none does, those of counted steps."""
    known = [one for one in said if one is not None]
    if not known:
        return times(path, range(len(said)), step, unit)
    if len(known) < len(said):
        raise StoreError(f"{path}: frame {[*said].index(None)} says no time, as others do")
    return np.array(known)


def of_frames(
    path: Path, t: Any, q: Any, v: Any, mass: Any, roundoff: float = 2.0**-53, fixed: Fixed | None = None
) -> States:
    """States of frames: t (f,), q and v (f, n, 3), v None where there are none, mass (n,) or None."""
    try:
        at, positions, velocities = (np.asarray(x, np.float64) for x in (t, q, q if v is None else v))
    except (ValueError, TypeError) as error:
        raise StoreError(f"{path}: its frames are no numbers, or not of as many particles each") from error
    frames = len(positions) if positions.ndim else 0
    if at.shape != (frames,) or positions.ndim != 3 or velocities.shape != positions.shape:
        raise StoreError(
            f"{path}: times {at.shape}, positions {positions.shape} and velocities {velocities.shape} do not "
            "belong to the same frames and particles"
        )
    if frames < 2:
        raise StoreError(f"{path}: holds {frames} frame; two are needed")
    m = None if mass is None else np.repeat(np.asarray(mass, np.float64), positions.shape[2])
    flat = None if v is None else velocities.reshape(frames, -1)
    where = positions.reshape(frames, -1)
    return States(t=at, q=where, p=None, v=flat, mass=m, roundoff=roundoff, fixed=fixed)


@contextmanager
def _frames(path: Path, what: str) -> Iterator[Lines]:
    """The lines of a file of frames; errors name the line."""
    with Lines(path) as lines:
        try:
            yield lines
        except ValueError as error:
            raise lines.wrong(f"is no {what}: {str(error)[:100]}") from error
        except IndexError:
            raise lines.wrong(f"is no {what}: it has fewer words than it should have") from None
        except StopIteration:
            raise lines.wrong("is damaged or cut off") from None


def _atoms(text: str, lines: Lines, before: int | None) -> int:
    """The number of atoms that a frame announces."""
    n = int(text)
    if not 0 < n <= MOST_NUMBERS // 6:
        raise lines.wrong(f"{n} atoms are none that can be read")
    if before not in (None, n):
        raise lines.wrong(f"the number of atoms changes from {before} to {n}")
    lines.count(6 * n)
    return n


def read_lammps(path: Path, columns: list[str], step: float | None) -> States:
    """A text dump with id, positions (x or xu), velocities (vx), and optionally the mass."""
    steps: list[int] = []
    clock: list[float] = []
    numbers = array("d")
    first: list[list[str]] = []
    names: list[str] = []
    n: int | None = None
    with _frames(path, "LAMMPS dump") as lines:
        for line in lines:
            # before the number of the step, as `dump_modify units yes time yes` asks for them
            item = line
            while item.startswith(("ITEM: UNITS", "ITEM: TIME")) and "STEP" not in item:
                said = next(lines)
                if item.startswith("ITEM: TIME"):
                    clock.append(float(said))
                item = next(lines)
            if not item.startswith("ITEM: TIMESTEP"):
                raise lines.wrong("ITEM: TIMESTEP is expected")
            steps.append(int(next(lines)))
            item, announced = next(lines), 0
            while not item.startswith("ITEM: ATOMS"):
                if item.startswith("ITEM: NUMBER OF ATOMS"):
                    announced = n = _atoms(next(lines), lines, n)
                item = next(lines)
            if not announced:
                raise lines.wrong("ITEM: NUMBER OF ATOMS is missing before it")
            wanted = _wanted(path, item.split()[2:])
            if names and list(wanted) != names:
                raise lines.wrong("its columns change")
            names = list(wanted)
            for _ in range(announced):
                cells = next(lines).split()
                row = [cells[i] for i in wanted.values()]
                values = [float(cell) for cell in row]
                if "ix" in wanted and any(values[-3:]):
                    raise lines.wrong("positions are wrapped into a box; dump xu yu zu in place of x y z")
                numbers.extend(values)
                if len(first) < SHOWN:
                    first.append(row[:6])
    table = np.frombuffer(numbers).reshape(len(steps), n or 1, len(names))
    if "id" in names:
        order = np.argsort(table[:, :, names.index("id")], axis=1, kind="stable")
        table = np.take_along_axis(table, order[:, :, None], axis=1)
        ids = table[:, :, names.index("id")]
        if np.any(others := np.any(ids != ids[0], axis=1)):
            raise StoreError(f"{path}: frame {np.argmax(others)} has other atoms than the first, by their id")
    q, v = table[:, :, :3], table[:, :, 3:6]
    mass = table[0, :, names.index("mass")] if "mass" in names else None
    # LAMMPS writes 6 digits unless dump_modify asks for more
    known = step is None and len(clock) == len(steps)
    when = np.array(clock) if known else times(path, steps, step)
    told = roundoff(first, range(6)), fixed(first, range(3), range(3, 6))
    return of_frames(path, when, q, v, mass, *told)


def _wanted(path: Path, names: list[str]) -> dict[str, int]:
    """Columns of positions, velocities and, where written, masses and numbers of atoms."""
    pairs = ["xu" if "xu" in names else "x", "yu" if "yu" in names else "y", "zu" if "zu" in names else "z"]
    wanted = [*pairs, "vx", "vy", "vz"]
    lacking = [name for name in wanted if name not in names]
    if lacking:
        raise StoreError(f"{path}: its atoms have no {', '.join(lacking)}; dump x y z vx vy vz")
    # counters of the borders that wrapped positions have crossed
    images = ["ix", "iy", "iz"] if {"x", "ix", "iy", "iz"} <= set(names) and "xu" not in names else []
    return {name: names.index(name) for name in (*wanted, "mass", "id", *images) if name in names}


def read_log(path: Path, columns: list[str], step: float | None) -> States:
    """Thermodynamic output of a LAMMPS log: Step or Time, v_... .

    Runs whose columns mean what those of the first one with positions do are read, others are noted.
    """
    runs: list[tuple[list[str], array[float], list[list[str]]]] = []
    within = False
    with _frames(path, "LAMMPS log") as lines:
        for line in lines:
            cells = line.split()
            if cells[:1] == ["Step"]:
                runs.append((cells, array("d"), []))
                within = True
            elif cells[:3] == ["Loop", "time", "of"]:
                within = False
            elif within and len(cells) == len(runs[-1][0]) and re.match(r"[-+.\d]", cells[0]):
                lines.count(len(cells))
                runs[-1][1].extend(number(cell) for cell in cells)
                if len(runs[-1][2]) < SHOWN:
                    runs[-1][2].append(cells)
    runs = [run for run in runs if run[1]]
    if not runs:
        raise StoreError(f"{path}: this LAMMPS log has no thermodynamic output that begins with Step")
    wanted = next((found for header, *_ in runs if (found := _read_of(header, columns))), runs[0][0])
    parts: list[Floats] = []
    first: list[list[str]] = []
    notes = []
    for header, numbers, shown in runs:
        values = np.frombuffer(numbers).reshape(-1, len(header))
        if not set(wanted) <= set(header) or (columns and header != wanted):
            steps = f"steps {values[0, 0]:.0f} to {values[-1, 0]:.0f}"
            notes.append(f"{steps} are left out: their columns are {listed(header)}")
            continue
        places = [header.index(name) for name in wanted]
        # a run begins with the frame that the last one ended with
        again = bool(parts) and values[0, 0] == parts[-1][-1, 0]
        parts.append(values[int(again) :, places])
        first += [[cells[i] for i in places] for cells in shown]
    values = np.concatenate(parts)
    names = columns or [_bare(name) for name in wanted]
    if not columns and "Time" not in wanted:
        values[:, 0] = times(path, values[:, 0], step)
        names[0] = "t"
    return replace(of_rows(path, values, first, names, []), notes=tuple(notes))


def _bare(name: str) -> str:
    """A column's name without LAMMPS' prefix of a variable, a compute or a fix."""
    return re.sub(r"^[vcf]_", "", name)


def _read_of(header: list[str], columns: list[str]) -> list[str]:
    """The columns of a run that are read, all of them where they were named; none where it has no
    positions."""
    kinds = [kind(_bare(name)) for name in header]
    if columns:
        return header if len(columns) == len(header) else []
    return [x for x, what in zip(header, kinds, strict=True) if what or x == "Step"] if "q" in kinds else []


def read_gro(path: Path, columns: list[str], step: float | None) -> States:
    """Frames of a .gro file with velocities; the times are in their titles."""
    t: list[float | None] = []
    numbers = array("d")
    n: int | None = None
    wide = thin = 0
    with _frames(path, ".gro frame") as lines:
        for title in lines:
            if not title.strip():
                break
            n = _atoms(next(lines), lines, n)
            said = re.search(r".*\bt=\s*([-+.\deE]+)", title)
            t.append(float(said[1]) if said else None)
            for atom in range(n):
                row = next(lines)
                if not (atom or wide):
                    # the distance between decimal points is the width of the columns
                    points = [j for j, c in enumerate(row) if c == "."]
                    if len(points) < 6:
                        raise StoreError(f"{path}: holds no velocities; {ALONE}")
                    wide, thin = points[1] - points[0], points[4] - points[3]
                at = 20 + 3 * wide
                cells = [row[20 + k * wide : 20 + (k + 1) * wide] for k in range(3)]
                cells += [row[at + k * thin : at + (k + 1) * thin] for k in range(3)]
                numbers.extend(map(float, cells))
            next(lines)
    table = np.frombuffer(numbers).reshape(len(t), n or 1, 6)
    q, v = table[:, :, :3], table[:, :, 3:]
    # decimals are fixed: 3 of positions and 4 of velocities unless GROMACS is told otherwise
    sizes = (float(np.max(np.abs(q), initial=0)), float(np.max(np.abs(v), initial=0)))
    halves = 0.5 * 10.0 ** (5 - wide), 0.5 * 10.0 ** (4 - thin)
    written = max([half / size for half, size in zip(halves, sizes, strict=True) if size > 0], default=1.0)
    single = all(np.all(np.abs(np.float32(x) - x) <= half) for x, half in zip((q, v), halves, strict=True))
    of_all = Fixed(*halves, 2.0**-24 if single else 2.0**-53)
    return of_frames(path, clock(path, t, step, "ps"), q, v, None, written, of_all)


COUNT = rb"\A[^\S\n]*\d+[^\S\n]*\n"
"""Extended and plain .xyz begin with a line of one number."""
XYZ = COUNT + rb".*\n[^\S\n]*[A-Za-z]{1,8}\d*[^\S\n]+[-+.\d]"
"""Plain .xyz continues with a comment and an atom of a name and numbers."""


def read_xyz(path: Path, columns: list[str], step: float | None) -> States:
    """Plain .xyz: a name and three numbers for each atom, and three more where it has velocities.

    The comment of a frame may hold its time, as ``t = 0.1``.
    """
    t: list[float | None] = []
    numbers = array("d")
    first: list[list[str]] = []
    n: int | None = None
    width = 0
    with _frames(path, ".xyz frame") as lines:
        for line in lines:
            if not line.strip():
                continue
            n = _atoms(line, lines, n)
            comment = re.search(r"\b(?:t|time)\s*[=:]\s*([-+.\deEdD]+)", next(lines)[:1000], re.IGNORECASE)
            t.append(number(comment[1]) if comment else None)
            for _ in range(n):
                cells = next(lines).split()[1:]
                width = width or (6 if len(cells) >= 6 else 3)
                numbers.extend(number(cell) for cell in cells[:width])
                if len(numbers) % width or len(cells) < width:
                    raise lines.wrong(f"an atom has {width} numbers, not {len(cells)}")
                if len(first) < SHOWN:
                    first.append(cells[:width])
    table = np.frombuffer(numbers).reshape(len(t), n or 1, width or 3)
    v = table[:, :, 3:] if width == 6 else None
    told = roundoff(first, range(width)), fixed(first, range(3), range(3, width))
    return of_frames(path, clock(path, t, step), table[:, :, :3], v, None, *told)


TRR_MARK = 1993
"""The first number of every frame of a .trr file."""

TRR_NUMBERS = {4: (">f4", 2.0**-24), 8: (">f8", 2.0**-53)}
"""Numbers of so many bytes: dtype and unit roundoff."""


def read_trr(path: Path, columns: list[str], step: float | None) -> States:
    """A GROMACS .trr file in the precision in which it was written; MDAnalysis reads single precision alone.

    Positions [nm] and velocities [nm/ps].  Frames are XDR, big-endian: a mark, the format's name, the bytes
    of each array, the numbers of atoms and of the step, time and coupling, then box, virial, pressure,
    positions, velocities and forces.
    """
    if path.stat().st_size > 8 * MOST_NUMBERS:
        raise StoreError(f"{path}: more than {MOST_NUMBERS:,} numbers: keep fewer frames")
    data, at, found, written = path.read_bytes(), 0, [], 0.0
    try:
        while at < len(data):
            magic, _, name = struct.unpack_from(">3i", data, at)
            *sizes, atoms, _, _ = struct.unpack_from(">13i", data, at + 12 + name)
            if magic != TRR_MARK or atoms < 1 or min(name, *sizes) < 0 or not any(sizes):
                raise StoreError(f"{path}: is no .trr file from byte {at} on")
            # bytes of positions, velocities or forces, or of the box where there are none
            width = max(sizes[7:]) // (3 * atoms) or sizes[2] // 9
            kind, coarse = TRR_NUMBERS[width]
            written = max(written, coarse)
            begin = at + 64 + name
            time = float(np.frombuffer(data, kind, 1, begin)[0])
            begin += 2 * width + sum(sizes[:7])
            at = begin + sum(sizes[7:])
            if sizes[7] and sizes[8]:
                both = np.frombuffer(data, kind, 6 * atoms, begin).reshape(2, atoms, 3)
                found.append((time, *both.astype(np.float64)))
    except (struct.error, KeyError, ValueError) as error:
        raise StoreError(f"{path}: the .trr file is cut off or damaged in frame {len(found)}") from error
    if not found:
        raise StoreError(f"{path}: has no frame with both positions and velocities")
    t, q, v = zip(*found, strict=True)
    return of_frames(path, t, q, v, None, written)
