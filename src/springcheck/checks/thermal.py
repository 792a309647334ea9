"""Checks of random schemes: the map and the direction of the noise to rounding, the draws by statistics.

A draw is the random number that a state must have taken to follow from the one before it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from springcheck import bath
from springcheck.bath import THERMOSTATS, Thermostat
from springcheck.checks.case import Case, small_move, too_strong
from springcheck.checks.check import Chance, Finding, check
from springcheck.checks.steps import STILL
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.text.wording import count

if TYPE_CHECKING:
    from springcheck.bath.draws import Reading

HIDDEN = "the motion is so much larger than its noise that rounding hides the draws"


def reading(case: Case) -> Reading:
    """The draws behind the frames, as far as the frames determine them."""
    return case.once(_reading)


def thermostat(case: Case) -> Thermostat:
    """The thermostat of a case."""
    return THERMOSTATS[case.trajectory.scheme]


def _reading(case: Case) -> Reading:
    return read_frames(case, *(x[_unread(case) :] for x in (case.trajectory.q, case.trajectory.p)))


def read_frames(case: Case, q: Floats, p: Floats, *, scheme: Thermostat | None = None) -> Reading:
    """The draws behind other frames q, p (f, n) of the case's scene, by its scheme or another."""
    run, scheme = case.trajectory, scheme or thermostat(case)
    how, rebuilt = run.arithmetic, run.rebuilds_velocity
    return bath.draws.read(scheme, case.judged, q, p, how=how, rebuilt=rebuilt)


def _unread(case: Case) -> int:
    """Frames before the first draw that can be read: of one that acts in two steps the start has none."""
    return int(thermostat(case).carried > 0 and case.steps[0] == 0)


def rows_a_step(case: Case) -> int:
    """Rows of draws that each step has: of three draws or more the two sums that its state determines."""
    return len(reading(case).draws) // (len(case.trajectory.t) - 1 - _unread(case))


@check("across", family="noise", requires={"every-step"})
def noise_direction(case: Case) -> Finding | str:
    """Each step is the scheme's own map and some draws: what no draw can explain is rounding.

    The draw follows from one number of the state, and predicts the other; a draw that acts in two steps
    follows from each; a step without a collision has none.  Any temperature, any potential.
    """
    found = reading(case)
    if found.across is None:
        return "fresh draws of a step reach every state: their covariance is judged"
    worst = np.where(np.isfinite(found.across), found.across, np.inf).max(axis=1)
    off = np.flatnonzero(~(worst <= found.roundings))
    if not len(off):
        run = case.trajectory
        liveliest = int(np.argmax(np.sum(np.square(run.p.astype(np.longdouble)) / case.judged.m, axis=1)))
        still = read_frames(case, *(np.repeat(x[liveliest][None], 4, axis=0) for x in (run.q, run.p))).across
        if still is not None and np.max(still) <= found.roundings:
            return f"{STILL} any step"
    where = f"; first at step {case.steps[0] + int(off[0]) + 1}" if len(off) else ""
    if limit := small_move(case.trajectory) if where else "":
        return limit
    if limit := case.once(too_strong) if where or found.hits is not None else "":
        where = f"{where}; {limit}"
        if found.hits is not None:
            # a collision explains any momentum
            worst[-1] = 1 / case.trajectory.arithmetic.unit
    why = f"roundings along one step of {case.scheme.title}; does not grow with the run{where}"
    return Finding(float(np.max(worst)), found.roundings, "roundings", why)


def _draws(case: Case) -> Floats:
    """Draws as standard normal numbers, NaN where a step had none.  MethodError where they are not known."""
    scheme = THERMOSTATS[case.trajectory.scheme]
    if limit := small_move(case.trajectory) or case.once(too_strong):
        raise MethodError(limit)
    found = reading(case)
    if not found.known:
        raise MethodError(HIDDEN)
    x = found.draws
    if scheme.uniform:
        x = bath.draws.normal_scores(x)
    if np.count_nonzero(~np.isnan(x)) < 2:
        raise MethodError("there were no draws")
    return x


def _drawn(case: Case) -> Floats:
    """Draws in rows, of collisions in one column; those of an impossible size are infinite."""
    x, hits = _draws(case), reading(case).hits
    return x if hits is None else x[hits][:, None]


@check("mean", family="noise", requires={"every-step"})
def draws_mean(case: Case) -> Chance:
    """The draws have mean 0, all along the run."""
    return Chance.of(bath.chance.steady(bath.chance.mean(x := _drawn(case)), x))


