"""Several coordinates of one motion: two particles bound to each other, velocities turned by a field."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from itertools import combinations

import numpy as np

from springcheck.identify.evidence import LEFT_BY_ROUNDING
from springcheck.identify.fit import CERTAIN
from springcheck.identify.hypothesis import SURE
from springcheck.identify.misplaced import MOST_COMPARED, unsorted
from springcheck.identify.record import Record
from springcheck.identify.result import ONLY_TURNS, Explanation, Identification, nothing
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Floats, Reals

OF_A_BOND = (
    "the two halves of the coordinates are two particles bound to each other, at rest as a whole: the "
    "stated stiffness is taken for that of the bond"
)


def of_a_bond(record: Record, moving: list[int], stated: Floats) -> Floats | None:
    """Stiffness of each coordinate (n,) where the stated one is that of a bond between two particles at rest
    as a whole: k m_j/mu, mu the reduced mass; None where the states are no pair's.  Such momenta of one half
    of the coordinates are opposite to those of the other half in every frame."""
    half = len(moving) // 2
    if record.mass is None or len(moving) % 2 or not half:
        return None
    one, other = moving[:half], moving[half:]
    p = (record.v * record.mass).astype(np.float64)
    unit = (record.v_quantum * record.mass)[:, one] + (record.v_quantum * record.mass)[:, other]
    size = np.max(np.abs(p[:, moving]))
    # either particle's velocity adds its roundings up by itself
    room = unit + LEFT_BY_ROUNDING * ROUNDING * np.sqrt(len(p)) * size
    if np.any(np.abs(p[:, one] + p[:, other]) > room):
        return None
    masses = [np.unique(record.mass[x]) for x in (one, other)]
    if len(masses[0]) > 1 or len(masses[1]) > 1:
        return None
    return np.asarray(stated * record.mass * (1 / masses[0][0] + 1 / masses[1][0]))


def at_rest(record: Record, found: Identification) -> Identification:
    """Note the stiffness of the bond of two particles in space whose centre of mass rests: that of each
    coordinate is k m/mu, mu the reduced mass."""
    n, moving = record.q.shape[1], np.array(record.moving)
    each = of_a_bond(record, record.moving, np.ones(n))
    if n % 3 or found.scheme is None or found.stiffness is None or each is None:
        return found
    # the coordinates of two points, and not two of one
    points, axes = divmod(moving.reshape(2, -1), 3)
    if np.any(axes[0] != axes[1]) or np.any(points[0] != points[0, 0]) or np.any(points[1] == points[0, 0]):
        return found
    stiffness = float(np.median(np.array(found.stiffness) / each[moving]))
    bond = f"{BOUND}, at rest as a whole: their bond has the stiffness {stiffness:.9g}"
    return found.noting(bond)


WANDERS = 1e-3
"""Relative drift of the direction and of the centre of mass of two particles in single precision: a random
walk of roundings of 1e-7 over 1e8 steps."""

BOUND = "two particles bound to each other"


def of_a_pair(record: Record, found: Identification) -> Identification:
    """Note that the distance of two particles was judged, and their bond's stiffness if masses are known."""
    note = f"{BOUND}, which swing along their line: their distance is judged"
    if record.mass is not None and found.scheme and found.omega:
        reduced = 1 / (1 / record.mass[record.moving[0]] + 1 / record.mass[record.moving[-1]])
        note += f"; their bond has the stiffness {reduced * found.omega[0] ** 2:.9g}"
    return found.noting(note)


def distance(record: Record) -> Record | None:
    """Distance of two particles that oscillate along their line, in any direction, while their centre of mass
    rests or moves at constant velocity, as a record; None for other states.

    In single precision the centre of mass and the direction walk at random.
    """
    moving = record.moving
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
        # forces that are cut off, in fixed point, add up from frame to frame
        walk = LEFT_BY_ROUNDING * ROUNDING * len(v) * float(np.max(np.abs([q, q2])) / np.min(length))
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


def of_rotation(record: Record, found: Identification) -> Identification:
    """Add a rotation of the velocity as a cause, or as an alternative to what one coordinate alone shows."""
    if found.explanations and (cause := (not found.fits and unsorted(record)) or of_plane(record)):
        # numbers of one coordinate are none of what moves both
        return nothing((cause,), determinant=(math.nan,) * len(found.determinant), notes=found.notes)
    if (pair := _turning(record)) is None:
        return found
    i, j, factor, error = pair
    grows = abs(abs(factor) - 1) > LEFT_BY_ROUNDING * ROUNDING + error
    how = f"turns and grows by {abs(factor) - 1:+.3g} in each frame" if grows else "only turns"
    return found.doubted(
        f"{ONLY_TURNS}{i} and {j} {how}: a rotation, as of a charge in a magnetic field, or a "
        f"circular orbit on springs: {found.statement}",
        "what would tell: the stiffness, or an orbit that is no circle",
    )


