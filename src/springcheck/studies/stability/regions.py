"""The region of stability of a damped spring in the plane of h w and the damping ratio c / (2 sqrt(k m))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from springcheck import engines
from springcheck.engines.contract import Label
from springcheck.physics.arrays import Floats
from springcheck.studies.stability import propagators
from springcheck.studies.stability.propagators import Springs

REGION_TURNS = (0.05, 20.0)
"""Range of h w."""

RATIO_FROM = 0.025
"""The smallest damping ratio; the largest follows, because both axes have the same ratio of neighbours."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """Measured and predicted spectral radii on a grid."""

    method: str
    h_w: Floats
    """h w (i,)."""
    damping_ratio: Floats
    """Damping ratio (j,)."""
    radius: Floats
    """Measured (j, i)."""
    radius_predicted: Floats
    stable: np.ndarray
    stable_predicted: np.ndarray
    """Theory, without the allowance for rounding of `stable`."""
    off: float
    """Largest difference of the radii, in units of the effect of rounding of the propagator's entries."""
    undecided: int
    """Points whose predicted radius differs from 1 by less than the rounding of the entries."""
    wrong: int
    """Further points at which measurement and theory disagree, of those that were measured."""

    @property
    def points(self) -> int:
        """Number of points of the grid."""
        return int(self.radius.size)

    @property
    def unmeasured(self) -> int:
        """Number of points at which the engine stopped."""
        return int(np.count_nonzero(np.isnan(self.radius)))


def measure(label: Label, points: int = 200) -> Region:
    """Measure points * points damped springs in one run, or in one for each rate where a run has only one."""
    turn = np.geomspace(*REGION_TURNS, points)
    ratio = RATIO_FROM * turn / turn[0]
    row, column = (x.ravel() for x in np.indices((points, points)))
    brake = 2 * ratio[row] * turn[column]
    measured = np.empty((points * points, 2, 2))
    if engines.method(label).one_friction:
        # axes of equal ratios: the rate 2 ratio h w is constant along row + column
        for total in range(2 * points - 1):
            these = np.flatnonzero(row + column == total)
            rate = float(brake[these[0]])
            brake[these] = rate
            measured[these] = propagators.measured(Springs(label=label, turn=turn[column[these]], brake=rate))
    else:
        measured[:] = propagators.measured(Springs(label=label, turn=turn[column], brake=brake))
    predicted = propagators.theory(Springs(label=label, turn=turn[column], brake=brake))
    rounding = propagators.noise(label)
    radius, moved = propagators.radius(measured, rounding)
    truth, moved_truth = propagators.radius(predicted, rounding)
    allowed = np.where(np.isfinite(moved), np.maximum(moved, moved_truth), moved_truth)
    # for a method of one friction the product h c/m has a rounding of its own
    allowed += rounding * (1 + brake)
    stable = propagators.bounded(measured, rounding)
    inside = truth <= 1
    undecided, known = np.abs(truth - 1) <= allowed, ~np.isnan(measured).any(axis=(1, 2))
    radius = np.where(known & np.isnan(radius), np.inf, radius)
    off = np.where(np.isinf(radius), np.inf, np.abs(radius - truth) / allowed)
    shape = (points, points)
    return Region(
        method=str(label),
        h_w=turn,
        damping_ratio=ratio,
        radius=radius.reshape(shape),
        radius_predicted=truth.reshape(shape),
        stable=stable.reshape(shape),
        stable_predicted=inside.reshape(shape),
        off=float(np.max(off[known], initial=0.0)),
        undecided=int(np.count_nonzero(undecided)),
        wrong=int(np.count_nonzero((stable != inside) & ~undecided & known)),
    )
