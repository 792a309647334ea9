"""What the draws of a stated thermostat show where its verdicts fail: noise of another size, shared or
repeated random numbers, another friction.

Draws are read by the thermostat's own map: where the states are not on it, they say nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from springcheck.bath.catalogue import ENERGY_LEFT
from springcheck.bath.draws import Reading, law_of
from springcheck.checks.bath import collisions, noise_direction, reading, rows_a_step, thermostat
from springcheck.checks.case import Case
from springcheck.physics.arrays import Floats

STANDARD_ERRORS = 6.0
"""Standard errors by which a size differs from another: a chance of 2e-9 for normal numbers."""

FEWEST_DRAWS = 50
"""Draws from which a size is reported: its standard error is a tenth then."""

MOST_SIZES = 6
"""Coordinates whose noise is named."""

MOST_PAIRED = 512
"""Coordinates that are compared in pairs."""

FIT_ROUNDS = 20
"""Iterations of a fit whose weights are its own variances."""

NEARLY_ALL = 0.9
"""Share of the rows from the first that comes again on, from which on all do, but for what rounding hides."""

SAME_DRAWS = 1e-6
"""Relative difference up to which two draws count as one number."""

ROUNDINGS_OF_A_SUM = 4
"""Rounding errors of draws, added up, by which a sum of draws departs from 0 at most."""


@np.errstate(all="ignore")
def found(case: Case) -> str:
    """What the draws show, in one sentence; "" where they show nothing, or frames are several steps apart."""
    if case.trajectory.every != 1:
        return ""
    drawn = _told(reading(case)) and noise_direction(case).passed is not False
    ways: list[Callable[[Case], str]] = [*[_of_no_noise] * drawn, _of_bath, *[_balanced] * drawn, _collided]
    return next((said for way in (*ways, *[_of_state, _of_size] * drawn) if (said := way(case))), "")


def _of_no_noise(case: Case) -> str:
    """Coordinates whose draws are a linear map of the state before: no noise acts, or one number does."""
    seen, run = reading(case), case.trajectory
    x, error = (y.reshape(-1, rows_a_step(case), y.shape[1]) for y in (seen.draws, seen.error))
    known = np.column_stack([*(y[-len(x) - 1 : -1] for y in (run.q, run.p)), np.ones(len(x))])
    if len(x) < FEWEST_DRAWS + known.shape[1]:
        return ""
    flat = x.reshape(len(x), -1)
    rest = (flat - known @ np.linalg.lstsq(known, flat, rcond=None)[0]).reshape(x.shape)
    least = SAME_DRAWS * np.sqrt(np.mean(x * x))
    still = np.flatnonzero(np.all((np.abs(rest) <= least) | (np.abs(x) <= error), axis=(0, 1)))
    of = x[:, :, still]
    if len(still) and np.all(np.ptp(of, axis=0) <= least) and np.all(np.abs(of[0]) > least):
        return "every step takes the same random numbers"
    which = ", ".join(map(str, still[:MOST_SIZES])) + ", ..." * (len(still) > MOST_SIZES)
    return f"no noise acts on coordinate {which}, which follows from the state before alone" if which else ""


def _of_bath(case: Case) -> str:
    """Draws that two coordinates share or that come again, or a factor of momenta that is not the bath's."""
    seen = reading(case)
    if seen.rescaled is not None:
        return "" if noise_direction(case).passed is False else _rescaled(case, seen.rescaled)
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
    # pairs of numbers of equal size, and the distance that most of them have
    order = np.argsort(np.abs(x[:, 0]))
    lags = np.abs(np.diff(order)[np.diff(np.abs(x[order, 0])) <= SAME_DRAWS * size])
    lag = int(np.argmax(np.bincount(lags, minlength=2)))
    for what, sign in (("those", 1), ("the opposite of those", -1)) if lag else ():
        again = np.flatnonzero(np.all(np.abs(x[lag:] - sign * x[:-lag]) <= SAME_DRAWS * size, axis=1))
        if len(again) < FEWEST_DRAWS:
            continue
        if lag == sign == 1 and rows_a_step(case) == 2 and not np.any(again % 2):
            return "both random numbers of a step are one number, where each is one of its own"
        if len(again) < NEARLY_ALL * (len(x) - lag - again[0]):
            of = f"{len(again)} of {len(x) - lag} rows of random numbers"
            return f"{of} are {what} {lag} rows before, again"
        return f"the random numbers from row {lag + again[0]} on are {what} from row {again[0]} on, again"
    return ""


