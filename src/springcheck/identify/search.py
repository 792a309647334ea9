"""The search: which hypotheses are tried in turn, and which of them the states do not exclude."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from springcheck.identify.compare import nearest
from springcheck.identify.evidence import Measured
from springcheck.identify.families import FAMILIES, HELD, Family
from springcheck.identify.fit import Map
from springcheck.identify.guesses import roots_of
from springcheck.identify.hypothesis import (
    EXCLUDED,
    FEW,
    MANY,
    STRIDES,
    Joint,
    Match,
    Terms,
    distinct,
    likely,
)
from springcheck.identify.maps import unit
from springcheck.identify.record import ROUNDING, Record
from springcheck.physics.arrays import Floats

BIAS = 3.0
"""Residuals that a coarse arithmetic may bias an entry by.  Cutting off has a mean of half a unit in the
last place and a deviation of 0.29; the rest of the factor is for roundings that repeat with the motion."""

SINGLE = 2.0**-24
"""Unit roundoff of single precision."""

COARSE = 2.0**-46
"""Residual above which it is no double-precision rounding: 64 units in the last place."""

POOR = 8.0
"""Chi-squared of three degrees of freedom that chance exceeds once in 20."""

ONE_MORE = 4.0
"""Decrease of chi-squared by one more unknown that chance exceeds once in 20."""

PLAIN = 30.0
"""Residuals by which the exact flow must miss where a scheme is named in spite of coarse numbers."""

SAME_MAP = 1e-12
"""Distance of the entries of two steps that are the same, in double precision."""


@cache
def coincident(name: str) -> tuple[str, ...]:
    """Damped families that have the map of this scheme without friction, on springs of another stiffness."""
    wanted = np.asarray(unit(FAMILIES[name], np.array([0.3, 0.7, 1.1]), np.zeros(3)), np.float64)
    if not np.all(np.log(np.abs(np.linalg.det(wanted))) < -1e-9):
        return ()
    every = distinct(damped=True)
    which, root, _, g = roots_of(every, wanted, SAME_MAP)
    good = {(i, j) for i, j, x in zip(which.tolist(), root.tolist(), g.tolist(), strict=True) if x > 1e-6}
    return tuple(f.name for i, f in enumerate(every) if all((i, j) in good for j in range(3)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """Tolerance beside the numbers' own uncertainty, and the strides looked at, in turn."""

    damped: bool = False
    rounding: float = ROUNDING
    bias: float = 0.0
    strides: tuple[range, ...] = (FEW,)

    @property
    def families(self) -> tuple[Family, ...]:
        return (*distinct(damped=True), HELD) if self.damped else distinct(damped=False)


def find(seen: Measured) -> tuple[list[Joint], Measured]:
    """All families that the states do not exclude, the plainest first, and on the terms that allow for them.

    What is plainer comes first, and ends the search where it fits.
    """
    fine, stride = seen.record.fine, seen.stride
    first = (range(stride, stride + 1),) if stride is not None and stride > 0 else ()
    for rooms in _plan(seen):
        accepted: list[Joint] = []
        for room in rooms:
            terms = [replace(what, rounding=room.rounding, bias=room.bias) for what in seen.terms]
            wide = replace(seen, terms=terms)
            for strides in (*first, *room.strides):
                fitting = wide.compare(room.families, strides)
                if fitting:
                    accepted += fitting
                    if strides is FEW and (MANY in room.strides or not room.bias):
                        accepted += _further(wide, fitting, room)
                    if not (fine or room.damped):
                        accepted += _rivals(wide, fitting, many=strides is MANY)
                    break
        if accepted:
            return likely(accepted), wide
    return [], seen


