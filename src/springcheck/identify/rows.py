"""A hypothesis is a row: a one-step map with its free numbers, its names, and of a mistake its sentence.

A map acts on (q, h v) of a spring with a = (h w)**2 and a second number g: the friction h c/m, or a parameter
of the row.  Powers of it lead from frame to frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any, TypeAlias

import numpy as np

from springcheck.schemes.catalogue import number

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

    @property
    def key(self) -> str:
        return f"{self.scheme}|{self.law}|{self.fault}|{self.view}|{self.free}"

    @property
    def damped(self) -> bool:
        return self.free == "friction"


def unit(row: Row, a: Any, g: Any) -> Any:
    """One-step matrices (c, 2, 2) for a and g (c,)."""
    if row.view and row.inner:
        return _recorded(unit(row.inner, a, g), row.view)
    if row.formula:
        return _rows(*np.broadcast_arrays(*row.formula(a, g), a)[:4]).astype(a.dtype)
    one, zero = np.ones_like(a), np.zeros_like(a)
    m = (
        _rational(row, a, g if row.damped and not row.stages else zero)
        if row.over
        else _rows(one, zero, zero, one)
    )
    q, v = np.moveaxis(m, 0, -1).copy()
    for kind, share in row.stages:
        c = number(share, a.dtype.type)
        if kind == "drift":
            q = q + c * v
            continue
        e, i, x = KICKS[kind]
        b = 0 if kind == "friction" else c
        v = ((1 - e * c * g) * v - b * a * q) / (1 + i * c * g) * np.exp(-x * c * g)
    return np.moveaxis(np.stack([q, v]), -1, 0)


def sizes(row: Row, a: Any, g: Any) -> Any:
    """Sums (c, 2, 2) of the absolute values of all terms of the matrices, which roundings are relative to."""
    row = row.inner or row
    if row.over and len(row.under) == 1:
        return np.abs(unit(row, a, g)) + np.abs(unit(row, -np.abs(a), -np.abs(g) if row.damped else g))
    if row.formula or row.over:
        return np.abs(unit(row, a, g))
    one, zero = np.ones_like(a), np.zeros_like(a)
    q, v = np.moveaxis(_rows(one, zero, zero, one), 0, -1).copy()
    for kind, share in row.stages:
        c = abs(number(share, a.dtype.type))
        if kind == "drift":
            q = q + c * v
            continue
        e, i, x = KICKS[kind]
        b = 0 if kind == "friction" else c
        v = (
            (v * (1 + abs(e * c) * np.abs(g)) + b * np.abs(a) * q)
            / np.abs(1 + i * c * g)
            * np.exp(-x * c * g)
        )
    return np.moveaxis(np.stack([q, v]), -1, 0)


def _rows(a: Any, b: Any, c: Any, d: Any) -> Any:
    return np.moveaxis(np.array([[a, b], [c, d]]), -1, 0)


def _rational(row: Row, a: Any, g: Any) -> Any:
    """R(L) of L = [[0, 1], [-a, -g]]: every polynomial of L is x + y L, as L**2 = -g L - a."""

    def horner(coefficients: Any) -> Any:
        x, y = np.full_like(a, number(coefficients[-1], a.dtype.type)), np.zeros_like(a)
        for c in coefficients[-2::-1]:
            x, y = number(c, a.dtype.type) - a * y, x - g * y
        return x, y

    (x, y), (u, w) = horner(row.over), horner(row.under)
    det, p, r = u * u - u * w * g + w * w * a, u - w * g, -w
    x, y = (x * p - a * y * r) / det, (x * r + y * p - g * y * r) / det
    return _rows(x, y, -a * y, x - g * y)


def flow(a: Any, g: Any) -> tuple[Any, Any, Any, Any]:
    """The exact solution of a damped spring over a step."""
    w2 = a - g * g / 4
    w = np.sqrt(np.abs(w2))
    even = np.where(w2 >= 0, np.cos(w), np.cosh(np.minimum(w, 1e3)))
    safe = np.where(w == 0, 1, w)
    odd = np.where(w == 0, 1, np.where(w2 >= 0, np.sin(w), np.sinh(np.minimum(w, 1e3))) / safe)
    d = np.exp(-g / 2)
    return d * (even + odd * g / 2), d * odd, -d * odd * a, d * (even - odd * g / 2)


def _recorded(m: Any, view: int | str) -> Any:
    """The map of q and of velocities that are recorded or made otherwise."""
    det = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
    back = (
        np.stack([m[:, 1, 1], -m[:, 0, 1], -m[:, 1, 0], m[:, 0, 0]], 1).reshape(-1, 2, 2) / det[:, None, None]
    )
    # v half a step ahead of the positions, or behind them, is that of kicks of half a step
    made = {
        1: lambda: m[:, 1], -1: lambda: back[:, 1], "mean": lambda: (m[:, 0] - back[:, 0]) / 2,
        "later": lambda: m[:, 0] - [1, 0], "earlier": lambda: [1, 0] - back[:, 0],
    }[view]()  # fmt: skip
    turn, undo = np.zeros_like(m), np.zeros_like(m)
    turn[:, 0, 0], turn[:, 1] = 1, made
    undo[:, 0, 0], undo[:, 1, 0], undo[:, 1, 1] = 1, -made[:, 0] / made[:, 1], 1 / made[:, 1]
    return turn @ m @ undo


def _product(a: Any, b: Any) -> Any:
    """Products of matrices, by entries (4, c): far faster than `@` for matrices of this size."""
    return np.stack([
        a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3],
    ])  # fmt: skip


def power(m: Any, s: Any) -> Any:
    """Powers s (c,) of matrices (c, 2, 2)."""
    left, base = s.astype(int), np.moveaxis(m, 0, -1).reshape(4, -1)
    one, zero = np.ones_like(base[0]), np.zeros_like(base[0])
    out = np.where(left % 2 == 1, base, np.stack([one, zero, zero, one]))
    while np.any(left := left // 2):
        base = _product(base, base)
        odd = left % 2 == 1
        if np.any(odd):
            out = np.where(odd, _product(out, base), out)
    return np.moveaxis(out.reshape(2, 2, -1), -1, 0)


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


def bend_of(m: Any) -> tuple[Any, Any]:
    """2 - trace/sqrt|det| without cancellation, and log |det|, of maps (c, 2, 2)."""
    one, other, product = 1 - m[:, 0, 0], 1 - m[:, 1, 1], m[:, 0, 1] * m[:, 1, 0]
    alpha = one * other - product
    lost = one + other - alpha
    with np.errstate(all="ignore"):
        small = np.log1p(-np.minimum(lost, 1 - 1e-19))
        loss = np.where(lost < 1, small, np.log(np.maximum(np.abs(1 - lost), 1e-300)))
        root = np.exp(loss / 2)
        # 1 + det - trace = (1 - root)**2 + root (2 - trace/root)
        return (alpha - np.expm1(loss / 2) ** 2) / root, loss


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a row's curve on which 2 - trace/sqrt(det) rises with `bend`, at one value of its parameter:
    a, and log |det|, by it."""

    bend: Any
    a: Any
    loss: Any


