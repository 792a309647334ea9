"""A driving force, which depends on the time.

The time is a coordinate (see `System.clocked`): the position of a clock of unit velocity on which no force
acts. On the extended states the motion is autonomous, so that the stages of a scheme decide where within a
step each force is evaluated (Hairer, Lubich & Wanner, Geometric Numerical Integration, VIII.2.1, the extended
phase space).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.term import Column, Origin, Term, WithoutPotential

CLOCK = 2.0**-500
"""Mass of the clock [M], equal to its momentum for a unit velocity; its energy is negligible next to that of
any motion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive(WithoutPotential):
    """Driving forces on particles i: amplitude cos(frequency t + phase).  amplitude [M L/T2].

    They have no potential energy: they do work on the particles.
    """

    key: ClassVar[str] = "drive"
    formula: ClassVar[str] = "force amplitude cos(frequency t + phase)"
    kind: ClassVar[Origin] = "drive"
    ends: ClassVar[tuple[str, ...]] = ("i",)
    columns: ClassVar[tuple[Column, ...]] = (
        Column("amplitude", "amplitude", single=False),
        Column("frequency", "frequency", single=False),
        Column("phase", "phase", 0.0, single=False),
    )
    scaled = Term.scaled
    i: Integers
    amplitude: Floats
    frequency: Floats
    """Angular frequency [1/T]."""
    phase: Floats
    clock: bool = False
    """Whether the last coordinate of every state is the time; without it the force is that at t = 0."""

    def pull(self, q: Reals) -> Reals:
        time = q[..., -1:] if self.clock else np.zeros((*q.shape[:-1], 1), q.dtype)
        return np.asarray(-self.amplitude * np.cos(self.frequency * time + self.phase))

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        size = q if near is None else near
        time = np.abs(size[..., -1:]) if self.clock else 0
        # of the cosine, and of its argument
        return np.abs(self.amplitude) * (1 + np.abs(self.frequency) * time + np.abs(self.phase))


MOST_SUMMED = 10**7
"""Most steps whose sum is worked out, in 0.1 s."""


def sums(step: float, steps: Integers) -> Floats:
    """The times after so many steps (f,) of a clock that adds up its steps, rounded at each; NaN for too
    many."""
    if steps[-1] > MOST_SUMMED:
        return np.full(len(steps), np.nan)
    return np.append(0.0, np.cumsum(np.full(steps[-1], step)))[steps]


def with_clock(scene: Any) -> Any:
    """A scene with a clock, whose position is the time, as last coordinate: states are (..., n + 1)."""
    q, p, m = (np.append(x, y) for x, y in ((scene.q, 0.0), (scene.p, CLOCK), (scene.m, CLOCK)))
    terms = tuple(replace(term, clock=True) if isinstance(term, Drive) else term for term in scene.terms)
    places = None if scene.places is None else np.append(scene.places, 3 * scene.particles)
    return scene.derived(q=q, p=p, m=m, terms=terms, places=places)
