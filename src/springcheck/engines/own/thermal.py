"""Thermostats by NumPy: every random scheme, of any terms, with the draws of one generator."""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.bath import THERMOSTATS, Stepper
from springcheck.bath.stepper import forces
from springcheck.engines.own.vectors import kept
from springcheck.physics.arrays import Floats, Force, Reals
from springcheck.physics.scene import Scene

MOST_DRAWS = 1 << 16
"""Draws that are made at once: each step takes its own in the order of the steps, however many at once."""


class Random:
    """A scene carried through the steps of a random scheme.  `seed` is a number, or a generator."""

    def __init__(self, scene: Scene, scheme: str, step: float, seed: Any) -> None:
        self.force_calls = 0
        self._q, self._p = scene.q.astype(np.float64), scene.p.astype(np.float64)
        self._scheme = THERMOSTATS[scheme]
        self._step = Stepper.of(self._scheme, scene.derived(step=step), width=np.float64)
        self._force = self._counted(forces(scene.system))
        scripted = hasattr(seed, "standard_normal")
        self._rng = seed if scripted else np.random.Generator(np.random.PCG64(seed))
        # collisions take numbers of their own, far along the same sequence
        self._hits = self._rng if scripted else np.random.Generator(np.random.PCG64(seed).jumped())
        self._ahead = 1 if scripted else max(1, MOST_DRAWS // (scene.n * self._scheme.draws))
        self._carried = list(self._drawn(1, self._scheme.carried)[0])

    def _counted(self, force: Force) -> Force:
        """A force that counts its evaluations, and is kept where the positions stay."""

        def count(q: Reals, p: Reals) -> Reals:
            self.force_calls += 1
            return force(q, p)

        return kept(count, damped=False)

    def _drawn(self, steps: int, draws: int) -> Floats:
        """(steps, draws, n) numbers of variance 1."""
        shape = (steps, draws, len(self._q))
        if self._scheme.uniform:
            return np.asarray(np.sqrt(12) * (self._rng.random(shape) - 0.5))
        return np.asarray(self._rng.standard_normal(shape))

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q and p (f, n)."""
        left, fresh, row = every * len(q), self._scheme.fresh, 0
        with np.errstate(all="ignore"):
            while left:
                some = min(left, self._ahead)
                chances = self._hits.random((some, len(self._q))) if self._scheme.collides else None
                for i, drawn in enumerate(self._drawn(some, fresh)):
                    draws = [*self._carried, *drawn]
                    hit = None if chances is None else chances[i] < self._step.collision
                    a, b = self._step(self._q, self._p, self._force, draws, hit)
                    self._q, self._p = np.asarray(a, np.float64), np.asarray(b, np.float64)
                    self._carried = draws[len(draws) - self._scheme.carried :]
                    left -= 1
                    if left % every == 0:
                        q[row], p[row] = self._q, self._p
                        row += 1
