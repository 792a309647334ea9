"""Points of a study of precision: one method at one step or tolerance, its cost and its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from springcheck.studies.precision import fits
from springcheck.studies.precision.accuracy import Accuracy
from springcheck.studies.tables import Rows

CANNOT_RUN, CUT_OFF = "cannot run", "cut off"
"""Outcome of the only point of a method that cannot run the scene, and of one beyond the budget."""

COSTS = {"time": "run time [s]", "calls": "force calls"}
"""Costs of a point, and their names on an axis."""

TARGETS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Errors to which costs are reported."""

METRICS = {
    "largest": "largest error, relative to the initial energy norm",
    "end": "error at the end, relative to the initial energy norm",
    "energy": "largest energy error, relative to the initial kinetic and potential energy",
    "phase": "largest phase error, in radians",
}
"""Errors of a point, in words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One method at one step or tolerance: its cost and its errors, or why there are none."""

    method: str
    step: float | None
    """[T]; None for an adaptive solver."""
    tolerance: float | None
    steps: int | None
    outcome: str
    """"complete", or another status."""
    message: str = ""
    accuracy: Accuracy | None = None
    run_seconds_repeats: tuple[float, ...] = ()
    """Seconds of the engine's stepping alone, nothing recorded."""
    start_seconds: float | None = None
    """Seconds of a start, its library already imported and its code compiled."""
    force_calls: int | None = None
    spent_seconds: float = 0.0
    """Seconds of all its runs, with starts and comparisons."""

    @property
    def complete(self) -> bool:
        """Whether its errors were measured."""
        return self.outcome == "complete"

    def error(self, metric: str) -> float:
        """The error of this name, without its sign; NaN where there is none."""
        return self.accuracy.error(metric) if self.accuracy else float("nan")

    @property
    def seconds(self) -> float:
        """The smallest run time, NaN without one."""
        return min(self.run_seconds_repeats, default=float("nan"))

    def document(self) -> dict[str, Any]:
        """For JSON."""
        runs = self.run_seconds_repeats
        return {
            **{name: getattr(self, name) for name in ("method", "step", "tolerance", "steps")},
            **{one.name: getattr(self.accuracy, one.name, None) for one in fields(Accuracy)},
            "run_seconds": self.seconds,
            "run_seconds_quartiles": np.quantile(runs, [0.25, 0.75]).tolist() if runs else None,
            "start_seconds": self.start_seconds,
            "force_calls": self.force_calls,
            "outcome": f"{self.outcome}: {self.message}" if self.message else self.outcome,
        }


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Points of one method, coarse to fine, and what follows from them by one metric; None: unknown."""

    method: str
    points: tuple[Point, ...]
    metric: str

    @cached_property
    def complete(self) -> list[Point]:
        """Points with errors."""
        return [point for point in self.points if point.complete]

    @property
    def adaptive(self) -> bool:
        """Whether the method follows a tolerance, so that there is no step to fit an order to."""
        return any(point.tolerance is not None for point in self.points)

    @cached_property
    def errors(self) -> list[float]:
        """Errors of the complete points."""
        return [point.error(self.metric) for point in self.complete]

    @cached_property
    def fit(self) -> fits.Fit | None:
        """The order; None also with too few points."""
        if self.adaptive:
            return None
        # the rounding is known of the distance from the scheme's own motion
        known = self.metric in ("largest", "end")
        roundings = [x.accuracy.rounding_error if known and x.accuracy else None for x in self.complete]
        return fits.order([x.step or 0.0 for x in self.complete], self.errors, roundings)

    @cached_property
    def floor(self) -> float | None:
        """The smallest error, where finer steps have larger ones."""
        # an adaptive solver's error falls irregularly: its floor is one that a decade has not improved
        best = fits.turned(self.errors, by=2 if self.adaptive else 1)
        return None if best is None else self.errors[best]

    def values(self, name: str) -> list[float]:
        """Costs or errors of the complete points, by name."""
        return self.costs(name) if name in COSTS else [point.error(name) for point in self.complete]

    def costs(self, kind: str) -> list[float]:
        """Costs of the complete points.  Of run times the monotone envelope: a coarser run takes no longer
        than a finer one, unless the machine was busy."""
        if kind == "calls":
            return [float("nan") if x.force_calls is None else float(x.force_calls) for x in self.complete]
        times = np.array([x.seconds for x in self.complete])
        return [float(x) for x in np.fmin.accumulate(times[::-1])[::-1]]

    def cost(self, kind: str, target: float) -> float:
        """The least cost of an error within the target; infinite where none is known."""
        rows = zip(self.complete, self.errors, self.costs(kind), strict=True)
        return fits.cost([(x.steps, error, c) for x, error, c in rows if error > 0 and c > 0], target)

    @property
    def seconds_per_call(self) -> float:
        """The least run time of a force call with its share of the step; NaN where nothing was timed."""
        each = [x.seconds / x.force_calls for x in self.complete if x.force_calls]
        return float(np.nanmin(each)) if np.any(np.isfinite(each)) else float("nan")

    def document(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "method": self.method,
            "order": self.fit and self.fit.order,
            "order_standard_error": self.fit and self.fit.standard_error,
            "floor": self.floor,
            "seconds_per_force_call": self.seconds_per_call,
        }


POINTS: Rows[Point] = Rows(
    kind=Point, beginning="precision/", signal="max_error", axes=("run_seconds",),
    log=("run_seconds", "max_error"),
    units={"phase_error": "rad", "run_seconds": "s",
           **{one.name: "s" for one in fields(Point) if "seconds" in one.name}},
    about="error against run time; errors relative to the initial energy norm; -1 and NaN: not known; steps "
          "in the scene's unit of time",
    extra=lambda points: {"run_seconds": np.array([point.seconds for point in points])},
)  # fmt: skip
"""A table for each method, its points from coarse to fine."""


def of_methods(points: Sequence[Point], metric: str) -> tuple[Sweep, ...]:
    """The points of each method, coarse to fine."""
    found: dict[str, list[Point]] = {}
    for point in points:
        found.setdefault(point.method, []).append(point)
    return tuple(Sweep(method=x, points=tuple(mine), metric=metric) for x, mine in found.items())
