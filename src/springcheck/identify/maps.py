"""One-step maps of many families at once, on (q, v h), and their powers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck.identify.families import FAMILIES, LAGGED, PREDICTED, Family
from springcheck.physics.arrays import Extended, Floats, Integers, Reals
from springcheck.schemes import SCHEMES, Scheme, matrix, number, rotation

KINDS: dict[str, tuple[float, float, float]] = {
    "kick": (0, 0, 0),
    "friction": (0, 0, 1),
    "explicit": (1, 0, 0),
    "implicit": (0, 1, 0),
    "centred": (0.5, 0.5, 0),
    "remembered": (2, -1, 0),
}
"""Coefficients (e, i, x) of a kick over the share c: v' = exp(-x c g) ((1 - e c g) v - c a q)/(1 + i c g)."""

WIDTHS = np.dtype(np.float64), np.dtype(np.longdouble)

Columns: TypeAlias = dict[np.dtype[Any], Reals]
"""Coefficients with the families along the last axis, in double and in extended precision."""


def _in_both_widths(x: Extended) -> Columns:
    return {width: x.astype(width) for width in WIDTHS}


def _slots(families: tuple[Family, ...]) -> Extended:
    """Coefficients (slots, 5, F) of kicks, each with the drift after it: e, i, x of `KINDS` times the share,
    and the shares b of the force and d of the drift."""
    out = np.zeros((max(len(family.stages) for family in families), 5, len(families)), np.longdouble)
    for family, slots in zip(families, out.transpose(2, 0, 1), strict=True):
        k, open_ = -1, False
        for kind, share in family.stages:
            c = np.longdouble(number(share, np.longdouble))
            # a drift closes the slot of the kick before it, and has its own after another drift
            k += not (open_ and kind == "drift")
            open_ = kind != "drift"
            if open_:
                e, i, x = KINDS[kind]
                slots[k, :4] = e * c, i * c, x * c, (kind != "friction") * c
            else:
                slots[k, 4] = c
    return out[np.any(out, axis=(1, 2))]


@dataclass(frozen=True, slots=True, eq=False)
class MapTable:
    """Coefficients of F families, so that maps of many are evaluated together; `which` (c,) are indices."""

    families: tuple[Family, ...]
    slots: Columns
    """Kicks with the drift after each, as in `_slots`."""
    over: Columns
    under: Columns
    """Numerator and denominator (degree, F) of stability functions."""
    inside: Columns
    """1 (F,) where the stability function includes the friction, 0 where stages have it."""
    kinds: tuple[tuple[str, NDArray[np.bool_]], ...]
    """Kinds of map other than stages, and which families (F,) are of each."""
    path: Floats
    scaled: NDArray[np.bool_]
    """Whether coefficients multiply the whole state, and not only its increment (F,)."""
    held: NDArray[np.bool_]
    damped: bool

    def unit(self, which: Integers, a: Reals, g: Reals) -> Reals:
        """One-step matrices (c, 2, 2) for a and g (c,), in their width of float."""
        out = np.zeros((2, 2, len(a)), a.dtype)
        out[0, 0] = out[1, 1] = 1
        for kind, members in self.kinds:
            at = np.flatnonzero(members[which])
            if len(at):
                out[:, :, at] = self._special(kind, which[at], a[at], g[at])
        q, v = out
        damped = bool(np.any(g))
        present = np.unique(which)
        for slot in self.slots[a.dtype]:
            if not slot[:, present].any():
                continue
            e, i, x, b, d = slot[:, which]
            if damped:
                v *= 1 - e * g
            v -= b * a * q
            if damped:
                v /= 1 + i * g
                v *= np.exp(-x * g)
            q += d * v
        return out.transpose(2, 0, 1)

    def _special(self, kind: str, n: Integers, a: Reals, g: Reals) -> Reals:
        if kind == "held":
            return _matrices(1 - g * a, np.ones_like(a), -a, np.ones_like(a))
        if kind == "flow":
            return _exponential(a, g)
        if kind == "formula":
            out = np.empty((2, 2, len(a)), a.dtype)
            for i in np.unique(n):
                name = self.families[i].formula
                of = FORMULAS.get(name) or partial(_stepped, SCHEMES[name])
                out[:, :, n == i] = of(a[n == i], g[n == i])
            return out
        over, under, inside = (x[a.dtype][..., n] for x in (self.over, self.under, self.inside))
        return _rational(over, under, a, g * inside)

    def sums(self, which: Integers, a: Reals, g: Reals) -> Reals:
        """Sums (c, 2, 2) of the absolute values of all terms of a step, which bound its roundings."""
        out = np.zeros((2, 2, len(a)))
        out[0, 0] = out[1, 1] = 1
        for kind, members in self.kinds:
            at = np.flatnonzero(members[which])
            n, x, y = which[at], a[at], g[at]
            if kind != "rational":
                size = np.abs(self._special(kind, n, x, y))
                size[0, 0] = 1 + np.abs(x * y) if kind == "held" else size[0, 0]
            else:
                over, under, inside = (part[a.dtype][..., n] for part in (self.over, self.under, self.inside))
                one = np.ones((2, len(n))) * [[1.0], [0.0]]
                terms = _rational(np.abs(over), one, -np.abs(x), -np.abs(y * inside))
                size = np.einsum("ijc,jkc->ikc", np.abs(_rational(one, under, x, y * inside)), terms)
            out[:, :, at] = size
        q, v = out
        for e, i, x, b, d in self.slots[a.dtype][:, :, which]:
            v *= 1 + np.abs(e * g)
            v += np.abs(b * a) * q
            v /= np.abs(1 + i * g)
            v *= np.exp(-x * g)
            q += np.abs(d) * v
        return out.transpose(2, 0, 1)

    def frame(self, which: Integers, a: Reals, g: Reals, log_mass: Reals, s: Floats, ratio: Reals) -> Reals:
        """Predicted entries (4, c) over s steps on (q, v T), T = s h, `ratio` the unit of v T over q's."""
        out = self.unit(which, a, g)
        if np.any(s != 1):
            out = power(out, s)
        up = np.exp(-log_mass) / s.astype(a.dtype) * ratio.astype(a.dtype)
        return np.stack([out[:, 0, 0], out[:, 0, 1] * up, out[:, 1, 0] / up, out[:, 1, 1]])


