"""Causes that states show where they are not the scheme's.

The effect of a bath is in the draws that the states imply, and in their size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import comb

import numpy as np

from springcheck.bath import THERMOSTATS
from springcheck.bath.catalogue import ENERGY_LEFT
from springcheck.bath.draws import Reading, law_of
from springcheck.checks import driven, other, stages
from springcheck.checks.bath import noise_direction, read_frames, reading, rows_a_step, thermostat
from springcheck.checks.case import Case
from springcheck.checks.requires import MAP, missing
from springcheck.checks.steps import STANDS_APART, seldom_off, step_defect
from springcheck.physics.arrays import Floats
from springcheck.text.wording import regularly

STANDARD_ERRORS = 6.0
"""Standard errors by which a size differs from another: a chance of 2e-9 for normal numbers."""

FEWEST_DRAWS = 50
"""Draws from which a size is reported: its standard error is a tenth then."""

MOST_SIZES = 6
"""Coordinates whose noise a cause tells."""

MOST_PAIRED = 512
"""Coordinates that are compared in pairs."""

FIT_ROUNDS = 20
"""Iterations of a fit whose weights are its own variances."""

DIFFERENCE_ROUNDINGS = 4
"""Roundings of a velocity and of the difference in it: of a product, a quotient, a kick, recording."""

NEARLY_ALL = 0.9
"""Share of the rows from the first that comes again on, from which on all do, but for what rounding hides."""

SAME_DRAWS = 1e-6
"""Relative difference up to which two draws count as one number."""

REMOVED_ROUNDINGS = 16
"""Roundings of each particle's momentum up to which a total momentum is 0."""

FEWEST_ORDERS = 1e9
"""Ways to choose the steps that are wrong, of which one has the farthest by chance."""

DECLARE_DIFFERENCES = "judge it with --differences (in Python: rebuilds_velocity=True)"
"""What to do where velocities are right to what differences of positions keep."""

OR_UNKNOWN = "or one that is not known here"
"""End of an identification that does not exclude other schemes: another cause goes before it."""


@np.errstate(all="ignore")
def found(case: Case, shown: Callable[[int, bool], str] = lambda *_: "") -> str:
    """The cause in one sentence, or "" where nothing known here, nor what the states show, explains them."""
    run, system = case.trajectory, case.scene.system
    first, few = seldom_off(case)
    looks: list[Callable[[Case], str]] = [lambda _: shown(first, bool(few)), other.found]
    if case.scene.n > 1 or not system.is_linear:
        # of one particle by itself states show more than which number is another
        looks.reverse()
    ways: list[Callable[[Case], str]] = []
    random = run.scheme in THERMOSTATS
    if run.every == 1 and random:
        # of draws that are read by the map of another scheme the size says nothing
        drawn = _told(reading(case)) and noise_direction(case).passed is not False
        ways = [*[_of_no_noise] * drawn, _of_bath, *[stages.balanced] * drawn]
        ways += [stages.collided, _of_removal, stages.found]
        looks = [*looks, _of_reach, *[_of_state, _of_size] * drawn]
    elif run.every == 1 and not missing(case, MAP):
        ways = [_of_differences, driven.found, _of_removal, _of_factor]
        looks = [_of_numbers, *looks, _of_reach]
    elif not random:
        ways = [driven.summed]
    vague = ""
    for way in ways + looks:
        said = way(case)
        # where all but the momenta is right, what their draws hold is surer than a scheme that may be another
        if random and said.endswith(OR_UNKNOWN) and noise_direction(case).passed:
            vague = said
        elif said:
            return said
    return vague or few


def _off(case: Case, p: Floats | None = None) -> Floats:
    """Distance of each frame but the first (f-1,) from where the scheme leads from the one before, or from
    its positions and other momenta p (f, n), over its bound; 0 where draws explain any momentum."""
    run, found = case.trajectory, np.zeros(len(case.steps) - 1)
    starts = run.q, run.p if p is None else p
    if run.scheme not in THERMOSTATS:
        if case.scene.system.is_driven:
            return found
        ends = case.next_states if p is None else case.step(*(x[:-1].astype(np.longdouble) for x in starts))
        off = np.abs(np.stack(ends) - np.stack([run.q[1:], run.p[1:]])) / np.stack(case.allowance)
        return np.asarray(np.max(off, axis=(0, 2)) / case.roundings, np.float64)
    bath, seen, every = thermostat(case), reading(case), 1
    if p is not None:
        if bath.carried:
            # what these carry on is that of their own states
            return found + np.inf
        # each end beside its start, so that every other step is one of these
        both = zip(starts, (run.q, run.p), strict=True)
        pairs = (np.stack([x[:-1], y[1:]], axis=1).reshape(-1, case.scene.n) for x, y in both)
        seen, every = read_frames(case, *pairs), 2
    if seen.across is not None:
        off = np.max(seen.across[::every], axis=1) / seen.roundings
        # a first draw that acts in two steps is not read
        found[len(found) - len(off) :] = off
    return found


