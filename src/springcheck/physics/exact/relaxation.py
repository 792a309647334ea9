"""Van der Pol's oscillator in extended precision: without a closed form, it is integrated once for all times.

With u = (q - at)/width it is u'' = (g (1 - u**2) - r) u' - w2 (u - u0), stiff by g**2/w2.  The unknowns are
the velocities at the nodes of Radau IIA (Hairer & Wanner, Solving ODEs II, IV.8): on the slow arcs, where
terms cancel, the equation determines all digits of u', and steps may skip what has decayed.  Steps are as
long as the Legendre series of u' ends in rounding.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from springcheck.physics.arrays import EPS, Extended, Floats, by_identity
from springcheck.physics.exact.closedform import FORM_EPS, ClosedForm, States, wide
from springcheck.physics.exact.digits import digits, exactly, extended
from springcheck.physics.exact.normal import exact_sums
from springcheck.physics.system import System
from springcheck.physics.terms import VanDerPol

RADAU_STAGES = 16
TIME_ERROR = FORM_EPS / 4
"""Relative error of the time; `validation/van_der_pol.py` finds errors of at most 0.075 of the resulting
bound."""
SERIES_TAIL = 32 * EPS
"""Largest share of a step's last two series coefficients in its largest one."""
FELT_ROUNDING = 8 * EPS
"""Relative change of u at one step that is equivalent to the roundings of all steps; near |u| = 1, where the
friction is nearly 0, and before a jump, it is amplified. In 300 starts there it was at most 0.53 of this."""
MOST_RADAU_STEPS = 20_000
MOST_RADAU_CORRECTIONS = 40


@by_identity
class _Rule(NamedTuple):
    """Nodes c (s,) on [0, 1], A (s, s), and the matrix from values to Legendre coefficients (s, s)."""

    nodes: Extended
    a: Extended
    series: Extended


class _Law(NamedTuple):
    """g, r, w2 and u0 of one particle."""

    g: np.longdouble
    r: np.longdouble
    w2: np.longdouble
    centre: np.longdouble


@by_identity
class _Path(NamedTuple):
    """The ends of its steps t (j + 1,), u at their starts (j,), and the series of u' (j, s)."""

    t: Extended
    u: Extended
    series: Extended
    fastest: tuple[float, float, float]
    """The largest |u|, |u'| and |u''| along the path."""
    growth: float
    """The largest |D phi| between any two ends of steps, in the energy norm."""
    felt: tuple[float, float]
    """The largest change of u and of u' by a unit relative change of u at the start of any step."""


@by_identity
class _Nodes(NamedTuple):
    """u, u' and u'' at the nodes of a step (s,), and the derivative of its end by its start (2, 2)."""

    u: Extended
    v: Extended
    push: Extended
    tangent: Floats


def _legendre(x: Extended, count: int) -> Extended:
    """P_0 to P_(count - 1) at x (...,) -> (..., count)."""
    found = [np.ones_like(x), x]
    for j in range(1, count - 1):
        found.append(((2 * j + 1) * x * found[j] - j * found[j - 1]) / (j + 1))
    return np.stack(found[:count], axis=-1)


def _integrals(x: Extended, count: int) -> Extended:
    """Their integrals from -1 to x (..., count)."""
    p, j = _legendre(x, count + 1), np.arange(1, count)
    return np.concatenate([x[..., None] + 1, (p[..., 2:] - p[..., :-2]) / (2 * j + 1)], axis=-1)


@lru_cache(maxsize=1)
def _rule() -> _Rule:
    s = RADAU_STAGES
    # all but the last are zeros of Jacobi's polynomial (1, 0): eigenvalues of a symmetric matrix, all real
    k = np.arange(s - 1)
    jacobi = np.diag(-1 / ((2 * k + 1) * (2 * k + 3))) + np.diag((np.sqrt(k * (k + 1)) / (2 * k + 1))[1:], -1)
    x = np.append(np.linalg.eigvalsh(jacobi), 1).astype(np.longdouble)
    for _ in range(4):
        p = _legendre(x[:-1], s + 1)
        # (x**2 - 1) P_s' = s (x P_s - P_(s-1))
        slopes = [n * (x[:-1] * p[:, n] - p[:, n - 1]) for n in (s, s - 1)]
        x[:-1] -= (p[:, s] - p[:, s - 1]) * (x[:-1] ** 2 - 1) / (slopes[0] - slopes[1])
    p = _legendre(x, s)
    series = np.linalg.inv(p.astype(np.float64)).astype(np.longdouble)
    for _ in range(3):
        series = np.asarray(series @ (2 * np.eye(s) - p @ series), np.longdouble)
    return _Rule((1 + x) / 2, wide(_integrals(x, s) @ series / 2), series)


