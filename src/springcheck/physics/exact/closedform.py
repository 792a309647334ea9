"""The base class of all solutions of a motion."""

from __future__ import annotations

from typing import Any, Self, TypeAlias

import numpy as np

from springcheck.physics.arrays import Extended
from springcheck.physics.system import System

States: TypeAlias = tuple[Extended, Extended]
PI = 4 * np.arctan(np.longdouble(1))


class NoClosedFormError(ValueError):
    """A system for which this closed form does not hold."""


class ClosedForm:
    """The motion of a system.  Its constructor computes the constants of the motion once, or raises
    NoClosedFormError."""

    def __init__(self, system: System[Any]) -> None:
        self.system = system

    def need(self, known: Any) -> None:
        """Raise NoClosedFormError unless the motion is known."""
        if not known:
            raise NoClosedFormError

    @classmethod
    def of(cls, system: System[Any]) -> Self | None:
        """The closed form of a system, None where it does not apply."""
        try:
            return cls(system)
        except NoClosedFormError:
            return None

    def at(self, t: Extended) -> States:
        """q and p (f, n) at times t (f, 1) [T]."""
        raise NotImplementedError

    def doubt(self, t: np.longdouble) -> States:
        """Bounds (n,) on the errors of q [L] and p [M L/T] from the start to a time [T], or back to it."""
        raise NotImplementedError


def wide(x: Any) -> Extended:
    """Doubles in extended precision."""
    return np.asarray(x, np.longdouble)
