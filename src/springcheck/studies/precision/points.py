"""One point of a study of precision: one method at one step or tolerance."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from springcheck.physics.scene import Scene
from springcheck.studies.precision.accuracy import Accuracy
from springcheck.studies.tables import Rows

Place = tuple[str, int | None, float | None]


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
    run_seconds_repeats: tuple[float, ...] = ()
    """Seconds inside the engine's stepping, nothing recorded."""
    start_seconds_repeats: tuple[float, ...] = ()
    """Seconds until the engine stood ready, its library imported and its code compiled before."""
    read_seconds_repeats: tuple[float, ...] = ()
    """Seconds of the same steps with each of them read."""
    force_calls: int | None = None
    spent_seconds: float = 0.0
    """Seconds that all of its runs took, with their starts and comparisons."""

    @property
    def place(self) -> Place:
        """Which point of all it is."""
        return self.method, self.steps, self.tolerance

    @property
    def complete(self) -> bool:
        """Whether there are errors to look at."""
        return self.outcome == "complete"

    @property
    def error(self) -> float:
        """The largest error, NaN where there is none."""
        return self.accuracy.max_error if self.accuracy else float("nan")

    @property
    def rounding(self) -> float | None:
        """The part of the error that is rounding, where it is known."""
        return self.accuracy.rounding_error if self.accuracy else None

    @property
    def seconds(self) -> float:
        """The smallest run time, NaN without one."""
        return min(self.run_seconds_repeats, default=float("nan"))

    @property
    def quartiles(self) -> tuple[float, float] | None:
        """First and third quartile of the run times."""
        if not self.run_seconds_repeats:
            return None
        low, high = np.quantile(self.run_seconds_repeats, [0.25, 0.75])
        return float(low), float(high)

    @property
    def said(self) -> str:
        """The outcome, and why."""
        return f"{self.outcome}: {self.message}" if self.message else self.outcome

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "method": self.method,
            "step": self.step,
            "tolerance": self.tolerance,
            "steps": self.steps,
            **{one.name: getattr(self.accuracy, one.name, None) for one in fields(Accuracy)},
            "run_seconds": self.seconds,
            "run_seconds_quartiles": self.quartiles,
            "start_seconds": min(self.start_seconds_repeats, default=None),
            "read_seconds": min(self.read_seconds_repeats, default=None),
            "force_calls": self.force_calls,
            "outcome": self.said,
        }


POINTS: Rows[Point] = Rows(
    kind=Point,
    beginning="precision/",
    units={
        "phase_error": "rad",
        "run_seconds": "s",
        **{one.name: "s" for one in fields(Point) if "seconds" in one.name},
    },
    signal="max_error",
    axes=("run_seconds",),
    log=("run_seconds", "max_error"),
    about="error against run time; errors relative to the initial energy norm; -1 and NaN: not known",
    extra=lambda points: {"run_seconds": np.array([point.seconds for point in points])},
)
"""A table for each method, its points from coarse to fine; the attribute `study_seconds`: what the study
had taken by then."""


def points_of(scene: Scene) -> Rows[Point]:
    """The same, with the scene's unit of time."""
    time = {"reduced": "1", "md": "ps", "si": "s"}[scene.units]
    return replace(POINTS, units={**POINTS.units, "step": time})
