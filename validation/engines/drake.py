"""Drake: bodies on prismatic joints along x in a plant that moves by discrete steps.

Drake evaluates springs at the beginning of a step and takes the damping of joints implicitly.
"""

from __future__ import annotations

import numpy as np

from springcheck.engines.contract import Engine, Label, Method, Need, by_name, installed_version, named
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, WallSpring


class _Plant:
    """A discrete `MultibodyPlant` in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        from pydrake.multibody import plant as plants
        from pydrake.multibody import tree
        from pydrake.systems import analysis

        if step < 0:
            raise MethodError(f"{label}: Drake takes no negative step")
        self.force_calls = 0
        self._h, self._m, self._done = step, scene.m, 0
        damping = np.zeros(scene.n)
        for term in scene.terms:
            if isinstance(term, Damping):
                np.add.at(damping, term.i, term.c)
        self._plant = plant = plants.MultibodyPlant(time_step=step)
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
        joints = []
        for i, (m, c) in enumerate(zip(scene.m.tolist(), damping.tolist(), strict=True)):
            inertia = tree.SpatialInertia(m, [0.0, 0.0, 0.0], tree.UnitInertia(1.0, 1.0, 1.0))
            body = plant.AddRigidBody(f"body{i}", inertia)
            axis = [1.0, 0.0, 0.0]
            joint = tree.PrismaticJoint(f"joint{i}", plant.world_frame(), body.body_frame(), axis, damping=c)
            joints.append(plant.AddJoint(joint))
        for term in scene.terms:
            if isinstance(term, WallSpring):
                if np.any(term.k < 0):
                    raise MethodError(f"{label}: a spring of Drake has a stiffness of 0 or more")
                for i, k, at in term.rows():
                    plant.AddForceElement(tree.PrismaticSpring(joints[i], at, k))
        plant.Finalize()
        self._simulator = analysis.Simulator(plant)
        self._context = self._simulator.get_mutable_context()
        plant.SetPositions(self._context, scene.q)
        plant.SetVelocities(self._context, scene.p / scene.m)
        self._simulator.Initialize()

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        plant, context = self._plant, self._context
        for row in range(len(q)):
            self._done += every
            # the update of time t, which gives the state of t + h, is made on the way from t
            self._simulator.AdvanceTo(self._done * self._h)
            q[row] = plant.GetPositions(context)
            p[row] = plant.GetVelocities(context)
        p *= self._m
        self.force_calls += every * len(q)


ENGINE = Engine(
    name="drake",
    title="Drake",
    distribution="drake",
    module="pydrake",
    methods=named(
        by_name(
            "prismatic-spring", "semi-implicit-euler", "PrismaticSpring in a discrete plant",
            frozenset({"wall-spring"}),
        ),
        by_name(
            "joint-damping", "semi-implicit-euler-implicit-friction",
            "PrismaticSpring and damping of the joint in a discrete plant",
            frozenset({"wall-spring", "damping"}), Need.DAMPING,
        ),
    ),
    start=_Plant,
    version=installed_version("drake"),
)  # fmt: skip
