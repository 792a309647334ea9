"""Friction, or its opposite, below the noise of velocities that are rebuilt from positions.

An engine that takes its velocity from (x' - x)/h rounds it by eps x/h, which hides a friction of that size in
every single step.  The noise is effectively random and a friction is not: the residuals of the steps are
summed along the momenta, sum d p, where a friction c adds -c h p**2 at every step and the noise its standard
error.

Not so where positions are solved for, as implicit schemes do: the factors of the solver are rounded once, and
take eps x'/h from the velocity at every step alike, which no sum distinguishes from a friction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from springcheck.checks.case import Case
from springcheck.physics.arrays import Extended

BLOCKS = 16
"""Blocks of a run whose sums give the standard error: the noise of consecutive steps may be correlated."""

T_FIFTEEN = 7.98
"""Student's t of 15 degrees of freedom, two-sided 1e-6."""

FEWEST_STEPS = 8
"""Steps in a block, and periods in it of a rounding that recurs after a number of steps."""


def drag(case: Case, told: NDArray[np.bool_]) -> tuple[float, float, str] | None:
    """Sum of the residuals along the momenta, in allowances without rebuilt velocities, its bound, and both
    in words, for the particle farthest off; None where velocities are not rebuilt, or steps are few."""
    run, ahead = case.trajectory, case.ahead
    rebuilds = run.rebuilds_velocity and not run.arithmetic.keeps_displacement and case.law.has("explicit")
    if not rebuilds or ahead is None or np.count_nonzero(told) < BLOCKS * FEWEST_STEPS:
        return None
    plain = Case(trajectory=replace(run, rebuilds_velocity=False), scene=case.scene).ahead
    assert plain is not None
    p = run.p[:-1][told].astype(np.longdouble)
    lacks = (run.p[1:].astype(np.longdouble) - ahead.end[1])[told] * p
    size, unit = p * p, np.sum(np.abs(p) * plain.last[1][told], axis=0)
    rate = np.sum(lacks, axis=0) / np.sum(size, axis=0)
    # a uniform friction explains the blocks; the rest is noise
    rest = [np.sum(part, axis=0) for part in np.array_split(lacks - rate * size, BLOCKS)]
    error: Extended = np.sqrt(np.sum(np.square(rest), axis=0) * BLOCKS / (BLOCKS - 1))
    value, bound = np.abs(np.sum(lacks, axis=0)) / unit, case.roundings + T_FIFTEEN * error / unit
    known = np.isfinite(value) & np.isfinite(bound) & _is_irregular(case, len(p) // BLOCKS)
    if not np.any(known):
        return None
    worst = int(np.argmax(np.where(known, value / bound, -1)))
    interval = abs(run.step) * run.every
    said = (
        f"velocities are rebuilt from positions: along the momenta the steps gain "
        f"{float(rate[worst]) / interval:.2g} a unit of time, with a standard error of "
        f"{float(error[worst] / np.sum(size, axis=0)[worst]) / interval:.1g}"
    )
    return float(value[worst]), float(bound[worst]), said


def _is_irregular(case: Case, steps: int) -> NDArray[np.bool_]:
    """Whether the roundings of positions are effectively random within so many steps (n,).

    x' - 2x + x'' is a number of quanta of x, and h**2 a is rounded to it: what it loses comes back when h**2
    a has changed by a quantum.  Where that takes long it is no noise, and what is lost may be all of a force.
    """
    run, scene = case.trajectory, case.judged
    q = run.q.astype(np.longdouble)
    kicks = np.longdouble(run.step) ** 2 * scene.system.force(q, run.p.astype(np.longdouble)) / scene.m
    turned = np.median(np.abs(np.diff(kicks, axis=0)), axis=0) / run.every
    return np.asarray(turned * steps >= FEWEST_STEPS * 2.0**-52 * np.max(np.abs(run.q), axis=0))
