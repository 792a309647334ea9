"""Powers of matrices (2, 2) from their rotation or growth, without the rounding of a long product."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from springcheck.physics.arrays import Extended, Integers, by_identity


@by_identity
class Rotation(NamedTuple):
    """Rotation of one-step matrices: by `angle`, or for unbounded motion by a hyperbolic angle `growth` > 0,
    with `sign` the sign of the real parts of their eigenvalues.  `propagate` computes powers from it."""

    determinant: Extended
    angle: Extended
    growth: Extended
    sign: Extended
    near: Extended
    """The angle of sign * M, at most pi/2: near a half turn `angle` has lost the digits of pi - angle."""


def rotation(matrices: Extended) -> Rotation:
    """Phase and growth of one-step matrices (n, 2, 2), without the cancellation of acos(trace/2).

    Where the determinant is not positive a step reverses orientation and has neither.
    """
    a, b = matrices[:, 0, 0], matrices[:, 0, 1]
    c, d = matrices[:, 1, 0], matrices[:, 1, 1]
    determinant = a * d - b * c
    # -discriminant/4 = det sin(angle)**2; b*c is -(h w)**2 to leading order, so nothing cancels
    minus = -((a - d) ** 2 / 4 + b * c)
    half_trace = (a + d) / 2
    root = np.sqrt(np.abs(minus))
    turning = minus > 0
    angle, near = (np.where(turning, np.arctan2(root, x), 0) for x in (half_trace, np.abs(half_trace)))
    # a step that reverses orientation (determinant <= 0) has no such growth
    hyperbolic = (minus < 0) & (determinant > 0)
    growth = np.zeros_like(root)
    if np.any(hyperbolic):
        growth = np.where(hyperbolic, np.arcsinh(root / np.sqrt(np.where(hyperbolic, determinant, 1))), 0)
    sign = np.where(half_trace < 0, np.longdouble(-1), np.longdouble(1))
    return Rotation(determinant, angle, growth, sign, near)


NO_AREA = 2.0**-56
"""Error of a determinant of 1 from which a growth by it would be wrong in the digits of a double."""


def propagate(
    matrices: Extended, y: Extended, v: Extended, steps: Integers, *, area_preserving: bool
) -> tuple[Extended, Extended]:
    """Closed form of the discrete motion: M**j (y, v) of n modes for j in steps (f,) -> (f, n), twice.

    M**j = sign**j d**(j/2) (C + S (sign M/sqrt(d) - c)) with d the determinant, c = cos(x), C = cos(j x) and
    S = sin(j x)/sin(x), x the angle of sign M; hyperbolic where the eigenvalues are real, j at the edge
    between.
    """
    turn = rotation(matrices)
    j = np.asarray(steps).astype(np.longdouble)[:, None]
    d = np.ones_like(turn.determinant) if area_preserving else turn.determinant
    if np.any(d <= 0):
        raise ValueError("a step that reverses orientation (det <= 0) has no phase")
    sign = np.where(np.asarray(steps)[:, None] % 2 == 1, turn.sign, 1)
    x, g = turn.near, turn.growth
    with np.errstate(over="ignore", invalid="ignore"):
        if area_preserving and np.any(off := (g != 0) & (np.abs(turn.determinant - 1) > NO_AREA)):
            # of large elements it is a difference without digits, but known to be 1
            g = np.where(off, np.arcsinh(np.sinh(g) * np.sqrt(turn.determinant)), g)
        turning, growing = x != 0, g != 0
        cosine = np.where(turning, np.cos(x), np.cosh(g))
        sine = np.where(turning, np.sin(np.where(turning, x, 1)), np.sinh(np.where(growing, g, 1)))
        root = turn.sign * np.sqrt(d)
        # d is 1 + (h w)**2 or the like: the logarithm of the rounded sum would be wrong by j EPS
        less = matrices - np.eye(2, dtype=np.longdouble)
        a, c = less[:, 0, 0], less[:, 1, 1]
        beyond = a + c + a * c - less[:, 0, 1] * less[:, 1, 0]
        decay = j / 2 * (np.zeros_like(d) if area_preserving else np.log1p(beyond))
        # combined with the powers of the root: growth by cosh and decay by friction would be 0 times infinity
        size, up = sign * np.exp(decay), sign * np.exp(decay + j * g)
        even = np.where(
            turning, size * np.cos(j * x), np.where(growing, up * (1 + np.exp(-2 * j * g)) / 2, size)
        )
        odd = np.where(
            turning,
            size * np.sin(j * x) / sine,
            np.where(growing, -up * np.expm1(-2 * j * g) / (2 * sine), j * size),
        )
        a, b = matrices[:, 0, 0] / root - cosine, matrices[:, 0, 1] / root
        c, e = matrices[:, 1, 0] / root, matrices[:, 1, 1] / root - cosine
        return (np.asarray(even * y + odd * (a * y + b * v)), np.asarray(even * v + odd * (c * y + e * v)))
