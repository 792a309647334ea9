"""Closed form of the discrete motion of a mode that is driven: z' = A z + Re(g exp(i (W t + phase))).

From rest j steps of it lead to Re((A**j - mu**j) (A - mu)**-1 g exp(i phase)), mu = exp(i W h): the steady
answer to the drive, and the free motion that begins it from rest.  With a projection on each eigenvector of A
that is a divided difference of x**j, which has a limit at resonance.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from springcheck.physics.arrays import Extended, Integers, Reals
from springcheck.physics.driven import CLOCK
from springcheck.physics.exact.normal import Modes
from springcheck.physics.exact.response import drives, first_difference
from springcheck.physics.system import System
from springcheck.schemes.catalogue import Scheme
from springcheck.schemes.powers import rotation
from springcheck.schemes.stepping import step

Complex = NDArray[np.complexfloating[Any, Any]]


def answer(
    scheme: Scheme, system: System[Any], modes: Modes, matrices: Extended, *, h: float, steps: Integers
) -> tuple[Extended, Extended]:
    """Contribution of the driving forces of a system to its modes after so many steps (f,): (f, n) each."""
    u, v = np.zeros((2, len(steps), len(modes.w2)), np.longdouble)
    for frequency, phase, push in drives(system, modes):
        gains = gain(scheme, h=h, k=modes.w2, c=modes.rate, frequency=frequency)
        y, w = driven(matrices, gains, frequency * np.longdouble(h), steps)
        turned = push * np.exp(1j * phase)
        u, v = u + (y * turned).real, v + (w * turned).real
    return u, v


def gain(scheme: Scheme, *, h: float, k: Extended, c: Extended, frequency: np.longdouble) -> Complex:
    """Effect of a force exp(i frequency t) on modes k, c (n,) in a step from rest at t = 0: g (n, 2).

    The real and the imaginary part are those of the forces cos and sin; each stage reads a clock.
    """
    clock = np.array([0, CLOCK])
    m, at = np.append(np.ones_like(k), clock[1]), np.zeros((2, len(k) + 1), np.longdouble)
    late = np.array([[0], [-1]], np.longdouble) * np.arctan2(np.longdouble(1), np.longdouble(0))

    def force(q: Reals, p: Reals) -> Reals:
        pull = np.cos(frequency * q[:, -1:] + late) - k * q[:, :-1] - c * p[:, :-1]
        return np.concatenate([pull, 0 * late], axis=1)

    def none(q: Reals, p: Reals) -> Reals:
        return np.zeros_like(q)

    q, p = step(
        scheme, at, at + np.append(0 * k, clock[1]), h=h, m=m, force=force, stiffness=np.append(k, 0),
        rate=np.append(c, 0) if np.any(c) else None, parts=(none, force),
    )  # fmt: skip
    found = np.stack([q, p], axis=-1)[:, :-1]
    return np.asarray(found[0] + 1j * found[1])


def driven(
    matrices: Extended, gains: Complex, angle: np.longdouble, steps: Integers
) -> tuple[Complex, Complex]:
    """States y and v (f, n) of modes of these one-step matrices (n, 2, 2), at rest at first, after j steps
    (f,), whose real parts are those of the force exp(i angle j); NaN for a mode that does not turn."""
    found = rotation(matrices)
    # powers of -A where A is near half a turn, whose phases would lose all digits
    sign, pi = found.sign, np.arctan2(np.longdouble(0), np.longdouble(-1))
    less = sign[:, None, None] * matrices - np.eye(2, dtype=np.longdouble)
    a, d = less[:, 0, 0], less[:, 1, 1]
    decay = np.log1p(a + d + a * d - less[:, 0, 1] * less[:, 1, 0]) / 2
    first, second = decay + found.growth + 1j * found.near, decay - found.growth - 1j * found.near
    turn = np.where(sign < 0, angle - pi, angle)
    mu = 1j * (turn - 2 * pi * np.round(turn / (2 * pi)))
    j, one = np.asarray(steps).astype(np.longdouble)[:, None], np.ones((1, 1), np.longdouble)
    y, v = np.zeros((2, len(j), len(matrices)), np.clongdouble)
    with np.errstate(all="ignore"):
        for mine, other in ((first, second), (second, first)):
            # g along the eigenvector of exp(mine): (sign A - x) g / (exp(mine) - x), x the other eigenvalue
            gap = np.exp(decay) * 2 * np.sinh((mine - other) / 2)
            share = (np.einsum("nij,nj->ni", less, gains) - np.expm1(other)[:, None] * gains) / gap[:, None]
            grown = sign ** (j - 1) * first_difference(mine, mu, j) / first_difference(mine, mu, one)
            y, v = y + grown * share[:, 0], v + grown * share[:, 1]
    return y, v
