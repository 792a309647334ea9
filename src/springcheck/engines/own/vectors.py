"""The same operations on whole arrays, for scenes with a term that the compiled loops do not have."""

from __future__ import annotations

import numpy as np

from springcheck.engines.own.kernels import DRIFT, EULER, FRICTION, KICK, KICK_DRIFT
from springcheck.engines.own.operations import Program, terms_of
from springcheck.physics.arrays import Floats, Force
from springcheck.physics.scene import Scene


class Vectors:
    """A scene carried through the explicit operations of a program, its forces those of its own terms."""

    def __init__(self, plan: Program, scene: Scene) -> None:
        self._plan = plan
        self._m = scene.m
        self._q, self._p = scene.q.astype(np.float64), scene.p.astype(np.float64)
        self._forces: list[Force] = [scene.system.force_of(terms_of(name, scene)) for name in plan.forces]
        self._kept: list[Floats | None] = [None, None]
        rates = scene.system.friction_rates.astype(np.float64)
        self._decays = [np.exp(-x * rates) for x in plan.decays]

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q and p (f, n)."""
        with np.errstate(all="ignore"):
            for row in range(len(q)):
                for _ in range(every):
                    if self._plan.b is None:
                        self._operations()
                    else:
                        self._tableau()
                q[row], p[row] = self._q, self._p

    def _operations(self) -> None:
        for o, slot in zip(self._plan.operations, self._plan.slots, strict=True):
            old = self._p
            if o.code == FRICTION:
                self._p = old * self._decays[slot]
            elif o.code != DRIFT:
                self._p = old + self._force(slot) * o.x
            if o.code in (DRIFT, KICK_DRIFT, EULER):
                self._q = self._q + ((old if o.code == EULER else self._p) / self._m) * o.y
            moved = o.code not in (FRICTION, KICK)
            damped = self._plan.damped
            self._kept = [None if moved or damped[i] else kept for i, kept in enumerate(self._kept)]

    def _force(self, slot: int) -> Floats:
        found = self._kept[slot]
        if found is None:
            found = self._kept[slot] = np.asarray(self._forces[slot](self._q, self._p), np.float64)
        return found

    def _tableau(self) -> None:
        a, b = self._plan.a, self._plan.b
        assert a is not None
        assert b is not None
        forces: list[Floats] = []
        velocities: list[Floats] = []
        for row in a:
            q, p = self._q, self._p
            for c, v, f in zip(row, velocities, forces, strict=False):
                if c:
                    q, p = q + c * v, p + c * f
            forces.append(np.asarray(self._forces[0](q, p), np.float64))
            velocities.append(p / self._m)
        for c, v, f in zip(b, velocities, forces, strict=True):
            if c:
                self._q, self._p = self._q + c * v, self._p + c * f
