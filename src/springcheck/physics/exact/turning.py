"""Rods on which nothing else acts: alone, or as flat rigid bodies that turn about an axis across them.

x(t) = x cos(w t) + v sin(w t)/w about a centre of mass that goes straight on, or about a fixed point.  In a
drift of h such a body turns by asin(h w) under SHAKE and RATTLE: x + h v is x turned by that angle, and what
is too long, (1 - cos) x, is what pushes along its rods can balance.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended, Integers
from springcheck.physics.exact.well import LAST, States, Well, sums, wide
from springcheck.physics.rods import UNTRUE, Rods
from springcheck.physics.system import System


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Turning:
    """Of each coordinate (n,): its way from the centre and velocity about it, the distance of its particle,
    the angular velocity, and the velocity of the centre."""

    x: Extended
    v: Extended
    reach: Extended
    w: Extended
    drift: Extended


def _is_flat(places: Integers, x: Extended, v: Extended) -> bool:
    """Whether v (n,) is w x turned by a right angle, as it is only if the axis is across all of x."""
    z, u = np.zeros((2, int(np.max(places)) // 3 + 1, 3), np.longdouble)
    z.reshape(-1)[places], u.reshape(-1)[places] = x, v
    size = z @ z.T
    return bool(np.all(np.abs(u @ u.T - size) <= UNTRUE * np.max(size)))


def _groups(body: Integers) -> list[Integers]:
    return [np.flatnonzero(body == one) for one in np.unique(body)]


def _turning(system: System[Any]) -> _Turning | None:
    """None where some rods are no flat rigid body that turns about an axis across it."""
    rods, m, places = system.rods, wide(system.m), system.scene.all_places
    assert rods is not None
    of = _bodies(rods, system.scene.particles)
    if of is None:
        return None
    body, held = of[places // 3], np.isin(places // 3, [ends[0] for ends in rods.ends if len(ends) == 1])
    along = 3 * body + places % 3
    p = rods.projected(wide(system.q), wide(system.p))
    drift = np.where(held, 0, sums(along, p) / sums(along, m))
    x = np.where(
        held, rods.spread(rods.ways(wide(system.q))), system.q - sums(along, m * system.q) / sums(along, m)
    )
    v = p / m - drift
    w = np.sqrt(sums(body, m * v * v) / sums(body, m * x * x))
    if rods.share and not all(_is_flat(places[of], (w * x)[of], v[of]) for of in _groups(body)):
        return None
    reach = np.sqrt(sums(places // 3, x * x))
    return _Turning(x=wide(x), v=wide(v), reach=reach, w=wide(w), drift=wide(drift))


def _bodies(rods: Rods, particles: int) -> Integers | None:
    """The body of each particle (particles,), None where some could bend, or has more rods than it needs."""
    of = np.arange(particles)
    for ends in rods.ends * (len(rods) if rods.share else 1):
        of[of == max(of[list(ends)])] = min(of[list(ends)])
    size, joined = Counter(of.tolist()), Counter(int(of[ends[0]]) for ends in rods.ends)
    fixed = Counter(int(of[ends[0]]) for ends in rods.ends if len(ends) == 1)
    rigid = all(
        count == (1 if fixed[one] else 2 * size[one] - 3) and (not fixed[one] or size[one] == 1)
        for one, count in joined.items()
    )
    return of if rigid else None


def _turned(system: System[Any], found: _Turning, t: Extended) -> States:
    turn, m = found.w * t, wide(system.m)
    sine, cosine = np.sin(turn), np.cos(turn)
    rate = np.where(found.w > 0, found.w, 1)
    q = system.q + found.drift * t + found.x * (cosine - 1) + found.v * (sine / rate)
    return wide(q), wide(m * (found.drift + found.v * cosine - found.x * found.w * sine))


def _doubt(system: System[Any], found: _Turning, t: np.longdouble) -> States:
    m, time, speed = wide(system.m), np.abs(t), np.abs(found.drift)
    turned = found.reach * (2 + found.w * time)
    return wide(LAST * (np.abs(system.q) + speed * time + turned)), wide(
        LAST * m * (speed + found.w * turned)
    )


ROD, WALL_ROD = (
    Well(key=key, terms=frozenset({key}), prepare=_turning, motion=_turned, doubt=_doubt)
    for key in ("rod", "wall-rod")
)
