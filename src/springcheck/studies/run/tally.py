"""Error and energy of a run, piece by piece, and its line in the report; temperatures in a bath beside
those of its scheme."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np

from springcheck import checks, thermal
from springcheck.physics import exact
from springcheck.physics.arrays import Extended, Floats, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.system import MOST_DENSE
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.run.result import Heated, MethodRun
from springcheck.thermal import THERMOSTATS

SETTLED = 5.0
"""Times over which the slowest part of the motion decays before frames count: exp(-5) of a start is left in
its mean, exp(-10) in its square."""

PLACES, RESISTED = 8, 1e-9
"""Frames at which the Hessian is evaluated, and the smallest singular value of a direction in which forces
change, for elements up to 1; those of translations are roundings."""


def heated_of(scene: Scene, pieces: Iterable[Trajectory]) -> Heated:
    """The temperatures of one run in a bath, of its pieces."""
    heat, label = Heat(scene), ""
    for piece in pieces:
        heat.add(piece)
        label = piece.label
    return heat.line(label)


def bound_freedoms(scene: Scene, q: Floats) -> int:
    """Coordinates less the directions in which no force changes, seen at frames q (f, n): the virial of these
    is 0, and they have no configurational temperature.  0 with rods, along which forces do no virtual work
    and are no part of the virial."""
    system = scene.system
    if system.rods or not any(term.kind == "potential" for term in scene.terms):
        return 0
    if system.has_modes:
        return int(np.count_nonzero(system.modes.w2))
    if scene.n > MOST_DENSE:
        return scene.n - len(system.free_groups)
    there = system.hessian(q[np.linspace(0, len(q) - 1, PLACES).astype(int)]).astype(np.float64)
    size = np.sqrt(np.max(np.abs(there), axis=(0, 1)))
    size[size == 0] = 1
    return int(np.linalg.matrix_rank((there / size / size[:, None]).reshape(-1, scene.n), tol=RESISTED))


class Heat:
    """Configurational and kinetic temperature of a run, from its pieces."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._law: thermal.Law | None = None
        rods = scene.system.rods
        self._freedoms = rods.freedoms if rods else scene.n
        self._bound = scene.n
        self._sums = np.zeros((2, scene.n))
        self._frames = 0
        self._from = 0
        self._every = scene.every
        self._scheme = ""

    def add(self, piece: Trajectory) -> None:
        """Take a piece into account."""
        scene, first = self._scene, round(float(piece.t[0]) / piece.step)
        assert scene.bath is not None
        if not self._scheme:
            self._begin(piece)
        # the last frame of a piece is the first of the next
        steps = first + np.arange(len(piece.t) - 1) * piece.every
        some = np.flatnonzero(steps >= self._from)
        if not len(some):
            return
        q, p = (x[some].astype(np.longdouble) for x in (piece.q, piece.p))
        with np.errstate(all="ignore"):
            if scene.system.has_modes and not scene.system.rods:
                y, v = scene.system.modes.about_centres(q, p)
                of_q, of_p = scene.system.modes.w2 * y * y, v * v
            else:
                # the virial q dV/dq has the mean kT in every potential
                of_q, of_p = -q * scene.system.potential_force(q, p), p * p / scene.m
        self._sums += np.asarray([np.sum(of_q, axis=0), np.sum(of_p, axis=0)], np.float64)
        self._frames += len(some)

    def _begin(self, piece: Trajectory) -> None:
        scene, self._scheme, self._every = self._scene, piece.scheme, piece.every
        assert scene.bath is not None
        self._bound = bound_freedoms(scene, piece.q)
        if scene.system.rods:
            self._from = round(self._settling(scene.p**2 / scene.m) / (scene.bath.friction * piece.step))
            return
        linear = scene.system.has_modes and bool(np.all(scene.system.modes.w2 >= 0))
        if piece.scheme in THERMOSTATS and linear and not THERMOSTATS[piece.scheme].rescales:
            if not THERMOSTATS[piece.scheme].splits:
                held = scene.system.modes.w2[scene.system.modes.w2 > 0]
                if not len(held):
                    return
                self._law = thermal.Law(
                    scheme=THERMOSTATS[piece.scheme], h=piece.step, m=np.ones(len(held)), k=held,
                    rate=scene.bath.friction, thermal=scene.thermal,
                )  # fmt: skip
            elif scene.system.is_separate and self._bound == scene.n:
                # modes of all terms are not those of the fast ones
                self._law = thermal.draws.law_of(THERMOSTATS[piece.scheme], scene.derived(step=piece.step))
            else:
                return
            left, modes = self._law.slowest, scene.system.modes
            y, v = modes.about_centres(scene.q.astype(np.longdouble), scene.p.astype(np.longdouble))
            lasts = self._settling(modes.w2 * y * y + v * v)
            self._from = round(lasts / -np.log(left)) if 0 < left < 1 else 0

    def _settling(self, squares: Reals) -> float:
        """Times of decay before frames count: more where the squares of the start (n,) are larger than kT,
        their mean in the bath."""
        mean, thermal = float(np.mean(squares)), self._scene.thermal
        return SETTLED + (0.5 * np.log(mean / thermal) if 0 < thermal < mean < np.inf else 0.0)

    def line(self, method: str) -> Heated:
        """What was found."""
        nan = np.full(self._scene.n, np.nan)
        thermal, bound = self._scene.thermal, self._bound
        with np.errstate(all="ignore"):
            q, p = self._sums / (self._frames * thermal) if self._frames else (nan, nan)
            if self._law is None:
                law, errors = (nan, nan), np.stack([nan, nan])
            else:
                law = self._law.configurational, self._law.kinetic
                several = self._law.error_of_variances(max(self._frames, 2), self._every)
                errors = several.T * np.stack(law)
        error = np.sqrt(np.sum(errors**2, axis=1)) / errors.shape[1]
        if bound < len(nan):
            # of motion that nothing holds the law has no stationary state
            law, error[1] = (law[0], nan), np.nan
        if self._scene.system.rods:
            law, error[1] = (nan, np.full(len(nan), self._law_of_rods)), self._error_of_rods()
        return Heated(
            method=method, scheme=self._scheme, configurational=float(np.sum(q)) / bound if bound else np.nan,
            configurational_error=float(error[0]), configurational_law=float(np.mean(law[0])),
            kinetic=float(np.sum(p)) / self._freedoms, kinetic_error=float(error[1]),
            kinetic_law=float(np.mean(law[1])),
        )  # fmt: skip

    @property
    def _law_of_rods(self) -> float:
        """1 where rods move freely, each by itself, and all that acts on momenta acts across them."""
        rods = self._scene.system.rods
        free = rods and not rods.share and all(term.kind == "constraint" for term in self._scene.terms)
        return 1.0 if free and THERMOSTATS[self._scheme].kinetic_of_rods else np.nan

    def _error_of_rods(self) -> float:
        """Standard error of squares of momenta that forget by exp(-friction h) a step."""
        assert self._scene.bath is not None
        square = np.exp(-2 * self._scene.bath.friction * self._scene.step * self._every)
        return float(np.sqrt(2 * (1 + square) / ((1 - square) * max(self._frames, 2) * self._freedoms)))


