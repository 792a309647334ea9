"""Checks of a recorded trajectory, or of a piece of one: they need no further run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from springcheck import schemes
from springcheck.arrays import Extended, Floats, Reals
from springcheck.checks.case import REPEATED, Case, overflows
from springcheck.engines.contract import Arithmetic
from springcheck.physics import exact
from springcheck.physics.system import MOST_JOINED
from springcheck.trajectory import Verdict

CONTRACTED = 1e-3
"""Determinant of a step below which its powers are not formed: as the difference of two products it has
lost 3 of the 19 digits of the reference there."""


def _no_map(case: Case) -> str | None:
    """Why a check of the scheme's one-step map does not apply, or None."""
    if not case.scheme.one_step:
        return "an adaptive solver has no one-step map; it is judged by its tolerance"
    if len(case.trajectory.t) < 2:
        return "there is no second frame"
    return None


def start(case: Case) -> Verdict:
    """Row 0 is the start, exactly."""
    run, scene = case.trajectory, case.scene
    if case.steps[0] != 0:
        return case.not_applicable("start", "this piece does not hold the start")
    value = float(np.max(np.abs([run.q[0] - scene.q, run.p[0] - scene.p])))
    return case.verdict("start", value, 0.0, "", "the start is recorded, not computed")


def times(case: Case) -> Verdict:
    """Times are the number of steps times the step, rounded once, up to where the run says it ended."""
    run = case.trajectory
    off = np.abs(run.t - case.steps * run.step)
    missing = abs(float(case.steps[-1]) - run.outcome.step) * abs(run.step)
    value = float(np.max([*off, missing]))
    return case.verdict("times", value, 0.0, "T", "one product, no accumulation; the last frame is the end")


def line(case: Case) -> Verdict:
    """y and z stay exactly 0."""
    off = case.trajectory.off_axis
    if off is None:
        return case.not_applicable("line", "the engine moves along a line only")
    return case.verdict("line", off, 0.0, "L", "every force along y and z is a product with 0")


def step_defect(case: Case) -> Verdict:
    """Each step is the scheme's own step, to rounding."""
    why_not = _no_map(case)
    if why_not:
        return case.not_applicable("step-defect", why_not)
    run = case.trajectory
    if run.every > REPEATED and (no_leap := _closed(case)):
        return case.not_applicable("step-defect", f"{run.every} steps lie between frames, and {no_leap}")
    if run.every == 1:
        bound = np.full(len(run.t) - 1, float(case.roundings))
        why = f"roundings along one step of {case.scheme.title}; does not grow with the run"
    else:
        bound = case.roundings * _amplified(case, run.every)
        if not bound[0] * run.arithmetic.state < 1:
            return case.not_applicable(
                "step-defect", "between two frames a rounding may grow to the whole motion"
            )
        why = f"roundings along {run.every} steps, each enlarged as the map can; does not grow with the run"
    seen, told = _defects(case), bound * run.arithmetic.state < 1
    if not np.all(told):
        # a motion that has grown steeper since: what rounding can do there is no smaller than the motion
        seen, bound = seen[told], bound[told]
        why += f"; judged up to step {case.steps[len(seen)]}, beyond which it may grow to the whole motion"
    off = ~(seen <= bound)
    still = _in_roundings(case, run.q[:-1], run.p[:-1])[: len(seen)]
    if not np.any(off) and np.any(still > 0) and not np.any(still > bound):
        return case.not_applicable("step-defect", f"{STILL} any step")
    worst = int(np.argmax(np.where(np.isfinite(seen), seen / bound, np.inf)))
    why = _beyond_range(case, np.pad(off, (0, len(told) - len(off)))) or why
    return case.verdict("step-defect", float(seen[worst]), float(bound[worst]), "roundings", why)


STILL = "standing still would pass: rounding may be as large as"
"""A check that an engine passes which does not move says nothing of one that does."""


