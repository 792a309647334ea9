"""OpenMM's `VariableVerletIntegrator`, read at the frames of a scene."""

from __future__ import annotations

import numpy as np
import openmm as mm

from springcheck.engines import bonds
from springcheck.engines.contract import Label, Method
from springcheck.engines.openmm.rounding import arithmetic
from springcheck.engines.openmm.simulation import _Context
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.schemes.variable import allowed

MOST_STEPS = 1e8
"""A minute of one particle."""


class Variable(_Context):
    """`VariableVerletIntegrator`, which chooses its steps and shortens the last one before each frame.

    The velocity that it stores belongs half of its own last step back.
    """

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        if arithmetic(label).state > 2.0**-53 or arithmetic(label).quantum:
            raise MethodError(f"{label}: its steps are chosen in single precision there")
        w = float(np.sqrt(np.max(scene.system.gershgorin(scene.q) / scene.m)))
        if (steps := w * abs(step) * scene.steps / np.sqrt(scene.tolerance)) > MOST_STEPS:
            raise MethodError(
                f"{label}: a tolerance of {scene.tolerance:g} takes some {steps:.0e} steps, and at most "
                f"{MOST_STEPS:.0e} are taken; --set time.tolerance=1e-6 asks for fewer"
            )
        super().__init__(scene, method, label, step)
        # the mean is over all particles, anchors among them
        count = self._context.getSystem().getNumParticles()
        self._integrator.setErrorTolerance(allowed(scene) * np.sqrt(scene.particles / count))

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        halves = np.zeros((len(q), 1))
        for row in range(len(q)):
            self._done += every
            self._integrator.stepTo(self._done * abs(self._step))
            halves[row] = self._integrator.getStepSize()._value / 2
            state = self._context.getState(positions=True, velocities=True)
            state._getVectorAsNumpy(mm.State.Positions, self._x)
            state._getVectorAsNumpy(mm.State.Velocities, self._v)
            q[row], p[row] = (x.reshape(-1)[self._where] for x in (self._x, self._v))
            self.off_axis = max(self.off_axis, bonds.off_axis(self._x, self._elsewhere))
        self._synchronise(every, q, p)
        p += np.copysign(halves, self._step) * self._force(0.0, q, p)
        self.force_calls = self._context.getStepCount()
