"""Terms of a scene: springs, wells, pendulums, bonds and friction, each a frozen class of parameter arrays.

A formula is written once, for any width of float, and serves double and extended precision, one state and
a whole trajectory alike.  To add a term: write its class here with the columns of its table in a scene
file, put it into `TERMS`, and name its key in the methods of the engines that serve it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from springcheck.arrays import Floats, Integers, Reals
from springcheck.physics.scene import Term


@lru_cache(maxsize=64)
def _kind(index: bytes) -> str:
    """Whether an index array counts 0, 1, 2 ..., names particles once each, or repeats some."""
    numbers = np.frombuffer(index, dtype=np.int64)
    if np.array_equal(numbers, np.arange(len(numbers))):
        return "counting"
    return "distinct" if len(np.unique(numbers)) == len(numbers) else "repeated"


def gather(q: Reals, index: Integers) -> Reals:
    """Values (..., s) of q (..., n) at index (s,); q itself where that is all of it."""
    everything = len(index) == q.shape[-1] and _kind(index.tobytes()) == "counting"
    # take, because the layout of q[..., index] makes the order of a later sum depend on the number of states
    return q if everything else np.take(q, index, axis=-1)


def scatter(out: Reals, index: Integers, values: Reals) -> None:
    """Add values (..., s) to out (..., n) at index (s,), repeated indices included."""
    kind = _kind(index.tobytes())
    if kind == "counting" and len(index) == out.shape[-1]:
        out += values
    elif kind != "repeated":
        out[..., index] += values
    else:
        where: Any = (..., index)
        np.add.at(out, where, values)


@dataclass(frozen=True, slots=True)
class Column:
    """A parameter of a term: its name in a scene file, the field that takes it, and what it may be.

    The field takes the number as it stands, or its inverse.
    """

    name: str
    field: str
    default: float | None = None
    positive: bool = False
    inverse: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WallSpring:
    """Springs from particles i to fixed points: V = k/2 (q - at)**2.  k [M/T2], at [L]."""

    key: ClassVar[str] = "wall-spring"
    bodies: ClassVar[int] = 1
    columns: ClassVar[tuple[Column, ...]] = ()
    i: Integers
    k: Floats
    at: Floats
    fast: bool = False
    """Whether a method of multiple time steps takes these springs in its short step."""

    def energy(self, q: Reals) -> Reals:
        u = gather(q, self.i) - self.at
        return np.asarray(0.5 * np.sum(self.k * u * u, axis=-1))

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        scatter(out, self.i, -self.k * (gather(q, self.i) - self.at))

    def add_magnitude(self, q: Reals, p: Reals, out: Reals, near: Reals | None) -> None:
        scatter(out, self.i, np.abs(self.k) * (np.abs(gather(q, self.i)) + np.abs(self.at)))

    def curvature(self, q: Reals) -> Reals:
        return self.k

    @property
    def rigidity(self) -> Floats:
        return np.abs(self.k)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spring:
    """Springs between particles a and b: V = k/2 (q[b] - q[a] - rest)**2.  k [M/T2], rest [L]."""

    key: ClassVar[str] = "spring"
    bodies: ClassVar[int] = 2
    columns: ClassVar[tuple[Column, ...]] = ()
    a: Integers
    b: Integers
    k: Floats
    rest: Floats
    fast: bool = False
    """As in `WallSpring`."""

    def energy(self, q: Reals) -> Reals:
        u = gather(q, self.b) - gather(q, self.a) - self.rest
        return np.asarray(0.5 * np.sum(self.k * u * u, axis=-1))

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        tension = self.k * (gather(q, self.b) - gather(q, self.a) - self.rest)
        scatter(out, self.a, tension)
        scatter(out, self.b, -tension)

    def add_magnitude(self, q: Reals, p: Reals, out: Reals, near: Reals | None) -> None:
        size = np.abs(gather(q, self.b)) + np.abs(gather(q, self.a)) + np.abs(self.rest)
        scatter(out, self.a, np.abs(self.k) * size)
        scatter(out, self.b, np.abs(self.k) * size)

    def curvature(self, q: Reals) -> Reals:
        return self.k

    @property
    def rigidity(self) -> Floats:
        return np.abs(self.k)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quartic:
    """Stiffening wells of particles i: V = b/4 (q - at)**4.  b [M/(L2 T2)], at [L]."""

    key: ClassVar[str] = "quartic"
    bodies: ClassVar[int] = 1
    columns: ClassVar[tuple[Column, ...]] = (Column("coefficient", "b"), Column("at", "at", 0.0))
    i: Integers
    b: Floats
    at: Floats

    def energy(self, q: Reals) -> Reals:
        u = gather(q, self.i) - self.at
        return np.asarray(0.25 * np.sum(self.b * (u * u) * (u * u), axis=-1))

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        u = gather(q, self.i) - self.at
        scatter(out, self.i, -self.b * (u * u * u))

    def add_magnitude(self, q: Reals, p: Reals, out: Reals, near: Reals | None) -> None:
        # a relative error of u counts threefold in u**3
        size = np.abs(gather(q, self.i)) + np.abs(self.at)
        u = size if near is None else np.abs(gather(near, self.i) - self.at)
        scatter(out, self.i, 3 * np.abs(self.b) * u * u * size)

    def curvature(self, q: Reals) -> Reals:
        u = gather(q, self.i) - self.at
        return np.asarray(3 * self.b * u * u)

    @property
    def rigidity(self) -> Floats:
        return np.zeros_like(self.b)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cosine:
    """Pendulums: V = depth (1 - cos(wave (q - at))).  depth [M L2/T2], wave [1/L], at [L].

    For a pendulum depth is m g l and wave 1/l; for an angle and its angular momentum wave is 1.
    """

    key: ClassVar[str] = "cosine"
    bodies: ClassVar[int] = 1
    columns: ClassVar[tuple[Column, ...]] = (
        Column("depth", "depth"),
        Column("length", "wave", 1.0, positive=True, inverse=True),
        Column("at", "at", 0.0),
    )
    i: Integers
    depth: Floats
    wave: Floats
    at: Floats

    def energy(self, q: Reals) -> Reals:
        # 1 - cos without its cancellation at small angles
        half = np.sin(self.wave * (gather(q, self.i) - self.at) / 2)
        return np.asarray(2 * np.sum(self.depth * half * half, axis=-1))

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        angle = self.wave * (gather(q, self.i) - self.at)
        scatter(out, self.i, -(self.depth * self.wave) * np.sin(angle))

    def add_magnitude(self, q: Reals, p: Reals, out: Reals, near: Reals | None) -> None:
        # the sine's own rounding, and that of its argument, which turns round and round
        size = 1 + np.abs(self.wave) * (np.abs(gather(q, self.i)) + np.abs(self.at))
        scatter(out, self.i, np.abs(self.depth * self.wave) * size)

    def curvature(self, q: Reals) -> Reals:
        angle = self.wave * (gather(q, self.i) - self.at)
        return np.asarray(self.depth * self.wave**2 * np.cos(angle))

    @property
    def rigidity(self) -> Floats:
        return np.asarray(np.abs(self.depth) * self.wave**2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Morse:
    """Bonds between particles a and b: V = depth (1 - exp(-steepness (q[b] - q[a] - rest)))**2.

    depth [M L2/T2], steepness [1/L], rest [L].  P. M. Morse, Phys. Rev. 34 (1929) 57.
    """

    key: ClassVar[str] = "morse"
    bodies: ClassVar[int] = 2
    columns: ClassVar[tuple[Column, ...]] = (
        Column("depth", "depth", positive=True),
        Column("steepness", "steepness", positive=True),
        Column("rest", "rest"),
    )
    a: Integers
    b: Integers
    depth: Floats
    steepness: Floats
    rest: Floats

    def _gap(self, q: Reals) -> Reals:
        """1 - exp(-steepness u), without its cancellation at small u."""
        u = gather(q, self.b) - gather(q, self.a) - self.rest
        return np.asarray(-np.expm1(-self.steepness * u))

    def energy(self, q: Reals) -> Reals:
        gap = self._gap(q)
        return np.asarray(np.sum(self.depth * gap * gap, axis=-1))

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        gap = self._gap(q)
        tension = (2 * self.depth * self.steepness) * (1 - gap) * gap
        scatter(out, self.a, tension)
        scatter(out, self.b, -tension)

    def add_magnitude(self, q: Reals, p: Reals, out: Reals, near: Reals | None) -> None:
        # roundings of 1 - x, of x = exp(-steepness u) itself, and of u, which both factors feel
        size = gather(q, self.b) + gather(q, self.a) + np.abs(self.rest)
        x = np.exp(self.steepness * size) if near is None else 1 - self._gap(near)
        size = 2 * self.depth * self.steepness * x * (1 + x + np.abs(1 - 2 * x) * self.steepness * size)
        scatter(out, self.a, np.abs(size))
        scatter(out, self.b, np.abs(size))

    def curvature(self, q: Reals) -> Reals:
        x = 1 - self._gap(q)
        return np.asarray(2 * self.depth * self.steepness**2 * x * (2 * x - 1))

    @property
    def rigidity(self) -> Floats:
        return np.asarray(2 * np.abs(self.depth) * self.steepness**2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Damping:
    """Friction of particles i: force -c p/m.  c [M/T], m their masses [M]."""

    key: ClassVar[str] = "damping"
    bodies: ClassVar[int] = 1
    columns: ClassVar[tuple[Column, ...]] = ()
    i: Integers
    c: Floats
    m: Floats

    def energy(self, q: Reals) -> Reals:
        return np.zeros(q.shape[:-1], dtype=q.dtype)

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        scatter(out, self.i, -self.c * (p[..., self.i] / self.m))

    def add_magnitude(self, q: Reals, p: Reals, out: Reals, near: Reals | None) -> None:
        scatter(out, self.i, np.abs(self.c) * (np.abs(p[..., self.i]) / self.m))

    def curvature(self, q: Reals) -> Reals:
        return np.zeros_like(self.c)

    @property
    def rigidity(self) -> Floats:
        return np.zeros_like(self.c)


TERMS: tuple[type[Any], ...] = (WallSpring, Spring, Quartic, Cosine, Morse, Damping)
LINEAR = frozenset({"wall-spring", "spring", "damping"})


def _ends(term: Term) -> tuple[str, ...]:
    return ("i",) if term.bodies == 1 else ("a", "b")


def particles(term: Term) -> tuple[Integers, ...]:
    """The particles on which a term acts: (i,), or both ends (a, b) of its bonds."""
    return tuple(getattr(term, name) for name in _ends(term))


def apart(term: Any, q: Reals) -> tuple[Term, Reals]:
    """The term with ends of its own for each of its springs, and where these are at q (..., n)."""
    ends = particles(term)
    own = np.arange(len(ends) * len(ends[0])).reshape(len(ends), -1)
    where = np.concatenate([gather(q, end) for end in ends], axis=-1)
    return replace(term, **dict(zip(_ends(term), own, strict=True))), where
