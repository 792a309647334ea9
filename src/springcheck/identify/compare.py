"""One score for every hypothesis: chi-squared of the four entries of the measured map, by one Gauss-Newton on
the free numbers (a, g or a parameter, the scale of the velocities), with its degrees of freedom."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.identify.catalogue import ORDER
from springcheck.identify.guesses import STRONG, guesses
from springcheck.identify.measure import Map
from springcheck.identify.rows import Row
from springcheck.identify.storage import ROUNDING
from springcheck.identify.tables import Table, power, product, table
from springcheck.physics.arrays import Floats

CHANCE, LIKELY = 1e-7, 25.0
"""Probability of a chi-squared that is excluded, and five standard errors."""

SINGLE = 2.0**-24


@dataclass(frozen=True, kw_only=True)
class Freedom:
    """What a comparison leaves open next to a row's own numbers."""

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
    """Standard error of the entries next to that of the fit."""


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
    sums: Any
    """Sums (2, 2) of the absolute values of all terms of the map between frames, as far as roundings have
    them."""
    of_way: bool
    """Whether velocities are differences of positions over the step."""


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


BEYOND = 25.0
"""Largest (h w)**2 of an explicit step that is tried."""

NEAR, NEAR_FREE = 0.05, 1.5
"""Distance of trace and of determinant from the measured ones at which a guess is given up, without a free
number and with one."""

FAR_OFF, SLOW = 1e7, 0.2
"""Chi-squared at which a guess is given up, and the share of it that it has to lose in a round not to be."""


class _Trial:
    """The guesses of all rows of a table against one map: of each its row, steps, and free numbers."""

    def __init__(self, table: Table, found: Map, free: Freedom, far: bool) -> None:
        self.table, self.free, self.far = table, free, far
        self.ratio, self.seen = found.size[1] / found.size[0], found.b.reshape(4)
        shear = free.jitter * self.seen.astype(float) * [0, 1, -1, 0]
        values, self.axes = np.linalg.eigh(found.cov + np.outer(shear, shear) + free.bias**2 * np.eye(4))
        self.values = np.maximum(values, 1e-15 * max(values[-1], 1e-300))
        self.largest = max(1.0, float(np.max(np.abs(self.seen))))
        # a growing or strongly damped motion is far from the scheme without friction, which guesses begin at
        self.strong = table.damped & (abs(_area(found) - 1) > STRONG)

    def entries(self, r: Any, x: Any, s: Any) -> Any:
        """The entries (4, c) of maps between frames."""
        m = power(self.table.unit(r, x[0], x[1]), s)
        up = np.exp(-x[2]) / s * x.dtype.type(self.ratio)
        return np.stack([m[0], m[1] * up, m[2] / up, m[3]])

    def left(self, r: Any, x: Any, s: Any, weight: Any) -> tuple[Any, Any]:
        """Entries, and residuals in standard errors."""
        e = self.entries(r, x, s)
        out = (self.axes.T @ (self.seen.astype(x.dtype)[:, None] - e).astype(float)) * weight
        return e, np.vstack([out, x[2].astype(float) / self.free.prior]) if self.free.prior else out

    def weight(self, r: Any, x: Any, s: Any, floor: float) -> Any:
        """One over the standard errors of the residuals, with the roundings of a row's own steps."""
        size = np.max(self.table.sizes(r, x[0], x[1]).astype(float), axis=0)
        added = np.minimum(np.sqrt(np.abs(x[0].astype(float))) + np.abs(x[1].astype(float)), 1)
        whole = (self.table.roundings[r] * added + 2) * s * np.maximum(size, 1) * self.largest
        whole = whole * self.free.rounding
        return 1 / np.sqrt(self.values[:, None] + whole**2 + (floor * self.largest) ** 2)


def _near(trial: _Trial, found: Map, r: Any, got: Floats) -> Any:
    """Whether the maps of guesses are near the measured one, whatever the scale of velocities."""
    b = found.b.astype(float)
    with np.errstate(all="ignore"):
        m = power(trial.table.unit(r, got[:, 2], got[:, 3]), got[:, 0])
        off = [m[0] - b[0, 0], m[3] - b[1, 1], m[1] * m[2] - b[0, 1] * b[1, 0]]
        least = np.max(np.abs(off), axis=0)
    largest = max(1.0, float(np.max(np.abs(b))), float(abs(b[0, 1] * b[1, 0])))
    error = 60 * math.sqrt(max(float(np.max(np.diag(found.cov))), 0.0))
    most = np.where(trial.table.free[r], NEAR_FREE, NEAR)
    return (least < most * largest * np.maximum(got[:, 0] / 4, 1) + error) | trial.strong[r]