@cache
def table(families: tuple[Family, ...]) -> MapTable:
    """The coefficients of these families."""
    degree = max(len(part) for family in families for part in (*family.stability, (1,)))

    def coefficients(row: tuple[Fraction | str, ...]) -> list[np.longdouble]:
        values = [np.longdouble(number(x, np.longdouble)) for x in row]
        return values + [np.longdouble(0)] * (degree - len(row))

    over, under = (
        np.array([coefficients(family.stability[i] or (Fraction(1),)) for family in families]).T
        for i in (0, 1)
    )
    kinds = {
        "held": [family.held for family in families],
        "flow": [family.flow for family in families],
        "formula": [bool(family.formula) for family in families],
        "rational": [bool(family.stability[0]) for family in families],
    }
    return MapTable(
        families=families,
        slots=_in_both_widths(_slots(families)),
        over=_in_both_widths(over),
        under=_in_both_widths(under[: max([2, *(len(family.stability[1]) for family in families)])]),
        inside=_in_both_widths(np.array([not family.stages for family in families])),
        kinds=tuple((name, np.array(members)) for name, members in kinds.items() if any(members)),
        path=np.array([family.path for family in families], np.float64),
        scaled=np.array([not _adds(family) for family in families]),
        held=np.array(kinds["held"]),
        damped=any(family.damped for family in families),
    )


def _adds(family: Family) -> bool:
    """Whether every step adds kicks, drifts or slopes to a state, and never multiplies it."""
    explicit = bool(family.stages) or len(family.stability[1]) == 1
    return explicit and {kind for kind, _ in family.stages} <= {"kick", "drift", "explicit"}


def unit(family: Family, a: Reals, g: Reals) -> Reals:
    """One-step matrices (c, 2, 2) of one family, a and g (c,)."""
    a, g = np.broadcast_arrays(a, g)
    return table((family,)).unit(np.zeros(len(a), dtype=np.int64), a, g)


def _matrices(a: Reals, b: Reals, c: Reals, d: Reals) -> Reals:
    return np.array([[a, b], [c, d]])


def _rational(over: Reals, under: Reals, a: Reals, g: Reals) -> Reals:
    """R(L) of L = [[0, 1], [-a, -g]], by Horner's rule; coefficients (degree, c) from the constant up."""

    def horner(rows: Reals) -> tuple[Reals, Reals]:
        # every polynomial of L is x I + y L, because L**2 = -g L - a I
        x, y = rows[-1], np.zeros_like(a)
        for c in rows[-2::-1]:
            x, y = c - a * y, x - g * y
        return x, y

    x, y = horner(over)
    u, w = horner(under)
    # (x + y L) / (u + w L): the adjugate of u + w L is (u - w g) - w L
    det = u * u - u * w * g + w * w * a
    p, r = u - w * g, -w
    x, y = (x * p - a * y * r) / det, (x * r + y * p - g * y * r) / det
    return _matrices(x, y, -a * y, x - g * y)


def _exponential(a: Reals, g: Reals) -> Reals:
    """exp(L) at any damping: L + g/2 is traceless, and its square is a multiple of the identity."""
    w2 = a - g * g / 4
    w = np.sqrt(np.abs(w2))
    even = np.where(w2 >= 0, np.cos(w), np.cosh(np.minimum(w, 1e3)))
    safe = np.where(w == 0, 1, w)
    odd = np.where(w == 0, 1, np.where(w2 >= 0, np.sin(w), np.sinh(np.minimum(w, 1e3))) / safe)
    decay = np.exp(-g / 2)
    return _matrices(
        decay * (even + odd * g / 2), decay * odd, -decay * odd * a, decay * (even - odd * g / 2)
    )


