"""Rows compiled to arrays: the one-step maps of many hypotheses at once, and their curves.

A map is its four entries (4, c), of c columns; each column belongs to one row.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from springcheck.identify.rows import KICKS, ONE, Row
from springcheck.physics.arrays import Floats
from springcheck.schemes.catalogue import number


@dataclass(frozen=True, eq=False, kw_only=True)
class _Numbers:
    """Coefficients of all rows in one width: of each slot (l, rows), a kick and then a drift; of each power
    (d, rows), numerator and denominator of the stability function."""

    pull: Any
    early: Any
    late: Any
    decay: Any
    drift: Any
    over: Any
    under: Any


def _slots(row: Row, width: Any) -> list[list[Any]]:
    """A row's stages as kicks, each with the drift after it: pull, early, late, decay, drift."""
    out: list[list[Any]] = []
    for kind, share in row.stages:
        c = number(share, width)
        if kind == "drift":
            if not out or out[-1][4]:
                out.append([0, 0, 0, 0, 0])
            out[-1][4] = c
        else:
            out.append([0 if kind == "friction" else c, *(x * c for x in KICKS[kind]), 0])
    return out


class Table:
    """The maps of some rows; `i` (c,) says which row each column belongs to."""

    def __init__(self, rows: tuple[Row, ...]) -> None:
        self.rows = rows
        self._base = [row.inner or row for row in rows]
        self._length = np.array([len(_slots(x, np.float64)) for x in self._base])
        self._rational = np.array([bool(x.over) for x in self._base])
        self._explicit = np.array([bool(x.over) and len(x.under) == 1 for x in self._base])
        self._made = np.array([bool(x.over or x.formula) for x in self._base])
        # without stages of its own, friction acts in the force of a tableau
        self._in_force = np.array([x.damped and not x.stages for x in self._base])
        self._steps = np.array([x.steps for x in rows])
        self._views = {x.view: np.array([y.view == x.view for y in rows]) for x in rows if x.view}
        self._formulas = [(n, x.formula) for n, x in enumerate(self._base) if x.formula]
        self.free = np.array([bool(x.free) for x in rows])
        self.damped = np.array([x.damped for x in rows])
        self.roundings = np.array([float(x.roundings) for x in rows])
        self._known: dict[Any, _Numbers] = {}

    def _of(self, width: Any) -> _Numbers:
        if width not in self._known:
            most = max(int(np.max(self._length)), 1)
            slots = np.zeros((5, most, len(self.rows)), width)
            for r, one in enumerate(self._base):
                for n, slot in enumerate(_slots(one, width)):
                    slots[:, n, r] = slot
            powers = []
            for each in ([x.over or (ONE,) for x in self._base], [x.under for x in self._base]):
                out = np.zeros((max(map(len, each)), len(each)), width)
                for r, row in enumerate(each):
                    out[: len(row), r] = [number(c, width) for c in row]
                powers.append(out)
            names = ("pull", "early", "late", "decay", "drift")
            self._known[width] = _Numbers(
                **dict(zip(names, slots, strict=True)), over=powers[0], under=powers[1]
            )
        return self._known[width]

    def unit(self, i: Any, a: Any, g: Any) -> Any:
        """Maps (4, c) of one step at a and g (c,)."""
        m = self.powered(i, a, g)
        for view, which in self._views.items():
            some = which[i]
            if np.any(some):
                m[:, some] = _recorded(m[:, some], a[some], view)
        return m

    def powered(self, i: Any, a: Any, g: Any) -> Any:
        """Maps of the steps of a row, of its own velocities."""
        steps = self._steps[i]
        if not np.any(steps > 1):
            return self._stepped(i, a, g)
        m = power(self._stepped(i, a / steps**2, g / steps), steps)
        return np.stack([m[0], m[1] / steps, m[2] * steps, m[3]])

    def _stepped(self, i: Any, a: Any, g: Any) -> Any:
        n, m = self._of(a.dtype.type), np.zeros((4, len(a)), a.dtype)
        m[0] = m[3] = 1
        for some in _where(self._rational[i]):
            k = i[some]
            m[:, some] = _rational(
                n.over[:, k], n.under[:, k], a[some], np.where(self._in_force[k], g[some], 0)
            )
        for some in _where(self._length[i] > 0):
            k, x, y = i[some], a[some], g[some]
            q, v = m[:2, some], m[2:, some]
            for slot in range(int(np.max(self._length[k]))):
                pull, drift = n.pull[slot, k] * x, n.drift[slot, k]
                e, late, decay = (z[slot, k] for z in (n.early, n.late, n.decay))
                if np.any(e) or np.any(late) or np.any(decay):
                    share = np.exp(-decay * y) / (1 + late * y)
                    v = share * ((1 - e * y) * v - pull * q)
                else:
                    v = v - pull * q
                q = q + drift * v
            m[:2, some], m[2:, some] = q, v
        for r, formula in self._formulas:
            some = i == r
            if np.any(some):
                entries = np.broadcast_arrays(*formula(a[some], g[some]), a[some])[:4]
                m[:, some] = np.stack(entries).astype(a.dtype)
        return m

    def sizes(self, i: Any, a: Any, g: Any) -> Any:
        """Sums (4, c) of the absolute values of all terms of the maps, which roundings are relative to."""
        n, m = self._of(a.dtype.type), np.abs(self.powered(i, a, g))
        if np.any(self._steps[i] > 1):
            return m
        for some in _where(self._explicit[i]):
            k = i[some]
            y = np.where(self.damped[k], -np.abs(g[some]), g[some])
            m[:, some] += np.abs(self._stepped(k, -np.abs(a[some]), y))
        for some in _where(~self._made[i]):
            k, x, y = i[some], np.abs(a[some]), g[some]
            q, v = np.zeros((2, len(x)), a.dtype), np.zeros((2, len(x)), a.dtype)
            q[0] = v[1] = 1
            for slot in range(int(np.max(self._length[k], initial=0))):
                pull, drift = np.abs(n.pull[slot, k]) * x, np.abs(n.drift[slot, k])
                e, late, decay = (z[slot, k] for z in (n.early, n.late, n.decay))
                v = (v * (1 + np.abs(e * y)) + pull * q) / np.abs(1 + late * y) * np.exp(-decay * y)
                q = q + drift * v
            m[:2, some], m[2:, some] = q, v
        return m

    @cached_property
    def curves(self) -> Curves:
        """The monotonic pieces of the curves of rows, at each value of their parameters."""
        return Curves(self)