def _defects(case: Case) -> Reals:
    """How far each frame is from the scheme's own steps after the frame before (f-1,), in roundings."""
    return _in_roundings(case, case.trajectory.q[1:], case.trajectory.p[1:])


def _in_roundings(case: Case, to_q: Floats, to_p: Floats) -> Reals:
    """How far states are from the scheme's own after each frame but the last (f-1,), in roundings."""
    q, p = case.next_states
    dq, dp = np.abs(q - to_q), np.abs(p - to_p)
    if case.trajectory.every == 1:
        of_q, of_p = case.allowance
        return np.asarray(np.max(np.maximum(dq / of_q, dp / of_p), axis=1))
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(case.norm.size(dq, dp) / case.allowance_of_stretches)


def _beyond_range(case: Case, off: NDArray[np.bool_]) -> str:
    """The limit of the engine's arithmetic that explains every step that is off (f-1,), or nothing."""
    how = case.trajectory.arithmetic
    if not np.isfinite(how.overflow) or not np.any(off) or not np.all(case.strongest[off] >= how.overflow):
        return ""
    first = int(np.argmax(off))
    return (
        f"the engine's limit: {overflows(how)}, and step {case.steps[first + 1]}, the first that is off, "
        f"has a force of {case.strongest[first]:.3g}"
    )


def _amplified(case: Case, steps: int) -> Floats:
    """What the map can make of one rounding a step in so many steps, from each frame but the last (f-1,)."""
    if case.linear:
        total, grown = schemes.amplification(case.matrices, case.w, np.array([steps]))
        return np.full(len(case.steps) - 1, float(total[0] * grown[0]))
    with np.errstate(over="ignore", invalid="ignore"):
        growth = abs(case.trajectory.step) * rates_met(case, case.trajectory.q[:-1], case.next_states[0])
        return np.where(growth > 0, ((1 + growth) ** steps - 1) / np.where(growth > 0, growth, 1), steps)


def rates_met(case: Case, *states: Reals) -> Floats:
    """Upper bound of the frequencies and rates met up to each of the states (f, n) -> (f,) [1/T].

    By Gershgorin's circles.
    """
    rows = [case.judged.system.gershgorin(q.astype(np.longdouble)) / case.judged.m for q in states]
    steepest = np.maximum.accumulate(np.max(np.concatenate(rows, axis=-1), axis=-1))
    return np.asarray(np.sqrt(steepest) + np.max(case.judged.system.friction_rates), np.float64)


def fastest(case: Case) -> float:
    """The same, of the whole trajectory."""
    return float(rates_met(case, case.trajectory.q)[-1])


def _closed(case: Case) -> str | None:
    reason = _no_map(case)
    if reason:
        return reason
    if case.mixed:
        return "slow and fast springs act at different times: no normal mode stays by itself"
    if not case.linear:
        return (
            "no closed form of the discrete motion: the scene is anharmonic, or friction couples its modes, "
            f"or more than {MOST_JOINED} particles are joined"
        )
    if np.any((case.modes.w2 == 0) & (case.modes.pull != 0)):
        return "a mode under a constant pull has no closed form here"
    determinant = schemes.rotation(case.matrices).determinant
    if np.any(determinant <= 0):
        return "the step turns area over: it has no phase"
    if np.any(determinant < CONTRACTED):
        return "friction contracts area more in one step than the reference has digits for"
    return None


def growth_bound(case: Case) -> tuple[Floats, Floats]:
    """Bound on the distance from the closed form at each frame, in units of one rounding, and that unit.

    One rounding a step, enlarged by the map from the step where it arises, and all of one sign.
    """
    bound, unit = case.growth
    with np.errstate(divide="ignore", over="ignore"):
        return bound, np.asarray(unit / case.norm.unit, np.float64)


