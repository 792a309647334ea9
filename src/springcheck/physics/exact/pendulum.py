"""Pendulums, librating and rotating, by Jacobi's elliptic functions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended
from springcheck.physics.exact.closedform import CANCELS, FORM_EPS, PI, ClosedForm, States, by_particle, wide
from springcheck.physics.exact.digits import digits, exactly, extended, pi, sine_cosine
from springcheck.physics.exact.elliptic import argument, jacobi, latency
from springcheck.physics.system import System
from springcheck.physics.terms import Cosine


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
