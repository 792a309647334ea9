"""What CVODE does on its way, counted; what a step of each engine takes, by which scripts plan their runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from springcheck.engines import quiet
from springcheck.engines.contract import Label, Method, Stopped
from springcheck.engines.sundials.simulation import KINDS, MOST_STEPS, Solver
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene

STEP_SECONDS = {
    "own": 4e-9, "openmm": 8e-7, "dart": 3e-6, "mujoco": 3e-6, "box2d": 5e-6, "pymunk": 5e-6, "rebound": 8e-6,
    "heyoka": 1e-5, "lammps": 1e-5, "rapier": 2e-5, "function": 2e-5, "drake": 3e-5, "sundials": 6e-5,
    "scipy": 1e-4, "ase": 3e-4, "command": 1e-3,
}  # fmt: skip
"""What a step of one particle takes, about."""


def step_seconds(label: Label) -> float:
    """Seconds per step of a method's engine; a microsecond where nobody has measured it."""
    return STEP_SECONDS.get(label.engine, 1e-6)


@dataclass(frozen=True, slots=True, kw_only=True)
class InternalSteps:
    """What CVODE did on its way to the end of a scene."""

    accepted: int
    attempted: int
    """Different times at which it asked for the force: rejected steps are those it did not accept, the
    trials of its first step among them."""
    force_calls: int
    t: float
    """Where it ended: before the end of the scene only where `most` steps did not suffice."""
    q: Floats
    p: Floats


class Counted(Solver):
    """CVODE, one internal step at a time."""

    def __init__(self, scene: Scene, method: str, step: float) -> None:
        self.asked: set[float] = set()
        super().__init__(scene, method, step)

    def _called(self, t: float) -> None:
        super()._called(t)
        self.asked.add(t)

    def count(self, end: float, most: int) -> InternalSteps:
        """Go to `end` one internal step at a time."""
        accepted, t = 0, 0.0
        y = np.empty(2 * self._n)
        while abs(t) < abs(end) and accepted < most:
            try:
                result = self._solver.step(end, method="onestep", tstop=end)
            except RuntimeError as error:
                raise Stopped(accepted, str(error)) from error
            if not result.success or result.t == t:
                raise Stopped(accepted, str(result.message))
            t, y = float(result.t), result.y
            accepted += 1
        # the start is asked for too, and is no step
        attempted = len(self.asked - {0.0})
        return InternalSteps(
            accepted=accepted,
            attempted=attempted,
            force_calls=self.force_calls,
            t=t,
            q=y[: self._n].copy(),
            p=y[self._n :].copy(),
        )


def internal_steps(scene: Scene, method: Method, *, most: int = MOST_STEPS) -> InternalSteps:
    """Run a scene by at most so many internal steps, and count.

    Stopped: CVODE gave up, and said why.  MethodError for a solver that is not CVODE.
    """
    if method.name not in ("adams", "bdf"):
        raise MethodError(f"{method.name}: its internal steps are not counted")
    # SUNDIALS' logger prints on standard output, where results go
    with quiet.caught(1) as said:
        try:
            solver = Counted(scene, KINDS[method.name], scene.step)
            return solver.count(scene.step * scene.steps, most)
        except (RuntimeError, Stopped) as error:
            stopped = error
    rows = stopped.rows if isinstance(stopped, Stopped) else 0
    raise Stopped(rows, " ".join((said[0] or str(stopped)).split()[:40])) from stopped
