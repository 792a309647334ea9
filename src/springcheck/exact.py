"""The true motion of a scene: normal modes, in extended precision.

A linear scene falls apart into modes y'' = -w2 y + g, one for each eigenvector of M^-1/2 K M^-1/2:
circular functions for w2 > 0, hyperbolic ones for w2 < 0, a parabola for w2 = 0.  Every scheme acts on
each mode by itself too, which is why limits and shadow energies are read off here as well.

Phases are taken as (number of steps) * (h w) with the very double h that the engines were given, in
extended precision: after 1e7 steps a phase in double precision would be wrong by 1e-10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from springcheck import mechanics
from springcheck.model import Extended, Integers, Reals, Scene

EPS = float(np.finfo(np.longdouble).eps)
"""Of the extended precision used for every reference: 1.1e-19 on x86-64.  Where `long double` is no
wider than double the references round like the engines, and every bound that names EPS widens."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Normal modes: q = M**-1/2 V y.  `vectors` is None where no term joins two particles (V = 1).

    w2 (n,) [1/T2]; vectors (n, n), columns; pull (n,): the constant force on each mode [M1/2 L/T2].
    """

    w2: Extended
    pull: Extended
    root_m: Extended
    vectors: Extended | None

    def into(self, q: Reals, p: Reals) -> tuple[Extended, Extended]:
        """Mode coordinates y [M1/2 L] and velocities [M1/2 L/T] of states (..., n)."""
        y, v = np.asarray(q, np.longdouble) * self.root_m, np.asarray(p, np.longdouble) / self.root_m
        return (y, v) if self.vectors is None else (y @ self.vectors, v @ self.vectors)

    def out_of(self, y: Extended, v: Extended) -> tuple[Extended, Extended]:
        """Positions and momenta of states in mode coordinates (..., n)."""
        if self.vectors is not None:
            y, v = y @ self.vectors.T, v @ self.vectors.T
        return y / self.root_m, v * self.root_m

    def centre(self) -> Extended:
        """Rest position of each mode, 0 for a mode that nothing holds (w2 = 0)."""
        held = self.w2 != 0
        return np.asarray(np.where(held, self.pull / np.where(held, self.w2, 1), 0))


def modes(scene: Scene) -> Modes:
    """Normal modes of a linear scene.  Errors of w2 are about n EPS max(w2)."""
    if not mechanics.is_linear(scene):
        raise ValueError(f"scene {scene.name!r} is not linear: it has no normal modes")
    root_m = np.sqrt(scene.m.astype(np.longdouble))
    zero = np.zeros(scene.n, dtype=np.longdouble)
    pull: Extended = np.asarray(mechanics.force(scene.terms)(zero, zero) / root_m, np.longdouble)
    if mechanics.is_separate(scene):
        k = np.zeros(scene.n, dtype=np.longdouble)
        for term in scene.terms:
            assert isinstance(term, mechanics.WallSpring)
            np.add.at(k, term.i, term.k.astype(np.longdouble))
        return Modes(w2=k / scene.m, pull=pull, root_m=root_m, vectors=None)
    scaled = mechanics.stiffness(scene, zero) / root_m[:, None] / root_m
    symmetric = np.asarray(scaled, np.longdouble)
    w2, vectors = _eigen(symmetric)
    # a free translation has w2 = 0 up to rounding; left as it is it would drift as a slow wave
    w2 = np.where(np.abs(w2) <= 8 * scene.n * EPS * np.max(np.abs(w2)), 0, w2)
    return Modes(w2=w2, pull=pull @ vectors, root_m=root_m, vectors=vectors)


def _eigen(symmetric: Extended) -> tuple[Extended, Extended]:
    """Eigenvalues and vectors in extended precision, by refinement of LAPACK's in double.

    Ogita & Aishima, Japan J. Indust. Appl. Math. 35 (2018) 1007: in the basis of the approximate
    vectors the matrix is nearly diagonal; one first-order rotation squares the error.  Within a cluster
    of equal eigenvalues the small block is diagonalised instead.
    """
    _, start = np.linalg.eigh(symmetric.astype(np.float64))
    vectors: Extended = start.astype(np.longdouble)
    size = float(np.max(np.abs(symmetric))) or 1.0
    for _ in range(4):
        gram = vectors.T @ vectors
        vectors = vectors @ (1.5 * np.eye(len(gram), dtype=np.longdouble) - 0.5 * gram)
        inner = vectors.T @ symmetric @ vectors
        values = np.diag(inner)
        gap = values[None, :] - values[:, None]
        close = np.abs(gap) <= 1e-9 * size
        rotation = np.where(close, 0, inner / np.where(close, 1, gap))
        vectors = vectors + vectors @ rotation
        for block in _clusters(close):
            off = inner[np.ix_(block, block)] - np.diag(values[block])
            if len(block) > 1 and np.any(np.abs(off) > EPS * size):
                shifted = inner[np.ix_(block, block)] - np.mean(values[block]) * np.eye(len(block))
                _, turn = np.linalg.eigh(np.asarray(shifted / np.max(np.abs(shifted)), np.float64))
                vectors[:, block] = vectors[:, block] @ turn.astype(np.longdouble)
        if np.max(np.abs(rotation)) < 4 * len(gram) * EPS:
            break
    gram = vectors.T @ vectors
    vectors = vectors @ (1.5 * np.eye(len(gram), dtype=np.longdouble) - 0.5 * gram)
    return np.diag(vectors.T @ symmetric @ vectors).copy(), vectors


def _clusters(close: np.ndarray) -> list[Integers]:
    """Runs of neighbouring (sorted) eigenvalues that lie close together."""
    breaks = np.flatnonzero(~np.diagonal(close, offset=1)) + 1
    return [np.asarray(block) for block in np.split(np.arange(len(close)), breaks)]


def has_true_motion(scene: Scene) -> bool:
    """Whether `true_motion` knows the scene."""
    return mechanics.is_linear(scene)


def true_motion(
    scene: Scene, steps: Integers, h: float, known: Modes | None = None
) -> tuple[Extended, Extended]:
    """True q and p (f, n) after these numbers of steps of h, in extended precision.

    `known` are the scene's modes, for a caller that asks often.
    """
    found = known or modes(scene)
    y0, v0 = found.into(scene.q, scene.p)
    centre = found.centre()
    w = np.sqrt(np.abs(found.w2))
    count = np.asarray(steps).astype(np.longdouble)[:, None]
    phase = count * (np.longdouble(h) * w)
    t = count * np.longdouble(h)
    u0 = y0 - centre
    safe = np.where(w > 0, w, 1)
    y = np.empty(phase.shape, dtype=np.longdouble)
    v = np.empty_like(y)
    for kind, cosine, sine, sign in (
        (found.w2 > 0, np.cos, np.sin, -1),
        (found.w2 < 0, np.cosh, np.sinh, 1),
    ):
        if np.any(kind):
            c, s = cosine(phase[:, kind]), sine(phase[:, kind])
            y[:, kind] = centre[kind] + u0[kind] * c + v0[kind] / safe[kind] * s
            v[:, kind] = v0[kind] * c + sign * safe[kind] * u0[kind] * s
    free = found.w2 == 0
    if np.any(free):
        y[:, free] = y0[free] + v0[free] * t + found.pull[free] * t * t / 2
        v[:, free] = v0[free] + found.pull[free] * t
    return found.out_of(y, v)