def _step(law: _Law, u: Any, v: Any, h: Any, guess: Extended) -> _Nodes | None:
    """A step of h from (u, v), None where Newton's iteration does not converge."""
    rule = _rule()
    found, last = guess, np.inf
    # near u = 1 the friction is nearly 0, and cancellation amplifies the rounding of u: all nodes share one
    # value
    first = law.g * ((1 - u) * (1 + u)) - law.r
    for _ in range(MOST_RADAU_CORRECTIONS):
        moved = h * (rule.a @ found)
        at = u + moved
        brake = first - law.g * (moved * (2 * u + moved))
        push = brake * found - law.w2 * (at - law.centre)
        residual = found - v - h * (rule.a @ push)
        steep = -2 * law.g * at * found - law.w2
        reach = np.asarray(h * rule.a, np.float64)
        matrix = np.eye(RADAU_STAGES) - reach @ (np.diag(brake) + steep[:, None] * reach).astype(np.float64)
        scale = np.max(np.abs(residual))
        if not np.isfinite(scale):
            return None
        change = scale and np.linalg.solve(matrix, (residual / scale).astype(np.float64)) * scale
        found = found - change
        off, size = float(np.max(np.abs(change))), float(np.max(np.abs(found)))
        if off <= 4 * EPS * size or (off <= 64 * EPS * size and off > last / 4):
            # response of Newton's solution to a change of u and of v at the start
            by = np.linalg.solve(
                matrix, np.stack([reach @ steep, np.ones(RADAU_STAGES)], axis=-1).astype(np.float64)
            )
            return _Nodes(at, found, push, np.stack([np.eye(2)[0] + reach[-1] @ by, by[-1]]))
        last = off
    return None


@lru_cache(maxsize=8)
def _path(law: _Law, u: Any, v: Any, end: Any) -> _Path | None:
    """The motion from (u, v) up to a time, None where Newton's iteration or the steps come to no end."""
    t, ts = wide(0), [wide(0)]
    us: list[Any] = []
    rows: list[Extended] = []
    maps: list[Floats] = []
    rate = abs(law.g) * (1 + u * u) + abs(law.r) + np.sqrt(abs(law.w2))
    h, rule = 1 / np.where(rate > 0, rate, 1), _rule()
    most: Any = [abs(u), abs(v), np.longdouble(0)]
    series, before = np.zeros(RADAU_STAGES, np.longdouble), wide(0)
    while t < end:
        if len(rows) == MOST_RADAU_STEPS or not t + h > t:
            return None
        guess = np.full(RADAU_STAGES, v)
        if before > 0 and h <= 2 * before:
            guess = _legendre(1 + 2 * rule.nodes * h / before, RADAU_STAGES) @ series
        met = _step(law, u, v, h, guess) or _step(law, u, v, h, np.full(RADAU_STAGES, v))
        if met is None:
            h = h / 4
            continue
        of = rule.series @ met.v
        tail = np.max(np.abs(of[-2:])) / np.max(np.abs(of))
        factor = 0.9 * (SERIES_TAIL / np.maximum(tail, SERIES_TAIL / 1e12)) ** (1 / (RADAU_STAGES - 1))
        if tail > 4 * SERIES_TAIL:
            h = h * np.clip(factor, 0.1, 0.9)
            continue
        ts.append(t + h)
        us.append(u)
        rows.append(of)
        maps.append(met.tangent)
        most = [max(x, np.max(np.abs(y))) for x, y in zip(most, met[:3], strict=True)]
        t, u, v, series, before = wide(t + h), met.u[-1], met.v[-1], wide(of), wide(h)
        h = h * np.clip(factor, 0.3, 3)
    slow = float(np.sqrt(np.abs(law.w2))) or 1 / float(t)
    growth, felt = _growth(np.stack(maps), slow, np.stack(us).astype(float))
    fastest: Any = tuple(float(x) for x in most)
    return _Path(np.stack(ts), np.stack(us), np.stack(rows), fastest, growth, felt)


