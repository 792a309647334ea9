"""One-step matrices of linear scenes: their derivation, their powers, and their invariants."""

from __future__ import annotations

import numpy as np

from springcheck.physics.arrays import Extended, Floats, Integers, Reals
from springcheck.physics.exact.linear import flow
from springcheck.schemes.catalogue import Scheme
from springcheck.schemes.powers import rotation
from springcheck.schemes.stepping import step


def matrix(scheme: Scheme, *, h: float, m: Reals, k: Reals, c: Reals | float = 0.0) -> Extended:
    """One-step matrices on (q, p) of springs m, k (n,), each with friction c -> (n, 2, 2), extended.

    Its columns are steps of the unit vectors, so the scheme is written down once.  A scheme that parts slow
    from fast takes each spring for a fast one, and friction for a slow force, as `System.slow` does; that of
    the exact flow is its closed form.
    """
    wide: list[Extended] = [np.atleast_1d(np.asarray(x, np.longdouble)) for x in (m, k, c)]
    m, k, c = np.broadcast_arrays(*wide)
    if scheme.flow:
        root = np.stack([np.ones_like(m), m], axis=-1)
        w2, rate = (np.asarray(x / m, np.longdouble) for x in (k, c))
        return np.asarray(flow(w2, rate, np.longdouble(h)) * root[:, :, None] / root[:, None, :])

    def force(q: Reals, p: Reals) -> Reals:
        return np.asarray(-k * q - c * (p / m))

    q, p = step(
        scheme,
        *(np.broadcast_to(x[:, None], (2, len(m))) for x in np.eye(2, dtype=np.longdouble)),
        h=h,
        m=m,
        force=force,
        stiffness=k,
        rate=c / m if np.any(c) else None,
        parts=(lambda q, p: np.asarray(-c * (p / m)), lambda q, p: np.asarray(-k * q)),
    )
    return np.asarray(np.stack([q.T, p.T], axis=1), np.longdouble)


def invariant(matrices: Extended, *, h: float) -> Extended:
    """Coefficients (n, 3) of the quadratic form s_qq q**2 + s_qp q p + s_pp p**2 that a step multiplies
    by the determinant of its matrix: the shadow energy, equal to H up to order h [M L2/T2].

    For every 2 x 2 matrix, M21 q**2 + (M22 - M11) q p - M12 p**2 has that property; -1/2h scales it to H.
    """
    out = np.stack([matrices[:, 1, 0], matrices[:, 1, 1] - matrices[:, 0, 0], -matrices[:, 0, 1]], axis=-1)
    return np.asarray(out / np.longdouble(-2 * np.longdouble(h)))


def condition(matrices: Extended, w: Extended) -> Extended:
    """Axis ratio of the invariant ellipses of one-step matrices (n, 2, 2), in energy coordinates (w y, v), w
    (n,) > 0.

    No power of a map is larger, but for those of its determinant; infinite where the motion does not turn.
    """
    a, b = matrices[:, 0, 0], matrices[:, 0, 1] * w
    c, d = matrices[:, 1, 0] / w, matrices[:, 1, 1]
    half = np.abs(c - b) / 2
    area = -((a - d) ** 2 / 4 + b * c)
    turning = area > 0
    spread = np.sqrt(np.maximum(half**2 - area, 0))
    return np.asarray(np.where(turning, (half + spread) / np.sqrt(np.where(turning, area, 1)), np.inf))


def amplification(matrices: Extended, w: Extended, steps: Integers) -> tuple[Floats, Floats]:
    """Amplification of one rounding a step over j steps: (sum over i < j of |M**i| / r**i, r**j), r >= 1 the
    spectral radius.

    Norms are taken in energy coordinates (w y, v), w (n,) > 0, and the worst mode counts; (f,) each.  At the
    edge of stability |M**i| grows with i, and the sum with j**2.
    """
    turn = rotation(matrices)
    half = (matrices[:, 0, 0] + matrices[:, 1, 1]) / 2
    split = np.sqrt(np.maximum(half * half - turn.determinant, 0))
    larger = half + np.where(half < 0, -split, split)
    # where orientation is reversed (det <= 0) the eigenvalues are real and of unlike sign: powers are bounded
    # by the larger one, x**i (1 + 2 |M - x| / |x - y|), instead of by the root of the determinant
    over = turn.determinant <= 0
    root = np.where(over, np.abs(larger), np.sqrt(np.abs(turn.determinant)))
    root = np.where(root > 0, root, 1)
    growth = np.where(over, 0, turn.growth)
    near = np.where(turn.angle != 0, np.cos(turn.angle), turn.sign * np.cosh(growth))
    near = np.where(over, larger / root, near)
    rest = np.stack(
        [
            np.stack([matrices[:, 0, 0] / root - near, w * matrices[:, 0, 1] / root], axis=-1),
            np.stack([matrices[:, 1, 0] / w / root, matrices[:, 1, 1] / root - near], axis=-1),
        ],
        axis=-2,
    )
    size = np.sqrt(np.sum(rest * rest, axis=(-2, -1)))
    sine = np.where(turn.angle != 0, np.sin(turn.angle), 2 * np.sinh(growth))
    sine = np.where(over, split / root, sine)
    longest = np.where(sine > 0, 1 / np.where(sine > 0, sine, 1), np.inf)
    radius = np.maximum(root * np.exp(growth), 1)
    j = np.asarray(steps).astype(np.longdouble)[:, None]
    short = np.minimum(j, longest)
    with np.errstate(over="ignore", invalid="ignore"):
        ramp = short * (short - 1) / 2 + np.where(j > short, (j - short) * short, 0)
        total = np.max(
            np.minimum(j + size * np.maximum(ramp, 0), np.where(j > 0, j * condition(matrices, w), 0)),
            axis=-1,
        )
        grown = np.max(radius**j, axis=-1)
    return np.asarray(total, np.float64), np.asarray(grown, np.longdouble)
