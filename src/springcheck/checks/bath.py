"""Checks of thermostats: map and direction of the noise to rounding; its size, shape, independence by chance.

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


def read_frames(case: Case, q: Floats, p: Floats) -> Reading:
    """The draws behind other frames q, p (f, n) of the case's scene."""
    run = case.trajectory
    return bath.draws.read(
        thermostat(case), case.judged, q, p, how=run.arithmetic, rebuilt=run.rebuilds_velocity
    )


def _unread(case: Case) -> int:
    """Frames before the first draw that can be read: of one that acts in two steps the start has none."""
    return int(thermostat(case).carried > 0 and case.steps[0] == 0)


def rows_a_step(case: Case) -> int:
    """Rows of draws that each step has."""
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
    """Draws in units of their standard deviation, NaN where a step had none.  MethodError where unknown."""
    if limit := small_move(case.trajectory) or case.once(too_strong):
        raise MethodError(limit)
    found = reading(case)
    if not found.known:
        raise MethodError(HIDDEN)
    if np.count_nonzero(~np.isnan(found.draws)) < 2:
        raise MethodError("there were no draws")
    return found.draws


def _finite_draws(case: Case) -> Floats:
    """Those draws.  MethodError where one is infinite: their size is judged."""
    x = _draws(case)
    if np.any(np.isinf(x)):
        raise MethodError("a draw is beyond all numbers")
    return x


@check("var", family="noise", requires={"every-step"})
def draws_variance(case: Case) -> Chance:
    """The noise has the size of temperature, masses and friction: its draws have variance 1."""
    return Chance.of(bath.evidence.size(_draws(case), uniform=thermostat(case).uniform))


@check("indep", family="noise", requires={"every-step"})
def draws_independent(case: Case) -> Chance:
    """The draws are independent: their mean is 0 whatever the previous draw, momentum and force were.

    A drag that is not that of the noise, a wrong force, or noise by place leaves a part of it in each draw.
    """
    x, scheme, scene, unread = _finite_draws(case), thermostat(case), case.judged, _unread(case)
    q, p = (y[unread:-1] for y in (case.trajectory.q, case.trajectory.p))
    k = np.abs(scene.system.hessian_diagonal(scene.q)).astype(np.float64)
    u = p / np.sqrt(scene.m * scene.thermal)
    force = scene.system.potential_force(q, 0 * p) / np.sqrt(np.where(k > 0, k, np.inf) * scene.thermal)
    before = {"the momentum": u, "the force": np.asarray(force, np.float64)}
    if scheme.rescales:
        before = {"the momentum": np.sqrt(np.mean(u**2, axis=1, keepdims=True))}
    rows = len(x) // len(q)
    known = [bath.evidence.Known(what, np.repeat(y, rows, axis=0)) for what, y in before.items()]
    known += [bath.evidence.Known(one.what, one.y, of_sizes=True) for one in known]
    # and their sizes, less the mean size of normal numbers
    known += [
        bath.evidence.Known(f"the size of {one.what}", np.abs(one.y) - np.sqrt(2 / np.pi), of_sizes=True)
        for one in known[: len(before)]
    ]
    drag = 0.0 if scheme.rescales else bath.draws.drag_in_draws(scheme, scene)
    known = bath.evidence.known_before(x, known, between=not scheme.rescales)
    return Chance.of(bath.evidence.independence(x, known, drag=drag))


@check("shape", family="noise", requires={"every-step"})
def draws_shape(case: Case) -> Chance:
    """The draws have the tails and the symmetry of their distribution.

    Judged by Legendre polynomials of their ranks, which no single draw decides.
    """
    return Chance.of(bath.evidence.shape(_finite_draws(case), uniform=thermostat(case).uniform))


@check("ties", family="noise", requires={"every-step"})
def draws_differ(case: Case) -> Chance | str:
    """No draw comes again: few values, a period, draws cut off or used twice would show as ties."""
    found = bath.evidence.ties(_finite_draws(case), reading(case).error)
    return Chance.of(found) if found else "rounding makes draws equal"


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
    p = bath.draws.law_of(thermostat(case), case.judged).collision
    hits, n = int(np.count_nonzero(found.hits)), found.hits.size
    # a collision that changes less than a rounding is not seen
    if found.missed is None or not p * np.sum(np.minimum(found.missed, 1)) <= 0.05 * np.sqrt(n * p):
        return HIDDEN
    return Chance.of(bath.evidence.hits(hits, n, p))


DRAWN = (noise_direction, draws_variance, draws_independent, draws_shape, draws_differ, collisions)
"""Checks of the trajectory of a thermostat."""
