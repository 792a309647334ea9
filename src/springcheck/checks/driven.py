"""Causes that a driven scene shows where its states are not the scheme's: the time, or the drive.

Each hypothesis is the scheme's own step with another clock, or another drive; the one whose residual is
rounding alone is the cause.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from springcheck.checks.case import Case
from springcheck.checks.check import Finding, check
from springcheck.checks.requires import MAP
from springcheck.checks.steps import step_defect
from springcheck.physics.arrays import Extended, Reals
from springcheck.physics.driven import CLOCK
from springcheck.physics.scene import Scene

PARTS = {-1.0: "the start of the step before", 0.0: "the start", 0.5: "the middle", 1.0: "the end",
         2.0: "the end of the next step"}  # fmt: skip
"""Times within a step, in words."""

SLACK = 4.0
"""Multiple of the scheme's own bound within which the residuals of a right hypothesis stay."""

NEWTON_STEPS = 4
"""Newton steps of the search for a time: the force is linear in a small shift up to its curvature."""


def found(case: Case) -> str:
    """The cause in one sentence, or "" where no cause known here explains the states, or nothing is
    driven; every step is recorded."""
    if not case.scene.system.is_driven:
        return ""
    sums, case = summed(case), case.clocked
    title, right = case.scheme.title, _abscissae(case)
    clocks = [(s, False) for s in (-1.0, -0.5, 0.5, 1.0)] + [(s, True) for s in (0.0, 0.5, 1.0)]
    for later, held in clocks:
        taken = {later} if held else {c + later for c in right}
        if taken != right and _fits(case, later, held=held):
            over = ", used throughout," if held and len(right) > 1 else ""
            of = "" if max(taken) in (-1.0, 2.0) else " of the step"
            return (
                f"the drive is taken at {_words(taken)}{of}{over} where {title} takes it at {_words(right)}"
            )
    for words, scene in _other_drives(case.scene):
        if _fits(replace(case, scene=scene)):
            return words
    if sums:
        return sums
    later = _later(case)
    if abs(later) > _delay(case)[1] and _fits(case, later):
        way = f"{'of a step' if abs(later) <= 1 else 'steps'} {'later' if later > 0 else 'earlier'}"
        return f"the drive is taken {abs(later):.6g} {way} than {title} takes it"
    allowed = np.stack(case.allowance)[..., :-1] * case.roundings * SLACK
    first = int(np.argmax(np.any(np.abs(_off(case, 0.0)) > allowed, axis=(0, 2))))
    rest = replace(case, trajectory=case.trajectory.at(slice(first, None)))
    if first and _fits(rest, -float(case.steps[first])):
        return f"from step {first} on the time of the drive is 0 again, as after a restart"
    if first and _fits(rest, later := _later(rest)):
        way = "later" if later > 0 else "earlier"
        return f"from step {first} on the drive is taken {abs(later):.6g} steps {way} than before"
    return ""


def summed(case: Case) -> str:
    """The cause where each step is the scheme's, at a time that is a sum of steps; "" elsewhere."""
    if not case.scene.system.is_driven or case.sums_steps or not np.isfinite(case.sums).all():
        return ""
    there = replace(case, trajectory=replace(case.trajectory, t=case.sums))
    if not (there.sums_steps and step_defect(there).passed):
        return ""
    return "the time of the drive is a sum of steps, rounded at each; take their number times the step"


def _words(places: set[float]) -> str:
    return " and ".join(PARTS.get(c, f"{c:g}") for c in sorted(places))


def _abscissae(case: Case) -> set[float]:
    """Fractions of the step at which the scheme evaluates the force."""
    met: list[Reals] = []
    start = (x[:1].astype(np.longdouble) for x in (case.trajectory.q, case.trajectory.p))
    case.step(*start, met=met)
    first = float(case.trajectory.q[0, -1])
    return {round((float(at[0, -1]) - first) / case.trajectory.step, 6) + 0.0 for at in met}


