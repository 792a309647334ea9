"""The base class of all closed forms of a motion."""

from __future__ import annotations

from typing import Any, ClassVar, Self, TypeAlias

import numpy as np

from springcheck.physics.arrays import EPS, Extended, Integers
from springcheck.physics.system import System

States: TypeAlias = tuple[Extended, Extended]
PI = 4 * np.arctan(np.longdouble(1))

CANCELS = 16
"""Least cancellation, summands over sum, for which sums are computed in more digits."""

FORM_EPS = 64 * EPS
"""Error bound of a closed form, relative to each size that it consists of; `validation/exact_check.py` finds
at most a tenth of it."""


class NoClosedFormError(ValueError):
    """A system for which this closed form does not hold."""


class ClosedForm:
    """The exact motion of a system.

    Its constructor computes the constants of the motion once, or raises NoClosedFormError.  For a part of a
    scene it serves the particles on which a term `key` acts, and no terms but `terms`; one without `terms`
    serves a whole scene.
    """

    key: ClassVar[str] = ""
    terms: ClassVar[frozenset[str]] = frozenset()
    growth: float | None = None
    """The largest derivative of the flow between two times, in the energy norm; None where unknown."""

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

    @property
    def one_each(self) -> bool:
        """Whether exactly one term acts on each particle."""
        return bool(np.all(self.system.pulls() == 1))

    def at(self, t: Extended) -> States:
        """Exact q and p (f, n) at times t (f, 1) [T]."""
        raise NotImplementedError

    def doubt(self, t: np.longdouble) -> States:
        """Bounds (n,) on the errors of q [L] and p [M L/T] from the start to a time [T], or back to it."""
        raise NotImplementedError


def wide(x: Any) -> Extended:
    """Doubles in extended precision."""
    return np.asarray(x, np.longdouble)


def by_particle(index: Integers, *rows: Any) -> States:
    """Positions and momenta (..., n) of the particles of these numbers (n,), in the order of the scene."""
    q, p = (np.take(x, np.argsort(index), axis=-1) for x in rows)
    return q, p
