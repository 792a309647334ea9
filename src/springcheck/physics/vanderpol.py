"""Van der Pol's friction: it amplifies small oscillations and damps large ones, towards a limit cycle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.term import Column, Origin, WithoutPotential


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
