"""Checks of the one-step map that need runs of their own: its matrix, its invariants, its reversibility."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck import schemes
from springcheck.checks import sight
from springcheck.checks.bench import Bench
from springcheck.checks.case import Case
from springcheck.checks.check import Finding, check, largest
from springcheck.checks.steps import step_defect
from springcheck.checks.stretch import follow, known
from springcheck.physics.arrays import Extended, Floats, Integers, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import NOT_KNOWN, Limits, Trajectory
from springcheck.text.wording import count

MATRIX = frozenset({"named", "one-step", "linear", "modes", "few", "resolved"})
"""Requirements of the recovery of a one-step matrix."""


@check("matrix", family="map", requires=MATRIX)
def propagator(bench: Bench) -> Finding | str:
    """The one-step matrix, recovered from single steps, is the scheme's."""
    case, _ = bench.copies
    if why_no_step := _no_step(case):
        return Finding(np.inf, case.roundings, "roundings", why_no_step)
    q, p = case.next_states
    of_q, of_p = case.allowance
    off = np.maximum(np.abs(q - case.trajectory.q[1:]) / of_q, np.abs(p - case.trajectory.p[1:]) / of_p)

    def part(at: Integers, change: sight.States) -> Reals:
        most = np.maximum(np.abs(change[0]) / of_q[at], np.abs(change[1]) / of_p[at])
        return np.asarray(most / case.roundings)

    sees, hidden = sight.of_steps(case, np.ones(1, dtype=bool), part, copies=2 * bench.scene.n + 1)
    why = f"{2 * bench.scene.n} unit pushes, one step of {case.scheme.title} each{hidden}"
    return Finding(np.max(off), case.roundings, "roundings", why, sees)


ENDED = "the engine made no step that ends in finite numbers"


def _no_step(case: Case) -> str | None:
    """Why single steps of the perturbed copies cannot be evaluated, or None."""
    run, scene = case.trajectory, case.scene
    if len(run.t) < 2 or not np.isfinite([run.q, run.p]).all():
        return ENDED
    started = np.array_equal(run.q[0], scene.q) and np.array_equal(run.p[0], scene.p)
    return None if started else "its first frame is not the start"


def _matrices(bench: Bench) -> tuple[Floats, Floats, Floats]:
    """The scheme's matrix, the engine's departure from it, and what rounding allows.

    On (q, p) in units in which a canonical pair has the action 1, (2n, 2n) each.
    """
    case, pushes = bench.copies
    n = bench.scene.n
    root = (bench.scene.m * bench.stiffness) ** 0.25
    scale = np.concatenate([1 / root, root])

    def columns(q: Extended, p: Extended, sign: int) -> Floats:
        """Displacement of each perturbed copy from the unperturbed one, per perturbation (2n, 2n)."""
        states = np.concatenate([q.reshape(2 * n + 1, n), p.reshape(2 * n + 1, n)], axis=1)
        return np.asarray(((states[1:] + sign * states[0]) / pushes[:, None]).T, np.float64)

    def scaled(matrix: Floats) -> Floats:
        return np.asarray(matrix * scale[None, :] / scale[:, None])

    q, p = case.next_states
    ideal = columns(q[0], p[0], -1)
    departure = columns(case.trajectory.q[1] - q[0], case.trajectory.p[1] - p[0], -1)
    roundings = [case.roundings * x[0] for x in case.allowance]
    allowed = np.abs(columns(roundings[0], roundings[1], 1))
    return scaled(ideal), scaled(departure), scaled(allowed)


@check("det", family="map", requires=MATRIX)
def determinant(bench: Bench) -> Finding | str:
    """The one-step matrix changes area by the scheme's factor, to rounding."""
    if why_no_step := _no_step(bench.copies[0]):
        return Finding(np.inf, 0.0, "relative", why_no_step)
    ideal, departure, allowed = _matrices(bench)
    try:
        inverse = np.linalg.inv(ideal)
    except np.linalg.LinAlgError:
        return "friction leaves nothing of an area within a step"
    relative = inverse @ departure
    # det(1 + X) - 1, whose leading part is exact as a trace where the determinant itself would round
    change = float(np.trace(relative))
    if not float(np.max(np.abs(relative))) < 1e-8:
        change = float(np.linalg.det(np.eye(len(relative)) + relative)) - 1
    limit = float(np.sum(np.abs(inverse).T * allowed))
    if abs(change) <= limit and limit >= 1:
        return "rounding of the entries may be as large as all of the area"
    own = float(np.linalg.det(ideal))
    why = f"roundings of every entry, each of the sign that hurts; the scheme's own is {own:.6g}"
    return Finding(abs(change), limit, "relative", why, Limits(area=limit / bench.scene.n))


