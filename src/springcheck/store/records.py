"""What is kept of a trajectory besides its numbers: attributes, read back with types and limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Kind, Units
from springcheck.physics.trajectory import Outcome, Timing, Trajectory
from springcheck.store.access import Scalar

Count = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]
Size = Annotated[int, msgspec.Meta(ge=1, lt=2**48)]
Name = Annotated[str, msgspec.Meta(max_length=200)]
Message = Annotated[str, msgspec.Meta(max_length=1 << 20)]
_DOUBLE = Arithmetic()
_ARITHMETIC = {
    "arithmetic": "name",
    "state_roundoff": "state",
    "force_roundoff": "force",
    "force_quantum": "quantum",
    "force_overflow": "overflow",
    "parameter_precision": "parameters",
    "force_excess": "excess",
    "keeps_displacement": "keeps_displacement",
}
"""Attributes, and the fields of `Arithmetic` that they keep."""


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """The attributes of /parameters/<label>, but for those that only people read."""

    scene: str
    scene_name: Name = ""
    units: Units
    kind: Kind
    frames: Size
    particles: Size
    quantities: Name
    sequence: Count = 0
    sha256: Name
    scheme: Name = ""
    step: float = math.nan
    every: Size = 1
    outcome: Literal["complete", "diverged", "stopped"] = "complete"
    outcome_step: Count = 0
    outcome_message: Message = ""
    start_seconds: float = math.nan
    run_seconds: float = math.nan
    force_calls: Count = 0
    tolerance: float | None = None
    arithmetic: Name = _DOUBLE.name
    state_roundoff: float = _DOUBLE.state
    force_roundoff: float = _DOUBLE.force
    force_quantum: float = _DOUBLE.quantum
    force_overflow: float = _DOUBLE.overflow
    parameter_precision: Literal["double", "single"] = _DOUBLE.parameters
    force_excess: float = _DOUBLE.excess
    keeps_displacement: bool = False
    rebuilds_velocity: bool = False
    off_axis: float | None = None

    @property
    def kept(self) -> tuple[str, ...]:
        """The quantities that are recorded."""
        return tuple(name for name in ("q", "p", "energy") if name in self.quantities.split())


def record(place: str, known: Mapping[str, Any]) -> Record:
    """Attributes with their types; StoreError that names the one that has another, or is missing."""
    try:
        found = msgspec.convert(known, Record)
    except msgspec.ValidationError as error:
        raise StoreError(f"{place}: {error}") from error
    if not found.kept:
        raise StoreError(f"{place}: records no quantity")
    return found


def attributes(trajectory: Trajectory) -> dict[str, Scalar | None]:
    """What `Draft.finish` stores of a trajectory besides its numbers, which are not looked at."""
    origin = {f"origin.{key}": value for key, value in trajectory.origin.items()}
    return {
        "method": trajectory.label,
        "scheme": trajectory.scheme,
        "step": trajectory.step,
        "every": trajectory.every,
        "outcome": trajectory.outcome.status,
        "outcome_step": trajectory.outcome.step,
        "outcome_message": trajectory.outcome.message,
        "start_seconds": trajectory.timing.start,
        "run_seconds": trajectory.timing.run,
        "force_calls": trajectory.force_calls,
        "tolerance": trajectory.tolerance,
        **{name: getattr(trajectory.arithmetic, field) for name, field in _ARITHMETIC.items()},
        "rebuilds_velocity": trajectory.rebuilds_velocity,
        "off_axis": trajectory.off_axis,
        **origin,
    }


def trajectory(
    label: str, x: Record, known: Mapping[str, Any], arrays: Mapping[str, Floats], stride: int = 1
) -> Trajectory:
    """A trajectory, or every stride-th frame of it, from its record and its arrays."""
    empty = np.empty((0, x.particles))
    return Trajectory(
        label=label,
        scheme=x.scheme,
        t=arrays["time"],
        q=arrays.get("q", empty),
        p=arrays.get("p", empty),
        energy=arrays.get("energy"),
        step=x.step,
        every=x.every * stride,
        outcome=Outcome(status=x.outcome, step=x.outcome_step, message=x.outcome_message),
        timing=Timing(start=x.start_seconds, run=x.run_seconds),
        force_calls=x.force_calls,
        tolerance=x.tolerance,
        arithmetic=Arithmetic(**{field: getattr(x, name) for name, field in _ARITHMETIC.items()}),
        rebuilds_velocity=x.rebuilds_velocity,
        off_axis=x.off_axis,
        origin={key[7:]: str(value) for key, value in known.items() if key.startswith("origin.")},
    )
