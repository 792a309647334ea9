"""pymunk (Chipmunk): bodies that do not turn, pulled along x by a force or by its `DampedSpring`.

Chipmunk moves positions first and velocities after, so that a force that is set before the step is that of
the old positions, and a spring that it evaluates itself is that of the new ones.
"""

from __future__ import annotations

from typing import Any

from bodies import Bodies

from springcheck.engines.contract import EVERY_FORCE, SPRINGS, Engine, Label, by_name, named
from springcheck.errors import MethodError
from springcheck.physics.arrays import Arithmetic
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring


def version() -> dict[str, str]:
    """Versions of pymunk and of Chipmunk beneath it."""
    import pymunk

    return {"pymunk": pymunk.version, "chipmunk": pymunk.chipmunk_version}


def arithmetic(label: Label) -> Arithmetic:
    """Double precision, and springs whose lengths are rounded."""
    return Arithmetic(joints=label.method == "damped-spring")


class _Space(Bodies):
    """Chipmunk's space in motion."""

    x, y, v = "position.x", "position.y", "velocity.x"
    numbers = float

    def begin(self, label: Label, step: float) -> None:
        import pymunk

        if step < 0 and label.method == "damped-spring":
            # the motion would end in NaN
            raise MethodError(f"{label}: Chipmunk's DampedSpring takes no negative step")
        self._library, self._h, self._space = pymunk, step, pymunk.Space()

    def add(self, m: float, q: float, v: float) -> Any:
        # without a moment of inertia that is finite nothing turns
        body = self._library.Body(m, float("inf"))
        body.position, body.velocity = (q, 0.0), (v, 0.0)
        self._space.add(body)
        return body

    def tie(self, scene: Scene, label: Label) -> None:
        length, bodies, wall = scene.system.far, self.bodies, self._space.static_body
        spring = self._library.DampedSpring
        for term in scene.terms:
            if isinstance(term, WallSpring):
                for i, k, at in term.rows():
                    self._space.add(spring(wall, bodies[i], (at - length, 0), (0, 0), length, k, 0.0))
            elif isinstance(term, Spring):
                for a, b, k, rest in term.rows():
                    # from a, moved back by the length, to b
                    self._space.add(spring(bodies[a], bodies[b], (rest - length, 0), (0, 0), length, k, 0.0))

    def push(self, body: Any, force: float) -> None:
        body.force = (force, 0.0)

    def step(self) -> None:
        self._space.step(self._h)


ENGINE = Engine(
    name="pymunk",
    title="pymunk",
    distribution="pymunk",
    methods=named(
        by_name("force", "explicit-euler", "Body.force, set before each step", EVERY_FORCE,
            note="a force set before a step acts after the positions have moved"),
        by_name(
            "damped-spring", "semi-implicit-euler-drift-kick",
            "DampedSpring without damping, its rest length far from 0", SPRINGS,
        ),
    ),
    start=_Space,
    version=version,
    arithmetic=arithmetic,
)  # fmt: skip
