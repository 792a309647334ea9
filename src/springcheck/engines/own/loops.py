"""The loops that the kernels call: forces by index lists of any term, or along a row; and what moves a state.

See `kernels` for the rules that every loop here keeps.  A row is what needs no index: one wall spring on
every particle, or walls at its ends alone; springs between neighbours, or none; friction.

To add a term: write its loop in `indexed`, and name it in `KINDS`.  Others are compiled from their
classes (`laws`).
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

Numbers: TypeAlias = Any
"""A list of numbers, or a one-dimensional array of them."""
Slot: TypeAlias = Any
"""A force: whether by index, the index lists of each kind of term, and the parts of a row, empty where there
is nothing: (k, at) of a wall spring on every particle, (k, rest, walls at both ends) of a chain, (c, m) of
friction."""

Solver: TypeAlias = Any
"""The factors of an implicit step: see `solve`."""

KINDS = (
    "wall-spring", "spring", "quartic", "cosine", "weight", "morse", "damping", "van-der-pol", "drive",
)  # fmt: skip
"""The terms that the loops have, in the order in which `indexed` takes them."""

INFINITE = math.inf
LARGEST_EXPONENT = 709.782712893384
"""exp overflows above."""


def sine(x: float) -> float:
    """sin(x) of the C library; not a number where x is infinite."""
    return math.sin(x) if -INFINITE < x < INFINITE else INFINITE - INFINITE


def cosine(x: float) -> float:
    """cos(x) of the C library; not a number where x is infinite."""
    return math.cos(x) if -INFINITE < x < INFINITE else INFINITE - INFINITE


def exponential(x: float) -> float:
    """exp(x) of the C library; infinite where it overflows."""
    return INFINITE if x > LARGEST_EXPONENT else math.exp(x)


def indexed(terms: Any, q: Numbers, p: Numbers, f: Numbers) -> None:
    """Fill f with the force of index lists: summed over the terms in this order, then over each list.

    A driven term reads the time from the last coordinate.  It is summed in NumPy's order: over all ends a,
    then over all ends b.
    """
    walls, springs, quartics, cosines, weights, morses, dampings, brakes, drives, laws = terms
    driven = len(drives[0]) > 0
    for j in range(len(f)):
        f[j] = 0.0
    i, k, at = walls
    for s in range(len(i)):
        f[i[s]] += -k[s] * (q[i[s]] - at[s])
    a, b, k, rest = springs
    for s in range(len(a)):
        tension = k[s] * (q[b[s]] - q[a[s]] - rest[s])
        f[a[s]] += tension
        if not driven:
            f[b[s]] -= tension
    if driven:
        for s in range(len(a)):
            f[b[s]] -= k[s] * (q[b[s]] - q[a[s]] - rest[s])
    i, k, at = quartics
    for s in range(len(i)):
        u = q[i[s]] - at[s]
        f[i[s]] += -k[s] * (u * u * u)
    i, depth, wave, at = cosines
    for s in range(len(i)):
        f[i[s]] += -(depth[s] * wave[s]) * sine(wave[s] * (q[i[s]] - at[s]))
    i, force, _ = weights
    for s in range(len(i)):
        f[i[s]] += force[s]
    a, b, depth, steepness, rest = morses
    for s in range(len(a)):
        x = exponential(-steepness[s] * (q[b[s]] - q[a[s]] - rest[s]))
        tension = 2.0 * depth[s] * steepness[s] * x * (1.0 - x)
        f[a[s]] += tension
        f[b[s]] -= tension
    others(laws, q, f)
    i, c, m = dampings
    for s in range(len(i)):
        f[i[s]] += -c[s] * (p[i[s]] / m[s])
    i, c, width, at, m = brakes
    for s in range(len(i)):
        x = (q[i[s]] - at[s]) / width[s]
        f[i[s]] -= c[s] * ((x - 1.0) * (x + 1.0)) * (p[i[s]] / m[s])
    i, amplitude, frequency, phase = drives
    for s in range(len(i)):
        f[i[s]] += amplitude[s] * cosine(frequency[s] * q[len(q) - 1] + phase[s])


def others(laws: Any, q: Numbers, f: Numbers) -> None:
    """Add the forces of the terms of `laws` to f; compiled without any it is `none`."""
    for ends, firsts, x, pull in laws:
        pull(ends, firsts, x, q, f)


def none(laws: Any, q: Numbers, f: Numbers) -> None:
    """Nothing: a loop over no pointer has no type."""


def held(k: Numbers, at: Numbers, q: Numbers, f: Numbers) -> None:
    """Fill f with the force of one wall spring on every particle."""
    for i in range(len(f)):
        f[i] = -k[i] * (q[i] - at[i])


def tensions(k: Numbers, rest: Numbers, ends: Numbers, q: Numbers, t: Numbers) -> None:
    """Fill t (n+1,) with the tension before each particle of a chain, and behind the last.

    `ends` are stiffness and place of the walls on both sides, the former 0 where there is none.
    """
    t[0] = ends[0] * (q[0] - ends[1])
    t[len(q)] = -ends[2] * (q[len(q) - 1] - ends[3])
    for i in range(len(k)):
        t[i + 1] = k[i] * (q[i + 1] - q[i] - rest[i])


def pulled(t: Numbers, f: Numbers) -> None:
    """Fill f with the pull of the neighbours on every particle."""
    for i in range(len(f)):
        f[i] = t[i + 1] - t[i]


def pulled_too(t: Numbers, f: Numbers) -> None:
    """Add the pull of the neighbours to f."""
    for i in range(len(f)):
        f[i] = (f[i] - t[i]) + t[i + 1]


def slowed(c: Numbers, m: Numbers, p: Numbers, f: Numbers) -> None:
    """Add friction to f."""
    for i in range(len(f)):
        f[i] += -c[i] * (p[i] / m[i])


def force_at(slot: Slot, q: Numbers, p: Numbers, t: Numbers, f: Numbers) -> None:
    """Fill f with the force at (q, p)."""
    indices, terms, (k_held, at_held), (k, rest, ends), (c, m) = slot
    if indices:
        indexed(terms, q, p, f)
        return
    if len(k_held):
        held(k_held, at_held, q, f)
    if len(k):
        tensions(k, rest, ends, q, t)
        if len(k_held):
            pulled_too(t, f)
        else:
            pulled(t, f)
    elif len(k_held) == 0:
        for i in range(len(f)):
            f[i] = 0.0
    if len(c):
        slowed(c, m, p, f)


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
