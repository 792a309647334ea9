"""Positions alone: the recurrence q[n+1] - T q[n] + D q[n-1] = c of one step's trace and determinant.

On a spring every one-step scheme obeys it, and schemes of equal trace and determinant have equal positions:
velocity Verlet, leapfrog, semi-implicit Euler and position Verlet.  T and D give a frequency and a change of
areas.  Without friction a scheme relates the two; with friction every scheme fits on some spring, so that
only a stated stiffness excludes any.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from springcheck.identify.coarse import is_white
from springcheck.identify.compare import Target, solved
from springcheck.identify.families import Family
from springcheck.identify.fit import KURTOSIS, LEAST_NOISE
from springcheck.identify.guesses import FLOW_TURNS, Guesses, Roots, first
from springcheck.identify.hypothesis import ERRORS, Match, Terms, distinct
from springcheck.identify.maps import MapTable, table, unit
from springcheck.identify.noise import least_squares
from springcheck.identify.record import Record
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Extended, Floats, Reals

FEWEST_FRAMES = 9
"""Five unknowns of an orbit, and as many frames again that they have to explain."""

UNUSUAL = 2.5
"""Largest residual that is white noise, in units of the expected rounding, 4 + 2 sqrt(steps)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recurrence:
    """alpha = 1 + D - T and beta = 1 - D of one oscillator, which do not cancel for small steps."""

    alpha: np.longdouble
    beta: np.longdouble
    covariance: Floats
    residual: float
    """Root mean square residual, relative to the positions."""
    ulp: float
    """Largest residual, in units of 2**-52 of the sum of the terms."""
    precision: str
    """The arithmetic, or the storage format, that explains the residuals; "" where none does."""

    @property
    def phase(self) -> float:
        """Phase between two frames, 0 where nothing turns."""
        return _phase(self.alpha, self.beta)

    @property
    def log_det(self) -> float:
        return float(np.log1p(-self.beta))

    @property
    def preserving(self) -> bool:
        """Whether areas are preserved to within the errors."""
        return abs(float(self.beta)) <= ERRORS * math.sqrt(self.covariance[1, 1])


def recurrence(record: Record, j: int, steps: int) -> Recurrence:
    """Recurrence of oscillator j, with at most `steps` steps between frames."""
    q = record.q[:, j]
    stored = record.q_quantum[:, j] / np.sqrt(12.0)
    size = np.abs(q).astype(np.float64)
    size = size[2:] + 2 * size[1:-1] + size[:-2]
    size = np.maximum(size, LEAST_NOISE * np.max(size))
    noise = np.sqrt((ROUNDING * size) ** 2 + stored[2:] ** 2 + 4 * stored[1:-1] ** 2 + stored[:-2] ** 2)
    noise = np.maximum(noise, LEAST_NOISE * np.max(noise))
    # a frame may lie off by the rounding of its time, on its way of up to a turn more than it shows
    amplitude = _around(np.abs(q - np.mean(q)).astype(np.float64))[1:-1]
    alpha, beta, covariance, left = _neighbours(q, noise, record.deviations)
    scale = float(np.std(q.astype(np.float64)))
    residual = float(np.sqrt(np.mean(left**2))) / scale
    ulp = float(np.max(np.abs(left) / (2.0**-52 * size)))
    usual = 4 + 2 * math.sqrt(steps)
    clock = record.clock * amplitude if record.deviations is not None else 0.0 * amplitude
    # each of four frames may lie half a rounding of its time away, on the way that the motion shows
    on_way = 2 * _phase(alpha, beta) * clock

    def explained(rounding: float, beside: Floats | float = 0.0) -> bool:
        def off(allowed: Floats | float) -> float:
            return float(np.max(np.maximum(np.abs(left) - beside - allowed, 0) / (rounding * size)))

        if off(on_way) <= usual:
            return True
        return off(2 * np.pi * clock) <= UNUSUAL * usual and is_white((left / noise)[:, None])

    precision = ""
    if record.fine:
        precision = "double" if explained(2.0**-52) else ""
    else:
        whole = _orbit(q, stored, alpha, beta)
        if whole is not None:
            alpha, beta, covariance = whole
            precision = record.q_storage.name
        elif explained(2.0**-23, 2 * np.sqrt(12.0) * (stored[2:] + 2 * stored[1:-1] + stored[:-2]) / 4):
            precision = record.q_storage.name
    # a coefficient is rounded once and the same in every step, which no number of frames averages away
    own = ROUNDING if record.fine or precision == record.q_storage.name != "single" else 2.0**-24
    coherent = np.array([64 * abs(float(alpha)) + 4, 4.0]) * steps * own
    return Recurrence(
        alpha=alpha, beta=beta, covariance=covariance + np.diag(coherent**2), residual=residual, ulp=ulp,
        precision=precision,
    )  # fmt: skip


