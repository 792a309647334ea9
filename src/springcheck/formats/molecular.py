"""Files of molecular programs that no library reads in full precision: LAMMPS dumps, .trr, plain .xyz.

Each in its own units: GROMACS' are nm, ps and u, those of a dump are LAMMPS' own.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import Fixed, Floats, States, times
from springcheck.formats.lines import MOST_NUMBERS, Lines, number
from springcheck.formats.tables import SHOWN, fixed, roundoff


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


def is_xyz(head: bytes) -> bool:
    """Whether a text begins as .xyz does: a number, a comment, and an atom of a name and numbers."""
    number_, _, rest = head.partition(b"\n")
    atom = rest.partition(b"\n")[2].split(b"\n")[0].split()
    return number_.strip().isdigit() and len(atom) > 3 and atom[0][:1].isalpha() and len(atom[0]) < 12


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
            t.append(_time(next(lines)))
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
    known = roundoff(first, range(width)), fixed(first, range(3), range(3, width))
    return of_frames(path, clock(path, t, step), table[:, :, :3], v, None, *known)


def _time(comment: str) -> float | None:
    """The time in a comment such as ``t = 0.1`` or ``step 3, Time: 0.3 ps``; None where it has none."""
    words = comment[:1000].replace("=", " = ").replace(":", " = ").replace(",", " ").split()
    for name, sign, value in zip(words, words[1:], words[2:], strict=False):
        if name.lower() in ("t", "time") and sign == "=":
            try:
                return number(value)
            except ValueError:
                return None
    return None


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
