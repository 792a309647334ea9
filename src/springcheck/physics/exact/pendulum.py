"""Pendulums, librating and rotating, by Jacobi's elliptic functions; also on rods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended
from springcheck.physics.exact.closedform import CANCELS, FORM_EPS, PI, ClosedForm, States, by_particle, wide
from springcheck.physics.exact.digits import digits, exactly, extended, pi, sine_cosine
from springcheck.physics.exact.elliptic import argument, jacobi, latency
from springcheck.physics.system import System
from springcheck.physics.terms import Cosine, Weight


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Swing:
    """Pendulums of a term: half the angle from the lowest point, in (-pi/2, pi/2], its sine and cosine, its
    rate in units of w, and R**2 = m = 1 - m1 = E / 2 depth, all (s,)."""

    length: Extended
    mass: Extended
    w: Extended
    half: Extended
    sine: Extended
    cosine: Extended
    rate: Extended
    m: Extended
    m1: Extended

    def at(self, t: Extended) -> States:
        """Half the angle, and its rate in units of w, at times t: libration, sin(angle/2) =
        R sn(w t + phase | R**2), and rotation, angle/2 = am(R w t + phase | 1/R**2).

        w**2 = depth wave**2 / mass; Landau & Lifshitz, Mechanics, section 11.
        """
        s, c, r, m, m1 = self.sine, self.cosine, self.rate, self.m, self.m1
        over = m1 < 0
        # in rotation the modulus is 1/m, and the arguments grow sqrt(m) times as fast
        fast = np.where(over, np.sqrt(m), 1)
        safe = np.where(m > 0, m, 1)
        modulus, other = np.where(over, 1 / safe, m), np.where(over, -m1 / safe, m1)
        phase = argument(np.where(over, np.sign(r) * s, s), np.where(over, c, r), modulus, other)
        am, sn, cn, dn = jacobi(self.w * t * fast + phase, modulus, other)
        root = np.sqrt(m)
        half = np.where(over, np.sign(r) * am, np.arctan2(root * sn, dn))
        return half, np.where(over, np.sign(r) * root * dn, root * cn)

    @property
    def latency(self) -> Extended:
        """Bound on the time [T] from the lowest point to the start, as far as rounding determines it."""
        return latency(self.m1 / np.maximum(self.m, 1)) / self.w


def _swing(system: System[Any], term: Cosine) -> _Swing:
    i, wave, depth = term.i, wide(term.wave), np.abs(wide(term.depth))
    mass, p = wide(system.m[i]), wide(system.p[i])
    # for a negative depth the lowest point is at half a turn
    turned = np.where(term.depth < 0, PI / 2, 0)
    angle = wave * (wide(system.q[i]) - term.at) / 2 + turned
    half = angle - PI * np.round(angle / PI)
    rate = p / (2 * np.sqrt(mass * depth))
    sine, cosine = np.sin(half), np.cos(half)
    m1 = (cosine - rate) * (cosine + rate)
    size = wave * (np.abs(wide(system.q[i])) + np.abs(term.at)) / 2 + turned
    near = (size > CANCELS * np.minimum(cosine, np.abs(half))) | (cosine**2 + rate**2 > CANCELS * np.abs(m1))
    for j in np.flatnonzero(near):
        one = system.m[i[j]], system.q[i[j]], system.p[i[j]], term.depth[j], term.wave[j], term.at[j]
        half[j], sine[j], cosine[j], m1[j] = _of_swing(*(exactly(x)[()] for x in one))
    return _Swing(
        length=1 / wave, mass=mass, w=np.sqrt(depth / mass) * wave, half=half, sine=sine, cosine=cosine,
        rate=rate, m=sine * sine + rate * rate, m1=m1,
    )  # fmt: skip


def _of_swing(m: Any, q: Any, p: Any, depth: Any, wave: Any, at: Any) -> Extended:
    """Half the angle, its sine and cosine, and m1 of one pendulum."""
    with digits():
        angle = wave * (q - at) / 2 + (pi() / 2 if depth < 0 else 0)
        half = angle - pi() * (angle / pi()).to_integral_value()
        sine, cosine = sine_cosine(half)
        m1 = cosine * cosine - p * p / (4 * m * abs(depth))
        return extended(np.array([half, sine, cosine, m1], dtype=object))


class PendulumMotion(ClosedForm):
    """Pendulums along an axis, librating and rotating."""

    key = "cosine"
    terms = frozenset({"cosine"})

    def __init__(self, system: System[Any]) -> None:
        super().__init__(system)
        (self.term,) = (term for term in system.terms if isinstance(term, Cosine))
        self.need(np.all(self.term.depth != 0) and self.one_each)
        self.swing = _swing(system, self.term)

    def at(self, t: Extended) -> States:
        i, swing = self.term.i, self.swing
        a, r = swing.at(t)
        q = self.system.q[i] + swing.length * (2 * (a - swing.half))
        return by_particle(i, q, swing.mass * swing.length * 2 * swing.w * r)

    def doubt(self, t: np.longdouble) -> States:
        i, swing = self.term.i, self.swing
        root = np.sqrt(swing.m)
        size = 2 * swing.length * np.minimum(root, PI / 2)
        speed = 2 * swing.length * swing.w * root
        time = np.abs(t) + swing.latency
        force = swing.mass * swing.w**2 * np.minimum(size, swing.length)
        q = FORM_EPS * (np.abs(self.system.q[i]) + size + speed * time)
        return by_particle(i, q, FORM_EPS * (swing.mass * speed + force * time))


class HangingRods(ClosedForm):
    """Rods to fixed points in a plane with a weight on each: the angle from the weight is that of a pendulum,
    w**2 = force / (mass length).  Unit vectors along the weight and across it are (c, 2)."""

    key = "weight"
    terms = frozenset({"weight", "wall-rod"})

    def __init__(self, system: System[Any]) -> None:
        """In extra digits: near the barrier the motion depends on the energy's small difference from it."""
        super().__init__(system)
        rods: Any = system.rods
        self.need(rods and not rods.share and all(len(ends) == 1 for ends in rods.ends))
        self.need(system.n == 2 * len(rods))
        shape = (len(rods), 2)
        with digits():
            at, weight = exactly(np.zeros((2, system.n)))
            for term in system.terms:
                if isinstance(term, Weight):
                    np.add.at(weight, term.i, exactly(term.force))
                else:
                    at[term.particles[0]] = exactly(getattr(term, term.origin))
            given: Any = exactly(system.q) - at, exactly(system.p), weight, exactly(system.m)
            (x, y), (u, v), (a, b), (m, _) = (rods.apart(of).reshape(shape).T for of in given)
            square, force = x * x + y * y, a * a + b * b
            self.need(np.all(force != 0))
            both = np.sqrt(square * force)
            low, side, area = x * a + y * b, a * y - b * x, x * v - y * u
            # both - |low| without its cancellation
            sum_, less = both + np.abs(low), side * side / (both + np.abs(low))
            down, up = (np.where(here, sum_, less) for here in (low > 0, low <= 0))
            sine, cosine = np.sqrt(up / (2 * both)), np.sqrt(down / (2 * both))
            rest = 2 * m * square
            parts = {
                "length": np.sqrt(square), "mass": m, "w": np.sqrt(both / m / square),
                "sine": np.where(side < 0, -sine, sine), "cosine": cosine,
                "rate": area / np.sqrt(2 * rest * both),
                "m1": (rest * down - area * area) / (2 * rest * both),
            }  # fmt: skip
            swing = {name: extended(values) for name, values in parts.items()}
            size = np.sqrt(force)
            self.start = extended(np.stack([x, y], axis=1)).ravel()
            self.across = extended(np.stack([-b / size, a / size], axis=1))
        half, m_ = np.arctan2(swing["sine"], swing["cosine"]), swing["sine"] ** 2 + swing["rate"] ** 2
        self.down = np.stack([self.across[:, 1], -self.across[:, 0]], axis=1)
        self.rods, self.swing = rods, _Swing(half=half, m=m_, **swing)

    def at(self, t: Extended) -> States:
        rods, swing = self.rods, self.swing
        half, rate = swing.at(t)
        sine, cosine = np.sin(2 * half)[..., None], np.cos(2 * half)[..., None]
        speed = (swing.length * 2 * swing.w * rate)[..., None]
        r = swing.length[:, None] * (cosine * self.down + sine * self.across)
        v = speed * (cosine * self.across - sine * self.down)
        rows = (*t.shape[:-1], -1)
        q = self.system.q + rods.spread(r.reshape(rows) - self.start)
        return wide(q), wide(rods.spread((swing.mass[:, None] * v).reshape(rows)))

    def doubt(self, t: np.longdouble) -> States:
        rods, swing = self.rods, self.swing
        speed = 2 * swing.length * swing.w * np.sqrt(swing.m)
        time = np.abs(t) + swing.latency
        q = rods.spread(rods.each(swing.length + speed * time))
        p = rods.spread(rods.each(swing.mass * (speed + swing.w**2 * swing.length * time)))
        return wide(FORM_EPS * (np.abs(self.system.q) + q)), wide(FORM_EPS * p)
