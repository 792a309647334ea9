"""A bond in space: a spring between two particles whose energy depends on their distance alone.

It has a row for each axis, and the rows of one bond share its number.  With d the vector between its ends, s
its length and e = d/s, its force is k (s - rest) e, and the matrix of second derivatives k (1 - rest/s) + k
rest/s e e'.  It is nonlinear except for motion along its direction.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.term import Column, LinearLaw, Term


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialSpring(LinearLaw, Term):
    """Bonds between particles, a row for each axis: V = k/2 (|q[b] - q[a]| - rest)**2.  k [M/T2], rest [L].
    Rows of one bond stand together and have one number."""

    key: ClassVar[str] = "bond"
    formula: ClassVar[str] = "k/2 (|q[b] - q[a]| - rest)**2"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("stiffness", "k"),
        Column("rest", "rest", 0.0, sign="nonnegative"),
        Column("number", "number", single=False),
    )
    ends: ClassVar[tuple[str, ...]] = ("a", "b")
    shared: ClassVar[str] = "number"
    a: Integers
    b: Integers
    k: Floats
    rest: Floats
    number: Floats

    @cached_property
    def _starts(self) -> Integers:
        """The first row of each bond."""
        return np.flatnonzero(np.diff(self.groups, prepend=-1))

    def _sum(self, values: Reals) -> Reals:
        """Sums over the axes of each bond, for each of its rows (..., s)."""
        return np.take(np.add.reduceat(values, self._starts, axis=-1), self.groups, axis=-1)

    def _vectors(self, q: Reals) -> tuple[Reals, Reals]:
        """Vector between the ends, and its length, for each axis (..., s)."""
        d = self.stretch(q)
        s = np.sqrt(self._sum(d * d))
        # a length of 0 has no direction, and d is 0 there
        return d, np.where(s > 0, s, np.finfo(q.dtype).tiny)

    def energies(self, q: Reals) -> Reals:
        # the energy of a bond is no sum over its axes: its first row has all of it
        s, first = np.sqrt(self._sum(self.stretch(q) ** 2)), np.diff(self.groups, prepend=-1) > 0
        return np.where(first, 0.5 * (self.k * (s - self.rest) * (s - self.rest)), 0.0)

    def pull(self, q: Reals) -> Reals:
        d, s = self._vectors(q)
        return np.asarray(self.k * (s - self.rest) * (d / s))

    def add_change(self, q: Reals, v: Reals, dq: Reals, dv: Reals, out: Reals) -> None:
        d, s = self._vectors(q)
        e, moved = d / s, self.stretch(dq)
        along = e * self._sum(e * moved)
        self.add_pull(self.k * (moved - self.rest / s * (moved - along)), out)

    def curvature(self, q: Reals) -> Reals:
        """Upper bound on each row's absolute curvatures, summed over the axes, for Gershgorin's bound."""
        _, s = self._vectors(q)
        bent = self.rest / s
        return np.asarray(np.abs(self.k) * (np.abs(1 - bent) + np.sqrt(3.0) * bent))

    def elements(self, q: Reals) -> Iterator[tuple[Integers, Integers, Reals]]:
        d, s = self._vectors(q)
        # each row beside all rows of its bond, without a matrix of all rows
        each = np.bincount(self.groups)[self.groups]
        one = np.repeat(np.arange(len(self)), each)
        other = np.repeat(self._starts[self.groups] + each - np.cumsum(each), each) + np.arange(len(one))
        bent, e = (self.rest / s)[..., one], d / s
        k = self.k[one] * ((1 - bent) * (one == other) + bent * e[..., one] * e[..., other])
        for here in self.particles:
            for there in self.particles:
                yield here[one], there[other], k if here is there else -k

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        size = self.most_stretch(np.abs(q))
        d, s = self._vectors(q if near is None else near)
        e, bent = np.abs(d) / s, self.rest / s
        # roundings of the difference vector, of its length by a root, of their quotient, of the products
        way = np.abs(1 - bent) * size + bent * (size + e * self._sum(e * size))
        return np.abs(self.k) * (way + np.abs(d) * (2 * np.abs(1 - bent) + 4 * (1 + bent)))

    def joined(self, other: Self) -> Self:
        more = other._changed(number=other.number + np.max(self.number) + 1 - np.min(other.number))
        return Term.joined(self, more)

    def tiled(self, copies: int, n: int) -> Self:
        made = Term.tiled(self, copies, n)
        apart = np.max(self.number) - np.min(self.number) + 1
        return made._changed(number=made.number + apart * np.repeat(np.arange(copies), len(self)))
