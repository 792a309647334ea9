"""The search: every family and stride against the maps of all oscillators together."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from springcheck.identify.families import (
    DAMPED,
    FAMILIES,
    G_ROUNDING,
    HELD,
    UNDAMPED,
    Family,
    endless,
    substeps,
)
from springcheck.identify.fit import ROUNDING, Map
from springcheck.identify.maps import table, unit
from springcheck.identify.match import Match, match
from springcheck.identify.record import Record
from springcheck.identify.solve import solved
from springcheck.identify.starts import Terms
from springcheck.physics.arrays import Floats, Reals
from springcheck.schemes import SCHEMES

BIAS = 3.0
"""Residuals that a coarse arithmetic may bias an entry by.  Cutting off has a mean of half a unit in the
last place and a deviation of 0.29; the rest of the factor is for roundings that repeat with the motion."""

SINGLE = 2.0**-24
"""Unit roundoff of single precision."""

SINGLE_ROOM = 8 * SINGLE
"""Relative difference of stiffnesses that a step, a mass and a stiffness in single precision may make."""

COARSE = 2.0**-46
"""Residual above which it is no double-precision rounding: 64 units in the last place."""

EXCLUDED = 25.0
"""By which chi-squared exceeds that of the best where a scheme is excluded: five standard errors."""

POOR = 8.0
"""Chi-squared of three degrees of freedom that chance exceeds once in 20."""

ONE_MORE = 4.0
"""By which one unknown more lowers chi-squared by chance once in 20."""

PLAIN = 30.0
"""Residuals by which the exact flow must miss where a scheme is named in spite of coarse numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """One family and stride for all oscillators together."""

    family: str
    stride: int
    parts: tuple[Match, ...]

    @property
    def scheme(self) -> str:
        return FAMILIES[self.family].scheme

    @property
    def accepted(self) -> bool:
        return all(part.accepted for part in self.parts)

    @property
    def chi2(self) -> float:
        return sum(part.chi2 for part in self.parts)

    @property
    def damped(self) -> bool:
        return FAMILIES[self.family].damped and not FAMILIES[self.family].held

    @property
    def keeps_area(self) -> bool:
        """Whether all maps predicted have a determinant of 1."""
        entries = np.array([part.predicted for part in self.parts])
        return bool(np.all(np.abs(entries[:, 0] * entries[:, 3] - entries[:, 1] * entries[:, 2] - 1) < 1e-12))

    @property
    def plainness(self) -> tuple[int, int, int]:
        """What parsimony sorts by: no unseen turns, the exact flow or the smallest stride, then the list."""
        return (
            max(part.turns for part in self.parts),
            self.stride,
            -1 if self.scheme == "exact" else list(FAMILIES).index(self.family),
        )

    @property
    def substeps(self) -> tuple[range, bool]:
        """Numbers of substeps that a force may be held over, and whether they kick first."""
        found = [substeps(part.g, part.g_error + G_ROUNDING) for part in self.parts]
        if len({first for _, first in found}) > 1:
            return range(0), True
        return range(max(n.start for n, _ in found), min(n.stop for n, _ in found)), found[0][1]

    @property
    def endless(self) -> bool:
        """Whether the force may be held over no end of substeps."""
        return all(endless(part.g, part.g_error + G_ROUNDING) for part in self.parts)

    def __str__(self) -> str:
        steps = "" if self.stride == 1 else f", {self.stride} steps a frame"
        return self.scheme + steps


def same_map(one: Family, other: Family, g: tuple[float, ...] = (0, 0, 0)) -> bool:
    """Whether two families have one map at three steps, with these frictions."""
    return bool(np.max(np.abs(_samples(one, g) - _samples(other, g))) < 1e-15)


@cache
def _samples(family: Family, g: tuple[float, ...]) -> Reals:
    return unit(family, np.array([0.3, 1.1, 2.9], np.longdouble), np.array(g, np.longdouble))


