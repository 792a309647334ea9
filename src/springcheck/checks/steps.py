"""Each recorded frame against the scheme's own steps from the frame before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from springcheck import schemes
from springcheck.checks import sight
from springcheck.checks.case import REPEATED, Case, keeps, least_moved, overflows
from springcheck.checks.check import Finding, check
from springcheck.checks.drag import drag
from springcheck.checks.requires import CLOSED, MAP, missing
from springcheck.checks.stretch import Stretch, known
from springcheck.physics.arrays import Arithmetic, Floats, Integers, Reals
from springcheck.physics.trajectory import Limits
from springcheck.text.wording import count, few, regularly


def bridges(case: Case) -> bool:
    """Whether the closed form reveals an error however long ago it was made: there is one, and at most half
    of the motion decays within the run."""
    if missing(case, CLOSED):
        return False
    decay = np.log(np.min(schemes.rotation(case.law.propagator).determinant)) * case.scene.steps / 2
    return case.area_preserving or bool(decay >= -np.log(2.0))


@check("step", family="motion", requires=MAP | {"resolved"})
def step_defect(case: Case) -> Finding | str:
    """Each step is the scheme's own step, to rounding."""
    # `arithmetic` asks for it too
    return case.clocked.once(_step_defect)


def _step_defect(case: Case) -> Finding | str:
    run = case.trajectory
    if run.every > REPEATED and (no_leap := missing(case, CLOSED)):
        return f"{run.every} steps lie between frames, and {no_leap}"
    bound, told = _allowed(case)
    if not np.any(told):
        return "between two frames a rounding may grow to the size of the motion"
    seen = np.where(told, _in_roundings(case, run.q[1:], run.p[1:]), 0)
    still = np.where(told, _in_roundings(case, run.q[:-1], run.p[:-1]), 0)
    off = ~(seen <= bound)
    if not np.any(off) and np.any(still > 0) and not np.any(still > bound):
        return f"{STILL} any step"
    worst = int(np.argmax(np.where(np.isfinite(seen), seen / bound, np.inf)))
    why = f"roundings along one step of {case.scheme.title}; does not grow with the run"
    if case.residual is not None:
        why += "; of the step itself, and of the equation of its positions"
    if case.ahead is None:
        why = f"roundings along {run.every} steps, each enlarged as the map can; does not grow with the run"
    elif run.every > 1:
        why = f"roundings of each of {run.every} steps, each carried to the frame by the steps after it"
    if not np.all(told):
        first = case.steps[int(np.argmin(told)) + 1]
        frames = count(int(np.count_nonzero(~told)), "frame")
        why += f"; {frames}, from step {first} on, where one may grow to all of it"
    why = _beyond_range(case, off) or why + _where(case, off) + _without_length(case, off)
    value, most = seen[worst], bound[worst]
    if not np.any(off) and (slow := drag(case, told)) and not slow[0] <= slow[1]:
        value, most, why = slow
    sees, hidden = _sees(case, bound, told)
    why += f"; as the engine declares: {run.arithmetic}" if str(run.arithmetic) else ""
    why += _blind(case, told, passed=bool(value <= most))
    return Finding(value, most, "roundings", why + hidden, sees)


def _allowed(case: Case) -> tuple[Floats, NDArray[np.bool_]]:
    """Bound in roundings of each frame but the first, and whether it is known there (f-1,).  Frames very many
    steps apart are judged in the energy norm over all particles."""
    if case.ahead is not None:
        told = known(case, case.ahead, case.trajectory.every)
        return np.full(len(told), float(case.roundings)), told
    # amplification of one rounding a step, over the steps from frame to frame
    total, grown = schemes.amplification(case.law.propagator, case.w, np.array([case.trajectory.every]))
    bound = np.full(len(case.steps) - 1, case.roundings * float(total[0] * grown[0]))
    told = bound * case.trajectory.arithmetic.state < 1
    return np.where(told, bound, 1), told