def _matches(
    rows: tuple[Row, ...], found: Map, free: Freedom, strides: Sequence[int], *, far: bool = False
) -> dict[tuple[int, int], Match]:
    """Best fit of every row at each stride, by one Gauss-Newton; with `far` those too that do not fit."""
    from scipy.special import chdtri

    compiled = table(rows)
    trial = _Trial(compiled, found, free, far)
    r, got = guesses(compiled, found, strides)
    if not far and len(r):
        near = _near(trial, found, r, got)
        r, got = r[near], got[near]
    if not len(r):
        return {}
    s, turns = got[:, 0], got[:, 1]
    x = np.concatenate([got[:, 2:4].T, np.zeros((1, len(got)))])
    with np.errstate(all="ignore"):
        # double precision leaves few hypotheses to extended precision
        for width, floor in ((np.float64, 1e-13), (np.longdouble, 0.0)):
            # where long double is no wider, both passes have one type
            coarse = floor > 0
            x = x.astype(width)
            weight = trial.weight(r, x, s, floor)
            if free.scale and coarse:
                e = trial.entries(r, x, s)
                seen = trial.seen
                x[2] = np.nan_to_num(np.log(np.abs(e[1] / seen[1] * seen[2] / e[2])) / 2, posinf=0, neginf=0)
            # few are given up once they are near
            given_up = np.where(trial.strong[r], 4, 2) if coarse and not far else np.full(len(r), 99)
            kept, x, e, chi2, error = _gauss_newton(trial, r, x, s, weight, given_up)
            r, s, turns = r[kept], s[kept], turns[kept]
            if coarse and far:
                x, e = x.astype(np.longdouble), e.astype(np.longdouble)
                break
            if coarse:
                some = np.isfinite(chi2) & (chi2 < 1e4)
                x, r, s, turns = x[:, some], r[some], s[some], turns[some]
                if not len(s):
                    return {}
    freedom = 3 - compiled.free[r].astype(int) - free.scale + bool(free.prior)
    most = np.where(freedom > 0, chdtri(np.maximum(freedom, 1), CHANCE), 1e-4)
    good = np.isfinite(chi2) & np.all(np.isfinite(e), axis=0) & (far | (chi2 <= most))
    damped = compiled.damped[r]
    good &= free.growing | ~damped | (x[1] > 0).astype(bool)
    # polynomials of many stages take any value far beyond their limit
    far_off = [BEYOND if y.damped and y.formula is None and len(y.under) == 1 else y.most for y in rows]
    good &= (np.abs(x[0]) <= np.array(far_off)[r]).astype(bool)
    best: dict[tuple[int, int], tuple[Any, int]] = {}
    for i in np.flatnonzero(good).tolist():
        unsure = free.scale and not free.prior and freedom[i] < 3
        rank = (0 if far else turns[i], abs(float(x[0, i])) if unsure else float(chi2[i]))
        at = int(r[i]), int(s[i])
        best[at] = min(best.get(at, (rank, i)), (rank, i))
    if not best:
        return {}
    kept = np.array([i for _, i in best.values()])
    x, s, r = x[:, kept], s[kept], r[kept]
    with np.errstate(all="ignore"):
        one, step = compiled.unit(r, x[0], x[1]), compiled.sizes(r, x[0], x[1]).astype(float)
        # the roundings of a frame's first step, as its other steps carry them on
        sums = np.maximum(product(np.abs(power(one, s - 1)).astype(float), step), step)
    way = np.max(np.abs(one[2:] - one[:2] + [[1], [0]]), axis=0) < 1e-12
    return {
        (row, n): Match(
            row=rows[row], stride=n, turns=int(turns[i]), a=float(x[0, c]), g=float(x[1, c]),
            a_error=float(error[0, i]), g_error=float(error[1, i]), log_scale=float(x[2, c]),
            scale_error=float(error[2, i]), chi2=float(chi2[i]), freedom=int(freedom[i]), entries=e[:, i],
            sums=sums[:, c].reshape(2, 2), of_way=bool(way[c]),
        )
        for c, ((row, n), (_, i)) in enumerate(best.items())
    }  # fmt: skip


