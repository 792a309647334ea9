"""Causes that states with rods, or in a bath, show where they are not the scheme's.

The impulse along a rod is the difference of a step from the same step without rods: its direction follows
from the positions.  The effect of a bath is in the draws that the states imply, and in their size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from springcheck.checks import driven, other
from springcheck.checks.case import Case
from springcheck.checks.requires import MAP, missing
from springcheck.checks.steps import step_defect
from springcheck.checks.thermal import reading
from springcheck.physics.arrays import Floats, Reals
from springcheck.thermal import THERMOSTATS
from springcheck.thermal.catalogue import ENERGY_LEFT

PUSH_ROUNDINGS = 64
"""Roundings of the positions whose difference is an impulse: of a free step, and of the frame as recorded."""

STANDARD_ERRORS = 6.0
"""Standard errors by which a size differs from another: a chance of 2e-9 for normal numbers."""

FEWEST_DRAWS = 50
"""Draws from which a size is reported: its standard error is a tenth then."""

FIT_ROUNDS = 20
"""Iterations of a fit whose weights are its own variances."""

DIFFERENCE_ROUNDINGS = 4
"""Roundings of a velocity and of the difference in it: of a product, a quotient, a kick, recording."""

SAME_DRAWS = 1e-6
"""Relative difference up to which two draws count as one number."""


@np.errstate(all="ignore")
def found(case: Case, shown: Callable[[], str] = str) -> str:
    """The cause in one sentence, or "" where nothing known here, nor what the states show, explains them."""
    run, system = case.trajectory, case.scene.system
    ways: list[Callable[[Case], str]] = []
    if run.every == 1 and run.scheme in THERMOSTATS:
        ways = [_of_bath]
    elif run.every == 1 and not missing(case, MAP):
        ways = [_of_differences, driven.found, _of_rods]
    # of one particle by itself states show more than which number is another
    looks: list[Callable[[Case], str]] = [lambda case: shown(), other.found]
    ways += looks if system.is_linear and system.is_separate else reversed(looks)
    return next(filter(None, (way(case) for way in ways)), "")


def _of_differences(case: Case) -> str:
    """Velocities that are differences of the positions, where every step is right to what those keep."""
    run, m = case.trajectory, case.judged.m
    for more, n, kick in (("", 1, 0.0), (" over two steps", 2, 0.0), (" and half a kick", 1, 0.5)):
        q, p = (x[1 : len(x) - n + 1] for x in (run.q, run.p))
        made = m * (run.q[n:] - run.q[:-n]) / (n * run.step)
        right, size = made + kick * run.step * case.system.force(q, p), np.abs(p) + np.abs(made)
        if rods := case.system.rods:
            right, size = rods.projected(q, right), np.max(size, axis=1, keepdims=True)
        # and those of decimals, of the positions that are subtracted too
        half = run.arithmetic.recorded(m, n * run.step, True)[1]
        off = (np.abs(p - right) - half) / (DIFFERENCE_ROUNDINGS * run.arithmetic.state)
        are = not run.rebuilds_velocity and np.all(off <= size)
        if are and step_defect(replace(case, trajectory=replace(run, rebuilds_velocity=True))).passed:
            return (
                f"velocities are differences of the positions{more}, which keep eps q/h of them, and each "
                "step is right to that: judge it with --differences (in Python: rebuilds_velocity=True)"
            )
    return ""


def _of_rods(case: Case) -> str:
    """The direction of the impulses along rods, where it is not that of the rods before the drift."""
    rods, run = case.system.rods, case.trajectory
    drifts = [kind for kind in case.scheme.kinds if kind.drifts]
    if rods is None or rods.share or len(run.t) < 3 or len(drifts) != 1:
        return ""
    scene = case.judged
    free = scene.derived(terms=tuple(x for x in scene.terms if x.kind != "constraint"))
    q, p = (x[:-1].astype(np.longdouble) for x in (run.q, run.p))
    loose = Case(trajectory=run, scene=free).step(q, p)[0]
    push, noise = run.q[1:] - loose, 2.0**-53 * (np.abs(run.q[1:]) + np.abs(loose))
    moved = rods.apart(push)
    allowed = PUSH_ROUNDINGS * rods.spans(noise)

    def along(way: Reals) -> bool:
        part = rods.each(rods.dot(moved, way) / rods.dot(way, way)) * way
        off = np.sqrt(rods.dot(moved - part, moved - part))
        return bool(np.all(off[1:] <= allowed[1:]))

    ways = rods.ways(q)
    if np.all(np.sqrt(rods.dot(moved, moved)) <= allowed) or along(ways):
        return ""
    if along(rods.ways(loose)):
        return (
            "SHAKE pushes the ends of a rod along it as it lies after the drift, where "
            f"{case.scheme.title} takes it as it lay before"
        )
    if along(np.concatenate([ways[:1], ways[:-1]])):
        return "SHAKE pushes the ends of a rod along it as it lay a step before"
    return ""


def _of_bath(case: Case) -> str:
    """Draws that two coordinates share, or noise whose size is not the bath's."""
    seen = reading(case)
    if seen.rescaled is not None:
        return _rescaled(case, seen.rescaled)
    x = seen.draws
    if not seen.known or x.size < FEWEST_DRAWS or not np.all(np.isfinite(x)):
        return ""
    size = np.sqrt(np.mean(x * x))
    for i in range(x.shape[1]):
        for j in range(i):
            for words, sign in (("the same as", 1), ("the opposite of", -1)):
                if np.all(np.abs(x[:, i] - sign * x[:, j]) <= SAME_DRAWS * size):
                    return f"the random numbers of coordinate {i} are {words} those of coordinate {j}"
    of = x * x
    error = np.std(of) / np.sqrt(of.size)
    if abs(np.mean(of) - 1) > STANDARD_ERRORS * error:
        return (
            f"the noise is {size:.4g} +- {error / (2 * size):.1g} times as large as the temperature, the "
            "masses and the friction ask"
        )
    return ""


