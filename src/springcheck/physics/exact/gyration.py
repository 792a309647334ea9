"""The exact solution of a charge in a magnetic field, on an isotropic spring or free, with friction or not.

In its plane z = x + i y moves by z'' + (r + i W) z' + w2 z = 0, W the field's strength over the mass: the
sum of two exponentials (Fock-Darwin, or Foucault's pendulum, where w2 > 0).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended
from springcheck.physics.exact.closedform import CANCELS, FORM_EPS, ClosedForm, States, by_particle
from springcheck.physics.exact.digits import digits, exactly, extended
from springcheck.physics.exact.normal import exact_sums, normal_modes
from springcheck.physics.exact.response import first_difference
from springcheck.physics.system import System


class Gyration(ClosedForm):
    """A whole scene of charges in a field, each on an isotropic spring or free: particles (s,) in planes of
    coordinates a and b, the two roots of their motion, and the start z and v about their centres (n,)."""

    def __init__(self, system: System[Any]) -> None:
        """No other terms, and none that is unequal on both coordinates of a plane."""
        super().__init__(system)
        planes = [term for term in system.terms if term.key == "magnetic"]
        self.need(len(planes) == 1 and set(system.acting) <= {"magnetic", "wall-spring", "damping"})
        self.a, self.b = a, b = planes[0].particles
        self.need(len(np.unique(np.append(a, b))) == system.n == len(a) * 2)
        modes = normal_modes(system.without("magnetic"))
        self.need(np.all(modes.w2[a] == modes.w2[b]) and np.all(modes.rate[a] == modes.rate[b]))
        turn = np.zeros(system.n, np.longdouble)
        turn[a] = planes[0].parameters[0] / system.m[a].astype(np.longdouble)
        half = (modes.rate[a] + 1j * turn[a]) / 2
        square = half * half - modes.w2[a]
        # where a field barely holds against a repulsive spring, the error here grows with the cube of time
        lost = CANCELS * np.abs(square) < np.abs(half * half) + np.abs(modes.w2[a])
        # and an orbit may be small beside the distance of its centre from 0
        with digits():
            k, pull, rate = exact_sums(system.without("magnetic"), np.diagonal)
            centre = np.where(k == 0, 0 * k, pull / np.where(k == 0, 1, k))
            q = extended(exactly(system.q) - centre)
            if np.any(lost):
                m, field = exactly(system.m)[a], exactly(planes[0].parameters[0])
                real, imag = (rate[a] ** 2 - (field / m) ** 2) / 4 - k[a] / m, rate[a] * field / m / 2
                square = np.where(lost, extended(real) + 1j * extended(imag), square)
        root = np.sqrt(square)
        # the larger root without cancellation, the other by their product
        self.other = far = -half - np.where((half.conjugate() * root).real < 0, -root, root)
        self.one = np.where(far == 0, 0, modes.w2[a] / np.where(far == 0, 1, far))
        v = system.p / system.m.astype(np.longdouble)
        self.z, self.v, self.centre = q[a] + 1j * q[b], v[a] + 1j * v[b], extended(centre)

    def at(self, t: Extended) -> States:
        one, other = self.one, self.other
        part = first_difference(one, other, t)
        slope = np.exp(one * t) + other * part
        z = self.z * (np.exp(one * t) - one * part) + self.v * part
        v = -self.z * one * other * part + self.v * slope
        parts = (np.concatenate([x.real, x.imag], axis=-1) for x in (z, v))
        q, p = by_particle(np.append(self.a, self.b), *parts)
        return q + self.centre, p * self.system.m

    def doubt(self, t: np.longdouble) -> States:
        """Rounding of its angles, times the largest state."""
        one, other, z, v = self.one, self.other, np.abs(self.z), np.abs(self.v)
        grown = np.exp(np.maximum(np.maximum((one * t).real, (other * t).real), 0))
        rate = np.maximum(np.abs(one), np.abs(other))
        gap = np.abs(one - other)
        hold = np.minimum(np.abs(t), 2 / np.where(gap > 0, gap, 1e-300))
        far = z * (1 + np.abs(one) * hold) + v * hold
        fast = np.abs(self.z * one * other) * hold + v * (1 + np.abs(other) * hold)
        sizes = (np.tile(FORM_EPS * (1 + rate * np.abs(t)) * grown * x, 2) for x in (far, fast))
        q, p = by_particle(np.append(self.a, self.b), *sizes)
        return q + FORM_EPS * np.abs(self.centre), p * self.system.m
