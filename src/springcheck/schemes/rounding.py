"""What one step of a scheme can round: running error bounds, and how many roundings there are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from springcheck.arrays import Force, Reals
from springcheck.schemes.catalogue import Scheme, number
from springcheck.schemes.stepping import acting, weighted_sum


def magnitude_step(
    scheme: Scheme,
    q: Reals,
    p: Reals,
    *,
    h: float,
    m: Reals,
    magnitude: Force,
    stiffness: Reals | None = None,
    rate: Reals | None = None,
    parts: tuple[Force, Force] | None = None,
    kicks: Sequence[Force] = (),
) -> tuple[Reals, Reals]:
    """What bounds the rounding of `step`: the same step with every difference taken as a sum.

    `magnitude` and `parts` are made by `System.magnitude`; `kicks` are one for each kick of a splitting,
    near where it takes place, and stand for `magnitude` where they are given.  An implicit scheme's is
    carried through the solution of its equation.
    """
    direction = np.sign(h)
    # in extended precision: the square of a step may leave the range of a double
    q, p, size = np.abs(q), np.abs(p), np.abs(np.longdouble(h))
    if scheme.stages:
        stages: list[tuple[str, float]] = [(kind, abs(number(c, np.float64))) for kind, c in scheme.stages]
        each = iter(kicks)
        for kind, c in stages:
            if kind == "drift":
                q = q + c * size * p / m
            elif kind == "friction":
                # a rounding of x in exp(-x) costs x exp(-x) p, and the decayed p is exp(-x) p: the sum is
                # below p forwards in time; backwards p grows first
                x = np.zeros_like(m) if rate is None else -c * direction * size * rate
                p = p * np.where(x > 0, (1 + x) * np.exp(x), 1)
            else:
                p = p + c * size * next(each, acting(kind, magnitude, parts))(q, p)
        return q, p
    rows = [[abs(float(c)) * size for c in row] for row in scheme.a]
    forces: list[Reals] = []
    velocities: list[Reals] = []
    for row in rows:
        qs = weighted_sum(list(zip(row, velocities, strict=False)), q)
        ps = weighted_sum(list(zip(row, forces, strict=False)), p)
        own = row[len(forces)]
        if own:
            slowed = np.ones_like(m) if rate is None else np.abs(1 + direction * own * rate)
            kicked = (ps + own * magnitude(qs, np.zeros_like(ps))) / slowed
            qs = _solved(qs + own * kicked / m, own**2 / (m * slowed), stiffness)
            ps = (ps + own * magnitude(qs, np.zeros_like(ps))) / slowed
        forces.append(magnitude(qs, ps))
        velocities.append(ps / m)
    weights = [abs(float(c)) * size for c in scheme.b]
    return (
        weighted_sum(list(zip(weights, velocities, strict=True)), q),
        weighted_sum(list(zip(weights, forces, strict=True)), p),
    )


def _solved(given: Reals, factor: Reals, stiffness: Reals | None) -> Reals:
    """What bounds the rounding of the solution of (1 + factor * stiffness) x = b, `given` bounding b.

    Componentwise backward error: |A^-1| (|A| |x| + |b|) with |x| <= |A^-1| |b| (Higham, Accuracy and
    Stability of Numerical Algorithms, 7.2).
    """
    if stiffness is None:
        return given
    if stiffness.ndim == 1:
        change = factor * stiffness
        inverse = 1 / np.abs(1 + change)
        return np.asarray(((1 + np.abs(change)) * (inverse * given) + given) * inverse)
    matrix = np.asarray(factor, np.float64)[:, None] * np.asarray(stiffness, np.float64)
    inverse = np.abs(np.linalg.inv(np.eye(len(matrix)) + matrix)).T
    return np.asarray(((given @ inverse) @ (np.eye(len(matrix)) + np.abs(matrix)).T + given) @ inverse)


def roundings(scheme: Scheme) -> int:
    """Roundings on the longest path through one step: a force 4, a kick 2, a drift 3, in and out 4.

    Friction takes 3: its exponent, the exponential and the product.
    """
    if scheme.stages:
        return 4 + sum(3 if kind in ("drift", "friction") else 6 for kind, _ in scheme.stages)
    return 4 + sum(6 + 3 + 2 * len(row) for row in scheme.a) + 2 * len(scheme.b)
