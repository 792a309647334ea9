"""The heat bath of a scene: its temperature, and the friction by which it acts."""

from __future__ import annotations

import math
from dataclasses import dataclass

from springcheck.errors import SceneError
from springcheck.physics.arguments import of_kind

KELVIN = {"md": 0.00831446261815324, "si": 1.380649e-23, "reduced": 1.0}
"""kT of one unit of temperature by the units of a scene: kJ/mol and J a kelvin, exact in the SI of 2019; in
reduced units the temperature is kT itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bath:
    """A heat bath: friction rate [1/T] and temperature.  Raises SceneError for invalid numbers."""

    temperature: float
    """[K], or kT where units are reduced; > 0."""
    friction: float
    """Friction rate gamma of every particle [1/T]; > 0."""

    def __post_init__(self) -> None:
        for name, remedy in (
            ("temperature", "at 0 it is friction without noise: [[damping]], c = friction * mass"),
            ("friction", "without friction there is no bath: leave [bath] out"),
        ):
            value = float(of_kind(f"bath.{name}", getattr(self, name), "float"))
            if not (0 < value < math.inf):
                raise SceneError(f"bath.{name} = {value!r}: a number > 0 is needed; {remedy}")
            object.__setattr__(self, name, value)

    def thermal(self, units: str) -> float:
        """The thermal energy kT [M L2/T2] in these units of a scene."""
        return self.temperature * KELVIN[units]