def _phase(alpha: np.longdouble, beta: np.longdouble) -> float:
    """Phase between two frames, 0 where nothing turns."""
    square = 4 * alpha - (alpha + beta) ** 2
    return float(np.arctan2(np.sqrt(square), 2 - alpha - beta)) if square > 0 and beta < 1 else 0.0


def _around(x: Floats) -> Floats:
    """Running maximum over each number and three neighbours on either side."""
    wide = np.pad(x, 3, mode="edge")
    return np.asarray(np.max(np.lib.stride_tricks.sliding_window_view(wide, 7), axis=1))


def _neighbours(
    q: Extended, noise: Floats, deviations: Extended | None
) -> tuple[np.longdouble, np.longdouble, Floats, Floats]:
    """alpha, beta, their covariance (2, 2) and the residuals (f - 2,), from neighbouring frames.  Steps that
    follow the `deviations` of the times displace frames along the motion."""
    weight = (1 / noise)[:, None]
    # a motion that grows is not centred by its largest frames
    share = 1 / np.square(noise / np.min(noise))
    about = q - np.sum(share * q[1:-1]) / np.sum(share)
    columns = np.stack([-about[1:-1], about[:-2] - about[1:-1], np.ones(len(q) - 2)], axis=1)
    second = (about[2:] - about[1:-1]) - (about[1:-1] - about[:-2])
    right = np.asarray(second[:, None] * weight, np.longdouble)
    x = least_squares(np.asarray(columns * weight, np.longdouble), right)[:, 0]
    left = (second - columns @ x).astype(np.float64)
    if deviations is not None and len(left) > 4 * FEWEST_FRAMES:
        moved = [1e12 * s[:, None] * columns[:, :2] for s in (deviations[1:], deviations[:-1])]
        wide = np.concatenate([columns, *moved], axis=1)
        y = least_squares(np.asarray(wide * weight, np.longdouble), right)[:, 0]
        rest = (second - wide @ y).astype(np.float64)
        lost, kept = (float(np.sum((r / noise) ** 2)) for r in (left, rest))
        if lost - kept > 200 * max(kept, 0.1 * len(left)) / len(left):
            x, left, columns = y, rest, wide
    even = (columns * weight).astype(np.float64)
    scale = np.maximum(np.sqrt(np.sum(even**2, axis=0)), 1e-300)
    inverse = np.linalg.pinv((even / scale).T @ (even / scale)) / scale[:, None] / scale
    variance = max(float(np.sum((left / noise) ** 2)) / max(len(left) - 3, 1), 0.1)
    # positions that were rounded once stand on both sides of the recurrence
    bias = 6 * float(np.mean(noise**2)) / max(float(np.mean(np.diff(about.astype(np.float64)) ** 2)), 1e-300)
    return x[0], x[1], variance * inverse[:2, :2] + bias**2 * np.eye(2), left


def _orbit(
    q: Extended, unit_: Floats, alpha: np.longdouble, beta: np.longdouble
) -> tuple[np.longdouble, np.longdouble, Floats] | None:
    """alpha, beta and their covariance from one orbit c + r**n (A cos + B sin)(n phase), if all frames are
    this orbit to the rounding of their storage; else None."""
    frames = len(q)
    values = (q - q[0]).astype(np.float64)
    n = np.arange(frames, dtype=np.float64)
    unit_ = np.maximum(unit_, _around(unit_) / 64)
    phase = _phase(alpha, beta)
    if not beta < 1:
        return None
    x = np.array([0.5 * math.log1p(-float(beta)), phase])
    for _ in range(30):
        wave = np.exp(np.clip(x[0] * n, -60, 60))
        c, s = wave * np.cos(x[1] * n), wave * np.sin(x[1] * n)
        basis = np.stack([c, s, np.ones(frames)], axis=1) / unit_[:, None]
        amplitude = np.linalg.lstsq(basis, values / unit_, rcond=None)[0]
        u, w = amplitude[0] * c + amplitude[1] * s, amplitude[1] * c - amplitude[0] * s
        slopes = np.concatenate([np.stack([n * u, n * w], axis=1) / unit_[:, None], basis], axis=1)
        left = values / unit_ - basis @ amplitude
        size = np.sqrt(np.sum(slopes**2, axis=0))
        if not np.all(np.isfinite(slopes)) or not np.all(size > 0):
            return None
        across, triangle = np.linalg.qr(slopes / size)
        if np.linalg.cond(triangle) > 1e9:
            return None
        change = np.linalg.solve(triangle, across.T @ left) / size
        x = x + np.clip(change[:2], -1 / frames, 1 / frames)
        if np.sum((across.T @ left) ** 2) <= 1e-12 * max(float(np.sum(left**2)), 1.0):
            break
    else:
        return None
    # a uniform error has a fourth moment of 9/5 of its variance squared, and ends at sqrt(3) of them
    most = frames + ERRORS * math.sqrt(KURTOSIS * frames) + 1
    if left @ left > most or np.max(np.abs(left)) > math.sqrt(3) + 0.5:
        return None
    inverse = np.linalg.inv(triangle)
    covariance = (inverse @ inverse.T / size[:, None] / size)[:2, :2]
    growth, phase = x.tolist()
    r = math.exp(growth)
    bent = 4 * r * math.sin(phase / 2) ** 2
    slope = np.array([[bent - 2 * (1 - r) * r, 2 * r * math.sin(phase)], [-2 * r * r, 0.0]])
    return np.longdouble((1 - r) ** 2 + bent), np.longdouble(1 - r * r), slope @ covariance @ slope.T


