"""Metadata of a trajectory: attributes, read back with types and limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from operator import attrgetter
from typing import Annotated, Any, Literal

import msgspec

from springcheck.errors import StoreError
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.fields import Kind, Units
from springcheck.physics.trajectory import Outcome, Timing, Trajectory
from springcheck.store.access import Scalar
from springcheck.store.layout import QUANTITIES

Count = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]
Size = Annotated[int, msgspec.Meta(ge=1, lt=2**48)]
Name = Annotated[str, msgspec.Meta(max_length=200)]
Message = Annotated[str, msgspec.Meta(max_length=1 << 20)]
_DOUBLE = Arithmetic()
KEPT = {
    "scheme": "scheme",
    "step": "step",
    "every": "every",
    "outcome": "outcome.status",
    "outcome_step": "outcome.step",
    "outcome_message": "outcome.message",
    "outcome_fastest": "outcome.fastest",
    "start_seconds": "timing.start",
    "run_seconds": "timing.run",
    "force_calls": "force_calls",
    "tolerance": "tolerance",
    "arithmetic": "arithmetic.name",
    "state_roundoff": "arithmetic.state",
    "force_roundoff": "arithmetic.force",
    "force_quantum": "arithmetic.quantum",
    "force_overflow": "arithmetic.overflow",
    "parameter_precision": "arithmetic.parameters",
    "force_excess": "arithmetic.excess",
    "forces_kept_within": "arithmetic.stale",
    "rod_tolerance": "arithmetic.lengths",
    "bath_cancels": "arithmetic.cancels",
    "keeps_displacement": "arithmetic.keeps_displacement",
    "counts_from_start": "arithmetic.from_start",
    "springs_are_joints": "arithmetic.joints",
    "rebuilds_velocity": "rebuilds_velocity",
    "off_axis": "off_axis",
}
"""Attributes, and the fields of a trajectory that they store."""


class RunRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The attributes of /parameters/<label>, without those that only people read."""

    scene: str
    scene_name: Name = ""
    units: Units
    kind: Kind
    frames: Size
    particles: Size
    """Number of coordinates: of particles, where each moves along one axis."""
    axes: Annotated[str, msgspec.Meta(max_length=1 << 20)] = "x"
    """See `layout.axes_of`."""
    quantities: Name
    sequence: Count = 0
    sha256: Name
    scheme: Name = ""
    step: float = math.nan
    every: Size = 1
    outcome: Literal["complete", "diverged", "stopped"] = "complete"
    outcome_step: Count = 0
    outcome_message: Message = ""
    outcome_fastest: float = math.inf
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
    forces_kept_within: float = _DOUBLE.stale
    rod_tolerance: float = 0.0
    bath_cancels: int = 0
    keeps_displacement: bool = False
    counts_from_start: bool = False
    springs_are_joints: bool = False
    rebuilds_velocity: bool = False
    off_axis: float | None = None

    @property
    def kept(self) -> tuple[str, ...]:
        """The quantities that are recorded."""
        return tuple(name for name in QUANTITIES if name in self.quantities.split())


def record(place: str, known: Mapping[str, Any]) -> RunRecord:
    """Attributes as a typed record; StoreError that names one that is missing or has another type."""
    try:
        found = msgspec.convert(known, RunRecord)
    except msgspec.ValidationError as error:
        raise StoreError(f"{place}: {error}") from error
    if not {"q", "p"} <= set(found.kept):
        raise StoreError(f"{place}: it records {found.quantities or 'nothing'}; q and p are needed")
    return found


def attributes(trajectory: Trajectory) -> dict[str, Scalar | None]:
    """Metadata of a trajectory that `Draft.finish` stores; its numbers are not looked at."""
    kept = {name: attrgetter(field)(trajectory) for name, field in KEPT.items()}
    return {"method": trajectory.label, **kept, **{f"origin.{x}": y for x, y in trajectory.origin.items()}}


def trajectory(
    label: str, x: RunRecord, known: Mapping[str, Any], arrays: Mapping[str, Floats], stride: int = 1
) -> Trajectory:
    """A trajectory, or every stride-th frame of it, from its record and its arrays."""
    parts: dict[str, dict[str, Any]] = {"": {}, "outcome": {}, "timing": {}, "arithmetic": {}}
    for name, field in KEPT.items():
        part, _, own = field.rpartition(".")
        parts[part][own] = getattr(x, name)
    parts[""]["every"] *= stride
    return Trajectory(
        label=label,
        t=arrays["time"],
        q=arrays["q"],
        p=arrays["p"],
        energy=arrays.get("energy"),
        last_step=arrays.get("last_step"),
        outcome=Outcome(**parts["outcome"]),
        timing=Timing(**parts["timing"]),
        arithmetic=Arithmetic(**parts["arithmetic"]),
        origin={key[7:]: str(value) for key, value in known.items() if key.startswith("origin.")},
        **parts[""],
    )
