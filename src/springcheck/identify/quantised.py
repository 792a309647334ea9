"""Forces truncated to multiples of a quantum: what frames many steps apart show of them.

Where frames lie several steps apart single forces cannot be read off, but the steps can be repeated from each
recorded frame with truncated forces.  Where that brings the residuals down to the rounding of states, it
is those forces; noise of the same size, or an error that goes with anything else, stays as large as it was.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np

from springcheck.identify import coarse
from springcheck.identify.coarse import EXCESS, QUANTUM, over_single
from springcheck.identify.families import FAMILIES
from springcheck.identify.fit import Map
from springcheck.identify.hypothesis import CHANCE, Match
from springcheck.identify.record import Record
from springcheck.physics.arrays import Floats
from springcheck.schemes import SCHEMES, Scheme, number

EXPLAINED = 0.3
"""Share of the misses in the root mean square that is left at most where forces are cut off: of the noise of
unlike forces more than all is left, 1.4 of it."""

REFINED = 16
"""Newton's steps of the stiffness, which the misses bias, with forces cut off."""

Force: TypeAlias = Callable[[Floats, Floats], Floats]
"""k (c, 1) and q (c, f) -> -k q as an arithmetic has it, both k and the result in quanta, powers of 2."""

Pull: TypeAlias = Callable[[Floats, Floats], Floats]
"""a (c, 1) and q (c, f) or (f,) -> h**2 F/m."""


def _single(k: Floats, q: Floats) -> Floats:
    return (-k * q).astype(np.float32).astype(np.float64)


def _all_single(k: Floats, q: Floats) -> Floats:
    return ((-k).astype(np.float32) * q.astype(np.float32)).astype(np.float64)


FORCES: dict[str, tuple[Force, ...]] = {
    "fixed-point force": (lambda k, q: np.trunc(-k * q), lambda k, q: np.rint(-k * q)),
    "mixed": (
        _single, _all_single,
        lambda k, q: np.trunc(_single(k, q)), lambda k, q: np.trunc(_all_single(k, q)),
    ),
}  # fmt: skip


def coarse_forces(record: Record, j: int, found: Map, match: Match, signed: Floats) -> tuple[str, str, bool]:
    """Precision of forces that leave these misses (f - 1, 2), a note, and whether it is certain; "" where
    none explains them."""
    name, note = coarse.sized(record, j, found, match, signed)
    for each in FORCES if name else ():
        if _reproduced(record, j, found, match, each):
            return each, "states are double, and the steps redone with such forces are those recorded", True
    seen = coarse.kinematic(record, j, found, match)
    if seen is not None:
        return *seen, record.mass is not None
    return (name, note, False) if name and coarse.white(found, match, signed) else ("", "", True)


def _reproduced(record: Record, j: int, found: Map, match: Match, precision: str) -> bool:
    """Whether forces of a precision, in an explicit scheme without friction, explain what frames miss."""
    family = FAMILIES[match.family]
    if record.mass is None:
        return False
    mass, h = float(record.mass[j]), float(record.interval) / match.stride
    # about the equilibrium; velocities as lengths
    q = (found.z[:, 0] * found.size[0]).astype(np.float64)
    v = (found.z[:, 1] * found.size[1] / record.interval).astype(np.float64) * h
    kick = h * h / mass * QUANTUM

    def missed(a: Floats, pull: Pull, *, leaps: bool = False) -> Floats:
        """What frames miss (c, 2 f - 2) where steps have these (h w)**2 (c, 1)."""
        x, y = (np.broadcast_to(z[:-1], (len(a), len(z) - 1)) for z in (q, v))
        if leaps:
            # stored half a step early, and half a kick of the exact force added where it was read
            y = y + a * x / 2
        scheme = SCHEMES["semi-implicit-euler" if leaps else family.scheme]
        for _ in range(match.stride):
            x, y = _step(scheme, x, y, partial(pull, a))
        if leaps:
            y = y - a * x / 2
        return np.concatenate([q[1:] - x, v[1:] - y], axis=1)

    def exact(a: Floats, x: Floats) -> Floats:
        return -a * x

    start, shift = np.array([[match.a]]), 1e-6 * match.a
    rows = missed(start, exact).reshape(2, -1)
    size = np.sqrt(np.mean(rows**2, axis=1, keepdims=True)) + 2.0**-52 * np.max(np.abs(q))
    scale = np.broadcast_to(1 / size, rows.shape).ravel()
    slope = (missed(start + shift, exact) - missed(start - shift, exact))[0] / (2 * shift) * scale
    # what another stiffness takes away is explained without any quantum
    inverse = (slope / (slope @ slope))[:, None]
    plain = start - missed(start, exact) * scale @ inverse
    without = missed(plain, exact) * scale
    before = float(np.sqrt(np.mean(without**2)))
    counted = float(np.sum(without**2) ** 2 / np.sum(without**4)) - 1
    single = float(over_single(mass))
    factors = [x * y for x in (1.0, 1.0 + EXCESS) for y in dict.fromkeys((1.0, single))]
    quanta = kick * np.array(factors)[:, None]
    forces, n = FORCES[precision], len(factors)

    def cut(a: Floats, x: Floats) -> Floats:
        # every force with all factors, one below the other
        x = np.broadcast_to(x, (len(a), x.shape[-1]))
        parts = ((f, a[i : i + n], x[i : i + n]) for f, i in zip(forces, range(0, len(a), n), strict=True))
        return np.concatenate([quanta * f(b / kick, y) for f, b, y in parts])

    for leaps in (False, True) if family.name == "velocity-verlet" else (False,):
        values = np.repeat(start, len(forces) * n, axis=0)
        for _ in range(REFINED):
            left = missed(values, cut, leaps=leaps) * scale
            share = np.sqrt(np.mean(left**2, axis=1)) / before
            # of one miss alone any stiffness leaves nothing
            if np.any((share <= EXPLAINED) & (share**counted <= CHANCE)):
                return True
            values = values - left @ inverse
    return False


def _step(scheme: Scheme, q: Floats, v: Floats, pull: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """One step on (q, v h), with h**2 F/m from `pull`."""
    slopes: list[tuple[Floats, Floats]] = []
    for row in (*scheme.a, scheme.b):
        x, y = q, v
        for share, (dx, dy) in zip(row, slopes, strict=False):
            x, y = x + float(share) * dx, y + float(share) * dy
        slopes.append((y, pull(x)))
    for kind, part in scheme.stages:
        c = float(number(part, np.longdouble))
        x, y = (x + c * y, y) if kind == "drift" else (x, y + c * pull(x) * (kind != "friction"))
    return x, y
