"""Hypotheses of what made states, as data: a family of maps, its steps to a frame, and how far it misses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from springcheck.identify.families import DAMPED, FAMILIES, G_ROUNDING, UNDAMPED, Family, endless, substeps
from springcheck.identify.maps import unit
from springcheck.identify.record import ROUNDING
from springcheck.physics.arrays import Reals
from springcheck.schemes import SCHEMES

ERRORS = 5.0
"""Standard errors that chance does not exceed: 6e-7."""

CHANCE = 1e-7
"""Probability with which a right hypothesis may be refused, or a wrong one pass: five standard errors."""

SOLVED = 1e-4
"""Chi-squared of unknowns that solve as many equations: Gauss-Newton's rest."""

EXCLUDED = ERRORS**2
"""Excess of chi-squared over the best hypothesis' that excludes another."""

SURE = 6.0
"""Standard errors by which a number differs from another for certain, and within which it may be off."""

STRIDES = 12, 100
"""Steps to a frame looked at: up to so many, and where nothing fits, or a choice is left, up to those."""

FEW, MANY = range(1, STRIDES[0] + 1), range(STRIDES[0] + 1, STRIDES[1] + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """Conditions of a comparison: what is known of a map beside its entries, and how finely the arithmetic
    resolves coefficients."""

    mass_unknown: bool = False
    jitter: float = 0.0
    """Relative uncertainty of the interval, and of a step or a mass in single precision."""
    log_stiffness: float | None = None
    """log(k T**2) where the stiffness is known and the mass is not: the mass follows from a then."""
    rounding: float = ROUNDING
    bias: float = 0.0
    """Bias allowed of the entries, in units of the residual and whatever the number of pairs: coarse
    forces that cut off are biased, and repeat from turn to turn."""
    scales: tuple[float, ...] = ()
    """Log of the scale of velocities at each stride from 0 on, where it is known beforehand."""
    growing: bool = False
    """Whether friction of the wrong sign is looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """A family with `stride` steps to a frame against one map; a = (h w)**2, g its second unknown."""

    family: str
    stride: int
    turns: int
    """Whole turns of the phase between two frames, which the frames do not show."""
    a: float
    a_error: float
    g: float
    g_error: float
    log_mass: float
    mass_error: float
    chi2: float
    freedom: int
    predicted: tuple[np.longdouble, ...]
    """The four entries, in the frame of the map."""

    @property
    def scheme(self) -> str:
        return FAMILIES[self.family].scheme

    @property
    def a_room(self) -> float:
        """Relative difference from another a within which it may be that one."""
        return SURE * self.a_error / abs(self.a)

    @property
    def friction(self) -> float:
        """g where it is friction, 0 where it is not."""
        return 0.0 if FAMILIES[self.family].held else self.g


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
        """Sort key of parsimony: no unseen turns, the exact flow or the smallest stride, then the list."""
        turns = max(part.turns for part in self.parts)
        return turns, self.stride, -1 if self.scheme == "exact" else list(FAMILIES).index(self.family)

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
        return self.scheme + ("" if self.stride == 1 else f", {self.stride} steps a frame")


@cache
def most(freedom: int) -> float:
    """Largest chi-squared that is accepted; where nothing is left to predict, that of a solution."""
    # SciPy is imported where it is asked: half of what importing this package takes
    from scipy.special import chdtri

    return float(chdtri(freedom, CHANCE)) if freedom else SOLVED


@cache
def _samples(family: Family, g: tuple[float, ...]) -> Reals:
    return unit(family, np.array([0.3, 1.1, 2.9], np.longdouble), np.array(g, np.longdouble))


def same_map(one: Family, other: Family, g: tuple[float, ...] = (0, 0, 0)) -> bool:
    """Whether two families have one map at three steps, with these frictions."""
    return bool(np.max(np.abs(_samples(one, g) - _samples(other, g))) < 1e-15)


@cache
def distinct(*, damped: bool) -> tuple[Family, ...]:
    """One family of every map.  The implicit midpoint rule speaks for the trapezoidal rule, and so on."""
    out: list[Family] = []
    for family in DAMPED if damped else UNDAMPED:
        if not damped and SCHEMES[family.scheme].has("friction"):
            continue
        if not any(same_map(family, other, (0.1, 0.2, 0.5)) for other in out):
            out.append(family)
    return tuple(out)


@cache
def aliases(name: str) -> tuple[str, ...]:
    """Schemes whose map on a spring is the same, entry for entry, without friction and with it."""
    # the scheme itself where only its steps are known
    damped = {x: FAMILIES.get(f"{x}, damped", FAMILIES[x]) for x in (name, *_still(name))}
    return tuple(x for x in _still(name) if same_map(damped[x], damped[name], (0, 0.2, 0.5)))


@cache
def _still(name: str) -> tuple[str, ...]:
    """Schemes whose map is the same where there is no friction."""
    return tuple(f.scheme for f in UNDAMPED if f.scheme != name and same_map(f, FAMILIES[name]))


def frictionless(name: str) -> tuple[str, ...]:
    """Schemes with a friction of their own whose map is this one's where there is none."""
    return tuple(x for x in _still(name) if SCHEMES[x].has("friction"))


def likely(joints: list[Joint]) -> list[Joint]:
    """Hypotheses within five standard errors of the best, each once, the plainest first."""
    if not joints:
        return []
    best = min(x.chi2 for x in joints)
    each = {(x.family, x.stride): x for x in sorted(joints, key=lambda x: -x.chi2)}
    return sorted((x for x in each.values() if x.chi2 <= best + EXCLUDED), key=lambda x: x.plainness)
