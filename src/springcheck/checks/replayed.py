"""A solver whose steps follow a rule, replayed from the recorded frames: each stretch from its own first.

One stretch leaves the length of its last step to the next: as the engine reports it, or else as replayed.

Where a step of velocity Verlet of length h ends, E' - E = (h**2/8) sum (F'**2 - F**2)/m of linear forces,
exactly: it keeps the energy less (h**2/8) sum F**2/m, each step with its own h.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import islice
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.checks.case import Case
from springcheck.checks.check import Finding, check, largest
from springcheck.physics.arrays import ROUNDOFF, Extended, by_identity
from springcheck.schemes.variable import Taken, allowed, push_of, taken
from springcheck.text.wording import count

MOST_REPLAYED = 10_000
"""Most steps of a solver that are replayed: two seconds."""

LOST = 0.1
"""Relative uncertainty of the last step before a frame up to which a longer and a shorter one are replayed
too.

The last step is the remainder of the frame's time after the others.  Where it is not recorded, its
uncertainty grows from frame to frame, until the rule takes a step that does not depend on it or nothing is
known.
"""

Times: TypeAlias = tuple[float, float]


@by_identity
class _Replayed(NamedTuple):
    """The replayed stretches between frames: of q and p (2, f-1, n), and (f-1,)."""

    ends: Extended
    """Where the steps of each stretch end."""
    bounds: Extended
    """One rounding of all that these steps add up."""
    late: Extended
    """Effect of the roundings of the time on the end."""
    gains: Extended
    """Energy that the steps add by their law (f-1,)."""
    loose: Extended
    """Effect of the roundings of the time on that."""
    counts: Extended
    shortest: Extended
    """The shortest step."""
    untrue: Extended
    """Roundings by which the recorded last step differs from the remainder of the time, or exceeds the
    rule."""
    ended: str
    """Why later stretches are not replayed; "" where there are none."""


def _follow(case: Case) -> _Replayed | str:
    """Replay the steps from each frame to the next, or say why they cannot be."""
    run, system, m = case.trajectory, case.system, case.judged.m.astype(np.longdouble)
    told = None if run.last_step is None or run.last_step.shape != run.t.shape else run.last_step
    if case.steps[0] != 0 and told is None:
        return "the length of the step before its first frame is not recorded"
    state, before, unsure = run.arithmetic.state + ROUNDOFF, 0.0, 0.0
    left, ended = MOST_REPLAYED, ""
    rows: list[list[Extended]] = []
    for i in range(len(run.t) - 1):
        first = tuple(x[i].astype(np.longdouble) for x in (run.q, run.p))
        times = float(case.steps[i] * run.step), float(case.steps[i + 1] * run.step)
        rule: dict[str, Any] = {"times": times, "tolerance": allowed(case.scene)}
        rule["last"] = None if told is None else float(told[i + 1])
        stretch = partial(taken, case.scheme, case.judged, first, **rule)
        if told is not None and case.steps[i]:
            before, unsure = float(told[i]), 0.0
        if unsure > LOST * before:
            ended = "the last step before the next hangs on roundings alone"
            break
        steps = list(islice(stretch(before=before), left + 1))
        # the rule is discontinuous where it holds a step: take both sides
        sides = (before + unsure, before - unsure) if unsure else ()
        others = [list(islice(stretch(before=side), left + 1)) for side in sides if side > 0]
        if not steps:
            return "two of its frames lie at one time"
        if max(map(len, (steps, *others))) > left:
            ended = f"more than {MOST_REPLAYED} steps are not replayed"
            break
        left -= len(steps)
        every = list(_rounded(case, steps, before))
        end, untrue, amiss = steps[-1].end, 0.0, 0.0
        if told is not None:
            untrue, amiss = _untrue(case, steps, every, before, times)
            if not (told[i + 1] > 0 and (case.steps[i] or told[i] == 0)):
                untrue = np.inf
        # the time is a sum of rounded lengths: its remainder is the last step, on which the next one depends
        off = len(steps) * state * abs(np.longdouble(times[1])) + amiss
        late = off * np.abs(end[1] / m), off * np.abs(system.force(*end))
        gain, loose, last = _gain(case, steps), np.longdouble(0), abs(steps[-1].h)
        if others:
            apart = [np.max([np.abs(x[-1].end[i] - end[i]) for x in others], axis=0) for i in range(2)]
            late = late[0] + 2 * apart[0], late[1] + 2 * apart[1]
            loose = 2 * np.max([np.abs(_gain(case, x) - gain) for x in others])
            # the remainder has the differences of all steps before it
            off += 2 * max(abs(abs(x[-1].h) - last) for x in others)
        before, unsure = last, float(off)
        shortest = min(abs(step.h) for step in steps)
        row = end, every[-1], late, gain, loose, len(steps), shortest, untrue
        rows.append([np.asarray(x, np.longdouble) for x in row])
    if not rows:
        return ended
    return _Replayed._make((*(np.stack(x, axis=x[0].ndim // 2) for x in zip(*rows, strict=True)), ended))


def _gain(case: Case, steps: list[Taken]) -> Extended:
    """Energy gained in the steps, for linear forces."""
    total = np.longdouble(0)
    for step in steps:
        old, new = (np.sum(case.system.force(*x) ** 2 / case.judged.m) for x in (step.start, step.end))
        total += np.longdouble(step.h) ** 2 / 8 * (new - old)
    return np.asarray(total)


def _rounded(case: Case, steps: list[Taken], before: float) -> Iterator[tuple[Extended, Extended]]:
    """One rounding of all that these steps add up (n,), carried on by the steps after it: before and after
    each."""
    run, system, m = case.trajectory, case.system, case.judged.m
    state = run.arithmetic.state + ROUNDOFF
    q, p = steps[0].start
    sizes, stiff = system.magnitude(None if system.is_linear else q), np.abs(system.hessian(q))
    # the momentum was read after a half kick
    of_q, of_p = np.zeros_like(q), state * (np.abs(p) + before * sizes(np.abs(q) + case.origins, np.abs(p)))
    yield of_q, of_p
    for length, (q, p), (end, _), _ in steps:
        h, reach = abs(length), np.abs(q) + np.abs(end) + case.origins
        if not system.is_linear:
            sizes, stiff = system.magnitude(q), np.abs(system.hessian(q))
        pushed = state * (np.abs(p) + h * sizes(reach, np.abs(p)))
        if run.rebuilds_velocity:
            pushed = pushed + run.arithmetic.state * m * (reach + 2 * case.scene.periods) / h
        one = of_q + h / m * (of_p + h / 2 * (stiff @ of_q)) + state * (reach + h * np.abs(p) / m)
        of_p = of_p + h / 2 * (stiff @ (of_q + one)) + pushed
        of_q = one
        yield of_q, of_p


def _untrue(
    case: Case, steps: list[Taken], bounds: list[tuple[Extended, Extended]], before: float, times: Times
) -> tuple[float, float]:
    """Roundings by which the recorded last step differs from the remainder of the time, or exceeds the rule;
    and the former as a time, as far as roundings explain it.

    The uncertainty of a step is that of the force at its start: of the roundings of positions and of the
    time.
    """
    system, m, rule, q = case.system, case.judged.m, case.scheme.rule, steps[0].start[0]
    state, allow = case.trajectory.arithmetic.state + ROUNDOFF, allowed(case.scene)
    assert rule is not None
    clock, of_h, of_t = abs(np.longdouble(times[0])), np.longdouble(0), np.longdouble(0)
    sizes, stiff = system.magnitude(None if system.is_linear else q), np.abs(system.hessian(q))
    for (length, (q, p), _, longest), (of_q, _) in zip(steps, bounds, strict=False):
        of_t += of_h
        if not system.is_linear:
            sizes, stiff = system.magnitude(q), np.abs(system.hessian(q))
        moved = stiff @ (of_q + np.abs(p) / m * of_t) + state * sizes(np.abs(q) + case.origins, np.abs(p))
        push, off = push_of(case.judged, system.force(q, p)), push_of(case.judged, moved)
        # the rule is discontinuous where it holds a step
        pushes, steps_before = (np.maximum(push - off, 0), push + off), (before - of_h, before + of_h)
        sides = [rule(float(x), float(y), allow) for x in pushes for y in steps_before]
        of_h = np.max(np.abs(np.array(sides) - longest)) + 2 * state * longest
        # roundings as large as the force allow any step, and determine no later one
        of_h = of_h if np.isfinite(of_h) else np.longdouble(np.inf)
        clock, before = clock + abs(length), longest
        of_t += state * clock
    number, amiss, excess = _roundings(case), abs(clock - abs(times[1])), abs(steps[-1].h) - longest
    # without a force a step may have any length
    found = amiss / of_t, excess / of_h if excess > 0 else np.longdouble(0)
    return float(np.max(np.array(found))), float(min(amiss, number * of_t))


def _roundings(case: Case) -> int:
    return schemes.roundings(schemes.scheme(case.scheme.steps_of))


def _until(case: Case, found: _Replayed) -> str:
    """How many frames are replayed, and why no more, in words; "" where all are."""
    if not found.ended:
        return ""
    first, every = len(found.counts), len(case.trajectory.t) - 1
    return f"; replayed are the first {first} of {every} frames: {found.ended}"


def _told(case: Case, found: _Replayed) -> str:
    """Whether the recorded last steps follow the rule, in words; "" where none are recorded."""
    told, wrong = case.trajectory.last_step, ~(found.untrue <= _roundings(case))
    if told is None:
        return ""
    if not np.any(wrong):
        return ", and the last one is as long as it is recorded"
    row = int(np.argmax(wrong))
    return (
        f"; the step of {told[row + 1]:.6g} that is recorded as the last before t = "
        f"{case.trajectory.t[row + 1]:g} is none by the rule from the frame before"
    )


def _hidden(case: Case, found: _Replayed) -> str:
    """The fraction of the largest momentum by which a frame may be off and pass, in words: twice the bound,
    because roundings may compensate one of the two."""
    number, p = _roundings(case), np.abs(case.trajectory.p[: len(found.counts) + 1])
    room = number * found.bounds[1] + found.late[1]
    part = float(2 * np.max(room) / np.max(p))
    if not part < 1:
        return ""
    at_every = ", a velocity being rebuilt from positions at every step"
    rebuilt = at_every if case.trajectory.rebuilds_velocity else ""
    return (
        f"; a momentum off by {part:.1e} of the largest shows at each of these frames, less may not{rebuilt}"
    )


@check("replay", family="motion", requires={"rule", "two-frames"})
def replay(case: Case) -> Finding | str:
    """Each step between two frames is that of a fixed-step scheme, as long as the solver's rule says."""
    found = case.once(_follow)
    if isinstance(found, str):
        return found
    run, number = case.trajectory, _roundings(case)
    ratios, still = [], []
    for at, end, one, late in zip((run.q, run.p), found.ends, found.bounds, found.late, strict=True):
        unit = one + late / number
        ratios.append(np.max(np.abs(at[1 : len(end) + 1] - end) / unit, axis=1))
        still.append(np.max(np.abs(at[: len(end)] - end) / unit, axis=1))
    seen = np.max([*ratios, found.untrue], axis=0)
    (worst,) = largest(seen)
    if seen[worst] <= number and not np.any(np.max(still, axis=0) > number):
        return "rounding may be as large as the way from frame to frame"
    lengths = np.abs(np.diff(run.t[: len(seen) + 1])) / found.counts
    why = (
        f"roundings of {count(int(found.counts[worst]), 'step')} from the frame before, each carried on, and "
        f"of the time{_told(case, found)}; {count(int(np.sum(found.counts)), 'step')} by the rule, "
        f"{np.min(lengths):.3g} to {np.max(lengths):.3g} long in the mean between two frames"
        f"{_hidden(case, found)}{_until(case, found)}"
    )
    return Finding(seen[worst], number, "roundings", why)


