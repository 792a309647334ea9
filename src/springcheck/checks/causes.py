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
from springcheck.checks.steps import seldom_off, step_defect
from springcheck.checks.thermal import collisions, draws_particles, noise_direction, reading, thermostat
from springcheck.physics.arrays import Floats, Reals
from springcheck.thermal import THERMOSTATS
from springcheck.thermal.catalogue import ENERGY_LEFT
from springcheck.thermal.draws import Reading

PUSH_ROUNDINGS = 64
"""Roundings of the positions whose difference is an impulse: of a free step, and of the frame as recorded."""

STANDARD_ERRORS = 6.0
"""Standard errors by which a size differs from another: a chance of 2e-9 for normal numbers."""

FEWEST_DRAWS = 50
"""Draws from which a size is reported: its standard error is a tenth then."""

MOST_SIZES = 6
"""Coordinates whose noise a cause tells."""

FIT_ROUNDS = 20
"""Iterations of a fit whose weights are its own variances."""

DIFFERENCE_ROUNDINGS = 4
"""Roundings of a velocity and of the difference in it: of a product, a quotient, a kick, recording."""

NEARLY_ALL = 0.9
"""Share of the rows from the first that comes again on, from which on all do, but for what rounding hides."""

SAME_DRAWS = 1e-6
"""Relative difference up to which two draws count as one number."""


@np.errstate(all="ignore")
def found(case: Case, shown: Callable[[int, bool], str] = lambda *_: "") -> str:
    """The cause in one sentence, or "" where nothing known here, nor what the states show, explains them."""
    run, system = case.trajectory, case.scene.system
    first, few = seldom_off(case)
    looks: list[Callable[[Case], str]] = [lambda _: shown(first, bool(few)), other.found]
    if not (system.is_linear and system.is_separate):
        # of one particle by itself states show more than which number is another
        looks.reverse()
    ways: list[Callable[[Case], str]] = []
    if run.every == 1 and run.scheme in THERMOSTATS:
        # of draws that are read by the map of another scheme the size says nothing
        ways, looks = [_of_no_noise, _of_bath, _of_collisions], [*looks, _of_size]
    elif run.every == 1 and not missing(case, MAP):
        ways = [_of_differences, driven.found, _of_rods]
    return next(filter(None, (way(case) for way in ways + looks)), few)


def _of_differences(case: Case) -> str:
    """Velocities that are differences of the positions, where every step is right to what those keep."""
    run, m = case.trajectory, case.judged.m
    for more, n, kick in (("", 1, 0.0), (" over two steps", 2, 0.0), (" and half a kick", 1, 0.5)):
        q, p = (x[1 : len(x) - n + 1] for x in (run.q, run.p))
        made = m * (run.q[n:] - run.q[:-n]) / (n * run.step)
        right, size = made + kick * run.step * case.system.force(q, p), np.abs(p) + np.abs(made)
        if rods := case.system.rods:
            right, size = rods.projected(q, right), np.max(size, axis=1, keepdims=True)
        # and those of their own decimals: what has finer ones than the positions was not made of them
        half = run.arithmetic.recorded(m, n * run.step, False)[1]
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


def _of_no_noise(case: Case) -> str:
    """Coordinates whose draws are a linear map of the state before: no noise acts, or one number does."""
    seen, run = reading(case), case.trajectory
    if seen.rescaled is not None or not _told(seen):
        return ""
    x = seen.draws.reshape(-1, max(thermostat(case).fresh, 1), seen.draws.shape[1])
    known = np.column_stack([*(y[-len(x) - 1 : -1] for y in (run.q, run.p)), np.ones(len(x))])
    if len(x) < FEWEST_DRAWS + known.shape[1]:
        return ""
    flat = x.reshape(len(x), -1)
    rest = (flat - known @ np.linalg.lstsq(known, flat, rcond=None)[0]).reshape(x.shape)
    least = SAME_DRAWS * np.sqrt(np.mean(x * x))
    still = np.flatnonzero(np.all(np.abs(rest) <= least, axis=(0, 1)))
    of = x[:, :, still]
    if len(still) and np.all(np.ptp(of, axis=0) <= least) and np.all(np.abs(of[0]) > least):
        return "every step takes the same random numbers"
    which = ", ".join(map(str, still[:MOST_SIZES])) + ", ..." * (len(still) > MOST_SIZES)
    return f"no noise acts on coordinate {which}, which follows from the state before alone" if which else ""


