"""Rapier (rapier3d): bodies that do not turn, pulled along x by a force or by a spring joint.

Rapier computes in single precision.  It divides a step into as many substeps as its solver has iterations, 4
unless it is told otherwise: a force that is set before the step is held over them, and a spring joint is
solved for implicitly in each of them, whatever its damping.
"""

from __future__ import annotations

from typing import Any

from bodies import Bodies, single, walls

from springcheck.engines.contract import EVERY_FORCE, Engine, Label, by_name, named, version_of
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene

SUBSTEPS = 4

SMALLEST_DIVISOR = 1e-20
"""Rapier takes 1/x for 0 where x is no larger (`utils::inv`): a soft spring is then a rigid joint."""


class _World(Bodies):
    """Rapier's world in motion."""

    x, y, v = "translation.x", "translation.y", "linvel.x"

    def begin(self, label: Label, step: float) -> None:
        import rapier3d

        if step < 0:
            raise MethodError(f"{label}: Rapier takes no negative step")
        self._library = rapier3d
        self._handles: list[Any] = []
        self._world = rapier3d.PhysicsWorld(gravity=(0, 0, 0))
        self._world.integration_parameters.dt = step
        self.fastest = self._world.integration_parameters.normalized_max_linear_velocity

    def add(self, m: float, q: float, v: float) -> Any:
        body = self._library.RigidBody.dynamic(
            translation=(q, 0, 0), linvel=(v, 0, 0), additional_mass=m, can_sleep=False
        )
        self._handles.append(self._world.add_body(body))
        return self._world.rigid_bodies[self._handles[-1]]

    def tie(self, scene: Scene, label: Label) -> None:
        length, ground = scene.system.far, self._world.add_body(self._library.RigidBody.fixed())
        for i, k, at in walls(scene, label):
            kick = k * (self._step / SUBSTEPS) ** 2
            if min(kick, 1 / self.m[i] + 1 / max(kick, SMALLEST_DIVISOR)) <= SMALLEST_DIVISOR:
                raise MethodError(
                    f"{label}: Rapier takes 1/x for 0 where x is below {SMALLEST_DIVISOR:g}, as k (h/4)**2 = "
                    f"{kick:.3g} or its inverse and 1/m together are; the scene in other units is inside"
                )
            spring = self._library.SpringJointBuilder(length, k, 0.0)
            joint = spring.local_anchor1((at - length, 0, 0)).build()
            self._world.impulse_joints.insert(ground, self._handles[i], joint, True)

    def push(self, body: Any, force: float) -> None:
        body.reset_forces(True)
        body.add_force((force, 0, 0), True)

    def step(self) -> None:
        self._world.step()


ENGINE = Engine(
    name="rapier",
    title="Rapier",
    distribution="rapier3d",
    methods=named(
        by_name("force", "force-held-4", "RigidBody.add_force before each step of 4 substeps", EVERY_FORCE,
            note="documented: one force for all substeps"),
        by_name(
            "spring-joint", "implicit-euler-4",
            "SpringJoint without damping, its length far from 0, in 4 substeps", frozenset({"wall-spring"}),
        ),
    ),
    start=_World,
    version=version_of("rapier3d"),
    arithmetic=single,
)  # fmt: skip
