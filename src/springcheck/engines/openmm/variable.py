"""OpenMM's `VariableVerletIntegrator`, read at the frames of a scene."""

from __future__ import annotations

import numpy as np
import openmm as mm

from springcheck.engines import bonds
from springcheck.engines.contract import Label, Method, Stopped
from springcheck.engines.openmm.rounding import arithmetic
from springcheck.engines.openmm.simulation import _Context
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, Spring, WallSpring
from springcheck.schemes import SCHEMES
from springcheck.schemes.variable import allowed, taken

MOST_STEPS = 1e8
"""Most steps of a run: a minute for one particle."""

MOST_TRIED, ESCAPED = 10_000, 30
"""Most steps of the trial of a motion that may escape, two seconds; and the distance in amplitudes from which
on it has escaped: in a well within a negative quartic potential it reaches sqrt(2) at most."""


REACHED = 0.9
"""Part of the energy of a barrier at which a run ends: a period adds 2 % at a tolerance of `COARSEST`."""

COARSEST = 1e-2


def _barrier(scene: Scene) -> float:
    """The energy of the barrier around a well within a negative quartic potential, all other potentials being
    springs; 0 where none is known."""
    if any(term.key not in ("wall-spring", "spring", "quartic") for term in scene.terms):
        return 0.0
    if any(np.any(term.k < 0) for term in scene.terms if isinstance(term, Spring | WallSpring)):
        return 0.0
    least, met = np.inf, set()
    for term in scene.terms:
        for i, b, at in term.rows() if isinstance(term, Quartic) else ():
            if b >= 0:
                continue
            walls = (x for x in scene.terms if isinstance(x, WallSpring))
            k = sum(float(np.sum(x.k[(x.i == i) & (x.at == at)])) for x in walls)
            if i in met or not (scene.q[i] - at) ** 2 < k / -b:
                return 0.0
            met.add(i)
            least = min(least, k * k / (4 * -b))
    return least


def _stays(scene: Scene, label: Label, step: float, w: float) -> float:
    """The energy at which the run is to end, infinite where no motion escapes.

    MethodError where one reaches infinity within the run, or may: OpenMM's steps grow shorter there without
    end.  No other potential falls faster than a parabola.
    """
    if not any(isinstance(term, Quartic) and np.any(term.b < 0) for term in scene.terms):
        return np.inf
    barrier, low = _barrier(scene), 2 * float(scene.system.energy(scene.q, scene.p))
    # looked at in each frame, which is at most a period
    if low <= barrier and scene.tolerance <= COARSEST and scene.every * abs(step) * w <= 2 * np.pi:
        return REACHED * barrier
    farthest, start = ESCAPED * float(np.max(scene.system.amplitudes[0])), (scene.q, scene.p)
    tried = taken(
        SCHEMES["variable-verlet"], scene, start, before=0.0, times=(0.0, step * scene.steps),
        tolerance=allowed(scene),
    )  # fmt: skip
    with np.errstate(all="ignore"):
        for number, one in enumerate(tried):
            if not np.all(np.abs(one.end[0] - scene.q) <= farthest) or number >= MOST_TRIED:
                raise MethodError(
                    f"{label}: its steps have no end where a motion escapes to infinity, as it does here or "
                    f"may after step {number}; --set time.steps asks for a shorter run"
                )
    return np.inf


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
        if not scene.system.norm.of or not allowed(scene) > 0:
            raise MethodError(
                f"{label}: its tolerance is a part of the amplitude, and the energy of the start is 0; "
                "start it away from rest"
            )
        self._most = _stays(scene, label, step, w)
        super().__init__(scene, method, label, step)
        self.last_steps = np.zeros(0)
        # the mean is over all particles, anchors included
        count = self._context.getSystem().getNumParticles()
        self._integrator.setErrorTolerance(allowed(scene) * np.sqrt(scene.particles / count))

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        lasts, row = np.zeros(len(q)), 0
        try:
            while row < len(q):
                self._integrator.stepTo((self._done + every) * abs(self._step))
                lasts[row] = self._integrator.getStepSize()._value
                self._read(q[row], p[row])
                self.off_axis = max(self.off_axis, bonds.off_axis(self._x, self._elsewhere))
                self._done += every
                row += 1
                if self._most < np.inf:
                    now = self._context.getState(energy=True)
                    if now.getKineticEnergy()._value + now.getPotentialEnergy()._value > self._most:
                        raise Stopped(
                            row, "its energy nears that of a barrier, beyond which steps have no end"
                        )
        except mm.OpenMMException as error:
            raise Stopped(row, str(error)) from error
        finally:
            q, p, self.last_steps = q[:row], p[:row], lasts[:row]
            self._synchronise(every, q, p)
            with np.errstate(over="ignore", invalid="ignore"):
                p += np.copysign(lasts[:row, None] / 2, self._step) * self._force(0.0, q, p)
            self.force_calls = self._context.getStepCount()
