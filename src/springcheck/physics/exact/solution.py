"""The solution of a system: normal modes and their response to drives, or a reference that is integrated.

Particles without interaction are independent.  Those on which only linear terms act move in normal modes; the
others are integrated together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from springcheck.physics.arrays import Extended, Integers, States
from springcheck.physics.exact.linear import LinearMotion
from springcheck.physics.exact.normal import Modes, normal_modes
from springcheck.physics.graph import lowest_joined
from springcheck.physics.system import Fields, System


class Motion(Protocol):
    """The motion of a whole system, its constants computed once."""

    def at(self, t: Extended) -> States:
        """q and p (f, n) at times t (f, 1) [T]."""
        ...

    def doubt(self, t: np.longdouble) -> States:
        """Bounds (n,) on the errors of q [L] and p [M L/T] from the start to a time [T], or back to it."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """The motion of n particles, in independent groups (s,)."""

    n: int
    groups: tuple[tuple[Integers, Motion], ...]

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


class SolvedSystem(System[Fields]):
    """The facts of one scene, with its normal modes and its solution."""

    @cached_property
    def modes(self) -> Modes:
        """Normal modes.  ValueError where there are none (see `has_modes`)."""
        return normal_modes(self)

    @property
    def solution(self) -> Solution | None:
        """The analytic or reference solution, None where there is none (see `unsolved`)."""
        found = self._solved
        return None if isinstance(found, str) else found

    @property
    def unsolved(self) -> str:
        """Why there is no solution; empty where there is one."""
        return self._solved if isinstance(self._solved, str) else ""

    @cached_property
    def _solved(self) -> Solution | str:
        if self.scene.bath:
            return "a bath moves it at random"
        from springcheck.physics.exact.reference import NoReferenceError, reference

        groups: list[tuple[Integers, Motion]] = []
        with np.errstate(all="ignore"):
            left = np.ones(self.n, dtype=bool)
            for chosen in _linear(self):
                part = self if len(chosen) == self.n else self.beside(self.part(chosen))
                if motion := _closed_form(part):
                    groups.append((chosen, motion))
                    left[chosen] = False
            if np.any(left):
                chosen = np.flatnonzero(left)
                part = self if np.all(left) else self.beside(self.part(chosen))
                try:
                    groups.append((chosen, reference(part)))
                except NoReferenceError as error:
                    return str(error)
        return Solution(n=self.n, groups=tuple(groups))


def _linear(system: System[Any]) -> list[Integers]:
    """The particles (s,) on which only linear terms and drives act, also through others."""
    group, bent = lowest_joined(system.n, system.terms), np.zeros(system.n, dtype=bool)
    for term in system.terms:
        if not term.is_linear and term.key != "drive":
            for index in term.particles:
                bent[group[index]] = True
    chosen = np.flatnonzero(~bent[group])
    return [chosen] if len(chosen) else []


def _closed_form(system: System[Any]) -> Motion | None:
    if system.is_driven and system.without("drive").has_modes:
        from springcheck.physics.exact.response import Response

        return Response(system)
    return LinearMotion(system) if system.has_modes else None
