"""The exact solution of a system: normal modes, and closed forms of groups that nothing joins to others.

Each closed form serves single particles in a well, or pairs on a bond, that nothing joins to others, all at
once, at times t (f, 1).  Near a separatrix all hangs on how far the energy lies from that of the barrier, and
at the start on how far the particle stands from its top.  Where these cancel they are taken in more digits
(`digits`); nothing that follows loses any.  So every motion is known to a few roundings of its size and of
its time, near a barrier as elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from springcheck.physics.arrays import Extended, Integers
from springcheck.physics.exact import linear
from springcheck.physics.exact.well import Well

if TYPE_CHECKING:
    from springcheck.physics.scene import Scene
    from springcheck.physics.system import System


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Group:
    """Particles (s,) of a scene, the scene of these alone, and the closed form of their motion."""

    particles: Integers
    scene: Scene
    found: Any
    """What was worked out once (see `Well.prepare`)."""
    law: Well


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """The exact motion of n particles, in groups that move by themselves."""

    n: int
    groups: tuple[_Group, ...]

    def __call__(self, steps: Integers, h: float) -> tuple[Extended, Extended]:
        """q and p (f, n) after these numbers of steps of h: see `exact.true_motion`."""
        t = np.asarray(steps).astype(np.longdouble)[:, None] * np.longdouble(h)
        q, p = np.empty((2, len(t), self.n), dtype=np.longdouble)
        with np.errstate(all="ignore"):
            for group in self.groups:
                q[:, group.particles], p[:, group.particles] = group.law.motion(group.scene, group.found, t)
        return q, p

    def doubt(self, duration: float) -> tuple[Extended, Extended]:
        """Bounds (n,) of the errors of q and p from the start to a time [T], which may lie before it."""
        q, p = np.empty((2, self.n), dtype=np.longdouble)
        with np.errstate(all="ignore"):
            for group in self.groups:
                q[group.particles], p[group.particles] = group.law.doubt(
                    group.scene, group.found, np.longdouble(duration)
                )
        # infinite where the motion itself is; never no number
        return np.nan_to_num(q, nan=np.inf, posinf=np.inf), np.nan_to_num(p, nan=np.inf, posinf=np.inf)


def solution(system: System) -> Solution | None:
    """The exact motion of a system, None where some particles have no closed form here."""
    if system.has_modes:
        whole = _Group(particles=np.arange(system.n), scene=system.scene, found=True, law=linear.LINEAR)
        return Solution(n=system.n, groups=(whole,))
    if "magnetic" in system.acting:
        from springcheck.physics.exact.gyration import GYRATION

        ready = GYRATION.prepare(system.scene)
        here = _Group(particles=np.arange(system.n), scene=system.scene, found=ready, law=GYRATION)
        return Solution(n=system.n, groups=(here,)) if ready else None
    if system.is_driven:
        from springcheck.physics.exact.mathieu import MATHIEU
        from springcheck.physics.exact.response import RESPONSE

        for law in (RESPONSE, MATHIEU):
            if ready := law.prepare(system.scene):
                here = _Group(particles=np.arange(system.n), scene=system.scene, found=ready, law=law)
                return Solution(n=system.n, groups=(here,))
        return None
    from springcheck.physics.exact.bond import MORSE
    from springcheck.physics.exact.pendulum import COSINE, RIGID, ROD, WALL_ROD
    from springcheck.physics.exact.quartic import QUARTIC

    found: list[_Group] = []
    nothing = np.zeros(system.n, dtype=bool)
    acting = system.acting
    if system.rods:
        # what acts along one axis of a rod is felt along all of them
        acting = {key: system.rods.reach(here) for key, here in acting.items()}
    left = ~nothing
    with np.errstate(all="ignore"):
        for law in (QUARTIC, COSINE, MORSE, ROD, WALL_ROD, RIGID, linear.LINEAR):
            others = (here for key, here in acting.items() if key not in law.terms)
            other = np.any([nothing, *others], axis=0)
            mine = left if law is linear.LINEAR else acting.get(law.key, nothing) & ~other
            chosen = np.flatnonzero(mine)
            if len(chosen):
                part = system.part(chosen)
                ready = law.prepare(part)
                if ready is None:
                    return None
                found.append(_Group(particles=chosen, scene=part, found=ready, law=law))
                left[chosen] = False
    return Solution(n=system.n, groups=tuple(found))
