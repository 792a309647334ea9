"""Misplaced numbers: positions wrapped into a box, particles or velocities in another order, velocities of
the wrong sign.

Each is undone and the map fitted anew: it is the cause where that reduces the residuals.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from springcheck.identify.evidence import FALLS, FIXED, LEFT_BY_ROUNDING, Evidence
from springcheck.identify.fit import fit
from springcheck.identify.noise import least_squares
from springcheck.identify.record import Record
from springcheck.identify.result import Explanation
from springcheck.physics.arrays import Extended, Floats

LEAPS = 4.0
"""Ratio of the length of a box to what the velocities of a step leave of its way, beside a box."""

AGAINST = 0.3
"""Relative difference up to which displacements are opposite to the velocities."""

MOST_COMPARED = 12
"""Most coordinates that are compared in pairs."""

SORT = "sort the particles by their number before they are written, positions and velocities alike"

Repair = tuple[Record, str, str]
"""A repaired record, what was wrong, and what to do."""


def misplaced(e: Evidence) -> Explanation | None:
    """The cause, if one map fits once numbers are moved to another column or row."""
    # an exchange of some frames takes the largest parts of noise away, and leaves noise in all of them
    least = max(FIXED, LEFT_BY_ROUNDING * float(np.median(e.weight * e.unit)))
    for look in (_wrapped, _exchanged):
        for record, cause, remedy in look(e.record, e.j):
            after, usual = _left(record, e.j)
            if after * FALLS < e.size and (look is _wrapped or after <= least or usual * FALLS < after):
                return Explanation(cause, remedy, after / e.size, local=True)
    return None


def _left(record: Record, j: int) -> tuple[float, float]:
    """Residual of a coordinate's map, relative to the states: root mean square, and median of all pairs."""
    if j not in record.moving:
        return 0.0, 0.0
    found = fit(record, j)
    usual = np.median(np.max(np.abs(found.residuals()), axis=1) * found.weight)
    return float(np.max(found.residual)), float(usual)


def _ways(record: Record, columns: list[int]) -> tuple[Floats, Floats]:
    """Displacements between frames (f - 1, n), and those by the mean of their velocities."""
    mean = (record.v[1:, columns] + record.v[:-1, columns]) / 2 * record.interval
    return np.diff(record.q[:, columns], axis=0).astype(np.float64), mean.astype(np.float64)


def _wrapped(record: Record, j: int) -> Iterator[Repair]:
    """Undo positions wrapped into a box: jumps of one length."""
    (moved,), (mean,) = (x.T for x in _ways(record, [j]))
    # beside the mean of both velocities a step moves by its error, and at the edge of a box by its length
    way = moved - mean
    box = float(np.max(np.abs(way)))
    times = np.rint(way / max(box, 1e-300))
    if np.any(LEAPS * np.abs(way - times * box) > box):
        return
    # of positions with so many boxes added there is one map, and it tells the box better than a leap does
    often = np.concatenate([[0.0], np.cumsum(times)])
    columns = [record.q[:-1, j], record.v[:-1, j], often[:-1], often[1:], np.ones(len(way), np.longdouble)]
    box = float(least_squares(np.stack(columns, axis=1), record.q[1:, [j]])[3, 0])
    if not box > np.ptp(record.q[:, j]) - np.max(np.abs(moved - times * box)):
        return
    unwrapped = record.q.copy()
    unwrapped[:, j] -= box * often
    first = int(np.flatnonzero(times)[0]) + 1
    yield (
        replace(record, q=unwrapped),
        f"The positions of coordinate {j} are wrapped into a box of {box:.6g}, first at frame {first}",
        "write unwrapped positions, or unwrap them by the length of the box",
    )


