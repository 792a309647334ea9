"""The one-step map between frames of one oscillator, by generalised least squares.

z[n+1] = B z[n] + c + p[n], recorded as z + e.  The residuals have the covariance A S A^T + P, a band matrix;
in double precision e = 0, and every pair of frames counts by itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from springcheck.identify.record import Record
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Extended, Floats

GROWS = 30
"""Ratio of sizes of frames from which on each frame counts by its own size."""


@dataclass(eq=False)
class Map:
    """z -> B z between frames, z = (q - centre, v T)/size, with what the fit leaves over."""

    b: Extended
    cov: Floats
    size: Extended
    centre: Extended
    z: Extended
    noise: Floats
    """Standard error (f, 2) of the recorded states; 0 in double precision."""
    unit: Floats
    """Roundoff (f - 1,) of a step."""
    chi2: float
    freedom: int
    level: float
    """Root mean square of the roundings of a step, in units of double precision's."""
    drifts: bool
    """Whether a constant is added to the velocity, or to position and velocity, in every frame."""
    stored: bool
    """Whether rounding when written explains all residuals."""

    @cached_property
    def left(self) -> Floats:
        """Residuals (f - 1, 2) of every pair."""
        return np.asarray(self.z[1:] - self.z[:-1] @ self.b.T, np.float64)

    @cached_property
    def relative(self) -> Floats:
        """Residuals in units of the expected error of each."""
        var = self.noise[1:] ** 2 + (self.noise[:-1] ** 2) @ (self.b.T.astype(float) ** 2)
        level = max(self.level, 1.0) if not self.stored and np.any(self.noise) else 1.0
        return np.asarray(self.left / np.sqrt(var + (self.unit[:, None] * level) ** 2))

    @property
    def size_left(self) -> float:
        """Root mean square of what the map leaves over, relative to the state."""
        return float(np.sqrt(np.mean(self.left**2) / np.mean(np.sum(self.z[:-1].astype(float) ** 2, 1))))

    @property
    def turns(self) -> float:
        """Periods of the motion in all frames, as far as frames show them."""
        b = self.b.astype(float)
        det = float(b[0, 0] * b[1, 1] - b[0, 1] * b[1, 0])
        half = float(b[0, 0] + b[1, 1]) / 2 / math.sqrt(det) if det > 0 else 2.0
        return len(self.unit) * math.acos(half) / (2 * math.pi) if abs(half) < 1 else math.inf

    @property
    def base(self) -> Floats:
        """Expected error (f - 1,) of a pair: roundoff and recording."""
        return np.asarray(np.hypot(self.unit, np.max(self.noise[1:], 1)))

    @property
    def spans(self) -> bool:
        """Whether the states span the plane beyond what the map leaves over."""
        w = (self.z[:-1] / np.maximum(self.unit[:, None], 1e-300)).astype(float)
        least = float(np.linalg.eigvalsh(w.T @ w / len(w))[0])
        return least > 100 * max(float(np.mean(self.relative**2)), 1.0) and bool(
            np.all(np.isfinite(self.cov))
        )

    @property
    def unscaled(self) -> Floats:
        return np.asarray(self.b * self.size[:, None] / self.size[None, :], np.float64)

    @property
    def excess(self) -> float:
        """Root mean square of what the map leaves over, in units of rounding: 1 where nothing is left."""
        if self.stored or not np.any(self.noise):
            return float(np.sqrt(np.mean(self.relative**2)))
        return max(self.level, 1.0)


class Band:
    """The covariance of residuals by errors `noise` (f, 2) of states and `unit` (f - 1,) of steps."""

    def __init__(self, b: Floats, noise: Floats, unit: Floats) -> None:
        s, n = noise**2, len(unit)
        block = np.einsum("ij,nj,kj->nik", b, s[:-1], b)
        block[:, 0, 0] += s[1:, 0] + unit**2
        block[:, 1, 1] += s[1:, 1] + unit**2
        self.scale = np.sqrt(np.stack([block[:, 0, 0], block[:, 1, 1]], 1))
        below = -b[None] * s[1:-1, None, :] / self.scale[1:, :, None] / self.scale[:-1, None, :]
        band = np.zeros((4, 2 * n))
        band[0] = 1 + 1e-12
        band[1, ::2] = block[:, 1, 0] / self.scale[:, 0] / self.scale[:, 1]
        band[1, 1:-1:2], band[2, :-2:2] = below[:, 0, 1], below[:, 0, 0]
        band[2, 1:-1:2], band[3, :-2:2] = below[:, 1, 1], below[:, 1, 0]
        from scipy.linalg import cholesky_banded

        self.factor = cholesky_banded(band, lower=True)
        self.log_det = 2 * float(np.sum(np.log(self.factor[0])) + np.sum(np.log(self.scale)))

    def solve(self, x: Floats) -> Floats:
        """V**-1 x of columns (f - 1, 2, k)."""
        y = x / self.scale[:, :, None]
        from scipy.linalg import cho_solve_banded

        solved = cho_solve_banded((self.factor, True), y.reshape(-1, x.shape[2]))
        return np.asarray(solved.reshape(x.shape) / self.scale[:, :, None])


