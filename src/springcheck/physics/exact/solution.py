"""The exact solution of a system: normal modes, and closed forms of independent groups.

Each closed form serves single particles in a potential, or pairs on a bond, without other interaction, all at
once, at times t (f, 1).  Near a separatrix the motion depends on the difference of the energy from the
barrier, and at the start on the distance from its top.  Where these cancel they are computed in more digits
(`digits`), and no later step loses any, so that every motion is known to a few roundings of its size and
time, near a barrier as elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended, Integers
from springcheck.physics.exact.closedform import ClosedForm
from springcheck.physics.exact.linear import LinearMotion
from springcheck.physics.exact.normal import Modes, normal_modes
from springcheck.physics.system import Fields, System


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """The exact motion of n particles, in independent groups (s,)."""

    n: int
    groups: tuple[tuple[Integers, ClosedForm], ...]

    def at(self, t: Extended) -> tuple[Extended, Extended]:
        """q and p (f, n) at times t (f, 1) [T]."""
        q, p = np.empty((2, len(t), self.n), dtype=np.longdouble)
        with np.errstate(all="ignore"):
            for particles, motion in self.groups:
                q[:, particles], p[:, particles] = motion.at(t)
        return q, p

    def doubt(self, duration: float) -> tuple[Extended, Extended]:
        """Bounds (n,) on the errors of q and p from the start to a time [T], which may precede it."""
        q, p = np.empty((2, self.n), dtype=np.longdouble)
        with np.errstate(all="ignore"):
            for particles, motion in self.groups:
                q[particles], p[particles] = motion.doubt(np.longdouble(duration))
        # infinite where the motion itself is; never NaN
        return np.nan_to_num(q, nan=np.inf, posinf=np.inf), np.nan_to_num(p, nan=np.inf, posinf=np.inf)

    @property
    def growth(self) -> float | None:
        """The largest derivative of the flow between two times, in the energy norm; None where some closed
        form has no bound."""
        each = [motion.growth for _, motion in self.groups]
        return None if None in each else max(x for x in each if x is not None)


class SolvedSystem(System[Fields]):
    """The facts of one scene, with its normal modes and its exact motion."""

    @cached_property
    def modes(self) -> Modes:
        """Normal modes.  ValueError where there are none (see `has_modes`)."""
        return normal_modes(self)

    @cached_property
    def solution(self) -> Solution | None:
        """The exact (analytic) solution, None where no closed form is known, or where a bath acts."""
        return None if self.scene.bath else _solution(self)


def _solution(system: SolvedSystem[Any]) -> Solution | None:
    """Solution of a system, None where some particles have no closed form here."""
    for law in _of_whole_scenes(system):
        if motion := law.of(system):
            return Solution(n=system.n, groups=((np.arange(system.n), motion),))
    groups: list[tuple[Integers, ClosedForm]] = []
    nothing = np.zeros(system.n, dtype=bool)
    acting = system.acting
    left = ~nothing
    with np.errstate(all="ignore"):
        for law in _of_groups(system):
            others = (here for key, here in acting.items() if key not in law.terms)
            other = np.any([nothing, *others], axis=0)
            mine = left if law is LinearMotion else acting.get(law.key, nothing) & ~other
            chosen = np.flatnonzero(mine)
            if len(chosen):
                if any(np.any(mine[x.particles[0]] != mine[x.particles[-1]]) for x in system.terms):
                    # another term acts on the other end of a pair
                    return None
                motion = law.of(system.beside(system.part(chosen)))
                if motion is None:
                    return None
                groups.append((chosen, motion))
                left[chosen] = False
    return Solution(n=system.n, groups=tuple(groups))


def _of_whole_scenes(system: SolvedSystem[Any]) -> Iterator[type[ClosedForm]]:
    """Closed forms of all particles together; those that the scene's terms exclude are not imported."""
    yield LinearMotion
    if "magnetic" in system.acting:
        from springcheck.physics.exact.gyration import Gyration

        yield Gyration
    elif system.is_driven:
        from springcheck.physics.exact.mathieu import ModulatedMotion
        from springcheck.physics.exact.response import Response

        yield from (Response, ModulatedMotion)
    if ("magnetic" in system.acting or system.is_damped) and not system.is_driven:
        from springcheck.physics.exact.damped import CoupledModes

        yield CoupledModes


def _of_groups(system: SolvedSystem[Any]) -> Iterator[type[ClosedForm]]:
    """Closed forms of independent particles, and last that of normal modes for the rest."""
    if system.brakes_by_place:
        from springcheck.physics.exact.relaxation import VanDerPolMotion

        yield VanDerPolMotion
    if "bond" in system.acting:
        from springcheck.physics.exact.swinging import SwingingMotion

        yield SwingingMotion
    from springcheck.physics.exact.bond import MorseMotion
    from springcheck.physics.exact.pendulum import PendulumMotion
    from springcheck.physics.exact.quartic import QuarticMotion

    yield from (QuarticMotion, PendulumMotion, MorseMotion, LinearMotion)
