"""Mistakes in a record as a table: what may have happened, undone, and the sentence if that explains all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from springcheck.identify.record import Record
from springcheck.identify.result import Explanation

FALLS = 12.0
"""Factor by which a residual has to fall for its cause to be seen."""

MOST = 12
"""Most coordinates whose columns are compared."""

SORT = "sort the columns, or the particles by their number, in every frame"


def unsorted(record: Record) -> Explanation | None:
    """Velocities in other columns than the positions, in every frame."""
    each = np.array(record.moving[:MOST])
    if len(each) < 2:
        return None
    way = np.diff(record.q[:, each], axis=0).astype(float)
    mean = ((record.v[1:, each] + record.v[:-1, each]) / 2 * record.interval).astype(float)
    off = np.sum(way**2, 0)[:, None] + np.sum(mean**2, 0) - 2 * way.T @ mean
    of = np.argmin(off, 1)
    others = np.flatnonzero((of != np.arange(len(each))) & (FALLS * np.min(off, 1) < np.diag(off)))
    if not len(others) or len(set(of.tolist())) < len(of):
        return None
    which = ", ".join(f"{each[i]} in column {each[of[i]]}" for i in others)
    cause = "The velocities stand in other columns than the positions, in every frame: those of coordinate "
    return Explanation(cause + which, "sort the columns of the velocities", local=True)


def turned(record: Record, moving: list[int]) -> Explanation | None:
    """Velocities of the wrong sign."""
    way = np.diff(record.q[:, moving], axis=0).astype(float)
    mean = ((record.v[1:, moving] + record.v[:-1, moving]) / 2 * record.interval).astype(float)
    away = np.sum((way + mean) ** 2, 0) < 0.09 * np.sum(way**2, 0)
    against = [j for j, x in zip(moving, away, strict=True) if x]
    if not against:
        return None
    whose = "all coordinates" if against == moving else f"coordinate {', '.join(map(str, against))}"
    if against == moving and record.interval < 0:
        cause = "The motion runs forwards while its times fall: each step is |h|, not h"
        return Explanation(cause, "look for abs(dt), or turn the velocities round", local=True)
    cause = f"The velocities of {whose} have the wrong sign: positions move against them"
    return Explanation(cause, "look at the sign of the velocities, and of the step", local=True)


Repaired = Iterator[tuple[Record, Explanation]]


def _exchanged(record: Record, j: int, clean: bool) -> Repaired:
    """Positions and velocities, or momenta, in each other's columns."""
    mass = 1.0 if record.mass is None else record.mass[None]
    for what, scale in (("velocities", 1.0), ("momenta", mass)) if clean else ():
        other = replace(
            record, q=record.v * scale, v=record.q / scale, dq=record.dv * scale, dv=record.dq / scale
        )
        if not _moves_along(other, j):
            continue
        yield other, Explanation(f"Positions and {what} are exchanged", "look at the order of the columns")


def _moves_along(record: Record, j: int) -> bool:
    """Whether positions move by about as much as velocities say."""
    way = np.diff(record.q[:, j]).astype(float)
    mean = ((record.v[1:, j] + record.v[:-1, j]) / 2 * record.interval).astype(float)
    return float(np.sum((way - mean) ** 2)) < 0.25 * float(np.sum(way**2))


def _wrapped(record: Record, j: int, clean: bool) -> Repaired:
    """Positions that are wrapped into a box."""
    mean = (record.v[1:, j] + record.v[:-1, j]) / 2 * record.interval
    way = (np.diff(record.q[:, j]) - mean).astype(float)
    box = float(np.max(np.abs(way)))
    times = np.rint(way / max(box, 1e-300))
    if clean or not box or np.any(4 * np.abs(way - times * box) > box):
        return
    at = np.flatnonzero(times)
    if len(at) == 2 and at[1] == at[0] + 1 and times[at[0]] == -times[at[1]]:
        # there and back at once: one frame is wrong
        return
    size = float(np.median(np.abs(way[times != 0])))
    for length in dict.fromkeys([*(float(f"{size:.{digits}g}") for digits in (1, 2, 3)), size]):
        q = record.q.copy()
        q[1:, j] -= length * np.cumsum(times)
        begins = int(at[0]) + 1
        where = f"wrapped into a box of about {length:.4g}, first at frame {begins}"
        cause = f"The positions of coordinate {j} are {where}"
        yield replace(record, q=q), Explanation(cause, "write positions that are not wrapped")


def _columns(record: Record, j: int, clean: bool) -> Repaired:
    """Velocities, or whole particles, of two coordinates in each other's column, in some frames or all."""
    for pair in (x for x in combinations(record.moving[:MOST], 2) if j in x):
        two = list(pair)
        for what, of_q in (("velocities", False), ("particles", True)):
            q, v, at = _sorted(record, two, of_q=of_q)
            if not at:
                continue
            right_q, right_v = record.q.copy(), record.v.copy()
            right_q[:, two], right_v[:, two] = q, v
            where = f"in {len(at)} frames, first in frame {at[0]}"
            if len(at) == len(q):
                where = "in every frame"
            elif len(at) == len(q) - at[0]:
                where = f"from frame {at[0]} on"
            cause = f"The {what} of coordinates {pair[0]} and {pair[1]} have changed places {where}"
            yield replace(record, q=right_q, v=right_v), Explanation(cause, SORT, local=True)


def _sorted(record: Record, two: list[int], *, of_q: bool) -> tuple[Any, Any, list[int]]:
    """Positions and velocities (f, 2) with places changed where that makes the motion smoother, and where."""
    q, v, at, pace = record.q[:, two].copy(), record.v[:, two].copy(), [], record.interval
    for i in range(len(q)):
        x, u = (q[i, ::-1] if of_q else q[i]), v[i, ::-1]
        if i == 0:
            way = q[1] - q[0]
            swap = not of_q and np.sum((way - pace * u) ** 2) < np.sum((way - pace * v[0]) ** 2)
        else:
            y, w = q[i - 1], v[i - 1]
            off = [
                np.sum((a - y - pace * (b + w) / 2) ** 2) + np.sum((pace * (b - w)) ** 2)
                for a, b in ((x, u), (q[i], v[i]))
            ]
            swap = off[0] < off[1]
        if swap:
            q[i], v[i] = x.copy(), u.copy()
            at.append(i)
    return q, v, at


EXCHANGED = _exchanged
REPAIRS: tuple[Callable[[Record, int, bool], Repaired], ...] = (_wrapped, _columns)
