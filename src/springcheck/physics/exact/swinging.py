"""Pairs on a bond of a rest length that swing along it and do not turn.

The length is a spring of the reduced mass about its rest, its direction stays, and the centre of mass goes
straight on.  Rounding of the start leaves some turning: it is no more than what the ends move by across.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended
from springcheck.physics.exact.digits import Wide, digits, exactly, extended
from springcheck.physics.exact.well import LAST, States, Well, one_each, wide
from springcheck.physics.rods import UNTRUE
from springcheck.physics.system import System


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Swing:
    """Arrays by coordinate (n,): signed share of the length, and direction; the centre and its velocity;
    length less rest and its rate at the start, rest, frequency, amplitude, and the speed across."""

    share: Extended
    along: Extended
    centre: Extended
    drift: Extended
    u: Extended
    rate: Extended
    rest: Extended
    w: Extended
    most: Extended
    across: Extended


def _swings(system: System[Any]) -> _Swing | None:
    """None where some bond turns, may close, or shares a particle with another."""
    term: Any = system.terms[0]
    if not one_each(system):
        return None
    a, b, zero = term.a, term.b, np.zeros(system.n)
    bond = np.unique(term.number, return_inverse=True)[1]

    def summed(values: Wide) -> Wide:
        out = exactly(zero)
        np.add.at(out, bond, values)
        return out[bond]

    # ways and velocities are differences, which may be small beside what they are of
    with digits():
        m, q, p, k, rest = (exactly(x) for x in (system.m, system.q, system.p, term.k, term.rest))
        whole, d, v = m[a] + m[b], q[b] - q[a], p / m
        apart, square = v[b] - v[a], summed(d * d)
        if np.any(square == 0) or not np.all(term.k > 0):
            return None
        s = np.sqrt(square)
        e, rate = d / s, summed(d * apart) / s
        across, speed = summed((apart - rate * e) ** 2), summed(v[a] ** 2 + v[b] ** 2) / 2
        rows = extended(
            np.stack([
                e, (m[a] * q[a] + m[b] * q[b]) / whole, (p[a] + p[b]) / whole,
                (square - rest * rest) / (s + rest), rate, rest, np.sqrt(k * whole / m[a] / m[b]),
                np.sqrt(across), np.sqrt(speed),
            ])
        )  # fmt: skip
        share = extended(np.concatenate([-m[b], m[a]]) / np.tile(whole, 2))
    ends = np.argsort(np.concatenate([a, b]))
    along, centre, drift, u, rate, rest, w, across, speed = np.tile(rows, 2)[:, ends]
    with np.errstate(all="ignore"):
        most = np.hypot(u, rate / w)
    if not np.all((rest > most) & (across <= UNTRUE * speed)):
        return None
    return _Swing(
        share=share[ends], along=along, centre=centre, drift=drift, u=u, rate=rate, rest=rest, w=w,
        most=wide(most), across=across,
    )  # fmt: skip


def _motion(system: System[Any], found: _Swing, t: Extended) -> States:
    sine, cosine = np.sin(found.w * t), np.cos(found.w * t)
    way = found.share * found.along
    q = found.centre + found.drift * t + way * (found.rest + found.u * cosine + found.rate * sine / found.w)
    return wide(q), wide(system.m * (found.drift + way * (found.rate * cosine - found.u * found.w * sine)))


def _doubt(system: System[Any], found: _Swing, t: np.longdouble) -> States:
    time, share, far = np.abs(t), np.abs(found.share), found.rest + found.most
    near = found.rest - found.most
    # an angle at most, of what keeps its angular momentum, and the way that its turning pushes the ends apart
    turned = found.across * time * far / near**2 * far
    pushed = (found.across * far / found.w) ** 2 / near**3
    phase = 2 + found.w * time
    q = LAST * (np.abs(found.centre) + np.abs(found.drift) * time + share * (far + found.most * phase))
    size = np.abs(found.drift) + share * found.most * found.w * phase
    swung = found.w * (turned + pushed * phase) + found.across * far / near
    return wide(q + share * (turned + pushed * phase)), wide(system.m * (LAST * size + share * swung))


SWINGING = Well(key="bond", terms=frozenset({"bond"}), prepare=_swings, motion=_motion, doubt=_doubt)
