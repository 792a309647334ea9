"""The loops of the own methods: plain Python that runs interpreted or compiled, bit for bit the same.

Interpreted, the rows `m, k, q, p ...` are lists of floats (Python's floats neither warn nor raise when
they overflow); compiled, they are arrays.  So no kernel may contain what rounds or fails differently
there: only + - * / on floats, in a fixed order, and no division by anything but a mass.

Every kernel takes `(every, h, *constants, q, p, qs, ps)`, fills row after row of qs and ps (f, n) with
the state `every` steps later, and returns the last state.  There are four layouts:

one     a single particle on one spring at rest in 0; its state stays in two registers
many    particles side by side, each on one wall spring: n systems in one
joined  any terms; forces are summed over the terms in the order of `forces`, then over each term's list
chain   springs between neighbours, for implicit Euler: its equations are tridiagonal then

To add a term to `joined`: write its loop, add it to `HELPERS` and `forces`, and name its fields in
`simulation.FIELDS`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

Row: TypeAlias = Any
"""A list of numbers, or a one-dimensional array of them."""
Rows: TypeAlias = Any
"""A list of lists, or a two-dimensional array; qs and ps are always arrays (f, n)."""
Terms: TypeAlias = Any
"""One tuple of rows for each kind of term, in the order of `simulation.FIELDS`."""
State: TypeAlias = Any
Kernel: TypeAlias = Callable[..., State]

FLAGS = {"error_model": "numpy"}
"""How numba compiles: division by zero gives inf instead of an exception, and there is no fastmath, which
would contract and reorder.  They stand in this file because numba takes saved code for its own as long
as this file has not changed, whatever the flags.
"""

BLOCK = 512
"""Particles of `many` that are carried through all steps before the next ones: 5 rows of 4 KiB stay in
the first-level cache.  They do not act on each other, so the order changes no number.  The rows of
`many` are therefore cut into blocks of equal width, (blocks, width), the last one padded; and indices
count from 0 within a block, because LLVM vectorises no loop in which an index might be negative."""


def one_euler(every: int, h: float, m: float, k: float, q: float, p: float, qs: Rows, ps: Rows) -> State:
    """Explicit Euler: both from the old state."""
    for row in range(len(qs)):
        for _ in range(every):
            q, p = q + (p / m) * h, p + (-k * q) * h
        qs[row, 0] = q
        ps[row, 0] = p
    return q, p


def one_semi_implicit_euler(
    every: int, h: float, m: float, k: float, q: float, p: float, qs: Row, ps: Row
) -> State:
    """Semi-implicit Euler: kick, then drift with the new momentum."""
    for row in range(len(qs)):
        for _ in range(every):
            p = p + (-k * q) * h
            q = q + (p / m) * h
        qs[row, 0] = q
        ps[row, 0] = p
    return q, p


def one_implicit_euler(
    every: int, h: float, m: float, k: float, inverse: float, q: float, p: float, qs: Row, ps: Row
) -> State:
    """Implicit Euler: p' = (p + h F(q)) / (1 + h**2 k/m), then drift; `inverse` is 1 over the divisor."""
    for row in range(len(qs)):
        for _ in range(every):
            p = (p + (-k * q) * h) * inverse
            q = q + (p / m) * h
        qs[row, 0] = q
        ps[row, 0] = p
    return q, p


def many_euler(
    every: int, h: float, m: Rows, k: Rows, at: Rows, q: Rows, p: Rows, qs: Rows, ps: Rows
) -> State:
    """Explicit Euler of independent wall springs."""
    for block in range(len(m)):
        mb, kb, ab, qb, pb = m[block], k[block], at[block], q[block], p[block]
        first = block * len(mb)
        for row in range(len(qs)):
            for _ in range(every):
                for i in range(len(mb)):
                    x = qb[i]
                    qb[i] = x + (pb[i] / mb[i]) * h
                    pb[i] = pb[i] + (-kb[i] * (x - ab[i])) * h
            out_q, out_p = qs[row, first : first + len(mb)], ps[row, first : first + len(mb)]
            for i in range(len(out_q)):
                out_q[i] = qb[i]
                out_p[i] = pb[i]
    return q, p


