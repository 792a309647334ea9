"""What every closed form of a well needs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from springcheck.physics.arrays import EPS, Extended
from springcheck.physics.system import System

States: TypeAlias = tuple[Extended, Extended]
PI = 4 * np.arctan(np.longdouble(1))

CANCELS = 16
"""Sums that are smaller than their summands by this factor are taken in more digits."""

LAST = 64 * EPS
"""Roundings of a closed form, relative to each size that it is made of; `validation/exact_check.py` finds
at most a tenth of them."""


class Well(NamedTuple):
    """A closed form: for particles on which a term `key` acts, and nothing but `terms`."""

    key: str
    terms: frozenset[str]
    prepare: Callable[[System[Any]], Any]
    """What is worked out once for all times: constants of the motion; None where it is not known."""
    motion: Callable[[System[Any], Any, Extended], States]
    """A scene, what was worked out of it, and times t (f, 1) [T] -> q and p (f, n)."""
    doubt: Callable[[System[Any], Any, np.longdouble], States]
    """The same with one time -> bounds (n,) of the errors of q and p up to that time."""
    growth: Callable[[System[Any], Any], float] | None = None
    """A scene and what was worked out of it -> the largest derivative of the flow between two times of it, in
    the energy norm, where the law knows it."""


def wide(x: Any) -> Extended:
    """Doubles in extended precision."""
    return np.asarray(x, np.longdouble)


def one_each(system: System[Any]) -> bool:
    """Whether one term alone acts on each particle."""
    return bool(np.all(system.pulls() == 1))


def latency(m1: Extended) -> Extended:
    """Bound of F(phi | m) up to a quarter turn, for any phi that numbers of this width can tell from it."""
    return np.asarray(2 + np.log(16 / np.maximum(np.abs(m1), EPS**4)) / 2)
