"""A scene: the particles, the terms of the Hamiltonian, the start, the time grid, and what is recorded."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal, TypeAlias

from springcheck.arrays import Floats
from springcheck.physics.system import System
from springcheck.physics.term import Term

Kind: TypeAlias = Literal["particles", "circuit", "rotor"]
Units: TypeAlias = Literal["reduced", "md", "si"]


@dataclass(frozen=True, kw_only=True, eq=False)
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

    @cached_property
    def system(self) -> System:
        """What follows from the scene: forces, energies, modes and the like, each worked out once."""
        return System(self)

    def derived(self, **changes: Any) -> Scene:
        """Like `replace`, for numbers that follow from a scene's own and are not checked again.

        They may be inf, where an engine of single precision would keep them so.
        """
        twin = object.__new__(type(self))
        twin.__dict__.update({field.name: getattr(self, field.name) for field in fields(self)}, **changes)
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}
