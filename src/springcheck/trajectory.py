"""What runs yield: trajectories, and what is said of them: comparisons and verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from springcheck.arrays import Floats
from springcheck.engines.contract import Arithmetic


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a run ended.  Nothing that is not `complete` passes for a result."""

    status: Literal["complete", "diverged", "stopped", "continued"]
    """`continued`: a piece of a run that goes on after it."""
    step: int
    """Steps done with finite numbers."""
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Seconds of wall clock: `start` until the engine stands ready, `run` inside `advance` alone."""

    start: float
    run: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Recorded states of one run: row i of q and p belongs to t[i]; row 0 is the start."""

    label: str
    scheme: str
    t: Floats
    q: Floats
    p: Floats
    step: float
    every: int
    outcome: Outcome
    timing: Timing
    force_calls: int
    tolerance: float | None = None
    """Relative tolerance per step; None for a method of fixed step."""
    energy: Floats | None = None
    """Total energy of each frame, (f,) [M L2/T2]; None where the scene asks for none."""
    arithmetic: Arithmetic = field(default_factory=Arithmetic)
    rebuilds_velocity: bool = False
    off_axis: float | None = None
    """Largest |y| or |z| seen, for engines in three dimensions."""
    origin: Mapping[str, str] = field(default_factory=dict)
    """Versions, platform, velocity convention and the like: what a reader needs to repeat the run."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """Largest difference of each pair of trajectories over all frames, (l, l), symmetric.

    In units of the start (`Norm`); NaN where one of the two runs did not complete.
    """

    labels: tuple[str, ...]
    max_difference: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One number against one bound.  `passed` is None where the check does not apply."""

    method: str
    check: str
    value: float
    bound: float
    unit: str
    passed: bool | None
    why: str
    """The bound's reason, or why the check does not apply."""
