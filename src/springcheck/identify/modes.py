"""The oscillators of a record: its coordinates, or where springs couple these its normal modes."""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.errors import IdentificationError
from springcheck.identify.measure import Map, least_squares, measure
from springcheck.identify.record import AT_REST, Record
from springcheck.identify.shapes import without_force
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Extended

SAME_MODE = 1e-5
"""Relative difference of eigenvalues below which any combination of two modes is one."""

NO_FORCE = "no force acts: every scheme moves it in a straight line"
NO_PLANE = (
    "the states do not span their plane (a standing state, half periods between frames, or an arc shorter "
    "than the rounding): record more of the motion"
)


def straight(record: Record, j: int) -> bool:
    """Whether a coordinate moves at constant velocity, to rounding."""
    q, v = record.q[:, j], record.v[:, j]
    room = 64 * ROUNDING * np.max(np.abs(v)) + 2 * np.max(record.dv[:, j])
    if np.ptp(v) > room:
        return False
    way = np.arange(len(q)) * record.interval * np.mean(v)
    quantum = 2 * np.max(record.dq[:, j]) + 64 * ROUNDING * np.sqrt(len(q)) * np.max(np.abs(q))
    slack = np.abs(way[-1]) * (record.jitter + 64 * ROUNDING) + len(q) * abs(record.interval) * room
    return bool(np.max(np.abs(q - q[0] - way)) <= quantum + slack)


def falls(record: Record, j: int) -> bool:
    """Whether a coordinate moves at constant acceleration, to the rounding of its numbers and times."""
    n = np.arange(len(record.q), dtype=np.longdouble) / len(record.q)
    rounding = 64 * ROUNDING * np.sqrt(len(n)) + record.jitter
    for x, quantum, degree in ((record.q[:, j], record.dq, 2), (record.v[:, j], record.dv, 1)):
        powers = np.vander(n, degree + 1)
        numbers = least_squares(powers, x[:, None])[0][:, 0]
        room = rounding * np.max(np.abs(x)) + 2 * np.max(quantum[:, j])
        if np.max(np.abs(x - powers @ numbers)) > room or not np.abs(numbers[0]) > room:
            return False
    return len(n) > 8


def oscillators(record: Record) -> tuple[Record, list[int], list[Map], list[str]]:
    """The record of what can be judged, indices, maps, and notes.  Raises IdentificationError."""
    n, every = record.q.shape[1], record.moving
    if not every:
        raise IdentificationError(AT_REST)
    notes = [f"{n - len(every)} of {n} oscillators are at rest and left out"] * (len(every) < n)
    moving = [j for j in every if not straight(record, j)]
    if not moving:
        raise IdentificationError(NO_FORCE)
    pulled = [j for j in moving if falls(record, j)]
    moving = [j for j in moving if j not in pulled]
    if not moving:
        raise IdentificationError(
            f"only a constant force acts on oscillator {pulled[0]}; few schemes differ there: "
            "state the scene, or record a motion on a spring"
        )
    maps = [measure(record, j) for j in moving]
    if len(moving) > 1 and any(not x.spans or x.excess > 40 for x in maps):
        got = _modes(record, moving, maps)
        if got is not None:
            record, maps = got
            moving = list(range(len(maps)))
            notes.append(f"the coordinates are coupled: their {len(maps)} normal modes were judged instead")
    good = [i for i, x in enumerate(maps) if x.spans] or [i for i, x in enumerate(maps) if x.excess > 100]
    if not good:
        none = without_force(record, moving[0])
        raise IdentificationError(none.cause if none else _standing(record, moving[0]) or NO_PLANE)
    return record, [moving[i] for i in good], [maps[i] for i in good], notes


def _standing(record: Record, j: int) -> str:
    """Message for velocities that are constant or proportional to the positions, well above rounding."""
    q, v = (x[:, j].astype(float) - float(np.mean(x[:, j])) for x in (record.q, record.v))
    size = float(np.max(np.abs(q)))
    if size * 1e-9 < max(float(np.max(record.dq[:, j])), ROUNDING * float(np.max(np.abs(record.q[:, j])))):
        return ""
    whose, slope = f"the velocities of oscillator {j}", float(q @ v / (q @ q))
    if np.max(np.abs(v)) * abs(float(record.interval)) <= 1e-9 * size:
        return f"{whose} do not change while its positions do: look at what is written as velocity"
    if np.max(np.abs(v - slope * q)) > 1e-9 * abs(slope) * size:
        return ""
    return (
        f"{whose} are {slope:.6g} times its positions, but for a constant: one exponential, as of an "
        "overdamped or unstable motion, half periods between frames, or velocities made from positions; they "
        "show no scheme"
    )


def _modes(record: Record, each: list[int], maps: list[Map]) -> tuple[Record, list[Map]] | None:
    """The normal modes, where one map of all coordinates leaves far less than each one's own."""
    q, v = record.q[:, each], record.v[:, each] * record.interval
    off = (q - np.mean(q, 0)).astype(float)
    _, sizes, ways = np.linalg.svd(off, full_matrices=False)
    least = 64 * ROUNDING * len(q) * sizes[0] + np.sqrt(len(q)) * float(np.max(record.dq[:, each])) * any(
        record.coarse
    )
    parts = ways[sizes > least].astype(np.longdouble)
    if len(parts) == len(each):
        parts = np.eye(len(each), dtype=np.longdouble)
    n = len(parts)
    z = np.concatenate([q @ parts.T, v @ parts.T], 1)
    if len(z) < 2 * n + 8:
        return None
    z = z / np.repeat([np.max(np.std(z[:, :n], 0)), np.max(np.std(z[:, n:], 0))], n)
    w = 1 / np.maximum(np.max(np.abs(z), 1), 1e-30)
    w = np.minimum(w[1:], w[:-1])[:, None] if record.fine else np.ones((len(z) - 1, 1), np.longdouble)
    known = np.column_stack([z[:-1], np.ones(len(z) - 1)])
    x, _ = least_squares(known * w, z[1:] * w)
    rest = ((z[1:] - known @ x) * w).astype(float)
    left = float(np.sqrt(np.mean(rest**2)))
    single = max(float(np.sqrt(np.mean(m.left**2))) for m in maps)
    if left > single / (1e3 if record.fine else 12):
        return None
    block = x[:-1].T[n:, :n]
    values, vectors = np.linalg.eig(block.astype(float))
    if np.max(np.abs(vectors.imag)) > 1e-6 or np.linalg.cond(vectors.real) > 1e6:
        return None
    basis, spread = vectors.real.astype(np.longdouble), values.real
    gap = spread[None] - spread[:, None]
    far = np.abs(gap) > SAME_MODE * np.max(np.abs(spread))
    for _ in range(3):
        # eigenvectors of double precision, corrected by what they leave off the diagonal
        inside = inverse(basis) @ block @ basis
        basis = basis @ (np.eye(n) + np.where(far, inside / np.where(far, gap, 1), 0) * (1 - np.eye(n)))
    whole = record.of(each).along(inverse(basis) @ parts)
    free = [j for j in range(n) if j in whole.moving and not straight(whole, j)]
    good = [(j, m) for j, m in ((j, measure(whole, j)) for j in free) if m.spans]
    return (whole.of([j for j, _ in good]), [m for _, m in good]) if good else None


def inverse(x: Any) -> Extended:
    """Inverse in extended precision: that of double precision, refined by Newton's iteration."""
    out = np.linalg.inv(x.astype(float)).astype(np.longdouble)
    for _ in range(2):
        out = out @ (2 * np.eye(len(x)) - x @ out)
    return np.asarray(out)