@check("sympl", family="map", requires=MATRIX | {"symplectic", "undamped"})
def symplecticity(bench: Bench) -> Finding | str:
    """The one-step matrix is symplectic, M^T J M = J, to rounding."""
    if why_no_step := _no_step(bench.copies[0]):
        return Finding(np.inf, 0.0, "of an action", why_no_step)
    ideal, departure, allowed = _matrices(bench)
    n = bench.scene.n
    form = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    one = ideal.T @ form @ departure
    off = np.abs(one - one.T + departure.T @ form @ departure)
    half = np.abs(ideal).T @ np.abs(form) @ allowed
    limit = half + half.T
    # next to nothing is allowed between coordinates that are not coupled
    ratio = off / np.where(limit > 0, limit, 1)
    worst = largest(ratio)
    if ratio[worst] <= 1 and not np.any(limit[form != 0] < 1):
        return "rounding of the entries may be as large as the form"
    why = "roundings of every entry, each of the sign that hurts"
    sees = Limits(area=float(np.min(limit[form != 0])))
    return Finding(off[worst], limit[worst], "of an action", why, sees)


def _shifted(case: Case, q: Reals, p: Reals, sign: int) -> tuple[Reals, Reals]:
    """The state a first stage of a two-stage scheme on, or back: there its adjoint is synchronised.

    Kick-drift and drift-kick undo each other, but for that stage at start and end; other schemes undo
    themselves.
    """
    if len(case.scheme.stages) != 2:
        return q, p
    q, p, h = q.astype(np.longdouble), p.astype(np.longdouble), np.longdouble(sign * case.judged.step)
    if case.scheme.kinds[0].kicks:
        p = p + h * case.system.force(q, p)
    else:
        q = q + h * (p / case.judged.m)
    return np.asarray(q, np.float64), np.asarray(p, np.float64)


@check("reverse", family="map", requires={"one-step", "undamped", "reversible", "autonomous"})
def reversibility(bench: Bench) -> Finding | str:
    """A run, momenta reversed, and a second run lead back to the initial state, to rounding."""
    out = bench.trajectory
    steps = len(out.t) - 1
    case = Case(trajectory=out, scene=bench.scene)
    if out.outcome.status != "complete" or not steps:
        return "the run did not finish"
    state: tuple[Reals, Reals] = (out.q[-1], -out.p[-1])
    if not np.isfinite(state).all():
        return Finding(np.inf, case.roundings, "roundings", ENDED)
    state = _shifted(case, *state, -1)
    back = bench.run(bench.scene.derived(q=state[0], p=state[1], steps=steps, every=1), bench.label)
    # size of the forward run alone: a backward run that explodes must not enlarge its own bound
    size = np.max(case.system.norm.most(*case.allowance_at(out.q, out.p)))
    enlarged = _enlarged(case, steps, state, size)
    if enlarged is None:
        return "the motion grows, and rounding with it"
    bound = case.roundings * enlarged
    if len(back.t) < len(out.t):
        return Finding(np.inf, bound, "roundings", "it ended early on its way back")
    end = _shifted(case, back.q[-1], back.p[-1], 1)
    off = case.system.norm.size(end[0] - bench.scene.q, end[1] + bench.scene.p)
    # a motion that stands still after its turning point would end there, with the momenta flipped
    moved = case.system.norm.size(out.q - bench.scene.q, bench.scene.p - out.p)
    if off <= bound * size and moved[-1] <= bound * size and np.any(moved > 0):
        return "standing still on the way back would pass"
    why = f"{count(steps, 'step')} out and {steps} back, each rounded, all of one sign"
    return Finding(float(off / size), bound, "roundings", why, _sees(case, steps, bound * size))


SMALL_PART = 2.0**-10
"""Largest change, relative to the initial energy norm, whose effect is taken to be linear."""


def _sees(case: Case, steps: int, allowed: np.floating) -> Limits:
    """Relative error of momenta, made at each step, that brings the run back at the bound."""
    change = np.longdouble(sight.change_of(2 * steps))
    q, p = (x.astype(np.longdouble) for x in (case.scene.q, case.scene.p))
    for sign in (-1, 1):
        for _ in range(steps):
            q, p = case.step(q, p)
            p = p * (1 + change)
        q, p = (x.astype(np.longdouble) for x in _shifted(case, q, sign * p, sign))
    off = case.system.norm.size(q - case.scene.q, p + case.scene.p)
    # beyond a small part of the motion the effect is no longer as large as the change
    told = allowed * change < off <= case.system.norm.unit * SMALL_PART
    return Limits(area=float(allowed * change / off)) if told else NOT_KNOWN


