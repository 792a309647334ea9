"""Hypotheses as data: a family of one-step maps, steps to a frame, the fitted unknowns, chi-squared."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from springcheck.identify.families import DAMPED, FAMILIES, UNDAMPED, Family, substeps
from springcheck.identify.maps import unit
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Reals
from springcheck.schemes import SCHEMES

ERRORS = 5.0
"""Standard errors that chance exceeds with a probability of 6e-7."""

CHANCE = 1e-7
"""Probability of rejecting a right hypothesis, and of accepting a wrong one: five standard errors."""

SOLVED = 1e-4
"""Chi-squared that Gauss-Newton leaves where there are as many unknowns as equations."""

EXCLUDED = ERRORS**2
"""Excess of chi-squared over the best hypothesis from which another is excluded."""

SURE = 6.0
"""Standard errors from which two numbers differ significantly."""

STRIDES = 12, 100
"""Largest numbers of steps to a frame: at first, and where nothing or more than one scheme fits."""

FEW, MANY = range(1, STRIDES[0] + 1), range(STRIDES[0] + 1, STRIDES[1] + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """What a comparison takes as known beside the map: scale of the velocities, rounding of coefficients."""

    mass_unknown: bool = False
    """Whether the scale of the velocities is one more unknown, the log of the mass."""
    jitter: float = 0.0
    """Relative uncertainty of the interval, and of a step or a mass that may be in single precision."""
    vague: bool = False
    """Whether the interval, which scales the velocities, is one more unknown with an error of `jitter`."""
    log_stiffness: float | None = None
    """log(k T**2) where the stiffness is known and the mass is not, which then follows from a."""
    rounding: float = ROUNDING
    """Unit roundoff of the coefficients."""
    bias: float = 0.0
    """Bias of the entries by truncated forces, in units of the residual, which pairs do not average away."""
    scales: tuple[float, ...] = ()
    """Log of the scale of the velocities at each stride from 0 on, where step or mass are rounded."""
    growing: bool = False
    """Whether negative friction is admitted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """The fit of a family with `stride` steps to a frame to the map of one oscillator; a = (h w)**2."""

    family: str
    stride: int
    turns: int
    """Whole turns of the phase between two frames."""
    a: float
    a_error: float
    g: float
    g_error: float
    log_mass: float
    mass_error: float
    chi2: float
    freedom: int
    predicted: tuple[np.longdouble, ...]
    """The four entries of the map between frames, in the units of the measured one."""

    @property
    def scheme(self) -> str:
        return FAMILIES[self.family].scheme

    @property
    def a_room(self) -> float:
        """Relative error of a, at `SURE` standard errors."""
        return SURE * self.a_error / abs(self.a)

    @property
    def interval_room(self) -> float:
        """Relative error of an interval that the map shows, at `SURE` standard errors, and its roundings."""
        return SURE * self.mass_error + 4 * FAMILIES[self.family].path * self.stride * ROUNDING

    @property
    def friction(self) -> float:
        """gamma h, and 0 of a held force, whose g is a share."""
        return 0.0 if FAMILIES[self.family].held else self.g


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A hypothesis: one family and stride, fitted to every oscillator."""

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
    def misfit(self) -> float:
        """Distance from the measured maps, in standard errors."""
        return math.sqrt(self.chi2)

    @property
    def of_one_interval(self) -> bool:
        """Whether all maps show the same interval, where each is free to show its own."""
        own = [(x.log_mass, x.interval_room) for x in self.parts]
        return all(abs(y - own[0][0]) <= room + own[0][1] for y, room in own)

    @property
    def damped(self) -> bool:
        return FAMILIES[self.family].damped and not FAMILIES[self.family].held

    @property
    def keeps_area(self) -> bool:
        """Whether all predicted maps have determinant 1."""
        entries = np.array([part.predicted for part in self.parts])
        return bool(np.all(np.abs(entries[:, 0] * entries[:, 3] - entries[:, 1] * entries[:, 2] - 1) < 1e-12))

    @property
    def simplicity(self) -> tuple[int, int, int]:
        """Sort key, the simplest first: by turns, steps, the exact solution, the order of `FAMILIES`."""
        turns = max(part.turns for part in self.parts)
        return turns, self.stride, -1 if self.scheme == "exact" else list(FAMILIES).index(self.family)

    @property
    def substeps(self) -> tuple[range, bool]:
        """Numbers of substeps over which a force may be held, and whether they kick first."""
        found = [substeps(part.g, part.g_error) for part in self.parts]
        alike = len({first for _, first, _ in found}) == 1
        both = range(max(n.start for n, *_ in found), min(n.stop for n, *_ in found))
        return both if alike else range(0), found[0][1]

    @property
    def endless(self) -> bool:
        """Whether the force may be held over infinitely many substeps."""
        return all(substeps(part.g, part.g_error)[2] for part in self.parts)

    def __str__(self) -> str:
        return self.scheme + ("" if self.stride == 1 else f", {self.stride} steps a frame")


@cache
def most(freedom: int) -> float:
    """Largest accepted chi-squared of so many degrees of freedom."""
    # SciPy is imported where it is asked: half of what importing this package takes
    from scipy.special import chdtri

    return float(chdtri(freedom, CHANCE)) if freedom else SOLVED


@cache
def _samples(family: Family, g: tuple[float, ...]) -> Reals:
    return unit(family, np.array([0.3, 1.1, 2.9], np.longdouble), np.array(g, np.longdouble))


def same_map(one: Family, other: Family, g: tuple[float, ...] = (0, 0, 0)) -> bool:
    """Whether two families have the same map at three values of a, with these g."""
    return bool(np.max(np.abs(_samples(one, g) - _samples(other, g))) < 1e-15)


@cache
def distinct(*, damped: bool) -> tuple[Family, ...]:
    """One family for each map: the implicit midpoint rule represents the trapezoidal rule, and so on."""
    every = DAMPED if damped else [x for x in UNDAMPED if not SCHEMES[x.scheme].has("friction")]
    return tuple(
        x for i, x in enumerate(every) if not any(same_map(x, y, (0.1, 0.2, 0.5)) for y in every[:i])
    )


@cache
def aliases(name: str) -> tuple[str, ...]:
    """Schemes with the same map on a spring, without friction and with it."""
    # the scheme itself where only its steps are known
    damped = {x: FAMILIES.get(f"{x}, damped", FAMILIES[x]) for x in (name, *_still(name))}
    return tuple(x for x in _still(name) if same_map(damped[x], damped[name], (0, 0.2, 0.5)))


@cache
def _still(name: str) -> tuple[str, ...]:
    """Other schemes with the same map without friction."""
    return tuple(f.scheme for f in UNDAMPED if f.scheme != name and same_map(f, FAMILIES[name]))


def frictionless(name: str) -> tuple[str, ...]:
    """Schemes with a friction stage whose map equals this one's without friction."""
    return tuple(x for x in _still(name) if SCHEMES[x].has("friction"))


def likely(joints: list[Joint]) -> list[Joint]:
    """Hypotheses within five standard errors of the best, each once, the simplest first."""
    if not joints:
        return []
    best = min(x.chi2 for x in joints)
    each = {(x.family, x.stride): x for x in sorted(joints, key=lambda x: -x.chi2)}
    return sorted((x for x in each.values() if x.chi2 <= best + EXCLUDED), key=lambda x: x.simplicity)