def recurrence_of(m: Reals) -> tuple[Reals, Reals]:
    """1 + det - trace and 1 - det of maps (c, 2, 2)."""
    # (1 - M11)(1 - M22) - M12 M21 is 1 + det - trace without the cancellation
    one, other, product = 1 - m[:, 0, 0], 1 - m[:, 1, 1], m[:, 0, 1] * m[:, 1, 0]
    alpha = one * other - product
    return alpha, one + other - alpha


@cache
def classes() -> tuple[tuple[Family, ...], ...]:
    """Classes of undamped schemes whose positions agree for every step."""
    every = distinct(damped=False)
    alike = (tuple(y for y in every if np.allclose(_shape(x), _shape(y), rtol=0, atol=1e-13)) for x in every)
    return tuple(dict.fromkeys(alike))


@cache
def _shape(family: Family) -> Reals:
    """alpha and beta (2, 3) of a family at three steps."""
    a = np.array([0.3, 0.7, 1.1])
    return np.stack(recurrence_of(unit(family, a, np.zeros(3))))


class PositionTarget(Target):
    """The recurrence of positions alone: 1 + det - trace and 1 - det of a map, with their covariance."""

    def __init__(self, found: Recurrence) -> None:
        self.terms = Terms()
        self.observed = np.array([found.alpha, found.beta])
        # two numbers of very unlike size: eigenvectors of double precision do not part them
        size = np.sqrt(np.diag(found.covariance))
        values, axes = np.linalg.eigh(found.covariance / size[:, None] / size)
        self.axes, self.variance = axes / size[:, None], values

    def weight(self, every: MapTable, x: Guesses, s: Floats) -> Floats:
        return np.asarray(1 / np.sqrt(self.variance[:, None]) * np.ones(len(s)))

    def entries(self, every: MapTable, x: Guesses, s: Floats, values: Reals) -> Reals:
        ones = np.ones(len(s), np.longdouble)
        out = every.frame(x.which, values[0], values[1], 0 * ones, s, ones)
        return np.stack(recurrence_of(out.T.reshape(-1, 2, 2)))


def matches(found: Recurrence, families: tuple[Family, ...], strides: range) -> list[Match]:
    """Fits of the families to a recurrence, for each number of steps and of turns and each spring.  Positions
    do not show the sense of rotation."""
    every = table(families)
    ways = [(s, i) for s in strides for i in range(max(s, FLOW_TURNS if s == 1 else 1) + 1)]
    s, i = np.array(ways, np.float64).T
    turns = (i + 1) // 2
    phases = (np.where(i % 2, -1.0, 1.0) * found.phase + 2 * np.pi * turns) / s
    keep = phases > 0
    s, turns, phases = s[keep], turns[keep], phases[keep]
    each = found.log_det / s
    det, trace = np.exp(each), 2 * np.exp(each / 2) * np.cos(phases)
    ones = np.ones_like(s)
    step = np.stack([trace - 1, ones, trace - 1 - det, ones], axis=1).reshape(-1, 2, 2)
    roots = Roots(s, turns, phases, each, step, 0.0)
    with np.errstate(all="ignore"):
        x = first(every, roots, growing=False, free_scale=True, far=True)
        if not every.damped:
            # the area of a frame is known, and that of a scheme without friction beside it
            own = np.log(np.abs(np.linalg.det(every.unit(x.which, x.a, x.g)))) * s[x.root]
            room = 0.02 * np.abs(own) + 1e-4 + 100 * math.sqrt(found.covariance[1, 1])
            near = np.flatnonzero(np.abs(own - found.log_det) <= room)
            x = x[near]
        return solved(every, PositionTarget(found), roots, x, every_turn=True)
