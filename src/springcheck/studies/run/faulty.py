"""An engine broken on purpose among the others: --fault."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from springcheck import schemes
from springcheck.errors import MethodError, nearest
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.faults.seeded import Fault
from springcheck.studies.faults.table import FAULTS
from springcheck.studies.keeper import Draft, attributes
from springcheck.studies.run.result import FAULT

MOST_NUMBERS = 10**7
"""Most steps times particles of a run with a fault: Python loops record it in memory."""


@dataclass(frozen=True, slots=True)
class Broken:
    """A fault, with its size in the table or another."""

    fault: Fault
    size: float | None

    @property
    def label(self) -> str:
        """Label of its trajectory."""
        return f"{FAULT}:{self.fault.name}"

    @property
    def about(self) -> str:
        """The fault and its size."""
        size = self.fault.size if self.size is None else self.size
        return self.fault.about + ("" if size is None else f" ({size:.0e})")

    def play(self, scene: Scene, draft: Draft, seed: int | None = None) -> None:
        """Record it, with the `seed` of a run in a bath.  MethodError where it does not apply to the
        scene."""
        option = f"--fault {self.fault.name}"
        if self.fault.random != (scene.bath is not None):
            needed = "a bath: --temperature or [bath] gives one" if self.fault.random else "no bath"
            raise MethodError(f"{option}: it needs a scene with {needed}")
        if scene.steps * scene.n > MOST_NUMBERS:
            raise MethodError(f"{option}: {scene.steps} steps are too many for it")
        try:
            made = self.fault.run(scene, self.label, size=self.size, seed=seed)
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            only = f"only on a {self.fault.scene} such as that of `springcheck faults` ({error})"
            raise MethodError(f"{option}: it cannot be had on scene {scene.name}, {only}") from error
        if self._is_right(scene, made):
            where = f"`springcheck faults` judges it on a scene of its own ({self.fault.scene})"
            raise MethodError(f"{option}: nothing on scene {scene.name} shows it; {where}")
        energy = made.energy if "energy" in scene.quantities else None
        draft.append(made.t, made.q, made.p, energy)
        origin = {"engine": "broken on purpose", "method": self.about, "velocity": "as it says"}
        draft.finish(attributes(replace(made, origin=origin)))

    def _is_right(self, scene: Scene, made: Trajectory) -> bool:
        """Whether the fault has no effect on this scene, so that its run equals the correct engine's."""
        if self.fault.random or schemes.scheme(self.fault.scheme).has("adaptive"):
            return False
        right = Fault("", "", scheme=self.fault.scheme).run(scene)
        alike = ("arithmetic", "rebuilds_velocity", "off_axis", "t", "q", "p", "energy")
        return all(np.array_equal(getattr(made, x), getattr(right, x)) for x in alike)


def broken(text: str) -> Broken:
    """The fault of NAME or NAME=SIZE.  MethodError where there is none."""
    name, equals, size = text.partition("=")
    found = {fault.name: fault for fault in FAULTS}.get(name)
    if found is None:
        names = [fault.name for fault in FAULTS]
        raise MethodError(
            f"--fault {name}: no such fault{nearest(name, names)}; `springcheck faults` tells them all"
        )
    if not equals:
        return Broken(found, None)
    try:
        value = float(size)
    except ValueError:
        value = math.nan
    if found.size is None or not (math.isfinite(value) and value > 0):
        needed = "it has no size" if found.size is None else "a size above 0 is needed"
        raise MethodError(f"--fault {text}: {needed}")
    return Broken(found, value)
