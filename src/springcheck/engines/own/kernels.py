"""The loops of the own methods: plain Python that runs interpreted or compiled, bit for bit the same.

Interpreted, rows of numbers are lists (Python's floats neither warn nor raise when they overflow);
compiled, they are arrays.  So no loop may contain what rounds or fails differently there: + - * / in a
fixed order, no division by what may be 0, and the C library's sine and exponential within their range.

A step is a list of operations, or an explicit tableau (see `operations`).  `many` carries out any of them by
any force; `single` does so for one particle on one spring at rest in 0, whose state stays in two registers,
eight times as fast.  Both fill row after row of qs and ps (f, n) with the state `every` steps later.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from springcheck.engines.own.loops import (
    Numbers,
    Slot,
    Solver,
    add,
    chain_implicit,
    chain_kick_drift,
    drift,
    force_at,
    held,
    held_implicit,
    held_kick_drift,
    implicit,
    kick,
    kick_drift,
    pulled,
    tensions,
)

Rows: TypeAlias = Any
"""A list of lists, or a two-dimensional array; qs and ps are always arrays (f, n)."""

Steps: TypeAlias = Any
"""Code, slot, x, y of each operation, whether slots are damped, decays, and the tableau: see `many`."""

KICK, DRIFT, KICK_DRIFT, EULER, FRICTION, IMPLICIT, MIDPOINT, SET_CLOCK = range(8)
"""Operations on (q, p), with coefficients x and y in units of time:

KICK        p += x F            EULER       KICK and DRIFT, both from the old state
DRIFT       q += y p/m          IMPLICIT    P = p + x F(Q, P), Q = q + x P/m; q = q + y P/m, p = P
KICK_DRIFT  one after the other MIDPOINT    the same, but p = P + (P - p)
FRICTION    p *= decay            SET_CLOCK   the last coordinate is the time: steps done times x
"""


def many(
    every: int,
    steps: Steps,
    one: Slot,
    two: Slot,
    solver: Solver,
    m: Numbers,
    room: Rows,
    q: Numbers,
    p: Numbers,
    qs: Rows,
    ps: Rows,
) -> None:
    """Operation s kicks by the force of slot[s], with coefficients x[s] and y[s].

    A force f[slot] is evaluated again only when the state that it belongs to has moved: `damped` says of each
    slot whether it depends on p, `stale` carries this over from call to call.

    Of a tableau the rows of `a` are coefficients times the step, the weights last, v and f (s, n) velocities
    and forces of the stages (q + sum a v, p + sum a f), and `stage` is the one that is being formed.
    """
    code, slot, x, y, damped, decay, a = steps
    v, f, stage, t, stale = room
    n, stages, f_one, f_two = len(m), len(v), f[0], f[1]
    # for a simple row the loops are called from here: passing a whole force on costs as much as 100 particles
    indices, _, (k_held, at_held), (k, rest, ends), (c, _) = one
    divisors, factors, _ = solver
    simple = not indices and len(c) == 0
    held_alone = simple and len(k) == 0 and len(k_held) == n
    chain_alone = simple and len(k) > 0 and len(k_held) == 0
    for row in range(len(qs)):
        for _ in range(every):
            for s in range(len(code)):
                what = code[s]
                xs, ys, where = x[s], y[s], slot[s]
                if what == FRICTION:
                    decayed = decay[where]
                    for i in range(n):
                        p[i] = p[i] * decayed[i]
                elif what == DRIFT:
                    drift(ys, m, q, p)
                elif what == SET_CLOCK:
                    # nothing else of an index list is in t
                    q[n - 1] = t[0] * xs
                    t[0] += 1.0
                elif what in (IMPLICIT, MIDPOINT):
                    if where == 0 and held_alone:
                        held_implicit(xs, ys, what == MIDPOINT, divisors, k_held, at_held, m, q, p)
                    elif where == 0 and chain_alone and len(factors[1]):
                        tensions(k, rest, ends, q, t)
                        chain_implicit(xs, ys, what == MIDPOINT, factors, t, f_one, m, q, p)
                    elif where == 0:
                        force_at(one, q, p, t, f_one)
                        implicit(xs, ys, what == MIDPOINT, solver, f_one, m, q, p)
                    else:
                        force_at(two, q, p, t, f_two)
                        implicit(xs, ys, what == MIDPOINT, solver, f_two, m, q, p)
                elif where == 0 and held_alone and stale[0] and what != KICK:
                    held_kick_drift(xs, ys, what == EULER, k_held, at_held, m, q, p)
                elif where == 0 and chain_alone and stale[0] and what != KICK:
                    tensions(k, rest, ends, q, t)
                    chain_kick_drift(xs, ys, what == EULER, t, m, q, p)
                else:
                    if where == 0 and stale[0]:
                        if held_alone:
                            held(k_held, at_held, q, f_one)
                        elif chain_alone:
                            tensions(k, rest, ends, q, t)
                            pulled(t, f_one)
                        else:
                            force_at(one, q, p, t, f_one)
                    elif where == 1 and stale[1]:
                        force_at(two, q, p, t, f_two)
                    pull = f_one if where == 0 else f_two
                    if what == KICK:
                        kick(xs, pull, p)
                    else:
                        kick_drift(xs, ys, what == EULER, pull, m, q, p)
                    stale[where] = False
                moved = what not in (KICK, FRICTION, SET_CLOCK)
                stale[0] = stale[0] or moved or damped[0]
                stale[1] = stale[1] or moved or damped[1]
            if stages:
                u, w = stage[0], stage[1]
                for s in range(stages):
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
                for s in range(stages):
                    add(a[stages][s], v[s], q)
                    add(a[stages][s], f[s], p)
        out_q, out_p = qs[row], ps[row]
        for i in range(len(out_q)):
            out_q[i] = q[i]
            out_p[i] = p[i]


def single(
    every: int, steps: Steps, spring: Numbers, state_q: Numbers, state_p: Numbers, qs: Rows, ps: Rows
) -> None:
    """`many` of one particle on one spring; its stages v and f are numbers."""
    code, x, y, a, v, f = steps
    divisor, m, k = spring
    stages, q, p = len(v), state_q[0], state_p[0]
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
                else:
                    old = p
                    p = (p + (-k * q) * x[s]) * divisor
                    q = q + (p / m) * y[s]
                    if what == MIDPOINT:
                        p = p + (p - old)
            if stages:
                for s in range(stages):
                    u, w = q, p
                    for r in range(s):
                        c = a[s][r]
                        if c != 0.0:
                            u = u + c * v[r]
                            w = w + c * f[r]
                    v[s] = w / m
                    f[s] = -k * u
                for s in range(stages):
                    c = a[stages][s]
                    if c != 0.0:
                        q = q + c * v[s]
                        p = p + c * f[s]
        qs[row, 0] = q
        ps[row, 0] = p
    state_q[0] = q
    state_p[0] = p
