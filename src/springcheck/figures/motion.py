"""The exact solution next to runs: smooth for a line, at their own frames for their errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from springcheck.physics import exact
from springcheck.physics.arrays import Extended, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

Motion = tuple[Floats, Floats, Floats]
"""t (f,) [T], q and p (f, n)."""

SMOOTH = 1500
"""Points of a smooth line."""
FEWEST_POINTS, MOST_NUMBERS = 16, 1 << 21
"""Fewest points of a line, however many particles, and most positions of all lines together."""
SPLIT, CLOSE = 64, 20
"""Fraction of the distance of its points, and distances from its start within which there are more."""


def true_motion(scene: Scene, runs: Sequence[Trajectory], points: int = SMOOTH) -> Motion | None:
    """A smooth exact solution from the first frame of these runs to the last, None where none is known."""
    times = [np.abs(run.t[[0, -1]]) for run in runs]
    return smooth(scene, float(np.min(times)), float(np.max(times)), points)


def smooth(scene: Scene, first: float, last: float, points: int = SMOOTH) -> Motion | None:
    """A smooth exact solution between two times from the start [T], None where none is known."""
    if not exact.has_true_motion(scene):
        return None
    begin, end = (round(x / abs(scene.step)) for x in (first, last))
    # whole parts of steps, or whole steps; closer where a stiff motion may decay
    points = max(FEWEST_POINTS, min(points, MOST_NUMBERS // scene.n))
    finer = SPLIT * max(1, -(-points // max(1, end - begin)))
    even = np.linspace(begin * finer, end * finer, points + 1)
    close = begin * finer + np.geomspace(1, CLOSE * max(1, even[1] - even[0]), min(CLOSE * 10, points))
    steps = np.unique(np.rint(np.concatenate([even, close[close < even[-1]]])).astype(np.int64))
    q, p = exact.true_motion(scene, steps, scene.step / finer)
    t, where, speed = (np.asarray(x, np.float64) for x in (steps * (scene.step / finer), q, p))
    return t, where, speed


BOUNDS = 17
"""Times at which the uncertainty of an exact solution is evaluated."""


class Exact:
    """The exact solution of a scene at the frames of its runs; alike frames are computed once."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.known = exact.has_true_motion(scene)
        self._found: dict[tuple[float, ...], tuple[Extended, Extended]] = {}

    def at(self, run: Trajectory) -> tuple[Extended, Extended]:
        """Exact q and p (f, n) at the frames of a run."""
        key = (len(run.t), float(run.t[0]), float(run.t[-1]), run.step)
        if key not in self._found:
            steps = np.rint(run.t / run.step).astype(np.int64)
            self._found[key] = exact.true_motion(self.scene, steps, run.step)
        return self._found[key]

    def error(self, run: Trajectory) -> Floats:
        """Distance of each frame from it (f,), relative to the initial energy norm, but no smaller than its
        uncertainty."""
        q, p = self.at(run)
        return np.maximum(self.scene.system.norm(run.q - q, run.p - p), self.uncertainty(run.t))

    def reach(self, run: Trajectory) -> float:
        """How far it goes from its start in the time of a run, or 1, relative to the initial energy norm."""
        q, p = self.at(run)
        return max(1.0, float(np.max(self.scene.system.norm(q - q[0], p - p[0]))))

    def uncertainty(self, t: Floats) -> Floats:
        """Its uncertainty at these times (f,), relative to the initial energy norm."""
        times = np.linspace(0, float(np.max(np.abs(t))), BOUNDS)
        bounds = [exact.uncertainty(self.scene, float(time)) for time in times]
        return np.interp(np.abs(t), times, bounds)


def periods(x: Floats) -> float:
    """Number of periods of a motion: half of the crossings of its mean."""
    if len(x) < 3 or not np.isfinite(x).all():
        return 0.0
    side = x > np.mean(x)
    return float(np.count_nonzero(side[1:] != side[:-1])) / 2