def many_semi_implicit_euler(
    every: int, h: float, m: Rows, k: Rows, at: Rows, q: Rows, p: Rows, qs: Rows, ps: Rows
) -> State:
    """Semi-implicit Euler of independent wall springs."""
    for block in range(len(m)):
        mb, kb, ab, qb, pb = m[block], k[block], at[block], q[block], p[block]
        first = block * len(mb)
        for row in range(len(qs)):
            for _ in range(every):
                for i in range(len(mb)):
                    x = pb[i] + (-kb[i] * (qb[i] - ab[i])) * h
                    pb[i] = x
                    qb[i] = qb[i] + (x / mb[i]) * h
            out_q, out_p = qs[row, first : first + len(mb)], ps[row, first : first + len(mb)]
            for i in range(len(out_q)):
                out_q[i] = qb[i]
                out_p[i] = pb[i]
    return q, p


def many_implicit_euler(
    every: int, h: float, m: Rows, k: Rows, at: Rows, inverse: Rows, q: Rows, p: Rows, qs: Rows, ps: Rows
) -> State:
    """Implicit Euler of independent wall springs, each as in `one_implicit_euler`."""
    for block in range(len(m)):
        mb, kb, ab, qb, pb = m[block], k[block], at[block], q[block], p[block]
        db = inverse[block]
        first = block * len(mb)
        for row in range(len(qs)):
            for _ in range(every):
                for i in range(len(mb)):
                    x = (pb[i] + (-kb[i] * (qb[i] - ab[i])) * h) * db[i]
                    pb[i] = x
                    qb[i] = qb[i] + (x / mb[i]) * h
            out_q, out_p = qs[row, first : first + len(mb)], ps[row, first : first + len(mb)]
            for i in range(len(out_q)):
                out_q[i] = qb[i]
                out_p[i] = pb[i]
    return q, p


def wall_springs(i: Row, k: Row, at: Row, q: Row, f: Row) -> None:
    """Add -k (q - at) to f."""
    for s in range(len(i)):
        f[i[s]] += -k[s] * (q[i[s]] - at[s])


def springs(a: Row, b: Row, k: Row, rest: Row, q: Row, f: Row) -> None:
    """Add the tension k (q[b] - q[a] - rest) to f[a] and take it from f[b]."""
    for s in range(len(a)):
        tension = k[s] * (q[b[s]] - q[a[s]] - rest[s])
        f[a[s]] += tension
        f[b[s]] -= tension


def quartics(i: Row, b: Row, at: Row, q: Row, f: Row) -> None:
    """Add -b (q - at)**3 to f."""
    for s in range(len(i)):
        u = q[i[s]] - at[s]
        f[i[s]] += -b[s] * (u * u * u)


def dampings(i: Row, c: Row, m: Row, p: Row, f: Row) -> None:
    """Add -c p/m to f."""
    for s in range(len(i)):
        f[i[s]] += -c[s] * (p[i[s]] / m[s])


def forces(terms: Terms, q: Row, p: Row, f: Row) -> None:
    """Fill f with the force on every particle."""
    walls, pairs, wells, brakes = terms
    for i in range(len(f)):
        f[i] = 0.0
    wall_springs(walls[0], walls[1], walls[2], q, f)
    springs(pairs[0], pairs[1], pairs[2], pairs[3], q, f)
    quartics(wells[0], wells[1], wells[2], q, f)
    dampings(brakes[0], brakes[1], brakes[2], p, f)


