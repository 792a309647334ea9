"""Numbers and names in words: ordinals, counts, times, alternatives."""

from __future__ import annotations

import ast
import inspect
import math
import sys
import textwrap
from collections.abc import Sequence
from decimal import ROUND_FLOOR, Context, Decimal
from itertools import pairwise
from typing import Any, cast

DIAGNOSIS = ". Diagnosis: "
"""Separator between the reason of a failed verdict and its diagnosis."""


def described(one: Any) -> str:
    """The docstring of a function or class; from its source where Python omits docstrings (-OO)."""
    if sys.flags.optimize < 2:
        return inspect.cleandoc(one.__doc__ or "")
    tree = ast.parse(textwrap.dedent(inspect.getsource(one)))
    return ast.get_docstring(cast(Any, tree.body[0])) or ""


def ordinal(n: int) -> str:
    """Ordinal of a number: 1st, 2nd, 3rd, 11th, 41st."""
    ending = "th" if n % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(n % 10, "th")
    return f"{n}{ending}"


def count(n: int, noun: str) -> str:
    """A count with its noun: 1 cell, 2 cells."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def few(names: Sequence[str], most: int, joint: str = ", ") -> str:
    """The first names, and how many more there are: a, b and 3 more."""
    more = len(names) - most
    return joint.join(names[:most]) + (f" and {more} more" if more > 0 else "")


def regularly(at: Sequence[int], what: str = "frame") -> str:
    """How often something is that is in at least three places, equally far apart; "" where it is not so."""
    apart = {b - a for a, b in pairwise(at)} if len(at) > 2 else set()
    return f", and so every {count(apart.pop(), what).removeprefix('1 ')}" if len(apart) == 1 else ""


def either(names: Sequence[str]) -> str:
    """Alternatives: a, b or c."""
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def number(x: float | None, form: str, infinite: str = "inf") -> str:
    """A number in this format; "-" where it is unknown."""
    if x is None or math.isnan(x):
        return "-"
    return infinite if x == math.inf else f"{x:{form}}"


def seconds(value: float | None) -> str:
    """A time with three digits and its unit."""
    if value is None or not math.isfinite(value):
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-9:.0f} ns"


def duration(value: float) -> str:
    """Seconds, hours or years, roughly."""
    for unit, size in (("years", 3.156e7), ("days", 86400.0), ("h", 3600.0)):
        if value >= size:
            return f"{value / size:.2g} {unit}"
    return seconds(value)


def rounded_down(x: float, digits: int = 8) -> str:
    """A positive number with so many digits, never above it: the printed limit of a step is a safe one."""
    if not 0 < x < math.inf:
        return f"{x:g}"
    down = Decimal(x).normalize(Context(prec=digits, rounding=ROUND_FLOOR))
    return f"{down:f}" if 1e-5 < x < 1e8 else f"{down:e}"