def are_differences(case: Case) -> bool:
    """Whether velocities are undeclared differences of the positions, over a step or two or with half a kick,
    and every step is right to what those keep."""
    run, m = case.trajectory, case.judged.m
    half = run.arithmetic.recorded(m, run.step, False)[1]
    for n, kick in ((1, 0.0), (2, 0.0), (1, 0.5)) if run.every == 1 and not run.rebuilds_velocity else ():
        q, p = (x[1 : len(x) - n + 1] for x in (run.q, run.p))
        made = m * (run.q[n:] - run.q[:-n]) / (n * run.step)
        off = np.abs(p - made - kick * run.step * case.system.force(q, p)) - half / n
        # of a product, a quotient, a kick, recording
        if np.all(off <= 4 * run.arithmetic.state * (np.abs(p) + np.abs(made))):
            declared = replace(case, trajectory=replace(run, rebuilds_velocity=True))
            return step_defect(declared).passed is True
    return False


BLIND = "cannot be judged by single steps here: rounding may be as large as they are"

NO_BETTER = "cannot be judged to better than that here: rounding is as large"


def _blind(case: Case, told: NDArray[np.bool_], *, passed: bool) -> str:
    """Name the positions and momenta that move by no more in any step than rounding may, and the others whose
    bound exceeds `OF_DIGITS` roundings of their own digits or `OF_WAY` of their range.

    Where the steps pass, also those that are off by more than `OF_RECORDING` roundings of the recording: a
    right engine may be that far off, and so may one with a wrong force.
    """
    ahead, run = case.ahead, case.trajectory
    if ahead is None:
        return ""
    states, most = np.stack([run.q, run.p]), case.roundings * ahead.allowance[:, told]
    moves = np.abs(ahead.end - states[:, :-1])[:, told]
    hidden = ~np.any(moves > most, axis=1) & np.any(moves > 0, axis=1)
    worst = np.max(most, axis=1)
    digits, way = np.max(np.abs(states), axis=1), np.ptp(states, axis=1)
    half = run.arithmetic.recorded(case.judged.m, run.step, run.rebuilds_velocity)
    known = (worst <= OF_DIGITS * (run.arithmetic.state * digits + half)) & (worst <= OF_WAY * way)
    if passed:
        ends = states[:, 1:]
        off = np.max(np.abs(ahead.end - ends)[:, told], axis=1)
        coarser = run.arithmetic.state / Arithmetic().state
        last = coarser * np.spacing(np.max(np.abs(ends), axis=1)) / 2
        known &= off <= OF_RECORDING * (last + half)
    coarse = (way > 0) & ~hidden & ~known
    return _list(case, hidden, BLIND) + _list(case, coarse, NO_BETTER, worst)


OF_DIGITS, OF_WAY = 512.0, 1e-9
"""Roundings of a number, and fraction of its range, above which the verdict says how much rounding hides."""

OF_RECORDING = 20.0
"""Departure of a number from the scheme's own, in roundings of recording it (half a unit in the last place),
above which a verdict that passes says that the number is known no better than to its bound."""


def _list(case: Case, which: NDArray[np.bool_], said: str, size: Reals | None = None) -> str:
    """List the coordinates of `which` (2, n), each with its size if sizes are given; "" for none."""
    of, axes = np.divmod(case.scene.all_places, 3)
    along = [""] * len(of) if case.scene.places is None else [f"_{'xyz'[axis]}" for axis in axes]
    names = [
        f"{'qp'[i]}{along[j]} of particle {of[j]}" + ("" if size is None else f" ({float(size[i, j]):.1e})")
        for i, j in np.argwhere(which)
    ]
    return f"; {few(names, MOST_LISTED)} {said}" if names else ""


MOST_LISTED = 4


