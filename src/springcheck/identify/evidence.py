"""What an explanation of a misfit may look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from springcheck.identify.compare import compare
from springcheck.identify.fit import Map
from springcheck.identify.hypothesis import FEW, Match, Terms, distinct
from springcheck.identify.record import ROUNDING, Record
from springcheck.physics.arrays import Floats

FALLS = 12.0
"""Factor by which an explanation must bring the misfit down."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evidence:
    """What an explanation may look at: the worst oscillator's map, and what was stated of it."""

    record: Record
    j: int
    found: Map
    terms: Terms
    stiffness: float | None

    @property
    def pairs(self) -> int:
        return len(self.found.z) - 1

    @property
    def misses(self) -> Floats:
        """What the map leaves over in each pair (f - 1, 2), in units of the states' size."""
        return self.found.misses()

    @property
    def unit(self) -> Floats:
        """Rounding of each state (f - 1,): a few units in the last place, and half a quantum of the file."""
        z = np.abs(self.found.z.astype(np.float64))
        quanta = self.record.quanta(self.j) / self.found.size.astype(np.float64)
        size = (
            z[1:].max(axis=1)
            + z[:-1].max(axis=1)
            + 2 * float(np.max(np.abs(self.found.centre / self.found.size)))
        )
        # at rest in 0 nothing is rounded
        size = 8 * ROUNDING * size + quanta[1:].max(axis=1) + quanta[:-1].max(axis=1)
        return np.asarray(np.maximum(size, np.finfo(np.float64).tiny))


def matched(found: Map, terms: Terms) -> list[Match]:
    """The schemes of few steps that fit a map, the plainest first."""
    joints = compare([found], [terms], distinct(damped=False), FEW[:4])
    return [x.parts[0] for x in joints]


def distance(found: Map, m: Match) -> float:
    """Largest difference of an entry of the measured map from the predicted one."""
    return float(np.max(np.abs(found.entries.reshape(4).astype(np.float64) - np.array(m.predicted))))
