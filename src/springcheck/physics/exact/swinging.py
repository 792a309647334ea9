"""Pairs on a bond of a rest length that swing along it and do not turn.

The length is a spring of the reduced mass about its rest, its direction stays, and the centre of mass goes
straight on.  Rounding of the start leaves some turning: it is no more than what the ends move by across.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended
from springcheck.physics.exact.well import LAST, States, Well, one_each, sums, wide
from springcheck.physics.rods import UNTRUE
from springcheck.physics.system import System


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Swing:
    """Of each coordinate (n,): its share of the length, signed, the direction; the centre and its velocity;
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
    m, q, p = (wide(x) for x in (system.m, system.q, system.p))
    both = np.concatenate([term.a, term.b])
    bond = np.empty(system.n, np.int64)
    bond[both] = np.tile(np.unique(term.number, return_inverse=True)[1], 2)
    k, rest, d, v, one, whole = (np.zeros(system.n, np.longdouble) for _ in range(6))
    for values, given in (
        (k, term.k), (rest, term.rest), (d, term.stretch(q)), (v, term.stretch(p / m)),
    ):  # fmt: skip
        values[both] = np.tile(given, 2)
    one[both] = np.concatenate([-m[term.b], m[term.a]])
    whole[both] = np.tile(m[term.a] + m[term.b], 2)

    def summed(values: Extended) -> Extended:
        # over the axes, of which each end has all
        return sums(bond, values) / 2

    with np.errstate(all="ignore"):
        s = np.sqrt(summed(d * d))
        e = d / s
        rate = summed(e * v)
        across = np.sqrt(summed((v - rate * e) ** 2))
        w = np.sqrt(k * whole / (m * (whole - m)))
        most = np.hypot(s - rest, rate / w)
        speed = np.sqrt(summed((p / m) ** 2))
        if not np.all((k > 0) & (rest > most) & (across <= UNTRUE * speed)):
            return None
    centre = q - one / whole * d
    return _Swing(
        share=wide(one / whole), along=wide(e), centre=wide(centre), drift=wide(p / m - one / whole * v),
        u=wide(s - rest), rate=wide(rate), rest=rest, w=wide(w), most=wide(most), across=wide(across),
    )  # fmt: skip


def _motion(system: System[Any], found: _Swing, t: Extended) -> States:
    sine, cosine = np.sin(found.w * t), np.cos(found.w * t)
    way = found.share * found.along
    q = found.centre + found.drift * t + way * (found.rest + found.u * cosine + found.rate * sine / found.w)
    return wide(q), wide(system.m * (found.drift + way * (found.rate * cosine - found.u * found.w * sine)))


def _doubt(system: System[Any], found: _Swing, t: np.longdouble) -> States:
    time, share, far = np.abs(t), np.abs(found.share), found.rest + found.most
    # an angle at most, of what keeps its angular momentum
    turned = found.across * time * far / (found.rest - found.most) ** 2 * far
    phase = 2 + found.w * time
    q = LAST * (np.abs(found.centre) + np.abs(found.drift) * time + share * far * phase) + share * turned
    size = np.abs(found.drift) + share * found.most * found.w * phase
    return wide(q), wide(
        system.m * (LAST * size + share * (found.w * turned + found.across * far / found.rest))
    )


SWINGING = Well(key="bond", terms=frozenset({"bond"}), prepare=_swings, motion=_motion, doubt=_doubt)
