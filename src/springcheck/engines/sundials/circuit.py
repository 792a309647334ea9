"""A circuit as the equations that Kirchhoff's laws give, unsolved for the currents, by SUNDIALS' IDA.

The unknowns of a loop are its charge q, the flux p of its coil, and the current i::

    q' = i        p' = -(voltages of its capacitors and resistors)        0 = p - L i

The last has no derivative: a differential-algebraic system of index 1, because L is not 0.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from sksundae.ida import IDA

from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene


def solver(scene: Scene, atol: Floats, most_steps: int, called: Callable[[float], None]) -> IDA:
    """IDA standing at the start, its vector (q, p, i).  `atol` is of (q, p); `called` gets every t asked."""
    n, m = scene.n, scene.m
    force = scene.system.force
    stiffness = np.asarray(scene.system.hessian(scene.q), np.float64)
    resistance = np.asarray(scene.system.friction_rates * m, np.float64)
    one = np.eye(n)

    def residual(t: float, y: Floats, yp: Floats, out: Floats) -> None:
        called(t)
        q, p, i = y[:n], y[n : 2 * n], y[2 * n :]
        out[:n] = yp[:n] - i
        out[n : 2 * n] = yp[n : 2 * n] - force(q, m * i)
        out[2 * n :] = p - m * i

    def jacobian(t: float, y: Floats, yp: Floats, out: Floats, cj: float, matrix: Floats) -> None:
        matrix[:n, :n], matrix[:n, 2 * n :] = cj * one, -one
        matrix[n : 2 * n, :n], matrix[n : 2 * n, n : 2 * n] = stiffness, cj * one
        matrix[n : 2 * n, 2 * n :] = np.diag(resistance)
        matrix[2 * n :, n : 2 * n], matrix[2 * n :, 2 * n :] = one, -np.diag(m)

    pull = force(scene.q, scene.p)
    found = IDA(
        residual, rtol=scene.tolerance, atol=np.concatenate([atol, atol[n:] / m]), jacfn=jacobian,
        algebraic_idx=list(range(2 * n, 3 * n)), max_num_steps=most_steps,
    )  # fmt: skip
    current = scene.p / m
    found.init_step(
        0.0, np.concatenate([scene.q, scene.p, current]), np.concatenate([current, pull, pull / m])
    )
    return found
