"""Forces and steps that no linear map explains, as a table: a limit, a sine, no force, a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.identify.catalogue import capital, distinct, title
from springcheck.identify.compare import Freedom, compare, distance
from springcheck.identify.measure import Map, least_squares
from springcheck.identify.record import Record
from springcheck.identify.result import Explanation
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Extended
from springcheck.schemes import SCHEMES, Scheme, step

FEWEST_AT_LIMIT = 4
"""Frames that have to lie at one largest value for it to be a limit."""

FAR_TIMES, STILL = 3.0, 0.05
"""Ratio of the interval to the steps from which on the times are wrong, whatever the scheme, and the largest
change of a state from frame to frame."""

SOLVED = 1e-4
"""Largest error of an implicit step that is solved to a tolerance, relative to the state."""


def limited(record: Record, j: int) -> Explanation | None:
    """A velocity or a position that is clipped: several frames at one largest value, and none above."""
    for what, x, quantum in (
        ("velocity", record.v[:, j], record.dv),
        ("position", record.q[:, j], record.dq),
    ):
        size = np.abs(x).astype(float)
        most = float(np.max(size))
        room = 4 * ROUNDING * most + float(np.max(quantum[:, j])) / 2
        at = size >= most - room
        # the top of a smooth motion is one frame, or two
        turns = np.count_nonzero(np.diff(at.astype(int)) == 1) + 1
        n = np.count_nonzero(at)
        if most and FEWEST_AT_LIMIT <= n < len(x) / 2 and n >= 2 * turns:
            limit = float(f"{most:.12g}")
            return Explanation(
                f"The {what} is clipped at {limit:.9g}: it is never above that, and stays there in "
                f"{n} frames",
                "take the limit out, or judge the frames below it",
                local=True,
            )
    return None


def without_force(record: Record, j: int) -> Explanation | None:
    """A velocity that follows from itself alone, whatever the position."""
    v = record.v[:, j].astype(float)
    known = np.column_stack([v[:-1], np.ones(len(v) - 1)])
    left = v[1:] - known @ np.linalg.lstsq(known, v[1:], rcond=None)[0]
    room = 1e-12 * float(np.max(np.abs(v))) + 4 * float(np.max(record.dv[:, j]))
    if len(v) < 8 or np.max(np.abs(left)) > room or not np.ptp(v) > 16 * room:
        return None
    cause = "The velocity does not depend on the position: no force of a spring acts on it"
    return Explanation(cause, "look at where the force is added", local=True)


@dataclass(frozen=True, slots=True)
class Force:
    """A force of one unknown strength w2: its words, its shape, its slope."""

    words: str
    number: str
    shape: Callable[[Any], Any]
    slope: Callable[[Any], Any]


DEGREE = np.longdouble(np.pi) / 180
SINES = (
    Force("Pendulum (a force of sin q)", "g/l", np.sin, np.cos),
    Force("Pendulum of an angle in degrees", "g/l in degrees", lambda q: np.sin(q * DEGREE),
          lambda q: DEGREE * np.cos(q * DEGREE)),
)  # fmt: skip
ON_A_FORCE = tuple(
    s for s in SCHEMES.values() if s.has("one-step") and not (s.has("mixes") or s.has("friction"))
)


def _after(scheme: Scheme, force: Force, w2: Any, q: Extended, v: Extended, h: Any) -> Extended:
    """States (2, f - 1) a step after each frame."""
    one = np.ones(1, np.longdouble)
    ends = step(
        scheme, q[:, None], v[:, None], h=h, m=one, force=lambda x, p: -w2 * force.shape(x),
        stiffness=lambda x: (w2 * force.slope(x), False),
    )  # fmt: skip
    return np.stack([ends[0][:, 0], ends[1][:, 0] * h])


def sine(record: Record, j: int) -> Explanation | None:
    """A pendulum without a scene: every scheme's step with the force -w2 sin q, of one free number."""
    q, v, h = record.q[:, j], record.v[:, j], record.interval
    ends = np.stack([q[1:], v[1:] * h])
    size = np.max(np.abs(ends), axis=1)
    quantum = np.stack([record.dq[1:, j], record.dv[1:, j] * abs(float(h))])
    room = 4 * quantum * np.array([[record.coarse[0]], [record.coarse[1]]])
    room = room + (256 * ROUNDING * size)[:, None] + 2 * record.jitter * size[1]
    for force in SINES:
        shape = force.shape(q)
        pull = (shape[1:] + shape[:-1]) / 2
        if not np.any(pull):
            continue
        start = -np.sum(np.diff(v) / h * pull) / np.sum(pull * pull)
        every = {s.name: _strength(s, force, start, q, v, h, ends, room) for s in ON_A_FORCE}
        found = {name: w2 for name, w2 in every.items() if w2 is not None}
        if found:
            first, w2 = next(iter(found.items()))
            cause = f"{force.words}, {force.number} = {w2:.9g}: {title(first)} ({', '.join(found)})"
            return Explanation(f"{cause} explains every step", "judge it with --scene pendulum", local=True)
    return None


