"""A claim: a trajectory, the scene and the scheme that it is said to come from, and the law that follows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from springcheck import schemes
from springcheck.physics.arrays import Extended, Floats
from springcheck.physics.exact.solution import SolvedSystem
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.schemes import Law


@dataclass(frozen=True, kw_only=True, eq=False)
class Claim:
    """A trajectory, or a piece of it, and the scene that it is stated to be of."""

    trajectory: Trajectory
    scene: Scene

    @property
    def label(self) -> str:
        """The label of the method."""
        return self.trajectory.label

    @property
    def scheme(self) -> schemes.Scheme:
        """The scheme that the method claims to run."""
        return schemes.scheme(self.trajectory.scheme)

    @cached_property
    def judged(self) -> Scene:
        """The scene with its parameters as the engine's arithmetic keeps them."""
        arithmetic = self.trajectory.arithmetic
        scene = self.scene.system.in_single if arithmetic.parameters == "single" else self.scene
        return scene.system.scaled(1 + arithmetic.excess) if arithmetic.excess else scene

    @property
    def system(self) -> SolvedSystem[Scene]:
        """Quantities derived from that scene."""
        return self.judged.system

    @cached_property
    def law(self) -> Law:
        """The law of the scheme on that scene."""
        return Law(scheme=self.scheme, scene=self.judged, h=self.trajectory.step)

    def step(self, q: Extended, p: Extended, **how: Any) -> tuple[Extended, Extended]:
        """One step of the scheme from states (..., n), in extended precision: see `Law.step`.  `near` is the
        engine's own result: of several solutions of an implicit step, the one there is taken."""
        with np.errstate(all="ignore"):
            a, b = self.law.step(q, p, **how)
        return np.asarray(a, np.longdouble), np.asarray(b, np.longdouble)

    @property
    def placed(self) -> bool:
        """Whether rounding depends on the positions at which a step evaluates the force."""
        return not self.law.has("linear") or self.law.has("implicit")

    @cached_property
    def origins(self) -> Floats:
        """Largest distance from 0 of a point from which an engine may count positions (n,) [L]: where springs
        between particles have their rest lengths, the nearest place to which a term ties a particle, and the
        start where the engine says so."""
        rest = self.system.rest_positions
        zero, sites = np.zeros(self.scene.n), np.full(self.scene.n, np.inf)
        for term in self.judged.terms:
            if term.bodies == 1 and term.origin:
                np.minimum.at(sites, term.particles[0], np.abs(term.elongation(zero)))
        tied = np.maximum(0.0 if rest is None else np.abs(rest), np.where(np.isinf(sites), 0.0, sites))
        start = np.abs(self.scene.q) if self.trajectory.arithmetic.from_start else 0.0
        return np.asarray(np.maximum(tied, start))

    @property
    def roundings(self) -> int:
        """Roundings along one step."""
        return self.law.roundings