def _told(seen: Reading) -> bool:
    """Whether draws are known, and many."""
    many = seen.rescaled is None and seen.known and seen.draws.size >= FEWEST_DRAWS
    return many and bool(np.all(np.isfinite(seen.draws)))


def _of_state(case: Case) -> str:
    """Draws that hold a part of the momentum or of the force before them."""
    run, system, rows, x = case.trajectory, case.judged.system, rows_a_step(case), reading(case).draws
    q, p = (np.repeat(y[-(len(x) // rows) - 1 :], rows, axis=0) for y in (run.q, run.p))
    force = system.potential_force(q, 0 * p)
    both = np.stack([p[:-rows], force[:-rows]])
    held = np.array([[np.corrcoef(*z)[0, 1] for z in zip(x.T, y.T, strict=True)] for y in both])
    which, i = np.unravel_index(int(np.argmax(np.abs(np.nan_to_num(held)))), held.shape)
    if not abs(held[which, i]) * np.sqrt(len(x)) > STANDARD_ERRORS:
        return ""
    # beside the draws before, which made a part of that momentum
    three = np.corrcoef([both[which, rows:, i], x[rows:, i], x[:-rows, i]])
    own, of_both, again = three[0, 1], three[0, 2], three[1, 2]
    alone = (own - again * of_both) / np.sqrt((1 - again**2) * (1 - of_both**2))
    if abs(alone) * np.sqrt(len(x)) <= STANDARD_ERRORS:
        return f"the draws of coordinate {i} go with those a step before, with a correlation of {again:+.2g}"
    # what the force at a step's end in place of that at its start adds to draws, and what another drag does
    made = np.max(np.abs(law_of(thermostat(case), case.judged).G[:, 1]), axis=1)
    change, drag = (np.asarray(y / made, float) for y in (run.step * (force[rows:] - force[:-rows]), both[0]))
    size, of_drag = np.linalg.norm(change), np.linalg.norm(drag)
    fitted = np.sum(x * change) / size
    better = fitted**2 - (np.sum(x * drag) / of_drag) ** 2
    why = ("the drag is not the one that the friction asks for", "the force is not that of the scene")[which]
    if abs(fitted - size) <= STANDARD_ERRORS and better > -(STANDARD_ERRORS**2):
        late = "the force is that at the end of the step where the scheme takes that at its start"
        why = late if better > STANDARD_ERRORS**2 else f"{late}, or {why}"
    return (
        f"the draws of coordinate {i} go with the {('momentum', 'force')[which]} before them, with a "
        f"correlation of {held[which, i]:+.2g}: {why}"
    )


def _of_size(case: Case) -> str:
    """Noise whose size is not the bath's, of each coordinate where these are unlike, and of none where
    coordinates share draws."""
    x = reading(case).draws
    of = x**2
    z = (x / np.sqrt(np.mean(of, axis=0)))[:, :MOST_PAIRED]
    if np.any(np.abs(np.triu(z.T @ z, 1)) > STANDARD_ERRORS * np.sqrt(len(z))):
        return ""
    mean, error = np.mean(of, axis=0), np.std(of, axis=0) / np.sqrt(len(of))
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


def _balanced(case: Case) -> str:
    """Noise that adds up to 0 over all particles at every step, along each axis, to its rounding."""
    seen, size, axes = reading(case), np.sqrt(case.judged.m), case.scene.all_places % 3
    # a draw acts on momenta by the root of the mass
    along = np.equal.outer(axes, axes).astype(float)
    total, room = np.abs((size * seen.draws) @ along), (size * seen.error) @ along
    return "the noise of all particles adds up to 0 at every step, as with LAMMPS' `zero yes`" * bool(
        case.scene.particles > 1 and np.all(total <= ROUNDINGS_OF_A_SUM * room)
    )


def _collided(case: Case) -> str:
    """How often momenta are drawn anew, where that is not as the friction asks."""
    hits, bath = reading(case).hits, case.judged.bath
    # where nothing is left of any step, its map is another
    if hits is None or bath is None or np.all(hits) or collisions(case).passed is not False:
        return ""
    share, x = float(np.mean(hits)), bath.friction * case.trajectory.step
    rate, error = -np.log1p(-share) / x, np.sqrt(share / (1 - share) / hits.size) / x
    return f"collisions come {rate:.4g} +- {error:.1g} times as often as the friction asks"
