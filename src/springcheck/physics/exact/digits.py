"""Decimal arithmetic for the few sums whose cancellation decides a motion: near barriers, and in stiff modes.

The numbers are `decimal` numbers of the standard library in arrays of objects: doubles convert exactly, and
+, -, *, /, np.sqrt and np.exp are correctly rounded to `DIGITS`.  A formula is written once, for these and
for extended precision.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from decimal import Context, Decimal, localcontext
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck.physics.arrays import Extended

Wide: TypeAlias = NDArray[np.object_]
"""An array of Decimal numbers."""

DIGITS = 420
"""Digits for sums of products of doubles that differ by 300 decades."""

FEWER_DIGITS = 57
"""Digits where all numbers are within 17 decades of the largest: three words of libmpdec."""


@contextmanager
def digits(count: int = DIGITS) -> Iterator[None]:
    """Compute with so many digits."""
    with localcontext(Context(prec=count, Emax=999_999, Emin=-999_999, traps=[])):
        yield


def exactly(x: Any) -> Wide:
    """Convert doubles or extended numbers exactly."""
    given = np.asarray(x)
    out = np.empty(given.shape, dtype=object)
    for i, value in np.ndenumerate(given):
        high = float(value)
        # the part of an extended number beyond a double is itself a double, or 0
        out[i] = (
            Decimal(high) + Decimal(float(value - high)) if given.dtype == np.longdouble else Decimal(high)
        )
    return out


def extended(x: Wide) -> Extended:
    """Rounded to extended precision."""
    return np.array([np.longdouble(f"{value:.30e}") for value in x.flat], np.longdouble).reshape(x.shape)


def eigen(symmetric: Wide, count: int = FEWER_DIGITS) -> tuple[Wide, Wide]:
    """Eigenvalues (n,) and eigenvectors (n, n), columns, of a symmetric matrix, by Jacobi's rotations (1846).

    Their errors are 10**-count of the largest eigenvalue.  They start from vectors in double precision, and
    take 1e-5 n**3 seconds with FEWER_DIGITS.
    """
    n = len(symmetric)
    size = np.max(np.abs(symmetric)) or Decimal(1)
    limit = size * Decimal(10) ** (5 - count)
    with digits(count):
        _, start = np.linalg.eigh((symmetric / size).astype(np.float64))
        turn = exactly(start)
        for _ in range(2 + (count // FEWER_DIGITS).bit_length()):
            # Newton's iteration for the nearest orthogonal matrix: 1e-16, 1e-32, 1e-64, and beyond
            turn = turn @ (3 * exactly(np.eye(n)) - turn.T @ turn) / 2
        a = turn.T @ symmetric @ turn
        rotated = True
        while rotated:
            rotated = False
            for i in range(n - 1):
                for j in np.flatnonzero(np.abs(a[i, i + 1 :]) > limit) + i + 1:
                    rotated = True
                    zeta = (a[j, j] - a[i, i]) / (2 * a[i, j])
                    t = 1 / (abs(zeta) + (1 + zeta * zeta).sqrt()).copy_sign(zeta)
                    cosine = 1 / (1 + t * t).sqrt()
                    sine = cosine * t
                    change = t * a[i, j]
                    low, high = a[i, i] - change, a[j, j] + change
                    for of in (a, turn):
                        x, y = of[:, i].copy(), of[:, j].copy()
                        of[:, i], of[:, j] = cosine * x - sine * y, sine * x + cosine * y
                    a[i, j] = a[j, i] = Decimal(0)
                    a[i, i], a[j, j] = low, high
                    a[i], a[j] = a[:, i], a[:, j]
    return np.diag(a).copy(), turn
