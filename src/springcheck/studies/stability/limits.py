"""The measured limit of a method: the largest h w up to which its own propagator stays bounded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.checks.stats import line
from springcheck.engines.contract import Label
from springcheck.physics.arrays import Extended, Floats
from springcheck.studies.stability import propagators
from springcheck.studies.stability.propagators import STEP, Springs, first

FIRST_H_W, LAST_H_W, COARSE_SPRINGS = 1e-9, 1e6, 4096
"""The scan: `COARSE_SPRINGS` values of h w from `FIRST_H_W` to `LAST_H_W`, in a ratio of 1.008."""

FINE_SPRINGS = 1024
"""Springs in each refinement, which divides the bracket by 1000."""

AGREED_LIMIT = 1e-6
"""Relative tolerance of every limit in double precision."""

BLURRED_ROUNDING = 16
"""Factor on the rounding in a second search.  Growth beyond a limit is of some power n of the distance, so
that rounding hides a distance r**(1/n), which changes by 16**(1/n) - 1 of itself, at least a quarter up to n
= 12."""

NEAR_LIMIT = 1e-3
"""Relative distance from the limit at which stepping confirms it."""

GROWING_H_W = 0.1
"""h w at which growth is stepped where the limit is 0."""

DECAYING_H_W = 1e3
"""h w at which decay is stepped where there is no limit."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limit:
    """Measurement of one method on one spring."""

    method: str
    scheme: str
    limit: float
    """Largest h w with a bounded propagator; infinity where none up to `LAST_H_W` is unbounded."""
    theory: float
    bound: float
    """Allowed |limit - theory|: what one step's rounding hides, `AGREED_LIMIT` at least."""
    growth_above: float
    """Measured growth of the amplitude per step just above the limit (its logarithm); NaN: no limit."""
    growth_predicted: float
    growth_below: float
    """Growth just below the limit, or at `DECAYING_H_W` where there is none."""
    growth_below_predicted: float
    h_w: Floats
    """h w of the points drawn (j,)."""
    radius: Floats
    """Measured spectral radius there."""
    radius_predicted: Floats

    @property
    def agrees(self) -> bool:
        """Whether the limit agrees with theory."""
        return self.limit == self.theory or abs(self.limit - self.theory) <= self.bound

    @property
    def follows(self) -> bool:
        """Whether the measured spectral radii are those of the scheme, to `AGREED_LIMIT`."""
        return np.allclose(self.radius, self.radius_predicted, rtol=AGREED_LIMIT, atol=0, equal_nan=True)


def measure(label: Label) -> Limit:
    """Measure a method's limit, step on both sides of it and at it, and compare with its scheme."""
    scheme = schemes.scheme(engines.method(label).scheme)
    limit = first_exit(label, propagators.measured)
    theory = scheme.limit
    bound = AGREED_LIMIT
    if not np.isinf(theory):
        # the scheme's map at its own rounding shows what is undecidable, to which the roundings of k and of
        # the step add.  The limit moves by more where rounding hides it, not where the stated limit is wrong
        hidden, blurred = (first_exit(label, propagators.theory, times) for times in (1, BLURRED_ROUNDING))
        off = 0.0 if hidden == blurred else min(abs(hidden - theory), abs(hidden - blurred))
        bound = max(AGREED_LIMIT, 4 * off + 4 * propagators.noise(label) * theory)
    turn = _points(theory)
    springs = Springs(label=label, turn=turn)
    rounding = propagators.noise(label)
    above, below = (np.nan, np.nan), (np.nan, np.nan)
    if theory == 0:
        above = _growth(label, GROWING_H_W)
    elif np.isinf(theory):
        below = _growth(label, DECAYING_H_W)
    else:
        above, below = _growth(label, theory * (1 + NEAR_LIMIT)), _growth(label, theory * (1 - NEAR_LIMIT))
    return Limit(
        method=str(label),
        scheme=scheme.title,
        limit=limit,
        theory=theory,
        bound=bound,
        growth_above=above[0],
        growth_predicted=above[1],
        growth_below=below[0],
        growth_below_predicted=below[1],
        h_w=turn,
        radius=propagators.radius(propagators.measured(springs), rounding)[0],
        radius_predicted=propagators.radius(propagators.theory(springs), rounding)[0],
    )


def first_exit(label: Label, matrices: Callable[[Springs], Floats | Extended], times: float = 1) -> float:
    """First h w at which the propagator is unbounded, to a part in 1e10, at `times` the rounding of the
    engine; infinity where there is none."""
    rounding = times * propagators.noise(label)

    def grows(turn: Floats) -> tuple[np.ndarray, Floats]:
        springs = Springs(label=label, turn=turn)
        wild = ~propagators.bounded(matrices(springs), rounding)
        return wild, np.asarray(springs.true_turn, np.float64)

    single = engines.arithmetic(label).parameters == "single"
    h_w = np.geomspace(FIRST_H_W, LAST_H_W, COARSE_SPRINGS)
    return first(grows, h_w, FINE_SPRINGS, 5, 2.0**-22 if single else 1e-10)


def _points(theory: float) -> Floats:
    """h w at which the spectral radius is drawn: over the decade around the limit, denser near it."""
    centre = theory if 0 < theory < np.inf else 2.0
    wide = np.geomspace(centre / 20, centre * 5, 41)
    near = centre * (1 + np.array([-0.02, -0.005, 0.0, 0.005, 0.02]))
    return np.unique(np.concatenate([wide, near]))


def stepped(springs: Springs, steps: int) -> tuple[Floats, Floats]:
    """A run of one spring in scaled coordinates, (f,) each."""
    of_q, of_p = propagators.units(springs)
    # a thousandth of the scan's force leaves room to grow
    run = driver.run(propagators.scene(springs, of_q * 1e-3, of_p * 0.7e-3, steps=steps), springs.label)
    return run.q[:, 0] / of_q[0], run.p[:, 0] / of_p[0]


def _growth(label: Label, turn: float) -> tuple[float, float]:
    """Logarithm of the growth per step: measured by stepping, and that of the largest eigenvalue.

    The slope of log amplitude over the last quarter of a run that is long enough for the growing eigenvector
    to dominate by 1e7, as far as amplitudes allow; of the invariant quadratic form where the motion is an
    ellipse.
    """
    springs = Springs(label=label, turn=np.array([turn]))
    matrix = propagators.theory(springs)
    found = schemes.rotation(matrix)
    predicted = float(0.5 * np.log(np.abs(found.determinant[0])) + found.growth[0])
    steps = 400
    if predicted != 0:
        steps = int(np.clip(16 / abs(predicted), 40, 400))
    x, y = stepped(springs, steps)
    size = np.hypot(x, y)
    usable = np.flatnonzero(np.isfinite(size) & (size > 0))
    first = usable[-1] * 3 // 4
    n = np.arange(first, usable[-1] + 1)
    if found.angle[0] != 0:
        form = schemes.invariant(matrix, h=STEP)[0]
        x, y = x[n], y[n]
        # along the invariant ellipse the amplitude does not oscillate
        ellipse = np.abs(form[0] * x * x + form[1] * x * y + form[2] * y * y)
        logs = 0.5 * np.log(ellipse.astype(np.float64))
    else:
        logs = np.log(size[n])
    return line(n.astype(np.float64), logs).slope, predicted
