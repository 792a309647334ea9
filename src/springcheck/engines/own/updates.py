"""What moves a state: loops over all particles for one operation of a step (see `kernels`)."""

from __future__ import annotations

from typing import Any, TypeAlias

from springcheck.engines.own.forces import Numbers

Solver: TypeAlias = Any
"""The factors of an implicit step: see `solve`."""


def kick(x: float, f: Numbers, p: Numbers) -> None:
    """p += x f."""
    for i in range(len(p)):
        p[i] = p[i] + f[i] * x


def drift(y: float, m: Numbers, q: Numbers, p: Numbers) -> None:
    """q += y p/m."""
    for i in range(len(p)):
        q[i] = q[i] + (p[i] / m[i]) * y


def kick_drift(x: float, y: float, euler: bool, f: Numbers, m: Numbers, q: Numbers, p: Numbers) -> None:
    """Kick, then drift with the new momentum, or with the old one for explicit Euler."""
    for i in range(len(p)):
        old = p[i]
        new = old + f[i] * x
        p[i] = new
        q[i] = q[i] + ((old if euler else new) / m[i]) * y


def held_kick_drift(
    x: float, y: float, euler: bool, k: Numbers, at: Numbers, m: Numbers, q: Numbers, p: Numbers
) -> None:
    """`kick_drift` by one wall spring on every particle, whose force is not stored."""
    for i in range(len(p)):
        old = p[i]
        new = old + (-k[i] * (q[i] - at[i])) * x
        p[i] = new
        q[i] = q[i] + ((old if euler else new) / m[i]) * y


def chain_kick_drift(x: float, y: float, euler: bool, t: Numbers, m: Numbers, q: Numbers, p: Numbers) -> None:
    """`kick_drift` by the tensions of a chain."""
    for i in range(len(p)):
        old = p[i]
        new = old + (t[i + 1] - t[i]) * x
        p[i] = new
        q[i] = q[i] + ((old if euler else new) / m[i]) * y


def solve(solver: Solver, f: Numbers) -> None:
    """Solve A z = f in place, A = 1 + x c/m + x**2 K/m by its factors, which are of one of three kinds.

    divisors      1 / A of particles that nothing joins
    tridiagonal   multipliers of the rows before, 1 / pivots, elements to the right of the diagonal
    banded        LU factors as LAPACK's dgbtrf stores them (Anderson et al., LAPACK Users' Guide, 1999),
                  transposed (n, 2 lower + upper + 1) and with 1 / pivots; the interchanges of its pivoting,
                  the order in which it takes the particles, room (n,), and the number `lower`
    """
    divisors, (below, inverse, above), (band, swaps, order, z, lower) = solver
    n = len(f)
    if len(divisors):
        for i in range(n):
            f[i] = f[i] * divisors[i]
    elif len(inverse):
        last = 0.0
        for i in range(n):
            last = f[i] - below[i] * last
            f[i] = last
        last = 0.0
        for i in range(n - 1, -1, -1):
            last = (f[i] - above[i] * last) * inverse[i]
            f[i] = last
    else:
        for j in range(n):
            z[j] = f[order[j]]
        for j in range(n):
            last = z[swaps[j]]
            z[swaps[j]] = z[j]
            z[j] = last
            column = band[j]
            diagonal = len(column) - 1 - lower
            for i in range(1, min(lower, n - 1 - j) + 1):
                z[j + i] -= column[diagonal + i] * last
        for j in range(n - 1, -1, -1):
            column = band[j]
            diagonal = len(column) - 1 - lower
            last = z[j] * column[diagonal]
            z[j] = last
            for i in range(1, min(diagonal, j) + 1):
                z[j - i] -= column[diagonal - i] * last
        for j in range(n):
            f[order[j]] = z[j]


def held_implicit(
    x: float,
    y: float,
    twice: bool,
    divisors: Numbers,
    k: Numbers,
    at: Numbers,
    m: Numbers,
    q: Numbers,
    p: Numbers,
) -> None:
    """`implicit` by one wall spring on every particle."""
    for i in range(len(p)):
        new = (p[i] + (-k[i] * (q[i] - at[i])) * x) * divisors[i]
        q[i] = q[i] + (new / m[i]) * y
        p[i] = new + (new - p[i]) if twice else new


def chain_implicit(
    x: float, y: float, twice: bool, factors: Any, t: Numbers, f: Numbers, m: Numbers, q: Numbers, p: Numbers
) -> None:
    """`implicit` by the tensions of a chain."""
    below, inverse, above = factors
    last = 0.0
    for i in range(len(p)):
        last = (p[i] + (t[i + 1] - t[i]) * x) - below[i] * last
        f[i] = last
    last = 0.0
    for i in range(len(p) - 1, -1, -1):
        last = (f[i] - above[i] * last) * inverse[i]
        q[i] = q[i] + (last / m[i]) * y
        p[i] = last + (last - p[i]) if twice else last


def implicit(
    x: float, y: float, twice: bool, solver: Solver, f: Numbers, m: Numbers, q: Numbers, p: Numbers
) -> None:
    """IMPLICIT, or MIDPOINT where `twice`; f holds F(q, 0) and serves as room."""
    for i in range(len(p)):
        f[i] = p[i] + f[i] * x
    solve(solver, f)
    for i in range(len(p)):
        new = f[i]
        q[i] = q[i] + (new / m[i]) * y
        p[i] = new + (new - p[i]) if twice else new


def add(c: float, values: Numbers, total: Numbers) -> None:
    """total += c values, left out where c is 0."""
    if c != 0.0:
        for i in range(len(total)):
            total[i] = total[i] + c * values[i]
