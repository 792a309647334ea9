"""The fields of a scene, and counts of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.bath import Bath
from springcheck.physics.term import FrozenArrays, Term

Kind: TypeAlias = Literal["particles", "circuit"]
Units: TypeAlias = Literal["reduced", "md", "si"]
Quantity: TypeAlias = Literal["q", "p", "energy"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False, init=False)
class SceneFields(FrozenArrays):
    """The fields of a `Scene`, unchecked: only a `Scene` validates them and derives quantities from them."""

    m: Floats
    """Masses, > 0 (n,) [M]."""
    q: Floats
    """Initial positions (n,) [L]."""
    p: Floats
    """Initial momenta (n,) [M L/T]."""
    places: Integers | None = None
    """Index of each coordinate among x, y and z of all particles (n,): 3 particle + axis; None if each
    particle moves along x only."""
    terms: tuple[Term, ...] = ()
    """One of each kind, in the order of `terms.known`; terms of one kind are joined."""
    step: float
    """Step [T], < 0 for a run backwards in time."""
    steps: int
    every: int = 1
    """Number of steps between recorded frames; it divides `steps`."""
    bath: Bath | None = None
    """The heat bath, which random methods require, or None."""
    tolerance: float = 1e-12
    """Relative tolerance per step of adaptive solvers."""
    units: Units = "reduced"
    kind: Kind = "particles"
    include: tuple[str, ...] = ("*",)
    """Labels or globs of the methods to run."""
    quantities: tuple[str, ...] = ("q", "p", "energy")
    """Recorded quantities: q and p, and the energy unless it is left out."""
    name: str = "scene"
    title: str = ""
    source: str = ""

    @property
    def n(self) -> int:
        """Number of coordinates: of particles, where each moves along one axis."""
        return len(self.m)

    @property
    def particles(self) -> int:
        """Number of particles."""
        return self.n if self.places is None else int(np.max(self.places)) // 3 + 1

    @property
    def size(self) -> str:
        """Number of particles, and the axes along which they move where that is not x, in words."""
        particles = f"{self.particles} particle{'s' if self.particles != 1 else ''}"
        along = ", ".join(self.axes[:-1]) + " and " * (len(self.axes) > 1) + self.axes[-1]
        return particles if self.places is None else f"{particles} along {along}"

    @property
    def stepping(self) -> str:
        """Number and length of the steps, with the unit of time, in words."""
        unit = {"reduced": "", "md": " ps", "si": " s"}[self.units]
        return f"{self.steps} step{'s' if self.steps != 1 else ''} of {self.step:g}{unit}"

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes, of x, y and z, along which something moves."""
        return ("x",) if self.places is None else tuple("xyz"[i] for i in np.unique(self.places % 3))

    @property
    def all_places(self) -> Integers:
        """Position of each coordinate (n,), as `places`, also where these are left out."""
        return 3 * np.arange(self.n) if self.places is None else self.places

    @property
    def masses(self) -> Floats:
        """The mass of each particle (particles,) [M]."""
        found = np.empty(self.particles)
        found[self.all_places // 3] = self.m
        return found

    @property
    def where(self) -> slice | Integers:
        """The coordinates among x, y and z of all particles, as an index of an array (3 particles,)."""
        return slice(0, 3 * self.n, 3) if self.places is None else self.places

    @cached_property
    def elsewhere(self) -> NDArray[np.bool_]:
        """Which of x, y and z of all particles (3 particles,) are no coordinates of the scene."""
        left = np.ones(3 * self.particles, dtype=bool)
        left[self.where] = False
        return left

    @property
    def frames(self) -> int:
        """Number of recorded states, the start among them."""
        return self.steps // self.every + 1

    @property
    def thermal(self) -> float:
        """The thermal energy kT of the bath [M L2/T2]; 0 without one."""
        return self.bath.thermal(self.units) if self.bath else 0.0

    def derived(self, **changes: Any) -> Self:
        """Like `replace`, for numbers that derive from a scene's own and are not checked again.

        They may be inf, where an engine of single precision would store them so.
        """
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__getstate__(), **changes)
        return twin