@cache
def aliases(name: str) -> tuple[str, ...]:
    """Schemes whose map on a spring is the same, entry for entry, without friction and with it."""
    own = FAMILIES[name], FAMILIES[f"{name}, damped"]
    return tuple(
        f.scheme
        for f in UNDAMPED
        if f.scheme != name
        and same_map(f, own[0], (0, 0, 0))
        and same_map(FAMILIES[f"{f.scheme}, damped"], own[1], (0, 0.2, 0.5))
    )


@cache
def frictionless(name: str) -> tuple[str, ...]:
    """Schemes with a friction of their own whose map is this one's where there is none."""
    return tuple(
        f.scheme
        for f in UNDAMPED
        if f.scheme != name
        and any(kind == "friction" for kind, _ in SCHEMES[f.scheme].stages)
        and same_map(f, FAMILIES[name], (0, 0, 0))
    )


@cache
def distinct(*, damped: bool) -> tuple[Family, ...]:
    """One family of every map.  The implicit midpoint rule speaks for the trapezoidal rule, and so on."""
    out: list[Family] = []
    for family in DAMPED if damped else UNDAMPED:
        if not damped and any(kind == "friction" for kind, _ in family.stages):
            continue
        if not any(same_map(family, other, (0.1, 0.2, 0.5)) for other in out):
            out.append(family)
    return tuple(out)


@cache
def coincident(name: str) -> tuple[str, ...]:
    """Damped families that have the map of this scheme without friction, on springs of another stiffness."""
    a = np.array([0.3, 0.7, 1.1])
    wanted = np.asarray(unit(FAMILIES[name], a, np.zeros(3)), np.float64)
    g = -np.log(np.abs(np.linalg.det(wanted)))
    if not np.all(g > 1e-9):
        return ()
    every = table(distinct(damped=True))
    n = len(every.families)
    _, rates, off = solved(
        every, np.repeat(np.arange(n), 3), np.tile(a + (g / 2) ** 2, n), np.tile(g, n),
        np.tile(wanted, (n, 1, 1)), free_scale=False, turns=40,
    )  # fmt: skip
    same = np.all(((off < 1e-12) & (rates > 1e-6)).reshape(n, 3), axis=1)
    return tuple(family.name for family, known in zip(every.families, same, strict=True) if known)


def search(
    maps: list[Map],
    terms: list[Terms],
    strides: range,
    families: tuple[Family, ...] = (),
    *,
    far: bool = False,
) -> list[Joint]:
    """Every family and stride against every oscillator; what fails one is not tried on the others.

    Those that are accepted, or with `far` all."""
    families = families or distinct(damped=False)
    asked = "search", families, tuple(terms), strides, far
    if len(maps) > 1 or asked not in maps[0].found:
        maps[0].found[asked] = _searched(maps, terms, strides, families, far=far)
    return list(maps[0].found[asked])


def _searched(
    maps: list[Map], terms: list[Terms], strides: range, families: tuple[Family, ...], *, far: bool
) -> list[Joint]:
    first = match(families, maps[:1], terms[:1], strides, far=far)[0]
    passing = {key: m for key, m in first.items() if m.accepted} or (first if far else {})
    rest: list[dict[tuple[str, int], Match]] = []
    if passing and len(maps) > 1:
        left = tuple(f for f in families if any(f.name == name for name, _ in passing))
        found = [stride for _, stride in passing]
        within = range(min(found), max(found) + 1)
        rest = match(left, maps[1:], terms[1:], within, keys=set(passing), far=far)
    return [
        Joint(family=key[0], stride=key[1], parts=(m, *(x[key] for x in rest)))
        for key, m in passing.items()
        if all(key in x for x in rest)
    ]


STRIDES = 12, 100
"""Strides looked at: first up to this many steps per frame, and where nothing fits, up to so many."""

