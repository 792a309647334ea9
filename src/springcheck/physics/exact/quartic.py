"""Hardening and softening (Duffing) oscillators, double wells: u'' = -k u - b u**3, by elliptic functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springcheck.physics.arrays import Extended
from springcheck.physics.exact.closedform import CANCELS, FORM_EPS, ClosedForm, States, wide
from springcheck.physics.exact.digits import digits, exactly, extended
from springcheck.physics.exact.elliptic import argument, jacobi, latency
from springcheck.physics.system import System
from springcheck.physics.terms import Quartic, WallSpring


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Duffing:
    """u'' = -k u - b u**3 of unit masses (k, b per mass), all (n,); E is the energy of the start.

    root = sqrt(k**2 + 4 b E) = k + b A**2 at a turning point A; plus = root + k.
    The motion is that of an elliptic function of parameter m = 1 - m1, of amplitude A and argument w t.
    """

    k: Extended
    b: Extended
    u: Extended
    v: Extended
    pull: Extended
    """k + b u**2 of the start."""
    energy: Extended
    """4 E."""
    root: Extended
    plus: Extended
    amplitude: Extended
    w: Extended
    m: Extended
    m1: Extended

    def __getitem__(self, which: NDArray[np.bool_]) -> _Duffing:
        return _Duffing(**{name: getattr(self, name)[which] for name in self.__slots__})


def _parameters(system: System[Any], of: Callable[[Any], Any]) -> tuple[Any, ...]:
    """m, k, b, q, at, p of each particle (n,), in numbers made by `of`."""
    k, b, at = (of(np.zeros(system.n)) for _ in range(3))
    for term in system.terms:
        if isinstance(term, Quartic):
            term.scatter(of(term.b), b)
            at[term.i] = of(term.at)
        elif isinstance(term, WallSpring):
            term.scatter(of(term.k), k)
    return of(system.m), k, b, of(system.q), at, of(system.p)


def _sums(m: Any, k: Any, b: Any, u: Any, p: Any) -> tuple[Any, Any, Any]:
    """k + b u**2, and m**3 root**2 and 4 m**2 E of unit masses: the sums that may cancel."""
    x = k + b * u * u
    return x, m * x * x + 2 * b * p * p, 2 * p * p + m * (2 * k + b * u * u) * u * u


class QuarticMotion(ClosedForm):
    """Single particles in quartic potentials with one centre each."""

    key = "quartic"
    terms = frozenset({"quartic", "wall-spring"})

    def __init__(self, system: System[Any]) -> None:
        super().__init__(system)
        m, k, b, q, at, p = _parameters(system, wide)
        for term in system.terms:
            self.need(not isinstance(term, Quartic | WallSpring) or np.all(term.at == at[term.i]))
        u = q - at
        sums = _sums(m, k, b, u, p)
        m_, k_, b_, q_, at_, p_ = _parameters(system, lambda x: np.abs(wide(x)))
        sizes = _sums(m_, k_, b_, q_ + at_, p_)
        near = np.any([size > CANCELS * np.abs(x) for x, size in zip(sums, sizes, strict=True)], axis=0)
        if np.any(near):
            chosen = np.flatnonzero(near)
            with digits():
                m_, k_, b_, q_, at_, p_ = _parameters(system.beside(system.part(chosen)), exactly)
                for out, x in zip(sums, _sums(m_, k_, b_, q_ - at_, p_), strict=True):
                    out[chosen] = extended(x)
        x, square, energy = sums[0] / m, sums[1] / m**3, sums[2] / m**2
        k, b = k / m, b / m
        # a turning point
        self.need(np.all((b > 0) | ((k > 0) & (square >= 0) & (x >= 0))))
        root = np.sqrt(square)
        # root**2 - k**2 is 4 b E: of plus and minus the one that cancels follows from the other
        large = root + np.abs(k)
        small = b * energy / np.where(large > 0, large, 1)
        minus, plus = np.where(k < 0, large, small), np.where(k < 0, small, large)
        parts = {"k": k, "b": b, "u": u, "v": p / m, "pull": x, "energy": energy}
        parts |= {"root": root, "plus": plus}
        self.well, self.centre = _Duffing(**parts, **_orbit(b, root, minus, plus, energy)), at

    def at(self, t: Extended) -> States:
        """cn, dn or sn, by the kind of orbit."""
        well = self.well
        u, v = np.empty((2, len(t), self.system.n), dtype=np.longdouble)
        softening = well.b <= 0
        # the sign of the energy, which may be lost in the root beside |k|
        caught = ~softening & (well.plus < 0)
        for which, law in ((softening, _sn), (caught, _dn), (~softening & ~caught, _cn)):
            if np.any(which):
                u[:, which], v[:, which] = law(well[which], t)
        return u + self.centre, v * self.system.m

    def doubt(self, t: np.longdouble) -> States:
        well, hill = self.well, (self.well.k < 0) & (self.well.b > 0)
        # at the bottom of the potential
        fastest = np.where(hill, well.root**2 / (2 * np.abs(well.b)), np.abs(well.energy) / 2)
        a, speed = well.amplitude, np.sqrt(fastest)
        time = np.abs(t) + latency(well.m1) / np.where(well.w > 0, well.w, 1)
        q = FORM_EPS * (np.abs(self.centre) + a + speed * time)
        p = FORM_EPS * (speed + (np.abs(well.k) + np.abs(well.b) * a * a) * a * time)
        return np.asarray(q), np.asarray(p * self.system.m)


def _orbit(
    b: Extended, root: Extended, minus: Extended, plus: Extended, energy: Extended
) -> dict[str, Extended]:
    """A, w, m and m1: for sn below the barriers of a softening spring, for dn within one of two wells, for cn
    elsewhere (Byrd & Friedman, Handbook of Elliptic Integrals, 1971)."""
    soft = b <= 0
    caught = ~soft & (plus < 0)
    rest = ~soft & (root == 0)
    over = np.where(rest, 1, root)
    m, m1 = np.where(rest, 0, minus / (2 * over)), np.where(rest, 1, plus / (2 * over))
    amplitude, w = np.sqrt(minus / np.where(soft, -1, b)), np.sqrt(root)
    broad, deep = np.where(soft, plus, 1), np.where(caught, minus, 1)
    # A**2 = 4 E / plus, a sum where minus / b would be a quotient of small numbers
    amplitude = np.where(soft, np.sqrt(np.abs(energy) / broad), amplitude)
    w = np.where(soft, np.sqrt(broad / 2), np.where(caught, np.sqrt(deep / 2), w))
    m = np.where(soft, -minus / broad, np.where(caught, 2 * root / deep, m))
    m1 = np.where(soft, 2 * root / broad, np.where(caught, -plus / deep, m1))
    return {"amplitude": amplitude, "w": w, "m": m, "m1": m1}


def _cn(well: _Duffing, t: Extended) -> States:
    """Across the centre of a hardening potential: u = A cn(w t + phase), w**2 = root."""
    amplitude, w, m, m1 = well.amplitude, well.w, well.m, well.m1
    cosine = well.u / np.where(amplitude > 0, amplitude, 1)
    turn = w * np.sqrt(m1 + m * cosine * cosine)
    # the top of the barrier is reached after an infinite time
    sine = np.where(turn > 0, -well.v / np.where(turn > 0, turn, 1), 1)
    _, sn, cn, dn = jacobi(t * w + argument(sine, well.u, m, m1), m, m1)
    return np.asarray(amplitude * cn), np.asarray(-amplitude * w * sn * dn)


def _dn(well: _Duffing, t: Extended) -> States:
    """Within one of two wells: u = +-A dn(w t + phase), w**2 = (root - k)/2."""
    m, m1, w = well.m, well.m1, well.w
    amplitude = np.copysign(well.amplitude, well.u)
    # sine and cosine of 2 am(phase) are rational in the start
    y, x = -np.copysign(np.sqrt(2 * well.b) * well.v, well.u * well.v), well.pull
    # half of that angle, without computing it: the smaller of sine and cosine follows from the larger
    large = np.sqrt((well.root + np.abs(x)) / 2)
    small = np.abs(y) / (2 * np.where(large > 0, large, 1))
    sine, cosine = np.where(x < 0, large, small), np.where(x < 0, small, large)
    _, sn, cn, dn = jacobi(t * w + argument(np.copysign(sine, y), cosine, m, m1), m, m1)
    return np.asarray(amplitude * dn), np.asarray(-amplitude * w * m * sn * cn)


def _sn(well: _Duffing, t: Extended) -> States:
    """Below the barriers of a softening spring: u = A sn(w t + phase), w**2 = (k + root)/2."""
    m, m1, w = well.m, well.m1, well.w
    begun = np.sqrt((well.root + well.pull) / well.plus)
    phase = argument(well.u, well.v / (w * np.where(begun > 0, begun, 1)), m, m1)
    _, sn, cn, dn = jacobi(t * w + phase, m, m1)
    return np.asarray(well.amplitude * sn), np.asarray(well.amplitude * w * cn * dn)
