"""P-values of draws under the null hypothesis: independent standard normal numbers.

Each is the probability, two-sided, of a value as extreme or more.  A `Statistic` is of sums that have an
exact law for the draws of one piece of a run and, added up, for those of all pieces: an error of the noise
that is too small to show in any piece shows in all.  They are exact but for the saddlepoint approximation of
`shape`, which is off by a few percent of the probability itself, however small that is (Lugannani & Rice,
Adv.  Appl.  Probab. 12 (1980) 475), and for `foretold`, which is a bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss

from springcheck.physics.arrays import Floats
from springcheck.physics.trajectory import NOT_KNOWN, Limits

MISSED = 0.05
"""Share of runs in which an error as large as the limit of detection is not detected."""

USUAL = 1e-8
"""Chance of a largest draw below, and of one above, the range that the report gives as usual."""

NOT_ALIKE = 1e-6
"""Chance below which what comes and goes is mentioned: a verdict fails by it where it is the only one."""

FEWEST_AGAIN = 40
"""Fewest numbers of which an exact repetition shows: their sum of squares is sqrt(40) standard deviations."""

FEW_TIMES = 30.0
"""How much of its usual sum of squares what foretells may lack before it is seen less well."""

Sums: TypeAlias = tuple[Any, ...]
"""Numbers and arrays, of which those of two pieces of a run add up."""


def _added(one: Sums, other: Sums) -> Sums:
    return tuple(a + b for a, b in zip(one, other, strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistic:
    """A test statistic of draws, and its law."""

    draws: int
    sums: Sums
    law: Callable[..., tuple[float, str]]
    """(draws, *sums) -> the chance, and the value in words."""
    join: Callable[[Sums, Sums], Sums] = _added
    """What the sums of two pieces are together."""
    limits: Callable[[int, float], Limits] = lambda draws, chance: NOT_KNOWN
    """(draws, probability of a false alarm) -> limits of detection, missed in a share `MISSED` of runs."""
    pieces: int = 1
    """Pieces of a run of which it is the statistic."""

    def __add__(self, other: Statistic) -> Statistic:
        """The statistic of the draws of both."""
        draws, pieces = self.draws + other.draws, self.pieces + other.pieces
        return replace(self, draws=draws, pieces=pieces, sums=self.join(self.sums, other.sums))

    @property
    def tests(self) -> int:
        """Tests of a run that is judged by each of its pieces and by all."""
        return self.pieces + (self.pieces > 1)

    @property
    def found(self) -> tuple[float, str]:
        """Two-sided probability of a value as extreme or more, and the value in words, for the report."""
        return self.law(self.draws, *self.sums)

    @property
    def chance(self) -> float:
        """The probability alone."""
        return self.found[0]

    def sees(self, chance: float) -> Limits:
        """Limits of detection where all tests of the run have this probability of a false alarm."""
        return self.limits(self.draws, chance / self.tests)


def of_normal(z: float) -> float:
    """Chance of a standard normal number at least as far from 0."""
    return math.erfc(abs(z) / math.sqrt(2)) if math.isfinite(z) else 0.0


def _any(of: Callable[[float, float], float], words: str, n: int, sums: Any) -> tuple[float, str]:
    """Chance of the sum over n draws, or over those of one of their columns (c,), by `of` (sum, draws)."""
    columns, c = np.ravel(sums).tolist(), np.size(sums)
    each = [(c * of(x, n / c), c * x / n, f" of coordinate {i}") for i, x in enumerate(columns)]
    found, value, which = min([(of(sum(columns), n), sum(columns) / n, ""), *each])
    return min(1.0, (1 + (c > 1)) * found), words.format(value, which, n)


def mean(x: Floats) -> Statistic:
    """The mean of draws x (f, ...), of all and of each column."""

    def law(n: int, totals: Floats) -> tuple[float, str]:
        return _any(
            lambda total, n: of_normal(total / math.sqrt(n)), "mean {:+.2e}{}, of {} draws", n, totals
        )

    return Statistic(draws=x.size, sums=(np.sum(x, axis=0),), law=law)


def variance(x: Floats) -> Statistic:
    """The sum of squares of draws x (f, ...), of all and of each column, by chi-squared."""
    from scipy.special import gammainc, gammaincc, gammainccinv, gammaincinv

    def of(squares: float, n: float) -> float:
        sides = gammainc(n / 2, squares / 2), gammaincc(n / 2, squares / 2)
        return min(1.0, 2 * float(min(sides))) if math.isfinite(squares) else 0.0

    def law(n: int, squares: Floats) -> tuple[float, str]:
        return _any(of, "variance {:.6f}{} where 1 is right, of {} draws", n, squares)

    def limits(n: int, chance: float) -> Limits:
        part = chance / (2 + 2 * (x.ndim > 1 and x.shape[1] > 1))
        return Limits(temperature=float(gammainccinv(n / 2, part) / gammaincinv(n / 2, MISSED)) - 1)

    return Statistic(draws=x.size, sums=(np.sum(x * x, axis=0),), law=law, limits=limits)


LARGEST = 40.0
"""No normal number of double precision is larger."""


def steady(one: Statistic, z: Floats) -> Statistic:
    """A statistic, or whether standard normal numbers z (f, c) of its draws are alike all along a run.

    Their periodogram shows what comes and goes: that of each piece, and that of the sums of pieces.
    """

    def law(n: int, one: Statistic, inside: tuple[float, str], sums: Floats) -> tuple[float, str]:
        (found, words), (chance, period) = one.found, min(inside, _periodic(sums, "pieces"))
        return min(1.0, 2 * min(found, chance)), words + period * (chance < min(found, NOT_ALIKE))

    def join(a: Sums, b: Sums) -> Sums:
        return a[0] + b[0], (1.0, ""), np.concatenate([a[2], b[2]])

    z = np.clip(z, -LARGEST, LARGEST)
    sums = one, _periodic(z, "rows of draws"), np.sum(z, axis=0, keepdims=True) / math.sqrt(len(z))
    return replace(one, sums=sums, law=law, join=join, limits=lambda n, chance: one.limits(n, chance / 2))


def _periodic(z: Floats, rows: str) -> tuple[float, str]:
    """Chance, and period in words, of the largest ordinate of the periodograms of normal numbers z (f, c), of
    each column and of all: each has an exponential law, or that of chi-squared where it alternates."""
    from scipy.special import erfc

    # every second, third, fourth, and sixth row is then a period
    f, c = len(z) - len(z) % 12 * (len(z) > 100), z.shape[1]
    z = np.concatenate([z, np.sum(z, axis=1, keepdims=True) / math.sqrt(c)], axis=1)[:f, c == 1 :]
    powers = np.abs(np.fft.rfft(z, axis=0)[1:]) ** 2 / f
    chances = np.exp(-powers)
    chances[(f - 1) // 2 :] = erfc(np.sqrt(powers[(f - 1) // 2 :] / 2))
    if not chances.size:
        return 1.0, ""
    k, j = np.unravel_index(np.argmin(chances), chances.shape)
    words = f", but not alike all along: with a period of {f / (k + 1):.4g} of {f} {rows}"
    return min(1.0, chances.size * float(chances[k, j])), words


def normal_sizes(x: Floats) -> Floats:
    """The sizes |x| of normal draws as the normal numbers of the same rank, up to `LARGEST`."""
    from scipy.special import erfc, ndtri

    return np.clip(-ndtri(erfc(np.abs(x) / math.sqrt(2))), -LARGEST, LARGEST)


def shape(x: Floats) -> Statistic:
    """Skewness and weight of the tails of draws x (...), whatever the variance.

    The means of the Legendre polynomials of degrees 3 and 4 of the ranks 2 Phi(x) - 1 (Neyman's smooth test),
    of draws normalised to variance 1, in each piece by itself: bounded, so that no single draw decides.
    """
    from scipy.special import erf

    square = max(float(np.mean(x * x)), 1e-300)
    ranks, size = erf(x.ravel() / math.sqrt(2 * square)), math.sqrt(square)

    def law(n: int, *sums: float) -> tuple[float, str]:
        chances = [2 * _saddlepoint(x / n, n, degree) for x, degree in zip(sums, (3, 4), strict=False)]
        return min(1.0, *chances), f"third moment {sums[2] / n:+.4f}, fourth {sums[3] / n:.4f}, of {n} draws"

    sums = [float(np.sum(Legendre.basis(degree)(ranks))) for degree in (3, 4)]
    moments = [float(np.sum((x / size) ** i)) for i in (3, 4)]
    return Statistic(draws=x.size, sums=(*sums, *moments), law=law)


@cache
def _quadrature(degree: int) -> tuple[Floats, Floats]:
    """The Legendre polynomial at Gauss's nodes, and their weights of a mean."""
    nodes, weights = leggauss(64)
    return Legendre.basis(degree)(nodes), weights / 2


def _saddlepoint(value: float, n: int, degree: int) -> float:
    """Two-sided chance of a mean of n values of the Legendre polynomial at uniform numbers."""
    values, parts = _quadrature(degree)
    if not np.min(values) < value < np.max(values) or n < 8:
        return 1.0 if n < 8 and math.isfinite(value) else 0.0

    def moments(t: float) -> tuple[float, float, float]:
        weights = parts * np.exp(t * values)
        total = float(np.sum(weights))
        first = float(np.sum(weights * values)) / total
        return math.log(total), first, float(np.sum(weights * values**2)) / total - first**2

    low, high = -2e3, 2e3
    for _ in range(200):
        t = (low + high) / 2
        low, high = (t, high) if moments(min(max(t, -600), 600))[1] < value else (low, t)
    t = min(max((low + high) / 2, -600), 600)
    k, _, second = moments(t)
    w = math.copysign(math.sqrt(max(2 * n * (t * value - k), 0)), t)
    if abs(w) < 1e-3:
        return 1.0
    tail = math.erfc(abs(w) / math.sqrt(2)) / 2
    tail += math.exp(-w * w / 2) / math.sqrt(2 * math.pi) * (1 / abs(t * math.sqrt(n * second)) - 1 / abs(w))
    return min(1.0, 2 * max(tail, 0.0))


def largest(x: Floats, error: Floats) -> Statistic:
    """The largest |x| of draws x (...) with rounding errors (...), and how far it is from the second largest.

    The largest of n has an exact law, and so has the largest given the second.  Draws that are cut off have
    too small a largest one, or two that are equal to rounding; one of another distribution is too large.
    """
    from scipy.special import log_ndtr, ndtri

    def law(n: int, sizes: Floats, errors: Floats) -> tuple[float, str]:
        # edges of the usual range, -inf of none
        low, high = (-float(ndtri(-math.expm1(log / n) / 2)) for log in (math.log(USUAL), -USUAL))
        words = f"largest {sizes[0]:.4f}, usual are {low:.2f} to {high:.2f}, of {n} draws"
        if not math.isfinite(sizes[0]):
            return 0.0, words
        beyond = math.erfc(sizes[0] / math.sqrt(2))
        smaller = n * math.log1p(-beyond) if beyond < 1 else -math.inf
        # rounding may have made two sizes equal that were not
        apart = log_ndtr(-sizes[0] - errors[0]) - log_ndtr(-sizes[1] + errors[1])
        tied, inside = -math.expm1(min(float(apart), 0.0)), min(math.exp(smaller), -math.expm1(smaller))
        words += f", but two are equal to {abs(sizes[0] - sizes[1]):.0e}" * (tied < min(inside, NOT_ALIKE))
        return min(1.0, 3 * min(inside, tied)), words

    def join(one: Sums, other: Sums) -> Sums:
        sizes, errors = (np.concatenate([a, b]) for a, b in zip(one, other, strict=True))
        two = np.argsort(-sizes, kind="stable")[:2]
        return sizes[two], errors[two]

    none = np.zeros(2), np.zeros(2)
    return Statistic(draws=x.size, sums=join(none, (np.abs(x.ravel()), error.ravel())), law=law, join=join)


def neighbours(x: Floats) -> Statistic:
    """The autocorrelation of draws x (f, ...) at a lag of one row.

    Given every second row, the sum over the rows between is normal, with a variance that these have.
    """

    def law(n: int, products: float, squares: float, pairs: int) -> tuple[float, str]:
        words = f"correlation {products / max(pairs, 1):+.2e}, of {n} draws"
        if not pairs:
            return 1.0, words
        return of_normal(products / math.sqrt(squares)) if squares > 0 else 0.0, words

    around = x[: len(x) // 2 * 2 : 2].copy()
    after = x[2::2]
    around[: len(after)] += after[: len(around)]
    sums = float(np.sum(x[1::2] * around)), float(np.sum(around * around)), x[1:].size
    return Statistic(draws=x.size, sums=sums, law=law)


def foretold(x: Floats, y: Floats, drag: float = 0.0) -> Statistic:
    """How well numbers y (k, s, n) of the usual size 1, each known before its draws x (u, s, n), go with
    those of one column, or of all n together, or with the sizes of these; a draw of 0 is none.

    With S = sum x y and V = sum y**2, exp(l S - l**2 V/2) is 1 in the mean however y comes of draws before;
    so is its average over normal l of variance 1/t, and the product of several x, which is 1/a or more with
    a chance of at most a (Robbins, Ann. Math. Stat. 41 (1970) 1397): no less than the chance, for any s.
    `drag` is the correlation of draws with the first of y for each relative change of a friction.
    """
    from scipy.special import erfinv

    names = ("the momentum", "the force", "the size of momenta", "the size of forces")[-2 * (len(y) == 1) :]
    sized = np.where(x == 0, 0, normal_sizes(x))

    @np.errstate(all="ignore")
    def law(n: int, s: int, products: Floats, known: Floats, squares: float) -> tuple[float, str]:
        size = np.sqrt(squares / len(products) * np.sum(known, axis=1))
        each = np.sum(products, axis=2) / size
        u, i = np.unravel_index(np.argmax(np.where(np.isfinite(each), np.abs(each), np.inf)), each.shape)
        what = "of the size of draws with" if u >= len(each) // 2 else "with"
        words = f"correlation {each[u, i]:+.2e} {what} {names[i]} before, of {n} draws"
        if not math.isfinite(squares):
            return 0.0, words
        columns = known.shape[-1]
        S, V = (np.concatenate([z, np.sum(z, axis=-1, keepdims=True)], axis=-1) for z in (products, known))
        t = s * np.append(np.ones(columns), columns) / FEW_TIMES
        logs = np.sum(np.log1p(V / t) / 2 - S * S / (2 * (V + t)), axis=0)
        return min(1.0, float(logs.size) * math.exp(min(float(np.min(logs)), 0.0))), words

    def limits(n: int, chance: float) -> Limits:
        # of all others S**2 is V at least in the mean, which is left out
        paid = len(x) * math.log1p(FEW_TIMES) / 2 + math.log(len(y) * (y.shape[-1] + 1) / chance)
        away = math.sqrt(2 * paid * (1 + 1 / FEW_TIMES)) + math.sqrt(2) * float(erfinv(1 - 2 * MISSED))
        if not drag > 0:
            return NOT_KNOWN
        # a friction more by x than its noise leaves momenta that are smaller by the root of 1 + x
        held = away / (drag * math.sqrt(n))
        return Limits(friction=held * held / 2 + held * math.hypot(1, held / 2))

    x = np.concatenate([x, sized])
    sums = x.shape[1], np.einsum("usn,ksn->ukn", x, y), np.sum(y * y, axis=1), float(np.sum(x * x))
    return Statistic(draws=x.size // 2, sums=sums, law=law, limits=limits)


def count(hits: int, n: int, p: float) -> Statistic:
    """How many of n steps have a collision, each of probability p = 1 - exp(-friction rate h): binomial."""
    from scipy.special import bdtr, bdtrc, bdtri

    def law(n: int, hits: int) -> tuple[float, str]:
        below, above = float(bdtr(hits, n, p)), float(bdtrc(hits - 1, n, p)) if hits else 1.0
        return min(1.0, 2 * min(below, above)), f"{hits} of {n} steps, expected {n * p:.1f}"

    def limits(n: int, chance: float) -> Limits:
        several = np.ceil(n * p) + np.arange(50 + 10 * int(np.sqrt(n * p)))
        alarms = several[(several <= n) & (bdtrc(several - 1, n, p) <= chance / 2)]
        if not len(alarms):
            return NOT_KNOWN
        return Limits(friction=math.log1p(-float(bdtri(alarms[0] - 1, n, MISSED))) / math.log1p(-p) - 1)

    return Statistic(draws=n, sums=(hits,), law=law, limits=limits)


def repeats(x: Floats) -> tuple[float, str]:
    """Chance of the largest autocorrelation of draws x (f, n), taken one after the other, row by row, and the
    correlation in words: of each number and any that comes more than n later.

    Of numbers more than half a record apart the sum is normal given the first ones; others are nearly normal,
    more so the longer the record: ten times its chance stands for the difference.
    """
    f, n = len(x), x.size // len(x)
    flat = x.ravel()
    lags = np.arange(n + 1, x.size - FEWEST_AGAIN)
    if f < 1000 or not np.all(np.isfinite(flat)):
        return 1.0, "largest correlation of all lags"
    sums = np.fft.irfft(np.abs(np.fft.rfft(flat, 2 * x.size)) ** 2)[lags]
    both = x.size - lags
    z = sums / np.sqrt(np.where(lags < both, both, np.cumsum(flat * flat)[both - 1]))
    at = int(np.argmax(np.abs(z)))
    lag = lags[at]
    size = math.sqrt(float(np.sum(flat[:-lag] ** 2) * np.sum(flat[lag:] ** 2)))
    later = f"{lag // n} rows" if lag % n == 0 else f"{lag} numbers, of {n} a row,"
    words = f"largest correlation {sums[at] / size:+.2e}, with those {later} later"
    return min(1.0, 10 * len(lags) * of_normal(float(z[at]))), words


MOST_PAIRED = 512
"""Columns that are compared in pairs."""


@np.errstate(all="ignore")
def pairs(x: Floats) -> tuple[float, str]:
    """Chance of the largest of the sums of products of two columns of draws x (f, n), of the first
    `MOST_PAIRED`, and the correlation in words: normal given the first of both.

    NaN where a step had no draw; where each has one, of all neighbours together as well.
    """
    some, drawn = np.nan_to_num(x[:, :MOST_PAIRED], nan=0.0), ~np.isnan(x[:, :MOST_PAIRED])
    both, sums, squares = np.triu(drawn.T.astype(float) @ drawn, 1) > 0, some.T @ some, (some**2).T @ drawn
    z = np.where(both, sums / np.sqrt(squares), 0.0)
    at = np.argmax(np.where(np.isfinite(z), np.abs(z), np.inf))
    found = max(int(np.count_nonzero(both)), 1) * of_normal(float(z.flat[at]))
    if len(z) > 2 and np.all(drawn):
        found = 2 * min(found, neighbours(x.T).chance)
    size = abs((sums / np.sqrt(squares * squares.T)).flat[at])
    return min(1.0, found), f"largest correlation {size:.2e}, of {np.count_nonzero(~np.isnan(x))} draws"


def crossed(x: Floats, y: Floats) -> float:
    """Chance of the largest cross-correlation of draws x (n,) with draws y (n,), at lags up to n/2 either
    way; the sum at each lag is normal given x."""
    n = len(x)
    turned = np.fft.rfft(y, 2 * n) * np.conj(np.fft.rfft(x, 2 * n))
    sums, squares = np.fft.irfft(turned, 2 * n), np.concatenate([[0.0], np.cumsum(x * x)])
    far = np.arange(n // 2)
    # y later than x, by the first of x; y earlier, by the last
    later, earlier = squares[n - far], squares[n] - squares[far]
    z = np.concatenate([sums[far] / np.sqrt(later), sums[-far[1:]] / np.sqrt(earlier[1:])])
    return min(1.0, len(z) * of_normal(float(np.max(np.abs(z))))) if np.all(np.isfinite(z)) else 0.0
