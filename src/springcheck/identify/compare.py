"""One score for every hypothesis: chi-squared of the four entries of the measured map, by one Gauss-Newton on
the free numbers (a, g or a parameter, the scale of the velocities), with its degrees of freedom."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.identify.catalogue import ORDER
from springcheck.identify.guesses import STRONG, guesses
from springcheck.identify.measure import Map
from springcheck.identify.rows import Row, power, sizes, unit
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Floats

CHANCE, LIKELY = 1e-7, 25.0
"""Probability of a chi-squared that is excluded, and five standard errors."""

SINGLE = 2.0**-24


@dataclass(frozen=True, kw_only=True)
class Freedom:
    """What a comparison leaves open beside a row's own numbers."""

    jitter: float = 0.0
    """Relative uncertainty of the interval, by which velocities scale."""
    scale: bool = False
    """Whether the scale of the velocities is one more number."""
    prior: float = 0.0
    """Standard error of the log of that scale, by the times; 0 where it may be any."""
    rounding: float = ROUNDING
    """Roundoff of the coefficients."""
    growing: bool = False
    """Whether friction may be negative."""
    bias: float = 0.0
    """Standard error of the entries beside that of the fit."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Match:
    """A row with s steps to a frame, fitted to one map."""

    row: Row
    stride: int
    turns: int
    """Whole turns between two frames."""
    a: float
    g: float
    a_error: float
    g_error: float
    log_scale: float
    scale_error: float
    chi2: float
    freedom: int
    entries: Any


@dataclass(frozen=True, eq=False)
class Joint:
    """A row and stride on every oscillator."""

    row: Row
    stride: int
    parts: tuple[Match, ...]

    @property
    def chi2(self) -> float:
        return sum(x.chi2 for x in self.parts)

    @property
    def simple(self) -> tuple[int, int, int, int]:
        exact = -(self.row.scheme == "exact")
        return max(x.turns for x in self.parts), self.stride, exact, ORDER.get(self.row.key, len(ORDER))


def match(row: Row, found: Map, free: Freedom, strides: Iterable[int], *, far: bool = False) -> list[Match]:
    """Best fit of a row at each stride, by Gauss-Newton; with `far` those too that do not fit."""
    from scipy.special import chdtri

    got = guesses(row, found, strides)
    strong = row.damped and abs(_area(found) - 1) > STRONG
    got = got if far or strong else _near(row, found, got)
    if not len(got):
        return []
    s, turns = got[:, 0], got[:, 1]
    x = np.concatenate([got[:, 2:4].T, np.zeros((1, len(got)))])
    ratio, seen = found.size[1] / found.size[0], found.b.reshape(4)
    which = [0] + [1] * bool(row.free) + [2] * free.scale
    freedom = 4 - len(which) + bool(free.prior)
    shear = free.jitter * seen.astype(float) * [0, 1, -1, 0]
    values, axes = np.linalg.eigh(found.cov + np.outer(shear, shear) + free.bias**2 * np.eye(4))
    values = np.maximum(values, 1e-15 * max(values[-1], 1e-300))
    largest = max(1.0, float(np.max(np.abs(seen))))

    def entries(x: Any, s: Any) -> Any:
        m = power(unit(row, x[0], x[1]), s)
        up = np.exp(-x[2]) / s * x.dtype.type(ratio)
        return np.stack([m[:, 0, 0], m[:, 0, 1] * up, m[:, 1, 0] / up, m[:, 1, 1]])

    def left(x: Any, s: Any, weight: Any) -> tuple[Any, Any]:
        e = entries(x, s)
        out = (axes.T @ (seen.astype(x.dtype)[:, None] - e).astype(float)) * weight
        return e, np.vstack([out, x[2].astype(float) / free.prior]) if free.prior else out

    with np.errstate(all="ignore"):
        # double precision leaves few hypotheses to extended precision
        for width, floor in ((np.float64, 1e-13), (np.longdouble, 0.0)):
            # where long double is no wider, both passes have one type
            coarse = floor > 0
            x = x.astype(width)
            size = np.max(sizes(row, x[0], x[1]).astype(float), axis=(1, 2))
            added = np.minimum(np.sqrt(np.abs(x[0].astype(float))) + np.abs(x[1].astype(float)), 1)
            whole = (row.roundings * added + 2) * s * np.maximum(size, 1) * largest * free.rounding
            weight = 1 / np.sqrt(values[:, None] + whole**2 + (floor * largest) ** 2)
            e, r = left(x, s, weight)
            if free.scale and coarse:
                x[2] = np.nan_to_num(np.log(np.abs(e[1] / seen[1] * seen[2] / e[2])) / 2, posinf=0, neginf=0)
                e, r = left(x, s, weight)
            # few are given up once they are near
            given_up = 99 if far or not coarse else 6 if strong else 2
            kept, x, e, chi2, error = _gauss_newton(left, x, e, r, s, weight, which, given_up)
            s, turns = s[kept], turns[kept]
            if coarse and far:
                x, e = x.astype(np.longdouble), e.astype(np.longdouble)
                break
            if coarse:
                some = np.isfinite(chi2) & (chi2 < 1e4)
                x, s, turns = x[:, some], s[some], turns[some]
                if not len(s):
                    return []
    good = np.isfinite(chi2) & np.all(np.isfinite(e), axis=0)
    good &= far | (chi2 <= (chdtri(freedom, CHANCE) if freedom else 1e-4))
    if row.damped and not free.growing:
        good &= x[1] > 0
    if row.damped and row.formula is None and len(row.under) == 1:
        # polynomials of many stages take any value far beyond their limit
        good &= np.abs(x[0]) <= BEYOND
    best: dict[int, tuple[Any, int]] = {}
    for i in np.flatnonzero(good).tolist():
        open_ended = free.scale and not free.prior and freedom < 3
        rank = (0 if far else turns[i], abs(float(x[0, i])) if open_ended else float(chi2[i]))
        best[int(s[i])] = min(best.get(int(s[i]), (rank, i)), (rank, i))
    return [
        Match(
            row=row, stride=n, turns=int(turns[i]), a=float(x[0, i]), g=float(x[1, i]),
            a_error=float(error[0, i]), g_error=float(error[1, i]), log_scale=float(x[2, i]),
            scale_error=float(error[2, i]), chi2=float(chi2[i]), freedom=freedom, entries=e[:, i],
        )
        for n, (_, i) in best.items()
    ]  # fmt: skip


BEYOND = 25.0
"""Largest (h w)**2 of an explicit step that is tried."""

NEAR, NEAR_FREE = 0.05, 1.5
"""Distance of trace and of determinant from the measured ones at which a guess is given up, without a free
number and with one."""


def _near(row: Row, found: Map, got: Floats) -> Floats:
    """The guesses whose map is near the measured one, whatever the scale of velocities."""
    b = found.b.astype(float)
    with np.errstate(all="ignore"):
        m = power(unit(row, got[:, 2], got[:, 3]), got[:, 0])
        off = [m[:, 0, 0] - b[0, 0], m[:, 1, 1] - b[1, 1], m[:, 0, 1] * m[:, 1, 0] - b[0, 1] * b[1, 0]]
        least = np.max(np.abs(off), axis=0)
    largest = max(1.0, float(np.max(np.abs(b))), float(abs(b[0, 1] * b[1, 0])))
    error = 60 * math.sqrt(max(float(np.max(np.diag(found.cov))), 0.0))
    most = NEAR_FREE if row.free else NEAR
    near: Floats = got[least < most * largest * np.maximum(got[:, 0] / 4, 1) + error]
    return near


def _gauss_newton(
    left: Any, x: Any, e: Any, r: Any, s: Any, weight: Any, which: list[int], given_up: int
) -> tuple[Any, Any, Any, Floats, Floats]:
    """Minimise the residuals over the free numbers: which are left, x (3, c), entries, chi-squared (c,) and
    errors (3, c).  At the round `given_up` those are that do not converge."""
    kept = np.arange(x.shape[1])
    chi2, error, before = np.sum(r**2, 0), np.zeros(x.shape), np.inf
    slow, eye = np.ones(x.shape[1]), 1e-14 * np.eye(len(which))
    for i in range(14):
        if i == given_up:
            # what does not converge by now does not fit
            going = (chi2 < 1e7) | (chi2 < 0.2 * before)
            if not np.any(going):
                return kept[:0], x[:, :0], e[:, :0], chi2[:0], error[:, :0]
            kept, s, slow = kept[going], s[going], slow[going]
            x, e, r, weight, error = (y[:, going] for y in (x, e, r, weight, error))
            chi2 = chi2[going]
        before, slopes = chi2, []
        for k in which:
            d = np.abs(x[0]) * 1e-7 if k == 0 else np.full(x.shape[1], 1e-7, x.dtype)
            moved = x.copy()
            moved[k] += d
            slopes.append((r - left(moved, s, weight)[1]) / d.astype(float))
        j = np.nan_to_num(np.array(slopes))
        scale = np.sqrt(np.sum(j * j, 1))
        scale[scale == 0] = 1
        j = j / scale[:, None]
        inverse = np.linalg.inv(np.einsum("iec,jec->cij", j, j) + eye)
        step = np.einsum("cij,jec,ec->ic", inverse, j, np.nan_to_num(r)) / scale
        error[which] = np.sqrt(np.abs(np.einsum("cii->ic", inverse))) / scale
        most = 0.5 * np.abs(x[0].astype(float))
        step[0] = np.clip(step[0], -most, most)
        moved = x.copy()
        moved[which] += step * slow
        e2, r2 = left(moved, s, weight)
        new = np.sum(r2**2, 0)
        better = new < chi2
        gain = np.max(((chi2 - new) / (1 + new))[better], initial=0)
        going = bool(np.any(~better & (slow > 0.05) & (chi2 > 100) & (chi2 < 1e12)))
        slow = np.where(better, 1.0, slow / 4)
        x, e = np.where(better, moved, x), np.where(better, e2, e)
        r, chi2 = np.where(better, r2, r), np.where(better, new, chi2)
        if not (gain > 1e-5 or going):
            break
    return kept, x, e, chi2, error


def compare(
    maps: list[Map], free: Freedom, rows: Iterable[Row], strides: Iterable[int], *, far: bool = False
) -> list[Joint]:
    """Rows and strides that fit every oscillator, the simplest first."""
    out, strides = [], list(strides)
    for row in rows:
        parts = [{x.stride: x for x in match(row, maps[0], free, strides, far=far)}]
        for found in maps[1:]:
            left = list(parts[-1])
            parts.append({x.stride: x for x in match(row, found, free, left, far=far)} if left else {})
        out += [Joint(row, s, tuple(x[s] for x in parts)) for s in parts[0] if all(s in x for x in parts)]
    return sorted(out, key=lambda x: x.simple)


def likely(joints: list[Joint]) -> list[Joint]:
    """Those within five standard errors of the best."""
    low = min((x.chi2 for x in joints), default=0.0)
    return sorted((x for x in joints if x.chi2 <= low + LIKELY), key=lambda x: x.simple)


def _area(found: Map) -> float:
    return float(found.b[0, 0] * found.b[1, 1] - found.b[0, 1] * found.b[1, 0])


def distance(found: Map, m: Match) -> float:
    """Largest difference of the entries of a measured map and a row's."""
    return float(np.max(np.abs((found.b.reshape(4) - m.entries).astype(float))))
