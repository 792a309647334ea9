"""Identification of arrays: every stage in its order."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.identify.bath import of_bath
from springcheck.identify.clock import UnevenError
from springcheck.identify.explain import drift, explain
from springcheck.identify.measure import measure
from springcheck.identify.positions import identify_positions
from springcheck.identify.record import Record, read, times_of
from springcheck.identify.repairs import turned, unsorted
from springcheck.identify.result import Identification, nothing
from springcheck.identify.say import either_way, said, unnamed
from springcheck.identify.search import Seen, search
from springcheck.identify.seeing import see
from springcheck.identify.shapes import not_opposite
from springcheck.identify.uneven import of_uneven

CLEAN, FEWEST_LATE, HALF_A_STEP_AGO = 64.0, 12, "half a step ago"
"""Excess of a map that is rounding, fewest frames that show a late start, and the law that has it."""


def identify_arrays(
    t: ArrayLike, q: ArrayLike, p: ArrayLike | None = None, *, v: ArrayLike | None = None,
    mass: ArrayLike | None = None, stiffness: ArrayLike | None = None, friction: float | None = None,
    step: float | None = None, last: ArrayLike | None = None,
) -> Identification:  # fmt: skip
    """The scheme that made a trajectory of oscillators, from its states alone.

    t (f,) [T]; q (f, n) or (f,) [L]; p [M L/T] or v [L/T] or both, like q.  Where both are given the mass
    follows from them.  Coupled oscillators are replaced by their normal modes.  `mass` [M], `stiffness`
    [M/T2], `friction` c [M/T] and `step` [T] are stated values, which the states are tested against; `last`
    is the unit of the last decimal of velocities (n,) that were written in other units.  Raises
    IdentificationError where the states cannot show a map: too few, not finite, at rest, at uneven times, or
    not spanning the plane.
    """
    stated: dict[str, Any] = {"mass": mass, "stiffness": stiffness, "friction": friction, "step": step}
    try:
        return _at_even_times(t, q, p, v, last, **stated)
    except UnevenError:
        if found := of_uneven(t, q, p, v, mass, stiffness):
            return found
        raise


def _at_even_times(t: Any, q: Any, p: Any, v: Any, last: Any, **stated: Any) -> Identification:
    """Identify states one interval apart, forwards or backwards in time.  Raises IdentificationError."""
    step = stated["step"]
    if p is None and v is None:
        mass, *others = stated.values()
        return identify_positions(read(t, q, None, np.zeros(np.shape(q)), mass), *others)
    times = times_of(t)
    if times[-1] >= times[0]:
        return _of_states(t, q, p, v, last, **stated)
    # steps back in time, or frames that stand in reverse order
    reverse: list[Any] = [*(None if x is None else np.asarray(x)[::-1] for x in (t, q, p, v)), last]
    back = _of_states(t, q, p, v, last, **stated) if step is None or step < 0 else None
    turned_over = _of_states(*reverse, **stated) if step is None or step > 0 else None
    return either_way(back, turned_over)


def _of_states(t: Any, q: Any, p: Any, v: Any, last: Any, *, mass: Any, **stated: Any) -> Identification:
    """Identify states whose times rise: by a deterministic scheme, or in a bath."""
    units = None if last is None else np.asarray(last, np.float64)
    record = read(t, q, p, v, mass, units)
    try:
        found = of_record(record, **stated)
    except IdentificationError:
        if in_a_bath := of_bath(t, q, p, v, mass, **stated):
            return in_a_bath
        raise
    if found.candidates or any(x.local for x in found.explanations):
        return found
    return of_bath(t, q, p, v, mass, **stated) or found


def of_record(
    record: Record, stiffness: Any = None, friction: float | None = None, step: float | None = None,
    *, repairing: bool = True,
) -> Identification:  # fmt: skip
    """Identify a record: measure its maps, compare hypotheses, explain what is left."""
    first = unsorted(record) or (turned(record, record.moving) if len(record.moving) > 1 else None)
    if first:
        return nothing([first], max(len(record.moving), 1))
    seen = see(record, stiffness, friction, step)
    if any(m.drifts for m in seen.maps) and all(m.excess <= CLEAN for m in seen.maps):
        # without the constant a scheme may explain all
        maps = [
            measure(seen.record, j, most=1) if m.drifts else m
            for j, m in zip(seen.moving, seen.maps, strict=True)
        ]
        again = replace(seen, maps=maps)
        found, one = search(again)
        return said(again, found, one) if found and one else unnamed(seen, drift(seen))
    found, one = search(seen)
    if found and one:
        coupled = seen.record is not record and not any(x.row.damped for x, _ in found)
        if coupled and (unlike := not_opposite(record, record.moving, surely=True)):
            return unnamed(seen, unlike)
        return said(seen, found, one)

    if repairing and (late := _started_late(seen, record, stiffness, friction, step)):
        return late

    def again_of(other: Record, _: Seen) -> Identification:
        return of_record(other, stiffness, friction, step, repairing=False)

    return unnamed(seen, *explain(seen, again_of if repairing else None))


def _started_late(
    seen: Seen, record: Record, stiffness: Any, friction: float | None, step: float | None
) -> Identification | None:
    """The identification from frame 1 on, where friction of the velocity half a step ago begins with that of
    the first velocity; None of other motions."""
    kept = np.arange(len(record.q) - 1) > 0
    if len(record.q) < FEWEST_LATE:
        return None
    for j, m in zip(seen.moving, seen.maps, strict=True):
        if seen.record is not record or int(np.argmax(np.max(np.abs(m.left), 1) / m.base)) > 0:
            return None
        off = np.max(np.abs(measure(record, j, kept).left), 1) / m.base
        if np.max(off[1:]) > 64 or off[0] <= 64:
            return None
    later = replace(record, q=record.q[1:], v=record.v[1:], dq=record.dq[1:], dv=record.dv[1:])
    again = see(later, stiffness, friction, step)
    found, one = search(again)
    found = [x for x in found if HALF_A_STEP_AGO in x[0].row.law]
    return (
        said(again, found, one).noting("the first step has the friction of its first velocity")
        if found and one
        else None
    )