def _of_removal(case: Case) -> str:
    """A total momentum that is taken away after steps or before them, at every one or at every so many."""
    run, bath = case.trajectory, THERMOSTATS.get(case.trajectory.scheme)
    off = ~(_off(case) <= 1)
    if case.scene.particles < 2 or not np.any(off):
        return ""
    m, axis = case.judged.m, np.equal.outer(np.unique(case.scene.all_places % 3), case.scene.all_places % 3)
    total, size = run.p @ axis.T, np.abs(run.p) @ axis.T
    left = run.p - m * (total / (axis @ m) @ axis)
    # a total that the scheme keeps at 0 is no sign
    drawn = bath is not None and bath.fresh > 0 and not bath.rescales
    ends = case.next_states[1] @ axis.T if bath is None else size[1:] * drawn
    room = REMOVED_ROUNDINGS * case.scene.n * run.arithmetic.state * np.max(size, axis=0)
    if np.all((np.abs(total[1:]) <= room)[off]) and np.any((np.abs(ends) > room)[off]):
        where = "after"
    elif np.all(_off(case, left)[off] <= driven.SLACK):
        where = "before"
    else:
        return ""
    at = case.steps[1:][off].tolist()
    often = "every step" if np.all(off) else f"step {at[0]}{regularly(at, 'step')}"
    return f"the total momentum is taken away {where} {often}: the motion of the centre of mass is removed"


def _of_factor(case: Case) -> str:
    """One factor that multiplies a state, or its momenta, after most steps, and not the same after each."""
    if not np.median(_off(case)) > 1:
        return ""
    run, n, room = case.trajectory, case.scene.n, driven.SLACK * case.roundings
    unit, ends = (np.concatenate(x, axis=1) for x in (case.allowance, case.next_states))
    made = np.concatenate([run.q[1:], run.p[1:]], axis=1)
    off = np.abs(made - ends) / unit
    # of one freedom any change of a momentum is a factor
    for what, kept, of, freedoms in (
        ("momenta", slice(n), slice(n, None), n), ("positions and momenta", [], slice(None), 2 * n),
    ):  # fmt: skip
        x, y = ends[:, of] / unit[:, of], made[:, of] / unit[:, of]
        factor = np.sum(x * y, axis=1) / np.sum(x * x, axis=1)
        left = [np.max(np.abs(y - one * x)) for one in (factor[:, None], np.mean(factor))]
        if freedoms > 1 and np.all(off[:, kept] <= room) and left[0] <= room < left[1] / driven.SLACK:
            size = " to ".join(f"{float(one):.6g}" for one in (np.min(factor), np.max(factor)))
            return (
                f"each step is the scheme's own, and all {what} are multiplied by one factor after it, from "
                f"{size}: a rescaling, as to one energy or temperature"
            )
    return ""


def _of_reach(case: Case) -> str:
    """A force that is another from a distance on: no step that comes so far is the scheme's, all others
    are."""
    by, q = _off(case), case.trajectory.q
    off = ~(by <= 1)
    # an error that grows with the distance leaves none so far off at once
    if np.any(by[off] <= STANDS_APART) or comb(len(off), int(np.count_nonzero(off))) < FEWEST_ORDERS:
        return ""
    for term in case.scene.terms:
        if term.kind == "potential":
            far = np.max(np.abs(term.elongation(q)), axis=1)
            reach = np.maximum(far[:-1], far[1:])
            if (least := np.min(reach[off])) > (most := np.max(reach[~off])):
                return (
                    f"steps that end within {most:.6g} of the rest of each {term.key} are the scheme's, and "
                    f"none beyond {least:.6g} is: the force is another there, as where it is cut off"
                )
    return ""


def _of_numbers(case: Case) -> str:
    """Positions and momenta in each other's columns, or decimals of a file that were cut off and not rounded:
    right is the middle of what they leave open."""
    run = case.trajectory
    q, p = (np.concatenate([x[:1], y[1:]]) for x, y in ((run.q, run.p), (run.p, run.q)))
    if step_defect(replace(case, trajectory=replace(run, q=q, p=p))).passed:
        return "each step is the scheme's own, but positions and momenta are exchanged from frame 1 on"
    half = run.arithmetic.recorded(case.judged.m, run.step, False).astype(np.float64)
    for words, sign in (("towards 0", np.sign), ("downwards", np.ones_like)) if np.any(half) else ():
        q, p = (x + one * sign(x) for x, one in zip((run.q, run.p), half, strict=True))
        if step_defect(replace(case, trajectory=replace(run, q=q, p=p))).passed:
            return (
                f"the decimals of the file are cut off, {words}, and not rounded: each step is the scheme's "
                "own from and to the middle of what they leave open; write all digits, as by %.17g, or round"
            )
    return ""


def _of_differences(case: Case) -> str:
    """Velocities that are differences of the positions, where every step is right to what those keep."""
    run, m = case.trajectory, case.judged.m
    declared = replace(case, trajectory=replace(run, rebuilds_velocity=True))
    if run.rebuilds_velocity or step_defect(case).passed:
        return ""
    for more, n, kick in (("", 1, 0.0), (" over two steps", 2, 0.0), (" and half a kick", 1, 0.5)):
        q, p = (x[1 : len(x) - n + 1] for x in (run.q, run.p))
        made = m * (run.q[n:] - run.q[:-n]) / (n * run.step)
        right, size = made + kick * run.step * case.system.force(q, p), np.abs(p) + np.abs(made)
        # and those of their own decimals: what has finer ones than the positions was not made of them
        half = run.arithmetic.recorded(m, n * run.step, False)[1]
        off = (np.abs(p - right) - half) / (DIFFERENCE_ROUNDINGS * run.arithmetic.state)
        if np.all(off <= size) and step_defect(declared).passed:
            return (
                f"velocities are differences of the positions{more}, which keep eps q/h of them, and each "
                f"step is right to that: {DECLARE_DIFFERENCES}"
            )
    return ""


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
