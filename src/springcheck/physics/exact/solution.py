"""The exact solution of a system: normal modes, and closed forms of groups that nothing joins to others.

Each closed form serves single particles in a well, or pairs on a bond, that nothing joins to others, all at
once, at times t (f, 1).  Near a separatrix all hangs on how far the energy lies from that of the barrier, and
at the start on how far the particle stands from its top.  Where these cancel they are taken in more digits
(`digits`); nothing that follows loses any.  So every motion is known to a few roundings of its size and of
its time, near a barrier as elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from springcheck.physics.arrays import Extended, Integers, by_identity
from springcheck.physics.exact import linear
from springcheck.physics.exact.normal import Modes, normal_modes
from springcheck.physics.exact.well import Well
from springcheck.physics.system import Fields, System


@by_identity
class _Group(NamedTuple):
    """Particles (s,) of a system, the system of these alone, and the closed form of their motion."""

    particles: Integers
    system: System[Any]
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
        return self.at(np.asarray(steps).astype(np.longdouble)[:, None] * np.longdouble(h))

    def at(self, t: Extended) -> tuple[Extended, Extended]:
        """The same at times t (f, 1) [T]."""
        q, p = np.empty((2, len(t), self.n), dtype=np.longdouble)
        with np.errstate(all="ignore"):
            for group in self.groups:
                q[:, group.particles], p[:, group.particles] = group.law.motion(group.system, group.found, t)
        return q, p

    def doubt(self, duration: float) -> tuple[Extended, Extended]:
        """Bounds (n,) of the errors of q and p from the start to a time [T], which may lie before it."""
        q, p = np.empty((2, self.n), dtype=np.longdouble)
        with np.errstate(all="ignore"):
            for group in self.groups:
                q[group.particles], p[group.particles] = group.law.doubt(
                    group.system, group.found, np.longdouble(duration)
                )
        # infinite where the motion itself is; never no number
        return np.nan_to_num(q, nan=np.inf, posinf=np.inf), np.nan_to_num(p, nan=np.inf, posinf=np.inf)

    @property
    def growth(self) -> float | None:
        """The largest derivative of the flow between two times, in the energy norm; None where some law does
        not know it."""
        each = [group.law.growth and group.law.growth(group.system, group.found) for group in self.groups]
        return None if None in each else max(x for x in each if x is not None)


class SolvedSystem(System[Fields]):
    """The facts of one scene, its normal modes and its exact motion among them."""

    @cached_property
    def modes(self) -> Modes:
        """Normal modes.  ValueError where there are none (see `has_modes`)."""
        return normal_modes(self)

    @cached_property
    def solution(self) -> Solution | None:
        """The exact (analytic) solution, None where no closed form is known, or where a bath acts."""
        return None if self.scene.bath else _solution(self)


def _solution(system: SolvedSystem[Any]) -> Solution | None:
    """None where some particles have no closed form here."""
    everything = partial(_Group, particles=np.arange(system.n), system=system)
    if system.has_modes:
        return Solution(n=system.n, groups=(everything(found=system.modes, law=linear.LINEAR),))
    if system.is_driven or "magnetic" in system.acting:
        from springcheck.physics.exact.gyration import GYRATION
        from springcheck.physics.exact.mathieu import MATHIEU
        from springcheck.physics.exact.response import RESPONSE

        for law in (GYRATION,) if "magnetic" in system.acting else (RESPONSE, MATHIEU):
            if ready := law.prepare(system):
                return Solution(n=system.n, groups=(everything(found=ready, law=law),))
        return None
    if system.is_linear and system.is_damped and not system.rods:
        from springcheck.physics.exact.damped import UNLIKE_FRICTION

        ready = UNLIKE_FRICTION.prepare(system)
        return ready and Solution(n=system.n, groups=(everything(found=ready, law=UNLIKE_FRICTION),))
    from springcheck.physics.exact.bond import MORSE
    from springcheck.physics.exact.pendulum import COSINE, RIGID
    from springcheck.physics.exact.quartic import QUARTIC
    from springcheck.physics.exact.turning import ROD, WALL_ROD

    if system.rods and system.scene.places is None:
        from springcheck.physics.exact.lumped import LUMPED

        if ready := LUMPED.prepare(system):
            return Solution(n=system.n, groups=(everything(found=ready, law=LUMPED),))
    laws = [QUARTIC, COSINE, MORSE, ROD, WALL_ROD, RIGID, linear.LINEAR]
    if "bond" in system.acting:
        from springcheck.physics.exact.swinging import SWINGING

        laws.insert(0, SWINGING)
    if system.brakes_by_place:
        from springcheck.physics.exact.relaxation import VAN_DER_POL

        laws.insert(0, VAN_DER_POL)
    found: list[_Group] = []
    nothing = np.zeros(system.n, dtype=bool)
    acting = system.acting
    if system.rods:
        # what acts along one axis of a rod is felt along all of them
        acting = {key: system.rods.reach(here) for key, here in acting.items()}
    left = ~nothing
    with np.errstate(all="ignore"):
        for law in laws:
            others = (here for key, here in acting.items() if key not in law.terms)
            other = np.any([nothing, *others], axis=0)
            mine = left if law is linear.LINEAR else acting.get(law.key, nothing) & ~other
            chosen = np.flatnonzero(mine)
            if len(chosen):
                if any(np.any(mine[x.particles[0]] != mine[x.particles[-1]]) for x in system.terms):
                    # the end of a pair whose other end something else acts on
                    return None
                part = system.beside(system.part(chosen))
                ready = law.prepare(part)
                if ready is None:
                    return None
                found.append(_Group(particles=chosen, system=part, found=ready, law=law))
                left[chosen] = False
    return Solution(n=system.n, groups=tuple(found))
