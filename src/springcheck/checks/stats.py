"""Straight lines through measured points, and quantiles of Student's t."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from springcheck.physics.arrays import Floats, by_identity


@by_identity
class Line(NamedTuple):
    """Least squares of y = intercept + slope x, and further terms."""

    slope: float
    standard_error: float
    """Standard error of the slope; NaN where there are as many unknowns as points."""
    intercept: float
    leverage: Floats
    """Derivative of the slope by each y (n,)."""


def line(x: Floats, y: Floats, *terms: Floats) -> Line:
    """The line through points x, y (n,), fitted together with the coefficients of these terms (n,)."""
    design = np.stack([np.ones_like(x), x, *terms], axis=1)
    inverse = np.linalg.pinv(design)
    best = inverse @ y
    left = y - design @ best
    freedom = len(x) - len(best)
    variance = float(left @ left) / freedom if freedom else np.nan
    error = float(np.sqrt(variance) * np.linalg.norm(inverse[1]))
    return Line(float(best[1]), error, float(best[0]), inverse[1])


def student(freedom: int, chance: float) -> float:
    """Two-sided quantile of Student's t: |t| exceeds it with this probability."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 1 - chance / 2))
