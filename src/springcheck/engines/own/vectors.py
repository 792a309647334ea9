"""Any scheme of fixed step by NumPy, where the compiled loops have not all of its stages or of its terms.

A clock among the particles, which a force that depends on the time needs, is set to i h before step i, as the
loops set it: the stages move it from there, and no rounding of the sum of all steps is in it.
"""

from __future__ import annotations

import numpy as np

from springcheck import schemes
from springcheck.physics.arrays import Floats, Force, Reals
from springcheck.physics.scene import Scene
from springcheck.schemes import Law, Scheme


class Vectors:
    """A scene carried through the steps of a scheme, its forces those of its own terms."""

    def __init__(self, scheme: Scheme, scene: Scene, step: float) -> None:
        self._n, self._done = scene.n, 0
        scene = scene.system.clocked
        system = scene.system
        self._scheme, self._h, self._m = scheme, step, scene.m
        self._q, self._p = scene.q.astype(np.float64), scene.p.astype(np.float64)
        self._law = Law(scheme=scheme, scene=scene, h=step)
        self._rates = self._law.rates()
        self._force = kept(system.force, system.is_damped)
        slow, fast = system.force_of(system.slow), system.force_of(system.fast)
        self._parts = kept(slow, system.is_damped), kept(fast, False)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q and p (f, n)."""
        with np.errstate(all="ignore"):
            for row in range(len(q)):
                for _ in range(every):
                    self._q[self._n :] = self._done * self._h
                    self._done += 1
                    a, b = schemes.step(
                        self._scheme, self._q, self._p, h=self._h, m=self._m, force=self._force,
                        rate=self._rates, parts=self._parts, stiffness=self._law.stiffness,
                    )  # fmt: skip
                    self._q, self._p = np.asarray(a, np.float64), np.asarray(b, np.float64)
                q[row], p[row] = self._q[: self._n], self._p[: self._n]


def kept(force: Force, damped: bool) -> Force:
    """A force that is evaluated again only when the state that it depends on has changed."""
    last: list[Reals] = []

    def again(q: Reals, p: Reals) -> Reals:
        if not last or last[0] is not q or (damped and not np.array_equal(last[1], p)):
            last[:] = q, p, force(q, p)
        return last[2]

    return again