def _sees(case: Case, bound: Floats, told: NDArray[np.bool_]) -> tuple[Limits, str]:
    """The limits of detection that the bound leaves, by each degree of freedom where it has its own."""
    # a clock stands at the times that were recorded, whatever step the engine takes
    particles = np.arange(case.scene.n) < case.scene.n - case.scene.system.is_driven
    ahead = case.ahead
    if ahead is None:
        unit = case.allowance_of_stretches * bound

        def whole(at: Integers, change: sight.States) -> Reals:
            return case.system.norm.size(*(x * particles for x in change)) / unit[at]

        return sight.of_steps(case, told, whole)
    most = case.roundings * ahead.allowance

    def part(at: Integers, change: sight.States) -> Reals:
        left = _left(case, *change, at) / case.roundings
        return np.stack([change[0] / most[0, at], change[1] / most[1, at], left]) * particles

    return sight.of_steps(case, told, part)


SELDOM = 0.25
"""Largest share of frames off that something which acts in some steps alone explains."""

STANDS_APART = 64.0
"""Ratio to the bound from which frames off stand apart: of what acts in every step, and keeps the bound in
three of four, none is so far above it."""


def seldom_off(case: Case) -> tuple[int, str]:
    """The first frame that is not the scheme's own after the frame before, 0 where none is; and where few
    are, and far off, so that nothing which acts in every step explains them, a sentence on these."""
    if missing(case, MAP):
        return 0, ""
    case = case.clocked
    bound, told = _allowed(case)
    seen = _in_roundings(case, case.trajectory.q[1:], case.trajectory.p[1:]) / bound
    off = ~(seen <= 1) & told
    first, number, of = int(np.argmax(off)) + 1, int(np.count_nonzero(off)), int(np.count_nonzero(told))
    if not 0 < number <= SELDOM * of or np.any(seen[off] <= STANDS_APART):
        return first * (number > 0), ""
    where = f"{'the first ' * (number > 1)}at step {case.steps[first]}{_regularly(case, off)}"
    does = "does not follow" if number == 1 else "do not follow"
    return first, (
        f"{number} of {of} frames {does} from the one before, {where}, and all others do to rounding: "
        "something acts there alone"
    )


def _where(case: Case, off: NDArray[np.bool_]) -> str:
    """The step of the first wrong frame, and the number of wrong frames (f-1,)."""
    if not np.any(off):
        return ""
    step, number = case.steps[int(np.argmax(off)) + 1], int(np.count_nonzero(off))
    several = f"the first of {number} wrong frames is at step {step}{_regularly(case, off)}"
    return f"; {several}" if number > 1 else f"; one frame is wrong, at step {step}"


def _regularly(case: Case, off: NDArray[np.bool_]) -> str:
    """How often runs of frames that are wrong (f-1,) begin, if it is regular."""
    return regularly(case.steps[1:][off & ~np.append(False, off[:-1])].tolist(), "step")


STILL = "standing still would pass: rounding may be as large as"
"""An engine that does not move passes such a check too, so a pass proves nothing there."""


def _in_roundings(case: Case, to_q: Floats, to_p: Floats) -> Reals:
    """How far states are from the scheme's own after each frame but the last (f-1,), in roundings."""
    if case.ahead is not None:
        off = to_q - case.ahead.end[0], to_p - case.ahead.end[1]
        left = np.max(_left(case, *off), axis=1)
        return np.asarray(np.maximum(_off(case.ahead, to_q, to_p), left))
    q, p = case.next_states
    size = case.system.norm.size(q - to_q, p - to_p)
    return np.asarray(size / case.allowance_of_stretches)


def _left(case: Case, off_q: Reals, off_p: Reals, at: Integers | slice = slice(None)) -> Reals:
    """Residual of an implicit step's equation for positions (`Case.residual`) for errors (r, n) of the states
    after these frames, in units of its rounding; 0 for an explicit scheme."""
    if case.residual is None:
        return np.zeros_like(off_q)
    way, added = case.residual
    return np.asarray(np.abs(off_q - way * off_p) / added[at], dtype=np.longdouble)


