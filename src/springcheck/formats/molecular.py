"""Frames of atoms: LAMMPS dumps and .xyz as text, .trr in the precision in which it was written.

Each in its own units: GROMACS' are nm, ps and u, those of a dump are LAMMPS' own.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import MOST_NUMBERS, Floats, States, split, times
from springcheck.formats.digits import SHOWN, fixed, number, roundoff
from springcheck.formats.tables import Lines

R, V, P = ("x", "y", "z"), ("vx", "vy", "vz"), ("px", "py", "pz")
IMAGES = "ix", "iy", "iz"
"""Counters of the borders that wrapped positions have crossed."""


def of_frames(path: Path, t: Any, q: Sequence[Any], v: Sequence[Any], coarse: float = 0.0) -> States:
    """States of frames of as many particles each: q and v (n, 3), no v where there are none."""
    if len({len(x) for x in q}) > 1:
        raise StoreError(f"{path}: the number of particles changes from frame to frame")
    columns = {name: np.reshape(x, (len(t), -1)) for name, x in (("t", t), ("q", q), ("v", v)) if len(x)}
    return split(path, columns, max(coarse, 2.0**-53))


Frame: TypeAlias = tuple[float | None, int, int, list[str]]
"""Time, number of the step, number of atoms, and names of their columns."""


def clock(
    path: Path, said: Sequence[float | None], step: float | None, steps: Any = None, unit: str = ""
) -> Floats:
    """The times that the frames state, or where none does, those of counted steps."""
    known = [one for one in said if one is not None]
    if not known:
        return times(path, range(len(said)) if steps is None else steps, step, unit)
    if len(known) < len(said):
        how = "; give its time step, as --step H" * (step is None)
        raise StoreError(f"{path}: frame {[*said].index(None)} says no time, as others do{how}")
    return np.array(known)


def _read(path: Path, step: float | None, what: str, begins: Callable[[Lines], Iterator[Frame]]) -> States:
    """The states of a text of frames; `begins` reads the head of a frame, whose atoms are rows."""
    heads: list[Frame] = []
    numbers = array("d")
    first: list[list[str]] = []
    symbols: list[str] = []
    wanted: dict[str, int] = {}
    with Lines(path) as lines:
        try:
            for head in begins(lines):
                _, _, n, names = head
                if not 0 < n <= MOST_NUMBERS // 6:
                    raise lines.wrong(f"{n} atoms are none that can be read")
                if heads and (n, names) != heads[0][2:]:
                    raise lines.wrong(
                        f"the number of atoms changes from {heads[0][2]} to {n}, or their columns"
                    )
                heads.append(head)
                for _ in range(n):
                    cells = lines.take().split()
                    wanted = wanted or _wanted(path, names[: len(cells)])
                    row = [cells[i] for i in wanted.values()]
                    numbers.extend(map(number, row))
                    if len(first) < SHOWN:
                        first.append(row)
                    if len(heads) == 1 and "species" in names:
                        symbols.append(cells[names.index("species")])
        except ValueError as error:
            raise lines.wrong(f"is no {what}: {str(error)[:100]}") from error
        except IndexError:
            raise lines.wrong(f"is no {what}: it has fewer words than it should have") from None
    if not heads:
        raise StoreError(f"{path}: is no {what}")
    at = {name: i for i, name in enumerate(wanted)}
    table = np.frombuffer(numbers).reshape(len(heads), heads[0][2], len(wanted))
    if "id" in at:
        order = np.argsort(table[:, :, at["id"]], axis=1, kind="stable")
        table = np.take_along_axis(table, order[:, :, None], axis=1)
        ids = table[:, :, at["id"]]
        if np.any(others := np.any(ids != ids[0], axis=1)):
            raise StoreError(f"{path}: frame {np.argmax(others)} has other atoms than the first, by their id")
    if "ix" in at and np.any(table[:, :, [at[name] for name in IMAGES]]):
        raise StoreError(f"{path}: positions are wrapped into a box; dump xu yu zu in place of x y z")
    columns = {name: table[:, :, i] for name, i in at.items() if name not in ("id", *IMAGES)}
    columns["t"] = clock(path, [one[0] for one in heads], step, [one[1] for one in heads])[:, None]
    # LAMMPS writes 6 digits unless dump_modify asks for more
    rates = range(len(R), len(R) + len(V) * bool({*V, *P} & at.keys()))
    known, decimals = roundoff(first, [*range(len(R)), *rates]), fixed(first, range(len(R)), rates)
    if symbols and "mass" not in at:
        columns["mass"] = np.tile(_masses(symbols), (len(heads), 1))
    if P[0] in at and "mass" in columns:
        from ase.units import fs

        of_one = fs / columns["mass"][0]
        columns |= {v: columns.pop(p) / columns["mass"] * fs for v, p in zip(V, P, strict=True)}
        decimals = decimals and decimals._replace(v=decimals.v * np.repeat(of_one, 3))
    return replace(split(path, columns, known), fixed=decimals)


def _wanted(path: Path, names: list[str]) -> dict[str, int]:
    """Places of positions, of velocities or momenta, and of masses, numbers of atoms and images."""
    unwrapped = {name: f"{name}u" for name in R if f"{name}u" in names}
    known = {name: names.index(unwrapped.get(name, name)) for name in (*R, *V, *P) if
             unwrapped.get(name, name) in names}  # fmt: skip
    if not {*R} <= known.keys():
        raise StoreError(f"{path}: its atoms have no x, y and z, but {' '.join(names)[:100]}")
    rates = next((group for group in (V, P) if {*group} <= known.keys()), ())
    others = ("mass", "id", *(IMAGES if "x" in names and not unwrapped and {*IMAGES} <= {*names} else ()))
    return {name: known[name] for name in (*R, *rates)} | {
        name: names.index(name) for name in others if name in names
    }


def _masses(symbols: list[str]) -> Floats:
    """Masses of elements, as ASE has them [u]."""
    from ase.data import atomic_masses, atomic_numbers

    return np.array([atomic_masses[atomic_numbers.get(symbol, 0)] for symbol in symbols])


def read_lammps(path: Path, columns: list[str], step: float | None) -> States:
    """A text dump with positions (x or xu), velocities (vx), and optionally id and mass."""

    def begins(lines: Lines) -> Iterator[Frame]:
        for line in lines:
            item, time, steps, n = line, None, None, 0
            if not item.startswith("ITEM: "):
                raise lines.wrong("ITEM: TIMESTEP is expected")
            while not item.startswith("ITEM: ATOMS"):
                if item.startswith("ITEM: TIMESTEP"):
                    steps = int(lines.take())
                elif item.startswith("ITEM: TIME"):
                    # where `dump_modify time yes` asks for it
                    time = float(lines.take())
                elif item.startswith("ITEM: NUMBER OF ATOMS"):
                    n = int(lines.take())
                item = lines.take()
            if steps is None or not n:
                raise lines.wrong("ITEM: TIMESTEP and ITEM: NUMBER OF ATOMS are missing before it")
            yield None if step is not None else time, steps, n, item.split()[2:]

    return _read(path, step, "LAMMPS dump", begins)


def is_xyz(head: bytes) -> bool:
    """Whether a text begins as .xyz does: a number, a comment, and an atom of a name and numbers."""
    number_, _, rest = head.partition(b"\n")
    atom = rest.partition(b"\n")[2].split(b"\n")[0].split()
    return number_.strip().isdigit() and len(atom) > 3 and atom[0][:1].isalpha() and len(atom[0]) < 12


def read_xyz(path: Path, columns: list[str], step: float | None) -> States:
    """An .xyz file: a name and three numbers for each atom, and three more where it has velocities, or the
    columns that an extended one names.

    The comment of a frame may hold its time, as ``t = 0.1``.  ASE's momenta become velocities per fs.
    """

    def begins(lines: Lines) -> Iterator[Frame]:
        for i, line in enumerate(filter(str.strip, lines)):
            comment = lines.take()
            yield _time(comment), i, int(line), _properties(comment) or ["", *R, *V]

    return _read(path, step, ".xyz frame", begins)


RATES = "velocities", "velocity", "vel", "velo", "v"
NAMED = {"pos": R, "momenta": P, "masses": ("mass",), **dict.fromkeys(RATES, V)}
"""Columns of extended .xyz by our names for them."""


def _properties(comment: str) -> list[str]:
    """Names of the columns of extended .xyz, from ``Properties=species:S:1:pos:R:3``; none in others."""
    said = comment.partition("Properties=")[2].split()[:1]
    words = said[0].strip('"').split(":") if said else []
    names: list[str] = []
    for name, width in zip(words[::3], words[2::3], strict=False):
        many = min(int(width), 99)
        known = NAMED.get(name.lower(), ())
        names += known if len(known) == many else [name.lower()] * many
    return names


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
    return of_frames(path, t, q, v, written)
