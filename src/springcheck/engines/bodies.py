"""Rigid bodies of engines for games, pushed and read one by one between the steps of their world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from springcheck.engines.contract import Label
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene


def single(label: Label) -> Arithmetic:
    """Single precision; a joint's length, up to 8 times the motion's reach, is rounded at both ends."""
    force = 16 * 2.0**-24 if label.method.endswith("-joint") else 2.0**-24
    return Arithmetic(name="single", state=2.0**-24, force=force, parameters="single")


class Bodies(ABC):
    """A world in motion along x; `bodies` are its particles.

    Where the force is ours it is set before each step; else the world's own springs pull.
    """

    bodies: list[Any]

    def __init__(self, scene: Scene, *, springs: bool) -> None:
        self.force_calls = 0
        self.off_axis = 0.0
        self.bodies = []
        self.m = scene.m
        self._force = None if springs else scene.system.force

    @abstractmethod
    def position(self, body: Any) -> Any:
        """Where a body is, with x and y."""

    @abstractmethod
    def velocity(self, body: Any) -> Any:
        """How fast it moves, with x."""

    @abstractmethod
    def push(self, body: Any, force: float) -> None:
        """Set the force of the next step along x."""

    @abstractmethod
    def step(self, row: int) -> None:
        """Move the world by one step; Stopped(row, ...) where it does not move as it was told."""

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill rows of q and p (f, n), `every` steps each."""
        bodies, force, position, velocity = self.bodies, self._force, self.position, self.velocity
        here, there = np.empty(len(bodies)), np.empty(len(bodies))
        with np.errstate(over="ignore", invalid="ignore"):
            for row in range(len(q)):
                for _ in range(every):
                    if force is not None:
                        for i, body in enumerate(bodies):
                            here[i], there[i] = position(body).x, velocity(body).x
                        for body, f in zip(bodies, force(here, there * self.m).tolist(), strict=True):
                            self.push(body, f)
                    self.step(row)
                for i, body in enumerate(bodies):
                    q[row, i], p[row, i] = position(body).x, velocity(body).x * self.m[i]
            self.off_axis = max(self.off_axis, *(abs(position(body).y) for body in bodies))
        self.force_calls += every * len(q)