def least_squares(columns: Any, right: Any) -> tuple[Any, Any]:
    """Least squares in extended precision, and the inverse of the normal matrix."""
    size = np.sqrt(np.sum(columns**2, 0))
    size = np.where(size > 0, size, 1)
    x = columns / size
    inverse = np.linalg.pinv((x.T @ x).astype(float), rcond=1e-15, hermitian=True)
    out = inverse @ (x.T @ right)
    for _ in range(4):
        out = out + inverse @ (x.T @ (right - x @ out))
    scale = size.astype(float)
    return out / size[:, None], inverse / scale[:, None] / scale


@dataclass(eq=False)
class _Fit:
    b: Any
    centre: Any
    inverse: Any
    chi2: float
    log_det: float
    numbers: int


def _pairs(z: Any, unit: Floats, numbers: int) -> _Fit:
    """Every pair by itself; `numbers` 0 without a constant, 1 of an equilibrium, 2 of any."""
    w = (1 / unit)[:, None].astype(np.longdouble)
    centre = np.zeros(2, np.longdouble)
    if numbers == 0:
        x, inverse = least_squares(z[:-1] * w, z[1:] * w)
        b = x.T
    else:
        x, inverse = least_squares(np.column_stack([z[:-1], np.ones(len(unit))]) * w, z[1:] * w)
        b = x[:2].T
        way = (np.eye(2) - b)[:, :numbers]
        centre[:numbers] = np.linalg.pinv(way.astype(float)) @ x[2]
        for _ in range(4 if numbers == 1 else 0):
            # an equilibrium whose velocity is 0: one number, in turn with the map
            s = z - centre
            x, inverse = least_squares(s[:-1] * w, s[1:] * w)
            b = x.T
            left, way = (s[1:] - s[:-1] @ b.T) * w, (np.eye(2) - b)[:, 0]
            centre[0] += np.sum(left * (w * way)) / np.sum((w * way) ** 2)
            inverse = np.pad(inverse, ((0, 1), (0, 1)))
    left = (((z[1:] - centre) - (z[:-1] - centre) @ b.T) * w).astype(float)
    cov = np.kron(np.eye(2), inverse[:2, :2])
    return _Fit(b, centre, cov, float(np.sum(left**2)), 4 * float(np.sum(np.log(unit))), 4 + numbers)


def _orbit(z: Any, noise: Floats, unit: Floats, start: _Fit, numbers: int) -> _Fit:
    """Gauss-Newton with all frames together."""
    b, centre, best = start.b.copy(), start.centre.copy(), None
    for _ in range(12):
        s = z - centre
        left = (s[1:] - s[:-1] @ b.T).astype(float)
        v = Band(b.astype(float), noise, unit)
        w = v.solve(left[:, :, None])[:, :, 0]
        chi2 = float(np.sum(left * w))
        if best is not None and not chi2 + v.log_det < best.chi2 + best.log_det:
            break
        seen = s.astype(float)
        if chi2 < 200 * len(left):
            # the states as they were before they were rounded
            wrong = np.zeros_like(noise)
            wrong[1:] += w
            wrong[:-1] -= w @ b.astype(float)
            seen = seen - noise**2 * wrong
        j = np.zeros((len(left), 2, 4 + numbers))
        j[:, 0, :2] = j[:, 1, 2:4] = seen[:-1]
        j[:, :, 4:] = (np.eye(2) - b.astype(float))[None, :, :numbers]
        vj = v.solve(j).reshape(-1, 4 + numbers)
        square = j.reshape(-1, 4 + numbers).T @ vj
        size = np.sqrt(np.maximum(np.diag(square), 1e-300))
        inverse = np.linalg.pinv(square / size[:, None] / size, rcond=1e-14, hermitian=True)
        inverse = inverse / size[:, None] / size
        best = _Fit(b, centre, inverse[:4, :4], chi2, v.log_det, 4 + numbers)
        gradient = vj.T @ left.ravel()
        step = inverse @ gradient
        if gradient @ step < 1e-3:
            break
        b = b + step[:4].reshape(2, 2)
        centre = centre.copy()
        centre[:numbers] += step[4:]
    return best or start