def _plan(seen: Measured) -> list[list[Room]]:
    """Order of the search: tolerances, the plainest first; what stands together is equally plain.

    Without friction first, and with it where nothing fits.  Coefficients are rounded in double precision,
    unless the states show that the arithmetic was coarser, or are too few to show that it was not; text
    does not show it, so there single precision is as plain as friction.  A bias of the size of what single
    steps leave over comes last: what is one orbit, rounded once, has none.  Coarse numbers make room for
    other schemes' few steps, so there many are tried before a wider room; with a bias many hide at once, so
    that none could be named.
    """
    record, whole = seen.record, all(found.whole for found in seen.maps)
    residual = max(float(np.max(found.residual)) for found in seen.maps)
    biased = [BIAS] if residual > COARSE and not whole else []
    if record.fine:
        rooms = [[Room(damped=d, bias=bias)] for d in (False, True) for bias in (0.0, *biased)]
        return [*rooms, [Room(strides=(MANY,))]]
    near = (FEW, MANY)
    double, double_damped, single, single_damped = (
        Room(damped=damped, rounding=rounding, strides=near)
        for rounding in (ROUNDING, SINGLE)
        for damped in (False, True)
    )
    coarse = residual > 2.0**-40 and not record.deep
    out: list[list[Room]] = []
    if whole or not coarse:
        out += [[double], [double_damped, single] if record.text and coarse else [double_damped]]
    if coarse:
        out += [[single], [single_damped]]
    return out + [
        [Room(damped=damped, bias=bias, strides=near)] for bias in biased for damped in (False, True)
    ]


def _further(seen: Measured, accepted: list[Joint], room: Room) -> list[Joint]:
    """Further hypotheses that the states do not exclude, beside those accepted of few steps to a frame.

    More of them may fit as well: the error of a step falls with their number, and where the exact flow
    fits, so does any scheme from some number on.  In double precision that is looked at only where few
    steps leave a choice.  Friction that is hardly needed may still be there.
    """
    out: list[Joint] = []
    open_ended = len(accepted) > 1 or any(x.scheme == "exact" or x.stride == STRIDES[0] for x in accepted)
    if open_ended or not (seen.record.fine or room.damped):
        out += seen.compare(room.families, MANY)
    if not room.damped and min(x.chi2 for x in accepted) > EXCLUDED:
        out += seen.compare(distinct(damped=True), FEW)
    return out


def _rivals(seen: Measured, fitting: list[Joint], *, many: bool) -> list[Joint]:
    """Rival hypotheses in coarse files: a force held over substeps is nearly as many steps, and friction
    may be what steps lose.  What has a fitting scheme's map at one friction must fit better."""
    losing = many or not any(x.keeps_area and x.chi2 < POOR for x in fitting)
    others = distinct(damped=True) if losing else ()
    same = {name: x.chi2 for x in fitting for name in coincident(x.family)}
    found = seen.compare((*others, HELD), FEW)
    return [x for x in found if x.chi2 < same.get(x.family, math.inf) - ONE_MORE]


def visible(found: Map, terms: Terms, *, damped: bool) -> bool:
    """Whether the error of a scheme's step stands far above what the numbers leave over.

    An adaptive solver misses the exact flow by as much as its steps scatter, and then many schemes with
    many small steps fit within that; a coarse arithmetic does not bring a map nearer to the exact flow.
    """
    asked = "visible", terms, damped
    if asked not in found.found:
        flow = FAMILIES["exact, damped" if damped else "exact"]
        near = nearest([found], [replace(terms, bias=1.0)], (flow,), range(1, 2))
        found.found[asked] = all(m.chi2 > PLAIN**2 for m in near)
    return bool(found.found[asked])


def difference(found: Map, part: Match) -> tuple[float, ...]:
    """Measured less predicted entries on (q, v T)."""
    off = found.entries.reshape(4) - np.array(part.predicted, dtype=np.longdouble)
    ratio = float(found.size[0] / found.size[1])
    return tuple(float(x) * y for x, y in zip(off, (1, ratio, 1 / ratio, 1), strict=True))


def terms_of(record: Record, j: int, stated: Floats | None) -> Terms:
    """On what terms the map of oscillator j of a record is compared."""
    log_stiffness = None
    if record.momenta and stated is not None and stated[j] > 0:
        log_stiffness = math.log(stated[j] * float(record.interval) ** 2)
    # in a coarse file a step or a mass may be in single precision as well
    jitter = math.hypot(record.jitter, 0.0 if record.deep else SINGLE)
    return Terms(mass_unknown=record.momenta, jitter=jitter, log_stiffness=log_stiffness)


def determinants(maps: list[Map], stride: int) -> tuple[tuple[float, ...], float]:
    """Determinants of one step of each map, and the largest |det - 1| of a map between frames."""
    between = [float(x.entries[0, 0] * x.entries[1, 1] - x.entries[0, 1] * x.entries[1, 0]) for x in maps]
    each = tuple(math.copysign(abs(d) ** (1 / stride), d) for d in between)
    return each, max(abs(d - 1) for d in between)