def _grid() -> Any:
    half = np.concatenate([
        np.geomspace(1e-9, 1e-3, 60)[:-1], np.geomspace(1e-3, 1, 300)[:-1], np.linspace(1, 16, 600)[:-1],
        np.geomspace(16, 3600, 150),
    ])  # fmt: skip
    return np.concatenate([-half[::-1], half])


@cache
def pieces(row: Row, parameter: float) -> tuple[Piece, ...]:
    """The monotonic pieces of the curve of a row, from |a| = 1e-9 to 3600."""
    a = _grid()
    with np.errstate(all="ignore"):
        bend, loss = bend_of(unit(row, a, np.full(len(a), parameter)))
        rises = np.sign(np.diff(bend))
    good = np.isfinite(bend) & np.isfinite(loss)
    cut = np.flatnonzero((rises[1:] != rises[:-1]) | ~good[1:-1]) + 1
    out = []
    for part in np.split(np.arange(len(a)), cut):
        # neighbouring pieces share the point between them
        both = np.append(part, part[-1] + 1) if part[-1] + 1 < len(a) else part
        both = both[good[both]]
        both = both if len(both) > 1 and bend[both[0]] < bend[both[-1]] else both[::-1]
        if len(both) > 1:
            out.append(Piece(bend[both], a[both], loss[both]))
    return tuple(out)


@cache
def _samples(row: Row, g: float) -> Any:
    return unit(row, np.array([0.3, 1.1, 2.9], np.longdouble), np.full(3, np.longdouble(g)))


def same(one: Row, other: Row) -> bool:
    """Whether two rows have one map."""
    if bool(one.free) != bool(other.free):
        return False
    g = 0.3 if one.damped and other.damped else 0.0
    return bool(np.max(np.abs(_samples(one, g) - _samples(other, g))) < 1e-15)
