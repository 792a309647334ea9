"""Laws of thermostats on a spring: temperatures against the step, limits of stability against friction."""

from __future__ import annotations

from collections.abc import Callable
from math import nan

import numpy as np

from springcheck.bath import THERMOSTATS, Law
from springcheck.physics.arrays import Floats

RATE = 0.4
"""Friction over omega at which temperatures are measured."""

LARGEST_H_OMEGA, RESOLVED = 8.0, 5e-5
"""Largest h omega up to which a limit is looked for, and the largest error of a limit."""


def law_at(scheme: str, turns: Floats, frictions: Floats | float) -> Law:
    """The law of a scheme at these h omega and frictions over omega (n,)."""
    one = np.ones(len(turns))
    return Law(scheme=THERMOSTATS[scheme], h=1.0, m=one, k=turns**2, rate=frictions * turns, thermal=1.0)


def curve(scheme: str, turns: Floats, of: str) -> Floats:
    """The law's temperature at these h omega, NaN where the step is unstable."""
    with np.errstate(all="ignore"):
        found = np.asarray(getattr(law_at(scheme, turns, RATE), of))
    return np.where(np.isfinite(found), found, nan)


def last_stable(radius: Callable[[Floats], Floats], n: int, to: float) -> Floats:
    """The largest h omega (n,) up to which no map grows, `to` this part of it; infinity where none up to 8
    does, NaN where growth there is too slow to tell from none.

    The rounding of a map is 1e-15; where its two eigenvalues coincide it acts by its square root.
    """
    slack, low, high = 1e-7, np.zeros(n), np.full(n, np.inf)
    for turn in np.geomspace(0.02, LARGEST_H_OMEGA, 25):
        going = np.isinf(high)
        stable = radius(np.full(n, turn)) <= 1 + slack
        low, high = np.where(going & stable, turn, low), np.where(going & ~stable, turn, high)
        if not np.any(np.isinf(high)):
            break
    endless = np.isinf(high)
    while np.any(~endless & (high - low > to * high) & (high > 1e-3)):
        middle = np.where(endless, LARGEST_H_OMEGA, (low + high) / 2)
        stable = radius(middle) <= 1 + slack
        low, high = np.where(stable & ~endless, middle, low), np.where(stable, high, middle)
        high[endless] = np.inf
    some = high > 1e-3
    below = np.where(endless, LARGEST_H_OMEGA, np.maximum(low - RESOLVED, 1e-9))
    decays = radius(np.where(some, below, 1.0)) <= 1 - slack
    return np.where(some, np.where(decays, np.where(endless, np.inf, low), nan), 0.0)


def limits(scheme: str, frictions: Floats) -> Floats:
    """The largest h omega at which the law of a scheme is stable, at frictions over omega (n,)."""
    with np.errstate(all="ignore"):
        return last_stable(lambda turns: law_at(scheme, turns, frictions).growth, len(frictions), 1e-9)
