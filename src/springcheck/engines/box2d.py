"""Box2D (pybox2d): bodies that do not turn, pulled along x by a force or by a soft distance joint.

Box2D computes in single precision.  A soft joint is a constraint that Box2D solves implicitly in position and
velocity, whatever its damping; one joint on a body is solved exactly, joints that meet are not.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from springcheck.engines.bonds import far, walls
from springcheck.engines.contract import (
    EVERY_FORCE,
    Engine,
    Label,
    Method,
    Simulation,
    Stopped,
    by_name,
    named,
)
from springcheck.errors import MethodError
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene

FURTHEST = 2.0
"""Longest way of a body in a step (`b2_maxTranslation`): Box2D shortens every longer one [L]."""


def version() -> dict[str, str]:
    """Version of pybox2d."""
    from importlib.metadata import version

    return {"box2d": version("box2d")}


def start(scene: Scene, method: Method, label: Label, step: float) -> Simulation:
    """A world with the scene's bodies at its start.  MethodError for a negative step."""
    if step < 0:
        raise MethodError(f"{label}: Box2D takes no negative step")
    return _World(scene, step, joints=method.name == "distance-joint")


def arithmetic(label: Label) -> Arithmetic:
    """Single precision; a joint's length, up to 8 times the motion's reach, is rounded at both ends."""
    force = 16 * 2.0**-24 if label.method == "distance-joint" else 2.0**-24
    return Arithmetic(name="single", state=2.0**-24, force=force, parameters="single")


class _World:
    """Box2D's world in motion."""

    def __init__(self, scene: Scene, step: float, *, joints: bool) -> None:
        import Box2D

        self.force_calls = 0
        self.off_axis = 0.0
        self._h, self._m = step, scene.m
        self._world = world = Box2D.b2World(gravity=(0, 0), doSleep=False)
        self._bodies = []
        for m, q, p in zip(scene.m.tolist(), scene.q.tolist(), scene.p.tolist(), strict=True):
            body = world.CreateDynamicBody(position=(q, 0), linearVelocity=(p / m, 0), fixedRotation=True)
            body.massData = Box2D.b2MassData(mass=m, center=(0, 0), I=1.0)
            self._bodies.append(body)
        self._force = None if joints else scene.system.force
        if joints:
            self._add_joints(Box2D, scene)

    def _add_joints(self, library: Any, scene: Scene) -> None:
        length, ground = far(scene), self._world.CreateStaticBody(position=(0, 0))
        for i, k, at in walls(scene, "box2d:distance-joint"):
            frequency = math.sqrt(k / self._m[i]) / (2 * math.pi)
            self._world.CreateJoint(
                library.b2DistanceJointDef(
                    bodyA=ground,
                    bodyB=self._bodies[i],
                    localAnchorA=(at - length, 0),
                    localAnchorB=(0, 0),
                    length=length,
                    frequencyHz=frequency,
                    dampingRatio=0.0,
                )
            )

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        world, bodies, force = self._world, self._bodies, self._force
        here, there = np.empty(len(bodies)), np.empty(len(bodies))
        with np.errstate(over="ignore", invalid="ignore"):
            for row in range(len(q)):
                for _ in range(every):
                    if force is not None:
                        for i, body in enumerate(bodies):
                            here[i], there[i] = body.position.x, body.linearVelocity.x
                        for body, f in zip(bodies, force(here, there * self._m).tolist(), strict=True):
                            body.ApplyForceToCenter((f, 0), True)
                    world.Step(self._h, 1, 0)
                    world.ClearForces()
                    if any(abs(body.linearVelocity.x * self._h) > 0.999 * FURTHEST for body in bodies):
                        raise Stopped(row, f"Box2D moves no body by more than {FURTHEST:g} in a step")
                for i, body in enumerate(bodies):
                    q[row, i], p[row, i] = body.position.x, body.linearVelocity.x * self._m[i]
            self.off_axis = max(self.off_axis, *(abs(body.position.y) for body in bodies))
        self.force_calls += every * len(q)


ENGINE = Engine(
    name="box2d",
    title="Box2D (pybox2d)",
    distribution="box2d",
    module="Box2D",
    extra="box2d",
    methods=named(
        by_name("force", "semi-implicit-euler", "ApplyForceToCenter before each step", EVERY_FORCE),
        by_name(
            "distance-joint",
            "implicit-euler",
            "b2DistanceJoint with a frequency and no damping, its length far from 0",
            frozenset({"wall-spring"}),
        ),
    ),
    start=start,
    version=version,
    arithmetic=arithmetic,
    step_seconds=5e-6,
)
