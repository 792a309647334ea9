"""Temperatures of a run in a bath, measured, next to those of its scheme."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from springcheck.bath.catalogue import THERMOSTATS
from springcheck.bath.laws import Law
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.system import MOST_DENSE
from springcheck.physics.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class Heated:
    """Temperatures of a run over that of its bath: measured, with standard errors, and as its scheme has
    them exactly; NaN where there is no law."""

    method: str
    scheme: str
    configurational: float
    configurational_error: float
    configurational_law: float
    kinetic: float
    kinetic_error: float
    kinetic_law: float


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
    is 0, and they have no configurational temperature."""
    system = scene.system
    if not any(term.kind == "potential" for term in scene.terms):
        return 0
    if system.has_modes:
        return int(np.count_nonzero(system.modes.w2))
    if scene.n > MOST_DENSE:
        return scene.n - len(system.free_groups)
    with np.errstate(all="ignore"):
        there = system.hessian(q[np.linspace(0, len(q) - 1, PLACES).astype(int)]).astype(np.float64)
    # of a run that diverges where it still has one, as at its start
    there = there[np.isfinite(there).all(axis=(1, 2))]
    size = np.sqrt(np.max(np.abs(there), axis=(0, 1)))
    size[size == 0] = 1
    return int(np.linalg.matrix_rank((there / size / size[:, None]).reshape(-1, scene.n), tol=RESISTED))


class Heat:
    """Configurational and kinetic temperature of a run, from its pieces."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._law: Law | None = None
        self._sums = np.zeros((2, scene.n))
        self._frames = self._from = 0
        self._scheme, self._every, self._bound = "", scene.every, scene.n

    def add(self, piece: Trajectory) -> None:
        """Take a piece into account."""
        scene, first = self._scene, round(float(piece.t[0]) / piece.step)
        if not self._scheme:
            self._begin(piece)
        # the last frame of a piece is the first of the next
        steps = first + np.arange(len(piece.t) - 1) * piece.every
        some = np.flatnonzero(steps >= self._from)
        if not len(some):
            return
        q, p = (x[some].astype(np.longdouble) for x in (piece.q, piece.p))
        with np.errstate(all="ignore"):
            if scene.system.has_modes:
                y, v = scene.system.modes.about_centres(q, p)
                of_q, of_p = scene.system.modes.w2 * y * y, v * v
            else:
                # the virial q dV/dq has the mean kT in every potential
                of_q, of_p = -q * scene.system.potential_force(q, p), p * p / scene.m
            self._sums += np.asarray([np.sum(of_q, axis=0), np.sum(of_p, axis=0)], np.float64)
        self._frames += len(some)

    def _begin(self, piece: Trajectory) -> None:
        scene, system, bath = self._scene, self._scene.system, self._scene.bath
        assert bath is not None
        self._scheme, self._every, self._bound = piece.scheme, piece.every, bound_freedoms(scene, piece.q)
        if law := self._law_of(piece):
            left, modes = law.slowest, system.modes
            y, v = modes.about_centres(scene.q.astype(np.longdouble), scene.p.astype(np.longdouble))
            lasts = self._settling(modes.w2 * y * y + v * v)
            self._from = round(lasts / -np.log(left)) if 0 < left < 1 else 0
            # a collision is one particle's, and mixes modes
            self._law = None if law.scheme.collides and not system.is_separate else law

    def _law_of(self, piece: Trajectory) -> Law | None:
        """The law of each mode."""
        scene, system, scheme = self._scene, self._scene.system, THERMOSTATS.get(piece.scheme)
        if scheme is None or scheme.rescales or not system.has_modes or not np.all(system.modes.w2 >= 0):
            return None
        assert scene.bath is not None
        held = system.modes.w2[system.modes.w2 > 0]
        return Law(
            scheme=scheme, h=piece.step, m=np.ones(len(held)), k=held, rate=scene.bath.friction,
            thermal=scene.thermal,
        ) if len(held) else None  # fmt: skip

    def _settling(self, squares: Reals) -> float:
        """Times of decay before frames count: more where the squares of the start (n,) are larger than kT,
        their mean in the bath."""
        mean, thermal = float(np.mean(squares)), self._scene.thermal
        return SETTLED + (0.5 * np.log(mean / thermal) if 0 < thermal < mean < np.inf else 0.0)

    def line(self, method: str) -> Heated:
        """What was found."""
        n, bound = self._scene.n, self._bound
        law, errors = np.full((2, n), np.nan), np.full((2, n), np.nan)
        with np.errstate(all="ignore"):
            q, p = self._sums / (self._frames * self._scene.thermal)
            if self._law is not None:
                law = np.stack([self._law.configurational, self._law.kinetic])
                errors = law * self._law.error_of_variances(max(self._frames, 2), self._every).T
        error = np.sqrt(np.sum(errors**2, axis=1)) / errors.shape[1]
        if bound < n:
            # of motion that nothing holds the law has no stationary state
            law[1] = error[1] = np.nan
        return Heated(
            method=method, scheme=self._scheme, configurational=float(np.sum(q)) / bound if bound else np.nan,
            configurational_error=float(error[0]), configurational_law=float(np.mean(law[0])),
            kinetic=float(np.sum(p)) / n, kinetic_error=float(error[1]),
            kinetic_law=float(np.mean(law[1])),
        )  # fmt: skip
