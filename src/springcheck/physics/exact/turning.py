"""Rods on which nothing else acts: alone, or as flat rigid bodies that turn about an axis across them.

x(t) = x cos(w t) + v sin(w t)/w about a centre of mass that goes straight on, or about a fixed point.  In a
drift of h such a body turns by asin(h w) under SHAKE and RATTLE: x + h v is x turned by that angle, and what
is too long, (1 - cos) x, is what pushes along its rods can balance.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from springcheck.physics.arrays import Extended, Integers, by_identity
from springcheck.physics.exact.digits import Wide, digits, exactly, extended
from springcheck.physics.exact.well import LAST, States, Well, wide
from springcheck.physics.rods import UNTRUE, Rods
from springcheck.physics.system import System


@by_identity
class _Turning(NamedTuple):
    """Arrays by coordinate (n,): position and velocity from the centre, the distance of its particle,
    the angular velocity, and the velocity of the centre."""

    x: Extended
    v: Extended
    reach: Extended
    w: Extended
    drift: Extended


def _turning(system: System[Any]) -> _Turning | None:
    """None where some rods are no flat rigid body that turns about an axis across it."""
    rods, places, n = system.rods, system.scene.all_places, system.scene.particles
    assert rods is not None
    of, at = _bodies(rods, n), np.zeros(system.n)
    if of is None:
        return None
    for term in system.terms:
        if term.origin:
            at[term.particles[0]] = getattr(term, term.origin)
    held = np.isin(np.arange(n), [ends[0] for ends in rods.ends if len(ends) == 1])[:, None]

    def by_axes(values: Any) -> Any:
        out = np.zeros((n, 3), values.dtype)
        out.reshape(-1)[places] = values
        return out

    def summed(values: Wide) -> Wide:
        out = exactly(np.zeros_like(values, np.float64))
        np.add.at(out, of, values)
        return out[of]

    # in more digits: a body may be small beside where it is, and turn slowly beside how it moves
    with digits():
        q, p, m = (exactly(by_axes(x)) for x in (system.q, system.p, system.m))
        q, m = q - exactly(by_axes(at)), np.max(m, axis=1, keepdims=True)
        drift, centre = (np.where(held, 0 * x, summed(x) / summed(m)) for x in (p, m * q))
        x = q - centre
        square = np.sum(x * x, axis=1, keepdims=True)
        turn = summed(np.cross(x, p)) / summed(m * square)
        v, w = np.cross(turn, x), np.sqrt(np.sum(turn * turn, axis=1, keepdims=True)) + 0 * x
        found = [extended(y).reshape(-1)[places] for y in (x, v, np.sqrt(square) + 0 * x, w, drift)]
    if rods.share:
        # momenta are those of such a turn
        off = rods.projected(wide(system.q), wide(system.p)) / system.m - found[4] - found[1]
        body, speed = of[places // 3], found[2] * found[3]
        if any(np.max(np.abs(off[body == b])) > UNTRUE / 2 * np.max(speed[body == b]) for b in set(body)):
            return None
    return _Turning(*found)


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