def _off(case: Case, later: float, *, held: bool = False) -> Extended:
    """Distance of the particles from the scheme's step (2, f-1, n) where the time is taken later by a part of
    a step, and is constant over the stages."""
    run = case.trajectory
    q, p = (x[:-1].astype(np.longdouble) for x in (run.q, run.p))
    q[:, -1] += later * np.longdouble(run.step)
    p[:, -1] = 0 if held else CLOCK
    off = np.stack(case.step(q, p)) - np.stack([run.q[1:], run.p[1:]])
    return np.asarray(off[..., :-1])


def _fits(case: Case, later: float = 0.0, *, held: bool = False) -> bool:
    allowed = np.stack(case.allowance)[..., :-1] * case.roundings * SLACK
    return bool(np.all(np.abs(_off(case, later, held=held)) <= allowed))


def _later(case: Case) -> float:
    """Delay of the drive's time, in steps, by least squares in units of the allowance."""
    later = 0.0
    for _ in range(NEWTON_STEPS):
        later += _delay(case, later)[0]
    return later if np.isfinite(later) else 0.0


def _delay(case: Case, later: float = 0.0) -> tuple[float, float]:
    """Further delay of the drive's time, in steps, by linear least squares, and its rounding."""
    unit, change = np.stack(case.allowance)[..., :-1], 1e-6
    off, moved = (_off(case, at) / unit for at in (later, later + change))
    slope = np.where(unit > 0, (moved - off) / change, 0)
    weight = np.sum(slope * slope)
    more = -np.sum(np.where(unit > 0, off, 0) * slope) / weight
    return float(more), float(case.roundings * np.sum(np.abs(slope)) / weight)


@check("drive", family="motion", requires=MAP | {"driven", "resolved"}, telling=False)
def drive(case: Case) -> Finding | str:
    """A drive is evaluated at those times within a step at which the scheme evaluates it.

    The delay of all drives, in steps, by linear least squares over all steps.  Each residual may be wrong by
    the scheme's roundings, which are added up with the worst signs.  Where no time and no other drive
    explains the states, the cause is not the drive.
    """
    if case.trajectory.every > 1:
        return f"{case.trajectory.every} steps lie between frames"
    later, bound = _delay(case.clocked)
    if not bound < 1:
        return "rounding may be as large as what a drive a whole step later does"
    why = "rounding errors of every step, and how far each may shift the time at which the drive fits best"
    if not abs(later) <= bound:
        why = found(case)
        if not why:
            return "steps are wrong, and neither the time of the drive nor another known drive explains it"
    return Finding(abs(later), bound, "of a step", why)


OTHER_DRIVES: tuple[tuple[str, str, Callable[[Any, Any], Any]], ...] = (
    ("the drive does not act", "amplitude", lambda x, m: 0 * x),
    ("the phase of the drive has the wrong sign", "phase", lambda x, m: -x),
    ("the phase of the drive is left out", "phase", lambda x, m: 0 * x),
    ("the drive has the wrong sign", "phase", lambda x, m: x + np.pi),
    ("the drive goes by the sine, not by the cosine", "phase", lambda x, m: x - np.pi / 2),
    ("the phase of the drive is taken for degrees", "phase", lambda x, m: x * np.pi / 180),
    ("the angular frequency of the drive is taken for cycles in a unit of time", "frequency",
     lambda x, m: 2 * np.pi * x),
    ("the angular frequency of the drive is divided by 2 pi, as if it were cycles in a unit of time",
     "frequency", lambda x, m: x / (2 * np.pi)),
    ("the amplitude of the drive is divided by the mass", "amplitude", lambda x, m: x / m),
)  # fmt: skip
"""Faults of a drive: words, field, its value by the mass."""


def _other_drives(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """Scenes with another drive, and its name."""
    for words, name, change in OTHER_DRIVES:
        terms: list[Any] = list(scene.terms)
        for number, term in enumerate(terms):
            if term.kind == "drive":
                terms[number] = replace(term, **{name: change(term.arrays[name], scene.m[term.i])})
        yield words, scene.derived(terms=tuple(terms))