FAINTEST_ENERGY = np.finfo(np.float64).tiny / np.finfo(np.float64).eps
"""Initial energy below which energies in double precision are subnormal and lose digits."""


def solution(scene: Scene, pieces: Collection[Trajectory]) -> tuple[Extended, Extended]:
    """The exact solution q, p (f, n) at the frames of the longest of these pieces, where it is known."""
    longest = max(pieces, key=lambda piece: len(piece.t))
    return exact.true_motion(scene, checks.Case(trajectory=longest, scene=scene).steps, longest.step)


class Tally:
    """Error and energy over all pieces of a trajectory."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._norm = scene.system.norm
        self.heat = Heat(scene)
        self._known = exact.has_true_motion(scene)
        start = scene.system.energy(scene.q.astype(np.longdouble), scene.p.astype(np.longdouble))
        self._wide = bool(start) and not FAINTEST_ENERGY < abs(start) < np.finfo(np.float64).max
        self._start = start if self._wide else scene.system.energy(scene.q, scene.p)
        self.error = 0.0 if self._known else np.nan
        self.doubt = 0.0
        self.drift: float = 0.0

    def add(self, piece: Trajectory, known: tuple[Extended, Extended] | None = None) -> None:
        """Take a piece into account; `known` is the exact solution from its first frame on, or further."""
        scene, right = self._scene, self._start
        if scene.bath:
            self.heat.add(piece)
        if self._known:
            q, p = (x[: len(piece.t)] for x in known or solution(scene, [piece]))
            if not scene.system.keeps_energy:
                right = self._energy(q, p)
            # not max(), which leaves out what is no number
            here = np.max(self._norm(piece.q - q, piece.p - p))
            self.error = float(np.maximum(self.error, here))
            last = int(checks.Case(trajectory=piece, scene=scene).steps[-1])
            self.doubt = max(self.doubt, exact.uncertainty(scene, float(last) * piece.step))
        with np.errstate(over="ignore", invalid="ignore"):
            off = self._energy(piece.q, piece.p) - right
            worst = float(off[np.argmax(np.abs(off))] / (abs(self._start) or 1.0))
        if not abs(worst) <= abs(self.drift) and not np.isnan(self.drift):
            self.drift = worst

    def _energy(self, q: Reals, p: Reals) -> Reals:
        """Energies in double precision, unless that of the start leaves its range."""
        if not self._wide:
            return np.asarray(self._scene.system.energy(q, p), np.float64)
        return self._scene.system.energy(q.astype(np.longdouble), p.astype(np.longdouble))


def line(piece: Trajectory, tally: Tally) -> MethodRun:
    """The row of the report for a run, from its last piece and the tally of all of them."""
    # a run that left no frame but the start has no error: that of the start is nothing
    ended = piece.outcome.status != "complete" and piece.outcome.step == 0
    return MethodRun(
        method=piece.label,
        scheme=piece.scheme,
        outcome=piece.outcome.status,
        steps=piece.outcome.step,
        message=piece.outcome.message,
        # differences below the uncertainty of the exact solution are no errors of the engine
        max_error=np.nan if ended else tally.error + (tally.doubt if tally.error < tally.doubt else 0.0),
        error_below=not ended and tally.error < tally.doubt,
        energy_drift=np.nan if ended else tally.drift,
        start_seconds=piece.timing.start,
        run_seconds=piece.timing.run,
        force_calls=piece.force_calls,
    )
