"""Points of a study of precision, each one method at one step or tolerance, and the quantities fitted to a
sweep of them: order, rounding floor, Pareto front, cheapest way to an error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any, Literal, TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.checks.stats import line
from springcheck.engines.contract import Method
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.studies.precision.accuracy import Accuracy
from springcheck.studies.tables import Rows

Place = tuple[str, int | None, float | None]

CANNOT_RUN = "cannot run"
"""Outcome of the only point of a method that cannot run the scene."""


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
    start_seconds_repeats: tuple[float, ...] = ()
    """Seconds of a start, its library already imported and its code compiled."""
    read_seconds_repeats: tuple[float, ...] = ()
    """Seconds of the same steps, each of them read."""
    force_calls: int | None = None
    spent_seconds: float = 0.0
    """Seconds of all its runs, with starts and comparisons."""

    @property
    def place(self) -> Place:
        """Key of the point among all."""
        return self.method, self.steps, self.tolerance

    @property
    def complete(self) -> bool:
        """Whether its errors were measured."""
        return self.outcome == "complete"

    @property
    def error(self) -> float:
        """The largest error, NaN where there is none."""
        return self.accuracy.max_error if self.accuracy else float("nan")

    @property
    def rounding(self) -> float | None:
        """The part of the error that is rounding, or None."""
        return self.accuracy.rounding_error if self.accuracy else None

    @property
    def seconds(self) -> float:
        """The smallest run time, NaN without one."""
        return min(self.run_seconds_repeats, default=float("nan"))

    @property
    def said(self) -> str:
        """The outcome, and why."""
        return f"{self.outcome}: {self.message}" if self.message else self.outcome

    def document(self) -> dict[str, Any]:
        """For JSON."""
        runs = self.run_seconds_repeats
        return {
            "method": self.method,
            "step": self.step,
            "tolerance": self.tolerance,
            "steps": self.steps,
            **{one.name: getattr(self.accuracy, one.name, None) for one in fields(Accuracy)},
            "run_seconds": self.seconds,
            "run_seconds_quartiles": np.quantile(runs, [0.25, 0.75]).tolist() if runs else None,
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
"""A table for each method, its points from coarse to fine; the attribute `study_seconds` is the time that the
study had taken by then."""


def points_of(scene: Scene) -> Rows[Point]:
    """`POINTS` with the scene's unit of time."""
    time = {"reduced": "1", "md": "ps", "si": "s"}[scene.units]
    return replace(POINTS, units={**POINTS.units, "step": time})


ASYMPTOTIC_ERROR = 2e-2
"""Largest error that the leading term of its expansion dominates.  The next term relative to it is about as
large as the error: a fiftieth here, and a quarter or a half of that at each halving of the step."""

ABOVE_FLOOR = 100.0
"""Least ratio of a fitted error to its rounding, which then shifts it by at most 1 %."""

MOST_FITTED = 8
"""Most points in a fit, the finest ones: their steps span a factor of 128."""

FEWEST_FITTED = 4
"""Points below which no order is claimed."""


MOST_CURVATURE = 3.0
"""Standard errors of a curvature from which the coarsest points are not asymptotic."""

MOST_SLOPE_LOST = 2 / 3
"""Slope beyond the usual one that a halving of the step may lose: a term of order n + 2 above one of order n,
x/(1 + x) of their sum, takes 2 x/(1 + x) - 2 x/(4 + x), 2/3 where x = 2.  More is lost to rounding alone."""

