"""The Jacobian of large scenes by its elements that are not 0: cost grows with the springs, not the cube."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_array

from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene

LARGE = 32
"""Particles above which the sparse solver is taken; below, the dense one is faster."""


def options(scene: Scene) -> dict[str, Any]:
    """What CVODE needs for the linear systems of (q, p) of this scene."""
    n = scene.n
    rows, columns = [np.arange(n), n + np.arange(n)], [n + np.arange(n)] * 2
    for i, j, _ in scene.system.elements(scene.q):
        rows.append(n + i)
        columns.append(j)
    by_place = scene.system.brakes_by_place
    if by_place:
        rows.append(n + np.arange(n))
        columns.append(np.arange(n))
    where = np.concatenate(rows).astype(np.int32), np.concatenate(columns).astype(np.int32)
    constant: list[Reals] = [1 / scene.m, -scene.system.friction_rates.astype(np.float64)]

    def matrix(values: Reals) -> Any:
        # elements of the same place are added up, in the order of columns that SuperLU takes
        return coo_array((values, where), shape=(2 * n, 2 * n)).tocsc()

    def jacobian(t: float, y: Floats, yp: Floats, out: Floats) -> None:
        values = [*constant, *(-k for *_, k in scene.system.elements(y[:n]))]
        if by_place:
            rate, bend = scene.system.friction_at(y[:n])
            values[1] = -rate
            values.append(-bend * y[n:])
        out[:] = matrix(np.concatenate(values)).data

    pattern = matrix(np.ones(len(where[0])))
    pattern.data[:] = 1
    return {"linsolver": "sparse", "sparsity": pattern, "jacfn": jacobian}
