"""Terms that the loops lack, compiled from the `slope` of their classes where numba can.

All are called through pointers of one type, so the kernels are compiled, and saved, once for all of them.
Forces are summed as NumPy sums them, first over all ends a, then over all ends b.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from springcheck.engines.own.compiled import HELP
from springcheck.engines.own.loops import KINDS
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.distance import Distances
from springcheck.physics.term import Term
from springcheck.physics.termcheck import FORMULA_ROUNDINGS

TINY = float(np.finfo(np.float64).tiny)


@cache
def _slope(kind: Any) -> tuple[Any, str]:
    """The slope of a law as a compiled function of u, of its parameters (k, s), and of the row; or why it is
    not compiled."""
    import numba

    parameters = [c.field for c in kind.columns if c.field not in (kind.origin, "number")]
    # numba knows no calls with a varying number of arguments
    arguments = ", ".join(f"x[{i}, s]" for i in range(len(parameters)))
    source = f"lambda u, x, s: law(u, {arguments})"
    signature = numba.float64(numba.float64, numba.float64[:, ::1], numba.int64)
    try:
        law = numba.njit(**HELP)(kind.slope)
        return numba.njit(signature, **HELP)(eval(source, {"law": law})), ""
    except Exception as error:
        said = [line.strip() for line in str(error).splitlines() if line.strip()]
        told = (line for line in said if not line.startswith(("Failed in", "\x1b")))
        why = next(told, type(error).__name__)
        return None, f"numba: {why:.120}"


def why_not(kind: Any) -> str:
    """Why a term is not compiled, in a clause; empty where it is."""
    if kind.key not in KINDS and kind.kind != "potential":
        return "it is no potential"
    try:
        return "" if kind.key in KINDS else _slope(kind)[1]
    except ImportError:
        return "numba is not installed"


@cache
def _pull(kind: Any) -> Any:
    """A pointer to a function that adds the force of a term's rows to f, from its `arrays`."""
    import numba

    of, in_space = _slope(kind)[0], issubclass(kind, Distances)

    def pull(ends: Any, firsts: Any, x: Any, q: Any, f: Any) -> None:
        at, room, pairs = x[len(x) - 2], x[len(x) - 1], len(ends) == 2
        for s in range(len(at)):
            room[s] = (q[ends[1, s]] - q[ends[0, s]] if pairs else q[ends[0, s]]) - at[s]
        if in_space:
            for j in range(len(firsts) - 1):
                # NumPy's reduceat adds the sum of the others to the first
                first, others = firsts[j], 0.0
                for s in range(first + 1, firsts[j + 1]):
                    others += room[s] * room[s]
                u = max(math.sqrt(room[first] * room[first] + others), TINY)
                slope = of(u, x, first)
                for s in range(firsts[j], firsts[j + 1]):
                    room[s] = slope * (room[s] / u)
        else:
            for s in range(len(at)):
                room[s] = of(room[s], x, s)
        if pairs:
            for s in range(len(at)):
                f[ends[0, s]] += room[s]
        for s in range(len(at)):
            f[ends[len(ends) - 1, s]] -= room[s]

    many, row = numba.float64[:, ::1], numba.float64[::1]
    signature = numba.void(numba.int64[:, ::1], numba.int64[::1], many, row, row)
    made = numba.njit(signature, **HELP)(pull)
    return numba.types.CompileResultWAP(made.get_compile_result(signature))


def arrays(term: Term) -> tuple[Integers, Integers, Floats]:
    """Ends (1 or 2, s); the first row of each distance, and their number; parameters, origins and room
    (k + 2, s)."""
    at = getattr(term, term.origin) if term.origin else np.zeros(len(term))
    firsts = [*term.firsts, len(term)] if isinstance(term, Distances) else []
    numbers = np.array([*term.parameters, at, np.zeros(len(term))], np.float64)
    return np.array(term.particles, np.int64), np.array(firsts, np.int64), numbers


def compiled(term: Term) -> tuple[Any, ...]:
    """A term as `loops.others` takes it, where `obstacle` has none."""
    kind: Any = type(term)
    # numba warns of a pointer that comes first
    return *arrays(term), _pull(kind)


def obstacle(term: Term, q: Floats) -> str:
    """Why a term is not compiled; empty where its compiled force is NumPy's near q (n,), to rounding."""
    kind: Any = type(term)
    if why := why_not(kind):
        return why
    *given, pull = compiled(term)
    for at in (q, 1.25 * q):
        found, right, bound = np.zeros((3, len(q)))
        pull(*given, at, found)
        # a force that depends on the velocity is no function of u
        term.add_force(at, 1 + np.abs(at), right)
        term.add_rounding(np.abs(at), 0 * at, bound, at, False)
        if not np.all(np.abs(found - right) <= FORMULA_ROUNDINGS * 2.0**-53 * bound):
            return "its compiled force is another than NumPy's"
    return ""
