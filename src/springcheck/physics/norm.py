"""The size of an error: the square root of an energy, relative to the initial one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.errors import SpringcheckError
from springcheck.physics.arrays import Extended, Floats, Integers, Reals, in_pieces
from springcheck.physics.term import Term

SMALLEST_ENERGY = np.finfo(np.longdouble).tiny / np.finfo(np.longdouble).eps
"""Least energy whose terms, squares, lose no digits to underflow."""

WHOLE = 1e-12
"""Relative difference up to which the initial energy counts as the energy of the norm's unit."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Norm:
    """The size of a difference between states, relative to the initial energy norm.

    The square root of the sum of dp**2 / 2m and of |k| du**2 / 2 over the rows of all terms, u their
    elongation and |k| their absolute curvature at rest, divided by that of the kinetic plus the absolute
    potential energy of the start, or where that is 0 of the energy that it may gain (`System.gained`), or 1.
    For one spring it is the distance in the phase plane in units of the amplitude.  A free group's
    position has no potential energy: counted instead is the kinetic energy that moves its centre by the
    difference within the duration of the run.
    """

    m: Floats
    terms: Sequence[Term]
    stiffness: Sequence[Floats]
    """|k| of the rows of each term (s,); of a law without a rest that at the start."""
    groups: tuple[Integers, ...]
    duration: float
    unit: np.longdouble
    """The initial energy norm, a root of an energy."""
    of: str
    """Which energy that is; "" where the start has none and gains none, and the unit is 1."""

    def __call__(self, dq: Reals, dp: Reals) -> Floats:
        """(..., n) and (..., n) -> (...)."""
        size = self.size(dq, dp)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(np.where(size == 0, 0, size / self.unit), dtype=np.float64)

    def size(self, dq: Reals, dp: Reals) -> Extended:
        """The norm before division by the unit: a root of an energy, (..., n) and (..., n) -> (...)."""
        return self._root(dq, dp, lambda term, q: term.stretch(q))

    def most(self, of_q: Reals, of_p: Reals) -> Extended:
        """The largest `size` of differences bounded by these absolute values (...)."""
        return self._root(of_q, of_p, lambda term, q: term.most_stretch(q))

    def _root(self, dq: Reals, dp: Reals, stretch: Callable[[Term, Reals], Reals]) -> Extended:
        q, p = np.broadcast_arrays(np.asarray(dq, np.longdouble), np.asarray(dp, np.longdouble))
        with np.errstate(invalid="ignore", over="ignore"):
            energy = np.asarray(self._energy(q, p, stretch), np.longdouble)
            size = np.array(np.sqrt(energy))
            # squares out of range: scale the difference by a power of two, which is exact
            out = ~((energy > SMALLEST_ENERGY) & np.isfinite(energy))
            if np.any(out):
                power = np.frexp(np.max(np.maximum(np.abs(q[out]), np.abs(p[out])), axis=-1))[1]
                small_q, small_p = (np.ldexp(x[out], -power[..., None]) for x in (q, p))
                size[out] = np.ldexp(np.sqrt(self._energy(small_q, small_p, stretch)), power)
            return np.asarray(size)

    def _energy(self, dq: Reals, dp: Reals, stretch: Callable[[Term, Reals], Reals]) -> Reals:
        def whole(dq: Reals, dp: Reals) -> Reals:
            total = kinetic_energy(self.m, dp)
            for term, k in zip(self.terms, self.stiffness, strict=True):
                du = stretch(term, dq)
                total = total + 0.5 * np.sum(k * du * du, axis=-1)
            for group in self.groups:
                m = self.m[group]
                centre = np.sum(m * dq[..., group], axis=-1) / np.sum(m)
                total = total + 0.5 * np.sum(m) * (centre / self.duration) ** 2
            return np.asarray(total)

        return in_pieces(whole, max(map(len, self.terms), default=0))(dq, dp)


def kinetic_energy(m: Floats, p: Reals) -> Reals:
    """Sum of p**2 / 2m of momenta p (..., n) -> (...) [M L2/T2]."""
    # 2 m would overflow from half the largest number on
    return np.asarray(np.sum(0.5 * (p * p) / m, axis=-1))


def energy_scale(system: Any) -> tuple[np.longdouble, str]:
    """The energy to which differences of energies are relative, and its name, as `Norm` has it.

    That is the initial energy, unless potentials of both signs, or one and the kinetic energy, cancel in it:
    then it may be a rounding.
    """
    start, unit = system.energy(*(x.astype(np.longdouble) for x in (system.q, system.p))), system.norm.unit**2
    whole = abs(start - unit) <= WHOLE * unit
    return (np.longdouble(start), "initial energy") if whole else (unit, system.norm.of)


def energy_changes(run: Any) -> Floats:
    """Change of a trajectory's energy (f,), relative to the unit of its scene's norm, or else to |H0|.

    SpringcheckError where it was recorded without energies.
    """
    if run.energy is None:
        raise SpringcheckError(f"{run.label}: its scene keeps no energies (record.quantities)")
    scale = run.scene.system.norm.unit**2 if run.scene else abs(run.energy[0]) or 1.0
    return np.asarray((run.energy - run.energy[0]) / float(scale))
