"""The true motion of a scene, in extended precision.

Linear scenes move in normal modes (`linear`).  Single particles in a stiffening well or on a pendulum,
and pairs on a Morse bond, have closed forms of their own (`wells`), by Jacobi's elliptic functions
(`elliptic`).  Where the particles of a scene fall into groups that nothing joins, its motion is known if
that of every group is.

Times are taken as (number of steps) * h with the very double h that the engines were given: after 1e7
steps a phase in double precision would be wrong by 1e-10.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from springcheck.arrays import Extended, Integers
from springcheck.physics import mechanics
from springcheck.physics.exact import linear, wells
from springcheck.physics.exact.elliptic import EPS
from springcheck.physics.exact.linear import Modes, modes
from springcheck.physics.scene import Scene

__all__ = ["EPS", "Modes", "has_true_motion", "modes", "true_motion"]

Motion = Callable[[Scene, Extended], tuple[Extended, Extended]]
"""A scene and times t (f, 1) [T] -> q and p (f, n)."""


def has_true_motion(scene: Scene) -> bool:
    """Whether `true_motion` knows the scene."""
    if mechanics.has_modes(scene):
        return True
    with np.errstate(all="ignore"):
        return _groups(scene) is not None


def true_motion(
    scene: Scene, steps: Integers, h: float, known: Modes | None = None
) -> tuple[Extended, Extended]:
    """True q and p (f, n) after these numbers of steps of h, in extended precision.

    `known` are the scene's modes, for a caller that asks often.  Motion that leaves even the extended
    range comes back infinite.  ValueError: the motion has no closed form here (see `has_true_motion`).
    """
    t = np.asarray(steps).astype(np.longdouble)[:, None] * np.longdouble(h)
    if known is not None or mechanics.has_modes(scene):
        return linear.motion(scene, t, known)
    q, p = np.empty((2, len(t), scene.n), dtype=np.longdouble)
    with np.errstate(all="ignore"):
        groups = _groups(scene)
        if groups is None:
            raise ValueError(f"the motion of scene {scene.name!r} has no closed form here")
        for chosen, motion in groups:
            q[:, chosen], p[:, chosen] = motion(mechanics.part(scene, chosen), t)
    return q, p


def _groups(scene: Scene) -> list[tuple[Integers, Motion]] | None:
    """Particles and the closed form that moves them, or None where some have none."""
    acting = mechanics.acting(scene)
    nothing = np.zeros(scene.n, dtype=bool)
    left = ~nothing
    found: list[tuple[Integers, Motion]] = []
    for well in wells.WELLS:
        other = np.any([nothing, *(here for key, here in acting.items() if key not in well.terms)], axis=0)
        chosen = np.flatnonzero(acting.get(well.key, nothing) & ~other)
        if len(chosen):
            if not well.is_known(mechanics.part(scene, chosen)):
                return None
            found.append((chosen, well.motion))
            left[chosen] = False
    rest = np.flatnonzero(left)
    if len(rest):
        if not mechanics.has_modes(mechanics.part(scene, rest)):
            return None
        found.append((rest, linear.motion))
    return found
