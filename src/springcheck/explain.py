"""`springcheck explain`: a check, a scheme or a method in words, all of them from the objects themselves."""

from __future__ import annotations

import inspect
import math
import textwrap
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

from springcheck import checks, engines, schemes
from springcheck.errors import SpringcheckError, nearest
from springcheck.schemes import SCHEMES, Scheme

WIDTH = 100
"""Columns of a line."""

STAGES = {
    "kick": "p = p + {c}F",
    "pull": "p = p + {c}F of the potential",
    "drift": "q = q + {c}p/m",
    "friction": "p = p exp(-{c}c/m)",
    "implicit-friction": "p = p / (1 + {c}c/m)",
    "held": "p = p + {c}F, as it was last evaluated",
    "slow": "p = p + {c}F of the slow springs",
    "fast": "p = p + {c}F of the fast springs",
}
"""What a stage of a splitting does, with its part of the step h; F is the force at the present q and p."""


def lines(name: str) -> Iterator[str]:
    """What a name stands for.  SpringcheckError where it stands for nothing."""
    known = {check.name: check for check in checks.ALL}
    if name in known:
        return _check(known[name])
    if ":" in name:
        return _method(name)
    if name not in SCHEMES:
        methods = [
            f"{engine}:{method}" for engine in engines.names() for method in engines.engine(engine).methods
        ]
        near = nearest(name, (*known, *SCHEMES, *methods))
        raise SpringcheckError(
            f"{name!r} is no check, no scheme and no method{near}; "
            f"`springcheck list` names checks and methods, schemes are {', '.join(SCHEMES)}"
        )
    return scheme_lines(SCHEMES[name])


def _check(check: Any) -> Iterator[str]:
    yield f"{check.name}, a check of the {check.family}"
    first, _, rest = inspect.cleandoc(check.judge.__doc__ or "").partition("\n")
    yield from _folded(first)
    if rest.strip():
        yield ""
        yield from rest.strip("\n").splitlines()
    yield ""
    yield from _folded(f"Applies to: {check.needs}")


def _method(name: str) -> Iterator[str]:
    label = engines.parse(name)
    method = engines.engine(label.engine).methods.get(label.method)
    if method is None:
        there = ", ".join(engines.engine(label.engine).methods)
        raise SpringcheckError(f"{name!r} names no method; {label.engine} has {there}")
    yield f"{name}: {method.about}"
    yield ""
    yield from scheme_lines(schemes.scheme(method.scheme))


def scheme_lines(scheme: Scheme) -> Iterator[str]:
    """Formula, order, limit and source of a scheme."""
    yield f"{scheme.name}: {scheme.title}"
    for kind, c in scheme.stages:
        part = "h " if c == 1 else f"{c} h "
        yield f"  {STAGES[kind].format(c=part)}"
    if scheme.b:
        yield from _tableau(scheme.a, scheme.b)
    if not scheme.stages and not scheme.b:
        yield "  the exact flow" if scheme.flow else "  a solver that chooses its own steps; no one-step map"
    if scheme.stages or scheme.b:
        bounded = {0.0: "no step", math.inf: "every step"}.get(scheme.limit)
        area = "symplectic" if scheme.symplectic else "not symplectic"
        where = bounded or f"h omega up to {scheme.limit:.6g}"
        yield f"Order {scheme.order}; {area}; bounded on a spring: {where}"
    if scheme.source:
        yield from _folded(f"Source: {scheme.source}")


def _tableau(a: Sequence[Sequence[Fraction]], b: Sequence[Fraction]) -> Iterator[str]:
    for i, row in enumerate(a, 1):
        yield f"  Y{i} = y + h ({_sum(row)})" if any(row) else f"  Y{i} = y"
    yield f"  y = y + h ({_sum(b)})"
    yield "  with y = (q, p) and f(y) = (p/m, F(q, p))"


def _sum(row: Sequence[Fraction]) -> str:
    terms = [("" if c == 1 else f"{c} ") + f"f(Y{i})" for i, c in enumerate(row, 1) if c]
    return " + ".join(terms).replace("+ -", "- ")


def _folded(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH)