def _scaled(record: Record, j: int) -> tuple[Any, Any]:
    """States (q, v T) of a coordinate in units of their spread, and these units; of what grows or dies each
    frame counts by its own size."""
    z = np.stack([record.q[:, j], record.v[:, j] * record.interval], 1).astype(np.longdouble)
    spread = np.std(z, 0)
    size = np.where(spread > 0, spread, 1)
    about = np.mean(z, 0) if np.max(np.abs(z)) < GROWS * np.max(spread) else 0
    for _ in range(3):
        norm = np.sqrt(np.sum(((z - about) / size) ** 2, 1))
        share = np.sqrt(np.mean((z / size / np.where(norm > 0, norm, 1)[:, None]) ** 2, 0))
        if np.all(share > 0) and np.max(norm) > GROWS * np.min(norm):
            size = size * share
    return z / size, size


def measure(record: Record, j: int, kept: Any = None, most: int = 2) -> Map:
    """The map of coordinate j from the pairs that are `kept` (f - 1,), with a constant of `most` numbers."""
    from scipy.special import fdtri

    z, size = _scaled(record, j)
    pace = abs(float(record.interval))
    quanta = np.stack([record.dq[:, j] * record.coarse[0], record.dv[:, j] * pace * record.coarse[1]], 1)
    noise = quanta / np.sqrt(12) / size.astype(float)
    row = np.max(noise, 1, keepdims=True)
    noise = np.maximum(noise, np.where(row > 0, row, np.median(row)) / 8)
    own: Any = 0.0
    if record.mixed and record.fine:
        own = np.hypot(record.dq[:, j], record.dv[:, j] * pace)[1:] / float(np.max(size)) / 2

    def unit_of(centre: Any) -> Floats:
        away = np.sqrt(np.sum((z - centre).astype(float) ** 2, 1))
        out = np.maximum(away[1:], away[:-1]) + float(np.sqrt(np.sum(centre.astype(float) ** 2)))
        out = np.maximum(ROUNDING * np.maximum(out, 1e-130 * np.max(out)), own)
        return np.asarray(out if kept is None else np.where(kept, out, 1e10 * np.max(out)))

    unit = unit_of(np.zeros(2))
    rough = unit if record.fine else np.hypot(unit, np.max(noise[1:], 1))
    pairs = 2 * len(unit) if kept is None else 2 * int(np.count_nonzero(kept))
    level, stored = 1.0, True

    def fitted(numbers: int, before: _Fit | None) -> _Fit:
        one = _pairs(z, rough, numbers)
        if record.fine:
            return one
        start = before if before and before.numbers == 4 + numbers else one
        return _orbit(z, noise, unit * level, start, numbers)

    best = fitted(0, None)
    least = max(1 / 16, min(4.0, 8 / max(pairs - 6, 1))) if record.fine else 1.0
    for numbers in (1, 2)[:most] if record.fine else (1,):
        spare = pairs - 4 - numbers
        if spare < 2 or best.chi2 <= spare * least:
            break
        more = fitted(numbers, None)
        gain = (best.chi2 + best.log_det - more.chi2 - more.log_det) / max(more.chi2 / spare, least)
        shift = np.max(np.abs((np.eye(2) - more.b) @ (more.centre - best.centre)))
        if numbers == 2 and shift < 64 * ROUNDING * np.max(np.abs(z)):
            continue
        if gain > max(50.0 if record.fine else 10.0, float(fdtri(1, spare, 1 - 1e-6))):
            best = more
            unit = unit_of(best.centre)
            if record.fine:
                rough, best = unit, _pairs(z, unit, numbers)
    numbers, freedom = best.numbers - 4, max(pairs - best.numbers, 1)
    if not record.fine and best.chi2 > freedom + 5 * math.sqrt(0.8 * freedom + 1):
        # rounded in every step as well: the size of that is fitted
        level = float(np.median(np.max(noise[1:], 1) / unit))
        for _ in range(5):
            best = fitted(numbers, best)
            share = best.chi2 / freedom
            if 0.9 < share < 1.1:
                break
            level *= math.sqrt(max(share, 0.05))
        stored = False
    elif record.fine:
        level = math.sqrt(best.chi2 / freedom)
    if record.fine:
        # roundings of states that hardly change from frame to frame are alike
        each = ((z[1:] - best.centre) - (z[:-1] - best.centre) @ best.b.T).astype(float) / unit[:, None]
        alike = float(np.sum(each[1:] * each[:-1]) / max(float(np.sum(each * each)), 1e-300))
        best.inverse = best.inverse * min(max((1 + alike) / (1 - alike), 1.0), 50.0)
    repeats = len(z) / len(np.unique(z.astype(float) @ [1, 1j]))
    scale = max(best.chi2 / freedom, least) * (1.0 if record.fine else repeats)
    return Map(
        best.b, best.inverse * scale, size, best.centre * size, z - best.centre, noise, unit, best.chi2,
        freedom, level, numbers == 2, stored,
    )  # fmt: skip
