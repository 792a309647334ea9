"""Many steps between two frames: where the scheme comes to, and what the roundings on the way may have
become.

A rounding made in step i is carried to the frame by the tangent map of the steps after it, D Phi^(s-1-i).
With A the allowance of one step (see `rounding`), s steps later it is at most the sum over i < s of
|D Phi^(s-1-i)| A(z_i), each degree of freedom by itself: in a norm over all of them a heavy body would
hide a light one, and a bound by norms of single steps grows exponentially on a motion that merely turns.

That takes all roundings for of one sign.  In double precision they are effectively random, and 5 standard
deviations are allowed, and one more, or the worst of the last step if that is less.  Three parts add up their
variances:

* what a step rounds is uniform within its unit, and a position or momentum is rounded once by each stage
  that moves it and once by what it moves by: a walk, a third of A**2 for each;
* a coefficient, or an element of a matrix, is rounded once, and so acts at every step alike, along the state
  or along its change: A times their signs;
* where a coordinate moves evenly, by few of its last digits, it is rounded to the same side at step after
  step by each stage that moves it: A for each with one sign, as much of it as there can be.

The last two are summed up along the way, signs and all, before they are squared.

The tangent map of a scheme is the scheme carried out on the equations of variation (Hairer, Lubich & Wanner,
Geometric Numerical Integration, VI.4.1), so it needs no code of its own beyond the slope of the force.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springcheck.checks import rounding
from springcheck.checks.claim import Claim
from springcheck.physics.arrays import WIDE, Arithmetic, Extended, Force, Reals
from springcheck.physics.term import Term

JOINED = 32
"""Joined particles up to which tangent maps are carried as matrices (2n, 2n)."""

SAMPLES = 16
"""Tangent vectors with a random sign of every rounding, which stand for the matrices of more particles."""

SAFE = 1 + 2.0**-40
"""Factor by which an allowance in doubles is made larger: its own few hundred roundings take less off it."""

DEVIATIONS = 5.0
"""Standard deviations of roundings as good as random that are allowed: more once in 1.7 million; one more, as
few steps have, once in 500 million.  In a step of h w << 1 that is above the worst that there can be, a
rounding by each stage that moves a coordinate, two on its way in and two out: numbers whose roundings are not
random raise no alarm."""

T_SIXTEEN = 7.98
"""The same multiple where the standard deviation is estimated from `SAMPLES`: Student's t."""

WIDENED = 3.32
"""Factor by which an estimate from `SAMPLES` is below the standard deviation once in a million:
chi-squared."""

