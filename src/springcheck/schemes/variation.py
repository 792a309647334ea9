"""Rods beside changes of a motion: what derivatives of a step follow."""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.physics.arrays import Reals
from springcheck.physics.rods import Rods


class Variation(Rods):
    """The rods on states (1 + d, ..., n): the first is a motion, the others are changes of it.

    The change of a multiplier follows from the length that stays (implicit differentiation).
    """

    def __init__(self, rods: Rods) -> None:
        self.__dict__.update(rods.__dict__)

    def drifted(self, before: Reals, q: Reals, p: Reals, x: Any) -> tuple[Reals, Reals]:
        """As of `Rods`."""
        m, r, dr = self.m.astype(q.dtype), self.ways(before[0]), self.apart(before[1:])
        k = self.multiplier(r, self.ways(q[0]))
        push, turned = self._push(k, r), self._push(k, dr)
        s = self.ways(q[0] + push / m)
        lacks = self.dot(s, self.apart(q[1:] + turned / m))
        whole = np.concatenate([push[None], turned - self._push(self.solve(s, r, lacks), r)])
        return q + whole / m, p + whole / x

    def projected(self, q: Reals, p: Reals) -> Reals:
        """As of `Rods`."""
        m, r, dr = self.m.astype(q.dtype), self.ways(q[0]), self.apart(q[1:])
        k = self._along(r, p[0])
        first, change = p[0] - self._push(k, r), p[1:] - self._push(k, dr)
        lacks = self.dot(r, self.apart(change / m)) + self.dot(dr, self.apart(first / m))
        return np.concatenate([first[None], change - self._push(self.solve(r, r, lacks), r)])
