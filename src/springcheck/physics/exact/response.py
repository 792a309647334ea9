"""The exact solution of driven linear scenes: the undriven motion, plus the response to each drive from rest.

A mode u'' = -w2 u - r u' + g cos(W t + phi) that starts at rest in its centre responds by the real part of g
exp(i phi) D(t), D the divided difference of exp(x t) at x = iW and the two roots of x**2 + r x + w2: its
Laplace transform is 1/((x - iW) (x - x1) (x - x2)).  One formula covers resonance, critical damping and a
free particle, where points coincide (de Boor, Surveys in Approximation Theory 1 (2005) 46).
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck.physics.arrays import EPS, Extended, States
from springcheck.physics.exact.linear import ROUNDINGS, LinearMotion, reaches
from springcheck.physics.exact.normal import Modes, discriminant
from springcheck.physics.system import System

_Complex = NDArray[np.complexfloating[Any, Any]]

SERIES_TERMS = 26
"""Terms of a series within |x t| < 1: the next one is below a rounding of 113 bits."""

_Drive: TypeAlias = tuple[np.longdouble, np.longdouble, Extended]


class Response:
    """A whole scene of linear springs, friction that admits modes, and drives: the undriven motion `alone`,
    and the frequency, phase and force on each mode of every drive."""

    def __init__(self, system: System[Any]) -> None:
        self.alone = LinearMotion(system.without("drive"))
        self.modes = self.alone.modes
        self.drives = drives(system, self.modes)

    def at(self, t: Extended) -> States:
        q, p = self.alone.at(t)
        slow, fast = roots(self.modes)
        for frequency, phase, force in self.drives:
            turn = np.full_like(slow, 1j * frequency)
            strength = force * np.exp(1j * phase)
            y = second_difference(turn, slow, fast, t)
            # x / ((x - a)(x - b)(x - c)) is 1 / ((x - a)(x - c)) and b times what belongs to y
            v = first_difference(turn, fast, t) + slow * y
            dq, dp = self.modes.out_of((strength * y).real, (strength * v).real)
            q, p = q + dq, p + dp
        return q, p

    def doubt(self, t: np.longdouble) -> States:
        """Errors of the undriven motion, and roundings of the angles and of the response: g moves a mode by
        at most |t g| min(t, 1/w) (variation of constants)."""
        q, p = self.alone.doubt(t)
        modes, duration = self.modes, np.abs(t)
        _, _, phase, hold = reaches(modes, t)
        grown = np.exp(np.maximum(np.max([x.real * t for x in roots(modes)], axis=0), 0))
        for frequency, _, force in self.drives:
            angles = 1 + phase + np.abs(frequency) * duration
            kick = ROUNDINGS * EPS * angles * grown * np.abs(force) * duration
            q, p = q + modes.spread(kick * hold) / modes.root_m, p + modes.spread(kick) * modes.root_m
        return np.asarray(q), np.asarray(p)


def drives(system: System[Any], modes: Modes) -> tuple[_Drive, ...]:
    """Frequency and phase of each drive of a system, and its force on each normal mode (n,)."""
    found = []
    for term in system.terms:
        for i, amplitude, frequency, phase in term.rows() if term.key == "drive" else ():
            push = np.zeros(system.n)
            push[i] = amplitude
            found.append((np.longdouble(frequency), np.longdouble(phase), modes.into(push * 0, push)[1]))
    return tuple(found)


def roots(modes: Modes) -> tuple[_Complex, _Complex]:
    """The two roots of x**2 + r x + w2 of each mode (n,), the smaller first."""
    b, square, s = discriminant(modes.w2, modes.rate)
    fast = np.where(square > 0, 0, b + s)
    slow = np.where(fast > 0, -modes.w2 / np.where(fast > 0, fast, 1), 0)
    turning = square > 0
    first = np.where(turning, -b + 1j * s, slow)
    return first.astype(np.clongdouble), np.where(turning, -b - 1j * s, -fast).astype(np.clongdouble)


def first_difference(a: _Complex, b: _Complex, t: Extended) -> _Complex:
    """The divided difference of exp(x t) at a and b: (exp(a t) - exp(b t)) / (a - b), t where they meet."""
    d = (a - b) * t
    swap = d.real < 0
    d, larger = np.where(swap, -d, d), np.where(swap, b, a)
    safe = np.where(d == 0, 1, d)
    return np.asarray(np.exp(larger * t) * t * np.where(d == 0, 1, -np.expm1(-safe) / safe))


def second_difference(a: _Complex, b: _Complex, c: _Complex, t: Extended) -> _Complex:
    """The divided difference of exp(x t) at three points (n,), for times t (f, 1)."""
    far = np.argmax(np.abs([a - b, b - c, a - c]), axis=0)
    x, y, z = (np.choose(far, some) for some in ((a, b, a), (c, a, b), (b, c, c)))
    d = (x - z) * t
    near = np.abs(d) < 1
    one, other = (np.where(near, (end - y) * t, 0) for end in (x, z))
    # sum of h_k(one, other) / (k + 2)!, h_k their complete homogeneous polynomials
    total, power, h = np.zeros_like(d), np.ones_like(d), np.ones_like(d)
    factor = np.longdouble(1)
    for k in range(SERIES_TERMS):
        factor /= k + 2
        total += h * factor
        power = power * one
        h = h * other + power
    apart = first_difference(x, y, t) - first_difference(z, y, t)
    return np.asarray(
        np.where(near, t * t * np.exp(y * t) * total, apart / np.where(near | (x == z), 1, x - z))
    )