def _gauss_newton(
    trial: _Trial, r: Any, x: Any, s: Any, weight: Any, given_up: Any
) -> tuple[Any, Any, Any, Floats, Floats]:
    """Minimise the residuals over the free numbers: which are left, x (3, c), entries, chi-squared (c,) and
    errors (3, c).  From the round `given_up` (c,) on those are that do not converge."""
    free = np.stack([np.ones(len(r), bool), trial.table.free[r], np.full(len(r), trial.free.scale)])
    which = [k for k in range(3) if np.any(free[k])]
    e, res = trial.left(r, x, s, weight)
    chi2, error = np.sum(res**2, 0), np.zeros(x.shape)
    alive, slow = np.ones(len(r), bool), np.ones(len(r))
    going = np.arange(len(r))
    for i in range(14):
        if not len(going):
            break
        j, y, w = going, x[:, going], weight[:, going]
        before, slopes = chi2[j], []
        for k in which:
            d = np.abs(y[0]) * 1e-7 if k == 0 else np.full(len(j), 1e-7, x.dtype)
            moved = y.copy()
            moved[k] += d
            slope = (res[:, j] - trial.left(r[j], moved, s[j], w)[1]) / d.astype(float)
            slopes.append(np.where(free[k, j], np.nan_to_num(slope), 0.0))
        jac = np.array(slopes)
        scale = np.sqrt(np.sum(jac * jac, 1))
        scale[scale == 0] = 1
        jac = jac / scale[:, None]
        eye = 1e-14 * np.eye(len(which)) + np.einsum("ic,ij->cij", ~free[which][:, j], np.eye(len(which)))
        inverse = np.linalg.inv(np.einsum("iec,jec->cij", jac, jac) + eye)
        move = np.einsum("cij,jec,ec->ic", inverse, jac, np.nan_to_num(res[:, j])) / scale
        move = np.where(free[which][:, j], move, 0.0)
        spread = np.sqrt(np.abs(np.einsum("cii->ic", inverse))) / scale
        for n, k in enumerate(which):
            error[k, j] = np.where(free[k, j], spread[n], 0.0)
        most = 0.5 * np.abs(y[0].astype(float))
        move[0] = np.clip(move[0], -most, most)
        moved = y.copy()
        moved[which] += move * slow[j]
        e2, res2 = trial.left(r[j], moved, s[j], w)
        new = np.sum(res2**2, 0)
        better = new < before
        gain = np.where(better, (before - new) / (1 + new), 0.0)
        again = ~better & (slow[j] > 0.05) & (before > 100) & (before < 1e12)
        slow[j] = np.where(better, 1.0, slow[j] / 4)
        b = j[better]
        x[:, b], e[:, b], res[:, b], chi2[b] = moved[:, better], e2[:, better], res2[:, better], new[better]
        # what does not converge by then does not fit
        lost = (given_up[j] <= i + 1) & ~((chi2[j] < FAR_OFF) | (chi2[j] < SLOW * before))
        alive[j[lost]] = False
        going = j[((gain > 1e-5) | again) & ~lost]
    return np.flatnonzero(alive), x[:, alive], e[:, alive], chi2[alive], error[:, alive]


def compare(
    maps: list[Map], free: Freedom, rows: Iterable[Row], strides: Iterable[int], *, far: bool = False
) -> list[Joint]:
    """Rows and strides that fit every oscillator, the simplest first."""
    every, strides = tuple(rows), list(strides)
    parts = [_matches(every, maps[0], free, strides, far=far)]
    for found in maps[1:]:
        which = sorted({r for r, _ in parts[-1]})
        left = sorted({s for _, s in parts[-1]})
        some = _matches(tuple(every[r] for r in which), found, free, left, far=far) if which else {}
        parts.append({(which[r], s): x for (r, s), x in some.items() if (which[r], s) in parts[-1]})
    out = [Joint(every[r], s, tuple(x[r, s] for x in parts)) for r, s in parts[-1]]
    return sorted(out, key=lambda x: x.simple)


def likely(joints: list[Joint]) -> list[Joint]:
    """The candidates within five standard errors of the best."""
    low = min((x.chi2 for x in joints), default=0.0)
    return sorted((x for x in joints if x.chi2 <= low + LIKELY), key=lambda x: x.simple)


def _area(found: Map) -> float:
    return float(found.b[0, 0] * found.b[1, 1] - found.b[0, 1] * found.b[1, 0])


def distance(found: Map, m: Match) -> float:
    """Largest difference of the entries of a measured map and a row's."""
    return float(np.max(np.abs((found.b.reshape(4) - m.entries).astype(float))))
