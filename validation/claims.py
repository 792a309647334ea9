"""The scheme that each program's documentation or source claims, so that its row can be wrong.

A claim is a scheme by its name, or a map of one spring where no name is known here: by its stability function
or by the kicks and drifts of its source.  Sources: the manuals of cannon-es, p2, planck and matter.js
(semi-implicit Euler; Verlet by positions, whose velocities are those of half a step before); GSL 2.7,
"Ordinary Differential Equations"; Boost.odeint's "Stepper overview" and headers; the manual of ODE,
"Integrator"; Simbody's doxygen of its integrators; PETSc 3.18's pages of TS.
"""

from collections.abc import Callable, Sequence
from math import sqrt
from typing import Any

import numpy as np

NAMED = {
    name: line.partition(": ")[0]
    for line in """
semi-implicit-euler: cannon-es cannon-es-spring p2 p2-spring planck matter-js ode-force ode-quick
semi-implicit-euler: simbody-semi-explicit-euler petsc-basicsymplectic-1
semi-implicit-euler-drift-kick: odeint-symplectic-euler
implicit-euler: planck-joint ode-slider gsl-rk1imp odeint-implicit-euler petsc-beuler
implicit-midpoint: gsl-rk2imp petsc-theta petsc-alpha
trapezoidal: petsc-cn
explicit-euler: odeint-euler simbody-explicit-euler petsc-euler petsc-rk-1fe
rk2-heun: simbody-runge-kutta2 petsc-rk-2a
rk2-midpoint: petsc-rk-2b
rk3-kutta: torchdiffeq:heun3 gsl-rk2 simbody-runge-kutta3 petsc-rk-3 petsc-rk-3bs
rk4: gsl-rk4 odeint-runge-kutta4 petsc-rk-4
fehlberg5: gsl-rkf45 petsc-rk-5f
cash-karp5: gsl-rkck odeint-cash-karp54
dormand-prince5: odeint-dopri5 petsc-rk-5dp
exact: gsl-rk8pd odeint-fehlberg78
gauss4: gsl-rk4imp
velocity-verlet: odeint-velocity-verlet simbody-verlet
position-verlet: petsc-basicsymplectic-2
yoshida4: petsc-basicsymplectic-4
""".strip().splitlines()
    for name in line.partition(": ")[2].split()
}
"""By name.  `exact`: of eighth order, which at h omega = 0.09 is the exact flow but for rounding."""


def of_polynomial(*numbers: float) -> Callable[[float], Any]:
    """The map of h omega by the coefficients of R, from the constant up."""

    def found(x: float) -> Any:
        z = np.array([[0, x], [-x, 0]])
        return sum(c * np.linalg.matrix_power(z, i) for i, c in enumerate(numbers))

    return found


def of_stages(first: str, drifts: Sequence[float], kicks: Sequence[float]) -> Callable[[float], Any]:
    """The map of drifts and kicks in turn, in shares of the step; `first` is "drift" or "kick"."""

    def found(x: float) -> Any:
        out = np.eye(2)
        for a, b in zip(drifts, kicks, strict=True):
            drift, kick = np.array([[1, a * x], [0, 1]]), np.array([[1, 0], [-b * x, 1]])
            out = (kick @ drift if first == "drift" else drift @ kick) @ out
        return out

    return found


_A, _B, _Z = (0.40518861839525227722, -0.28714404081652408900), (-3 / 73, 17 / 59), sqrt(7 / 8) / 3

_MIDDLE, _SMALL = 0.5 - sum(_A), -1 / 3 + _Z

MAPS = {
    "odeint-modified-midpoint": (
        "modified midpoint (Gragg) of two substeps, smoothed", of_polynomial(1, 1, 1 / 2, 1 / 8),
    ),
    "simbody-runge-kutta-merson": (
        "Runge-Kutta-Merson", of_polynomial(1, 1, 1 / 2, 1 / 6, 1 / 24, 1 / 144),
    ),
    "odeint-mclachlan": (
        "McLachlan's RKN, fourth order, six stages",
        of_stages("drift", (*_A, _MIDDLE, _MIDDLE, *_A[::-1]), (*_B, 1 - 2 * sum(_B), *_B[::-1], 0)),
    ),
    "odeint-m4-mclachlan": (
        "McLachlan's RKN, fourth order, five stages",
        of_stages("drift", (0.5 - _Z, _SMALL, 2 / 3, _SMALL, 0.5 - _Z), (1, -1 / 2, -1 / 2, 1, 0)),
    ),
    "cp2k:nve": ("velocity-verlet", of_stages("kick", (1, 0), (1 / 2, 1 / 2))),
    "petsc-basicsymplectic-3": (
        "Ruth, third order", of_stages("kick", (-1 / 24, 3 / 4, 7 / 24), (1, -2 / 3, 2 / 3)),
    ),
}  # fmt: skip
"""By their maps, with what they are called."""

ROUNDED = 1e-12
"""Accuracy of a trace and a determinant that are read off 200 steps: some thousand roundings."""


def agrees(entry: dict[str, Any], matrix: Any) -> bool:
    """Whether the determinant and the trace of a row are those of a map."""
    det, trace = float(np.linalg.det(matrix)), float(np.trace(matrix))
    allowed = 1e-10 if "decimals" in entry["precision"] else ROUNDED
    return bool(max(abs(entry["area"] - (det - 1)), abs(entry["trace"] - trace)) < allowed)
