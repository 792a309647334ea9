"""DART through dartpy: bodies on prismatic joints along x, pulled by a force or by the spring of the joint.

DART takes joint springs and joint damping implicitly, whatever is asked of them.
"""

from __future__ import annotations

import numpy as np
from bodies import walls

from springcheck.engines.contract import EVERY_FORCE, Engine, Label, Method, by_name, named, version_of
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping


class _World:
    """DART's world in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        import dartpy

        if step < 0:
            # DART would warn, and continue with a step of its own
            raise MethodError(f"{label}: DART takes no negative step")
        springs = method.name == "joint-spring"
        self.force_calls = 0
        self._m = scene.m
        self._world = dartpy.simulation.World()
        self._world.setGravity([0.0, 0.0, 0.0])
        self._world.setTimeStep(step)
        self._skeleton = skeleton = dartpy.dynamics.Skeleton("springs")
        joints = []
        for m in scene.m.tolist():
            joint, body = skeleton.createPrismaticJointAndBodyNodePair(None)
            joint.setAxis([1.0, 0.0, 0.0])
            body.setInertia(dartpy.dynamics.Inertia(m, [0.0, 0.0, 0.0], np.eye(3)))
            joints.append(joint)
        self._world.addSkeleton(skeleton)
        skeleton.setPositions(scene.q)
        skeleton.setVelocities(scene.p / scene.m)
        self._force = None if springs else scene.system.force
        if not springs:
            return
        for i, k, at in walls(scene, label):
            joints[i].setSpringStiffness(0, k)
            joints[i].setRestPosition(0, at)
        for term in scene.terms:
            if isinstance(term, Damping):
                for i, c in term.rows():
                    joints[i].setDampingCoefficient(0, joints[i].getDampingCoefficient(0) + c)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        world, skeleton, force = self._world, self._skeleton, self._force
        self.force_calls += every * len(q)
        with np.errstate(over="ignore", invalid="ignore"):
            for row in range(len(q)):
                for _ in range(every):
                    if force is not None:
                        pull = force(skeleton.getPositions(), skeleton.getVelocities() * self._m)
                        if not np.all(np.isfinite(pull / self._m)):
                            # DART leaves such an acceleration out, and goes on
                            p[:row] *= self._m
                            q[row:] = p[row:] = np.nan
                            return
                        skeleton.setForces(pull)
                    world.step()
                q[row] = skeleton.getPositions()
                p[row] = skeleton.getVelocities()
            p *= self._m


ENGINE = Engine(
    name="dart",
    title="DART (dartpy)",
    distribution="dartpy",
    methods=named(
        by_name("force", "semi-implicit-euler", "Skeleton.setForces before each step", EVERY_FORCE),
        by_name(
            "joint-spring", "implicit-euler", "spring and damping of the joint",
            frozenset({"wall-spring", "damping"}),
            note="as documented for stiff joints; dartsim/dart#846 asks where the energy goes",
        ),
    ),
    start=_World,
    version=version_of("dartpy", "dart"),
)  # fmt: skip