MOST_DRIFT = 4 / (ABOVE_FLOOR * np.log(2))
"""Change of the slope from one halving to the next of which rounding is capable: of three errors, each off by
1 / `ABOVE_FLOOR`, one counts twice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """Error = constant * step**order; `order` is a signed slope, with its standard error, at least the range
    of the slopes between neighbours: the next term of the error is systematic, not scatter."""

    order: float
    standard_error: float
    constant: float
    points: int


def turned(errors: Sequence[float], *, by: int = 1) -> int | None:
    """Index of the smallest error of a sweep from coarse to fine; None until `by` finer ones follow."""
    if not errors or np.all(np.isnan(errors)):
        return None
    best = int(np.nanargmin(errors))
    return best if best < len(errors) - by and errors[best] < ASYMPTOTIC_ERROR else None


def order(points: Sequence[Point], how: Condition | None = None) -> Fit | None:
    """Order of a method of fixed step from points of ever finer steps; None with fewer than four usable,
    where the slope changes ever faster, as before a term of the error takes over, and where it does not
    distinguish one order from the next.  Rounding that was not measured is the floor, or typical by `how`.
    """
    best = turned([point.error for point in points])
    floor = points[best].error if best is not None else 0.0
    chosen = [point for point in points[:best] if 0 < point.error <= ASYMPTOTIC_ERROR]
    if best is None and len(chosen) > 2:
        *_, last = slopes = _slopes(*_logarithms(chosen))
        floor = chosen[-1].error if last < np.median(slopes) - MOST_SLOPE_LOST else 0.0

    def rounding(point: Point) -> float:
        if point.rounding is not None:
            return point.rounding
        grown = TYPICAL_ROUNDING * how.eps * how.value(point.steps) if how and point.steps else 0.0
        return max(floor, grown)

    chosen = [point for point in chosen if point.error >= ABOVE_FLOOR * rounding(point)][-MOST_FITTED:]
    if len(chosen) < FEWEST_FITTED:
        return None
    x, y = _logarithms(chosen)
    while len(x) > FEWEST_FITTED and (_curvature(x, y) > MOST_CURVATURE or np.ptp(_slopes(x, y)) > 0.5):
        x, y = x[1:], y[1:]
    found, slopes = line(x, y), _slopes(x, y)
    *_, before, last = np.diff(slopes)
    error = max(found.standard_error, float(np.ptp(slopes)))
    slower = abs(last) < abs(before)
    if not slower and abs(last) > MOST_DRIFT:
        return None
    # where a term vanishes the slopes end beyond the last by the sum of a geometric series (Aitken)
    beyond = last * last / (before - last) if slower else np.copysign(np.inf, last)
    if abs(last) <= MOST_DRIFT:
        # no end is in sight where rounding, too, may change the slope: they may drift as far again
        beyond = np.clip(beyond, *(np.array([-1, 1]) * len(slopes) * abs(last)))
    error = max(error, abs(float(slopes[-1] + beyond - found.slope)))
    if error > 0.5:
        return None
    return Fit(
        order=found.slope,
        standard_error=error,
        constant=float(np.exp(found.intercept)),
        points=len(x),
    )


def _logarithms(points: Sequence[Point]) -> tuple[Floats, Floats]:
    """Of the steps and of the errors (j,)."""
    return np.log([abs(x.step or 0.0) for x in points]), np.log([x.error for x in points])


def _slopes(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.diff(y) / np.diff(x))


def _curvature(x: Floats, y: Floats) -> float:
    """Curvature of y(x) in standard errors of a fitted parabola; large for a few points without scatter."""
    away = x - np.mean(x)
    found = line(away**2, y, away)
    return abs(found.slope) / found.standard_error if found.standard_error else np.inf


Growth: TypeAlias = Literal["sqrt(N)", "N", "N**1.5/(w T)", "w T"]

POWERS: Mapping[Growth, tuple[float, float]] = {
    "sqrt(N)": (0.5, 0), "N": (1, 0), "N**1.5/(w T)": (1.5, -1), "w T": (0, 1),
}  # fmt: skip
"""Exponents of the number of steps and of w T."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """Growth of one rounding per step into the final error: eps times `value(steps)`, and the reason."""

    name: Growth
    why: str
    eps: float
    """Relative spacing of the rounded numbers."""
    angle: float
    """w T, the largest phase that the motion accumulates."""

    def value(self, steps: float) -> float:
        """Amplification of rounding over a run of so many steps."""
        of_steps, of_angle = POWERS[self.name]
        return float(steps**of_steps * self.angle**of_angle)


def condition(method: Method, arithmetic: Arithmetic, angle: float) -> Condition | None:
    """Growth of rounding over a run whose phase advances by `angle`; None for an adaptive solver.

    Each step rounds the state once, in either direction, and the motion propagates that: a random walk, eps
    sqrt(N).  Two cases are worse.  A velocity rebuilt as (x' - x)/h acquires eps x / h in each step, a walk
    of eps sqrt(N) / (h w).  A divisor 1 + (h w)**2 that is rounded once and used in every step shifts the
    phase the same way each time, eps N.  Parameters in single precision detune the motion by their own eps,
    whatever the step.
    """
    scheme = schemes.scheme(method.scheme)
    if not scheme.has("one-step") or angle <= 0:
        return None
    name: Growth = "sqrt(N)"
    eps = 2 * max(arithmetic.state, 2.0**-53)
    why = "each step rounds the state once, up or down: a random walk"
    if arithmetic.parameters == "single" and arithmetic.force < 2.0**-24:
        eps, name, why = 2.0**-23, "w T", "parameters kept in single precision detune it"
    elif method.rebuilds_velocity:
        name = "N**1.5/(w T)"
        why = "each step rounds the position, and the velocity is rebuilt from it over h"
    elif scheme.has("implicit"):
        name, why = "N", "one rounded divisor is used in every step"
    return Condition(name=name, why=why, eps=eps, angle=angle)


TYPICAL_ROUNDING = 0.25
"""Rounding over eps times its condition, where it cannot be measured: about the standard deviation of a
rounding, eps/sqrt(12), in a sum that changes sign."""


def expected_floor(points: Sequence[Point], fit: Fit, how: Condition, duration: float) -> tuple[float, float]:
    """Intersection of the fitted error with the rounding -> (steps, error there)."""
    seen = [
        point.rounding / (how.eps * how.value(point.steps))
        for point in points[-4:]
        if point.rounding and point.steps
    ]
    per = how.eps * (float(np.median(seen)) if seen else TYPICAL_ROUNDING)
    # both are powers of the number of steps
    of_steps, _ = POWERS[how.name]
    ratio, power = fit.constant * abs(duration) ** fit.order / (per * how.value(1)), fit.order + of_steps
    with np.errstate(over="ignore", divide="ignore"):
        steps = float(np.clip(ratio ** (np.float64(1) / power), 1, 1e18))
    return steps, 2 * per * how.value(steps)


def front(points: Sequence[Point]) -> list[Point]:
    """The Pareto front of error and time, from the fastest point to the most accurate."""
    best: list[Point] = []
    known = [point for point in points if not np.isnan(point.error) and not np.isnan(point.seconds)]
    for point in sorted(known, key=lambda point: (point.seconds, point.error)):
        if not best or point.error < best[-1].error:
            best.append(point)
    return best


def cheapest(points: Sequence[Point], target: float) -> Point | None:
    """The point of the least time with an error within the target, or None.

    Where a sweep crosses the target between two numbers of steps, that is the least number in between, by a
    power law through both points (see `_between`); elsewhere it is a point as measured.
    """
    timed = [point for point in points if not np.isnan(point.seconds)]
    reaching = [point for point in timed if point.error <= target]
    for before, after in pairwise(timed):
        if before.method == after.method and before.error > target >= after.error:
            reaching.append(_between(before, after, target))
    return min(reaching, key=lambda point: point.seconds) if reaching else None


def _between(before: Point, after: Point, target: float) -> Point:
    """The point at the least number of steps whose error is within the target, by log error over log steps.

    Quantities that grow with the steps are interpolated likewise; `after` itself for adaptive solvers.
    """
    if not (before.steps and after.steps and before.force_calls and after.force_calls and after.accuracy):
        return after
    if not (before.steps < after.steps and before.seconds <= after.seconds and after.error > 0):
        return after
    share = np.log(before.error / target) / np.log(before.error / after.error)
    steps = int(np.ceil(before.steps * (after.steps / before.steps) ** share))
    # calls and seconds follow from the rounded number of steps
    share = np.log(steps / before.steps) / np.log(after.steps / before.steps)
    calls = before.force_calls * (after.force_calls / before.force_calls) ** share
    return replace(
        after,
        steps=steps,
        step=None if after.step is None else after.step * after.steps / steps,
        force_calls=round(calls),
        run_seconds_repeats=(before.seconds * (after.seconds / before.seconds) ** share,),
        accuracy=Accuracy(max_error=target),
        message=f"between {before.steps} and {after.steps} steps",
    )
