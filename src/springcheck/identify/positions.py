"""Identification from positions alone, which show trace and determinant of a step, and no more."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from springcheck.errors import IdentificationError
from springcheck.identify.catalogue import FRICTION, PLAIN, titles
from springcheck.identify.compare import Freedom, Joint, Match, compare
from springcheck.identify.record import Record
from springcheck.identify.result import Explanation, Identification, nothing
from springcheck.identify.rows import Row
from springcheck.identify.say import answer, of_another_friction
from springcheck.identify.search import FEW, explained
from springcheck.identify.seeing import see
from springcheck.identify.unknown import kind_of_map

FEWEST = 8
"""Fewest frames of positions alone."""

ALONE = (
    "positions alone show a frequency and how areas change, and no velocities: velocity Verlet, leapfrog, "
    "semi-implicit Euler and position Verlet have the same positions"
)


@cache
def _shown(row: Row, steps: int) -> Row:
    """The row of this many steps whose velocities are the last displacements over the interval."""
    return replace(row, view="earlier", inner=row, steps=steps)


def identify_positions(
    record: Record, stiffness: Any, friction: float | None, step: float | None
) -> Identification:
    """The schemes that may have made these positions.  Raises IdentificationError where they show none."""
    if len(record.q) < FEWEST:
        raise IdentificationError(
            f"too few frames of positions alone: {len(record.q)}; give {FEWEST}, or velocities"
        )
    dq = np.maximum(record.dq, 2.0**-52 * np.abs(record.q)).astype(np.float64)
    pace = abs(float(record.interval))
    made = replace(
        record, q=record.q[1:], v=np.diff(record.q, axis=0) / record.interval, dq=dq[1:], mixed=True,
        dv=(dq[1:] + dq[:-1]) / pace, names=(record.names[0], record.names[0]), momenta=False,
    )  # fmt: skip
    seen = see(made, stiffness, friction, step)
    free = Freedom(jitter=record.jitter)
    strides = FEW if seen.stride is None or seen.stride < 1 else range(seen.stride, seen.stride + 1)
    joints: list[Joint] = []
    others: list[Joint] = []
    for rows, steps in (*((PLAIN, s) for s in strides), *((FRICTION, s) for s in strides)):
        if joints or (rows is FRICTION and friction == 0):
            break
        found = compare(seen.maps, free, [_shown(row, steps) for row in rows], range(1, 2))
        good = [
            replace(x, stride=steps, parts=tuple(_of_a_step(y, steps) for y in x.parts))
            for x in found
            if seen.off(x) <= 0 and explained(seen, x)
        ]
        joints = [x for x in good if seen.rubs(x) <= 0]
        others = others or good
    if not joints and others and seen.stiffness is not None:
        return of_another_friction(seen, others)
    if not joints:
        return _none(seen.maps[0].excess, kind_of_map(seen.maps[0]), len(seen.maps))
    names = list(dict.fromkeys(x.row.scheme for x in joints))
    said = answer(seen, joints)
    if len(names) == 1:
        return replace(said, statement=f"{titles(names)}, by positions alone").noting(ALONE)
    statement = f"Positions alone: they are those of {titles(names)}, or a scheme that is not known here"
    return replace(said, statement=statement, verdict="not told apart", scheme=None).noting(
        ALONE, "what would tell more: velocities, or the mass, the stiffness and the friction"
    )


def _of_a_step(m: Match, steps: int) -> Match:
    return replace(m, stride=steps, a=m.a / steps**2, g=m.g / steps)


def _none(excess: float, kind: str, n: int) -> Identification:
    cause = "The positions are not those of one linear scheme whose every step was recorded"
    if excess <= 4 and kind:
        cause = "One linear map explains the positions, and no known scheme of one step to a frame has it"
    return nothing([Explanation(cause, "give velocities, which show more")], n, notes=(ALONE,))
