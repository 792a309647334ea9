"""One point of a study of precision: one method at one step or tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from springcheck.physics.scene import Scene
from springcheck.studies.precision.accuracy import Accuracy
from springcheck.studies.tables import Rows, column


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One method at one step or tolerance: what it cost and how far it was off, or why there is nothing."""

    method: str
    step: float | None
    """[T]; None for an adaptive solver."""
    tolerance: float | None
    steps: int | None
    outcome: str
    """"complete", or what else happened."""
    message: str = ""
    accuracy: Accuracy | None = None
    run_repeats: tuple[float, ...] = field(metadata=column("run_seconds_repeats"), default=())
    """Seconds inside the engine's stepping, nothing recorded."""
    start_repeats: tuple[float, ...] = field(metadata=column("start_seconds_repeats"), default=())
    """Seconds until the engine stood ready, its library imported and its code compiled before."""
    read_repeats: tuple[float, ...] = field(metadata=column("read_seconds_repeats"), default=())
    """Seconds of the same steps with each of them read."""
    force_calls: int | None = None
    spent: float = field(metadata=column("spent_seconds"), default=0.0)
    """Seconds that all of its runs took, with their starts and comparisons."""

    @property
    def complete(self) -> bool:
        """Whether there are errors to look at."""
        return self.outcome == "complete"

    @property
    def size(self) -> float:
        """Length of the step, 0 for an adaptive solver."""
        return self.step or 0.0

    @property
    def error(self) -> float:
        """The largest error, NaN where there is none."""
        return self.accuracy.largest if self.accuracy else float("nan")

    @property
    def rounding(self) -> float | None:
        """The part of the error that is rounding, where it is known."""
        return self.accuracy.rounding if self.accuracy else None

    @property
    def seconds(self) -> float:
        """The smallest run time, NaN without one."""
        return min(self.run_repeats, default=float("nan"))

    @property
    def quartiles(self) -> tuple[float, float] | None:
        """First and third quartile of the run times."""
        if not self.run_repeats:
            return None
        low, high = np.quantile(self.run_repeats, [0.25, 0.75])
        return float(low), float(high)

    @property
    def said(self) -> str:
        """The outcome, and why."""
        return f"{self.outcome}: {self.message}" if self.message else self.outcome

    def document(self) -> dict[str, Any]:
        """For JSON."""
        found = self.accuracy
        return {
            "method": self.method,
            "step": self.step,
            "tolerance": self.tolerance,
            "steps": self.steps,
            "max_error": found.largest if found else None,
            "end_error": found.end if found else None,
            "phase_error": found.phase if found else None,
            "energy_error": found.energy if found else None,
            "rounding_error": found.rounding if found else None,
            "run_seconds": self.seconds,
            "run_seconds_quartiles": self.quartiles,
            "start_seconds": min(self.start_repeats, default=None),
            "read_seconds": min(self.read_repeats, default=None),
            "force_calls": self.force_calls,
            "outcome": self.said,
        }


def _run_seconds(points: Sequence[Point]) -> dict[str, Any]:
    return {"run_seconds": np.array([point.seconds for point in points])}


POINTS: Rows[Point] = Rows(
    kind=Point,
    beginning="precision/",
    units={
        "phase_error": "rad",
        **dict.fromkeys(
            (
                "run_seconds",
                "run_seconds_repeats",
                "start_seconds_repeats",
                "read_seconds_repeats",
                "spent_seconds",
            ),
            "s",
        ),
    },
    signal="max_error",
    axes=("run_seconds",),
    log=("run_seconds", "max_error"),
    about="error against run time; errors relative to the initial energy norm; -1 and NaN: not known",
    extra=_run_seconds,
)
"""A table for each method, its points from coarse to fine; the attribute `study_seconds`: what the study
had taken by then."""


def points_of(scene: Scene) -> Rows[Point]:
    """The same, with the scene's unit of time."""
    time = {"reduced": "1", "md": "ps", "si": "s"}[scene.units]
    return replace(POINTS, units={**POINTS.units, "step": time})
