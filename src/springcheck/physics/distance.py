"""Terms whose energy depends on the distance of two particles, or of a particle from a fixed point, in space.

Such a term has a row for each axis, and the rows of one pair share its `number`.  With d the vector between
the ends, u its length and e = d/u, the force is slope(u) e, and the matrix of second derivatives is
A + (second(u) - A) e e' with A = slope(u)/u.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import SceneError
from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.term import Column, Term

NUMBER = Column("number", "number", single=False)


class Distances(Term):
    """Rows (s,) for each axis of each distance: the common base of pairs and of fixed points."""

    is_by_axes: ClassVar[bool] = False
    number: Floats

    @cached_property
    def parameters(self) -> tuple[Floats, ...]:
        names = (c.field for c in self.columns if c.field not in (self.origin, "number"))
        return tuple(getattr(self, name) for name in names)

    @cached_property
    def _pair(self) -> Integers:
        """Index of the distance of each row."""
        return np.cumsum(np.append(0, np.diff(self.number) != 0))[: len(self)]

    @cached_property
    def firsts(self) -> Integers:
        """The first row of each distance."""
        return np.flatnonzero(np.diff(self._pair, prepend=-1))

    def _sum(self, values: Reals) -> Reals:
        """Sums over the axes of each distance, for each of its rows (..., s)."""
        return np.take(np.add.reduceat(values, self.firsts, axis=-1), self._pair, axis=-1)

    def _vectors(self, q: Reals) -> tuple[Reals, Reals]:
        """Vector between the ends, and its length, for each axis (..., s)."""
        d = self.elongation(q)
        u = np.sqrt(self._sum(d * d))
        # a length of 0 has no direction, and d is 0 there
        return d, np.where(u > 0, u, np.finfo(q.dtype).tiny)

    def _matrix(self, u: Reals) -> tuple[Reals, Reals]:
        """A and second - A (..., s)."""
        across = self.law("slope", u) / u
        return across, self.law("second", u) - across

    def lengths(self, q: Reals) -> Reals:
        """The distance of each row (..., s) [L]."""
        return np.sqrt(self._sum(self.elongation(q) ** 2))

    def check_start(self, q: Floats) -> None:
        """SceneError where a distance is 0 at q (n,), and the law is singular there."""
        u = self.lengths(q)
        with np.errstate(all="ignore"):
            singular = (u == 0) & ~np.isfinite(self.law("potential", u))
        if np.any(singular):
            row = int(np.argmax(singular))
            ends = " and ".join(str(index[row]) for index in self.particles)
            raise SceneError(
                f"{self.key}: the distance u at the start is 0 at coordinates {ends}, where its energy "
                f"{self.formula} is singular: move its ends apart"
            )

    def energies(self, q: Reals) -> Reals:
        # the energy is no sum over the axes: the first row has all of it
        first = np.diff(self._pair, prepend=-1) > 0
        return np.where(first, self.law("potential", self.lengths(q)), 0.0)

    def pull(self, q: Reals) -> Reals:
        d, u = self._vectors(q)
        return np.asarray(self.law("slope", u) * (d / u))

    def add_change(self, q: Reals, v: Reals, dq: Reals, dv: Reals, out: Reals) -> None:
        d, u = self._vectors(q)
        e, moved = d / u, self.stretch(dq)
        across, more = self._matrix(u)
        self.add_pull(across * moved + more * (e * self._sum(e * moved)), out)

    def curvature(self, q: Reals) -> Reals:
        """Upper bound on each row's absolute curvatures, summed over the axes, for Gershgorin's bound."""
        across, more = self._matrix(self._vectors(q)[1])
        return np.asarray(np.abs(across) + np.sqrt(3.0) * np.abs(more))

    @cached_property
    def rigidity(self) -> Floats:
        """At the rest length, where the term has one."""
        rest = getattr(self, "rest", np.zeros(len(self)))
        with np.errstate(all="ignore"):
            found = np.abs(self.law("second", rest)) + np.zeros(len(self))
        return np.where(np.isfinite(found), found, 0)

    def stiffness(self, q: Reals) -> Floats:
        """Without a rest length that of the start counts."""
        if hasattr(self, "rest"):
            return self.rigidity
        return np.asarray(
            np.max(np.abs([x + 0 * self.number for x in self._matrix(self._vectors(q)[1])]), axis=0)
        )

    @property
    def joins(self) -> NDArray[np.bool_]:
        return np.asarray(self.parameters[0] != 0)

    def elements(self, q: Reals) -> Iterator[tuple[Integers, Integers, Reals]]:
        d, u = self._vectors(q)
        # each row beside all rows of its distance, without a matrix of all rows
        each = np.bincount(self._pair)[self._pair]
        one = np.repeat(np.arange(len(self)), each)
        other = np.repeat(self.firsts[self._pair] + each - np.cumsum(each), each) + np.arange(len(one))
        e, (across, more) = d / u, self._matrix(u)
        k = across[..., one] * (one == other) + more[..., one] * e[..., one] * e[..., other]
        for here in self.particles:
            for there in self.particles:
                yield here[one], there[other], k if here is there else -k

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        size = self.most_stretch(np.abs(q))
        if self.origin:
            size = size + np.abs(getattr(self, self.origin))
        d, u = self._vectors(q if near is None else near)
        e, (across, more) = np.abs(d) / u, np.abs(self._matrix(u))
        # roundings of the difference vector, of its length by a root, of the law, and of the products
        own = np.abs(self.rounding(u, u, *self.parameters)) + 2 * u * across + 4 * u * more
        return np.asarray(across * size + more * (e * self._sum(e * size)) + e * own)

    def joined(self, other: Self) -> Self:
        more = other._changed(number=other.number + np.max(self.number) + 1 - np.min(other.number))
        return Term.joined(self, more)

    def tiled(self, copies: int, n: int) -> Self:
        made = Term.tiled(self, copies, n)
        apart = np.max(self.number) - np.min(self.number) + 1
        return made._changed(number=made.number + apart * np.repeat(np.arange(copies), len(self)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ToPoints(Distances):
    """A term on the distance of a particle from a fixed point, `at` on each axis [L]."""

    ends: ClassVar[tuple[str, ...]] = ("i",)
    origin: ClassVar[str] = "at"
    i: Integers
    at: Floats
    number: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class OnDistances(Distances):
    """A term on the distance u of two particles.

    A subclass gives `potential`, `slope` and `second` as functions of u and of its columns, and its `formula`
    as an expression in u and the fields that Python reads.  A column `rest` is its rest length.  Its twin
    `to_points` is the same law for the distance from a fixed point.
    """

    ends: ClassVar[tuple[str, ...]] = ("a", "b")
    to_points: ClassVar[type[ToPoints]]
    a: Integers
    b: Integers
    number: Floats

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        own = {name: x for name, x in vars(cls).items() if name not in ("__dict__", "__weakref__")}
        if "rounding" not in own:
            functions: Any = cls
            own["rounding"] = staticmethod(
                lambda size, u, *p: (
                    np.abs(functions.second(u, *p)) * size + 16 * np.abs(functions.slope(u, *p))
                )
            )
            cls.rounding = own["rounding"]
        given = {c.field: Floats for c in cls.columns}
        own |= {
            "columns": (*cls.columns, Column("at", "at", 0.0, single=False), NUMBER),
            "key": f"wall-{cls.key}", "__annotations__": {**given, "at": Floats, "number": Floats},
            "__qualname__": f"{cls.__qualname__}ToPoints",
        }  # fmt: skip
        cls.columns = (*cls.columns, NUMBER)
        name = f"{cls.__name__}ToPoints"
        twin: Any = dataclass(frozen=True, kw_only=True, eq=False)(type(name, (ToPoints,), own))
        cls.to_points = twin
        # found there when a term goes to another process
        if module := sys.modules.get(cls.__module__):
            setattr(module, name, twin)


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialSpring(OnDistances):
    """Bonds in any direction: V = k/2 (u - rest)**2, u the distance.  k [M/T2], rest [L]."""

    key: ClassVar[str] = "bond"
    formula: ClassVar[str] = "k/2*(u - rest)**2"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("stiffness", "k"),
        Column("rest", "rest", 0.0, sign="nonnegative"),
    )
    k: Floats
    rest: Floats

    potential: ClassVar[Any] = staticmethod(lambda u, k, rest: 0.5 * (k * (u - rest) * (u - rest)))
    slope: ClassVar[Any] = staticmethod(lambda u, k, rest: k * (u - rest))
    second: ClassVar[Any] = staticmethod(lambda u, k, rest: k + 0 * u)
    rounding: ClassVar[Any] = staticmethod(lambda size, u, k, rest: k * (size + rest))

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        size = self.most_stretch(np.abs(q))
        if self.origin:
            size = size + np.abs(getattr(self, self.origin))
        d, u = self._vectors(q if near is None else near)
        e, bent = np.abs(d) / u, self.rest / u
        # roundings of the difference vector, of its length by a root, of their quotient, of the products
        way = np.abs(1 - bent) * size + bent * (size + e * self._sum(e * size))
        return np.asarray(np.abs(self.k) * (way + np.abs(d) * (2 * np.abs(1 - bent) + 4 * (1 + bent))))


@dataclass(frozen=True, kw_only=True, eq=False)
class Kepler(OnDistances):
    """Attraction as the inverse square: V = -strength/u, u the distance.  strength [M L3/T2].

    Verlet's scheme conserves the angular momentum and turns an ellipse of eccentricity e backwards by
    (pi/8) (4 + e**2)/(1 - e**2)**3 (2 pi h/period)**2 in every orbit; the exact axis does not turn.
    """

    key: ClassVar[str] = "kepler"
    formula: ClassVar[str] = "-strength/u"
    columns: ClassVar[tuple[Column, ...]] = (Column("strength", "strength"),)
    strength: Floats

    potential: ClassVar[Any] = staticmethod(lambda u, strength: -strength / u)
    slope: ClassVar[Any] = staticmethod(lambda u, strength: strength / (u * u))
    second: ClassVar[Any] = staticmethod(lambda u, strength: -2 * strength / (u * u * u))


@dataclass(frozen=True, kw_only=True, eq=False)
class LennardJones(OnDistances):
    """V = 4 depth ((diameter/u)**12 - (diameter/u)**6), u the distance.  depth [M L2/T2], diameter [L].

    J. E. Lennard-Jones, Proc. R. Soc. A 106 (1924) 463; least at u = 2**(1/6) diameter.
    """

    key: ClassVar[str] = "lennard-jones"
    formula: ClassVar[str] = "4*depth*((diameter/u)**12 - (diameter/u)**6)"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("depth", "depth"),
        Column("diameter", "diameter", sign="positive"),
    )
    depth: Floats
    diameter: Floats

    @staticmethod
    def potential(u: Reals, depth: Floats, diameter: Floats) -> Any:
        x = (diameter / u) ** 2
        return 4 * depth * (x * x * x) * (x * x * x - 1)

    @staticmethod
    def slope(u: Reals, depth: Floats, diameter: Floats) -> Any:
        x = (diameter / u) ** 2
        return -24 * depth / u * (x * x * x) * (2 * (x * x * x) - 1)

    @staticmethod
    def second(u: Reals, depth: Floats, diameter: Floats) -> Any:
        x = (diameter / u) ** 2
        return 24 * depth / (u * u) * (x * x * x) * (26 * (x * x * x) - 7)


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialMorse(OnDistances):
    """Bonds in any direction: V = depth (1 - exp(-steepness (u - rest)))**2, u the distance.

    depth [M L2/T2], steepness [1/L], rest [L].  P. M. Morse, Phys. Rev. 34 (1929) 57.
    """

    key: ClassVar[str] = "radial-morse"
    formula: ClassVar[str] = "depth*(1 - exp(-steepness*(u - rest)))**2"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("depth", "depth", sign="positive"),
        Column("steepness", "steepness"),
        Column("rest", "rest", sign="nonnegative"),
    )
    depth: Floats
    steepness: Floats
    rest: Floats

    @staticmethod
    def potential(u: Reals, depth: Floats, steepness: Floats, rest: Floats) -> Any:
        gap = -np.expm1(-steepness * (u - rest))
        return depth * gap * gap

    @staticmethod
    def slope(u: Reals, depth: Floats, steepness: Floats, rest: Floats) -> Any:
        gap = -np.expm1(-steepness * (u - rest))
        return (2 * depth * steepness) * (1 - gap) * gap

    @staticmethod
    def second(u: Reals, depth: Floats, steepness: Floats, rest: Floats) -> Any:
        x = 1 + np.expm1(-steepness * (u - rest))
        return 2 * depth * steepness**2 * x * (2 * x - 1)