def _turning(record: Record) -> tuple[int, int, complex, float] | None:
    """Two coordinates whose complex velocity v_i + i v_j is multiplied by one complex factor in every frame,
    that factor and its error: a charge in a magnetic field, or a circular orbit on an isotropic spring."""
    v = record.v.astype(np.float64)
    for i, j in combinations(range(min(v.shape[1], MOST_COMPARED)), 2):
        w = v[:, i] + 1j * v[:, j]
        size = np.abs(w)
        if not np.all(size > 0):
            continue
        ratios = w[1:] / w[:-1]
        factor, error = complex(np.mean(ratios)), SURE * float(np.std(ratios)) / math.sqrt(len(ratios))
        room = LEFT_BY_ROUNDING * ROUNDING * (size[1:] + size[:-1]) + 2 * np.max(
            record.v_quantum[1:, [i, j]], axis=1
        )
        turns = abs(np.angle(factor)) * len(w) > 1
        if turns and np.all(np.abs(w[1:] - factor * w[:-1]) <= room):
            return i, j, factor, error
    return None


LEFT = 1e-9
"""Largest residual of a complex map, relative to the states: roundings of a long motion."""

KEPT = 1e-4
"""Distance of the determinant from 1 up to which its phase is given in full."""


def of_plane(record: Record) -> Explanation | None:
    """The pair of coordinates that a rotation couples: a magnetic field across their plane, or a rotating
    frame.

    With z = x + i y, on isotropic springs, a frame takes (z, z') to A (z, z') with a complex A, which is real
    without a field.  The phase of its determinant is the angle by which it turns a velocity.
    """
    pairs = [_of_two(record, *two) for two in combinations(record.moving[:MOST_COMPARED], 2)]
    return max(pairs, key=lambda x: x[0], default=(0.0, None))[1]


def _of_two(record: Record, i: int, j: int) -> tuple[float, Explanation | None]:
    """Squares that maps of two coordinates alone leave over those that one complex map leaves, 0 where that
    is no map, and the rotation that it shows."""
    (x, y), (u, v) = (a[:, [i, j]].astype(np.float64).T for a in (record.q, record.v * record.interval))
    z = np.stack([x + 1j * y, u + 1j * v, np.ones(len(x))], axis=1)
    if not np.all(size := np.max(np.abs(z), axis=0)):
        return 0.0, None
    # where the motion grows or decays, each frame is weighted by its size
    each = np.max(np.abs(z[:-1, :2]) / size[:2], axis=1, keepdims=True)
    weight = 1 / each if np.all(each > 0) else 1.0
    scaled = weight * z[:-1] / size
    ends = (weight * z[1:] / size)[:, :2]
    rows = np.linalg.lstsq(scaled, ends)[0]
    left = np.abs(ends - scaled @ rows)
    # half a unit of both coordinates, at either end of a step
    unit = np.hypot(*(record.quanta(k) for k in (i, j))) * (0.0 if record.fine else 0.5) / size[:2]
    if np.any(left > LEFT + weight * (unit[1:] + unit[:-1] @ np.abs(rows[:2]))):
        return 0.0, None
    # maps of each coordinate alone have as many numbers, and hold on springs that are not alike as well
    apart = (scaled.real, ends.real), (np.where([False, False, True], scaled, -1j * scaled).real, ends.imag)
    parted = sum(float(np.sum((to - x @ np.linalg.lstsq(x, to)[0]) ** 2)) for x, to in apart)
    gain = parted / max(float(np.sum(left**2)), np.finfo(np.float64).tiny)
    if not gain > math.exp(CERTAIN / (2 * len(left))):
        return 0.0, None
    spread = np.sqrt(np.diag(np.linalg.pinv(np.real(scaled.conj().T @ scaled), hermitian=True))[:2])
    size = size[:2]
    scale = size[:, None] / size
    entries = np.asarray(rows[:2].T * scale, np.complex128)
    error = SURE * np.sqrt(np.mean(left**2, axis=0))[:, None] * spread * scale
    det = complex(np.linalg.det(entries))
    angle, open_to = cmath.phase(det), float(np.sum(np.abs(entries[::-1, ::-1]) * error))
    if abs(angle) < LEFT + open_to:
        # the velocities are other numbers than these positions', and nothing turns them
        return gain, None
    of = f" of coordinates {i} and {j}" if record.q.shape[1] > 2 else ""
    turned = _known(angle, open_to) if abs(abs(det) - 1) < KEPT else f"about {angle:.2g}"
    cause = (
        f"The velocity{of} turns by {turned} in each frame beside what springs alike along both axes do: a "
        "magnetic field across the plane, or Coriolis' force in a turning frame"
    )
    # to few digits any central force that is nearly linear turns its ellipse at a constant rate
    cause += "" if record.fine else ", or a central force that is not quite linear"
    remedy = "such a scene is not part of springcheck"
    return gain, Explanation(cause, remedy, float(np.max(left)), local=True)


def _known(x: float, error: float) -> str:
    """A number to the digits that its error leaves, nine at most."""
    return f"{x:.{max(1, min(9, math.floor(math.log10(abs(x) / max(error, 1e-300)))))}g}" if x else "0"
