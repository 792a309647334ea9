"""The analytic or reference solution of a scene, in extended precision, with a bound of its error.

Linear scenes move in normal modes (`linear`), and drives add a response (`response`).  Every other smooth
scene has a reference that is integrated (`reference`), unless that needs too many calls of the force, or its
stated error is above a thousandth of the motion: then there is none, and `no_reference` says why.  The error
of a mode is some roundings of extended precision times the phase: a phase of 1e6 is known to 1e-13, and to
1e-9 where `long double` is no wider than double (`arrays.ROUNDOFF`).  `uncertainty` is the bound.

Times are (number of steps) * h with the very double h that the engines were given: after 1e7 steps a phase in
double precision would be wrong by 1e-10.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from springcheck.physics.arrays import EPS, Extended, Integers
from springcheck.physics.exact.linear import LinearMotion
from springcheck.physics.exact.normal import Modes

if TYPE_CHECKING:
    from springcheck.physics.scene import Scene

__all__ = ["EPS", "Modes", "has_true_motion", "no_reference", "true_motion", "uncertainty"]


MOST_NUMBERS = 1 << 20
"""Most positions that are computed at a time, in extended precision."""


def has_true_motion(scene: Scene) -> bool:
    """Whether `true_motion` has a solution for the scene; the first call may integrate it."""
    return scene.system.solution is not None


def no_reference(scene: Scene) -> str:
    """Why the scene has no solution, in a clause; empty where it has one."""
    return scene.system.unsolved


def _needed(scene: Scene) -> Any:
    if (known := scene.system.solution) is None:
        raise ValueError(f"no reference solution of scene {scene.name!r}: {no_reference(scene)}")
    return known


def true_motion(scene: Scene, steps: Integers, h: float) -> tuple[Extended, Extended]:
    """Reference q and p (f, n) after these numbers of steps of h, in extended precision.

    Motion that leaves even the extended range is infinite.  Beyond the scene's duration it is NaN where it
    cannot be integrated.  Raises ValueError where there is none (see `no_reference`).
    """
    known = _needed(scene)
    # in blocks of times: the intermediate results take ten times the memory of the result
    rows = max(1, MOST_NUMBERS // scene.n)
    t = np.asarray(steps).astype(np.longdouble)[:, None] * np.longdouble(h)
    q, p = np.empty((2, len(t), scene.n), np.longdouble)
    for begin in range(0, len(t), rows):
        some = slice(begin, begin + rows)
        q[some], p[some] = known.at(t[some])
    return q, p


def uncertainty(scene: Scene, duration: float) -> float:
    """Bound on the error of `true_motion` from the start to a time [T], relative to the initial energy norm.

    Smaller errors of an engine are not reported.  The bound is infinite where the motion leaves the extended
    range. ValueError as for `true_motion`.
    """
    system, known = scene.system, _needed(scene)
    with np.errstate(all="ignore"):
        # the errors of all particles together are smaller than the sum of their bounds; a chain has a joint
        # bound
        modes = LinearMotion(system) if system.has_modes else None
        square = modes.energy_of_doubt(np.longdouble(duration)) if modes else None
        if square is None:
            dq, dp = known.doubt(duration)
            # the error of a spring's elongation is that of both of its ends
            square = np.longdouble(np.sum(system.rigidity * dq * dq + dp * dp / scene.m) / 2)
            for group in system.free_groups if duration else ():
                square += np.sum(scene.m[group] * dq[group] ** 2) / (2 * duration * duration)
        found = float(np.sqrt(square) / system.norm.unit)
    return found if found >= 0 else np.inf