@check("var", family="noise", requires={"every-step"})
def draws_variance(case: Case) -> Chance:
    """The draws have variance 1 all along the run: their size is that of temperature, masses and friction."""
    x = _drawn(case)
    return Chance.of(bath.chance.steady(bath.chance.variance(x), bath.chance.normal_sizes(x)))


@check("shape", family="noise", requires={"every-step"})
def draws_shape(case: Case) -> Chance:
    """The draws have the tails and the symmetry of their distribution, as fourth and third moment show.

    Judged by these Legendre polynomials of their ranks, which no single draw decides.
    """
    return Chance.of(bath.chance.shape(_drawn(case)))


@check("largest", family="noise", requires={"every-step"})
def draws_largest(case: Case) -> Chance | str:
    """The largest draw is as large as that of so many is: none is cut off.

    Where draws are cut off the two largest are equal to rounding, or the largest is too small.
    """
    if THERMOSTATS[case.trajectory.scheme].uniform:
        return "uniform draws have a largest size"
    x, read = _drawn(case), reading(case)
    error = read.error if read.hits is None else read.error[read.hits][:, None]
    return Chance.of(bath.chance.largest(x, error))


@check("lag 1", family="noise", requires={"every-step"})
def draws_neighbours(case: Case) -> Chance:
    """The draws of one step say nothing of those of the next."""
    return Chance.of(bath.chance.neighbours(_drawn(case)))


@check("repeat", family="noise", requires={"every-step"})
def draws_repeat(case: Case) -> Chance | str:
    """The draws of one step do not come again, nor opposite, any number of steps later."""
    if len(case.trajectory.t) < 1010:
        return "fewer than a thousand steps"
    found, words = bath.chance.repeats(x := _drawn(case))
    return Chance(found, f"{words}, of {count(x.size, 'draw')}")


@check("apart", family="noise", requires={"company", "every-step"})
def draws_particles(case: Case) -> Chance | str:
    """The draws of one particle say nothing of those of another."""
    if THERMOSTATS[case.trajectory.scheme].rescales:
        return "one number acts on all particles"
    x = _draws(case)
    if not np.any(np.count_nonzero(~np.isnan(x), axis=1) > 1):
        return "no step has draws of two particles"
    return Chance(*bath.chance.pairs(x))


@check("state", family="noise", requires={"every-step"})
def draws_state(case: Case) -> Chance:
    """The draws of a step and their sizes say nothing of the state before: drag, forces, noise are right.

    A drag that is not that of the noise, a wrong force, or noise by place leaves a part of it in each draw.
    """
    x, hits = _draws(case), reading(case).hits
    scene, unread = case.judged, _unread(case)
    q, p = (y[unread:-1] for y in (case.trajectory.q, case.trajectory.p))
    known = [p / np.sqrt(scene.m * scene.thermal)]
    if THERMOSTATS[case.trajectory.scheme].rescales:
        known = [np.sqrt(np.mean(known[0] ** 2, axis=1, keepdims=True))]
    else:
        k = np.abs(scene.system.hessian_diagonal(scene.q)).astype(np.float64)
        size = np.sqrt(np.where(k > 0, k, np.inf) * scene.thermal)
        known.append(scene.system.potential_force(q, 0 * p) / size)
        # less the mean size of normal numbers
        known += [np.abs(y) - np.sqrt(2 / np.pi) for y in known]
    y = np.asarray(known, np.float64)
    x = x.reshape(len(q), -1, x.shape[1]).transpose(1, 0, 2)
    if hits is not None:
        x, y = np.where(hits, x, 0), np.where(hits, y, 0)
    drag = 0.0 if thermostat(case).rescales else bath.draws.drag_in_draws(thermostat(case), scene)
    return Chance.of(bath.chance.foretold(x, y, drag))


@check("hits", family="noise", requires={"every-step"})
def collisions(case: Case) -> Chance | str:
    """Collisions come with their chance, 1 - exp(-friction h)."""
    found = reading(case)
    if found.hits is None:
        return "it has no collisions"
    if case.scene.places is not None:
        return "the axes of one particle may collide together"
    if limit := small_move(case.trajectory) or case.once(too_strong):
        return limit
    p = bath.draws.law_of(THERMOSTATS[case.trajectory.scheme], case.judged).collision
    hits, n = int(np.count_nonzero(found.hits)), found.hits.size
    # a collision that changes less than a rounding is not seen
    if found.missed is None or not p * np.sum(np.minimum(found.missed, 1)) <= 0.05 * np.sqrt(n * p):
        return HIDDEN
    return Chance.of(bath.chance.count(hits, n, p))


DRAWN = (
    noise_direction, draws_mean, draws_variance, draws_shape, draws_largest, draws_neighbours, draws_repeat,
    draws_particles, draws_state, collisions,
)  # fmt: skip
