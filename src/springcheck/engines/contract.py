"""The engine contract: what an engine declares, how its arithmetic rounds, and what a simulation does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from springcheck.arrays import Floats

ANY_POTENTIAL = "any potential"
"""Among the terms of a method: it takes the force of every potential as a function, whatever its law."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """A method that an engine can run, as the engine declares it without its library being imported."""

    engine: str
    name: str
    scheme: str
    about: str
    adaptive: bool = False
    terms: frozenset[str] = frozenset({"spring"})
    kinds: frozenset[str] = frozenset({"particles"})
    requires: frozenset[str] = frozenset()
    """What a scene must have for the method to be worth running: term keys, or "springs marked fast"."""
    rebuilds_velocity: bool = False
    """The velocity is a difference of positions over the step, which costs digits: eps q / h."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arithmetic:
    """How a platform rounds.  The defaults are IEEE double precision throughout."""

    name: str = "double"
    state: float = 2.0**-53
    """Unit roundoff of stored positions and momenta."""
    force: float = 2.0**-53
    """Unit roundoff of the force."""
    quantum: float = 0.0
    """Fixed-point unit of force [M L/T2]: each term's force on a particle is cut off to a multiple of it."""
    overflow: float = float("inf")
    """Largest force that the fixed-point sum holds."""
    parameters: Literal["double", "single"] = "double"
    """Width in which force constants and rest lengths are kept."""
    excess: float = 0.0
    """Every force is too large by this fraction."""
    keeps_displacement: bool = False
    """A velocity rebuilt over the step comes from the stored displacement, not from x' - x."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A method and where it runs: ``engine:method[@platform[-precision]]``."""

    engine: str
    method: str
    platform: str = ""
    precision: str = ""

    def __str__(self) -> str:
        place = "@" + self.platform if self.platform else ""
        return f"{self.engine}:{self.method}{place}{'-' + self.precision if self.precision else ''}"


class Simulation(Protocol):
    """A started engine.  It moves and does nothing else: the driver records, times and judges."""

    @property
    def force_calls(self) -> int:
        """Evaluations of the force so far, counted by us."""
        ...

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q and p (f, n): row i holds the state `every` steps after row i-1, both at the same time.

        An engine that stops by itself raises `Stopped`, with the rows before left filled.
        """
        ...


class Stopped(Exception):  # noqa: N818 - an outcome, not an error
    """An engine gave up: rows that it had filled, and what it said."""

    def __init__(self, rows: int, message: str) -> None:
        super().__init__(message)
        self.rows = rows
