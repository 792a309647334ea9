"""Metadata of a trajectory: attributes, read back with types and limits, and of the machine."""

from __future__ import annotations

import contextlib
import math
import os
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from operator import attrgetter
from typing import Annotated, Any, Literal, get_type_hints

import h5py
import msgspec
import numpy as np

import springcheck
from springcheck.errors import StoreError
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.fields import Units
from springcheck.physics.trajectory import Outcome, Timing, Trajectory
from springcheck.store.access import Scalar
from springcheck.store.layout import QUANTITIES

Count = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]
Size = Annotated[int, msgspec.Meta(ge=1, lt=2**48)]
Name = Annotated[str, msgspec.Meta(max_length=200)]
Message = Annotated[str, msgspec.Meta(max_length=1 << 20)]
_DOUBLE = Arithmetic()


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A trajectory without its numbers: the attributes of /parameters/<label>.

    A text next to a type is the field of a `Trajectory` that the attribute stores.
    """

    label: str
    parameters: Mapping[str, Any]
    """All attributes as stored."""
    scene: str
    scene_name: Name = ""
    units: Units
    kind: Name
    frames: Size
    particles: Size
    """Number of coordinates: of particles, where each moves along one axis."""
    axes: Annotated[str, msgspec.Meta(max_length=1 << 20)] = "x"
    """See `layout.axes_of`."""
    quantities: Name
    sequence: Count = 0
    sha256: Name
    scheme: Annotated[Name, "scheme"] = ""
    step: Annotated[float, "step"] = math.nan
    every: Annotated[Size, "every"] = 1
    outcome: Annotated[Literal["complete", "diverged", "stopped"], "outcome.status"] = "complete"
    outcome_step: Annotated[Count, "outcome.step"] = 0
    outcome_message: Annotated[Message, "outcome.message"] = ""
    outcome_fastest: Annotated[float, "outcome.fastest"] = math.inf
    start_seconds: Annotated[float, "timing.start"] = math.nan
    run_seconds: Annotated[float, "timing.run"] = math.nan
    force_calls: Annotated[Count, "force_calls"] = 0
    tolerance: Annotated[float | None, "tolerance"] = None
    arithmetic: Annotated[Name, "arithmetic.name"] = _DOUBLE.name
    state_roundoff: Annotated[float, "arithmetic.state"] = _DOUBLE.state
    force_roundoff: Annotated[float, "arithmetic.force"] = _DOUBLE.force
    force_quantum: Annotated[float, "arithmetic.quantum"] = _DOUBLE.quantum
    force_overflow: Annotated[float, "arithmetic.overflow"] = _DOUBLE.overflow
    parameter_precision: Annotated[Literal["double", "single"], "arithmetic.parameters"] = _DOUBLE.parameters
    force_excess: Annotated[float, "arithmetic.excess"] = _DOUBLE.excess
    forces_kept_within: Annotated[float, "arithmetic.stale"] = _DOUBLE.stale
    bath_cancels: Annotated[int, "arithmetic.cancels"] = 0
    keeps_displacement: Annotated[bool, "arithmetic.keeps_displacement"] = False
    counts_from_start: Annotated[bool, "arithmetic.from_start"] = False
    springs_are_joints: Annotated[bool, "arithmetic.joints"] = False
    rebuilds_velocity: Annotated[bool, "rebuilds_velocity"] = False
    off_axis: Annotated[float | None, "off_axis"] = None

    @property
    def kept(self) -> tuple[str, ...]:
        """The quantities that are recorded."""
        return tuple(name for name in QUANTITIES if name in self.quantities.split())


KEPT: dict[str, str] = {
    name: text
    for name, hint in get_type_hints(Run, include_extras=True).items()
    for text in getattr(hint, "__metadata__", ())
    if isinstance(text, str)
}
"""Attributes, and the fields of a trajectory that they store."""


def record(place: str, label: str, known: Mapping[str, Any]) -> Run:
    """Attributes as a typed record; StoreError that names one that is missing or has another type."""
    try:
        found = msgspec.convert({**known, "label": label, "parameters": known}, Run)
    except msgspec.ValidationError as error:
        raise StoreError(f"{place}: {error}") from error
    if not {"q", "p"} <= set(found.kept):
        raise StoreError(f"{place}: it records {found.quantities or 'nothing'}; q and p are needed")
    return found


def attributes(trajectory: Trajectory) -> dict[str, Scalar | None]:
    """Metadata of a trajectory that `Draft.finish` stores; its numbers are not looked at."""
    kept = {name: attrgetter(field)(trajectory) for name, field in KEPT.items()}
    return {"method": trajectory.label, **kept, **{f"origin.{x}": y for x, y in trajectory.origin.items()}}


def trajectory(run: Run, arrays: Mapping[str, Floats], stride: int = 1) -> Trajectory:
    """A trajectory, or every stride-th frame of it, from its record and its arrays."""
    parts: dict[str, dict[str, Any]] = {"": {}, "outcome": {}, "timing": {}, "arithmetic": {}}
    for name, field in KEPT.items():
        part, _, own = field.rpartition(".")
        parts[part][own] = getattr(run, name)
    parts[""]["every"] *= stride
    return Trajectory(
        label=run.label,
        t=arrays["time"],
        q=arrays["q"],
        p=arrays["p"],
        energy=arrays.get("energy"),
        outcome=Outcome(**parts["outcome"]),
        timing=Timing(**parts["timing"]),
        arithmetic=Arithmetic(**parts["arithmetic"]),
        origin={key[7:]: str(value) for key, value in run.parameters.items() if key.startswith("origin.")},
        **parts[""],
    )


def now() -> str:
    """The time in UTC, in seconds since 1970 where the clock shows a year that dates do not have."""
    try:
        return datetime.now(UTC).isoformat(timespec="seconds")
    except (ValueError, OverflowError, OSError):
        return f"{time.time():.0f} s after 1970"


@cache
def machine() -> dict[str, Scalar]:
    """Provenance: software, versions and machine."""
    return {
        "springcheck": springcheck.__version__,
        "machine": platform.machine(),
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "system": f"{platform.system()} {platform.release()}",
        "host": platform.node(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "h5py": h5py.__version__,
        "hdf5": h5py.version.hdf5_version,
    }


def _processor() -> str:
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
        for line in lines:
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown"
