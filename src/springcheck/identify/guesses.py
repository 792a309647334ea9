"""First guesses of the free numbers of a row: what its trace and determinant ask for."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from springcheck.identify.measure import Map
from springcheck.identify.rows import Row, bend_of, pieces
from springcheck.physics.arrays import Floats

FEW = 13
"""Strides from here on are tried without whole turns between frames."""


def _roots(found: Map, strides: Iterable[int], exact: bool) -> list[tuple[int, int, float, float]]:
    """Every possible step: number in a frame, whole turns between frames, 2 - trace/sqrt(det), log det; the
    exact solution has one step to a frame, and the phase in place of the third."""
    b = found.b[None]
    bend, loss = (float(x[0]) for x in bend_of(b))
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


def guesses(row: Row, found: Map, strides: Iterable[int]) -> Floats:
    """Rows (stride, turns, a, g) of first guesses."""
    strides = list(strides)
    if row.free == "share":
        return np.array([_held(*x) for x in _roots(found, strides, False)]).reshape(-1, 4)
    if row.formula is not None and row.scheme == "exact" and not row.view:
        return np.array([_exact(*x, damped=row.damped) for x in _roots(found, strides, True)]).reshape(-1, 4)
    every = np.array(_roots(found, strides, False)).reshape(-1, 4)
    target, loss = every[:, 2], every[:, 3]
    out: list[Any] = []
    for parameter in row.start if row.free not in ("", "friction") else (0.0,):
        i, a, lost = _crossed(row, parameter, target, FOLD_DAMPED if row.damped else FOLD)
        g = np.full(len(a), parameter)
        if row.damped:
            g = lost - loss[i]
            a = a + g * g / 4
        if not row.free:
            least = max(min(1.0, math.exp(float(np.min(loss * every[:, 0], initial=0.0)))), 1e-6)
            error = math.sqrt(max(float(np.max(np.diag(found.cov))), 0.0))
            keep = np.abs(lost - loss[i]) < 3e-3 + 0.02 * np.abs(loss[i]) + 30 * error / least
            i, a, g = i[keep], a[keep], g[keep]
        out.append(np.column_stack([every[i, :2], a, g]))
    if row.damped and np.any(np.abs(loss) > STRONG):
        # of a strong friction the exact solution is nearer than the scheme without it
        with np.errstate(all="ignore"):
            phase = 2 * np.arcsin(np.sqrt(target / 4))
        ok = np.isfinite(phase)
        out.append(np.column_stack([every[:, :2], phase**2 + loss**2 / 4, -loss])[ok])
    return np.concatenate(out)


STRONG, FOLD, FOLD_DAMPED = 0.02, 0.02, 0.2
"""Loss from which a friction is strong, and how far beyond an extremum of its curve a row is tried."""


def _held(s: int, n: int, bend: float, loss: float) -> tuple[float, ...]:
    """Of a force that is held: det = 1 + a (1 - g)."""
    a = bend * math.exp(loss / 2) + (1 - math.exp(loss / 2)) ** 2
    return s, n, a, 1 - math.expm1(loss) / a if a else 0.5


def _exact(s: int, n: int, phase: float, loss: float, *, damped: bool) -> tuple[float, ...]:
    g = max(-loss, 0.0) if damped else 0.0
    return s, n, math.copysign(phase**2, phase) + g * g / 4, g


def _crossed(row: Row, parameter: float, target: Floats, fold: float) -> tuple[Any, Floats, Floats]:
    """Where the curve of a row takes each of these values, or nearly does: index of the value, a, log det."""
    which, at, lost = [], [], []
    for piece in pieces(row, parameter):
        low, high = piece.bend[0], piece.bend[-1]
        inside = (target >= low - fold * abs(low)) & (target <= high + fold * abs(high))
        i = np.flatnonzero(inside)
        if len(i):
            which.append(i)
            at.append(np.interp(target[i], piece.bend, piece.a))
            lost.append(np.interp(target[i], piece.bend, piece.loss))
        for end, inner in ((0, 1), (-1, -2)):
            # near an extremum, which the curve may take on either side of it
            near = np.flatnonzero(np.abs(target - piece.bend[end]) <= fold * abs(piece.bend[end]))
            which.append(near)
            at.append(np.full(len(near), piece.a[inner]))
            lost.append(np.full(len(near), piece.loss[inner]))
    tiny = np.flatnonzero(np.abs(target) < 1e-9)
    which, at, lost = [*which, tiny], [*at, target[tiny]], [*lost, 0 * target[tiny]]
    return np.concatenate(which), np.concatenate(at), np.concatenate(lost)