def _growth(maps: Floats, w: float, u: Floats) -> tuple[float, tuple[float, float]]:
    """The largest |D phi| of consecutive steps, from each start to each later end, on (w u, v), and the
    largest effect on u and on v of a unit relative change of u at these starts (j,)."""
    scaled = maps * np.array([[1, w], [1 / w, 1]])
    whole, most, felt = np.empty((0, 2, 2)), 1.0, np.zeros(2)
    for j, one in enumerate(scaled, 1):
        whole = np.asarray(one @ np.concatenate([whole, np.eye(2)[None]]), np.float64)
        most = max(most, float(np.sqrt(np.max(np.sum(whole**2, axis=(1, 2))))))
        felt = np.maximum(felt, np.max(np.abs(whole[:, :, 0] * u[:j, None]), axis=0))
    return most, (float(felt[0]), float(felt[1] * w))


class VanDerPolMotion(ClosedForm):
    """Single particles with van der Pol friction, on springs to walls."""

    key = "van-der-pol"
    terms = frozenset({"van-der-pol", "wall-spring", "damping"})

    def __init__(self, system: System[Any]) -> None:
        """At most one such friction on a particle; backwards in time the motion diverges."""
        super().__init__(system)
        self.paths: list[tuple[np.longdouble, np.longdouble, tuple[float, float], _Path]] = []
        """Of each particle the place and the width of its friction, its start, and its motion."""
        term = next(term for term in system.terms if isinstance(term, VanDerPol))
        self.need(system.scene.step > 0 and len(term) == len(np.unique(term.i)) == system.n)
        with digits():
            k, springs, _ = exact_sums(system.without(term.key), np.diagonal)
        for i, c, width, at in sorted(term.rows()):
            m, wall, wide_at = (np.longdouble(x) for x in (system.m[i], width, at))
            self.need(k[i] or not springs[i])
            with digits():
                # the force at `at`, in units of the stiffness: where the springs rest; far from 0 it cancels
                away = (springs[i] - k[i] * exactly(at)[()]) / (k[i] or 1)
                stiffness, rests = extended(np.array([k[i], away], object))
            w2, centre = stiffness / m, rests / wall
            law = _Law(np.longdouble(c) / m, system.friction_rates[i], w2, centre)
            start = float(system.q[i]), float(system.p[i])
            u, v = (system.q[i] - wide_at) / wall, np.longdouble(system.p[i]) / m / wall
            self.need(u != centre or v != 0)
            path: Any = _path(law, u, v, np.longdouble(system.scene.step) * system.scene.steps)
            self.need(path)
            self.paths.append((wide_at, wall, start, path))
        self.growth = max(path.growth for *_, path in self.paths)

    def at(self, t: Extended) -> States:
        """NaN beyond the end of the scene."""
        q, p = np.full((2, len(t), self.system.n), np.nan, dtype=np.longdouble)
        for i, (at, width, start, path) in enumerate(self.paths):
            inside = np.flatnonzero((t[:, 0] >= 0) & (t[:, 0] <= path.t[-1]))
            times = t[inside, 0]
            j = np.clip(np.searchsorted(path.t, times) - 1, 0, len(path.u) - 1)
            h = path.t[j + 1] - path.t[j]
            x = 2 * (times - path.t[j]) / h - 1
            series = path.series[j]
            u = path.u[j] + h / 2 * np.sum(series * _integrals(x, RADAU_STAGES), axis=-1)
            q[inside, i] = at + width * u
            p[inside, i] = width * np.sum(series * _legendre(x, RADAU_STAGES), axis=-1) * self.system.m[i]
            q[t[:, 0] == 0, i], p[t[:, 0] == 0, i] = start
        return q, p

    def doubt(self, t: np.longdouble) -> States:
        """Errors of size and position, and the larger of a time known to `TIME_ERROR` and amplified
        rounding."""
        ats, widths, _, paths = zip(*self.paths, strict=True)
        u, v, a = np.array([np.array(x.fastest) * float(w) for x, w in zip(paths, widths, strict=True)]).T
        late, at = TIME_ERROR * np.abs(t), np.abs(ats)
        felt = FELT_ROUNDING * np.array([w * np.array(x.felt) for x, w in zip(paths, widths, strict=True)]).T
        dq, dv = np.maximum(FORM_EPS * u + late * v, felt[0]), np.maximum(FORM_EPS * v + late * a, felt[1])
        return np.asarray(FORM_EPS * at + dq), np.asarray(dv * self.system.m)
