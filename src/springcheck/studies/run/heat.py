"""Temperatures of a run in a bath, beside those that its scheme has exactly."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.run.result import Heated
from springcheck.thermal import THERMOSTATS, Law
from springcheck.thermal.draws import law_of

SETTLED = 5.0
"""Times over which the slowest part of the motion decays before frames count: exp(-5) of a start is left in
its mean, exp(-10) in its square."""


def heated_of(scene: Scene, pieces: Iterable[Trajectory]) -> Heated:
    """The temperatures of one run in a bath, of its pieces."""
    heat, label = Heat(scene), ""
    for piece in pieces:
        heat.add(piece)
        label = piece.label
    return heat.line(label)


class Heat:
    """Configurational and kinetic temperature of a run, from its pieces."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._law: Law | None = None
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
            if scene.system.has_modes:
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
        linear = scene.system.has_modes and bool(np.all(scene.system.modes.w2 > 0))
        if piece.scheme in THERMOSTATS and linear and not THERMOSTATS[piece.scheme].rescales:
            if not THERMOSTATS[piece.scheme].splits:
                self._law = Law(
                    scheme=THERMOSTATS[piece.scheme], h=piece.step, m=np.ones(scene.n),
                    k=scene.system.modes.w2, rate=scene.bath.friction, thermal=scene.thermal,
                )  # fmt: skip
            elif scene.system.is_separate:
                # modes of all terms are not those of the fast ones
                self._law = law_of(THERMOSTATS[piece.scheme], scene.derived(step=piece.step))
            else:
                return
            left = self._law.slowest
            self._from = round(SETTLED / -np.log(left)) if 0 < left < 1 else 0

    def line(self, method: str) -> Heated:
        """What was found."""
        nan = np.full(self._scene.n, np.nan)
        thermal = self._scene.thermal
        held = any(term.kind == "potential" for term in self._scene.terms)
        with np.errstate(all="ignore"):
            q, p = self._sums / (self._frames * thermal) if self._frames else (nan, nan)
            if self._law is None:
                law, errors = (nan, nan), np.stack([nan, nan])
            else:
                law = self._law.configurational, self._law.kinetic
                several = self._law.error_of_variances(max(self._frames, 2), self._every)
                errors = several.T * np.stack(law)
        n = len(nan)
        error = np.sqrt(np.sum(errors**2, axis=1)) / n
        return Heated(
            method=method, scheme=self._scheme, configurational=float(np.mean(q)) if held else np.nan,
            configurational_error=float(error[0]), configurational_law=float(np.mean(law[0])),
            kinetic=float(np.mean(p)), kinetic_error=float(error[1]), kinetic_law=float(np.mean(law[1])),
        )  # fmt: skip
