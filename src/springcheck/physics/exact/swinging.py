"""Pairs on a bond of a rest length that oscillate along it without rotation.

The length oscillates as a spring of the reduced mass about its rest length, the direction is constant, and
the centre of mass moves uniformly.  Rounding of the start leaves some rotation, bounded by the transverse
velocities.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended
from springcheck.physics.exact.closedform import FORM_EPS, ClosedForm, States, wide
from springcheck.physics.exact.digits import Wide, digits, exactly, extended, summed
from springcheck.physics.system import System

START_TOLERANCE = 2.0**-46
"""Largest relative transverse velocity at the start: 64 roundings, as of numbers written with all digits."""


class SwingingMotion(ClosedForm):
    """Arrays by coordinate (n,): signed share of the length, and direction; the centre and its velocity;
    excess of the length and its rate at the start, rest length, frequency, amplitude, and the transverse
    speed."""

    key = "bond"
    terms = frozenset({"bond"})

    def __init__(self, system: System[Any]) -> None:
        """No bond may rotate, reach length 0, or share a particle with another."""
        super().__init__(system)
        term: Any = system.terms[0]
        self.need(self.one_each)
        a, b = term.a, term.b
        bond = np.unique(term.number, return_inverse=True)[1]

        def over_axes(values: Wide) -> Wide:
            return summed(values, bond, system.n)[bond]

        # separations and velocities are differences, which may be small beside their operands
        with digits():
            m, q, p, k, rest = (exactly(x) for x in (system.m, system.q, system.p, term.k, term.rest))
            whole, d, v = m[a] + m[b], q[b] - q[a], p / m
            apart, square = v[b] - v[a], over_axes(d * d)
            self.need(np.all(square != 0) and np.all(term.k > 0))
            s = np.sqrt(square)
            e, rate = d / s, over_axes(d * apart) / s
            across, speed = over_axes((apart - rate * e) ** 2), over_axes(v[a] ** 2 + v[b] ** 2) / 2
            rows = extended(
                np.stack([
                    e, (m[a] * q[a] + m[b] * q[b]) / whole, (p[a] + p[b]) / whole,
                    (square - rest * rest) / (s + rest), rate, rest, np.sqrt(k * whole / m[a] / m[b]),
                    np.sqrt(across), np.sqrt(speed),
                ])
            )  # fmt: skip
            share = extended(np.concatenate([-m[b], m[a]]) / np.tile(whole, 2))
        ends = np.argsort(np.concatenate([a, b]))
        self.share, rows = share[ends], np.tile(rows, 2)[:, ends]
        self.along, self.centre, self.drift, self.u, self.rate, self.rest, self.w, self.across, speed = rows
        with np.errstate(all="ignore"):
            self.most = np.hypot(self.u, self.rate / self.w)
        self.need(np.all((self.rest > self.most) & (self.across <= START_TOLERANCE * speed)))

    def at(self, t: Extended) -> States:
        sine, cosine = np.sin(self.w * t), np.cos(self.w * t)
        way = self.share * self.along
        q = self.centre + self.drift * t + way * (self.rest + self.u * cosine + self.rate * sine / self.w)
        speed = self.drift + way * (self.rate * cosine - self.u * self.w * sine)
        return wide(q), wide(self.system.m * speed)

    def doubt(self, t: np.longdouble) -> States:
        time, share, far = np.abs(t), np.abs(self.share), self.rest + self.most
        near, w = self.rest - self.most, self.w
        # a bound on the angle from the conserved angular momentum, and the displacement by its centrifugal
        # force
        turned = self.across * time * far / near**2 * far
        pushed = (self.across * far / w) ** 2 / near**3
        phase = 2 + w * time
        q = FORM_EPS * (np.abs(self.centre) + np.abs(self.drift) * time + share * (far + self.most * phase))
        size = np.abs(self.drift) + share * self.most * w * phase
        swung = w * (turned + pushed * phase) + self.across * far / near
        p = self.system.m * (FORM_EPS * size + share * swung)
        return wide(q + share * (turned + pushed * phase)), wide(p)