def _enlarged(case: Case, steps: int, turned: tuple[Reals, Reals], size: np.floating) -> float | None:
    """Amplification of one rounding in each of so many steps out and back, in roundings of this size, or
    None.

    A rounding on the way out is carried by all of the way back from where it was made, and so counts like one
    that is made there on the way back.
    """
    if case.linear:
        total, grown = schemes.amplification(case.law.propagator, case.w, np.array([2 * steps + 2]))
        return float(total[0]) if grown[0] < 2 else None
    ways = [
        follow(case, q[None].astype(np.longdouble), p[None].astype(np.longdouble), steps + 1)
        for q, p in ((case.scene.q, case.scene.p), turned)
    ]
    if not all(np.all(known(case, way, steps)) for way in ways):
        return None
    ends = 2 * case.system.norm.most(*ways[1].allowance)[0]
    return float(ends / size) if size > 0 else 0.0


def _against(
    why: str, scene: Scene, first: Trajectory, *others: Trajectory, rounding: str = ""
) -> Finding | str:
    """Number of frames at which other runs of a scene differ from the first, bit for bit; `rounding` where
    each of them is the scheme's own."""
    if any(len(run.t) != len(first.t) for run in others):
        return Finding(np.inf, 0.0, "frames", "one of the runs ended early")
    differ = np.any([(run.q != first.q) | (run.p != first.p) for run in others], axis=(0, 2))
    if rounding and np.any(differ):
        runs = (first, *(replace(first, q=run.q, p=run.p) for run in others))
        if all(step_defect(Case(trajectory=run, scene=scene)).passed for run in runs):
            return rounding
    return Finding(np.count_nonzero(differ), 0.0, "frames", why)


@check("mirror", family="repeat", requires={"one-step", "undamped", "autonomous"})
def mirror(bench: Bench) -> Finding | str:
    """A negative step is a positive one with reversed momenta, bit for bit."""
    scene = replace(bench.scene, steps=min(bench.scene.steps, 20), every=1)
    flipped = bench.run(replace(scene, p=-scene.p), bench.label)
    back = bench.run(replace(scene, step=-scene.step), bench.label)
    if len(flipped.t) == len(back.t) < 2:
        return ENDED
    return _against("rounding to nearest does not know the sign", scene, flipped, replace(back, p=-back.p))


@check("turned", family="repeat", requires={"three-dimensions", "one-step"})
def orientation(bench: Bench) -> Finding | str:
    """The scene rotated, x to y to z to x, gives the rotated trajectory, bit for bit."""
    alone, places = bench.trajectory, bench.scene.all_places
    steps = len(alone.t) - 1
    if steps < 1:
        return ENDED
    base = replace(bench.scene, steps=steps, every=1)
    turned = []
    for turn in (1, 2):
        there = replace(base, places=places - places % 3 + (places + turn) % 3)
        turned.append(bench.run(there, bench.label))
    rounding = "the runs differ by rounding alone, as lengths that are sums in another order do"
    found = _against("no axis is another one's better", base, alone, *turned, rounding=rounding)
    left = max(float(run.off_axis or 0.0) for run in turned)
    if left and isinstance(found, Finding) and found.value < np.inf:
        return Finding(left, 0.0, "L", "coordinates that the turned scene leaves out stay exactly 0")
    return found


@check("company", family="repeat", requires={"one-step", "explicit", "linear"})
def company(bench: Bench) -> Finding | str:
    """An uncoupled copy with more energy changes no number of the trajectory."""
    alone, scene, n = bench.trajectory, bench.scene, bench.scene.n
    steps = len(alone.t) - 1
    if steps < 1:
        return ENDED
    lively = 3 * scene.p + np.sqrt(2 * scene.m) * float(scene.system.norm.unit)
    beside = replace(scene.system.tiled(2), p=np.concatenate([scene.p, lively]), steps=steps, every=1)
    both = bench.run(beside, bench.label)
    part = replace(both, q=both.q[:, :n].copy(), p=both.p[:, :n].copy())
    rounding = "the two runs differ by rounding alone, as sums of another length do"
    return _against("systems side by side share nothing", scene, alone, part, rounding=rounding)


@check("repeat", family="repeat")
def repeatability(bench: Bench) -> Finding | str:
    """A second run of the same scene gives the same numbers, bit for bit."""
    first = bench.trajectory
    again = bench.run(replace(bench.scene, every=1, steps=min(bench.scene.steps, 200)), bench.label)
    if first.q.shape != again.q.shape:
        return Finding(np.inf, 0.0, "frames", "the runs differ in length")
    if len(first.t) < 2:
        return ENDED
    one, other = (np.stack([run.q, run.p]).view(np.int64) for run in (first, again))
    differ = np.count_nonzero(np.any(one != other, axis=(0, 2)))
    return Finding(differ, 0.0, "frames", "the same operations in the same order")
