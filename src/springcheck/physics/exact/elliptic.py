"""Jacobi's elliptic functions in extended precision, by the arithmetic-geometric mean.

Abramowitz & Stegun, Handbook of Mathematical Functions (1964), 16.4 and 17.6, with every difference of
near-equal numbers rewritten.  A modulus is given as its parameter m and the complement m1 = 1 - m, both
in full: near the separatrix m1 would be lost in m.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from springcheck.physics.arrays import EPS, Extended

MOST_MEANS = 40
"""Most rounds of the mean: six for ordinary moduli, a dozen for m1 near the smallest number."""


def _means(m: Extended, m1: Extended) -> Iterator[tuple[Extended, Extended, Extended]]:
    """(a, b, c) of each round, from (1, sqrt(m1), sqrt(m)) until c vanishes beside a."""
    a, b, c = np.ones_like(m), np.sqrt(m1), np.sqrt(m)
    for _ in range(MOST_MEANS):
        yield a, b, c
        if np.all(c <= EPS * a):
            return
        mean = (a + b) / 2
        # (a - b)/2 without its cancellation
        a, b, c = mean, np.sqrt(a * b), c * c / (4 * mean)


def jacobi(u: Extended, m: Extended, m1: Extended) -> tuple[Extended, Extended, Extended, Extended]:
    """am(u | m) and sn, cn, dn, for 0 <= m <= 1 and m1 = 1 - m.  am grows with u, beyond pi."""
    u, m, m1 = np.broadcast_arrays(*(np.asarray(x, np.longdouble) for x in (u, m, m1)))
    edge = m1 == 0
    rounds = list(_means(np.where(edge, 0, m), np.where(edge, 1, m1)))
    phi = u * rounds[-1][0] * np.longdouble(2) ** (len(rounds) - 1)
    for (a, b, _), (mean, _, c) in zip(rounds[-2::-1], rounds[:0:-1], strict=True):
        sine, cosine = np.sin(phi), np.cos(phi)
        # asin(c/mean sin phi), with sqrt(1 - ...) of a sum of squares, because mean**2 - c**2 = a b
        turn = np.arctan2(c * sine, np.sqrt((mean * cosine) ** 2 + a * b * sine**2))
        phi = (phi + turn) / 2
    with np.errstate(over="ignore"):
        far = 1 / np.cosh(np.where(edge, u, 0))
    am = np.where(edge, np.arctan2(np.tanh(u), far), phi)
    sn, cn = np.where(edge, np.tanh(u), np.sin(phi)), np.where(edge, far, np.cos(phi))
    dn = np.where(edge, far, np.sqrt(m1 + m * cn * cn))
    return np.asarray(am), np.asarray(sn), np.asarray(cn), np.asarray(dn)


def argument(sine: Extended, cosine: Extended, m: Extended, m1: Extended) -> Extended:
    """F(phi | m), the inverse of am, for phi in (-pi, pi] of this sine and cosine, up to a common factor."""
    sine, cosine, m, m1 = np.broadcast_arrays(*(np.asarray(x, np.longdouble) for x in (sine, cosine, m, m1)))
    phi = np.arctan2(sine, cosine)
    edge = m1 == 0
    rounds = list(_means(np.where(edge, 0, m), np.where(edge, 1, m1)))
    # sine and cosine are propagated separately: near a quarter turn, where the way out of a separatrix is
    # long, those of the rounded phi would be wrong
    size = np.hypot(sine, cosine)
    s, c = (x / np.where(size > 0, size, 1) for x in (sine, cosine))
    for a, b, _ in rounds[:-1]:
        # 2 phi - (phi - atan(b/a tan phi)): the difference stays on the branch of phi
        phi = 2 * phi - np.arctan2((a - b) * s * c, a * c * c + b * s * s)
        size = np.hypot(b * s, a * c)
        safe = np.where(size > 0, size, 1)
        s, c = (a + b) * s * c / safe, (a * c * c - b * s * s) / safe
    mean = rounds[-1][0] * np.longdouble(2) ** (len(rounds) - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        endless = np.arcsinh(np.where(edge, sine, 0) / np.where(edge, cosine, 1))
    return np.asarray(np.where(edge, endless, phi / mean))


def latency(m1: Extended) -> Extended:
    """Bound on F(phi | m) up to a quarter turn, for any phi that this precision distinguishes from it."""
    return np.asarray(2 + np.log(16 / np.maximum(np.abs(m1), EPS**4)) / 2)
