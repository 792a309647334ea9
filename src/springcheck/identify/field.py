"""Two coordinates that turn into each other: a magnetic field across their plane, or a turning frame.

With z = x + i y, on springs alike along both axes, a frame takes (z, z') to A (z, z') with a complex A, where
without a field A is real.  The phase of its determinant is the angle by which the field turns a velocity.
"""

from __future__ import annotations

import cmath
import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from springcheck.identify.misplaced import MOST_COMPARED
from springcheck.identify.record import Record
from springcheck.identify.result import Explanation

LEFT = 1e-9
"""Largest residual of a right complex map, relative to the states: the roundings of a long motion."""

KEPT = 1e-4
"""Largest distance of the determinant from 1 where its angle is that of the velocity."""

BORIS_AGREES = 1e-10
"""Share of the largest entry by which Boris' map may miss the measured one."""


def of_plane(record: Record) -> list[Explanation]:
    """Explain by a rotation of two coordinates into each other, of the first pair that it alone couples."""
    moving = np.flatnonzero(np.ptp(record.q, axis=0) + np.ptp(record.v, axis=0) > 0)
    for i, j in combinations(moving[:MOST_COMPARED].tolist(), 2):
        if found := _of_two(record, i, j):
            return found
    return []


def _of_two(record: Record, i: int, j: int) -> list[Explanation]:
    (x, y), (u, v) = (a[:, [i, j]].astype(np.float64).T for a in (record.q, record.v * record.interval))
    z = np.stack([x + 1j * y, u + 1j * v, np.ones(len(x))], axis=1)
    size = np.max(np.abs(z), axis=0)
    # where the motion grows or decays, each frame is weighted by its size
    each = np.max(np.abs(z[:-1, :2]) / size[:2], axis=1, keepdims=True)
    weight = 1 / each if np.all(each > 0) else 1.0
    scaled = weight * z[:-1] / size
    rows = np.linalg.lstsq(scaled, weight * z[1:] / size)[0]
    off = np.max(np.abs(weight * z[1:] / size - scaled @ rows))
    entries = np.asarray((rows * size / size[:, None]).T[:2, :2], np.complex128)
    size = size[:2]
    if off > LEFT or np.max(np.abs(entries.imag) * size / size[:, None]) < LEFT:
        return []
    interval = abs(float(record.interval))
    det = complex(np.linalg.det(entries))
    angle = cmath.phase(det)
    if abs(angle) < LEFT:
        # the velocities are other numbers than these positions', and nothing turns them
        return []
    of = f" of coordinates {i} and {j}" if record.q.shape[1] > 2 else ""
    turned = f"{angle:.9g}" if abs(abs(det) - 1) < KEPT else f"about {angle:.2g}"
    cause = (
        f"The velocity{of} turns by {turned} in each frame beside what springs alike along both axes do: a "
        "magnetic field across the plane, or Coriolis' force in a turning frame"
    )
    half = math.tan(-angle / 2)
    turn = cmath.exp(1j * angle)
    stiff = (-2 * entries[1, 0] / (1 + turn)).real
    boris = _boris(stiff, turn)
    if np.max(np.abs(boris - entries)) <= BORIS_AGREES * np.max(np.abs(entries)):
        cause += (
            f". By Boris, if every step was recorded: strength over mass {2 * half / interval:.9g}, "
            f"stiffness over mass {stiff / interval**2:.9g}"
        )
    return [
        Explanation(
            cause=cause, remedy="judge it against a scene with [[magnetic]]", misfit=float(off), local=True
        )
    ]


def _boris(stiff: float, turn: complex) -> NDArray[np.complex128]:
    """Its map of (z, z' h) by (h w)**2 and the factor exp(-2 i atan(W h/2)) of the velocity."""
    drift, kick = np.array([[1, 0.5], [0, 1]]), np.array([[1, 0], [-stiff / 2, 1]])
    return np.asarray(drift @ kick @ np.diag([1, turn]) @ kick @ drift, np.complex128)
