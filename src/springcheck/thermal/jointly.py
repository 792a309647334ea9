"""Draws of all particles of a step together, where the force amid it depends on those of others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from springcheck.physics.arrays import Extended

MOST_JOINTLY = 64
"""Particles up to which draws are solved for together: a square matrix of twice their number a step."""


def jointly(
    at: Callable[[Extended], Extended], target: Extended, found: Extended, of: Extended
) -> tuple[Extended, Extended]:
    """Draws (2, f, n) that lead to the target (2, f, n), from a first guess, and a rounding of each where
    the target has those `of`; infinite ones where they are too many, or are not found."""
    u, f, n = found.shape
    unknown = np.full_like(found, np.inf)
    if n > MOST_JOINTLY:
        return found, unknown
    for _ in range(6):
        now = at(found)
        J = np.empty((f, u * n, u * n))
        for column in range(u * n):
            one = np.zeros_like(found)
            one[column // n, :, column % n] = 1
            J[:, :, column] = (at(found + one) - now).transpose(1, 0, 2).reshape(f, u * n)
        try:
            inverse = np.linalg.inv(J)
        except np.linalg.LinAlgError:
            return found, unknown
        change = (inverse @ (target - now).transpose(1, 0, 2).reshape(f, u * n, 1)).reshape(f, u, n)
        found = found + change.transpose(1, 0, 2)
        if np.all(np.abs(change) <= 1e-9 * (1 + np.abs(found.transpose(1, 0, 2)))):
            break
    else:
        return found, unknown
    unit = np.abs(inverse) @ of.transpose(1, 0, 2).reshape(f, u * n, 1)
    # the inverse is a double's: what it leaves is beside the rounding
    return found, np.asarray((unit.reshape(f, u, n) + np.abs(change)).transpose(1, 0, 2))


def independent_sums(
    made: Extended, left: Extended, allowed: Callable[[Extended], Extended]
) -> tuple[Extended, Extended]:
    """Independent sums (2, f, n) of draws, as many as a state has numbers, and a rounding of each, where r n
    draws make `made` (2, r n, n) and have made what is `left` (2, f, n), with roundings as `allowed` by draws
    (r, f, n): by the Cholesky factor of the covariance.  Infinite where draws do not reach each number."""
    u, f, n = left.shape
    J = made.transpose(0, 2, 1).reshape(u * n, -1).astype(np.float64)
    size = np.linalg.norm(J, axis=1)
    try:
        J = J / size[:, None]
        inverse = np.linalg.inv(np.linalg.cholesky(J @ J.T))
    except np.linalg.LinAlgError:
        return np.full_like(left, np.inf), np.full_like(left, np.inf)

    def rows(x: Extended) -> Extended:
        return np.asarray(x.transpose(1, 0, 2).reshape(f, u * n) / size)

    sums = rows(left) @ inverse.T
    draws = (sums @ (inverse @ J)).reshape(f, -1, n).transpose(1, 0, 2)
    unit = rows(allowed(draws)) @ np.abs(inverse).T
    sums, unit = (x.reshape(f, u, n).transpose(1, 0, 2) for x in (sums, unit))
    return sums, unit