def _where(some: Any) -> Iterable[Any]:
    """The columns of a kind, as a slice where all are."""
    if np.all(some):
        return [slice(None)]
    return [np.flatnonzero(some)] if np.any(some) else []


def _rational(over: Any, under: Any, a: Any, g: Any) -> Any:
    """R(L) of L = [[0, 1], [-a, -g]]: every polynomial of L is x + y L, as L**2 = -g L - a."""

    def horner(coefficients: Any) -> Any:
        x, y = coefficients[-1], np.zeros_like(a)
        for c in coefficients[-2::-1]:
            x, y = c - a * y, x - g * y
        return x, y

    x, y = horner(over)
    if len(under) > 1:
        u, w = horner(under)
        det, p, r = u * u - u * w * g + w * w * a, u - w * g, -w
        x, y = (x * p - a * y * r) / det, (x * r + y * p - g * y * r) / det
    return np.stack([x, y, -a * y, x - g * y])


def _recorded(m: Any, a: Any, view: int | str) -> Any:
    """The map of q and of velocities that are recorded or made otherwise; half a step is by the kick at q."""
    det = m[0] * m[3] - m[1] * m[2]
    back = np.stack([m[3], -m[1], -m[2], m[0]]) / det
    # v half a step ahead of the positions, or behind them, is that of kicks of half a step
    made: dict[int | str, Any] = {
        1: lambda: m[2:], -1: lambda: back[2:], "mean": lambda: (m[:2] - back[:2]) / 2,
        "later": lambda: (m[0] - 1, m[1]), "earlier": lambda: (1 - back[0], -back[1]),
        "half before": lambda: (a / 2, 1 + 0 * a), "half after": lambda: (-a / 2, 1 + 0 * a),
    }  # fmt: skip
    x, y = made[view]()
    one, two, three, four = m[0] - m[1] * x / y, m[1] / y, m[2] - m[3] * x / y, m[3] / y
    return np.stack([one, two, x * one + y * three, x * two + y * four])


def product(a: Any, b: Any) -> Any:
    """Products of maps, by entries (4, c): far faster than `@` for matrices of this size."""
    return np.stack([
        a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3],
    ])  # fmt: skip


