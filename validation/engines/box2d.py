"""Box2D (pybox2d): bodies that do not turn, pulled along x by a force or by a soft distance joint.

Box2D computes in single precision.  A soft joint is a constraint that Box2D solves implicitly in position and
velocity, whatever its damping; one joint on a body is solved exactly, joints that meet are not.
"""

from __future__ import annotations

import math
from typing import Any

from bodies import Bodies, single, walls

from springcheck.engines.contract import EVERY_FORCE, Engine, Label, by_name, installed_version, named
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene

FURTHEST = 2.0
"""Longest way of a body in a step (`b2_maxTranslation`): Box2D shortens every longer one [L]."""


class _World(Bodies):
    """Box2D's world in motion."""

    x, y, v = "position.x", "position.y", "linearVelocity.x"
    shortest = 0.005

    def begin(self, label: Label, step: float) -> None:
        import Box2D

        if step < 0:
            raise MethodError(f"{label}: Box2D takes no negative step")
        self._library, self._h, self.fastest = Box2D, step, FURTHEST / step
        self._world = Box2D.b2World(gravity=(0, 0), doSleep=False)

    def add(self, m: float, q: float, v: float) -> Any:
        body = self._world.CreateDynamicBody(position=(q, 0), linearVelocity=(v, 0), fixedRotation=True)
        body.massData = self._library.b2MassData(mass=m, center=(0, 0), I=1.0)
        return body

    def tie(self, scene: Scene, label: Label) -> None:
        length, ground = scene.system.far, self._world.CreateStaticBody(position=(0, 0))
        for i, k, at in walls(scene, label):
            joint = self._library.b2DistanceJointDef(
                bodyA=ground,
                bodyB=self.bodies[i],
                localAnchorA=(at - length, 0),
                localAnchorB=(0, 0),
                length=length,
                frequencyHz=math.sqrt(k / self.m[i]) / (2 * math.pi),
                dampingRatio=0.0,
            )
            self._world.CreateJoint(joint)

    def push(self, body: Any, force: float) -> None:
        body.ApplyForceToCenter((force, 0), True)

    def step(self) -> None:
        self._world.Step(self._h, 1, 0)
        self._world.ClearForces()


ENGINE = Engine(
    name="box2d",
    title="Box2D (pybox2d)",
    distribution="box2d",
    module="Box2D",
    methods=named(
        by_name("force", "semi-implicit-euler", "ApplyForceToCenter before each step", EVERY_FORCE,
            note="the wheel is Box2D of 2013"),
        by_name(
            "distance-joint", "implicit-euler",
            "b2DistanceJoint with a frequency and no damping, its length far from 0",
            frozenset({"wall-spring"}),
            note="the wheel is Box2D of 2013; its soft joints are implicit, as documented",
        ),
    ),
    start=_World,
    version=installed_version("box2d"),
    arithmetic=single,
)  # fmt: skip
