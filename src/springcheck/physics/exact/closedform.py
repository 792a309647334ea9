"""The base class of all closed forms of a motion."""

from __future__ import annotations

from typing import Any, ClassVar, Self, TypeAlias

import numpy as np

from springcheck.physics.arrays import EPS, Extended
from springcheck.physics.system import System

States: TypeAlias = tuple[Extended, Extended]
PI = 4 * np.arctan(np.longdouble(1))

CANCELS = 16
"""Sums smaller than their summands by this factor are computed with more digits."""

LAST = 64 * EPS
"""Roundings of a closed form, relative to each size that it is made of; `validation/exact_check.py` finds
at most a tenth of them."""


class NoClosedFormError(ValueError):
    """A system for which this closed form does not hold."""


class ClosedForm:
    """The exact motion of a system.

    Its constructor works out once what all times share, the constants of the motion, or raises
    NoClosedFormError.  Of a part of a scene it serves the particles on which a term `key` acts, and nothing
    but `terms`; one that has no `terms` serves a whole scene.
    """

    key: ClassVar[str] = ""
    terms: ClassVar[frozenset[str]] = frozenset()
    growth: float | None = None
    """The largest derivative of the flow between two times, in the energy norm, where it is known."""

    def __init__(self, system: System[Any]) -> None:
        self.system = system

    def need(self, known: Any) -> None:
        """Raise NoClosedFormError unless the motion is known."""
        if not known:
            raise NoClosedFormError

    @classmethod
    def of(cls, system: System[Any]) -> Self | None:
        """That of a system, None where it does not know the motion."""
        try:
            return cls(system)
        except NoClosedFormError:
            return None

    def at(self, t: Extended) -> States:
        """Exact q and p (f, n) at times t (f, 1) [T]."""
        raise NotImplementedError

    def doubt(self, t: np.longdouble) -> States:
        """Bounds (n,) of the errors of q [L] and p [M L/T], from the start to a time [T], which may lie
        before it."""
        raise NotImplementedError


def wide(x: Any) -> Extended:
    """Doubles in extended precision."""
    return np.asarray(x, np.longdouble)


def one_each(system: System[Any]) -> bool:
    """Whether exactly one term acts on each particle."""
    return bool(np.all(system.pulls() == 1))


def latency(m1: Extended) -> Extended:
    """Bound of F(phi | m) up to a quarter turn, for any phi that numbers of this width can tell from it."""
    return np.asarray(2 + np.log(16 / np.maximum(np.abs(m1), EPS**4)) / 2)
