"""Statistical tests of draws: the size of the noise, independence, shape, repeated values, collisions.

A draw is a number of mean 0 and variance 1 that is independent of everything before it.  Each test returns
a `Statistic`: sums that add up over the pieces of a run, and the probability of sums so extreme if the draws
are right.  That probability is exact, or an upper bound:

* size: the sum of squares is chi-squared; of uniform draws both tails are bounded (see `size`);
* independence: a draw is symmetric about 0 whatever is known before it.  Then exp(l S - l**2 V/2) is at most
  1 in the mean for S = sum x y and V = sum (x y)**2, y known before x, however large the noise is (de la
  Pena, Ann. Probab. 27 (1999) 537).  Averaged over l it exceeds 1/a with a probability of at most a (Robbins,
  Ann. Math. Stat. 41 (1970) 1397);
* shape: the same bound for Legendre polynomials of ranks, whose moment generating function is known;
* ties: pairs of draws that are equal to rounding are Poisson distributed.

Only the size of the noise decides `size`; the other tests do not depend on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss

from springcheck.physics.arrays import Floats, by_identity
from springcheck.physics.trajectory import NOT_KNOWN, Limits

MISSED = 0.05
"""Share of runs in which an error as large as the limit of detection is not detected."""

FEW_TIMES = 30.0
"""How much smaller than usual V may be before `independence` loses power."""

COARSEST = 2.0**-23
"""Chance that two right draws have the same size: uniform numbers of single precision have 24 bits."""

LONG = 10
"""Rows for each column from which on a column is scaled by its own size: few rows would change its shape."""

BLOCK = 50_000
"""Draws among which ties are counted: among more, right ones in single precision have many."""

MOST_HIDDEN = 0.01
"""Share of the draws that may be equal to rounding by chance; above, ties are not counted."""

STRENGTHS = (6.0, 12.0, 24.0, 48.0)
"""The l of `shape`, over the standard deviation of the sum."""

Sums: TypeAlias = tuple[Any, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistic:
    """Sums of draws, and their law."""

    sums: Sums
    """Numbers and arrays, of which those of two pieces of a run add up."""
    law: Callable[..., tuple[float, str]]
    """(*sums) -> the chance, and the value in words."""
    limits: Callable[[Sums, float], Limits] = lambda sums, chance: NOT_KNOWN
    """(sums, probability of a false alarm) -> limits of detection, missed in a share `MISSED` of runs."""

    def __add__(self, other: Statistic) -> Statistic:
        """The statistic of the draws of both."""
        return replace(self, sums=tuple(a + b for a, b in zip(self.sums, other.sums, strict=True)))

    @property
    def found(self) -> tuple[float, str]:
        """Probability of a value as extreme or more if all is right, and the value in words."""
        with np.errstate(all="ignore"):
            return self.law(*self.sums)

    @property
    def chance(self) -> float:
        """The probability alone."""
        return self.found[0]

    def sees(self, chance: float) -> Limits:
        """Limits of detection at this probability of a false alarm."""
        return self.limits(self.sums, chance)


def of_normal(z: float) -> float:
    """Probability of a standard normal number at least as far from 0."""
    return math.erfc(abs(z) / math.sqrt(2)) if math.isfinite(z) else 0.0


def size(x: Floats, *, uniform: bool = False) -> Statistic:
    """The mean square of draws x (f, n), NaN where there is none, of all and of each column."""
    from scipy.special import gammainc, gammaincc, gammainccinv, gammaincinv, ndtr

    def sides(squares: float, n: float) -> float:
        if not uniform:
            both = gammainc(n / 2, squares / 2), gammaincc(n / 2, squares / 2)
        else:
            # the squares have variance 4/5 and a skewness between those of a normal number and of this
            # chi-squared one: each bounds one tail
            both = ndtr((squares - n) / math.sqrt(0.8 * n)), gammaincc(1.25 * n, 1.25 * squares)
        return min(1.0, 2 * float(min(both))) if math.isfinite(squares) else 0.0

    def law(squares: Floats, counts: Floats) -> tuple[float, str]:
        total, n, several = float(np.sum(squares)), float(np.sum(counts)), np.count_nonzero(counts) > 1
        tests = 1 + several * int(np.count_nonzero(counts))
        each = [(sides(total, n), total / n, "")]
        if several:
            every = zip(squares.tolist(), counts.tolist(), strict=True)
            each += [(sides(x, k), x / k, f" of coordinate {i}") for i, (x, k) in enumerate(every) if k]
        found, value, which = min(each)
        said = f"variance {value:.6f}{which} where 1 is right, of {n:.0f} draws"
        return min(1.0, tests * found), said

    def limits(sums: Sums, chance: float) -> Limits:
        counts = sums[1]
        n, several = np.sum(counts), np.count_nonzero(counts) > 1
        part = chance / 2 / (1 + several * np.count_nonzero(counts))
        return Limits(temperature=float(gammainccinv(n / 2, part) / gammaincinv(n / 2, MISSED)) - 1)

    drawn = ~np.isnan(x)
    sums = np.sum(np.where(drawn, x, 0.0) ** 2, axis=0), np.sum(drawn, axis=0).astype(float)
    return Statistic(sums=sums, law=law, limits=limits)


@by_identity
class Known(NamedTuple):
    """Numbers y (f, n) of the usual size 1 that are known before the draws, and what they are."""

    what: str
    y: Floats
    of_sizes: bool = False
    """Whether the sizes of the draws are held against them, not the draws."""


def known_before(x: Floats, state: Iterable[Known], *, between: bool = True) -> list[Known]:
    """What no draw of x (f, n) may depend on: nothing (a mean), the draw before, the draw of the particle
    before where draws of particles are independent, and the state of the scene."""
    some = np.nan_to_num(x)
    before = np.zeros_like(some)
    before[1:] = some[:-1]
    out = [Known("a constant", np.ones_like(some)), Known("the draw before", before)]
    if between and x.shape[1] > 1:
        beside = np.zeros_like(some)
        beside[:, 1:] = some[:, :-1]
        out.append(Known("the draw of the coordinate before", beside))
    return [*out, *state]


def scaled(x: Floats, uniform: bool) -> Floats:
    """Draws x (f, n) over their measured size: of each column where all are long, else of all together."""
    some, drawn = np.nan_to_num(x), ~np.isnan(x)
    axis = 0 if len(x) >= LONG * x.shape[1] else None
    if uniform:
        # the largest of n uniform numbers is known to 1/n
        size = np.max(np.abs(some), axis=axis) / math.sqrt(3)
    else:
        size = np.sqrt(np.sum(some**2, axis=axis) / np.maximum(np.sum(drawn, axis=axis), 1))
    return np.asarray(x / np.where(size > 0, size, 1.0))


def independence(x: Floats, known: Iterable[Known], *, uniform: bool = False, drag: float = 0.0) -> Statistic:
    """Whether draws x (f, n), NaN where there is none, depend on what is known before them.

    `drag` is the correlation of draws with the momentum for each relative change of a friction.
    """
    from scipy.special import erfinv

    known, drawn = list(known), ~np.isnan(x)
    names = [f"the size of draws with {y.what}" if y.of_sizes else f"draws with {y.what}" for y in known]
    some, sizes = np.nan_to_num(x), np.abs(x)
    long = len(x) >= LONG * x.shape[1] and np.all(np.any(drawn, axis=0))
    sides = np.where(drawn, np.sign(sizes - np.nanmedian(sizes, axis=0 if long else None)), 0.0)

    def logs(S: Floats, V: Floats, counts: Floats) -> Floats:
        t = np.maximum(counts, 1) / FEW_TIMES
        return np.asarray(S * S / (2 * (V + t)) - np.log1p(V / t) / 2)

    def law(S: Floats, V: Floats, counts: Floats) -> tuple[float, str]:
        if x.shape[1] > 1:
            S, V, counts = (np.append(y, np.sum(y, axis=-1, keepdims=True), axis=-1) for y in (S, V, counts))
        found = logs(S, V, counts)
        which, i = np.unravel_index(int(np.nanargmax(found)), found.shape)
        r = S[which, i] / math.sqrt(max(float(V[which, i]) * float(counts[i]), 1e-300))
        of = f" of coordinate {i}" if i < x.shape[1] > 1 else ""
        said = f"correlation {r:+.2e} of {names[which]}{of}, of {counts[-1]:.0f} draws"
        return min(1.0, found.size * math.exp(-max(float(found[which, i]), 0.0))), said

    def limits(sums: Sums, chance: float) -> Limits:
        if not drag > 0:
            return NOT_KNOWN
        S, n = sums[0], float(np.sum(sums[2]))
        tests = S.size + len(S) * (x.shape[1] > 1)
        paid = math.log1p(FEW_TIMES) / 2 + math.log(tests / chance)
        away = math.sqrt(2 * paid * (1 + 1 / FEW_TIMES)) + math.sqrt(2) * float(erfinv(1 - 2 * MISSED))
        # a friction more by x than its noise leaves momenta that are smaller by the root of 1 + x
        held = away / (drag * math.sqrt(n))
        return Limits(friction=held * held / 2 + held * math.hypot(1, held / 2))

    products = [(sides if y.of_sizes else some) * y.y for y in known]
    S, V = (np.array([np.sum(z**power, axis=0) for z in products]) for power in (1, 2))
    return Statistic(sums=(S, V, np.sum(drawn, axis=0).astype(float)), law=law, limits=limits)


def shape(x: Floats, *, uniform: bool = False) -> Statistic:
    """The tails and the symmetry of draws x (f, n), whatever their size: the means of the Legendre
    polynomials of degrees 3 and 4 of their ranks (Neyman's smooth test), which no single draw decides."""
    from scipy.special import erf

    z = scaled(x, uniform)[~np.isnan(x)]
    ranks = z / math.sqrt(3) if uniform else erf(z / math.sqrt(2))
    nodes, weights = leggauss(64)

    def law(third: float, fourth: float, *rest: float) -> tuple[float, str]:
        n, total = rest[-1], 0.0
        for degree, value in ((3, third), (4, fourth)):
            of, spread = Legendre.basis(degree)(nodes), math.sqrt(n / (2 * degree + 1))
            for strength in STRENGTHS:
                for t in (min(strength / spread, 3.0), -min(strength / spread, 3.0)):
                    log = t * value - n * math.log(float(weights @ np.exp(t * of)) / 2)
                    total += math.exp(min(log, 700.0)) / (4 * len(STRENGTHS))
        said = f"third moment {rest[0] / n:+.4f}, fourth {rest[1] / n:.4f}, of {n:.0f} draws"
        return min(1.0, 1 / max(total, 1e-300)), said

    moments = [float(np.sum(z**power)) for power in (3, 4)]
    sums = [float(np.sum(Legendre.basis(degree)(ranks))) for degree in (3, 4)]
    return Statistic(sums=(*sums, *moments, len(z)), law=law)


def ties(x: Floats, error: Floats) -> Statistic | None:
    """Draws x (f, n) whose sizes are equal to their rounding errors (f, n), within blocks of rows: of a
    generator with few values, one that begins anew, of draws that are cut off or used twice.  None where
    rounding alone makes too many.

    Right draws are at least as fine as those of uniform numbers in single precision.
    """
    from scipy.special import gammainc

    each, rows = [], max(BLOCK // x.shape[1], 1)
    for first in range(0, len(x), rows):
        drawn = ~np.isnan(x[first : first + rows])
        sizes, errors = np.abs(x[first : first + rows][drawn]), error[first : first + rows][drawn]
        order, n = np.argsort(sizes), len(sizes)
        sizes, errors = sizes[order], errors[order]
        scale = math.sqrt(float(np.mean(sizes * sizes))) if n else 0.0
        # the squared density of the size of a normal number has the integral 1/pi**0.5, of a uniform one more
        near = min(1.0, 4 / math.sqrt(3) * float(np.mean(errors)) / scale) if scale > 0 else 1.0
        equal = int(np.count_nonzero(np.diff(sizes) <= errors[1:] + errors[:-1]))
        each.append((equal, n * (n - 1) / 2 * (near + COARSEST), n))
    sums = tuple(map(sum, zip(*each, strict=True)))
    if sums[2] < 2 or sums[1] > MOST_HIDDEN * sums[2] + 1:
        return None

    def law(equal: float, expected: float, n: float) -> tuple[float, str]:
        said = f"{n - equal:.0f} values among {n:.0f} draws"
        return float(gammainc(equal, expected)) if equal else 1.0, said

    return Statistic(sums=sums, law=law)


def hits(hits: int, n: int, p: float) -> Statistic:
    """How many of n steps have a collision, each of probability p = 1 - exp(-friction rate h): binomial."""
    from scipy.special import bdtr, bdtrc, bdtri

    def law(hits: int, n: int) -> tuple[float, str]:
        below, above = float(bdtr(hits, n, p)), float(bdtrc(hits - 1, n, p)) if hits else 1.0
        return min(1.0, 2 * min(below, above)), f"{hits} of {n} steps, expected {n * p:.1f}"

    def limits(sums: Sums, chance: float) -> Limits:
        n = sums[1]
        several = np.ceil(n * p) + np.arange(50 + 10 * int(np.sqrt(n * p)))
        alarms = several[(several <= n) & (bdtrc(several - 1, n, p) <= chance / 2)]
        if not len(alarms):
            return NOT_KNOWN
        return Limits(friction=math.log1p(-float(bdtri(alarms[0] - 1, n, MISSED))) / math.log1p(-p) - 1)

    return Statistic(sums=(hits, n), law=law, limits=limits)
