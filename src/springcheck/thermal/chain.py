"""Nose-Hoover chains: a bath of a few variables beside the motion, which no number of a generator enters.

Its momenta s (M,) [M L2/T] push one another and the first all momenta of the motion, by half steps there and
back and substeps whose weights sum to 1 (Martyna, Tuckerman, Tobias & Klein, Mol. Phys. 87 (1996) 1117):
s0' = 2K - N kT, s_j' = s_(j-1)**2/Q_(j-1) - kT, each slowed down by s_(j+1)/Q_(j+1), p' = -p s0/Q0, with
Q0 = N kT/gamma**2 and Q_j = kT/gamma**2.  Beside them run their places y, y' = s/Q, of the energy alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.physics.arrays import Extended

THIRD = 1 / (2 - 2 ** (1 / 3))
FOURTH = (THIRD, 1 - 2 * THIRD, THIRD)
"""Weights of Suzuki and Yoshida's fourth order."""

_OUTER = (0.784513610477560, 0.235573213359357, -1.17767998417887)
SIXTH = (*_OUTER, 1.31518632068391, *_OUTER[::-1])
"""Weights of Yoshida's sixth order, solution A, to OpenMM's digits."""

PER_SUBSTEP = 12
"""Roundings of one variable in a substep: two exponentials, four products and two sums, and its own push."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """A chain: its number of links, and how a step of it is divided."""

    length: int = 3
    weights: tuple[float, ...] = (1.0,)
    times: int = 1
    """How often the weights are applied, each time to its part of the step."""
    least: float = 0.0
    """A kinetic energy [M L2/T2] below which the chain is not propagated."""
    three_each: bool = False
    """Whether it counts three degrees of freedom for each particle, along however many axes that moves."""

    def start(self) -> Extended:
        """Momenta, then places (2 M,), at rest."""
        return np.zeros(2 * self.length, np.longdouble)

    def masses(self, freedoms: int, thermal: Any, rate: Any) -> Extended:
        """Q (M,) [M L2]."""
        out = np.full(self.length, thermal / rate**2)
        out[0] *= freedoms
        return np.asarray(out)

    def swing(
        self, state: Any, twice: Any, x: Any, *, freedoms: int, thermal: Any, Q: Any
    ) -> tuple[Any, Any]:
        """The chain (2 M, ...) propagated for the time x beside twice the kinetic energy (...), and the
        factor of all momenta (...)."""
        M = self.length
        s, y, factor = list(state[:M]), list(state[M:]), twice * 0 + 1

        def push(j: int, d: Any) -> None:
            g = factor * factor * twice - freedoms * thermal if j == 0 else s[j - 1] ** 2 / Q[j - 1] - thermal
            slow = np.exp(-d / 4 * s[j + 1] / Q[j + 1]) if j < M - 1 else 1
            s[j] = (s[j] * slow + d / 2 * g) * slow

        for weight in self.weights * self.times:
            d = x * weight / self.times
            for j in reversed(range(M)):
                push(j, d)
            factor = factor * np.exp(-d * s[0] / Q[0])
            for j in range(M):
                y[j] = y[j] + d * s[j] / Q[j]
                push(j, d)
        after = np.stack([*s, *y])
        if self.least:
            rests = twice < 2 * self.least
            after, factor = np.where(rests, np.stack([*state]), after), np.where(rests, 1, factor)
        return after, factor

    def rounding(self, state: Any, twice: Any, x: Any, *, freedoms: int, thermal: Any, Q: Any) -> Any:
        """Bound on the rounding of each momentum in a propagation (M,), over the unit roundoff."""
        s = np.abs(state[: self.length])
        pushes = [twice + freedoms * thermal, *(s[:-1] ** 2 / Q[:-1] + thermal)]
        substeps = len(self.weights) * self.times
        long = abs(x) * sum(map(abs, self.weights))
        return PER_SUBSTEP * (substeps * s + long * np.array(pushes))