NUMBERS = 1 << 18
"""Entries of states and tangent maps that are in memory at a time: 16 MB, and a few times as much for
temporaries."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """Where s steps of the scheme lead from each of f states, q and p as (2, f, n), all extended."""

    end: Extended
    allowance: Extended
    """Bound on the error that the roundings of all steps add up to there (2, f, n)."""
    last: Extended
    """The allowance of the last step alone (2, f, n)."""
    reach: Extended
    """The largest |q| and |p| on the way (2, f, n)."""
    turns: Extended
    """The largest h**2 |K|/m at an evaluation of the force (f,): below 1 an implicit step has one
    solution."""


BENT = 0.125
"""Fraction of a motion up to which the effect of rounding on it is linear: beyond, second order counts."""


def known(case: Claim, ahead: Stretch, steps: int) -> NDArray[np.bool_]:
    """Whether the end of each stretch of so many steps, and the effect of rounding on it, are known (f,)."""
    with np.errstate(all="ignore"):
        told = np.isfinite([ahead.end, ahead.allowance]).all(axis=(0, 1, 3))
        if not case.system.is_linear and steps > 1:
            span = steps * np.longdouble(abs(case.trajectory.step)) / case.judged.m
            reach = ahead.reach + np.stack([span * ahead.reach[1], ahead.reach[0] / span])
            near = case.roundings * ahead.allowance <= BENT * reach
            # with several solutions to a step, an engine may have found another one
            told &= np.all(near, axis=(0, 2)) & (ahead.turns < 1)
    return np.asarray(told)


def follow(case: Claim, q: Extended, p: Extended, steps: int) -> Stretch:
    """Steps from states (f, n), with bounds on the growth of their roundings."""
    if steps == 1:
        near = None if case.system.is_linear else case.trajectory.q[1:].astype(np.longdouble)
        end, bound, written = _one(case, q, p, near=near)
        reach = np.maximum(np.abs([q, p]), np.abs(end))
        turns = np.zeros(len(q), dtype=np.longdouble)
        # the solver of an implicit step forms sums of n products
        implicit, separate = case.law.has("implicit"), case.system.is_separate
        solved = (1 if separate else q.shape[1]) * implicit
        spread = bound * np.sqrt(_walk(case) + _to_one_side(case) ** 2 + (2 + solved) / 3)
        # stiff bonds carry a solver's residual along few directions, with one sign
        random = not implicit or separate or bool(np.max(_turn(case, q)) < 1)
        allowance = _allowed(case, bound, bound, spread, DEVIATIONS, random=random) + written
        return Stretch(end=end, allowance=allowance, last=bound + written, reach=reach, turns=turns)
    n, many = q.shape[1], _many
    if case.system.is_separate or n <= JOINED:
        wide = 2 if case.system.is_separate else 2 * n
        each = n * max(steps * (8 if case.system.is_linear else 2 * wide), 8 * wide)
    else:
        each = 2 * n * (1 + SAMPLES) + (n * n if callable(case.law.stiffness) else 0)
        many = _sampled
    rows = max(1, NUMBERS // each)
    parts = [many(case, q[i : i + rows], p[i : i + rows], steps) for i in range(0, len(q), rows)]
    whole = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=0 if name == "turns" else 1)
        for name in Stretch.__slots__
    }
    return Stretch(**whole)


def _one(
    case: Claim, q: Extended, p: Extended, near: Extended | None = None
) -> tuple[Extended, Extended, Extended]:
    """One step, the allowance of that step, and of the decimals of recorded states, (2, ..., n) each."""
    places: list[Reals] | None = [] if case.placed else None
    end = case.step(q, p, met=places, near=near)
    with np.errstate(all="ignore"):
        one = rounding.of_step(case, q, p, places, recorded=near is not None)
        written = np.stack(rounding.of_recording(case, q, p, places)) / case.roundings
        return np.stack(end), np.stack(one), written


def _many(case: Claim, q: Extended, p: Extended, steps: int) -> Stretch:
    separate = case.system.is_separate
    on = np.empty((2, steps + 1, *q.shape), dtype=np.longdouble)
    on[:, 0] = q, p
    with np.errstate(all="ignore"):
        for i in range(steps):
            on[:, i + 1] = case.step(*on[:, i])
        # terms of single steps are computed for all steps at once
        at_q, at_p = on[:, :-1].reshape(2, -1, q.shape[1])
        _, bound, _ = _one(case, at_q, at_p)
        each = bound.reshape(2, steps, *q.shape)
        bounds = _joined(separate)(list(each), axis=-1)
        if case.system.is_linear:
            one = tangent(case, q[:1], p[:1])
            maps = np.broadcast_to(one, (steps, *one.shape))
        else:
            maps = tangent(case, at_q, at_p)
            maps = maps.reshape(steps, len(q), *maps.shape[1:])
        turns = np.zeros(len(q), dtype=np.longdouble)
        if case.scheme.has("implicit") and not case.system.is_linear:
            turns = np.max([_turn(case, at) for at in on[0, 1:]], axis=0)
        states = _joined(separate)(list(on), axis=-1)
        alike = _alike(case, states[:-1], states[1:])
        worst, walk = np.zeros_like(bounds[0]), np.zeros_like(bounds[0])
        drifts = np.zeros((len(alike), *bounds[0].shape, bounds.shape[-1]), dtype=np.longdouble)
        power: Extended = np.broadcast_to(np.eye(maps.shape[-1], dtype=np.longdouble), maps.shape[1:])
        for i in reversed(range(steps)):
            worst = worst + _apply(np.abs(power), bounds[i])
            walk = walk + _apply(power * power, bounds[i] * bounds[i])
            drifts = drifts + power * (alike[:, i] * bounds[i])[..., None, :]
            if i:
                power = power @ maps[i]
        spread = np.sqrt(walk * _walk(case) + np.sum(drifts * drifts, axis=(0, -1)))
        carried = _allowed(case, worst, bounds[-1], spread, DEVIATIONS, random=not case.law.has("implicit"))
        if np.any(half := _joined(separate)(list(_recorded(case)), axis=-1)):
            carried = carried + half + _apply(np.abs(power @ maps[0]), half)
    allowance = np.moveaxis(carried, -1, 0) if separate else np.stack(np.split(carried, 2, axis=-1))
    reach = np.max(np.abs(on), axis=1)
    return Stretch(end=on[:, -1], allowance=allowance, last=each[:, -1], reach=reach, turns=turns)


def _sampled(case: Claim, q: Extended, p: Extended, steps: int) -> Stretch:
    """The same where n x n numbers are too many: the sum of |D Phi^(s-1-i)| A(z_i), which has 2 n s terms, is
    at most the root of their number times that of the sum of their squares (Cauchy-Schwarz).  The latter is
    the standard deviation of the end where every rounding has a random sign; some such ends tell it.

    The motion is extended, tangents and allowances are doubles, or extended where these leave their range.
    """
    for width in (np.float64, np.longdouble):
        with np.errstate(all="ignore"):
            found, told = _in_width(case, q, p, steps, width)
        if told:
            break
    return found


def _in_width(case: Claim, q: Extended, p: Extended, steps: int, width: Any) -> tuple[Stretch, bool]:
    """That in one width, and whether no number of it has left the range."""
    rng = np.random.default_rng(0)
    signs = np.array([-1.0, 1.0])
    shape, walk, half = (2, SAMPLES, *q.shape), width(np.sqrt(_walk(case))), _recorded(case)
    along = np.array([_to_one_side(case), 1 / np.sqrt(3), 1 / np.sqrt(3)])[:, None]
    fixed = (rng.choice(signs, size=(2, q.shape[1], 3, SAMPLES)) * along).astype(width)
    # what decimals take off the first state is spread evenly within half a unit
    begun = half[:, None, None] * rng.choice(signs, size=shape) if np.any(half) else 0.0
    off = np.zeros(shape, dtype=width) + begun * case.roundings / np.sqrt(3)
    on, placed = np.stack([q, p]), case.placed
    size = on.astype(width)
    reach, turns = np.abs(on), np.zeros(len(q), dtype=np.longdouble)
    last = np.zeros_like(size)
    recurs, turned = np.empty(shape, width), np.full((2, 2, *q.shape), 2, np.int8)
    for _ in range(steps):
        off = np.stack(_varied(case, *np.concatenate([size[:, None], off], axis=1)))[:, 1:]
        places: list[Reals] | None = [] if placed else None
        before, on = size, np.stack(case.step(*on, met=places))
        if places is not None:
            places = [np.asarray(x, width) for x in places]
        last = SAFE * np.stack(rounding.of_step(case, before[0], before[1], places, width=width))
        size = on.astype(width)
        way = np.stack([np.sign(before), np.sign(size - before)]).astype(np.int8)
        # of few coordinates in a step the sign, or that of their change, is another than before
        of, frame, particle = np.nonzero(np.any(way != turned, axis=0))
        each, (one, two) = fixed[of, particle], way[:, of, frame, particle, None]
        recurs[of, :, frame, particle] = each[:, 0] + one * each[:, 1] + two * each[:, 2] - walk
        turned = way
        bits = np.unpackbits(np.frombuffer(rng.bytes(-(-off.size // 8)), np.uint8), count=off.size)
        noise = bits.reshape(shape) * (2 * walk)
        noise += recurs
        noise *= last[:, None]
        off += noise
        reach = np.maximum(reach, np.abs(on))
        if case.law.has("implicit") and not case.system.is_linear:
            turns = np.maximum(turns, _turn(case, on[0]))
    spread = np.sqrt(np.mean(np.square(off), axis=1))
    told = bool(np.isfinite([spread, last]).all())
    spread, last = spread.astype(np.longdouble), last.astype(np.longdouble)
    worst = np.maximum(last, spread * np.sqrt(2 * q.shape[1] * steps) / walk * WIDENED)
    allowance = _allowed(case, worst, last, spread, T_SIXTEEN, random=not case.law.has("implicit"))
    allowance = allowance + half[:, None]
    return Stretch(end=on, allowance=allowance, last=last, reach=reach, turns=turns), told


def _alike(case: Claim, before: Reals, after: Reals) -> Extended:
    """Roundings that recur step after step, in deviations: to one side, along the state, along its change.

    Each of those to one side may be as large as possible; the others are effectively random.
    """
    one_side = 0 * before + _to_one_side(case)
    return np.stack([one_side, np.sign(before) / np.sqrt(3), np.sign(after - before) / np.sqrt(3)])


def _to_one_side(case: Claim) -> float:
    return max(_times(case) / DEVIATIONS, float(1 / np.sqrt(3)))


def _walk(case: Claim) -> float:
    """Variance of the random rounding error of one step, in units of its squared allowance."""
    return 2 * _times(case) / 3


def _times(case: Claim) -> int:
    """How often one step rounds numbers of the size of the whole position, or of the whole momentum."""
    kinds = case.scheme.kinds
    moves = sum(kind.drifts for kind in kinds), sum(not kind.drifts for kind in kinds)
    return max(1, len(case.scheme.b), *moves)


def _recorded(case: Claim) -> Extended:
    """Half a unit of the last decimal of recorded states (2, n), over the roundings of a step."""
    run = case.trajectory
    return run.arithmetic.recorded(case.judged.m, run.step, run.rebuilds_velocity) / case.roundings


def _allowed(
    case: Claim, worst: Extended, last: Extended, spread: Extended, deviations: float, *, random: bool
) -> Extended:
    """Bound on the roundings of all steps, in those of one: the worst case, or so many standard deviations
    next to the worst of the last step, or next to one more where they are effectively `random`."""
    how = case.trajectory.arithmetic
    # a solver errs alike at every step, with its whole error in velocities that are rebuilt from positions
    alike = case.trajectory.rebuilds_velocity and case.law.has("implicit")
    if not WIDE or how.quantum or how.stale or alike:
        return worst
    spread, beside = spread / case.roundings, last
    if how.state == how.force == Arithmetic().state and random:
        beside = np.minimum(spread, last)
    return np.asarray(np.minimum(worst, deviations * spread + beside))


def _joined(separate: bool) -> Callable[..., Extended]:
    """Combine the coordinates of q and p into pairs for each particle, or into one row of all."""
    return np.stack if separate else np.concatenate


def _turn(case: Claim, q: Extended) -> Extended:
    rows = case.system.gershgorin(q) / case.judged.m
    return np.asarray(np.longdouble(case.trajectory.step) ** 2 * np.max(rows, axis=-1))


def _apply(matrix: Extended, x: Extended) -> Extended:
    """matrix (f, [n,] d, d) times x (f, [n,] d); one matrix may serve all f."""
    if matrix.ndim == 3 and len(matrix) == 1:
        return np.asarray(x @ matrix[0].T)
    found = (matrix @ x[..., None])[..., 0]
    return np.asarray(found)


def tangent(case: Claim, q: Extended, p: Extended) -> Extended:
    """Derivative of one step at states (f, n): (f, n, 2, 2) where nothing is joined, else (f, 2n, 2n)."""
    f, n = q.shape
    separate = case.system.is_separate
    d = 2 if separate else 2 * n
    dq, dp = np.zeros((2, 1 + d, f, n), dtype=np.longdouble)
    dq[0], dp[0] = q, p
    if separate:
        dq[1], dp[2] = 1, 1
    else:
        each = np.arange(n)
        dq[1 + each, :, each] = 1
        dp[1 + n + each, :, each] = 1

    return _joined(separate)([np.moveaxis(x[1:], 0, -1) for x in _varied(case, dq, dp)], axis=-2)


def derivatives(
    case: Claim, q: Reals, p: Reals, steps: int, scaled: Sequence[Mapping[Term, Term]]
) -> tuple[Reals, Reals]:
    """Derivatives of so many steps from states (f, n) by the step and by each of these numbers, whose part of
    a term's force is another term's: (1 + d, f, n) each, in doubles.  Of scenes without friction and drives.

    Steps of h (1 + x) of q and p are those of h of q and p (1 + x) where every force is (1 + x)**2 times as
    large.
    """
    # the motion, and the derivatives below it
    at = np.zeros((2, 2 + len(scaled), *q.shape))
    at[:, 0] = q, p
    at[1, 1] = p
    with np.errstate(all="ignore"):
        for _ in range(steps):
            at = np.stack(_varied(case, at[0], at[1], scaled))
    at[1, 1] -= at[1, 0]
    return at[0, 1:], at[1, 1:]


def _varied(
    case: Claim, q: Reals, p: Reals, parts: Sequence[Mapping[Term, Term]] | None = None
) -> tuple[Reals, Reals]:
    """One step of states (1 + d, ..., n): the first is a motion, the others are its perturbations.

    With `parts` of terms they are its derivatives: the second state by the root of every force, the others by
    the strength of a part, one for each.
    """
    system = case.system

    def slope(q: Reals) -> tuple[Reals, bool]:
        # the changes solve the linear equations that belong to the motion
        k, joined = system.slope(q[0])
        return k[None], joined

    def forces(terms: Iterable[Term]) -> Force:
        terms = tuple(terms)
        whole = system.force_of(terms)
        # friction is linear in p, and so its own change where the motion is
        brakes = system.force_of(term for term in terms if term.kind == "friction")

        def force(q: Reals, p: Reals) -> Reals:
            change = brakes(np.broadcast_to(q[0], q[1:].shape), p[1:])
            for term in terms:
                term.add_change(q[0], p[0] / system.m, q[1:], p[1:] / system.m, change)
                for part, row in zip(parts or (), change[1:], strict=False):
                    if term in part:
                        part[term].add_force(q[0], p[0], row)
            now = whole(q[0], p[0])
            if parts is not None:
                change[0] += 2 * now
            return np.concatenate([now[None], change])

        return force

    return case.law.step(q, p, forces=forces, slope=slope, varied=True)