def closed_form(case: Case) -> Verdict:
    """The whole motion is the closed-form motion of the scheme, phase 2 asin(h w/2) and all."""
    why_not = _closed(case)
    if why_not:
        return case.not_applicable("closed-form", why_not)
    y, v = case.closed_states
    q, p = case.modes.out_of(y + case.modes.centre(), v)
    distance = case.norm.size(case.trajectory.q - q, case.trajectory.p - p)
    moved = case.norm.size(q - case.scene.q, p - case.scene.p)
    bound, unit = case.growth
    late = case.steps > 0
    allowed = np.where(late, bound * unit, 1)
    ratio = np.where(late, distance / allowed, 0)
    worst = int(np.argmax(np.where(np.isfinite(ratio), ratio, np.inf)))
    if ratio[worst] <= 1 and np.any(moved > 0) and not np.any(late & (moved > allowed)):
        return case.not_applicable("closed-form", f"{STILL} the motion")
    return case.verdict(
        "closed-form",
        float(distance[worst] / unit[worst]),
        float(bound[worst]),
        "roundings",
        f"one rounding of each of {case.steps[worst]} steps, carried on by the map, all of one sign"
        + _untold(case, np.maximum.accumulate(moved) <= allowed, "motion"),
    )


def _untold(case: Case, drowned: NDArray[np.bool_], what: str) -> str:
    """From where on a check says nothing any more because its bound is as large as what it looks at."""
    late = np.flatnonzero(~drowned)
    if not len(late) or late[-1] == len(drowned) - 1:
        return ""
    return f"; says nothing from step {case.steps[late[-1] + 1]} on, where that may be all of the {what}"


def shadow_energy(case: Case) -> Verdict:
    """The scheme's own energy of each mode is kept, or changes by its exact factor, to rounding."""
    why_not = _closed(case)
    if why_not:
        return case.not_applicable("shadow-energy", why_not)
    run = case.trajectory
    form = schemes.invariant(case.matrices, h=run.step)
    y, v = case.modes.into(run.q, run.p)
    u = y - case.modes.centre()
    stored = form[:, 0] * u * u + form[:, 1] * u * v + form[:, 2] * v * v
    turn = schemes.rotation(case.matrices)
    factor = np.ones_like(turn.determinant) if case.area_preserving else turn.determinant
    y0, v0 = case.modes.into(case.scene.q, case.scene.p)
    u0 = y0 - case.modes.centre()
    first = form[:, 0] * u0 * u0 + form[:, 1] * u0 * v0 + form[:, 2] * v0 * v0
    expected = first * factor ** case.steps[:, None].astype(np.longdouble)
    # |dE| <= 2 |z| |dz| in the form's own norm, whose size beside the energy's is `shape`
    shape = np.max(np.abs(form[:, 0]) / case.w**2 + np.abs(form[:, 1]) / case.w + np.abs(form[:, 2]))
    _, unit = case.growth
    size = np.maximum.accumulate(case.norm.size(run.q - _rest(case), run.p))
    if case.steps[0] != 0:
        size = np.maximum(size, case.norm.size(case.envelope[0] - np.abs(_rest(case)), case.envelope[1]))
    scale = 2 * shape * size * unit
    off = np.max(np.abs(stored - expected), axis=1)
    late = case.steps > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = np.where(late & (off != 0), off / scale, 0)
    limit = np.where(late, case.roundings * np.maximum(case.steps, 1), 1)
    worst = int(np.argmax(np.where(np.isfinite(seen), seen / limit, np.inf)))
    energy = np.max(np.abs(expected), axis=1)
    if seen[worst] <= limit[worst] and np.any(energy > 0) and not np.any(late & (energy > limit * scale)):
        return case.not_applicable("shadow-energy", "rounding may be as large as the energy")
    return case.verdict(
        "shadow-energy",
        float(seen[worst]),
        float(limit[worst]),
        "roundings",
        f"{case.steps[worst]} steps, each rounded {case.roundings} times, all of one sign"
        + _untold(case, energy <= limit * scale, "energy"),
    )


