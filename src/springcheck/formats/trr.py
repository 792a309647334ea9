"""GROMACS .trr files in the precision in which they were written; MDAnalysis reads single precision alone."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import States
from springcheck.formats.lines import MOST_NUMBERS
from springcheck.formats.molecular import of_frames

MARK = 1993
"""The first number of every frame."""

KINDS = {4: (">f4", 2.0**-24), 8: (">f8", 2.0**-53)}
"""Numbers of so many bytes: dtype and unit roundoff."""


def read_trr(path: Path, columns: list[str], step: float | None) -> States:
    """Positions [nm] and velocities [nm/ps].

    Frames are XDR, big-endian: a mark, the format's name, the bytes of each array, the numbers of atoms and
    of the step, time and coupling, then box, virial, pressure, positions, velocities and forces.
    """
    if path.stat().st_size > 8 * MOST_NUMBERS:
        raise StoreError(f"{path}: more than {MOST_NUMBERS:,} numbers: keep fewer frames")
    data, at, found, roundoff = path.read_bytes(), 0, [], 0.0
    try:
        while at < len(data):
            magic, _, name = struct.unpack_from(">3i", data, at)
            *sizes, atoms, _, _ = struct.unpack_from(">13i", data, at + 12 + name)
            if magic != MARK or atoms < 1 or min(name, *sizes) < 0 or not any(sizes):
                raise StoreError(f"{path}: is no .trr file from byte {at} on")
            # bytes of positions, velocities or forces, or of the box where there are none
            width = max(sizes[7:]) // (3 * atoms) or sizes[2] // 9
            kind, coarse = KINDS[width]
            roundoff = max(roundoff, coarse)
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
    return of_frames(path, t, q, v, None, roundoff)
