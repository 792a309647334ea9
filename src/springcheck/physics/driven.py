"""Terms whose force depends on the time: a driving force, and a spring of modulated stiffness.

The time is a coordinate (see `System.clocked`): the position of a clock of unit velocity on which no force
acts. On the extended states the motion is autonomous, so that the stages of a scheme decide where within a
step each force is evaluated (Hairer, Lubich & Wanner, Geometric Numerical Integration, VIII.2.1, the extended
phase space).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.term import Column, LinearLaw, Origin, Term, WithoutPotential

CLOCK = 2.0**-500
"""Mass of the clock [M], equal to its momentum for a unit velocity; its energy is negligible beside that of
any motion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Driven(Term):
    """Base of periodically driven terms: frequency and phase, and the clock that gives their time."""

    kind: ClassVar[Origin] = "drive"
    ends: ClassVar[tuple[str, ...]] = ("i",)
    i: Integers
    frequency: Floats
    """Angular frequency [1/T]."""
    phase: Floats
    clock: bool = False
    """Whether the last coordinate of every state is the time; without it the force is that at t = 0."""

    def wave(self, q: Reals) -> Reals:
        """cos(frequency t + phase) of each row at states q (..., n) -> (..., s)."""
        time = q[..., -1:] if self.clock else np.zeros((*q.shape[:-1], 1), q.dtype)
        return np.asarray(np.cos(self.frequency * time + self.phase))

    def turned(self, size: Reals) -> Reals:
        """Roundings of `wave`: its own, and of its argument at times of this size (..., n) -> (..., s)."""
        time = np.abs(size[..., -1:]) if self.clock else 0
        return np.asarray(1 + np.abs(self.frequency) * time + np.abs(self.phase))


_TURNS = (Column("frequency", "frequency", single=False), Column("phase", "phase", 0.0, single=False))


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive(WithoutPotential, _Driven):
    """Driving forces on particles i: amplitude cos(frequency t + phase).  amplitude [M L/T2].

    They have no potential energy: they do work on the particles.
    """

    key: ClassVar[str] = "drive"
    formula: ClassVar[str] = "force amplitude cos(frequency t + phase)"
    columns: ClassVar[tuple[Column, ...]] = (Column("amplitude", "amplitude", single=False), *_TURNS)
    amplitude: Floats
    scaled = Term.scaled

    def pull(self, q: Reals) -> Reals:
        return -self.amplitude * self.wave(q)

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        return np.abs(self.amplitude) * self.turned(q if near is None else near)


@dataclass(frozen=True, kw_only=True, eq=False)
class ModulatedSpring(LinearLaw, _Driven):
    """Springs from particles i to fixed points: V = k/2 (1 + depth cos(frequency t + phase)) (q - at)**2.

    k [M/T2], at [L].  Mathieu's equation; their energy is defined without the modulation, whose work changes
    it.
    """

    key: ClassVar[str] = "modulated-spring"
    formula: ClassVar[str] = "k/2 (1 + depth cos(frequency t + phase)) (q - at)**2"
    origin: ClassVar[str] = "at"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("stiffness", "k"),
        Column("depth", "depth"),
        *_TURNS,
        Column("at", "at", 0.0, single=False),
    )
    k: Floats
    depth: Floats
    at: Floats

    # the largest over all times; `curvature` is that at one time
    second: ClassVar[Any] = staticmethod(lambda u, k, depth, *_: np.abs(k) * (1 + np.abs(depth)))

    def pull(self, q: Reals) -> Reals:
        return np.asarray(self.curvature(q) * self.elongation(q))

    def curvature(self, q: Reals) -> Reals:
        return np.asarray(self.k * (1 + self.depth * self.wave(q)))

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        size = self.most_stretch(np.abs(q)) + np.abs(self.at)
        turned = 1 + np.abs(self.depth) * self.turned(q if near is None else near)
        return np.abs(self.k) * turned * size


def with_clock(scene: Any) -> Any:
    """A scene with a clock, whose position is the time, as last coordinate: states are (..., n + 1)."""
    q, p, m = (np.append(x, y) for x, y in ((scene.q, 0.0), (scene.p, CLOCK), (scene.m, CLOCK)))
    terms = tuple(replace(term, clock=True) if isinstance(term, _Driven) else term for term in scene.terms)
    places = None if scene.places is None else np.append(scene.places, 3 * scene.particles)
    return scene.derived(q=q, p=p, m=m, terms=terms, places=places)


def timed(scene: Any) -> tuple[Callable[[float, Floats, Floats], Floats], ...]:
    """For a solver with its own time, as functions of (t, q, p): the force (n,) [M L/T2], and the derivatives
    (2n, 2n) of (p/m, force) by (q, p)."""
    system, n = scene.system, scene.n
    if not system.is_driven:
        return lambda t, q, p: system.force(q, p), lambda t, q, p: system.jacobian(q, p)
    clocked = system.clocked.system
    kept = np.append(np.arange(n), np.arange(n + 1, 2 * n + 1))

    def force(t: float, q: Floats, p: Floats) -> Floats:
        return np.asarray(clocked.force(np.append(q, t), np.append(p, CLOCK))[:n], np.float64)

    return force, lambda t, q, p: clocked.jacobian(np.append(q, t), np.append(p, CLOCK))[np.ix_(kept, kept)]