def _strength(
    scheme: Scheme, force: Force, w2: Any, q: Extended, v: Extended, h: Any, ends: Any, room: Any
) -> float | None:
    """The strength by which a scheme takes every step, to rounding; None where there is none."""
    with np.errstate(all="ignore"):
        for _ in range(6):
            here = _after(scheme, force, w2, q[:-1], v[:-1], h) - ends
            if np.all(np.abs(here) <= room):
                return float(w2)
            change = np.abs(w2) * np.longdouble(2.0) ** -20
            slope = (_after(scheme, force, w2 + change, q[:-1], v[:-1], h) - ends - here) / change
            way = np.sum(here * slope) / np.sum(slope * slope)
            if not np.isfinite(way):
                return None
            w2 = w2 - way
    return None


def solved(m: Map, jitter: float) -> Explanation | None:
    """An implicit scheme whose equation is solved to a tolerance: far nearer than any other scheme."""
    rows = (*distinct("plain"), *distinct("elsewhere"))
    near = compare([m], Freedom(jitter=jitter), rows, range(1, 2), far=True)
    off = sorted(((distance(m, x.parts[0]), x.row) for x in near), key=lambda x: x[0])
    if len(off) < 2 or len(off[0][1].under) == 1:
        return None
    size = max(off[0][0], m.size_left)
    if not (size < SOLVED and size < 0.01 * off[1][0]):
        return None
    cause = f"{capital(off[0][1].title)}, its equation solved to {size:.1e} of the state"
    return Explanation(cause, "iterate further, or give the solver a smaller tolerance", local=True)


def accumulates(record: Record, j: int) -> Explanation | None:
    """A force to which that of every step is added: v'' - 2 v' + v is a multiple of the position."""
    q, v = record.q[:, j].astype(float), record.v[:, j].astype(float)
    twice = np.diff(v, 2)
    room = 64 * ROUNDING * float(np.max(np.abs(v))) + 8 * float(np.max(record.dv[:, j]))
    for x in (q[1:-1], q[2:]):
        known = np.column_stack([x, np.ones(len(x))])
        numbers = np.linalg.lstsq(known, twice, rcond=None)[0]
        if np.max(np.abs(twice - known @ numbers)) <= room < abs(numbers[0]) * np.ptp(x) / 64:
            cause = "The forces add up: that of each step is added to the sum of those before, never cleared"
            return Explanation(cause, "set the forces to 0 before they are worked out", local=True)
    return None


def not_opposite(record: Record, each: list[int]) -> Explanation | None:
    """Forces between two coordinates that are not equal and opposite, where one map of all is the motion."""
    n, pace = len(each), record.interval
    if n < 2 or record.mass is None or record.mixed or len(record.q) < 4 * n + 4:
        return None
    z = np.column_stack([record.q[:, each], record.v[:, each] * pace])
    known = np.column_stack([z[:-1], np.ones(len(z) - 1)])
    x, inverse = least_squares(known, z[1:])
    left = float(np.max(np.abs(z[1:] - known @ x)))
    if left > 1e-9 * float(np.max(np.abs(z))):
        return None
    force = (x[:n, n:].T * record.mass[each][:, None]).astype(float)
    error = 1e-6 * float(np.max(np.abs(force))) + 8 * left * float(np.sqrt(np.max(np.abs(inverse))))
    off = np.triu(np.abs(force - force.T))
    a, b = np.unravel_index(int(np.argmax(off)), off.shape)
    if off[a, b] <= error:
        return None
    how = "has the wrong sign" if abs(force[a, b] + force[b, a]) <= error else "is not equal to it"
    cause = f"The forces between coordinates {each[a]} and {each[b]} are not opposite: the reaction {how}"
    return Explanation(cause, "give the two particles forces that are equal and opposite", local=True)


def other_times(record: Record, j: int, m: Map, stiffness: float | None) -> Explanation | None:
    """Steps that are far from the interval, where they vary and no map is that of a scheme."""
    if stiffness is None or record.mass is None or not stiffness > 0:
        return None
    pull = stiffness / float(record.mass[j]) * float(record.interval) ** 2
    (q, drift), (kick, v) = m.unscaled
    ways = (1 / drift if drift else -1.0, -pull / kick if kick else -1.0)
    factor = float(np.sqrt(max(ways[0] * ways[1], 0)))
    if abs(q - 1) > STILL or abs(v - 1) > STILL:
        return None
    if min(ways) <= 0 or not 0.8 < ways[0] / ways[1] < 1.25 or 1 / FAR_TIMES < factor < FAR_TIMES:
        return None
    cause = f"times are {factor:.3g} times what was stepped: the steps taken are about "
    cause += f"{abs(float(record.interval)) / factor:.3g}, and not all alike"
    return Explanation(cause, "write the time of the solver with each state", local=True)
