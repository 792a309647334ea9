"""The data that hypotheses and causes are tested on: maps of the oscillators, residuals of one map."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from springcheck.identify.compare import compare
from springcheck.identify.families import FAMILIES, Family
from springcheck.identify.fit import Map
from springcheck.identify.hypothesis import FEW, Joint, Match, Terms, distinct
from springcheck.identify.record import Record
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Floats

FALLS = 12.0
"""Factor by which a cause has to reduce the residuals."""

LEFT_BY_ROUNDING = 64
"""Largest residual of a step, in roundings of the state, that is arithmetic's."""

FIXED = LEFT_BY_ROUNDING * 2.0**-52
"""The same residual in double precision, relative to the state."""

SPARE = 6
"""Degrees of freedom of each row that a map of all coordinates has to leave."""

AGREES = 1e-6
"""Relative difference up to which a number from a map agrees with a known or stated one."""

SINGLE_ROOM = 8 * 2.0**-24
"""Relative difference of stiffnesses if step, mass and stiffness are rounded to single precision."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """The oscillators of a record that can be judged: their maps, terms of comparison, and what is stated."""

    record: Record
    moving: list[int]
    maps: list[Map]
    terms: list[Terms]
    stiffness: Floats | None
    """Stated, of each oscillator of the record (n,) [M/T2]."""
    friction: float | None
    """Stated c [M/T]."""
    stride: int | None
    """Steps to a frame by the stated step; -1 where it does not divide the interval."""
    notes: tuple[str, ...]
    """Remarks for the report."""

    def noting(self, *more: str) -> Measured:
        """Copy with further remarks."""
        return replace(self, notes=(*self.notes, *more))

    def compare(self, families: tuple[Family, ...], strides: Iterable[int]) -> list[Joint]:
        """Hypotheses that agree with all oscillators."""
        joints = compare(self.maps, self.terms, families, strides)
        return [x for x in joints if x.of_one_interval] if self.vague else joints

    def evidence(self, i: int) -> Evidence:
        """Evidence of one oscillator, by its index in `moving`."""
        j = self.moving[i]
        stiffness = None if self.stiffness is None else float(self.stiffness[j])
        return Evidence(
            record=self.record, j=j, found=self.maps[i], terms=self.terms[i], stiffness=stiffness,
            others=tuple(self.maps[:i] + self.maps[i + 1 :]),
        )  # fmt: skip

    @property
    def vague(self) -> bool:
        """Whether the maps show the interval more exactly than the times."""
        return any(x.vague for x in self.terms)

    def at_stated_times(self) -> Measured:
        """Copy whose interval is known."""
        known = [replace(x, vague=False, jitter=0.0) for x in self.terms]
        return replace(self, terms=known, record=replace(self.record, jitter=0.0))

    def step(self, joint: Joint) -> float:
        """The step [T], by the map where the times are vague."""
        longer = math.exp(-joint.parts[0].log_mass) if self.vague else 1.0
        return float(self.record.interval) * longer / joint.stride

    def numbers(
        self, chosen: Joint, law: str = ""
    ) -> tuple[tuple[float, ...], tuple[float, ...] | None, tuple[float, ...]]:
        """Frequency [1/T], stiffness [M/T2] and friction rate [1/T] by this law, of each oscillator."""
        h = self.step(chosen)
        family = FAMILIES[chosen.family]
        law = law or (family.laws[0] if family.laws else "")
        omega = tuple(math.sqrt(m.a) / abs(h) if m.a > 0 else math.nan for m in chosen.parts)
        inside = {"explicit", "implicit", "centred", "remembered"} & {kind for kind, _ in family.stages}
        scaled = bool(family.stages) and not inside
        friction = tuple((family.rate(law, m.friction) if scaled else m.friction) / h for m in chosen.parts)
        stiffness: tuple[float, ...] | None = None
        if self.record.mass is not None:
            masses = self.record.mass[self.moving].tolist()
            stiffness = tuple(mass * m.a / h**2 for mass, m in zip(masses, chosen.parts, strict=True))
        elif self.record.momenta:
            stiffness = tuple(math.exp(m.log_mass) * m.a / h**2 for m in chosen.parts)
        return omega, stiffness, friction

    def disagreements(
        self, joint: Joint, other: Floats | None = None, quantum: float = 0.0, room: float = 0.0
    ) -> list[str]:
        """Sentences on each stiffness that differs from the stated one, or from `other`, by more than six
        standard errors and rounding.

        Forces truncated to multiples of `quantum` bias it as well, by that share of the mean force.  A coarse
        file does not show whether h, m, h k or h/m were rounded to single precision.
        """
        stated, record = self.stiffness if other is None else other, self.record
        _, stiffness, _ = self.numbers(joint)
        assert stated is not None
        out = []
        for j, part, k in zip(self.moving, joint.parts, stiffness or (), strict=False):
            open_ = 2 * part.interval_room if self.vague else 2 * record.jitter
            error = part.a_room + open_ + 4 * FAMILIES[joint.family].path * ROUNDING + room
            error += 0.0 if record.fine else SINGLE_ROOM
            # a step or a mass in single precision moves the stiffness that is worked out with the stated one
            error += 0.0 if record.momenta or self.vague else 3 * abs(part.log_mass)
            if quantum:
                error += 2 * quantum * (1 + 1 / (abs(k) * float(np.sqrt(np.mean(record.q[:, j] ** 2)))))
            off = k / float(stated[j]) - 1 if stated[j] else math.inf
            if not abs(off) <= error:
                out.append(
                    f"the stated stiffness {stated[j]:.9g} does not fit: the states show {k:.9g} "
                    f"(relative difference {off:+.2e}, known to {error:.0e})"
                )
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """The residuals of one oscillator's map, and what is stated of that oscillator."""

    record: Record
    j: int
    found: Map
    terms: Terms
    stiffness: float | None
    others: tuple[Map, ...] = ()
    """Maps of the other oscillators."""

    @property
    def stated(self) -> float | None:
        """(w T)**2 of the stated stiffness, T between two frames; None where it or the mass is unknown."""
        if not self.stiffness or self.record.mass is None:
            return 0.0 if self.stiffness == 0 else None
        return self.stiffness / float(self.record.mass[self.j]) * float(self.record.interval) ** 2

    @property
    def pairs(self) -> int:
        return len(self.found.z) - 1

    @cached_property
    def states(self) -> Floats:
        """States (f, 2) about the equilibrium, in units of their size."""
        return self.found.z.astype(np.float64)

    @property
    def q(self) -> Floats:
        """Positions (f - 1,) at the beginning of each pair."""
        return np.asarray(self.states[:-1, 0])

    @property
    def v(self) -> Floats:
        """Velocities (f - 1,) at the beginning of each pair."""
        return np.asarray(self.states[:-1, 1])

    @property
    def size(self) -> float:
        """Root mean square residual of a frame, relative to the state."""
        return float(np.max(self.found.residual))

    @cached_property
    def residuals(self) -> Floats:
        """Residuals of the map (f - 1, 2), in units of the states' size."""
        return self.found.residuals()

    @cached_property
    def weight(self) -> Floats:
        """Weight (f - 1,) of each pair, inverse to its size, 1 at most."""
        return np.asarray(self.found.weight / np.max(self.found.weight))

    @cached_property
    def unit(self) -> Floats:
        """Rounding of each state (f - 1,): a few units in the last place, and half a quantum of the file."""
        z = np.abs(self.states)
        quanta = self.record.quanta(self.j) / self.found.size.astype(np.float64)
        size = (
            z[1:].max(axis=1)
            + z[:-1].max(axis=1)
            + 2 * float(np.max(np.abs(self.found.centre / self.found.size)))
        )
        # at rest in 0 nothing is rounded
        size = 8 * ROUNDING * size + quanta[1:].max(axis=1) + quanta[:-1].max(axis=1)
        return np.asarray(np.maximum(size, np.finfo(np.float64).tiny))

    def excess(self, found: Map) -> Floats:
        """Residual of each pair (f - 1,) of a map of this oscillator, in roundings."""
        return np.asarray(np.max(np.abs(found.residuals()), axis=1) / self.unit)

    @property
    def turns(self) -> float:
        """Turns of the motion over all frames."""
        return self.pairs * float(self.found.turn.angle[0]) / (2 * math.pi)

    @cached_property
    def linear(self) -> list[Floats]:
        """Columns of the map's regression: position, velocity, and the constant if one was fitted."""
        return [*self.states[:-1].T, *([np.ones(self.pairs)] if np.any(self.found.centre) else [])]


def matched(found: Map, terms: Terms) -> list[Match]:
    """Undamped schemes of up to four steps to a frame that fit a map, the simplest first."""
    joints = compare([found], [terms], distinct(damped=False), FEW[:4])
    return [x.parts[0] for x in joints]


def distance(found: Map, m: Match) -> float:
    """Largest difference of an entry of the measured map from the predicted one."""
    return float(np.max(np.abs(found.entries.reshape(4).astype(np.float64) - np.array(m.predicted))))