def joined_euler(
    every: int, h: float, m: Row, terms: Terms, f: Row, q: Row, p: Row, qs: Row, ps: Row
) -> State:
    """Explicit Euler of any terms."""
    for row in range(len(qs)):
        for _ in range(every):
            forces(terms, q, p, f)
            for i in range(len(m)):
                q[i] = q[i] + (p[i] / m[i]) * h
                p[i] = p[i] + f[i] * h
        for i in range(len(m)):
            qs[row, i] = q[i]
            ps[row, i] = p[i]
    return q, p


def joined_semi_implicit_euler(
    every: int, h: float, m: Row, terms: Terms, f: Row, q: Row, p: Row, qs: Row, ps: Row
) -> State:
    """Semi-implicit Euler of any terms."""
    for row in range(len(qs)):
        for _ in range(every):
            forces(terms, q, p, f)
            for i in range(len(m)):
                x = p[i] + f[i] * h
                p[i] = x
                q[i] = q[i] + (x / m[i]) * h
        for i in range(len(m)):
            qs[row, i] = q[i]
            ps[row, i] = p[i]
    return q, p


def joined_implicit_euler(
    every: int, h: float, m: Row, terms: Terms, f: Row, inverse: Rows, q: Row, p: Row, qs: Row, ps: Row
) -> State:
    """Implicit Euler of linear terms: p' = inverse (p + h F(q)), then drift.

    `terms` hold no friction here: it is in the matrix.  `inverse` holds the columns of
    (1 + h c/m + h**2 K / m)**-1.  Column by column every p[i] is summed in the
    same order as in a row-wise product, and the inner loop is free of dependences.
    """
    for row in range(len(qs)):
        for _ in range(every):
            forces(terms, q, p, f)
            for i in range(len(m)):
                f[i] = p[i] + f[i] * h
                p[i] = 0.0
            for j in range(len(m)):
                column = inverse[j]
                x = f[j]
                for i in range(len(m)):
                    p[i] += column[i] * x
            for i in range(len(m)):
                q[i] = q[i] + (p[i] / m[i]) * h
        for i in range(len(m)):
            qs[row, i] = q[i]
            ps[row, i] = p[i]
    return q, p


def chain_implicit_euler(
    every: int,
    h: float,
    m: Row,
    terms: Terms,
    f: Row,
    lower: Row,
    inverse: Row,
    upper: Row,
    q: Row,
    p: Row,
    qs: Rows,
    ps: Rows,
) -> State:
    """Implicit Euler of neighbours: (1 + h**2 K / m) p' = p + h F(q) by its LU factors, then drift.

    `lower` are the multipliers of the rows before, `inverse` 1 over the pivots, `upper` the elements to
    the right of the diagonal.
    """
    for row in range(len(qs)):
        for _ in range(every):
            forces(terms, q, p, f)
            x = 0.0
            for i in range(len(m)):
                x = (p[i] + f[i] * h) - lower[i] * x
                f[i] = x
            x = 0.0
            for i in range(len(m) - 1, -1, -1):
                x = (f[i] - upper[i] * x) * inverse[i]
                p[i] = x
            for i in range(len(m)):
                q[i] = q[i] + (p[i] / m[i]) * h
        for i in range(len(m)):
            qs[row, i] = q[i]
            ps[row, i] = p[i]
    return q, p


HELPERS: tuple[Callable[..., None], ...] = (wall_springs, springs, quartics, dampings, forces)
"""What kernels call, each after what it calls itself."""

ONE: dict[str, Kernel] = {
    "euler": one_euler,
    "semi-implicit-euler": one_semi_implicit_euler,
    "implicit-euler": one_implicit_euler,
}
MANY: dict[str, Kernel] = {
    "euler": many_euler,
    "semi-implicit-euler": many_semi_implicit_euler,
    "implicit-euler": many_implicit_euler,
}
JOINED: dict[str, Kernel] = {
    "euler": joined_euler,
    "semi-implicit-euler": joined_semi_implicit_euler,
    "implicit-euler": joined_implicit_euler,
}
CHAIN: dict[str, Kernel] = {"implicit-euler": chain_implicit_euler}
