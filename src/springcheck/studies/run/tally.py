"""Error and energy of a run, accumulated piece by piece, and its row in the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from springcheck import checks
from springcheck.checks.compare import solution
from springcheck.physics import exact
from springcheck.physics.arrays import Extended, Reals
from springcheck.physics.norm import energy_scale
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

if TYPE_CHECKING:
    from springcheck.bath.heat import Heat

FAINTEST_ENERGY = np.finfo(np.float64).tiny / np.finfo(np.float64).eps
"""Scale of energies below which they are subnormal in double precision and lose digits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodRun:
    """One row of the report."""

    method: str
    scheme: str
    outcome: str
    steps: int
    """Steps that were taken."""
    message: str
    max_error: float
    """Largest distance from the exact solution (`Norm`); NaN where that is unknown."""
    error_below: bool
    """Whether `max_error` is only an upper bound: the uncertainty of the exact solution."""
    energy_drift: float
    """H - H0 over the scene's `energy_scale` where it is largest, > 0 where energy is gained.  With friction
    or a drive the exact solution's H replaces H0, where it is known."""
    start_seconds: float
    run_seconds: float
    force_calls: int


class Tally:
    """Error and energy over all pieces of a trajectory."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._norm = scene.system.norm
        self.heat: Heat | None = None
        if scene.bath:
            from springcheck.bath.heat import Heat

            self.heat = Heat(scene)
        self._known = exact.has_true_motion(scene)
        scale, _ = energy_scale(scene.system)
        self._wide = not FAINTEST_ENERGY < scale < np.finfo(np.float64).max
        self._scale = scale if self._wide else np.float64(scale)
        self._start = self._energy(scene.q, scene.p)
        self.error = 0.0 if self._known else np.nan
        self.doubt = 0.0
        self.drift: float = 0.0

    def add(self, piece: Trajectory, known: tuple[Extended, Extended] | None = None) -> None:
        """Add a piece; `known` is the exact solution from its first frame on, or further."""
        scene, right = self._scene, self._start
        if self.heat:
            self.heat.add(piece)
        if self._known:
            q, p = (x[: len(piece.t)] for x in known or solution(scene, [piece]))
            if not scene.system.keeps_energy:
                right = self._energy(q, p)
            # np.maximum propagates NaN, which max() drops
            here = np.max(self._norm(piece.q - q, piece.p - p))
            self.error = float(np.maximum(self.error, here))
            last = int(checks.Case(trajectory=piece, scene=scene).steps[-1])
            self.doubt = max(self.doubt, exact.uncertainty(scene, float(last) * piece.step))
        with np.errstate(over="ignore", invalid="ignore"):
            off = self._energy(piece.q, piece.p) - right
            worst = float(off[np.argmax(np.abs(off))] / self._scale)
        if not abs(worst) <= abs(self.drift) and not np.isnan(self.drift):
            self.drift = worst

    def _energy(self, q: Reals, p: Reals) -> Reals:
        """Energies in double precision, or in extended where their scale leaves the range of double."""
        if not self._wide:
            return np.asarray(self._scene.system.energy(q, p), np.float64)
        return self._scene.system.energy(q.astype(np.longdouble), p.astype(np.longdouble))


def line(piece: Trajectory, tally: Tally) -> MethodRun:
    """Row of the report for a run, from its last piece and the tally of all of them."""
    # a run with no frame but the start has no error: that of the start proves nothing
    ended = piece.outcome.status != "complete" and piece.outcome.step == 0
    return MethodRun(
        method=piece.label,
        scheme=piece.scheme,
        outcome=piece.outcome.status,
        steps=piece.outcome.step,
        message=piece.outcome.message,
        # differences below the uncertainty of the exact solution are not reported as errors
        max_error=np.nan if ended else tally.error + (tally.doubt if tally.error < tally.doubt else 0.0),
        error_below=not ended and tally.error < tally.doubt,
        energy_drift=np.nan if ended else tally.drift,
        start_seconds=piece.timing.start,
        run_seconds=piece.timing.run,
        force_calls=piece.force_calls,
    )
