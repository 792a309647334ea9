"""What coordinates show together: two particles bound to each other, a velocity that only turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.identify.record import ROUNDING, Record
from springcheck.identify.result import Identification
from springcheck.physics.arrays import Floats

ALIKE = 64
"""Roundings of a number by which coordinates of one motion may differ."""


def of_a_bond(record: Record, moving: list[int], stated: Floats, notes: list[str]) -> Floats:
    """The stiffness of each coordinate (n,) where the stated one is that of a bond between two particles at
    rest as a whole: k m_j/mu, mu the reduced mass, and a note; the stated one where the states are no pair's.

    Of two halves of the coordinates the momenta are opposite in every frame, in whatever direction.
    """
    half = len(moving) // 2
    if record.mass is None or len(moving) % 2 or not half:
        return stated
    one, other = moving[:half], moving[half:]
    p = (record.v * record.mass).astype(np.float64)
    unit = (record.v_quantum * record.mass)[:, one] + (record.v_quantum * record.mass)[:, other]
    size = np.max(np.abs(p[:, moving]))
    # either particle's velocity adds its roundings up by itself
    room = unit + ALIKE * ROUNDING * np.sqrt(len(p)) * size
    if np.any(np.abs(p[:, one] + p[:, other]) > room):
        return stated
    masses = [np.unique(record.mass[x]) for x in (one, other)]
    if len(masses[0]) > 1 or len(masses[1]) > 1:
        return stated
    notes.append(
        "the two halves of the coordinates are two particles bound to each other, at rest as a whole: the "
        "stated stiffness is taken for that of the bond"
    )
    return np.asarray(stated * record.mass * (1 / masses[0][0] + 1 / masses[1][0]))


def of_rotation(record: Record, moving: list[int], found: Identification) -> Identification:
    """What was found, where the states may as well be a rotation."""
    pair = turning(record, moving) if found.fits else None
    if pair is None:
        return found
    return replace(
        found, verdict="not told apart", scheme=None, aliases=(), fits=False, undecided=True,
        statement=f"The velocity of coordinates {pair[0]} and {pair[1]} only turns: a rotation, as of a "
        f"charge in a magnetic field (Boris), or a circular orbit on springs: {found.statement}",
        notes=(*found.notes, "what would tell: the stiffness, or an orbit that is no circle"),
    )  # fmt: skip


def turning(record: Record, moving: list[int]) -> tuple[int, int] | None:
    """Two coordinates whose velocity only turns, its size the same in every frame; None where there are none.

    A charge in a magnetic field moves so, and a circular orbit about an isotropic spring.
    """
    v = record.v.astype(np.float64)
    for n, i in enumerate(moving):
        for j in moving[n + 1 :]:
            square = v[:, i] ** 2 + v[:, j] ** 2
            mean = float(np.mean(square))
            off = 2 * np.sqrt(mean) * np.max(record.v_quantum[:, [i, j]])
            if np.ptp(square) > ALIKE * ROUNDING * np.sqrt(len(v)) * mean + 2 * off:
                continue
            if min(np.ptp(v[:, i]), np.ptp(v[:, j])) > np.sqrt(mean):
                return i, j
    return None