def _rest(case: Case) -> Floats:
    q, _ = case.modes.out_of(case.modes.centre(), np.zeros_like(case.modes.w2))
    return np.asarray(q, np.float64)


def frequency(case: Case) -> Verdict:
    """The phase turns by the scheme's own frequency, to rounding."""
    why_not = _closed(case)
    if why_not:
        return case.not_applicable("frequency", why_not)
    if case.scene.system.is_damped:
        return case.not_applicable("frequency", "a phase that decays is seen in the closed form")
    turn = schemes.rotation(case.matrices)
    y0, v0 = case.modes.into(case.scene.q, case.scene.p)
    u0 = y0 - case.modes.centre()
    strength = np.where(turn.angle > 0, np.hypot(case.w * u0, v0), -1)
    j = int(np.argmax(strength))
    if strength[j] <= 0:
        return case.not_applicable("frequency", "no mode oscillates")
    form = schemes.invariant(case.matrices, h=case.trajectory.step)[j]
    y, v = case.modes.into(case.trajectory.q[-1], case.trajectory.p[-1])
    steps = int(case.steps[-1])
    if steps == 0:
        return case.not_applicable("frequency", "nothing has moved yet")
    # in the coordinates of the invariant form a step is a plain rotation by -angle
    phase = _phase(form, (y - case.modes.centre())[j], v[j]) - _phase(form, u0[j], v0[j])
    # on an inverted spring a scheme that goes back on part of its way can turn the other way
    backwards = np.sign(case.matrices[j, 0, 1])
    expected = backwards * turn.angle[j] * np.longdouble(steps)
    off = phase - expected
    off -= 2 * np.pi * np.round(off / (2 * np.pi)) if np.isfinite(off) else 0
    off -= _LOW_TWO_PI * np.round((phase - expected) / (2 * np.pi))
    bound, unit = case.growth
    # where the mode ought to be: one that has come to nothing would excuse any phase
    own_y, own_v = case.closed_states
    # extended: a motion that spirals out is squared here, up to the end of double's range
    mode = np.abs(np.hypot(case.w[j] * own_y[-1, j], own_v[-1, j]))
    wide = unit[-1] * np.sqrt(np.longdouble(2))
    # an error e of a state of size z turns its phase by e/z, times the ratio of the ellipse's axes
    shape = schemes.condition(case.matrices, case.w)[j]
    angle = bound[-1] * (wide / mode) * shape
    if angle >= 1:
        return case.not_applicable(
            "frequency", "rounding may be as large as the mode, which has no phase then"
        )
    if angle >= abs(expected):
        return case.not_applicable("frequency", f"{STILL} the whole turn")
    limit = float(angle / abs(expected))
    true = float(turn.angle[j] / (abs(np.longdouble(case.trajectory.step)) * case.w[j]) - 1)
    return case.verdict(
        "frequency",
        float(abs(off) / abs(expected)),
        limit,
        "relative",
        f"the closed form's bound as an angle; the scheme itself is off the true frequency by {true:.2e}",
    )


_LOW_TWO_PI = 2 * (np.longdouble("3.14159265358979323846264338327950288") - np.longdouble(np.pi))
"""What the double 2 pi lacks."""


def _phase(form: Extended, u: np.longdouble, v: np.longdouble) -> np.longdouble:
    if not (np.isfinite(u) and np.isfinite(v)):
        return np.longdouble(np.nan)
    x = np.sqrt(np.abs(form[0] - form[1] ** 2 / (4 * form[2]))) * u
    y = np.sqrt(np.abs(form[2])) * (v + form[1] / (2 * form[2]) * u)
    return np.longdouble(np.arctan2(-y, x))


