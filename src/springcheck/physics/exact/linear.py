"""The exact solution of linear scenes: without friction circular functions for w2 > 0, hyperbolic ones for
w2 < 0, a parabola for w2 = 0; with friction the same, decaying.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from springcheck.physics.arrays import EPS, Extended, States, by_identity
from springcheck.physics.exact.normal import Modes, discriminant, split

SMALLEST = np.finfo(np.longdouble).tiny
ROUNDINGS = 32
"""Rounding errors of a motion in extended precision, for each of its summands and for its phase."""


class LinearMotion:
    """A whole system that has normal modes."""

    def __init__(self, system: Any) -> None:
        self.system = system
        self.modes: Modes = system.modes

    def at(self, t: Extended) -> States:
        """q and p (f, n) at times t (f, 1) [T]."""
        found, start = self.modes, self.modes.start
        law = _Law(found.w2, found.rate, found.pull, start.slow, start.fast)
        return found.from_centres(*_moved(start.u, start.v, t, law))

    def doubt(self, t: np.longdouble) -> States:
        """See `solution.Motion`.

        A mode is known to a few roundings of its amplitude, of its phase, and of the summands of its start.
        Errors of the equations themselves, y'' = -A y - r y' + g, act as forces, and a force f moves y by at
        most |t f| min(t, 1/w) (variation of constants).
        """
        found = self.modes
        y, v, of_y, of_v = self._of_modes(t)
        y, v = found.spread(y) + of_y, found.spread(v) + of_v
        return np.asarray(y / found.root_m), np.asarray(v * found.root_m)

    def energy_of_doubt(self, t: np.longdouble) -> np.longdouble | None:
        """Bound on the energy of the error at time t [M L2/T2]; None where `doubt` is the tightest bound."""
        if not self.modes.waves:
            return None
        y, v, of_y, of_v = self._of_modes(t)
        w = np.sqrt(np.max(self.modes.w2))
        of_modes = _length(np.hypot(np.sqrt(self.modes.w2) * y, v))
        known: np.longdouble = (of_modes + np.hypot(w * of_y, of_v)) ** 2 / 2
        return known

    def _of_modes(self, t: np.longdouble) -> tuple[Any, ...]:
        """Error bounds (n,) of each mode's position and velocity, and those that modes share.

        In a uniform chain these are of the transform, an orthogonal one: some log2(n) roundings of the norm
        of its argument (Higham, Accuracy and Stability of Numerical Algorithms, 24.1), three times that where
        n + 1 has large factors (Bluestein); the exact solution propagates the error of the start unchanged.
        """
        system, found = self.system, self.modes
        reach, speed, phase, hold = reaches(found, t)
        joined, duration = found.vectors is not None, np.abs(t)
        last = (ROUNDINGS + (system.n if joined else 0)) * EPS
        y, v = last * ((1 + phase) * reach + np.abs(found.centre())), last * (1 + phase) * speed
        # of joined particles friction rates that differ by rounding count as one
        uneven = np.ptp(found.rate)
        if not found.waves:
            force = found.doubt * reach + (uneven * speed if joined else 0)
            if np.any(found.doubt):
                zero = np.zeros(system.n, dtype=np.longdouble)
                force = force + last * system.magnitude()(zero, zero) / found.root_m
            if not joined:
                return y + duration * hold * force, v + duration * force, 0, 0
            # coupling may concentrate the errors of all modes in one
            kick = duration * _length(force)
            return y, v, np.max(hold) * kick, kick
        v, transform = v + duration * uneven * speed, 24 * np.log2(8 * (system.n + 1)) * EPS
        whole_y, whole_v = (_length(x) for x in found.into(system.q, system.p))
        w, driven = np.sqrt(np.max(found.w2)), np.exp(np.maximum(-t, 0) * np.max(found.rate))
        of_y = transform * (
            driven * (whole_y + np.max(hold) * whole_v) + _length(found.centre()) + _length(reach)
        )
        of_v = transform * (driven * (whole_v + w * whole_y) + _length(speed))
        return y, v, of_y, of_v


def flow(w2: Extended, rate: Extended, t: np.longdouble) -> Extended:
    """Matrices (n, 2, 2) that take (u, u') of u'' = -w2 u - rate u' over a time t [T]; w2, rate (n,)."""
    w2, rate = (np.repeat(x, 2) for x in (w2, rate))
    u, v = np.tile(np.eye(2, dtype=np.longdouble), len(w2) // 2)
    slow, fast, _ = split(u, v, w2, rate)
    y, z = _moved(u, v, np.full((1, 1), t), _Law(w2, rate, np.zeros_like(w2), slow, fast))
    return np.stack([y.reshape(-1, 2), z.reshape(-1, 2)], axis=1)


def _moved(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    """u and u' (f, n) at times t (f, 1), from u and v (n,)."""
    y, z = np.empty((2, len(t), len(u)), dtype=np.longdouble)
    turns, slows = law.w2 != 0, law.rate != 0
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        for kind, one in (
            (turns & ~slows, _undamped),
            (turns & slows, _damped),
            (~turns & ~slows, _free),
            (~turns & slows, _with_friction),
        ):
            if np.any(kind):
                y[:, kind], z[:, kind] = one(u[kind], v[kind], t, _Law(*(x[kind] for x in law)))
    return y, z


@by_identity
class _Law(NamedTuple):
    """u'' = -w2 u - rate u' + pull, the pull only where w2 = 0 (elsewhere u is relative to the centre)."""

    w2: Extended
    rate: Extended
    pull: Extended
    slow: Extended
    fast: Extended
    """Shares of the two exponentials, where the motion is a sum of these (see `Start`)."""


def _undamped(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    """Hyperbolic for w2 < 0: from |phase| = 1 on as two exponentials, either of which may be absent."""
    w = np.sqrt(np.abs(law.w2))
    phase = t * w
    turning = law.w2 > 0
    apart = ~turning & (np.abs(phase) > 1)
    near = np.where(turning | apart, 0, phase)
    cosine = np.where(turning, np.cos(phase), np.cosh(near))
    sine = np.where(turning, np.sin(phase), np.sinh(near))
    sign = np.where(turning, -1, 1)
    y, z = u * cosine + v / w * sine, v * cosine + sign * w * u * sine
    if np.any(apart):
        # an absent exponential does not grow, not even beyond the range of numbers
        up, down = (np.where(x == 0, 0, x * np.exp(to)) for x, to in ((law.slow, phase), (law.fast, -phase)))
        y, z = np.where(apart, up + down, y), np.where(apart, w * (up - down), z)
    return np.asarray(y), np.asarray(z)


def _damped(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    """With b = rate/2 and s**2 = w2 - b**2: exp(-b t) (u (cos st + b S) + v S), S = sin(st)/s.

    Hyperbolic beyond critical damping.  There the slow root -b + s would cancel and exp(-b t) cosh(st) would
    be 0 times infinity; from st = 1 on the two exponentials are computed separately, with the slow root as
    -w2 / (b + s).  Near critical damping S -> t, and nothing is divided by s.
    """
    b, square, s = discriminant(law.w2, law.rate)
    angle = s * t
    turning = square > 0
    apart = ~turning & (np.abs(angle) > 1)
    near = np.where(apart, 0, angle)
    safe = np.where(s > 0, s, 1)
    short = np.abs(near) < 2.0**-33
    cosine = np.where(turning, np.cos(near), np.cosh(np.where(turning, 0, near)))
    sine = np.where(turning, np.sin(near), np.sinh(np.where(turning, 0, near))) / safe
    sine = np.where(short, t, sine)
    decay = np.exp(-b * t)
    y = decay * (u * (cosine + b * sine) + v * sine)
    z = decay * (v * (cosine - b * sine) - law.w2 * u * sine)
    if np.any(apart):
        fast = -(b + s)
        slow = -law.w2 / (b + s)
        late, early = (
            np.where(x == 0, 0, x * np.exp(to * t)) for x, to in ((law.slow, slow), (law.fast, fast))
        )
        y = np.where(apart, late + early, y)
        z = np.where(apart, slow * late + fast * early, z)
    return np.asarray(y), np.asarray(z)


def _free(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    return np.asarray(u + v * t + law.pull * t * t / 2), np.asarray(v + law.pull * t)


def _with_friction(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    x = law.rate * t
    gone = -np.expm1(-x) / law.rate
    # (x - 1 + exp(-x)) / x**2, by its series where it would cancel
    small = np.abs(x) < 1
    near, far = np.where(small, x, 0), np.where(small, 1, x)
    series, term = np.zeros_like(x), np.full_like(x, 0.5)
    for k in range(3, 26):
        series, term = series + term, -term * near / k
    fallen = np.where(small, series, (far + np.expm1(-far)) / (far * far))
    return u + v * gone + law.pull * t * t * fallen, v * np.exp(-x) + law.pull * gone


def _length(x: Extended) -> Extended:
    return np.asarray(np.sqrt(np.sum(x * x)))


def reaches(found: Modes, t: np.longdouble) -> tuple[Extended, Extended, Extended, Extended]:
    """Bounds on |u|, |v|, the phase, which is known to rounding, and the response of u to a unit kick, from
    the start to time t, for each mode (n,)."""
    u, v, slow, fast = found.start.sizes
    duration, b, w = np.abs(t), found.rate / 2, np.sqrt(np.abs(found.w2))
    turns, falls = found.w2 > 0, found.w2 < 0
    rate = np.sqrt(w * w + b * b)
    # exp(-b t) sin(st)/s, or 1 - exp(-2 b t) over 2 b
    slowest = np.where(turns, np.maximum(w, b) / 2, np.where(falls, rate, 2 * b))
    hold = np.minimum(duration, 1 / np.where(slowest > 0, slowest, SMALLEST))
    drive = np.where(found.w2 == 0, np.abs(found.pull), 0)
    reach = 3 * u + (v + drive * duration) * hold
    speed = 3 * v + w * w * u * hold + drive * hold
    phase = (w + b) * duration
    if t < 0:
        square = b * b - found.w2
        driven = np.exp((b + np.sqrt(np.maximum(square, 0))) * duration)
        # near critical damping t exp(b t) grows, and errors of the roots with the cube of t
        longer = np.minimum(duration, 1 / np.sqrt(np.maximum(np.abs(square), SMALLEST)))
        hold = np.where(turns, np.maximum(hold, longer), hold)
        wider = np.where(turns, np.maximum(1, w * longer), 1)
        reach = (3 * u * wider + (v + drive * duration) * hold) * driven
        speed = (3 * v * wider + w * w * u * hold + drive * hold) * driven
        phase = phase * wider
    else:
        phase = np.where(turns & (b > 0), w * np.minimum(duration, 1 / np.where(b > 0, b, 1)), phase)
        phase = np.where((found.w2 == 0) & (b > 0), 0, phase)
    up, down = w * w / np.where(b + rate > 0, b + rate, 1), b + rate
    late, early = slow * np.exp(np.maximum(up * t, 0)), fast * np.exp(np.maximum(-down * t, 0))
    reach = reach + np.where(falls, late + early, 0)
    speed = speed + np.where(falls, up * late + down * early, 0)
    return np.asarray(reach), np.asarray(speed), np.asarray(phase), np.asarray(hold)
