"""What coordinates show together: two particles bound to each other, a velocity that only turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.identify.record import ROUNDING, Record
from springcheck.identify.result import Identification
from springcheck.physics.arrays import Floats, Reals

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


WANDERS = 1e-3
"""Part of its size by which the motion of two particles in single precision may leave their line, or their
middle its place: roundings of 1e-7 that walk for 1e8 steps."""


OF_A_PAIR = "two particles bound to each other, which swing along their line: their distance is judged"


def distance(record: Record) -> Record | None:
    """The distance of two particles that swing along their line, in any direction, while their middle rests
    or moves at a constant velocity; None of any other states.

    Each coordinate swings about a place that moves; in single precision the middle and the direction walk.
    """
    moving = np.flatnonzero(np.ptp(record.q, axis=0) + np.ptp(record.v, axis=0) > 0)
    half = len(moving) // 2
    if len(moving) % 2 or not 0 < half <= 3:
        return None
    one, other = moving[:half], moving[half:]
    q, q2, v, v2 = record.q[:, one], record.q[:, other], record.v[:, one], record.v[:, other]
    # the ratio of the masses, by which what changes the momenta is opposite
    push, push2 = np.diff(v, axis=0), np.diff(v2, axis=0)
    ratio = -np.sum(push * push2) / np.maximum(np.sum(push2**2), np.finfo(np.float64).tiny)
    apart, pace = q2 - q, v2 - v
    length = np.sqrt(np.sum(apart**2, axis=1, keepdims=True))
    way = apart / np.where(length > 0, length, 1)
    if not np.all(way @ way[0] > 0):
        return None
    along = np.sum(way * pace, axis=1, keepdims=True)
    whole = v + ratio * v2
    off = np.max(np.abs(np.stack([whole - np.mean(whole, axis=0), pace - along * way])))
    walk = WANDERS
    if record.fine:
        walk = ALIKE * ROUNDING * np.sqrt(len(v)) * float(np.max(np.abs([q, q2])) / np.min(length))
    if not (ratio > 0 and off <= walk * np.max(np.abs([v, v2]))):
        return None
    size = np.abs(way)

    def summed(one: Reals, other: Reals) -> Floats:
        return np.asarray(np.sum(size * (np.abs(one) + np.abs(other)), axis=1, keepdims=True), np.float64)

    return replace(
        record, q=length, v=along, parts=(summed(q, q2), summed(v, v2)), mass=None, momenta=False,
        q_quantum=summed(record.q_quantum[:, one], record.q_quantum[:, other]),
        v_quantum=summed(record.v_quantum[:, one], record.v_quantum[:, other]),
    )  # fmt: skip


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
