"""First guesses of the free numbers of rows: what trace and determinant of a map ask for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from springcheck.identify.measure import Map
from springcheck.identify.tables import Table, bend_of
from springcheck.physics.arrays import Floats

FEW = 13
"""Strides from here on are tried without whole turns between frames."""

STRONG, FOLD, FOLD_DAMPED = 0.02, 0.02, 0.2
"""Loss from which a friction is strong, and how far beyond an extremum of its curve a row is tried."""

ALIKE = 0.05
"""Relative difference of the numbers of two guesses of friction that are tried as one; of others a sixteenth,
whose curves may have two near solutions."""


def _roots(found: Map, strides: Sequence[int], exact: bool) -> list[tuple[int, int, float, float]]:
    """Every possible step: number in a frame, whole turns between frames, 2 - trace/sqrt(det), log det; the
    exact solution has one step to a frame, and the phase in place of the third."""
    bend, loss = (float(x[0]) for x in bend_of(found.b.reshape(4, 1)))
    det = float(found.b[0, 0] * found.b[1, 1] - found.b[0, 1] * found.b[1, 0])
    out: list[tuple[int, int, float, float]] = []
    if det > 0 and 0 < bend < 4:
        own = 2 * math.asin(min(1.0, math.sqrt(bend) / 2))
        own = own if found.b[0, 1] > 0 else 2 * math.pi - own
        for s in [1] if exact else strides:
            for n in range(9 if exact else s // 2 + 1 if s < FEW else 1):
                forth = (own + 2 * math.pi * n) / s
                if exact:
                    out.append((s, n, forth, loss / s))
                    continue
                ways = (forth, (2 * math.pi * (n + 1) - own) / s)
                out += [(s, n, 4 * math.sin(x / 2) ** 2, loss / s) for x in ways if x <= math.pi * (1 + 1e-9)]
    elif det > 0 and bend <= 0:
        grow = 2 * math.asinh(math.sqrt(-bend) / 2)
        for s in [1] if exact else strides:
            out.append((s, 0, -grow if exact else -4 * math.sinh(grow / s / 2) ** 2, loss / s))
            if s % 2 == 0 and not exact:
                out.append((s, 0, 4 + 4 * math.sinh(grow / s / 2) ** 2, loss / s))
    elif bend >= 4 and not exact:
        grow = 2 * math.asinh(math.sqrt(bend - 4) / 2)
        out += [(s, 0, 4 + 4 * math.sinh(grow / s / 2) ** 2, loss / s) for s in strides if s % 2 == 1]
    return out


def guesses(table: Table, found: Map, strides: Sequence[int]) -> tuple[Any, Floats]:
    """First guesses: the catalogue row of each (c,), and its stride, turns, a and g (c, 4)."""
    every = np.array(_roots(found, strides, False)).reshape(-1, 4)
    rows: list[Any] = []
    out: list[Any] = []
    for n, row in enumerate(table.rows):
        own = []
        if row.free == "share":
            own = [_held(*x) for x in every.tolist()]
        elif row.formula is not None and row.scheme == "exact" and not row.view:
            own = [_exact(*x, damped=row.damped) for x in _roots(found, strides, True)]
        rows.append(np.full(len(own), n))
        out.append(np.array(own, float).reshape(-1, 4))
    target, loss = every[:, 2], every[:, 3]
    special = [n for n, row in enumerate(table.rows) if row.free == "share" or _is_flow(row)]
    usual = np.ones(len(table.rows), bool)
    usual[special] = False
    if len(every) and np.any(usual):
        r, g, t, a, lost = table.curves.crossed(target, np.where(table.damped, FOLD_DAMPED, FOLD))
        tiny = np.flatnonzero(np.abs(target) < 1e-9)
        if len(tiny):
            each = np.repeat(np.flatnonzero(usual), len(tiny))
            more = np.tile(tiny, len(each) // len(tiny))
            r, t, a = np.append(r, each), np.append(t, more), np.append(a, target[more])
            g, lost = np.append(g, np.zeros(len(each))), np.append(lost, np.zeros(len(each)))
        damped = table.damped[r]
        g = np.where(damped, lost - loss[t], g)
        a = np.where(damped, a + g * g / 4, a)
        least = max(min(1.0, math.exp(float(np.min(loss * every[:, 0], initial=0.0)))), 1e-6)
        error = math.sqrt(max(float(np.max(np.diag(found.cov))), 0.0))
        near = np.abs(lost - loss[t]) < 3e-3 + 0.02 * np.abs(loss[t]) + 30 * error / least
        keep = usual[r] & (near | table.free[r])
        rows.append(r[keep])
        out.append(np.column_stack([every[t, :2], a, g])[keep])
        if np.any(np.abs(loss) > STRONG):
            # of a strong friction the exact solution is nearer than the scheme without it
            with np.errstate(all="ignore"):
                phase = 2 * np.arcsin(np.sqrt(target / 4))
            ok = np.isfinite(phase)
            strong = np.column_stack([every[:, :2], phase**2 + loss**2 / 4, -loss])[ok]
            each = np.flatnonzero(table.damped & usual)
            rows.append(np.repeat(each, len(strong)))
            out.append(np.tile(strong, (len(each), 1)))
    r, got = np.concatenate(rows), np.concatenate(out)
    return _unlike(r, got, np.where(table.damped[r], ALIKE, ALIKE / 16))


def _unlike(r: Any, got: Floats, alike: Floats) -> tuple[Any, Floats]:
    """One of guesses that lie so near each other that they lead to one solution."""
    key = (r * 128 + got[:, 0].astype(int)) * 64 + got[:, 1].astype(int)
    for x in got[:, 2:].T:
        with np.errstate(all="ignore"):
            size = np.clip(np.nan_to_num(np.rint(np.log(np.abs(x)) / alike), neginf=-8e3), -8e3, 8e3)
        key = key * 32768 + 16384 + np.where(x < 0, -1, 1) * (8000 + size).astype(int)
    first = np.sort(np.unique(key, return_index=True)[1])
    return r[first], got[first]


def _is_flow(row: Any) -> bool:
    return row.formula is not None and row.scheme == "exact" and not row.view


def _held(s: int, n: int, bend: float, loss: float) -> tuple[float, ...]:
    """Of a force that stays constant: det = 1 + a (1 - g)."""
    a = bend * math.exp(loss / 2) + (1 - math.exp(loss / 2)) ** 2
    return s, n, a, 1 - math.expm1(loss) / a if a else 0.5


def _exact(s: int, n: int, phase: float, loss: float, *, damped: bool) -> tuple[float, ...]:
    g = max(-loss, 0.0) if damped else 0.0
    return s, n, math.copysign(phase**2, phase) + g * g / 4, g
