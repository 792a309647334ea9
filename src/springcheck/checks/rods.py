"""Checks of rods: lengths, relative velocities along them, and the angle of rotation of a step."""

from __future__ import annotations

import numpy as np

from springcheck import bath as baths
from springcheck import schemes
from springcheck.bath import THERMOSTATS
from springcheck.bath.catalogue import PROJECT
from springcheck.checks.case import Case
from springcheck.checks.check import Finding, check, largest
from springcheck.checks.requires import MAP, missing
from springcheck.checks.thermal import reading, thermostat
from springcheck.physics.exact.closedform import PI
from springcheck.physics.rods import START_TOLERANCE, Rods
from springcheck.physics.trajectory import Limits
from springcheck.text.wording import count


def _rods(case: Case) -> Rods:
    found = case.system.rods
    assert found is not None
    return found


HELD_RIGID = frozenset({"named", "two-frames", "rods"})
"""Requirements of a check of rods."""


@check("length", family="motion", requires=HELD_RIGID, telling=False)
def rod_length(case: Case) -> Finding:
    """Every rod has its length at every frame, to rounding or to the tolerance that its engine declares."""
    rods, how = _rods(case), case.trajectory.arithmetic
    q = case.trajectory.q[1:].astype(np.longdouble)
    heated = case.law.has("random")
    roundings = baths.rounding.roundings_of(thermostat(case), case.judged) if heated else case.roundings
    off = np.abs(rods.strain(q))
    half = how.recorded(case.judged.m, case.trajectory.step, rebuilt=False)[0]
    bound = roundings * how.state * (1 + rods.magnitude(q)) + how.lengths + rods.spans(half) / rods.length
    worst = largest(off / bound)
    why = f"roundings along one step of {case.scheme.title}, of lengths and of positions"
    if how.lengths:
        why += f", and the tolerance {how.lengths:g} of the engine's solver, which is not its error"
    lost = ~np.isfinite(case.next_states[0] if case.scheme.has("one-step") else q).all(axis=1)
    if np.any(lost):
        step = int(case.steps[int(np.argmax(lost))])
        why += f"; after step {step} a rod turns by h w of 1 or more, and no push along it keeps its length"
    elif heated and np.any(wrong := np.any(~(off <= bound), axis=1)):
        # rates at the frames beside the step: draws may have rotated the rod three times as fast as usual
        i = int(np.argmax(wrong))
        near = rods.rates(case.trajectory.q[i : i + 2], case.trajectory.p[i : i + 2])
        usual = np.sqrt(case.judged.thermal * rods.inverse_mass) / rods.length
        turn, more = (float(abs(case.judged.step) * np.max(w)) for w in (near, usual))
        if turn + 3 * more >= 1:
            why += (
                f"; first at step {case.steps[i + 1]}, where a rod turns by h w = {turn:.2g} beside draws of "
            )
            why += f"{more:.2g}: from 1 on no push along it keeps its length; take a shorter step"
    return Finding(off[worst], bound[worst], "of the length", why)


@check("along", family="motion", requires=HELD_RIGID, telling=False)
def rod_velocity(case: Case) -> Finding | str:
    """The ends of a rod have one velocity along it, to rounding."""
    rods, bath, heated = _rods(case), THERMOSTATS.get(case.trajectory.scheme), case.law.has("random")
    if bath and bath.held and bath.held[-1] != PROJECT:
        return "momenta are stored as the drift leaves them, with what is taken off them in the next step"
    # the sum over a step depends on its draws, which frames further apart do not determine
    if why := missing(case, {"every-step"} if heated else {"one-step"}):
        return why
    if heated:
        found = reading(case)
        assert found.allowed is not None
        roundings, of_p = found.roundings, found.allowed[1]
    else:
        roundings, of_p = case.roundings, case.allowance[1]
    q, p = (x[-len(of_p) :].astype(np.longdouble) for x in (case.trajectory.q, case.trajectory.p))
    r, m = rods.ways(q), case.judged.m
    off = np.abs(rods.dot(r, rods.apart(p / m)))
    unit = rods.sum_of_sizes(r, of_p / m)
    # where a step has no solution its momenta are not known
    if not np.any(np.isfinite(unit)):
        return "no step has a solution whose rounding is known"
    seen = np.where((off == 0) | ~np.isfinite(unit), 0, off / unit)
    worst = largest(seen)
    why = f"roundings along one step of {case.scheme.title}; does not grow with the run"
    return Finding(seen[worst], roundings, "roundings", why)


@check("turn", family="motion", requires=MAP | {"rods", "turning"})
def turn(case: Case) -> Finding | str:
    """A rod that turns freely turns by asin(h w) in a drift of h, w that of the start, at every step."""
    # SHAKE pushes along the rod as it lay before the drift, of length l, and the drift moves its ends apart
    # by h v across it: the rod rotates by the angle with the sine h |v| / l = h w. The projection keeps w
    rods, run, m = _rods(case), case.trajectory, case.judged.m
    steps, (q0, p0) = case.begun
    w = rods.rates(q0, p0)
    # rounding errors of momenta along a line are no rotation
    w = np.where(w * rods.length > START_TOLERANCE * rods.spans(np.abs(p0) / m), w, 0)
    if not np.any(w > 0):
        return "no rod turns"
    parts = [c for kind, (_, c) in zip(case.scheme.kinds, case.scheme.stages, strict=True) if kind.drifts]
    x = np.array([schemes.number(c, np.longdouble) for c in parts]) * np.longdouble(run.step)
    each = np.sum(np.arcsin(x[:, None] * w), axis=0)
    steeper = np.sum(np.abs(x)[:, None] / np.sqrt(1 - (x[:, None] * w) ** 2), axis=0)
    r, n = rods.ways(run.q.astype(np.longdouble)), steps[:, None].astype(np.longdouble)
    first, across = rods.ways(q0), rods.apart(p0 / m)
    angle = np.arctan2(rods.dot(r, across) / np.where(w > 0, w, 1), rods.dot(r, first))
    off = angle - n * each
    off = np.abs(off - 2 * PI * np.round(off / (2 * PI)))[1:]
    square = rods.length**2
    of_q, of_p = (np.maximum.accumulate(one) for one in case.allowance)
    of_angle = rods.sum_of_sizes(r[1:], of_q) / square
    of_rate = rods.spans(of_p / m) / rods.length
    bound = case.roundings * (n[1:] * of_angle + n[1:] * (n[1:] + 1) / 2 * of_rate * steeper)
    ratio = np.where(w > 0, off / bound, 0)
    worst = largest(ratio)
    whole = n[1:] * np.abs(each)
    if ratio[worst] <= 1 and not np.any(whole > bound):
        return "rounding may be as large as all of the turn"
    why = (
        f"roundings of {count(int(steps[1:][worst[0]]), 'step')}, of angle and rate, all of one sign; "
        f"a step turns by {float(each[worst[1]]):.6g} where h w = {float(abs(run.step) * w[worst[1]]):.6g}"
    )
    sees = Limits(step=float(np.min(np.where(w > 0, bound / whole, np.inf))))
    return Finding(off[worst], bound[worst], "rad", why, sees)
