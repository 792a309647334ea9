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