def _off(ahead: Stretch, to_q: Floats, to_p: Floats) -> Reals:
    """Distance of states from the ends of stretches, in allowances of the degree of freedom farthest off."""
    off = np.abs(ahead.end - np.stack([to_q, to_p]))
    # where nothing rounds nothing may be off: 0 of 0 is 0
    return np.asarray(np.max(np.where(off == 0, 0, off / ahead.allowance), axis=(0, 2)))


def _beyond_range(case: Case, off: NDArray[np.bool_]) -> str:
    """The limit of the engine's arithmetic that explains all steps that are wrong (f-1,), or ""."""
    run, how, limit, does = case.trajectory, case.trajectory.arithmetic, "", ""
    if not np.any(off):
        return ""
    first = int(np.argmax(off))
    if np.isfinite(how.overflow) and np.all(case.strongest[off] >= how.overflow):
        limit, does = overflows(how), f"has a force of {case.strongest[first]:.3g}"
    if how.stale and run.every == 1:
        moved = least_moved(np.max(np.abs(np.diff(run.q, axis=0)), axis=1))
        if np.all(moved[off] <= 2 * how.stale):
            limit, does = keeps(how), f"moves by {moved[first]:.3g}"
    step = case.steps[first + 1]
    return f"the engine's limit: {limit}, and step {step}, the first that is wrong, {does}" if limit else ""


SHORTEST = float(np.sqrt(np.finfo(np.float64).smallest_normal))
"""Length below which the square of a length underflows."""


def _without_length(case: Case, off: NDArray[np.bool_]) -> str:
    """Why steps (f-1,) may be off where all positions are too small to be squared, or ""."""
    largest = float(np.max(np.abs(case.trajectory.q[:-1][off]), initial=0.0))
    if not 0 < largest < SHORTEST:
        return ""
    return (
        f"; positions up to {largest:.3g} have squares that underflow: an engine that takes forces from the "
        "lengths of bonds has none there"
    )


def fastest(case: Case) -> float:
    """Gershgorin's bound of the frequencies and rates met on the whole trajectory [1/T]."""
    q = case.trajectory.q
    steepest = np.max(case.system.gershgorin(q.astype(np.longdouble)) / case.judged.m)
    braked = np.max(np.abs(case.system.friction_at(q)[0])) if case.system.brakes_by_place else 0.0
    return float(np.sqrt(steepest) + np.max(case.system.friction_rates) + float(braked))


@check("arith", family="motion", requires=MAP | {"resolved"})
def arithmetic(case: Case) -> Finding | str:
    """The size of the step defect is that of the stated arithmetic."""
    named = case.trajectory.arithmetic
    plain = Arithmetic()
    if named.is_double and named.force <= plain.force and not named.quantum:
        return "plain double precision: the step defect covers it"
    case = case.clocked
    seen = case.once(_step_defect)
    if isinstance(seen, str):
        return seen
    # over many steps the bound is a sum, of which roundings that are as good as random fill a part
    alone = seen.value
    if case.ahead is not None and case.trajectory.every > 1:
        told = known(case, case.ahead, case.trajectory.every)
        last = replace(case.ahead, allowance=case.ahead.last)
        alone = float(np.max(_off(last, case.trajectory.q[1:], case.trajectory.p[1:])[told]))
    finer = Case(trajectory=replace(case.trajectory, arithmetic=plain), scene=case.judged)
    coarser, fine = (float(np.max(x.system.norm.most(*x.allowance))) for x in (case, finer))
    # at rest the only rounding is underflow, which is the same in both; binary numbers may need none
    if alone == 0 or coarser < fine / FLOOR or len(case.trajectory.t) < ENOUGH:
        return "its coarser parts do not show in these states"
    if not seen.value <= seen.bound:
        return seen
    why = f"{named.name} precision: more is worse arithmetic, less than 1/256 of a rounding is better"
    return seen._replace(why=why, holds=bool(alone >= FLOOR))


FLOOR = 2.0**-8
"""A random rounding stays below this fraction of its unit once in 2**8 times."""

ENOUGH = 9
"""Frames of which all stay below `FLOOR` by chance once in 2**64 times: 8 steps, or fewer particles."""
