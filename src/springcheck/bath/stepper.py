"""One step of any random scheme, by its stages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from springcheck.bath.catalogue import Thermostat, value_of
from springcheck.bath.decays import Decay
from springcheck.physics.arrays import Force, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.system import System
from springcheck.physics.term import Term


def forces(system: System[Any], of: Callable[[Sequence[Term]], Force] | None = None) -> Force:
    """The force of the potential terms of a system, as `of` makes it of terms."""
    of = of or system.force_of
    return of([term for term in system.terms if term.kind == "potential"])


class Stepper:
    """Steps of a random scheme: its coefficients are worked out once, in the width of its numbers.

    `rate` is the friction rate gamma [1/T], > 0; `thermal` is kT [M L2/T2].  With `absolute` every difference
    is a sum of sizes: a unit roundoff of these, times the roundings of a step, bounds its rounding.
    """

    @classmethod
    def of(cls, scheme: Thermostat, scene: Scene, *, width: Any = np.longdouble, **more: Any) -> Stepper:
        """The stepper of a scheme for a scene with a bath."""
        assert scene.bath is not None
        return cls(
            scheme, h=scene.step, m=scene.m, rate=scene.bath.friction, thermal=scene.thermal, width=width,
            **more,
        )  # fmt: skip

    def __init__(
        self, scheme: Thermostat, *, h: float, m: Reals, rate: Reals | float, thermal: float, width: Any,
        absolute: bool = False,
    ) -> None:  # fmt: skip
        self.scheme, self.h, self.m = scheme, width(h), np.asarray(m, width)
        x = np.asarray(self.h * width(rate), width)
        self.collision = np.asarray(-np.expm1(-x), np.float64)[()]
        size = np.sqrt(self.m * width(thermal))
        shot = np.sqrt(2 * x) * size
        sizes = {"noise": shot, "jump": self.h * (shot / self.m), "drift": self.h, "creep": self.h * self.h}
        moves = [act.kind in ("drift", "jump", "creep") for act in scheme.acts]
        self._moved = len(moves) - moves[::-1].index(True)
        self._acts, self._sign = [], 1 if absolute else -1
        for kind, part, number in scheme.acts:
            c = value_of(part, x)
            lost = part.lost(x) if isinstance(part, Decay) else 1 - c
            noise = np.sqrt(lost * part.both(x)) * size if isinstance(part, Decay) else size
            if kind in ("rescale", "scale"):
                noise = lost * width(thermal)
            if absolute and kind != "undamp":
                c = -np.abs(c) if kind == "damp" else np.abs(c)
            self._acts.append((kind, c * sizes.get(kind, 1), noise, number))

    def __call__(
        self, q: Reals, p: Reals, force: Any, draws: Sequence[Any], hit: Any = None, end: Reals | None = None,
    ) -> tuple[Reals, Reals]:  # fmt: skip
        """One step from (q, p), each (..., n), by what `forces` gives.

        `draws` are `scheme.draws` arrays of the shape of q; `hit` is the mask of collisions, or the factor
        of all momenta, otherwise computed from the draws.  A force after the last drift is evaluated at
        `end`, if given: draws of other particles act there.
        """
        m, h, last, q_old = self.m, self.h, p, q
        for i, (kind, c, noise, number) in enumerate(self._acts):
            if kind == "drift":
                q = q + c * (p / m)
            elif kind in ("kick", "held"):
                if kind != "held":
                    last = force(q if end is None or i < self._moved else end, np.zeros_like(p))
                p = p + (c * h) * last
            elif kind == "exchange":
                p = c * p + noise * draws[number]
            elif kind == "noise":
                p = p + c * draws[number]
            elif kind == "damp":
                p = p * (1 - c)
            elif kind == "undamp":
                p = p / (np.abs(1 + c) if self._sign > 0 else 1 + c)
            elif kind == "jump":
                q = q + c * draws[number]
            elif kind == "creep":
                q = q + c * force(q, np.zeros_like(p)) / m
            elif kind in ("rescale", "scale"):
                p = p * (self._factor(p, c, noise, draws[number], kind == "rescale") if hit is None else hit)
            elif kind == "rebuild":
                p = m * ((q + self._sign * q_old) / h)
            else:
                p = np.where(hit, noise * draws[number] + (self._sign > 0) * p, p)
        return q, p

    def _factor(self, p: Reals, c: Any, lost: Any, xi: Any, signed: bool) -> Any:
        """Factor of all momenta (..., 1), by a draw for each: Bussi & Parrinello 2008; `lost` is (1 - c)
        kT."""
        share = lost / np.sum(p * p / self.m, axis=-1, keepdims=True)
        first = xi[..., :1] + np.sqrt(c / share)
        size = np.sqrt(share * (first * first + np.sum(xi[..., 1:] ** 2, axis=-1, keepdims=True)))
        return np.where(first < 0, -size, size) if signed else size