def momentum(case: Case) -> Verdict:
    """Nothing outside pulls, so the total momentum stays."""
    if any(term.bodies == 1 for term in case.scene.terms):
        return case.not_applicable("momentum", "walls or wells take up momentum")
    if not case.scheme.one_step:
        return case.not_applicable("momentum", "an adaptive solver is judged by its tolerance")
    run = case.trajectory
    if len(run.t) < 2:
        return case.not_applicable("momentum", "there is no second frame")
    total = np.sum(run.p.astype(np.longdouble), axis=1)
    steps, first = case.steps, np.sum(case.scene.p.astype(np.longdouble))
    # at both ends of each stretch between frames, for a motion that grows along it
    with np.errstate(over="ignore", invalid="ignore"):
        _, of_p = case.allowance_at(run.q, run.p)
    unit = np.maximum.accumulate(np.sum(of_p, axis=1))[1:]
    if steps[0] != 0 and case.linear:
        unit = np.maximum(unit, np.sum(case.allowance_at(*case.envelope)[1]))
    elif steps[0] != 0:
        # nothing bounds the motion before this piece: it is judged from its own first frame on
        steps, first = steps - steps[0], total[0]
    off = np.abs(total - first)[1:]
    limit = case.roundings * steps[1:].astype(np.float64)
    # a step from a state near the end of all numbers may leave even the range of its own bound
    finite = np.all(np.isfinite(run.q) & np.isfinite(run.p), axis=1)
    beyond = np.asarray(finite)[1:] & ~np.isfinite(unit)
    seen = np.asarray(off / np.where(beyond, np.inf, unit), np.float64)
    worst = int(np.argmax(seen / limit))
    size = np.maximum.accumulate(np.sum(np.abs(run.p), axis=1))[1:]
    if seen[worst] <= limit[worst] and np.any(size > 0) and not np.any(~beyond & (size > limit * unit)):
        return case.not_applicable("momentum", "rounding may be as large as all momenta together")
    return case.verdict(
        "momentum",
        float(seen[worst]),
        float(limit[worst]),
        "roundings",
        f"forces cancel in pairs; {steps[worst + 1]} steps, each rounded, all of one sign",
    )


def energies(case: Case) -> Verdict:
    """Stored energies are those of the stored states, bit for bit."""
    run = case.trajectory
    if run.energy is None:
        return case.not_applicable("energies", "the scene keeps no energies")
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        again = np.asarray(case.scene.system.energy(run.q, run.p), np.float64)
    same = (again == run.energy) | (np.isnan(again) & np.isnan(run.energy))
    # the energy of finite states may overflow; states that are no numbers have none
    same &= np.isfinite(run.q).all(axis=1) & np.isfinite(run.p).all(axis=1)
    value = float(np.count_nonzero(~same))
    return case.verdict("energies", value, 0.0, "frames", "one formula, one order of operations")


def tolerance(case: Case) -> Verdict:
    """The error of an adaptive solver is what its tolerance allows."""
    run = case.trajectory
    if case.scheme.one_step or run.tolerance is None:
        return case.not_applicable("tolerance", "a method of fixed step has no tolerance")
    if not exact.has_true_motion(case.scene):
        return case.not_applicable("tolerance", "the true motion of this scene has no closed form")
    q, p = exact.true_motion(case.scene, case.steps, run.step)
    value = float(np.max(case.norm(run.q - q, run.p - p)))
    # sizes of the true motion: those of one that explodes would excuse it
    true = replace(run, q=np.asarray(q, np.float64), p=np.asarray(p, np.float64))
    bound = tolerance_bound(Case(trajectory=true, scene=case.scene))
    moved = np.max(case.norm(q - case.scene.q, p - case.scene.p))
    if value <= bound and 0 < moved <= bound:
        return case.not_applicable("tolerance", "standing still would pass: it allows all of the motion")
    return case.verdict(
        "tolerance",
        value,
        bound,
        "of the start",
        f"{run.tolerance:g} a step of every component, at most {run.force_calls} internal steps",
    )