def unsorted(record: Record) -> Explanation | None:
    """Velocities in the wrong columns of every frame, if one map fits each once they are sorted."""
    each = np.array(record.moving)
    if not 1 < len(each) <= MOST_COMPARED:
        return None
    way, mean = _ways(record, each.tolist())
    off = np.sum(way**2, axis=0)[:, None] + np.sum(mean**2, axis=0) - 2 * way.T @ mean
    of = each[np.argmin(off, axis=1)]
    others = np.flatnonzero((of != each) & (FALLS * np.min(off, axis=1) < np.diag(off)))
    put = replace(record, v=record.v.copy())
    put.v[:, each] = record.v[:, of]
    sure = others.size and len(set(of)) == len(of) and others.size == np.count_nonzero(of != each)
    if not sure or any(
        _left(put, j)[0] > max(_left(record, j)[0] / FALLS, FIXED) for j in each[others].tolist()
    ):
        return None
    where = ", ".join(f"of coordinate {each[i]} in column {of[i]}" for i in others)
    cause = f"The velocities stand in other columns than the positions, in every frame: those {where}"
    return Explanation(cause, SORT, local=True)


def turned(record: Record, moving: list[int]) -> Explanation | None:
    """Velocities of the wrong sign: displacements are opposite to them, in frames close enough to show it."""
    way, mean = _ways(record, moving)
    turn = np.sum((way + mean) ** 2, axis=0) < AGAINST**2 * np.sum(way**2, axis=0)
    against = [j for j, turns in zip(moving, turn, strict=True) if turns]
    if not against:
        return None
    whose = "all coordinates" if against == moving else f"coordinate {', '.join(map(str, against))}"
    cause = f"The velocities of {whose} have the wrong sign: positions move against them"
    remedy = "change the sign of the velocities, or write the frames in the order of time"
    if against == moving:
        # of m w = 1 the momentum in the place of the position moves so as well
        cause += ", or positions and velocities are exchanged"
    if against == moving and record.interval < 0:
        cause = "The motion runs forwards while its times fall: each step is |h|, not h"
        remedy = "look for abs(dt); if the step is right, all velocities have the wrong sign"
    return Explanation(cause, remedy, local=True)


def _exchanged(record: Record, j: int) -> Iterator[Repair]:
    """Undo an exchange of the numbers of two coordinates, in some frames or in all."""
    n = record.q.shape[1]
    if not 1 < n <= MOST_COMPARED:
        return
    h = record.interval
    for pair in (x for x in combinations(range(n), 2) if j in x):
        two = list(pair)
        for what, of_q, of_v in (
            ("particles", True, True), ("velocities", False, True), ("positions", True, False),
        ):  # fmt: skip
            q, v, at = record.q[:, two].copy(), record.v[:, two].copy(), []
            begin = what == "velocities" and _nearer(q, v, h)
            for i in range(len(q)):
                x, u = q[i, ::-1] if of_q else q[i], v[i, ::-1] if of_v else v[i]
                last = q[i - 1], v[i - 1]
                if begin if i == 0 else _off(*last, x, u, h) < _off(*last, q[i], v[i], h):
                    q[i], v[i] = x, u
                    at.append(i)
            if not at:
                continue
            right = replace(record, q=record.q.copy(), v=record.v.copy())
            right.q[:, two], right.v[:, two] = q, v
            yield (
                right,
                f"The {what} of coordinates {pair[0]} and {pair[1]} have changed places {_where(at, len(q))}",
                SORT,
            )


def _off(q: Extended, v: Extended, x: Extended, u: Extended, h: np.longdouble) -> float:
    """Squared distance of a frame from the one before, advanced by the mean of the velocities."""
    return float(np.sum((x - q - h * (u + v) / 2) ** 2) + np.sum((h * (u - v)) ** 2))


def _nearer(q: Extended, v: Extended, h: np.longdouble) -> bool:
    """Whether the first velocities of two coordinates are exchanged."""
    way = q[1] - q[0]
    return float(np.sum((way - h * v[0, ::-1]) ** 2)) < float(np.sum((way - h * v[0]) ** 2))


def _where(frames: list[int], of: int) -> str:
    if len(frames) == of - frames[0]:
        return f"from frame {frames[0]} on"
    return f"in {len(frames)} of {of} frames: {', '.join(map(str, frames[:4]))}{', ...' * (len(frames) > 4)}"