FEW, MANY = range(1, STRIDES[0] + 1), range(STRIDES[0] + 1, STRIDES[1] + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """What is allowed for beside the numbers' own uncertainty, and the strides looked at, in turn."""

    damped: bool = False
    rounding: float = ROUNDING
    bias: float = 0.0
    strides: tuple[range, ...] = (FEW,)

    @property
    def families(self) -> tuple[Family, ...]:
        return (*distinct(damped=True), HELD) if self.damped else distinct(damped=False)


def find(
    record: Record, maps: list[Map], base: list[Terms], stride: int | None
) -> tuple[list[Joint], list[Terms]]:
    """All families that the states do not exclude, the plainest first, and what was allowed for.

    What is plainer comes first, and ends the search where it fits.
    """
    residual = max(float(np.max(found.residual)) for found in maps)
    whole = all(found.whole for found in maps)
    first = (range(stride, stride + 1),) if stride is not None and stride > 0 else ()
    for rooms in _plan(fine=record.fine, text=record.text, whole=whole, residual=residual):
        accepted: list[Joint] = []
        for room in rooms:
            terms = [replace(what, rounding=room.rounding, bias=room.bias) for what in base]
            for strides in (*first, *room.strides):
                fitting = [x for x in search(maps, terms, strides, room.families) if x.accepted]
                if fitting:
                    accepted += fitting
                    if strides is FEW and (MANY in room.strides or not room.bias):
                        accepted += _further(maps, terms, fitting, room, coarse=not record.fine)
                    if not (record.fine or room.damped):
                        accepted += _rivals(maps, terms, fitting, many=strides is MANY)
                    break
        if accepted:
            return _likely(accepted), terms
    return [], base


def _plan(*, fine: bool, text: bool, whole: bool, residual: float) -> list[list[Room]]:
    """What is allowed for, the plainest first; what stands together is equally plain.

    Without friction first, and with it where nothing fits.  Coefficients are rounded in double precision,
    unless the states show that the arithmetic was coarser, or are too few to show that it was not; text
    does not show it, so there single precision is as plain as friction.  A bias of the size of what single
    steps leave over comes last: what is one orbit, rounded once, has none.  Coarse numbers make room for
    other schemes' few steps, so there many are tried before a wider room; with a bias many hide at once, so
    that none could be named.
    """
    biased = [BIAS] if residual > COARSE and not whole else []
    if fine:
        rooms = [[Room(damped=d, bias=bias)] for d in (False, True) for bias in (0.0, *biased)]
        return [*rooms, [Room(strides=(MANY,))]]
    near = (FEW, MANY)
    double, double_damped, single, single_damped = (
        Room(damped=damped, rounding=rounding, strides=near)
        for rounding in (ROUNDING, SINGLE)
        for damped in (False, True)
    )
    coarse = residual > 2.0**-40
    out: list[list[Room]] = []
    if whole or not coarse:
        out += [[double], [double_damped, single] if text and coarse else [double_damped]]
    if coarse:
        out += [[single], [single_damped]]
    return out + [
        [Room(damped=damped, bias=bias, strides=near)] for bias in biased for damped in (False, True)
    ]


def _further(
    maps: list[Map], terms: list[Terms], accepted: list[Joint], room: Room, *, coarse: bool
) -> list[Joint]:
    """What the states do not exclude either, beside what was accepted of few steps to a frame.

    More of them may fit as well: the error of a step falls with their number, and where the exact flow
    fits, so does any scheme from some number on.  In double precision that is looked at only where few
    steps leave a choice.  Friction that is hardly needed may still be there.
    """
    out: list[Joint] = []
    open_ended = len(accepted) > 1 or any(x.scheme == "exact" or x.stride == STRIDES[0] for x in accepted)
    if open_ended or (coarse and not room.damped):
        out += [x for x in search(maps, terms, MANY, room.families) if x.accepted]
    if not room.damped and min(x.chi2 for x in accepted) > EXCLUDED:
        out += [x for x in search(maps, terms, FEW, distinct(damped=True)) if x.accepted]
    return out


def _rivals(maps: list[Map], terms: list[Terms], fitting: list[Joint], *, many: bool) -> list[Joint]:
    """What coarse files do not exclude either: a force held over substeps is nearly as many steps, and
    friction may be what steps lose.  What has a fitting scheme's map at one friction must fit better."""
    losing = many or not any(x.keeps_area and x.chi2 < POOR for x in fitting)
    others = distinct(damped=True) if losing else ()
    same = {name: x.chi2 for x in fitting for name in coincident(x.family)}
    found = [x for x in search(maps, terms, FEW, (*others, HELD)) if x.accepted]
    return [x for x in found if x.chi2 < same.get(x.family, math.inf) - ONE_MORE]


def _likely(accepted: list[Joint]) -> list[Joint]:
    """Those of which the best is not five standard errors better, each once, the plainest first."""
    best = min(x.chi2 for x in accepted)
    each = {(x.family, x.stride): x for x in sorted(accepted, key=lambda x: -x.chi2)}
    return sorted((x for x in each.values() if x.chi2 <= best + EXCLUDED), key=lambda x: x.plainness)


def visible(found: Map, terms: Terms, *, damped: bool) -> bool:
    """Whether the error of a scheme's step stands far above what the numbers leave over.

    An adaptive solver misses the exact flow by as much as its steps scatter, and then many schemes with
    many small steps fit within that; a coarse arithmetic does not bring a map nearer to the exact flow.
    """
    asked = "visible", terms, damped
    if asked not in found.found:
        flow = FAMILIES["exact, damped" if damped else "exact"]
        near = match((flow,), [found], [replace(terms, bias=1.0)], range(1, 2), far=True)[0]
        found.found[asked] = all(m.chi2 > PLAIN**2 for m in near.values())
    return bool(found.found[asked])


def numbers(
    record: Record, moving: list[int], chosen: Joint, law: str = ""
) -> tuple[tuple[float, ...], tuple[float, ...] | None, tuple[float, ...]]:
    """Frequency, stiffness and friction rate of each oscillator, the friction being of this law."""
    h = float(record.interval) / chosen.stride
    family = FAMILIES[chosen.family]
    law = law or (family.laws[0] if family.laws else "")
    omega = tuple(math.sqrt(m.a) / abs(h) if m.a > 0 else math.nan for m in chosen.parts)
    friction = tuple(
        family.rate(law, m.friction) / h if family.stages else m.friction / h for m in chosen.parts
    )
    if any(kind in ("explicit", "implicit", "centred", "remembered") for kind, _ in family.stages):
        friction = tuple(m.friction / h for m in chosen.parts)
    stiffness: tuple[float, ...] | None = None
    if record.mass is not None:
        stiffness = tuple(
            float(record.mass[j]) * m.a / h**2 for j, m in zip(moving, chosen.parts, strict=True)
        )
    elif record.momenta:
        stiffness = tuple(math.exp(m.log_mass) * m.a / h**2 for m in chosen.parts)
    return omega, stiffness, friction


def disagreements(
    record: Record, moving: list[int], joint: Joint, stated: Floats, quantum: float = 0.0
) -> list[str]:
    """Where the stiffness of the states is not the stated one, beyond six standard errors and rounding.

    Forces cut off at multiples of `quantum` bias it as well, by that share of the mean force.  A
    coarse file does not show whether h, m, h k or h/m were rounded to single precision.
    """
    _, stiffness, _ = numbers(record, moving, joint)
    path = FAMILIES[joint.family].path
    out = []
    for j, part, k in zip(moving, joint.parts, stiffness or (), strict=False):
        error = 6 * part.a_error / abs(part.a) + 2 * record.jitter + 4 * path * ROUNDING
        error += 0.0 if record.fine else SINGLE_ROOM
        # a step or a mass in single precision moves the stiffness that is worked out with the stated one
        error += 0.0 if record.momenta else 3 * abs(part.log_mass)
        if quantum:
            error += 2 * quantum * (1 + 1 / (abs(k) * float(np.sqrt(np.mean(record.q[:, j] ** 2)))))
        off = k / float(stated[j]) - 1 if stated[j] else math.inf
        if not abs(off) <= error:
            out.append(
                f"the stated stiffness {stated[j]:.9g} does not fit: the states show {k:.9g} "
                f"(relative difference {off:+.2e}, known to {error:.0e})"
            )
    return out


def difference(found: Map, part: Match) -> tuple[float, ...]:
    """Measured less predicted entries on (q, v T)."""
    off = found.entries.reshape(4) - np.array(part.predicted, dtype=np.longdouble)
    ratio = float(found.size[0] / found.size[1])
    return tuple(float(x) * y for x, y in zip(off, (1, ratio, 1 / ratio, 1), strict=True))
