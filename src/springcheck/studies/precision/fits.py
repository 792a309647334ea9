"""Orders and floors from a sweep of errors, coarse to fine, and the cost of an error between two points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from springcheck.checks.stats import line
from springcheck.physics.arrays import Floats

ASYMPTOTIC_ERROR = 2e-2
"""Largest error that the leading term of its expansion dominates.  The next term relative to it is about as
large as the error: a fiftieth here, and a quarter or a half of that at each halving of the step."""

ABOVE_FLOOR = 100.0
"""Least ratio of a fitted error to its rounding, which then shifts it by at most 1 %."""

MOST_FITTED, FEWEST_FITTED = 8, 4
"""Most points in a fit, the finest ones, and those below which no order is claimed."""

MOST_CURVATURE = 3.0
"""Standard errors of a curvature from which the coarsest points are not asymptotic."""

MOST_SLOPE_LOST = 2 / 3
"""Slope beyond the usual one that a halving of the step may lose: a term of order n + 2 above one of order n,
x/(1 + x) of their sum, takes 2 x/(1 + x) - 2 x/(4 + x), 2/3 where x = 2.  More is lost to rounding alone."""

MOST_DRIFT = 4 / (ABOVE_FLOOR * np.log(2))
"""Change of the slope from one halving to the next of which rounding is capable: of three errors, each wrong
by 1 / `ABOVE_FLOOR`, one counts twice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """`order` is a signed slope, with its standard error, at least the range of the slopes between
    neighbours: the next term of the error is systematic, not scatter."""

    order: float
    standard_error: float
    points: int


def turned(errors: Sequence[float], *, by: int = 1) -> int | None:
    """Index of the smallest error of a sweep from coarse to fine; None until `by` finer ones follow."""
    if not errors or np.all(np.isnan(errors)):
        return None
    best = int(np.nanargmin(errors))
    return best if best < len(errors) - by and errors[best] < ASYMPTOTIC_ERROR else None


def order(steps: Sequence[float], errors: Sequence[float], roundings: Sequence[float | None]) -> Fit | None:
    """Order of a method of fixed step from errors at ever finer steps, with the part of each that is
    rounding, where that is known; else the floor stands for it.

    None with fewer than four usable errors, where the slope changes ever faster, as before a term of the
    error takes over, and where it does not distinguish one order from the next.
    """
    best = turned(errors)
    floor = errors[best] if best is not None else 0.0
    rows = list(zip(steps, errors, roundings, strict=True))[:best]
    rows = [row for row in rows if 0 < row[1] <= ASYMPTOTIC_ERROR]
    if best is None and len(rows) > 2:
        *_, last = slopes = _slopes(*_logarithms(rows))
        floor = rows[-1][1] if last < np.median(slopes) - MOST_SLOPE_LOST else 0.0
    rows = [row for row in rows if row[1] >= ABOVE_FLOOR * (floor if row[2] is None else row[2])]
    if len(rows) < FEWEST_FITTED:
        return None
    x, y = _logarithms(rows[-MOST_FITTED:])
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
    return None if error > 0.5 else Fit(order=found.slope, standard_error=error, points=len(x))


def _logarithms(rows: Sequence[tuple[float, float, float | None]]) -> tuple[Floats, Floats]:
    return np.log([abs(x) for x, *_ in rows]), np.log([y for _, y, _ in rows])


def _slopes(x: Floats, y: Floats) -> Floats:
    return np.asarray(np.diff(y) / np.diff(x))


def _curvature(x: Floats, y: Floats) -> float:
    """Curvature of y(x) in standard errors of a fitted parabola; large for a few points without scatter."""
    away = x - np.mean(x)
    found = line(away**2, y, away)
    return abs(found.slope) / found.standard_error if found.standard_error else np.inf


Row = tuple[float | None, float, float]
"""Number of steps (None: adaptive), error and cost of a point."""


def cost(rows: Sequence[Row], target: float) -> float:
    """The least cost of an error within the target, infinite where none is.

    Where a sweep of fixed steps crosses the target, that of the least number of steps in between, by a power
    law of the error and a straight line of the cost; elsewhere that of a measured point.
    """
    return min((*(x[2] for x in rows if x[1] <= target), *_between(rows, target)), default=np.inf)


def _between(rows: Sequence[Row], target: float) -> Iterator[float]:
    for (n, error, spent), (more, smaller, most) in pairwise(rows):
        if error > target >= smaller > 0 and n is not None and more is not None and n < more:
            steps = np.ceil(n * (more / n) ** (np.log(error / target) / np.log(error / smaller)))
            yield float(spent + (most - spent) * (steps - n) / (more - n))
