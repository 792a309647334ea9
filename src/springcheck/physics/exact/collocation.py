"""Collocation at the nodes of Radau IIA: its coefficients, and the Legendre series of a step."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from springcheck.physics.arrays import Extended, by_identity, wide
from springcheck.physics.exact.digits import digits, exactly, extended

RULE_DIGITS = 50


@by_identity
class Rule(NamedTuple):
    """Nodes c (s,) on [0, 1]; A and A A (s, s), their last rows as a sum of two numbers (2, s); and the
    matrix from values at the nodes to Legendre coefficients (s, s)."""

    c: Extended
    a: Extended
    aa: Extended
    end: Extended
    end_twice: Extended
    series: Extended


def legendre(x: Any, count: int) -> Any:
    """P_0 to P_(count - 1) at x (r,) -> (r, count), in the arithmetic of x."""
    found = [x * 0 + 1, x]
    for j in range(1, count - 1):
        found.append(((2 * j + 1) * x * found[j] - j * found[j - 1]) / (j + 1))
    return np.stack(found[:count], axis=-1)


def integrals(x: Any, count: int) -> Any:
    """Their integrals from -1 to x, halved for a step of length 1 (r, count)."""
    p = legendre(x, count + 1)
    each = [(p[:, j + 1] - p[:, j - 1]) / (2 * (2 * j + 1)) for j in range(1, count)]
    return np.stack([(x + 1) / 2, *each], axis=-1)


def _parts(x: Any) -> Extended:
    """Decimal numbers as a sum of two extended ones (2, ...)."""
    high = extended(x)
    return np.stack([high, extended(x - exactly(high))])


@cache
def rule(s: int) -> Rule:
    """Radau IIA with s stages, computed in decimals."""
    with digits(RULE_DIGITS):
        # all nodes but the last are zeros of a Jacobi polynomial: eigenvalues of a symmetric matrix
        k = np.arange(s - 1)
        jacobi = np.diag(-1 / ((2 * k + 1) * (2 * k + 3)))
        jacobi += np.diag((np.sqrt(k * (k + 1)) / (2 * k + 1))[1:], -1)
        x = exactly(np.append(np.linalg.eigvalsh(jacobi), 1.0))
        for _ in range(3):
            y = x[:-1]
            p = legendre(y, s + 1)
            # (x**2 - 1) P_n' = n (x P_n - P_(n-1))
            one, other = (n * (y * p[:, n] - p[:, n - 1]) / (y * y - 1) for n in (s, s - 1))
            x[:-1] = y - (p[:, s] - p[:, s - 1]) / (one - other)
        p = legendre(x, s)
        series = exactly(np.linalg.inv(p.astype(np.float64)))
        for _ in range(3):
            series = series @ (2 * exactly(np.eye(s)) - p @ series)
        a = integrals(x, s) @ series
        twice = a @ a
        return Rule(
            extended((1 + x) / 2), extended(a), extended(twice), _parts(a[-1]), _parts(twice[-1]),
            extended(series),
        )  # fmt: skip


@cache
def onward(s: int, powers: int) -> Extended:
    """Matrix (s, s) from the series of a step to values at the nodes of the next, 2**powers as long."""
    return wide(legendre(1 + 2 * rule(s).c * np.longdouble(2.0) ** powers, s))
