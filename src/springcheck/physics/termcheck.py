"""Consistency of the functions of a new term's law, checked as the term is registered."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from springcheck.physics.arrays import ROUNDOFF, WIDE, Reals
from springcheck.physics.distance import Distances
from springcheck.physics.term import Term

SPACING = 2.0**-7
"""Spacing of the points of a difference quotient of eighth order [L]."""
WEIGHTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280], np.longdouble)
LAW_AGREEMENT = 1e-9
"""Relative agreement required. The quotient errs by (SPACING/length)**8: 1e-17 for a law that varies over a
unit of length, 1e-9 over a tenth."""
FORMULA_ROUNDINGS = 32
"""Most operations in one formula."""


RESERVED_WORDS = (
    "particle", "inductor", "capacitor", "resistor", "chain", "ends", "fast", "title", "source",
    "units", "kind", "time", "methods", "record",
)  # fmt: skip
"""Words of a scene file that no term may take."""


def check(term: type[Term]) -> None:
    """Raise TypeError where the class lacks a part, ValueError where its functions are inconsistent.

    Tested at 64 elongations between -0.5 and 0.5 (distances: 1.5 to 2.5), with parameters from 0.5 to 1.5:
    slope and second are the derivatives of potential and slope, potential and slope are proportional to the
    first parameter and 0 at rest, the error of slope in single precision is within `rounding`, and in
    extended precision no function rounds to double precision.  The formula of a distance gives its potential.
    """
    _check_parts(term)
    rng = np.random.default_rng(1)
    in_space = issubclass(term, Distances)
    names = [column.field for column in term.columns if column.field not in (term.origin, "number")]
    whole = np.ldexp(np.rint(np.ldexp(rng.uniform(0.5, 1.5, (len(names), 64)), 52)), -52)
    whole = whole.astype(np.longdouble)
    parameters = [x.astype(np.float32).astype(np.longdouble) for x in whole]
    u = rng.uniform(-0.5, 0.5, 64).astype(np.float32).astype(np.longdouble) + (2.0 if in_space else 0.0)
    functions: Any = term
    for lower, upper in (("potential", "slope"), ("slope", "second")):
        of, slope = getattr(functions, lower), getattr(functions, upper)
        points = u + SPACING * np.arange(-4, 5)[:, None]
        quotient = WEIGHTS @ np.stack([of(row, *parameters) + 0 * row for row in points]) / SPACING
        _agree(term, f"{upper} is not the derivative of {lower}", slope(u, *parameters), quotient)
        wrong = f"{lower} is not proportional to its first parameter, the strength"
        _agree(term, wrong, of(u, 2 * parameters[0], *parameters[1:]), 2 * of(u, *parameters))
        if not in_space:
            _agree(term, f"{lower} is not 0 at rest", of(0 * u, *parameters), 0 * u)
    narrow = functions.slope(u.astype(np.float32), *(x.astype(np.float32) for x in parameters))
    bound = FORMULA_ROUNDINGS * 2.0**-24 * np.abs(functions.rounding(np.abs(u), u, *parameters))
    if not np.all(np.abs(narrow - functions.slope(u, *parameters)) <= bound):
        raise ValueError(f"{term.__name__}: slope rounds more than rounding(size, u, ...) says")
    # digits beyond a double's, of which every one counts
    fine = u + np.ldexp(rng.integers(0, 1024, 64).astype(np.longdouble), -60)
    for name in ("potential", "slope", "second"):
        if WIDE and not _is_wide(getattr(functions, name), fine, whole):
            raise ValueError(
                f"{term.__name__}: {name} rounds to double precision; write it with NumPy's functions of its "
                "arguments alone, which keep their precision"
            )
    if in_space:
        given = {"u": u, "exp": np.exp, "log": np.log, "sqrt": np.sqrt}
        given |= dict(zip(names, parameters, strict=True))
        try:
            found = eval(term.formula, {"__builtins__": {}}, given)
        except Exception as error:
            raise ValueError(f"{term.__name__}: its formula cannot be evaluated: {error}") from None
        _agree(term, "its formula is not its potential", found, functions.potential(u, *parameters))


DIFFERENCES = 12
"""Order of the difference in which a smooth function vanishes and its rounding remains."""
CLOSE = 2.0**-10
"""Spacing of its points: a law that varies over a twentieth leaves (CLOSE 20)**12, below 1e-20."""


def _is_wide(of: Any, u: Reals, parameters: Reals) -> bool:
    """Whether a function is smooth to extended precision where u and all parameters change together."""
    steps = CLOSE * np.arange(DIFFERENCES + 1)[:, None]
    # parameters are doubles, and u moves by digits beyond a double's as well
    fine = np.ldexp(np.longdouble(421), -62) / CLOSE
    with np.errstate(all="ignore"):
        values = np.stack([of(u + x * (1 + fine), *(parameters + x)) + 0 * u for x in steps])
    rest = np.abs(np.diff(values, DIFFERENCES, axis=0)[0])
    size = np.max(np.abs(values), axis=0) * np.sqrt(float(math.comb(2 * DIFFERENCES, DIFFERENCES)))
    return bool(np.median(rest / np.where(size > 0, size, 1)) <= FORMULA_ROUNDINGS * ROUNDOFF)


def _check_parts(term: type[Term]) -> None:
    for name in ("key", "formula", "columns", "ends", "potential", "slope", "second", "rounding"):
        if not hasattr(term, name):
            raise TypeError(f"{term.__name__} lacks {name!r}, which a term needs")
    words = [term.key, *(column.name for column in term.columns)]
    bad = [word for word in words if not word.replace("-", "_").isidentifier() or word in RESERVED_WORDS]
    if bad:
        raise TypeError(
            f"{term.__name__}: {bad[0]!r} cannot be the name of a table or a column in a scene file"
        )
    fields = [column.field for column in term.columns]
    given = getattr(term, "__dataclass_fields__", {})
    unknown = [name for name in (*fields, *term.ends) if name not in given]
    if unknown:
        raise TypeError(
            f"{term.__name__} has no field {unknown[0]!r}: it is a dataclass with one for each column"
        )
    if not fields or fields[0] == term.origin:
        raise TypeError(
            f"{term.__name__}: the first of its columns is the strength, to which the energy is proportional"
        )
    if term.origin and term.origin not in fields:
        raise TypeError(f"{term.__name__}: its columns need one of the field {term.origin!r}")


def _agree(term: type[Term], wrong: str, one: Reals, other: Reals) -> None:
    size = np.max(np.abs(other))
    if not np.all(np.abs(one - other) <= LAW_AGREEMENT * (size or 1)):
        raise ValueError(f"{term.__name__}: {wrong}")