def _rescaled(case: Case, kinetic: Floats) -> str:
    """Factor and offset of the kinetic energy by one factor for all momenta; weighted least squares.

    After it twice the kinetic energy over kT has the mean c K + n b and the variance 2 n b**2 + 4 c K b,
    where b = 1 - c in equation (A7) of Bussi, Donadio & Parrinello.
    """
    bath, n = case.judged.bath, case.scene.n
    before, after = kinetic
    if bath is None or len(before) < FEWEST_DRAWS or not np.all(np.isfinite(kinetic)):
        return ""
    x = np.float64(bath.friction * case.trajectory.step)
    asked, lost = float(ENERGY_LEFT(x)), float(ENERGY_LEFT.lost(x))
    design = np.stack([before, np.full_like(before, n)], axis=1)
    found = np.array([asked, lost])
    for _ in range(FIT_ROUNDS):
        c, b = np.maximum(found, lost * SAME_DRAWS)
        weight = 1 / (2 * n * b * b + 4 * c * before * b)
        covariance = np.linalg.inv((design * weight[:, None]).T @ design)
        found = covariance @ (design.T @ (weight * after))
    (c, b), (of_c, of_b) = found, np.sqrt(np.diag(covariance))
    kept = f"a step leaves {c:.5g} +- {of_c:.1g} of the kinetic energy"
    if abs(c - asked) > STANDARD_ERRORS * of_c:
        return f"{kept} where the friction asks for {asked:.5g}"
    if abs(b - lost) > STANDARD_ERRORS * of_b:
        return (
            f"{kept}, as the friction asks, and adds {b / lost:.4g} +- {of_b / lost:.1g} times the noise "
            "that goes with it: the coupling acts on one of both alone"
        )
    return ""
