"""A hypothesis is a row: a one-step map with its free numbers, its names, and of a mistake its sentence.

A map acts on (q, h v) of a spring with a = (h w)**2 and a second number g: the friction h c/m, or a parameter
of the row.  Powers of it lead from frame to frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np

ONE, HALF = Fraction(1), Fraction(1, 2)

Stage: TypeAlias = tuple[str, Any]
Formula: TypeAlias = Callable[[Any, Any], tuple[Any, Any, Any, Any]]

KICKS = {
    "kick": (0, 0, 0), "pull": (0, 0, 0), "friction": (0, 0, 1), "explicit": (1, 0, 0), "implicit": (0, 1, 0),
    "centred": (0.5, 0.5, 0), "remembered": (2, -1, 0),
}  # fmt: skip
"""A kick of the share c: v' = exp(-x c g) ((1 - e c g) v - c a q)/(1 + i c g), by its (e, i, x)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Row:
    """One hypothesis: a one-step map, given by stages, a stability function, a formula or another row."""

    scheme: str
    title: str
    stages: tuple[Stage, ...] = ()
    over: tuple[Any, ...] = ()
    """Coefficients of the stability function's numerator, from the constant up."""
    under: tuple[Any, ...] = (ONE,)
    formula: Formula | None = None
    """(a, g) -> the four entries."""
    free: str = ""
    """What g is: "" nothing, "friction", or the name of a parameter."""
    law: str = ""
    """Discretisation and place of the friction."""
    fault: str = ""
    """What is wrong, as a sentence; "" of a right scheme."""
    remedy: str = ""
    also: tuple[str, ...] = ()
    """Schemes of other names with the same map on a spring."""
    roundings: int = 16
    """Roundings in a step."""
    start: tuple[float, ...] = (0.5,)
    """First guesses of a parameter."""
    view: int | str = 0
    """Steps by which velocities are recorded behind (-1) or ahead (1) of positions, or how they were made
    from positions: "mean", "later", "earlier"."""
    inner: Row | None = None
    """Of a view, the row that is recorded so."""
    most: float = 3600.0
    """Largest |a| that is tried."""
    steps: int = 1
    """Steps of which the map is one."""

    @property
    def key(self) -> str:
        return f"{self.scheme}|{self.law}|{self.fault}|{self.view}|{self.free}"

    @property
    def damped(self) -> bool:
        return self.free == "friction"


def flow(a: Any, g: Any) -> tuple[Any, Any, Any, Any]:
    """The exact solution of a damped spring over a step."""
    w2 = a - g * g / 4
    w = np.sqrt(np.abs(w2))
    even = np.where(w2 >= 0, np.cos(w), np.cosh(np.minimum(w, 1e3)))
    safe = np.where(w == 0, 1, w)
    odd = np.where(w == 0, 1, np.where(w2 >= 0, np.sin(w), np.sinh(np.minimum(w, 1e3))) / safe)
    d = np.exp(-g / 2)
    return d * (even + odd * g / 2), d * odd, -d * odd * a, d * (even - odd * g / 2)


def stability(a: Any, b: Any) -> tuple[Any, Any]:
    """Coefficients of R(z) = 1 + z b (1 - z A)**-1 1 of a tableau, numerator and denominator."""
    s = len(b)
    full: list[Any] = [[*map(Fraction, row), *[Fraction(0)] * (s - len(row))] for row in a]
    x: list[Any] = [ONE] * s
    series: list[Any] = [ONE]
    for _ in range(s):
        series.append(sum((w * y for w, y in zip(b, x, strict=True)), Fraction(0)))
        x = [sum((c * y for c, y in zip(row, x, strict=True)), Fraction(0)) for row in full]
    under: list[Any] = [ONE]
    for i in range(s):
        under = [c - full[i][i] * d for c, d in zip([*under, 0], [0, *under], strict=True)]
    over = [sum((under[j] * series[k - j] for j in range(min(k, s) + 1)), Fraction(0)) for k in range(s + 1)]
    while len(under) > 1 and not under[-1]:
        under.pop()
    return tuple(over), tuple(under)
