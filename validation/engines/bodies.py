"""Rigid bodies of game engines, pushed and read one by one between the steps of their world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np

from springcheck.engines.contract import Label, Method, Stopped
from springcheck.errors import MethodError
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring


def single(label: Label) -> Arithmetic:
    """Single precision, and joints whose lengths are rounded."""
    joints = label.method.endswith("-joint")
    return Arithmetic(name="single", state=2.0**-24, force=2.0**-24, parameters="single", joints=joints)


@np.errstate(over="ignore")
def within(label: Label, sizes: Iterable[tuple[float, str, float, float]]) -> None:
    """MethodError where a number (least, its name, number, most) is none that an engine computes with."""
    for lowest, what, size, highest in sizes:
        if not lowest <= size <= highest:
            raise MethodError(
                f"{label}: a {what} of {size:.3g} is outside what it computes with, {lowest:.3g} to "
                f"{highest:.3g}; the scene in other units, its numbers nearer to 1, is inside"
            )


def walls(scene: Scene, label: Label) -> Iterator[tuple[int, float, float]]:
    """Particle, stiffness [M/T2] and rest position [L] of each wall spring, for joints that have one spring.

    Springs of stiffness 0 are left out: their joints would be rigid.  Raises MethodError where a particle has
    two, or a stiffness is negative.
    """
    taken: set[int] = set()
    for term in scene.terms:
        if isinstance(term, WallSpring):
            for i, k, at in term.rows():
                if i in taken or k < 0:
                    raise MethodError(
                        f"{label}: a joint has one spring, of stiffness 0 or more; particle {i}"
                    )
                taken.add(i)
                if k:
                    yield i, k, at


class Bodies(ABC):
    """A world in motion along x; `bodies` are its particles.

    The method "force" sets our force before each step; of any other the world's own springs pull.
    """

    x: ClassVar[str]
    y: ClassVar[str]
    v: ClassVar[str]
    """The attributes of a body that are its place along x and y, and its velocity along x."""
    numbers: ClassVar[type] = np.float32
    fastest: float = np.inf
    """Largest speed that the world gives a body [L/T]."""
    shortest: ClassVar[float] = 0.0
    """Length up to which a joint of the world has no direction, and no force [L]."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        ours = method.name == "force"
        self.force_calls, self.off_axis = 0, 0.0
        self.m = scene.m
        self._force = scene.system.force if ours else None
        self._step, self._length = step, scene.system.far
        self._ties: list[Any] = [] if ours else [x for x in scene.terms if isinstance(x, WallSpring | Spring)]
        self.begin(label, step)
        self._fit(scene, label, ours)
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
        sizes += [(least, "motion", whole or 1.0, most), (0.0, "speed", speed, most**0.5)]
        sizes += [(least, "step", abs(self._step), most)]
        if not ours:
            sizes += [(max(least**0.5, self.shortest), "joint's length", scene.system.far, most**0.5)]
            sizes += [(0.0, "stiffness", k, most) for _, k, _ in walls(scene, label)]
        within(label, sizes)

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
    def step(self) -> None:
        """Move the world by one step."""

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill rows of q and p (f, n), `every` steps each."""
        bodies, force = self.bodies, self._force
        x, y, v = (attrgetter(name) for name in (self.x, self.y, self.v))
        with np.errstate(over="ignore", invalid="ignore"):
            for row in range(len(q)):
                self.force_calls += every
                for _ in range(every):
                    here, there = (np.array([of(body) for body in bodies], np.float64) for of in (x, v))
                    if force is not None:
                        forces = force(here, there * self.m)
                        if not (largest := float(np.max(np.abs(forces)))) <= np.finfo(self.numbers).max:
                            raise Stopped(row, f"a force of {largest:.3g} is outside what it computes with")
                        for body, f in zip(bodies, forces.tolist(), strict=True):
                            self.push(body, f)
                        there += self._step * forces / self.m
                    self._within(row, there, 1.0)
                    self.step()
                    self._within(row, np.array([v(body) for body in bodies]), 0.999)
                    if self._turned_over():
                        raise Stopped(row, f"a joint of length {self._length:g} turns over", is_limit=True)
                q[row] = [x(body) for body in bodies]
                p[row] = [v(body) for body in bodies] * self.m
            self.off_axis = max(self.off_axis, *(abs(y(body)) for body in bodies))

    def _turned_over(self) -> bool:
        """Whether some joint, whose length has no sign, would have a negative one."""
        q = np.array([attrgetter(self.x)(body) for body in self.bodies]) if self._ties else np.zeros(0)
        return any(np.any(term.elongation(q) <= -self._length) for term in self._ties)

    def _within(self, row: int, speeds: Floats, part: float) -> None:
        """Stopped(row, ...) where the world does not move as it was told, at this part of its limit."""
        if np.any(np.abs(speeds) > part * self.fastest):
            said = f"the engine moves no body faster than {self.fastest:g}"
            raise Stopped(row, said, fastest=float(self.fastest))