def power(m: Any, s: Any) -> Any:
    """Powers s (c,) of maps (4, c)."""
    left, base = s.astype(int), m
    if np.all(left == 1):
        return m
    out = np.zeros_like(m)
    out[0] = out[3] = 1
    out = np.where(left % 2 == 1, base, out)
    while np.any(left := left // 2):
        base = product(base, base)
        odd = left % 2 == 1
        if np.any(odd):
            out = np.where(odd, product(out, base), out)
    return out


def bend_of(m: Any) -> tuple[Any, Any]:
    """2 - trace/sqrt|det| without cancellation, and log |det|, of maps (4, c)."""
    one, other = 1 - m[0], 1 - m[3]
    alpha = one * other - m[1] * m[2]
    lost = one + other - alpha
    with np.errstate(all="ignore"):
        small = np.log1p(-np.minimum(lost, 1 - 1e-19))
        loss = np.where(lost < 1, small, np.log(np.maximum(np.abs(1 - lost), 1e-300)))
        root = np.exp(loss / 2)
        # 1 + det - trace = (1 - root)**2 + root (2 - trace/root)
        return (alpha - np.expm1(loss / 2) ** 2) / root, loss


def _grid() -> Floats:
    half = np.concatenate([
        np.geomspace(1e-9, 1e-3, 60)[:-1], np.geomspace(1e-3, 1, 300)[:-1], np.linspace(1, 16, 600)[:-1],
        np.geomspace(16, 3600, 150),
    ])  # fmt: skip
    return np.concatenate([-half[::-1], half])


FLAT, LARGEST = 1e-12, 1e8
"""Relative change of a curve from point to point that is rounding, and values without digits."""


class Curves:
    """2 - trace/sqrt(det) and log |det| of every row from |a| = 1e-9 to 3600, in pieces on which the first
    rises or falls."""

    def __init__(self, table: Table) -> None:
        grid = _grid()
        each = [
            (r, x) for r, row in enumerate(table.rows)
            for x in (row.start if row.free not in ("", "friction") else (0.0,))
        ]  # fmt: skip
        which = np.repeat([r for r, _ in each], len(grid))
        with np.errstate(all="ignore"):
            # ways to record velocities leave trace and determinant as they are
            m = table.powered(which, np.tile(grid, len(each)), np.repeat([x for _, x in each], len(grid)))
            bends, losses = (x.reshape(len(each), -1) for x in bend_of(m))
            # where determinants are negative, or beyond all digits, rounding alone rises and falls
            risen = np.diff(bends, axis=1)
            signs = np.where(np.abs(risen) <= FLAT * np.abs(bends[:, 1:]), 0, np.sign(risen))
        pieces: list[Any] = []
        for (r, parameter), bend, loss, rises in zip(each, bends, losses, signs, strict=True):
            good = (np.abs(bend) < LARGEST) & np.isfinite(loss) & (np.abs(grid) <= table.rows[r].most)
            cut = np.flatnonzero((rises[1:] != rises[:-1]) | ~good[1:-1]) + 1
            for part in np.split(np.arange(len(grid)), cut):
                # neighbouring pieces share the point between them
                both = np.append(part, part[-1] + 1) if part[-1] + 1 < len(grid) else part
                both = both[good[both]]
                both = both if len(both) > 1 and bend[both[0]] < bend[both[-1]] else both[::-1]
                if len(both) > 1 and rises[part[0] if part[0] < len(rises) else -1]:
                    pieces.append((r, parameter, bend[both], grid[both], loss[both]))
        self._row, self._parameter = (np.array([x[n] for x in pieces]) for n in (0, 1))
        ends = np.cumsum([len(x[2]) for x in pieces])
        self._first, self._last = np.append(0, ends[:-1]), ends - 1
        self._bend, self._a, self._loss = (np.concatenate([x[n] for x in pieces]) for n in (2, 3, 4))

    def crossed(self, target: Floats, fold: Floats) -> tuple[Any, Any, Any, Floats, Floats]:
        """Where curves take these values, or nearly do: row, parameter, index of the value, a, log det.
        `fold` (rows,) is how far beyond an extremum a row is tried."""
        low, high = self._bend[self._first], self._bend[self._last]
        beyond = fold[self._row]
        inside = (target >= (low - beyond * np.abs(low))[:, None]) & (
            target <= (high + beyond * np.abs(high))[:, None]
        )
        p, t = np.nonzero(inside)
        below, above, x = self._first[p], self._last[p], target[t]
        while np.any(above - below > 1):
            middle = (below + above) // 2
            under = self._bend[middle] <= x
            below, above = np.where(under, middle, below), np.where(under, above, middle)
        with np.errstate(all="ignore"):
            share = (x - self._bend[below]) / (self._bend[above] - self._bend[below])
        share = np.clip(np.nan_to_num(share), 0, 1)
        pieces, which = [p], [t]
        at, lost = ([y[below] + share * (y[above] - y[below])] for y in (self._a, self._loss))
        for end, inner in ((self._first, self._first + 1), (self._last, self._last - 1)):
            # near an extremum, which the curve may take on either side of it
            edge = self._bend[end]
            p, t = np.nonzero(np.abs(target - edge[:, None]) <= (beyond * np.abs(edge))[:, None])
            pieces.append(p)
            which.append(t)
            at.append(self._a[inner[p]])
            lost.append(self._loss[inner[p]])
        p, t = np.concatenate(pieces), np.concatenate(which)
        return self._row[p], self._parameter[p], t, np.concatenate(at), np.concatenate(lost)


@cache
def table(rows: tuple[Row, ...]) -> Table:
    """The table of some rows."""
    return Table(rows)


def unit(row: Row, a: Any, g: Any) -> Any:
    """One-step matrices (c, 2, 2) of a row for a and g (c,)."""
    a = np.asarray(a)
    g = np.broadcast_to(np.asarray(g, a.dtype), a.shape)
    return np.moveaxis(table((row,)).unit(np.zeros(len(a), int), a, g).reshape(2, 2, -1), -1, 0)


@cache
def _samples(row: Row, g: float) -> Any:
    return unit(row, np.array([0.3, 1.1, 2.9], np.longdouble), np.full(3, np.longdouble(g)))


def same(one: Row, other: Row) -> bool:
    """Whether two rows have one map."""
    if one.free != other.free:
        return False
    g = 0.3 if one.free else 0.0
    return bool(np.max(np.abs(_samples(one, g) - _samples(other, g))) < 1e-15)
