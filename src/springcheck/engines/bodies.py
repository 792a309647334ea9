"""Rigid bodies of game engines, pushed and read one by one between the steps of their world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np

from springcheck.engines.bonds import far
from springcheck.engines.contract import Label, Method
from springcheck.errors import MethodError
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene


def single(label: Label) -> Arithmetic:
    """Single precision; a joint's length, up to 8 times the motion's reach, is rounded at both ends."""
    force = 16 * 2.0**-24 if label.method.endswith("-joint") else 2.0**-24
    return Arithmetic(name="single", state=2.0**-24, force=force, parameters="single")


class Bodies(ABC):
    """A world in motion along x; `bodies` are its particles.

    The method "force" sets our force before each step; of any other the world's own springs pull.
    """

    x: ClassVar[str]
    y: ClassVar[str]
    v: ClassVar[str]
    """The attributes of a body that are its place along x and y, and its velocity along x."""
    numbers: ClassVar[type] = np.float32
    fastest: ClassVar[float] = float(np.finfo(np.float32).max) ** 0.5
    """Speed up to which the world can square it without overflow [L/T]."""
    shortest: ClassVar[float] = 0.0
    """Length up to which a joint of the world has no direction, and no force [L]."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        ours = method.name == "force"
        self.force_calls = 0
        self.off_axis = 0.0
        self.m = scene.m
        self._force = scene.system.force if ours else None
        self._fit(scene, label, ours)
        self.begin(label, step)
        rows = zip(scene.m.tolist(), scene.q.tolist(), scene.p.tolist(), strict=True)
        self.bodies = [self.add(m, q, p / m) for m, q, p in rows]
        if not ours:
            self.tie(scene, label)

    def _fit(self, scene: Scene, label: Label, ours: bool) -> None:
        """MethodError where the world's numbers do not hold the scene, or the square of a joint's length."""
        least, most = (float(x) for x in (np.finfo(self.numbers).smallest_normal, np.finfo(self.numbers).max))
        speeds = np.abs(scene.p / scene.m)
        # components that are small beside the rest of the motion may vanish
        speed, whole = float(np.max(speeds)), float(np.max([speeds, np.abs(scene.q)]))
        sizes = [(least, "mass", x, most) for x in scene.m.tolist()]
        sizes += [(least, "motion", whole or 1.0, most), (0.0, "speed", speed, self.fastest)]
        if not ours:
            length = far(scene)
            sizes += [(max(least**0.5, self.shortest), "joint's length", length, most**0.5)]
        for lowest, what, size, highest in sizes:
            if not lowest <= size <= highest:
                raise MethodError(
                    f"{label}: a {what} of {size:.3g} is outside what it computes with, {lowest:.3g} to "
                    f"{highest:.3g}; the scene in other units, its numbers nearer to 1, is inside"
                )

    @abstractmethod
    def begin(self, label: Label, step: float) -> None:
        """Create the world, without gravity.  MethodError where the engine cannot take steps of this
        length."""

    @abstractmethod
    def add(self, m: float, q: float, v: float) -> Any:
        """Add a body that moves along x and does not turn."""

    @abstractmethod
    def tie(self, scene: Scene, label: Label) -> None:
        """Add the world's own springs.  MethodError where it has none that are the scene's."""

    @abstractmethod
    def push(self, body: Any, force: float) -> None:
        """Set the force of the next step along x."""

    @abstractmethod
    def step(self, row: int) -> None:
        """Advance the world by one step; Stopped(row, ...) where it does not obey."""

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill rows of q and p (f, n), `every` steps each."""
        bodies, force = self.bodies, self._force
        x, y, v = (attrgetter(name) for name in (self.x, self.y, self.v))
        with np.errstate(over="ignore", invalid="ignore"):
            for row in range(len(q)):
                self.force_calls += every
                for _ in range(every):
                    if force is not None:
                        here, there = (np.array([of(body) for body in bodies], np.float64) for of in (x, v))
                        for body, f in zip(bodies, force(here, there * self.m).tolist(), strict=True):
                            self.push(body, f)
                    self.step(row)
                q[row] = [x(body) for body in bodies]
                p[row] = [v(body) for body in bodies] * self.m
            self.off_axis = max(self.off_axis, *(abs(y(body)) for body in bodies))
