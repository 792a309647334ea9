"""The loops of the own methods: plain Python that runs interpreted or compiled, bit for bit the same.

Interpreted, rows of numbers are lists (Python's floats neither warn nor raise when they overflow);
compiled, they are arrays.  So no loop may contain what rounds or fails differently there: + - * / in a
fixed order, no division by what may be 0, and the C library's sine and exponential within their range.

A step is a list of operations (see `operations`).  `splitting` carries out any such list and `tableau`
any explicit Runge-Kutta tableau, by any force; `one_splitting` and `one_tableau` do the same for a single
particle on one spring at rest in 0, whose state stays in two registers.  Every kernel fills row after row
of qs and ps (f, n) with the state `every` steps later.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from springcheck.engines.own.forces import Numbers, Slot, force_at, tensions

Rows: TypeAlias = Any
"""A list of lists, or a two-dimensional array; qs and ps are always arrays (f, n)."""
Solver: TypeAlias = Any
"""The factors of an implicit step: see `solve`."""

KICK, DRIFT, KICK_DRIFT, EULER, FRICTION, IMPLICIT, MIDPOINT = range(7)
"""Operations on (q, p), with coefficients x and y in units of time:

KICK        p += x F            EULER       KICK and DRIFT, both from the old state
DRIFT       q += y p/m          IMPLICIT    P = p + x F(Q, P), Q = q + x P/m; q = q + y P/m, p = P
KICK_DRIFT  one after the other MIDPOINT    the same, but p = P + (P - p)
FRICTION    p *= decay
"""


def kick(x: float, f: Numbers, p: Numbers) -> None:
    """p += x f."""
    for i in range(len(p)):
        p[i] = p[i] + f[i] * x


def drift(y: float, m: Numbers, q: Numbers, p: Numbers) -> None:
    """q += y p/m."""
    for i in range(len(p)):
        q[i] = q[i] + (p[i] / m[i]) * y


def kick_drift(x: float, y: float, f: Numbers, m: Numbers, q: Numbers, p: Numbers) -> None:
    """Kick, then drift with the new momentum."""
    for i in range(len(p)):
        new = p[i] + f[i] * x
        p[i] = new
        q[i] = q[i] + (new / m[i]) * y


def euler(x: float, y: float, f: Numbers, m: Numbers, q: Numbers, p: Numbers) -> None:
    """Drift and kick, both from the old state."""
    for i in range(len(p)):
        old = p[i]
        p[i] = old + f[i] * x
        q[i] = q[i] + (old / m[i]) * y


def held_kick_drift(x: float, y: float, k: Numbers, at: Numbers, m: Numbers, q: Numbers, p: Numbers) -> None:
    """`kick_drift` by one wall spring on every particle, whose force is not stored."""
    for i in range(len(p)):
        new = p[i] + (-k[i] * (q[i] - at[i])) * x
        p[i] = new
        q[i] = q[i] + (new / m[i]) * y


def held_euler(x: float, y: float, k: Numbers, at: Numbers, m: Numbers, q: Numbers, p: Numbers) -> None:
    """`euler` by one wall spring on every particle, whose force is not stored."""
    for i in range(len(p)):
        old = p[i]
        p[i] = old + (-k[i] * (q[i] - at[i])) * x
        q[i] = q[i] + (old / m[i]) * y


def chain_kick_drift(x: float, y: float, t: Numbers, m: Numbers, q: Numbers, p: Numbers) -> None:
    """`kick_drift` by the tensions of a chain."""
    for i in range(len(p)):
        new = p[i] + (t[i + 1] - t[i]) * x
        p[i] = new
        q[i] = q[i] + (new / m[i]) * y


def chain_euler(x: float, y: float, t: Numbers, m: Numbers, q: Numbers, p: Numbers) -> None:
    """`euler` by the tensions of a chain."""
    for i in range(len(p)):
        old = p[i]
        p[i] = old + (t[i + 1] - t[i]) * x
        q[i] = q[i] + (old / m[i]) * y


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


def splitting(
    every: int,
    code: Numbers,
    slot: Numbers,
    x: Numbers,
    y: Numbers,
    damped: Numbers,
    decay: Rows,
    one: Slot,
    two: Slot,
    solver: Solver,
    m: Numbers,
    f_one: Numbers,
    f_two: Numbers,
    t: Numbers,
    stale: Numbers,
    q: Numbers,
    p: Numbers,
    skip: int,
    qs: Rows,
    ps: Rows,
) -> None:
    """Any list of operations; operation s kicks by the force of slot[s], with coefficients x[s] and y[s].

    A force is evaluated again only when the state that it belongs to has moved: `damped` says of each
    slot whether it depends on p, `stale` carries this over from call to call.  Rows of the result leave
    out the first `skip` particles.
    """
    n = len(m)
    for row in range(len(qs)):
        for _ in range(every):
            for s in range(len(code)):
                what = code[s]
                if what == FRICTION:
                    decayed = decay[slot[s]]
                    for i in range(n):
                        p[i] = p[i] * decayed[i]
                elif what == DRIFT:
                    drift(y[s], m, q, p)
                else:
                    force, f = (one, f_one) if slot[s] == 0 else (two, f_two)
                    if what == KICK:
                        if stale[slot[s]]:
                            force_at(force, q, p, t, f)
                        kick(x[s], f, p)
                    elif what in (KICK_DRIFT, EULER):
                        kick_and_drift(what == EULER, stale[slot[s]], x[s], y[s], force, m, f, t, q, p)
                    else:
                        force_at(force, q, p, t, f)
                        implicit(x[s], y[s], what == MIDPOINT, solver, f, m, q, p)
                    stale[slot[s]] = False
                moved = what not in (KICK, FRICTION)
                stale[0] = stale[0] or moved or damped[0]
                stale[1] = stale[1] or moved or damped[1]
        out_q, out_p = qs[row], ps[row]
        for i in range(len(out_q)):
            out_q[i] = q[skip + i]
            out_p[i] = p[skip + i]


def kick_and_drift(
    both: bool,
    stale: bool,
    x: float,
    y: float,
    force: Slot,
    m: Numbers,
    f: Numbers,
    t: Numbers,
    q: Numbers,
    p: Numbers,
) -> None:
    """KICK_DRIFT, or EULER where `both` are from the old state.  The force of a simple row is not stored."""
    indices, _, (k_held, at_held), (k, rest, ends), (c, _) = force
    simple = stale and not indices and len(c) == 0
    if simple and len(k) == 0 and len(k_held):
        if both:
            held_euler(x, y, k_held, at_held, m, q, p)
        else:
            held_kick_drift(x, y, k_held, at_held, m, q, p)
    elif simple and len(k) and len(k_held) == 0:
        tensions(k, rest, ends, q, t)
        if both:
            chain_euler(x, y, t, m, q, p)
        else:
            chain_kick_drift(x, y, t, m, q, p)
    else:
        if stale:
            force_at(force, q, p, t, f)
        if both:
            euler(x, y, f, m, q, p)
        else:
            kick_drift(x, y, f, m, q, p)


def tableau(
    every: int,
    a: Rows,
    b: Numbers,
    one: Slot,
    m: Numbers,
    v: Rows,
    f: Rows,
    u: Numbers,
    w: Numbers,
    t: Numbers,
    q: Numbers,
    p: Numbers,
    skip: int,
    qs: Rows,
    ps: Rows,
) -> None:
    """Any explicit tableau: stages (q + sum a v, p + sum a f), then the same sums by the weights b.

    a (s, s) and b (s,) hold coefficients times the step; v, f (s, n) velocities and forces of the stages,
    u and w (n,) the stage that is being formed.
    """
    n = len(m)
    for row in range(len(qs)):
        for _ in range(every):
            for s in range(len(b)):
                for i in range(n):
                    u[i] = q[i]
                    w[i] = p[i]
                for r in range(s):
                    add(a[s][r], v[r], u)
                    add(a[s][r], f[r], w)
                force_at(one, u, w, t, f[s])
                velocity = v[s]
                for i in range(n):
                    velocity[i] = w[i] / m[i]
            for s in range(len(b)):
                add(b[s], v[s], q)
                add(b[s], f[s], p)
        out_q, out_p = qs[row], ps[row]
        for i in range(len(out_q)):
            out_q[i] = q[skip + i]
            out_p[i] = p[skip + i]


def add(c: float, values: Numbers, total: Numbers) -> None:
    """total += c values, left out where c is 0."""
    if c != 0.0:
        for i in range(len(total)):
            total[i] = total[i] + c * values[i]


def one_splitting(
    every: int,
    code: Numbers,
    x: Numbers,
    y: Numbers,
    divisor: float,
    m: float,
    k: float,
    q: float,
    p: float,
    qs: Rows,
    ps: Rows,
) -> tuple[float, float]:
    """`splitting` of one particle on one spring; returns its last state."""
    for row in range(len(qs)):
        for _ in range(every):
            for s in range(len(code)):
                what = code[s]
                if what == KICK_DRIFT:
                    p = p + (-k * q) * x[s]
                    q = q + (p / m) * y[s]
                elif what == KICK:
                    p = p + (-k * q) * x[s]
                elif what == DRIFT:
                    q = q + (p / m) * y[s]
                elif what == EULER:
                    q, p = q + (p / m) * y[s], p + (-k * q) * x[s]
                elif what == IMPLICIT:
                    p = (p + (-k * q) * x[s]) * divisor
                    q = q + (p / m) * y[s]
                elif what == MIDPOINT:
                    old = p
                    p = (p + (-k * q) * x[s]) * divisor
                    q = q + (p / m) * y[s]
                    p = p + (p - old)
        qs[row, 0] = q
        ps[row, 0] = p
    return q, p


def one_tableau(
    every: int,
    a: Rows,
    b: Numbers,
    v: Numbers,
    f: Numbers,
    m: float,
    k: float,
    q: float,
    p: float,
    qs: Rows,
    ps: Rows,
) -> tuple[float, float]:
    """`tableau` of one particle on one spring; returns its last state."""
    for row in range(len(qs)):
        for _ in range(every):
            for s in range(len(b)):
                u, w = q, p
                for r in range(s):
                    c = a[s][r]
                    if c != 0.0:
                        u = u + c * v[r]
                        w = w + c * f[r]
                v[s] = w / m
                f[s] = -k * u
            for s in range(len(b)):
                if b[s] != 0.0:
                    q = q + b[s] * v[s]
                    p = p + b[s] * f[s]
        qs[row, 0] = q
        ps[row, 0] = p
    return q, p