def _of_bath(case: Case) -> str:
    """Draws that two coordinates share or that come again, or a factor of momenta that is not the bath's."""
    seen = reading(case)
    if seen.rescaled is not None:
        return _rescaled(case, seen.rescaled)
    x = seen.draws
    if not _told(seen):
        return ""
    size = np.sqrt(np.mean(x * x))
    for i in range(x.shape[1]):
        # coordinates whose first numbers are of unlike size share none
        near = np.abs(np.abs(x[0, :i]) - np.abs(x[0, i])) <= SAME_DRAWS * size
        for j in np.flatnonzero(near):
            for words, sign in (("the same as", 1), ("the opposite of", -1)):
                if np.all(np.abs(x[:, i] - sign * x[:, j]) <= SAME_DRAWS * size):
                    return f"the random numbers of coordinate {i} are {words} those of coordinate {j}"
    # pairs of equal numbers, and the distance that most of them have
    order = np.argsort(x[:, 0])
    lags = np.abs(np.diff(order)[np.diff(x[order, 0]) <= SAME_DRAWS * size])
    lag = int(np.argmax(np.bincount(lags, minlength=2)))
    again = np.flatnonzero(np.all(np.abs(x[lag:] - x[:-lag]) <= SAME_DRAWS * size, axis=1)) if lag else lags
    if len(again) < FEWEST_DRAWS:
        return ""
    if lag == 1 and thermostat(case).fresh == 2 and not np.any(again % 2):
        return "both random numbers of a step are one number, where each is one of its own"
    if len(again) < NEARLY_ALL * (len(x) - lag - again[0]):
        return f"{len(again)} of {len(x) - lag} rows of random numbers are those {lag} rows before, again"
    return f"the random numbers from row {lag + again[0]} on are those from row {again[0]} on, again"


def _told(seen: Reading) -> bool:
    return seen.known and seen.draws.size >= FEWEST_DRAWS and bool(np.all(np.isfinite(seen.draws)))


def _of_size(case: Case) -> str:
    """Draws that hold a part of the momentum before them; else noise whose size is not the bath's, of each
    coordinate where these are unlike, and of none where coordinates share draws."""
    seen, rods = reading(case), case.scene.system.rods
    if seen.rescaled is not None or not _told(seen) or noise_direction(case).passed is False:
        return ""
    of = seen.draws**2
    mean, error = np.mean(of, axis=0), np.std(of, axis=0) / np.sqrt(len(of))
    if not rods:
        rows = max(thermostat(case).fresh, 1)
        before = np.repeat(case.trajectory.p[-(len(of) // rows) - 1 : -1], rows, axis=0)
        held = [float(np.corrcoef(x, y)[0, 1]) for x, y in zip(seen.draws.T, before.T, strict=True)]
        i = int(np.argmax(np.abs(held)))
        if abs(held[i]) * np.sqrt(len(of)) > STANDARD_ERRORS:
            return (
                f"the draws of coordinate {i} go with the momentum before them, with a correlation of "
                f"{held[i]:+.2g}: the drag is not the one that the friction asks for"
            )
    if draws_particles(case).passed is False:
        return ""
    asked = "as large as the temperature, the masses and the friction ask"
    sizes = [(np.mean(of), np.std(of) / np.sqrt(of.size)), *zip(mean, error, strict=True)]
    told = [f"{np.sqrt(y):.4g} +- {e / (2 * np.sqrt(y)):.1g} times" for y, e in sizes]
    if np.any(np.abs(mean - sizes[0][0]) > STANDARD_ERRORS * error):
        more = ", ..." * (len(mean) > MOST_SIZES)
        return f"the noise of the coordinates is {', '.join(told[1 : MOST_SIZES + 1])}{more} {asked}"
    return f"the noise is {told[0]} {asked}" if abs(sizes[0][0] - 1) > STANDARD_ERRORS * sizes[0][1] else ""


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
        # a loss that goes with the noise is of another friction, and near 1 may be that of the bath's as well
        rate, error = -np.log1p(-b) / (2 * x), of_b / (1 - b) / (2 * x)
        of_both = abs(c - 1 + b) <= STANDARD_ERRORS * np.hypot(of_c, of_b)
        return (
            f"{kept}, where the friction asks for {asked:.5g}, and adds {b / lost:.4g} +- {of_b / lost:.1g} "
            "times the noise that goes with that: the coupling acts on one of both alone"
        ) + f", or the friction is {rate:.4g} +- {error:.1g} times the bath's" * bool(of_both)
    return ""


def _of_collisions(case: Case) -> str:
    """How often momenta are drawn anew, where that is not as the friction asks."""
    hits, bath = reading(case).hits, case.judged.bath
    if hits is None or bath is None or collisions(case).passed is not False:
        return ""
    share, x = float(np.mean(hits)), bath.friction * case.trajectory.step
    rate, error = -np.log1p(-share) / x, np.sqrt(share / (1 - share) / hits.size) / x
    return f"collisions come {rate:.4g} +- {error:.1g} times as often as the friction asks"