def tolerance_bound(case: Case) -> float:
    """What an adaptive solver's errors may add up to, in units of the start.

    CVODE and IDA keep the weighted root mean square of the 2n local errors below 1, each weighed by the
    tolerance times its size and its amplitude; all of it may lie in the component that counts most.  There
    are no more steps than force calls.  An unstable motion itself carries errors apart; in an anharmonic
    one an error of the energy shifts the frequency, and so the phase for the rest of the run.
    """
    run = case.trajectory
    duration = abs(float(run.t[-1]))
    growth = np.longdouble(1)
    states = run.q, run.p
    if not case.scene.system.is_linear:
        growth += fastest(case) * duration / 2
    elif case.linear and np.any(case.modes.w2 < 0):
        turn = np.sqrt(np.max(-case.modes.w2)) * duration
        with np.errstate(over="ignore"):
            growth = np.exp(turn) * max(turn, np.longdouble(1))
        if case.scene.system.is_separate:
            # what a state has grown to, an error made there no longer grows: from the start, both together
            states = case.scene.q[None], case.scene.p[None]
    local = _worst_local_error(case, *states)
    with np.errstate(over="ignore"):
        return float((run.tolerance or 0.0) * run.force_calls * local * growth)


def _worst_local_error(case: Case, q: Floats, p: Floats) -> np.longdouble:
    """The largest local error at states (f, n) that passes, in tolerances and in units of the start."""
    scene = case.judged
    # extended: the squares of large states leave the range of a double
    of_q, of_p = (x.astype(np.longdouble) for x in scene.system.amplitudes)
    weight_q, weight_p = np.max(np.abs(q), axis=0) + of_q, np.max(np.abs(p), axis=0) + of_p
    # (du)**2 of a spring is at most twice the sum of its ends' squares; nothing held: see `Norm`
    stiff = scene.system.rigidity.copy()
    for group in case.norm.groups:
        stiff[group] += scene.m[group] / case.norm.duration**2
    largest = np.max(np.maximum(stiff * weight_q**2, weight_p**2 / scene.m)) / 2
    if largest == 0:
        return np.longdouble(0)
    with np.errstate(divide="ignore"):
        return np.longdouble(np.sqrt(2 * scene.n * largest) / case.norm.unit)


def arithmetic(case: Case) -> Verdict:
    """The size of the step defect is that of the arithmetic the method says it has."""
    why_not = _no_map(case)
    if why_not:
        return case.not_applicable("arithmetic", why_not)
    named = case.trajectory.arithmetic
    plain = Arithmetic()
    if named.state <= plain.state and named.force <= plain.force and not named.quantum:
        return case.not_applicable("arithmetic", "plain double precision: the step defect says it all")
    seen = step_defect(case)
    if seen.passed is None:
        return case.not_applicable("arithmetic", seen.why)
    finer = Case(trajectory=replace(case.trajectory, arithmetic=plain), scene=case.judged)
    coarser, fine = (float(np.max(x.norm.size(*x.allowance))) for x in (case, finer))
    # at rest the only rounding is underflow, which is the same in both
    if coarser < fine / FLOOR or len(case.trajectory.t) < ENOUGH:
        return case.not_applicable("arithmetic", "its coarser parts do not show in these states")
    return Verdict(
        method=seen.method,
        check="arithmetic",
        value=seen.value,
        bound=seen.bound,
        unit=seen.unit,
        passed=bool(FLOOR <= seen.value <= seen.bound),
        why=seen.why
        if seen.passed is False
        else f"{named.name} precision: more is worse arithmetic, less than 1/256 of a rounding is better",
    )


FLOOR = 2.0**-8
"""A rounding that is as good as random stays below this fraction of its unit once in 2**8 times."""
ENOUGH = 9
"""Frames of which all stay below `FLOOR` by chance once in 2**64 times: 8 steps, or fewer particles."""
