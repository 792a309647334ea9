"""Runs of one method that several experiments share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.checks.case import Case
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

Run: TypeAlias = Callable[[Scene, str], Trajectory]
"""(scene, label) -> trajectory.  May raise MethodError: the experiment does not apply then."""

LARGEST = 8
"""Particles of which the one-step matrix is recovered: it takes 2n+1 copies of n particles."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """A method and a scene, and the runs that several experiments share, each made once."""

    scene: Scene
    label: str
    run: Run

    kept: dict[int, Trajectory] = field(default_factory=dict)

    def once(self, scene: Scene) -> Trajectory:
        """The run of a scene, made when the first experiment asks for it."""
        if id(scene) not in self.kept:
            self.kept[id(scene)] = self.run(scene, self.label)
        return self.kept[id(scene)]

    @cached_property
    def trajectory(self) -> Trajectory:
        """The scene's own run, of at most 200 steps, every step recorded."""
        return self.run(replace(self.scene, every=1, steps=min(self.scene.steps, 200)), self.label)

    @property
    def scheme(self) -> schemes.Scheme:
        """The scheme that the method claims to run."""
        return schemes.scheme(self.trajectory.scheme)

    @cached_property
    def law(self) -> schemes.Law:
        """The law of the scheme on the scene."""
        return schemes.Law(scheme=self.scheme, scene=self.scene, h=self.scene.step)

    @property
    def stiffness(self) -> Floats:
        """Stiffness that holds each particle (n,) [M/T2]; for one that nothing holds, that of one radian a
        step."""
        k = np.abs(self.scene.system.hessian_diagonal(self.scene.q)).astype(np.float64)
        return np.where(k > 0, k, self.scene.m / self.scene.step**2)

    @cached_property
    def copies(self) -> tuple[Case, Floats]:
        """One step of 2n+1 copies of the scene side by side, and the perturbation of each copy (2n,).

        Copy 0 starts in equilibrium; in copies 1..n one position is perturbed, in the rest one momentum.
        """
        scene, n = self.scene, self.scene.n
        unit = float(scene.system.norm.unit)
        pushes = np.concatenate([np.sqrt(2 / self.stiffness) * unit, np.sqrt(2 * scene.m) * unit])
        state = np.zeros((2 * n + 1, 2 * n))
        state[:, :n] = scene.system.modes.rest.astype(np.float64)
        state[1:] += np.diag(pushes)
        start = scene.system.from_states(state[:, :n], state[:, n:])
        return Case(trajectory=self.run(start, self.label), scene=start), np.diag(state[1:]) - state[0]
