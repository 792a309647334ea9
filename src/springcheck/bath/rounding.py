"""Rounding of one step of a random scheme: its running error bound, and the number of roundings."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from springcheck.bath.catalogue import Thermostat
from springcheck.bath.stepper import Stepper, forces
from springcheck.physics.arrays import Arithmetic, Extended, Force, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term

PER_ACT, IN_AND_OUT = 6, 4
"""Roundings of a stage at most (a force 4, its product and sum 2), and of the first and last state."""

SMALLEST = np.longdouble(np.finfo(np.float64).smallest_normal)
"""Loss of an operation to underflow: at rest at 0 nothing else rounds."""


def roundings_of(scheme: Thermostat) -> int:
    """Roundings along one step."""
    return IN_AND_OUT + PER_ACT * len(scheme.acts)


def one_rounding(
    scene: Scene, sizer: Stepper, start: tuple[Reals, Reals], draws: Sequence[Any], hit: Any,
    how: Arithmetic, rebuilt: bool,
) -> tuple[Extended, Extended]:  # fmt: skip
    """One rounding of the sum of absolute terms of a step, for q and for p (..., n)."""
    assert scene.bath is not None
    size, unit, x = np.abs(start[0]), how.state, scene.bath.friction * abs(scene.step)
    once, wide = unit * roundings_of(sizer.scheme), how.force / unit * (how.force > unit)
    fine: list[Reals] = []

    def pull(terms: Sequence[Term], *, first: bool) -> Force:
        plain, lost = scene.system.magnitude(terms=terms), how.quantum * scene.system.pulls(terms)

        def of(q: Reals, p: Reals) -> Reals:
            sizes = plain(q, p)
            if first:
                fine.append(sizes)
                return sizes
            # each term's force on a particle is truncated once in a kick, and lost below the quantum, no more
            bound = sizes + np.minimum(lost, sizes) / once
            return np.asarray(bound + wide * fine.pop(0)) if wide else bound

        return of

    # the error of a coarse force is no size of the next: sizes without it come first
    for first in [True, False] if wide else [False]:
        sizes = forces(scene.system, partial(pull, first=first))
        q, p = sizer(size, np.abs(start[1]), sizes, draws, hit)
    if cancels := max(how.cancels, sizer.scheme.cancels):
        # coefficients of all that is added to q, and of p
        lost = max(x, 1 / x) ** cancels
        q, p = q + lost * (q - size), p + lost * p
    if rebuilt:
        p = p + scene.m * q / abs(scene.step)
    half, carried = how.recorded(scene.m, scene.step, rebuilt), np.zeros(2)
    if np.any(half):
        # what decimals take off the state before, which the step carries on, and off this one
        near = None if scene.system.is_linear else start[0]
        plain = forces(scene.system, lambda terms: scene.system.magnitude(near, terms))
        off, none = (
            np.stack(sizer(size + x[0], np.abs(start[1]) + x[1], plain, draws, hit)) for x in (half, 0 * half)
        )
        written = half.reshape(2, *(1,) * (size.ndim - 1), -1)
        carried = (written + off - none) / roundings_of(sizer.scheme)
    return np.asarray(unit * q + SMALLEST + carried[0]), np.asarray(unit * p + SMALLEST + carried[1])
