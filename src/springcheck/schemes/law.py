"""The law of a scheme on a scene: one object to ask, whatever kind of scheme it is.

A step at any width, the propagator A of the normal modes, z' = A z, and the traits of scheme and scene
together: code asks for a trait, never for the name of a scheme or the way it is written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np

from springcheck.physics.arrays import Extended, Force, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.schemes.catalogue import Scheme
from springcheck.schemes.catalogue import Trait as OfScheme
from springcheck.schemes.linear import matrix
from springcheck.schemes.rounding import roundings
from springcheck.schemes.stepping import Slope, step

Trait: TypeAlias = OfScheme | Literal["undamped", "linear", "modes"]
"""A trait of a scheme, or of a scene: without friction; all forces linear; normal modes that decouple."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Law:
    """A scheme on a scene in steps of h [T]."""

    scheme: Scheme
    scene: Scene
    h: float

    @cached_property
    def traits(self) -> frozenset[Trait]:
        """The traits of the scheme, and those that the scene adds."""
        system = self.scene.system
        mixes = self.scheme.has("mixes") and any(term.kind == "potential" for term in system.slow)
        facts: dict[Trait, bool] = {
            "mixes": mixes,
            "undamped": not system.is_damped,
            "linear": system.is_linear,
            "modes": not mixes and system.has_modes,
        }
        return (self.scheme.traits - {"mixes"}) | {name for name, is_so in facts.items() if is_so}

    def has(self, *traits: Trait) -> bool:
        """Whether it has all of these traits."""
        return self.traits.issuperset(traits)

    @property
    def roundings(self) -> int:
        """Roundings along one step."""
        return roundings(self.scheme)

    @cached_property
    def rate(self) -> Extended | None:
        """Rates of friction (n,) [1/T], without what depends on the position; None where nothing is
        damped."""
        return self.scene.system.friction_rates if self.scene.system.is_damped else None

    def rates(self, *, varied: bool = False) -> Any:
        """Friction as a step takes it: rates, or where they depend on the position a function of the end Q
        and the start q of an implicit stage, (..., n) each.  It gives the rates at Q, their derivatives times
        Q - q, and what the changes of a motion lose next to the rates, all (..., n) [1/T], [1/T], [L/T]."""
        system = self.scene.system
        if not system.brakes_by_place:
            return self.rate

        def at(end: Reals, start: Reals) -> tuple[Reals, Reals, Reals]:
            rate, bend = system.friction_at(end[:1] if varied else end)
            lost = np.zeros_like(end)
            bent = bend * (end - start)[: len(bend)]
            if varied:
                lost[1:] = bent * end[1:]
            return rate, bent, lost

        return at

    @cached_property
    def stiffness(self) -> Any:
        """Second derivatives as an implicit step takes them: see `schemes.step`."""
        if not self.scheme.has("implicit"):
            return None
        system = self.scene.system
        return system.curvatures(self.scene.q) if system.is_linear else system.slope

    def step(
        self,
        q: Reals,
        p: Reals,
        *,
        near: Reals | None = None,
        forces: Callable[[Iterable[Term]], Force] | None = None,
        met: list[Reals] | None = None,
        slope: Slope | None = None,
        varied: bool = False,
    ) -> tuple[Reals, Reals]:
        """One step from states (..., n), in the width of q; `forces` makes the forces of terms.

        `slope` replaces the scene's own where the states are not positions; `varied`: all states but the
        first are variations of it.  For the other arguments see `schemes.step`.
        """
        system, forces = self.scene.system, forces or self.scene.system.force_of
        return step(
            self.scheme,
            q,
            p,
            h=self.h,
            m=self.scene.m,
            force=forces(self.scene.terms),
            parts=(forces(system.slow), forces(system.fast)),
            stiffness=slope if slope and callable(self.stiffness) else self.stiffness,
            rate=self.rates(varied=varied),
            met=met,
            near=near,
        )

    @cached_property
    def propagator(self) -> Extended:
        """One-step matrices A (n, 2, 2) of the modes, on (y, v).  For scenes that have the trait "modes"."""
        one, modes = np.ones(1, dtype=np.longdouble), self.scene.system.modes
        return matrix(self.scheme, h=self.h, m=one, k=modes.w2, c=modes.rate)
