"""Pairs on a Morse bond, by circular and hyperbolic functions."""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended
from springcheck.physics.exact.closedform import CANCELS, FORM_EPS, ClosedForm, States, by_particle, wide
from springcheck.physics.exact.digits import FEWER_DIGITS, digits, exactly, extended
from springcheck.physics.system import System
from springcheck.physics.terms import Morse

MOST_EXPONENT = np.log(np.finfo(np.longdouble).max) - 64
"""Largest exponent whose exponential, times its factors here, stays finite."""

FAR_PHASE = 64.0
"""Phase whose exponential is so large that 1 is negligible beside it in any precision used here."""


class MorseMotion(ClosedForm):
    """Attractive bonds without other forces: with s = exp(steepness u), s'' = w**2 (excess s + 1), a circular
    or hyperbolic function (Morse 1929).  The centre of mass moves uniformly.

    For each bond (s,): masses of both ends, reduced mass, elongation u, relative momentum p, energy E / depth
    and its excess over 1; w**2 = 2 depth steepness**2 / mass; and the phase of the start from the inner
    turning point, an angle or above dissociation a hyperbolic angle, with its rate.
    """

    key = "morse"
    terms = frozenset({"morse"})

    def __init__(self, system: System[Any]) -> None:
        super().__init__(system)
        (self.term,) = (term for term in system.terms if isinstance(term, Morse))
        term = self.term
        self.need(self.one_each and np.all((term.depth > 0) & (term.steepness != 0)))
        ends = term.a, term.b
        m, q, p = ([wide(x[end]) for end in ends] for x in (system.m, system.q, system.p))
        total, depth, a = m[0] + m[1], wide(term.depth), wide(term.steepness)
        mass = m[0] * m[1] / total
        u, pull = _relative(m, q, p, term.rest)
        # where exp(steepness u) overflows there is no force
        x = np.where(a * u > MOST_EXPONENT, 0, np.exp(-np.minimum(a * u, MOST_EXPONENT)))
        kinetic = (pull / total) ** 2 / (2 * mass * depth)
        # near the minimum the energy is small, near dissociation its excess over 1: neither follows from the
        # other
        excess = kinetic + x * (x - 2)
        near = kinetic + x * (x + 2) > CANCELS * np.abs(excess)
        near |= np.abs(q[1]) + np.abs(q[0]) + np.abs(term.rest) > CANCELS * np.abs(u)
        near |= m[0] * np.abs(p[1]) + m[1] * np.abs(p[0]) > CANCELS * np.abs(pull)
        if np.any(near):
            j = np.flatnonzero(near)
            u[j], pull[j], excess[j] = _of_bonds(
                *([exactly(x[end[j]]) for end in ends] for x in (system.m, system.q, system.p)),
                *(exactly(x[j]) for x in (term.rest, term.depth, term.steepness)),
            )
        y = np.minimum(a * u, MOST_EXPONENT)
        gap, p_ = np.expm1(-y), pull / total
        energy = p_ * p_ / (2 * mass * depth) + gap * gap
        w = np.abs(a) * np.sqrt(2 * depth / mass)
        rate, z, dz = w * np.sqrt(np.abs(excess)), np.expm1(y), a * p_ / mass * np.exp(y)
        safe = np.where(rate > 0, rate, 1)
        root = np.sqrt(energy)
        endless = np.arcsinh(dz * excess / (safe * np.where(root > 0, root, 1)))
        self.start = np.where(
            excess < 0,
            np.arctan2(-dz * excess / safe, energy + excess * z),
            # there arcsinh is a logarithm
            endless + np.sign(endless) * (a * u - y),
        )
        self.masses, self.mass, self.share = m, mass, m[0] / total
        self.u, self.p, self.energy, self.excess, self.w, self.rate = u, p_, energy, excess, w, rate

    def at(self, t: Extended) -> States:
        term, share = self.term, self.share
        stretch, speed = self._stretched(wide(term.steepness), t)
        u, pull = stretch / term.steepness, self.mass * speed / term.steepness
        total = wide(self.system.p[term.a]) + self.system.p[term.b]
        qa, qb = wide(self.system.q[term.a]), wide(self.system.q[term.b])
        centre = share * qa + (1 - share) * qb + total / (self.masses[0] + self.masses[1]) * t
        length = term.rest + u
        q = np.concatenate([centre - (1 - share) * length, centre + share * length], axis=-1)
        p = np.concatenate([share * total - pull, (1 - share) * total + pull], axis=-1)
        return by_particle(np.append(term.a, term.b), q, p)

    def _stretched(self, a: Extended, t: Extended) -> States:
        """log(s) and its time derivative at times t.

        At the inner turning point s = 1/(1 + root), root**2 = 1 + excess; from there on it grows by root
        (cosh(phase) - 1) / excess, or root (1 - cos(phase)) / |excess|, without cancellation.  Far beyond
        dissociation only root exp(|phase|) / (2 excess) of it remains, whose logarithm cannot overflow.
        """
        root, bound, edge = np.sqrt(self.energy), self.excess < 0, self.excess == 0
        phase = self.rate * t + self.start
        turn, run = np.where(bound, phase, 0), np.where(bound, 0, phase)
        far = np.abs(run) > FAR_PHASE
        endless, run = np.where(far, run, FAR_PHASE), np.where(far, 0, run)
        half, whole = (np.where(bound, np.sin(x), np.sinh(y)) for x, y in ((turn / 2, run / 2), (turn, run)))
        size = np.where(edge, 1, np.abs(self.excess))
        z, dz = 2 * root * half * half / size - root / (root + 1), root * self.rate * whole / size
        leaving = np.abs(endless) + np.log(np.where(far, root / (2 * size), 1))
        # at exactly the dissociation energy a parabola
        fast = np.where(edge, a * self.p / self.mass, 0)
        slow = np.where(edge, self.w**2 * np.exp(np.where(edge, -a * self.u, 0)), 0)
        grown = fast * t + slow * t * t / 2
        u, v = np.where(far, leaving, np.log1p(z)), np.where(far, self.rate * np.sign(endless), dz / (1 + z))
        edge_u, edge_v = a * self.u + np.log1p(grown), (fast + slow * t) / (1 + grown)
        return np.where(edge, edge_u, u), np.where(edge, edge_v, v)

    def doubt(self, t: np.longdouble) -> States:
        system, term = self.system, self.term
        a = np.abs(wide(term.steepness))
        root = np.sqrt(self.energy)
        speed = np.sqrt(2 * term.depth * self.energy / self.mass)
        time = np.abs(t) + np.abs(self.start) / np.where(self.rate > 0, self.rate, 1) + 2 / self.w
        bound = self.excess < 0
        reach = np.where(
            bound, -np.log(np.where(bound, -self.excess, 1) / (1 + root)) / a, np.abs(self.u) + speed * time
        )
        force = 2 * term.depth * a * (1 + root) * root
        ends = term.a, term.b
        pushed = sum(np.abs(wide(system.p[end])) for end in ends)
        far = sum(np.abs(wide(system.q[end])) for end in ends) + np.abs(term.rest)
        far = far + pushed / (system.m[term.a] + system.m[term.b]) * np.abs(t)
        q = FORM_EPS * (far + np.abs(self.u) + reach + speed * time)
        p = FORM_EPS * (pushed + self.mass * speed + force * time)
        return by_particle(np.append(*ends), np.tile(q, 2), np.tile(p, 2))


def _relative(m: Any, q: Any, p: Any, rest: Any) -> tuple[Any, Any]:
    """Elongation, and momentum times the sum of both masses."""
    return q[1] - q[0] - rest, m[0] * p[1] - m[1] * p[0]


def _of_bonds(m: Any, q: Any, p: Any, rest: Any, depth: Any, a: Any) -> tuple[Extended, Extended, Extended]:
    """Elongation, relative momentum times both masses, and E / depth - 1, computed in more digits."""
    with digits():
        u, pull = _relative(m, q, p, rest)
    with digits(FEWER_DIGITS):
        x = np.exp(-a * u)
        excess = pull * pull / (2 * m[0] * m[1] * (m[0] + m[1]) * depth) + x * (x - 2)
        return extended(u), extended(pull), extended(excess)
