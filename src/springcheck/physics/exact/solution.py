"""The exact solution of a system: normal modes, and closed forms of groups that nothing joins to others.

Each closed form serves single particles in a well, or pairs on a bond, that nothing joins to others, all at
once, at times t (f, 1).  Near a separatrix all hangs on how far the energy lies from that of the barrier, and
at the start on how far the particle stands from its top.  Where these cancel they are taken in more digits
(`digits`); nothing that follows loses any.  So every motion is known to a few roundings of its size and of
its time, near a barrier as elsewhere.
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
    """The exact motion of n particles, in groups (s,) that move by themselves."""

    n: int
    groups: tuple[tuple[Integers, ClosedForm], ...]

    def __call__(self, steps: Integers, h: float) -> tuple[Extended, Extended]:
        """q and p (f, n) after these numbers of steps of h: see `exact.true_motion`."""
        return self.at(np.asarray(steps).astype(np.longdouble)[:, None] * np.longdouble(h))

    def at(self, t: Extended) -> tuple[Extended, Extended]:
        """The same at times t (f, 1) [T]."""
        q, p = np.empty((2, len(t), self.n), dtype=np.longdouble)
        with np.errstate(all="ignore"):
            for particles, motion in self.groups:
                q[:, particles], p[:, particles] = motion.at(t)
        return q, p

    def doubt(self, duration: float) -> tuple[Extended, Extended]:
        """Bounds (n,) of the errors of q and p from the start to a time [T], which may lie before it."""
        q, p = np.empty((2, self.n), dtype=np.longdouble)
        with np.errstate(all="ignore"):
            for particles, motion in self.groups:
                q[particles], p[particles] = motion.doubt(np.longdouble(duration))
        # infinite where the motion itself is; never no number
        return np.nan_to_num(q, nan=np.inf, posinf=np.inf), np.nan_to_num(p, nan=np.inf, posinf=np.inf)

    @property
    def growth(self) -> float | None:
        """The largest derivative of the flow between two times, in the energy norm; None where some closed
        form does not know it."""
        each = [motion.growth for _, motion in self.groups]
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
    for law in _of_whole_scenes(system):
        if motion := law.of(system):
            return Solution(n=system.n, groups=((np.arange(system.n), motion),))
    groups: list[tuple[Integers, ClosedForm]] = []
    nothing = np.zeros(system.n, dtype=bool)
    acting = system.acting
    if system.rods:
        # what acts along one axis of a rod is felt along all of them
        acting = {key: system.rods.reach(here) for key, here in acting.items()}
    left = ~nothing
    with np.errstate(all="ignore"):
        for law in _of_groups(system):
            others = (here for key, here in acting.items() if key not in law.terms)
            other = np.any([nothing, *others], axis=0)
            mine = left if law is LinearMotion else acting.get(law.key, nothing) & ~other
            chosen = np.flatnonzero(mine)
            if len(chosen):
                if any(np.any(mine[x.particles[0]] != mine[x.particles[-1]]) for x in system.terms):
                    # the end of a pair whose other end something else acts on
                    return None
                motion = law.of(system.beside(system.part(chosen)))
                if motion is None:
                    return None
                groups.append((chosen, motion))
                left[chosen] = False
    return Solution(n=system.n, groups=tuple(groups))


def _of_whole_scenes(system: SolvedSystem[Any]) -> Iterator[type[ClosedForm]]:
    """Closed forms of all particles together; what a scene has nothing for is not imported."""
    yield LinearMotion
    if "magnetic" in system.acting:
        from springcheck.physics.exact.gyration import Gyration

        yield Gyration
    elif system.is_driven:
        from springcheck.physics.exact.mathieu import ModulatedMotion
        from springcheck.physics.exact.response import Response

        yield from (Response, ModulatedMotion)
    elif system.is_damped and system.is_linear:
        from springcheck.physics.exact.damped import UnlikeFriction

        yield UnlikeFriction
    if system.rods:
        from springcheck.physics.exact.lumped import LumpedMotion

        yield LumpedMotion


def _of_groups(system: SolvedSystem[Any]) -> Iterator[type[ClosedForm]]:
    """Closed forms of particles that nothing joins to others, at last that of normal modes for the rest."""
    if system.brakes_by_place:
        from springcheck.physics.exact.relaxation import VanDerPolMotion

        yield VanDerPolMotion
    if "bond" in system.acting:
        from springcheck.physics.exact.swinging import SwingingMotion

        yield SwingingMotion
    from springcheck.physics.exact.bond import MorseMotion
    from springcheck.physics.exact.pendulum import HangingRods, PendulumMotion
    from springcheck.physics.exact.quartic import QuarticMotion
    from springcheck.physics.exact.turning import TurningRods, TurningWallRods

    yield from (
        QuarticMotion, PendulumMotion, MorseMotion, TurningRods, TurningWallRods, HangingRods, LinearMotion,
    )  # fmt: skip