@np.errstate(divide="ignore", invalid="ignore")
def power(matrices: Reals, strides: Floats) -> Reals:
    """matrices (c, 2, 2) to the powers strides (c,), from phase and determinant.  Two to four times faster
    than `schemes.propagate`, which keeps the digits of 1e7 steps; NaN of matrices of determinant 0."""
    found = rotation(matrices)
    s = strides.astype(matrices.dtype)
    root = np.sqrt(np.abs(found.determinant))
    turning = found.angle > 0
    if np.all(turning):
        # M/sqrt(d) = cos + sin N, and its powers likewise
        odd = np.sin(found.angle * s) / np.sin(found.angle)
        size = root**s
        out = matrices * (odd * size / root)[:, None, None]
        rest = size * (np.cos(found.angle * s) - odd * np.cos(found.angle))
        out[:, 0, 0] += rest
        out[:, 1, 1] += rest
        return np.asarray(out)
    angle = np.where(turning, found.angle, 0)
    growth = np.where(turning, 0, found.growth)
    even_s, even_1 = (np.where(turning, np.cos(angle * x), np.cosh(growth * x)) for x in (s, 1))
    odd_1 = np.where(turning, np.sin(angle), np.sinh(growth))
    odd_s = np.where(turning, np.sin(angle * s), np.sinh(growth * s))
    flat = odd_1 == 0
    odd = np.where(flat, s, odd_s / np.where(flat, 1, odd_1))
    # real eigenvalues of the sign of the trace: factor the sign out, take it to the power s
    sign = np.where(turning, 1, found.sign).astype(matrices.dtype)
    normal = matrices * (sign / root)[:, None, None]
    out = odd[:, None, None] * normal
    rest = even_s - odd * even_1
    out[:, 0, 0] += rest
    out[:, 1, 1] += rest
    return np.asarray(out * (root**s * np.where(np.mod(s, 2) == 0, 1, sign))[:, None, None])


def powers(entries: Reals, frames: int) -> Reals:
    """entries (2, 2) to the powers 0 to frames - 1, (frames, 2, 2), by doubling."""
    out, last = np.eye(2, dtype=entries.dtype)[None], entries
    while len(out) < frames:
        out = np.concatenate([out, out @ last])
        last = last @ last
    return np.asarray(out[:frames])


def _lagging(a: Reals, g: Reals, base: str, steps: int) -> Reals:
    """Map of (q_n, v_(n + steps)): velocities that are recorded `steps` frames late."""
    m = unit(FAMILIES[base], a, g)
    det = (m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0])[:, None]
    row = m[:, 1, :] if steps > 0 else np.stack([-m[:, 1, 0], m[:, 0, 0]], axis=1) / det
    turn = np.zeros_like(m)
    turn[:, 0, 0], turn[:, 1, :] = 1, row
    back = np.zeros_like(m)
    back[:, 0, 0], back[:, 1, 0], back[:, 1, 1] = 1, -row[:, 0] / row[:, 1], 1 / row[:, 1]
    return np.moveaxis(turn @ m @ back, 0, -1)


def _predicted(a: Reals, g: Reals, share: Fraction) -> Reals:
    """Velocity Verlet whose second force has the friction of the velocity v + share h a."""
    part = a.dtype.type(share.numerator) / share.denominator
    return _matrices(
        1 - a / 2, 1 - g / 2, -a + a * a / 4 + part * a * g / 2, 1 - g - a / 2 + a * g / 4 + part * g * g / 2
    )


FORMULAS: dict[str, Callable[[Reals, Reals], Reals]] = {
    "old force": lambda a, g: _matrices(1 - a / 2, 1 + 0 * a, -a, 1 + 0 * a),
    "halves swapped": lambda a, g: _matrices(1 - a, 0.5 + 0 * a, -a * (1 - a / 2), 1 - a / 4),
    "implicit velocity": lambda a, g: _matrices(1 + 0 * a, 1 + 0 * a, -a / (1 + a), 1 / (1 + a)),
    "one iteration": lambda a, g: _matrices(1 - a, 1 - a, -a, 1 - a),
    **{name: partial(_predicted, share=share) for name, share in PREDICTED.items()},
    **{
        f"{name} {'behind' if n < 0 else 'ahead'}": partial(_lagging, base=name, steps=n)
        for name in LAGGED
        for n in (-1, 1)
    },
}
"""Maps (2, 2, c) of faults that are no sequence of stages."""


def _stepped(scheme: Scheme, a: Reals, g: Reals) -> Reals:
    """The map of a scheme that is no sequence of stages."""
    found = matrix(scheme, h=1.0, m=np.ones(1), k=np.asarray(a, np.longdouble))
    return np.moveaxis(found, 0, -1).astype(a.dtype)
