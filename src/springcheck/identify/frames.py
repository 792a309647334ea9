"""Runs of bad frames next to one map, as a table: what has happened there, in a sentence."""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.identify.catalogue import distinct, titles
from springcheck.identify.compare import Freedom, compare
from springcheck.identify.measure import Map, measure
from springcheck.identify.record import Record
from springcheck.identify.result import Explanation

FOLLOWING: tuple[tuple[int, int, str], ...] = (
    (1, 0, "The motion{of} stands still for a step: it is repeated at frame {at}"),
    (1, 2, "The motion is one{of}, but frame {at} is missing"),
    *((1, n, f"The motion is one{{of}}, but {n - 1} frames are missing from frame {{at}} on")
      for n in range(3, 9)),
    (2, 2, "The motion is one{of}, but frame {at} is wrong"),
    (3, 1, "The motion is one{of}, but frames {at} and {last} have changed places"),
)  # fmt: skip
"""Bad pairs in a row, the power of the map over them, what has happened."""

OF_A_MAP, FEWEST_OF_A_MAP = 64.0, 8
"""Largest residual of a map's pairs, in roundings, and fewest pairs that show one."""

MOST_SHARE = 0.06
"""Largest share of pairs that may be bad."""


def whose(record: Record, m: Map) -> str:
    """ " of " and the titles of the schemes of one map; "" where none is known."""
    free = Freedom(jitter=record.jitter)
    joints = compare([m], free, distinct("plain"), range(1, 5))
    joints = joints or compare([m], free, distinct("friction"), range(1, 2))
    return f" of {titles(x.row.scheme for x in joints)}" if joints else ""


def bad_frames(record: Record, m: Map, j: int) -> Explanation | None:
    """A few bad pairs next to one map."""
    kept, found = _good_pairs(record, m, j)
    off, n = np.max(np.abs(found.left), 1) / m.base, len(m.unit)
    bad = np.flatnonzero(~kept)
    if not len(bad) or len(bad) > max(3, MOST_SHARE * n) or np.count_nonzero(kept) < 8:
        return None
    rest, least = float(np.max(off[kept])), float(np.min(off[bad]))
    if least < 2 * rest or (rest > 100 and float(np.median(off[bad])) < 1e3 * rest):
        return None
    size = np.sqrt(np.sum(found.z[:-1].astype(float) ** 2, 1))
    usual = float(np.median(size))
    # of a motion that dies down or grows what is bad is the rounding of the small or of the large frames
    small = float(np.max(size[bad])) < min(2 * float(np.min(size[kept])), usual / 10)
    if small or (len(bad) > 1 and np.min(size[bad]) > np.max(size[kept]) / 2 > 5 * usual):
        return None
    runs = np.split(bad, np.flatnonzero(np.diff(bad) > 1) + 1)
    return _said(record, found, m.base, runs, rest)


def changed(record: Record, m: Map, j: int) -> Explanation | None:
    """One map up to a frame, and another from there on."""
    n = len(m.unit)
    pairs, part = np.arange(n), n // 3
    if not record.fine or part < FEWEST_OF_A_MAP:
        return None
    for kept, way in ((pairs < part, 0), (pairs >= n - part, -1)):
        found = measure(record, j, kept)
        bad = np.flatnonzero(np.max(np.abs(found.left), 1) / m.base > OF_A_MAP)
        rest = pairs >= bad[0] if len(bad) and not way else pairs <= bad[-1] if len(bad) else kept
        if np.any(kept & rest) or np.count_nonzero(rest) < FEWEST_OF_A_MAP or len(bad) < len(pairs[rest]) / 2:
            continue
        other = measure(record, j, rest)
        if np.max((np.max(np.abs(other.left), 1) / m.base)[rest]) <= OF_A_MAP:
            first, then = (found, other) if not way else (other, found)
            at = int(bad[0]) if not way else int(bad[-1]) + 1
            cause = f"The motion is one{whose(record, first)} up to frame {at}, and another"
            cause += f"{whose(record, then)} from there on"
            return Explanation(cause, "look at what changes there: scheme, step or force", local=True)
    return None


def _good_pairs(record: Record, m: Map, j: int) -> tuple[Any, Map]:
    """The pairs (f - 1,) that one map explains, and that map."""
    n = len(m.unit)
    kept, found, most = np.ones(n, bool), m, max(3, MOST_SHARE * n)
    for _ in range(10):
        off = np.max(np.abs(found.left), 1) / m.base
        now = off <= max(8 * float(np.median(off[kept])), 8.0 if record.fine else 6.0)
        if np.array_equal(now, kept):
            break
        if np.count_nonzero(~now) > most:
            # the worst alone, in turn
            now = off <= np.sort(off)[-max(3, int(MOST_SHARE * n))]
        kept = now
        found = measure(record, j, kept)
    return kept, found


def _said(record: Record, found: Map, base: Any, runs: list[Any], rest: float) -> Explanation:
    """The sentence for the first run of bad pairs."""
    of = whose(record, found) if rest < 100 else ""
    run, z, b = runs[0], found.z, found.b
    first, last = int(run[0]), int(run[-1])
    others = ", ".join(str(x[0] + 1) for x in runs[1:5])
    more = f", and at {len(runs) - 1} more frames: {others}" if len(runs) > 1 else ""
    if first == 0:
        begins = f"The motion is one{of}, but not from frame 0 to 1"
        if last:
            begins = f"The first frames, up to {last + 1}, follow another map than those after them"
            begins += f",{of}" if of else ""
        return Explanation(
            f"{begins}: a wrong start, a first frame that is recorded otherwise, or a scheme with memory, "
            f"whose force is that of the step before, or that begins with steps of its own{more}",
            "look at how the first steps are made",
            local=True,
        )
    where = "look at what happened there"
    missing = float(np.max(np.abs(z[last + 1] - b @ z[last])))
    for pairs, power, text in FOLLOWING:
        ahead = np.linalg.matrix_power(b.astype(float), power) @ z[first].astype(float)
        gap = np.max(np.abs(z[first + min(pairs, 2)].astype(float) - ahead))
        if len(run) == pairs and gap <= max(1e-3 * missing, 10 * rest * float(base[first])):
            return Explanation(text.format(of=of, at=first + 1, last=last) + more, where, local=True)
    if len(run) > 1:
        cause = f"The motion is one{of}, but not from frame {first} to frame {last + 1}{more}"
        return Explanation(cause, where, local=True)
    back = np.linalg.solve(b.astype(float), found.left[first])
    ways = (back, found.left[first])
    kick = next((x for x in ways if abs(x[0]) < 1e-2 * abs(x[1])), None)
    if kick is not None:
        size = float(kick[1] * found.size[1] / record.interval)
        kicked = f"but for one kick of {size:+.3g} of the velocity at frame {first + 1}"
        return Explanation(f"The motion is one{of}, {kicked}{more}", where, local=True)
    jump = float(np.max(np.abs(back)))
    cause = (
        f"The motion{of} jumps by {jump:.1e} of its size between frames {first} and {first + 1}, as after "
    )
    return Explanation(f"{cause}a restart{more}", where, local=True)
