"""A magnetic field on a charge, or the Coriolis force: perpendicular to the velocity, in a plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.term import Column, Origin, WithoutPotential


@dataclass(frozen=True, kw_only=True, eq=False)
class Magnetic(WithoutPotential):
    """A force strength (v_b, -v_a) in the plane of the coordinates a and b of one particle.

    strength [M/T]: charge times field, along z where a is x and b is y; for Coriolis' force 2 m Omega.  It
    does no work.
    """

    key: ClassVar[str] = "magnetic"
    formula: ClassVar[str] = "force strength (v_y, -v_x)"
    columns: ClassVar[tuple[Column, ...]] = (Column("strength", "strength", single=False),)
    ends: ClassVar[tuple[str, ...]] = ("a", "b")
    kind: ClassVar[Origin] = "magnetic"
    a: Integers
    b: Integers
    strength: Floats

    def add_force(self, q: Reals, v: Reals, out: Reals) -> None:
        one, other = (np.take(v, index, axis=-1) for index in self.particles)
        self._add(out, self.strength * other, -self.strength * one)

    def add_rounding(self, q: Reals, v: Reals, out: Reals, near: Reals | None, exact: bool) -> None:
        one, other = (np.abs(np.take(v, index, axis=-1) * self.strength) for index in self.particles)
        self._add(out, other, one)

    def _add(self, out: Reals, *pushes: Reals) -> None:
        for index, push in zip(self.particles, pushes, strict=True):
            where: Any = (..., index)
            np.add.at(out, where, push)

    def by_velocity(self, m: Floats) -> Floats:
        """Derivatives of the force by the momenta (n, n) [1/T]."""
        out = np.zeros((len(m), len(m)))
        np.add.at(out, (self.a, self.b), self.strength / m[self.b])
        np.subtract.at(out, (self.b, self.a), self.strength / m[self.a])
        return out

    def turns(self, m: Floats) -> Floats:
        """Angular frequency at which the field alone rotates the velocity of each coordinate (n,) [1/T]."""
        out = np.zeros(len(m))
        for index in (self.a, self.b):
            np.add.at(out, index, np.abs(self.strength) / m[index])
        return out