@check("gain", family="motion", requires={"rule", "two-frames", "linear"})
def energy_gain(case: Case) -> Finding | str:
    """The energy changes by what the lengths of the steps make of it, and by nothing else."""
    found = case.once(_follow)
    if isinstance(found, str):
        return found
    run, number, held = case.trajectory, _roundings(case), slice(len(found.gains) + 1)
    q, p = (x[held].astype(np.longdouble) for x in (run.q, run.p))
    energy = case.judged.system.energy(q, p).astype(np.longdouble)
    size = energy[0]
    if not size > 0:
        # hilltops and weights: what moves has either part of it somewhere
        moves = np.sum(p * p / 2 / case.judged.m, axis=1)
        size = np.max(moves + np.abs(energy - moves))
    if size == 0:
        return "nothing moves"
    force = case.system.force(q, p)
    of_q, of_p = (number * one + late for one, late in zip(found.bounds, found.late, strict=True))
    moved = np.abs(force[1:]) * of_q + (np.abs(p[1:]) + of_p) / case.judged.m * of_p
    each = np.sum(moved, axis=1) + found.loose
    law = np.cumsum(found.gains)
    off, bound = np.abs(energy[1:] - energy[0] - law), np.cumsum(each)
    ratio = off / bound
    (worst,) = largest(ratio)
    drowned = ~(np.abs(law) > bound)
    if ratio[worst] <= 1 and np.all(drowned):
        return "rounding may be as large as all that the steps add"
    told = ""
    if bound[-1] > np.max(np.abs(law)):
        told = f"; a step of {np.min(found.shortest):.1e} leaves a velocity rebuilt from positions no digit"
    turns = abs(float(run.t[held][-1])) * float(np.sqrt(np.max(np.abs(case.system.modes.w2)))) / (2 * np.pi)
    span = "a period of the fastest mode" if turns > 0 else "the run"
    grown, said = (float(x / size / (turns or 1)) for x in (energy[-1] - energy[0], law[-1]))
    why = (
        f"(h**2/8) (F'**2 - F**2)/m at each step; {span} adds {grown:.6g} of the "
        f"energy, by the sum over the steps {said:.6g}{told}{_until(case, found)}"
    )
    return Finding(off[worst] / size, bound[worst] / size, "of the energy", why)
