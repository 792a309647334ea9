"""The loops of the own methods: plain Python that runs interpreted or compiled, bit for bit the same.

Interpreted, the rows `m, k, q, p ...` are lists of floats (Python's floats neither warn nor raise when
they overflow); compiled, they are arrays.  So no kernel may contain what rounds or fails differently
there: only + - * / on floats, in a fixed order, and no division by anything but a mass.
Sines and exponentials are made of these too: the C library's differ in the last digit from one system
to the next, and Python's raise where these give inf or nan.

Every kernel takes `(every, h, *constants, q, p, qs, ps)`, fills row after row of qs and ps (f, n) with
the state `every` steps later, and returns the last state.  There are four layouts:

one     a single particle on one spring at rest in 0; its state stays in two registers
many    particles side by side, each on one wall spring: n systems in one
joined  any terms; forces are summed over the terms in the order of `forces`, then over each term's list
chain   springs between neighbours, for implicit Euler: its equations are tridiagonal then

To add a term to `joined`: write its loop, add it to `LAWS` and `forces`, and name its fields in
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
"""One tuple of rows for each kind of term, in the order of `LAWS`; empty where the scene has none."""
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


WHOLE = 6755399441055744.0
"""1.5 * 2**52: adding and taking it away rounds to a whole number."""
TWO_BY_PI = 6.36619772367581382433e-01
PI_BY_2 = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
"""In three parts, the first two of 33 bits: their products with numbers below 2**20 are exact."""
LOG2_E = 1.44269504088896338700e00
LN_2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
EXPONENTS = (7.09782712893383973096e02, -7.45133219101941108420e02)
"""exp overflows above the first and vanishes below the second."""
INFINITE = float("inf")
POWERS = tuple((float(e), 2.0**e) for e in (64, 512, 256, 128, 64, 32, 16, 8, 4, 2, 1))


def sine(x: float) -> float:
    """sin(x) to 1 ulp of x or of the result, for |x| < 2**20; to eps |x| below 2**50; no meaning beyond.

    Polynomials of fdlibm, k_sin.c and k_cos.c (Sun Microsystems, 1993).
    """
    turns = (x * TWO_BY_PI + WHOLE) - WHOLE
    r = ((x - turns * PI_BY_2[0]) - turns * PI_BY_2[1]) - turns * PI_BY_2[2]
    quarter = turns - 4.0 * ((turns * 0.25 + WHOLE) - WHOLE)
    z = r * r
    if quarter * quarter == 1.0:
        c = 2.08757232129817482790e-09 + z * -1.13596475577881948265e-11
        c = -2.75573143513906633035e-07 + z * c
        c = 2.48015872894767294178e-05 + z * c
        c = -1.38888888888741095749e-03 + z * c
        c = 4.16666666666666019037e-02 + z * c
        half = 0.5 * z
        w = 1.0 - half
        y = w + ((1.0 - w - half) + z * (z * c))
        return y if quarter == 1.0 else -y
    c = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    c = 2.75573137070700676789e-06 + z * c
    c = -1.98412698298579493134e-04 + z * c
    c = 8.33333333332248946124e-03 + z * c
    c = -1.66666666666666324348e-01 + z * c
    y = r + r * (z * c)
    return y if quarter == 0.0 else -y


def exponential(x: float) -> float:
    """exp(x) to 1 ulp; inf where it overflows, 0 where it vanishes.  Polynomial of fdlibm, e_exp.c."""
    if x > EXPONENTS[0]:
        return INFINITE
    if x < EXPONENTS[1]:
        return 0.0
    n = (x * LOG2_E + WHOLE) - WHOLE
    high = x - n * LN_2[0]
    low = n * LN_2[1]
    r = high - low
    z = r * r
    c = -1.65339022054652515390e-06 + z * 4.13813679705723846039e-08
    c = 6.61375632143793436117e-05 + z * c
    c = -2.77777777770155933842e-03 + z * c
    c = 1.66666666666666019037e-01 + z * c
    c = r - z * c
    y = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    for size, power in POWERS:
        if n >= size:
            n = n - size
            y = y * power
        elif n <= -size:
            n = n + size
            y = y / power
    return y


def wall_springs(rows: Rows, q: Row, p: Row, f: Row) -> None:
    """Add -k (q - at) to f."""
    i, k, at = rows
    for s in range(len(i)):
        f[i[s]] += -k[s] * (q[i[s]] - at[s])


def springs(rows: Rows, q: Row, p: Row, f: Row) -> None:
    """Add the tension k (q[b] - q[a] - rest) to f[a] and take it from f[b]."""
    a, b, k, rest = rows
    for s in range(len(a)):
        tension = k[s] * (q[b[s]] - q[a[s]] - rest[s])
        f[a[s]] += tension
        f[b[s]] -= tension


def quartics(rows: Rows, q: Row, p: Row, f: Row) -> None:
    """Add -b (q - at)**3 to f."""
    i, b, at = rows
    for s in range(len(i)):
        u = q[i[s]] - at[s]
        f[i[s]] += -b[s] * (u * u * u)


def cosines(rows: Rows, q: Row, p: Row, f: Row) -> None:
    """Add -depth wave sin(wave (q - at)) to f."""
    i, depth, wave, at = rows
    for s in range(len(i)):
        f[i[s]] += -(depth[s] * wave[s]) * sine(wave[s] * (q[i[s]] - at[s]))


def morses(rows: Rows, q: Row, p: Row, f: Row) -> None:
    """Add the tension 2 depth steepness x (1 - x), x = exp(-steepness u), to f[a]; take it from f[b]."""
    a, b, depth, steepness, rest = rows
    for s in range(len(a)):
        x = exponential(-steepness[s] * (q[b[s]] - q[a[s]] - rest[s]))
        tension = 2.0 * depth[s] * steepness[s] * x * (1.0 - x)
        f[a[s]] += tension
        f[b[s]] -= tension


def dampings(rows: Rows, q: Row, p: Row, f: Row) -> None:
    """Add -c p/m to f."""
    i, c, m = rows
    for s in range(len(i)):
        f[i[s]] += -c[s] * (p[i[s]] / m[s])


def nothing(rows: Rows, q: Row, p: Row, f: Row) -> None:
    """Stands in for a term that the scene does not have."""


def forces(terms: Terms, q: Row, p: Row, f: Row) -> None:
    """Fill f with the force on every particle."""
    for i in range(len(f)):
        f[i] = 0.0
    wall_springs(terms[0], q, p, f)
    springs(terms[1], q, p, f)
    quartics(terms[2], q, p, f)
    cosines(terms[3], q, p, f)
    morses(terms[4], q, p, f)
    dampings(terms[5], q, p, f)


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


ELEMENTARY: tuple[Callable[[float], float], ...] = (sine, exponential)
"""What the loops of terms call."""
LAWS: dict[str, Callable[..., None]] = {
    "wall-spring": wall_springs,
    "spring": springs,
    "quartic": quartics,
    "cosine": cosines,
    "morse": morses,
    "damping": dampings,
}
"""The loop of each kind of term, in the order in which `forces` calls them.  A scene's kernel has
`nothing` in the place of those that the scene lacks: they are neither compiled nor evaluated."""

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
