"""Rods without other forces: alone, or as flat rigid bodies that rotate about a perpendicular axis.

x(t) = x cos(w t) + v sin(w t)/w about a uniformly moving centre of mass, or about a fixed point.  In a drift
of h such a body rotates by asin(h w) under SHAKE and RATTLE: x + h v is x rotated by that angle plus an
excess (1 - cos) x, which impulses along its rods can balance.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from springcheck.physics import graph
from springcheck.physics.arrays import Extended, Integers
from springcheck.physics.exact.closedform import FORM_EPS, ClosedForm, NoClosedFormError, States, wide
from springcheck.physics.exact.digits import Wide, digits, exactly, extended, summed
from springcheck.physics.rods import START_TOLERANCE, Rods
from springcheck.physics.system import System


class TurningRods(ClosedForm):
    """Flat rigid bodies.  Arrays by coordinate (n,): position x and velocity v from the centre, the distance
    `reach` of its particle, the angular velocity w, and the velocity `drift` of the centre.
    """

    key = "rod"
    terms = frozenset({"rod"})

    def __init__(self, system: System[Any]) -> None:
        super().__init__(system)
        rods, places, n = system.rods, system.scene.all_places, system.scene.particles
        assert rods is not None
        of, at = _bodies(system, rods), np.zeros(system.n)
        for term in system.terms:
            if term.origin:
                at[term.particles[0]] = getattr(term, term.origin)
        held = np.isin(np.arange(n), [ends[0] for ends in rods.ends if len(ends) == 1])[:, None]

        def by_axes(values: Any) -> Any:
            out = np.zeros((n, 3), values.dtype)
            out.reshape(-1)[places] = values
            return out

        def whole(values: Wide) -> Wide:
            return summed(values, of, values.shape)[of]

        # in more digits: a body may be small beside its distance from 0, and rotate slowly beside its drift
        with digits():
            q, p, m = (exactly(by_axes(x)) for x in (system.q, system.p, system.m))
            q, m = q - exactly(by_axes(at)), np.max(m, axis=1, keepdims=True)
            drift, centre = (np.where(held, 0 * x, whole(x) / whole(m)) for x in (p, m * q))
            x = q - centre
            square = np.sum(x * x, axis=1, keepdims=True)
            turn = whole(np.cross(x, p)) / whole(m * square)
            v, w = np.cross(turn, x), np.sqrt(np.sum(turn * turn, axis=1, keepdims=True)) + 0 * x
            self.x, self.v, self.reach, self.w, self.drift = (
                extended(y).reshape(-1)[places] for y in (x, v, np.sqrt(square) + 0 * x, w, drift)
            )
        if rods.share:
            # momenta must be those of such a rotation
            off = rods.projected(wide(system.q), wide(system.p)) / system.m - self.drift - self.v
            body, speed = of[places // 3], self.reach * self.w
            each = (
                (np.max(np.abs(off[here])), np.max(speed[here])) for here in (body == b for b in set(body))
            )
            self.need(not any(moved > START_TOLERANCE / 2 * most for moved, most in each))

    def at(self, t: Extended) -> States:
        turn, m = self.w * t, wide(self.system.m)
        sine, cosine = np.sin(turn), np.cos(turn)
        rate = np.where(self.w > 0, self.w, 1)
        q = self.system.q + self.drift * t + self.x * (cosine - 1) + self.v * (sine / rate)
        return wide(q), wide(m * (self.drift + self.v * cosine - self.x * self.w * sine))

    def doubt(self, t: np.longdouble) -> States:
        m, time, speed = wide(self.system.m), np.abs(t), np.abs(self.drift)
        turned = self.reach * (2 + self.w * time)
        q = FORM_EPS * (np.abs(self.system.q) + speed * time + turned)
        return wide(q), wide(FORM_EPS * m * (speed + self.w * turned))


class TurningWallRods(TurningRods):
    """Flat rigid bodies on rods to fixed points."""

    key = "wall-rod"
    terms = frozenset({"wall-rod"})


def _bodies(system: System[Any], rods: Rods) -> Integers:
    """The body of each particle (particles,).  NoClosedFormError where some body is flexible, or has
    redundant rods."""
    places = system.scene.all_places
    of = np.arange(system.scene.particles)
    of[places // 3] = places[graph.lowest_joined(system.n, system.terms)] // 3
    size, joined = Counter(of.tolist()), Counter(int(of[ends[0]]) for ends in rods.ends)
    fixed = Counter(int(of[ends[0]]) for ends in rods.ends if len(ends) == 1)
    for one, count in joined.items():
        if count != (1 if fixed[one] else 2 * size[one] - 3) or (fixed[one] and size[one] > 1):
            raise NoClosedFormError
    return of
