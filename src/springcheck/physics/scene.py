"""A scene: the particles, the terms of the Hamiltonian, the start, the time grid, and what is recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

from springcheck.arrays import Floats, Reals

Kind: TypeAlias = Literal["particles", "circuit", "rotor"]
Units: TypeAlias = Literal["reduced", "md", "si"]


class Term(Protocol):
    """One part of a scene's Hamiltonian, or of its friction: arrays of parameters and what they do."""

    @property
    def key(self) -> str:
        """The name of its table in a scene file."""
        ...

    @property
    def bodies(self) -> int:
        """1 where it acts on single particles `i`, 2 where it joins pairs `a`, `b`."""
        ...

    def energy(self, q: Reals) -> Reals:
        """Potential energy of states q (..., n) -> (...) [M L2/T2], 0 at the term's own rest."""
        ...

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        """Add the force at (q, p), each (..., n), to out (..., n) [M L/T2]."""
        ...

    def add_magnitude(self, q: Reals, p: Reals, out: Reals, near: Reals | None) -> None:
        """Add what bounds the rounding of add_force at states of sizes q, p (see `mechanics.magnitude`)."""
        ...

    def curvature(self, q: Reals) -> Reals:
        """Second derivative of each energy by its spring's elongation, at q (..., n) -> (..., s) [M/T2].

        A constant may come back as (s,).
        """
        ...

    @property
    def rigidity(self) -> Floats:
        """Its absolute value at the term's own rest (s,) [M/T2]: what errors of position are weighed by."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """What is to be simulated: a system, its start, its time grid, and what is asked of it."""

    name: str
    title: str
    source: str
    m: Floats
    q: Floats
    p: Floats
    terms: tuple[Term, ...]
    step: float
    steps: int
    every: int = 1
    tolerance: float = 1e-12
    units: Units = "reduced"
    kind: Kind = "particles"
    include: tuple[str, ...] = ("*",)
    quantities: tuple[str, ...] = ("q", "p", "energy")
    text: str = ""

    @property
    def n(self) -> int:
        """Number of particles."""
        return len(self.m)

    @property
    def frames(self) -> int:
        """Number of recorded states, the start among them."""
        return self.steps // self.every + 1
