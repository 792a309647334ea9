"""P-values of draws under the null hypothesis: independent standard normal numbers.

Each function returns the probability, two-sided, of a value as extreme or more.  They are exact but for
`shape`, whose saddlepoint approximation is off by a few percent of the probability itself, however small that
is (Lugannani & Rice, Adv.  Appl.  Probab. 12 (1980) 475), and `foretold`, which is a bound.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss

from springcheck.physics.arrays import Floats

FACTOR_LAGS = 20
"""Lags at which a factor of momenta that persists would show."""


def of_normal(z: float) -> float:
    """Chance of a standard normal number at least as far from 0."""
    return math.erfc(abs(z) / math.sqrt(2)) if math.isfinite(z) else 0.0


def mean(x: Floats) -> float:
    """Chance of the mean of draws x (...)."""
    return of_normal(float(np.sum(x)) / math.sqrt(x.size))


def variance(x: Floats) -> float:
    """Chance of the sum of squares of draws x (...), by chi-squared."""
    from scipy.special import gammainc, gammaincc

    half = float(np.sum(x * x)) / 2
    if not math.isfinite(half):
        return 0.0
    return min(1.0, 2 * float(min(gammainc(x.size / 2, half), gammaincc(x.size / 2, half))))


def shape(x: Floats, degree: int = 4) -> float:
    """Chance of the weight of the tails, or by degree 3 of the skewness, whatever the variance.

    The mean of the Legendre polynomial of the rank 2 Phi(x) - 1 (Neyman's smooth test), of draws normalised
    to variance 1: bounded, so that no single draw decides.
    """
    from scipy.special import erf

    u = erf(x.ravel() / math.sqrt(2 * max(float(np.mean(x * x)), 1e-300)))
    value = float(np.mean(Legendre.basis(degree)(u)))
    return _saddlepoint(value, x.size, degree) if math.isfinite(value) else 0.0


@cache
def _quadrature(degree: int) -> tuple[Floats, Floats]:
    """The Legendre polynomial at Gauss's nodes, and their weights of a mean."""
    nodes, weights = leggauss(64)
    return Legendre.basis(degree)(nodes), weights / 2


def _saddlepoint(value: float, n: int, degree: int) -> float:
    """Two-sided chance of a mean of n values of the Legendre polynomial at uniform numbers."""
    values, parts = _quadrature(degree)
    if not np.min(values) < value < np.max(values) or n < 8:
        return 1.0 if n < 8 else 0.0

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


def repeats(x: Floats) -> float:
    """Chance of the largest autocorrelation of draws x (f, n), taken one after the other, row by row: of each
    number and any that comes more than n later.

    Each is nearly normal, more so the longer the record; ten times its chance stands for the difference.
    """
    f, n = len(x), x.size // len(x)
    padded = np.fft.rfft(x.ravel(), 2 * x.size)
    sums = np.fft.irfft(np.abs(padded) ** 2)[n + 1 : n * (f // 2)]
    if f < 1000 or not np.all(np.isfinite(sums)):
        return 1.0
    sizes = np.sqrt(x.size - np.arange(n + 1, n * (f // 2)))
    return min(1.0, 10 * len(sums) * of_normal(float(np.max(np.abs(sums) / sizes))))


MOST_PAIRED = 512
"""Columns that are compared in pairs."""


def products(x: Floats) -> Floats:
    """Sums of products of each pair of the first `MOST_PAIRED` columns of draws x (f, n), in standard
    deviations given the first of the two: normal numbers (n, n), 0 on and below the diagonal."""
    some = x[:, :MOST_PAIRED]
    sums = some.T @ some
    return np.asarray(np.triu(sums, 1) / np.sqrt(np.diag(sums))[:, None])


def pairs(x: Floats) -> float:
    """Chance of the largest of the sums of products of two columns of draws x (f, n), and of all neighbours
    together."""
    one, z = neighbours(x.T), products(x)
    n = len(z)
    return one if n < 3 else min(1.0, 2 * one, n * (n - 1) * of_normal(float(np.max(np.abs(z)))))


def neighbours(x: Floats) -> float:
    """Chance of the autocorrelation of draws x (f, ...) at a lag of one row.

    Given every second row, the sum over the rows between is normal, with a variance that these have.
    """
    if len(x) < 2:
        return 1.0
    around = np.zeros_like(x[1::2])
    around += x[0 : 2 * len(around) : 2]
    after = x[2::2]
    around[: len(after)] += after[: len(around)]
    size = float(np.sum(around * around))
    return of_normal(float(np.sum(x[1::2] * around)) / math.sqrt(size)) if size > 0 else 0.0


def foretold(x: Floats, y: Floats) -> float:
    """Chance that numbers y (k, s, n) of the usual size 1, each known before its draws x (u, s, n), go with
    them so well: with those of one column, or of all n together.

    With S = sum x y and V = sum y**2, exp(l S - l**2 V/2) is 1 in the mean however y comes of draws before;
    so is its average over normal l of variance 1/t, and the product of several x, which is 1/a or more with
    a chance of at most a (Robbins, Ann. Math. Stat. 41 (1970) 1397): no less than the chance, for any s.
    """
    if not np.all(np.isfinite(x)):
        return 0.0
    each, squares = np.einsum("usn,ksn->ukn", x, y), np.sum(y * y, axis=1)
    n = each.shape[-1]
    S, V = (np.concatenate([z, np.sum(z, axis=-1, keepdims=True)], axis=-1) for z in (each, squares))
    t = x.shape[1] * np.append(np.ones(n), n) / FEW_TIMES
    logs = np.sum(np.log1p(V / t) / 2 - S * S / (2 * (V + t)), axis=0)
    return min(1.0, float(logs.size) * math.exp(min(float(np.min(logs)), 0.0)))


FEW_TIMES = 30.0
"""How much of its usual sum of squares what foretells may lack before it is seen less well."""


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


def count(hits: int, n: int, p: float) -> float:
    """Chance of so many hits of n, each of probability p, by the binomial distribution."""
    from scipy.special import bdtr, bdtrc

    below, above = float(bdtr(hits, n, p)), float(bdtrc(hits - 1, n, p)) if hits else 1.0
    return min(1.0, 2 * min(below, above))


def normal_scores(x: Any) -> Floats:
    """Uniform draws of variance 1 as the normal numbers of the same rank; beyond their range infinite."""
    from scipy.special import ndtri

    u = np.asarray(x, np.float64) / math.sqrt(12) + 0.5
    # the ends of the range are known to a rounding
    u = np.where((u <= 0) & (u > -1e-9), 1e-12, np.where((u >= 1) & (u < 1 + 1e-9), 1 - 1e-12, u))
    return np.where((u > 0) & (u < 1), ndtri(np.clip(u, 1e-300, 1 - 2.0**-53)), np.inf)


def together(x: Floats) -> float:
    """Chance of the correlations of x (f,) over `FACTOR_LAGS` steps together (Ljung & Box, Biometrika 65
    (1978) 297); 1 of a few."""
    from scipy.special import gammaincc

    n, size = len(x), float(x @ x)
    if n < 4 * FACTOR_LAGS:
        return 1.0
    squares = [float(x[j:] @ x[:-j]) ** 2 / (n - j) for j in range(1, FACTOR_LAGS + 1)]
    return float(gammaincc(FACTOR_LAGS / 2, n * (n + 2) * sum(squares) / size**2 / 2)) if size else 0.0
