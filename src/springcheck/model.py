"""The data that travels through springcheck: frozen, with units and shapes, without behaviour.

Glossary, used in every module:

=====  ==========================================================================================
q, p   positions and momenta, (n,) for one state, (f, n) for a trajectory   [L], [M L/T]
m, k   mass and stiffness                                                   [M], [M/T2]
h, t   step and time                                                        [T]
w      angular frequency; w2 its square; a = (h w)**2                       [1/T]
n      particles (degrees of freedom); every motion is along one line
f      frames, the recorded states of a trajectory; frame 0 is the start
=====  ==========================================================================================

[L], [M] and [T] are the units of the scene: nm, u and ps for "md", m, kg and s for "si", and bare
numbers for "reduced".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Extended: TypeAlias = NDArray[np.longdouble]
Reals: TypeAlias = NDArray[np.floating[Any]]
"""Real numbers of any width: what is computed comes back in the width that came in."""

Integers: TypeAlias = NDArray[np.int64]
Force: TypeAlias = Callable[[Reals, Reals], Reals]
"""(q, p), each (..., n) -> force on every particle (..., n) [M L/T2]."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a run ended.  Nothing that is not `complete` passes for a result."""

    status: Literal["complete", "diverged", "stopped", "interrupted"]
    step: int
    """Steps done with finite numbers."""
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Seconds of wall clock: `start` until the engine stands ready, `run` inside `advance` alone."""

    start: float
    run: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Recorded states of one run: row i of q and p belongs to t[i]; row 0 is the start."""

    label: str
    scheme: str
    t: Floats
    q: Floats
    p: Floats
    step: float
    every: int
    outcome: Outcome
    timing: Timing
    force_calls: int
    tolerance: float | None = None
    """Relative tolerance per step; None for a method of fixed step."""
    energy: Floats | None = None
    """Total energy of each frame, (f,) [M L2/T2]; None where the scene asks for none."""
    arithmetic: Arithmetic = field(default_factory=Arithmetic)
    rebuilds_velocity: bool = False
    off_axis: float | None = None
    """Largest |y| or |z| seen, for engines in three dimensions."""
    origin: Mapping[str, str] = field(default_factory=dict)
    """Versions, platform, velocity convention and the like: what a reader needs to repeat the run."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """Largest difference of each pair of trajectories over all frames, (l, l), symmetric.

    In units of the start (`mechanics.Norm`); NaN where one of the two runs did not complete.
    """

    labels: tuple[str, ...]
    max_difference: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One number against one bound.  `passed` is None where the check does not apply."""

    method: str
    check: str
    value: float
    bound: float
    unit: str
    passed: bool | None
    why: str
    """The bound's reason, or why the check does not apply."""
