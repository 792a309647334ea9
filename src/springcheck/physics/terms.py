"""The terms: springs, quartic potentials, pendulums, Morse bonds, friction, fields, and driven terms.

To add one, write its class with its law in a file of your own and put `@register` before it: data/README.md
shows the ten lines.  A shipped one stands here, or in `distance.py`, and in `_KNOWN`, without `@register`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np

from springcheck.physics import termcheck
from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.distance import (
    Distances,
    Kepler,
    LennardJones,
    OnDistances,
    RadialMorse,
    RadialSpring,
    ToPoints,
)
from springcheck.physics.driven import Drive
from springcheck.physics.term import Column, LinearLaw, OnPairs, OnParticles, Origin, Term, WithoutPotential

__all__ = [
    "Column", "Cosine", "Damping", "Distances", "Drive", "Kepler", "LennardJones", "Morse", "OnDistances",
    "OnPairs", "OnParticles", "Quartic", "RadialMorse", "RadialSpring", "Spring", "Term", "ToPoints",
    "VanDerPol", "WallSpring", "Weight", "known", "register",
]  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class WallSpring(LinearLaw, OnParticles):
    """Springs from particles i to fixed points: V = k/2 (q - at)**2.  k [M/T2], at [L]."""

    key: ClassVar[str] = "wall-spring"
    formula: ClassVar[str] = "k/2 (q - at)**2"
    # a wall is a separate coordinate, which engines of single precision store like a position
    columns: ClassVar[tuple[Column, ...]] = (
        Column("stiffness", "k"),
        Column("wall", "at", 0.0, single=False),
    )
    is_linear: ClassVar[bool] = True
    k: Floats
    fast: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Spring(LinearLaw, OnPairs):
    """Springs between particles a and b: V = k/2 (q[b] - q[a] - rest)**2.  k [M/T2], rest [L]."""

    key: ClassVar[str] = "spring"
    formula: ClassVar[str] = "k/2 (q[b] - q[a] - rest)**2"
    columns: ClassVar[tuple[Column, ...]] = (Column("stiffness", "k"), Column("rest", "rest", 0.0))
    is_linear: ClassVar[bool] = True
    k: Floats
    fast: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Quartic(OnParticles):
    """Quartic potentials of particles i: V = b/4 (q - at)**4.  b [M/(L2 T2)], at [L]."""

    key: ClassVar[str] = "quartic"
    formula: ClassVar[str] = "b/4 (q - at)**4"
    columns: ClassVar[tuple[Column, ...]] = (Column("coefficient", "b"), Column("at", "at", 0.0))
    b: Floats

    potential: ClassVar[Any] = staticmethod(lambda u, b: 0.25 * (b * (u * u) * (u * u)))
    slope: ClassVar[Any] = staticmethod(lambda u, b: b * (u * u * u))
    second: ClassVar[Any] = staticmethod(lambda u, b: 3 * b * u * u)
    # a relative error of u is amplified threefold in u**3
    rounding: ClassVar[Any] = staticmethod(lambda size, u, b: 3 * np.abs(b) * u * u * size)


@dataclass(frozen=True, kw_only=True, eq=False)
class Cosine(OnParticles):
    """Pendulums: V = depth (1 - cos(wave (q - at))).  depth [M L2/T2], wave [1/L], at [L].

    For a pendulum depth is m g l and wave 1/l; for an angle and its angular momentum wave is 1.
    """

    key: ClassVar[str] = "cosine"
    formula: ClassVar[str] = "depth (1 - cos(wave (q - at)))"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("depth", "depth"),
        Column("wave", "wave", 1.0, sign="positive"),
        Column("at", "at", 0.0),
    )
    depth: Floats
    wave: Floats

    @staticmethod
    def potential(u: Reals, depth: Floats, wave: Floats) -> Reals:
        # 1 - cos without its cancellation at small angles
        half = np.sin(wave * u / 2)
        return 2 * (depth * half * half)

    slope: ClassVar[Any] = staticmethod(lambda u, depth, wave: (depth * wave) * np.sin(wave * u))
    second: ClassVar[Any] = staticmethod(lambda u, depth, wave: depth * wave**2 * np.cos(wave * u))

    @staticmethod
    def rounding(size: Reals, u: Reals, depth: Floats, wave: Floats) -> Reals:
        # the sine's own rounding, and that of its argument, which grows with the number of turns
        return np.abs(depth * wave) * (1 + np.abs(wave) * size)

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        """Many turns away the argument's rounding dominates, unless nothing is subtracted and the product
        with `wave` is exact."""
        whole = (self.at == 0) & (np.frexp(self.wave)[0] == 0.5)
        if near is None or not exact or not np.any(whole):
            return Term.pull_rounding(self, q, v, near, exact)
        size = np.where(whole, 0, np.abs(np.take(q, self.i, axis=-1)) + np.abs(self.at))
        return np.abs(self.rounding(size, self.elongation(near), self.depth, self.wave))


@dataclass(frozen=True, kw_only=True, eq=False)
class Weight(OnParticles):
    """Constant forces on particles i: V = -force (q - at), without equilibrium.  force [M L/T2], at [L]."""

    key: ClassVar[str] = "weight"
    formula: ClassVar[str] = "-force (q - at)"
    is_linear: ClassVar[bool] = True
    columns: ClassVar[tuple[Column, ...]] = (Column("force", "force"), Column("at", "at", 0.0))
    force: Floats

    potential: ClassVar[Any] = staticmethod(lambda u, force: -force * u)
    slope: ClassVar[Any] = staticmethod(lambda u, force: 0 * u - force)
    second: ClassVar[Any] = staticmethod(lambda u, force: 0 * u)
    rounding: ClassVar[Any] = staticmethod(lambda size, u, force: 0 * size + np.abs(force))


@dataclass(frozen=True, kw_only=True, eq=False)
class Morse(OnPairs):
    """Bonds between particles a and b: V = depth (1 - exp(-steepness (q[b] - q[a] - rest)))**2.

    depth [M L2/T2], steepness [1/L], rest [L].  P. M. Morse, Phys. Rev. 34 (1929) 57.
    """

    key: ClassVar[str] = "morse"
    formula: ClassVar[str] = "depth (1 - exp(-steepness (q[b] - q[a] - rest)))**2"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("depth", "depth", sign="positive"),
        Column("steepness", "steepness"),
        Column("rest", "rest"),
    )
    depth: Floats
    steepness: Floats

    @staticmethod
    def potential(u: Reals, depth: Floats, steepness: Floats) -> Reals:
        # 1 - exp(-steepness u), without its cancellation at small u
        gap = -np.expm1(-steepness * u)
        return np.asarray(depth * gap * gap)

    @staticmethod
    def slope(u: Reals, depth: Floats, steepness: Floats) -> Reals:
        gap = -np.expm1(-steepness * u)
        return np.asarray((2 * depth * steepness) * (1 - gap) * gap)

    @staticmethod
    def second(u: Reals, depth: Floats, steepness: Floats) -> Reals:
        x = 1 + np.expm1(-steepness * u)
        return np.asarray(2 * depth * steepness**2 * x * (2 * x - 1))

    @staticmethod
    def rounding(size: Reals, u: Reals, depth: Floats, steepness: Floats) -> Reals:
        # roundings of 1 - x, of x = exp(-steepness u), which may come from 1 - x, and of u, to which both are
        # sensitive
        x = 1 + np.expm1(-steepness * u)
        s = np.abs(steepness)
        return np.asarray(
            2 * depth * s * (x * (1 + x + np.abs(1 - 2 * x) * s * size) + np.maximum(1 - x, 0) ** 2)
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Damping(WithoutPotential):
    """Friction of particles i: force -c v, v their velocities.  c >= 0 [M/T]."""

    key: ClassVar[str] = "damping"
    formula: ClassVar[str] = "force -c p/m"
    columns: ClassVar[tuple[Column, ...]] = (Column("coefficient", "c", sign="nonnegative", single=False),)
    ends: ClassVar[tuple[str, ...]] = ("i",)
    is_linear: ClassVar[bool] = True
    kind: ClassVar[Origin] = "friction"
    i: Integers
    c: Floats

    # functions of the velocity, not of an elongation
    slope: ClassVar[Any] = staticmethod(LinearLaw.slope)
    rounding: ClassVar[Any] = staticmethod(LinearLaw.rounding)

    def add_force(self, q: Reals, v: Reals, out: Reals) -> None:
        Term.add_force(self, v, q, out)

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        return Term.pull_rounding(self, v, q, v, exact)


@dataclass(frozen=True, kw_only=True, eq=False)
class VanDerPol(WithoutPotential):
    """Position-dependent friction of particles i: force c (1 - ((q - at)/width)**2) v.

    c [M/T], width and at [L].  On a spring k, m q'' = c (1 - x**2) q' - k q has mu = c/sqrt(k m). B. van der
    Pol, Phil. Mag. 2 (1926) 978.
    """

    key: ClassVar[str] = "van-der-pol"
    formula: ClassVar[str] = "force c (1 - ((q - at)/width)**2) p/m"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("coefficient", "c", sign="nonnegative", single=False),
        Column("width", "width", 1.0, sign="positive", single=False),
        Column("at", "at", 0.0, single=False),
    )
    ends: ClassVar[tuple[str, ...]] = ("i",)
    kind: ClassVar[Origin] = "friction"
    i: Integers
    c: Floats
    width: Floats
    at: Floats

    def resistance(self, q: Reals) -> tuple[Reals, Reals]:
        """Friction coefficient of each row, and its derivative by q: (..., s) each [M/T], [M/(L T)]."""
        x = (np.take(q, self.i, axis=-1) - self.at) / self.width
        # (x - 1) (x + 1) keeps its digits where the friction changes its sign
        return np.asarray(self.c * ((x - 1) * (x + 1))), np.asarray(2 * self.c * x / self.width)

    def add_force(self, q: Reals, v: Reals, out: Reals) -> None:
        self.add_pull(self.resistance(q)[0] * np.take(v, self.i, axis=-1), out)

    def add_change(self, q: Reals, v: Reals, dq: Reals, dv: Reals, out: Reals) -> None:
        v, dq = (np.take(x, self.i, axis=-1) for x in (v, dq))
        self.add_pull(self.resistance(q)[1] * v * dq, out)

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        x = (np.abs(np.take(q if near is None else near, self.i, axis=-1)) + np.abs(self.at)) / self.width
        # a rounding of the position counts twice in its square
        return self.c * (1 + 3 * x * x) * np.abs(np.take(v, self.i, axis=-1))


_KNOWN: dict[str, type[Term]] = {
    term.key: term for term in (
        WallSpring, Spring, Quartic, Cosine, Weight, Morse, RadialSpring, Damping, VanDerPol, Drive,
        RadialSpring.to_points, *(
            each for pair in (Kepler, LennardJones, RadialMorse) for each in (pair, pair.to_points)
        ),
    )
}  # fmt: skip

T = TypeVar("T", bound=type[Term])


def register(term: T) -> T:
    """Class decorator that registers a term for scene files by its key; data/README.md has examples.

    Raises
    ------
    TypeError
        The class lacks a part, or its key is taken.
    ValueError
        The functions of its law are inconsistent, as those of a wrong derivative.
    """
    taken = _KNOWN.get(term.key)
    if taken is not None and (taken.__module__, taken.__qualname__) != (term.__module__, term.__qualname__):
        raise TypeError(f"{term.__name__}: the key {term.key!r} is taken by {taken.__name__}")
    termcheck.check(term)
    _KNOWN[term.key] = term
    if issubclass(term, OnDistances):
        _KNOWN[term.to_points.key] = term.to_points
    return term


def known() -> dict[str, type[Term]]:
    """The classes of terms by key, in the order in which a scene holds them."""
    return dict(_KNOWN)


def in_order(terms: Iterable[Term]) -> tuple[Term, ...]:
    """Terms as a scene holds them: one of each kind, in a fixed order, none without rows.

    Springs first, fast ones last among them, then the other potentials, then friction: forces are summed in
    this order, so that scenes of the same rows have bitwise the same motion.
    """
    known = list(_KNOWN)
    found: dict[tuple[type[Term], bool], Term] = {}
    for term in terms:
        if len(term):
            kind = (type(term), term.fast)
            found[kind] = found[kind].joined(term) if kind in found else term

    def place(term: Term) -> tuple[bool, bool, bool, int, str]:
        number = known.index(term.key) if term.key in known else len(known)
        is_spring = isinstance(term, WallSpring | Spring)
        return term.kind != "potential", not is_spring, term.fast, number, term.key

    return tuple(sorted(found.values(), key=place))
