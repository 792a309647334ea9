"""Limits of detection: the least relative change of a stiffness, step or friction that a check reports.

A run of an engine that is wrong by a fraction x departs from the right one by x D to first order, D the
derivative of the scheme's own motion: taken here as the quotient of two such motions in extended precision.
A check sees it where x D exceeds the bound, so its limit is the least bound/D. The engine's own roundings add
to it, and fill a quarter of a bound at most: three limits fail for certain, and a tenth of one passes.

Of several springs the limit is that of the least visible one among those that are visible at all: an error of
all of them at once would be detected long before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck import schemes
from springcheck.checks.case import Case, advance
from springcheck.checks.stretch import derivatives
from springcheck.physics import exact
from springcheck.physics.arrays import ROUNDOFF, Arithmetic, Extended, Integers, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.trajectory import NOT_KNOWN, Limits
from springcheck.text.wording import count

CHANGE = 2.0**-20
"""Relative change, over the phase of the motion, of the difference quotients, whose truncation error it
is."""

ROUNDING = np.longdouble(64 * ROUNDOFF)
"""Rounding of a motion in extended precision: a change that is not well above it is not resolved."""

LARGEST = 2.0**-5
"""Relative change up to which the effect is taken to be linear."""

COARSER = LARGEST / CHANGE
"""Factor to the larger change that is tried where the effect of the first is below the reference's
rounding."""

LOOKED_AT = 64
"""Frames, evenly spaced, at which a limit is computed: it is that of all frames or slightly larger."""

NUMBERS = 1 << 16
"""Most positions at which a limit is computed: very many particles use fewer frames."""

States: TypeAlias = tuple[Extended, Extended]
Part: TypeAlias = Callable[[States], Reals | np.floating]
OF_A_DRIVE = {
    "amplitude": ("amplitude", "depth"), "frequency": ("frequency",), "phase": ("phase",), "late": ("phase",),
}  # fmt: skip
"""Limits of a drive, and the fields that are changed; the last one is a phase of W h a step."""
NAMES = ("stiffness", "step", "friction", *OF_A_DRIVE)
"""Limits that are changes of a scene's own numbers, relative except for phases."""


def limits(
    right: States, motions: Callable[[str], Sequence[States]], change: float, part: Part,
    coarse: Callable[[str], Sequence[States]] | None = None,
) -> tuple[Limits, dict[str, int]]:  # fmt: skip
    """The limits of a check, and, by the name of a limit, how many are invisible where they are wrong by
    `LARGEST`.

    `motions(name)` are the right one with a parameter larger by `change`, one for each spring or friction,
    none where that is not known, and `part` expresses changes (r, n) of it in bounds.  Those whose effect is
    below the reference's own rounding are tried again at `COARSER` times that, if it is known.
    """
    found: dict[str, float | None] = {}
    hidden = {}

    def effects(wrong: Sequence[States]) -> list[float]:
        return [_largest(part((q - right[0], p - right[1]))) for q, p in wrong]

    unknown = _largest(part((np.abs(right[0]) * ROUNDING, np.abs(right[1]) * ROUNDING)))
    for name in NAMES:
        sizes = effects(motions(name))
        least = [change / size for size in sizes if size > 8 * unknown]
        if coarse is not None and len(least) < len(sizes):
            # a whole bound is far above what a reference rounds, even where it is no wider than an engine
            least += [
                COARSER * change / more
                for size, more in zip(sizes, effects(coarse(name)), strict=True)
                if size <= 8 * unknown and more > min(8 * unknown, 1)
            ]
        found[name] = max((x for x in least if x < LARGEST), default=None)
        hidden[name] = sum(not x < LARGEST for x in least)
    return Limits(**found), hidden


def _largest(parts: Reals | np.floating) -> float:
    return float(np.max(np.where(np.isfinite(parts), np.abs(parts), 0), initial=0.0))


def change_of(steps: int) -> float:
    """The relative change whose effect over so many steps is still small."""
    return CHANGE / max(1.0, 2.0 * steps)


def rows(case: Case, total: int, told: NDArray[np.bool_] | None = None) -> Integers:
    """Evenly spaced indices of so many rows, or of the rows that are `told`, the last one included."""
    chosen = np.arange(total) if told is None else np.flatnonzero(told)
    most = max(2, min(LOOKED_AT, NUMBERS // case.scene.n))
    if len(chosen) > most:
        chosen = chosen[np.linspace(0, len(chosen) - 1, most).round().astype(int)]
    return np.asarray(chosen)


MOST_ROWS = 8
"""Springs whose effects are computed one by one; of more springs, those with the least effect."""


def changed(case: Case, name: str, change: float, rows: Rows | None = None) -> Case:
    """The case with its step, or some rows of terms, larger by a fraction."""
    run, scene = case.trajectory, case.judged
    if name == "step":
        # the times too, from which the number of the first frame follows
        longer = replace(run, step=run.step * (1 + change), t=run.t * (1 + change))
        return of_scene(replace(case, trajectory=longer), scene)
    assert rows is not None
    number, chosen = rows
    terms = list(scene.terms)
    more = np.zeros(len(terms[number]))
    more[chosen] = change
    if name in OF_A_DRIVE:
        term: Any = terms[number]
        given = term.arrays
        field = next(one for one in OF_A_DRIVE[name] if one in given)
        unit = {"phase": 1.0, "late": given["frequency"] * run.step}.get(name, given[field])
        terms[number] = replace(term, **{field: given[field] + more * unit})
    else:
        # friction by the rule of all terms: by its own it is no part of what is scaled
        terms[number] = Term.scaled(terms[number], 1 + more)
    return of_scene(case, scene.derived(terms=tuple(terms)))


def of_scene(case: Case, scene: Scene) -> Case:
    """The case with another scene, whose parameters are those of the engine: they are not rounded again."""
    how = replace(case.trajectory.arithmetic, parameters=Arithmetic().parameters, excess=0.0)
    return Case(trajectory=replace(case.trajectory, arithmetic=how), scene=scene)


Rows: TypeAlias = tuple[int, slice]
"""The number of a term, and which of its rows."""


def every_row(case: Case, name: str, copies: int = 1) -> list[Rows]:
    """The springs, or frictions, of a scene; of `copies` of a scene side by side, one row in each copy."""
    found: list[Rows] = []
    kind = {"stiffness": "potential", "friction": "friction"}.get(name, "drive")
    for number, term in enumerate(case.judged.terms):
        if term.kind == kind:
            each = len(term) // copies
            strong = np.flatnonzero(term.parameters[0][:each])
            found += [(number, slice(row, None, each)) for row in strong.tolist()]
    return found


def _weakest(case: Case, every: list[Rows], at: Integers) -> list[Rows]:
    """The few rows with the least force in one step, relative to the bound of their particles' rounding."""
    if len(every) <= MOST_ROWS:
        return every
    q, p = (x[at].astype(np.longdouble) for x in (case.trajectory.q, case.trajectory.p))
    _, allowed = (x[np.minimum(at, len(x) - 1)] for x in case.allowance)
    sizes: dict[int, Extended] = {}
    for number in {number for number, _ in every}:
        term = case.judged.terms[number]
        pull = np.abs(
            term.parameters[0] * p[:, term.particles[0]] if term.kind == "friction" else term.pull(q)
        )
        most = [np.max(pull / allowed[:, index], axis=0) for index in term.particles]
        sizes[number] = np.max(most, axis=0)
    effect = [float(np.max(sizes[number][chosen])) for number, chosen in every]
    moving = [j for j in np.argsort(effect).tolist() if effect[j] > 0]
    return [every[j] for j in moving[:MOST_ROWS]]


def of_steps(
    case: Case, told: NDArray[np.bool_], part: Callable[[Integers, States], Reals | np.floating], *,
    copies: int = 1,
) -> tuple[Limits, str]:  # fmt: skip
    """Limits of detection of the steps from each frame to the next, of those that are told (f-1,), and what
    is invisible, in words.  `copies` of one scene side by side have their springs changed together."""
    at = rows(case, len(told), told)
    change = change_of(case.trajectory.every)

    def motions(name: str, change: float = change) -> list[States]:
        if name == "step":
            return [ends(changed(case, name, change), at)]
        some = _weakest(case, every_row(case, name, copies), at)
        return [ends(changed(case, name, change, one), at) for one in some]

    if (
        case.ahead is not None
        and case.trajectory.every > 1
        and case.law.has("undamped")
        and not case.scene.system.is_driven
    ):
        slopes = _slopes(case, at, copies)
        none = 0 * case.ahead.end[0, at], 0 * case.ahead.end[1, at]
        found, hidden = limits(none, lambda name: slopes.get(name, []), 1.0, lambda off: part(at, off))
    else:
        coarse = partial(motions, change=COARSER * change)
        found, hidden = limits(ends(case, at), motions, change, lambda off: part(at, off), coarse)
    names = {"stiffness": "spring", "friction": "friction"}
    blind = [count(hidden[name], noun) for name, noun in names.items() if hidden[name]]
    blind += ["the step"] * hidden["step"]
    said = f"; {' and '.join(blind)} wrong by {LARGEST:.0%} would not show in one step" if blind else ""
    return found, said


def _slopes(case: Case, at: Integers, copies: int) -> dict[str, list[States]]:
    """Derivatives of the scheme's own next frame after these frames, by the equations of variation."""
    parts = []
    for number, chosen in _weakest(case, every_row(case, "stiffness", copies), at):
        term: Any = case.judged.terms[number]
        parts.append({term: replace(term, **{name: x[chosen] for name, x in term.arrays.items()})})
    run = case.trajectory
    q, p = (x.astype(np.longdouble) for x in derivatives(case, run.q[at], run.p[at], run.every, parts))
    step, *springs = zip(q, p, strict=True)
    return {"step": [step], "stiffness": springs}


def of_exact(case: Case, part: Part) -> Limits:
    """The limits of a check of the exact solution."""
    at = rows(case, len(case.steps))
    # an anharmonic solution is known to a few roundings of a double at worst
    change = change_of(int(case.steps[-1])) if case.scene.system.is_linear else 2.0**-14

    def motions(name: str) -> list[States]:
        if name == "step":
            others = [changed(case, name, change)]
        else:
            every = every_row(case, name)
            # normal modes of many joined particles, once more for every spring, are not worth it
            if len(every) > MOST_ROWS or (case.scene.n > MOST_ROWS and not case.system.is_separate):
                return []
            others = [changed(case, name, change, one) for one in every]
        return [ends for other in others if (ends := _solution(other, at)) is not None]

    right = _solution(case, at)
    return NOT_KNOWN if right is None else limits(right, motions, change, part)[0]


def _solution(case: Case, at: Integers) -> States | None:
    if not exact.has_true_motion(case.scene):
        return None
    return exact.true_motion(case.scene, case.steps[at], case.trajectory.step)


def ends(case: Case, at: Integers) -> States:
    """The scheme's own next frame after these frames."""
    run = case.trajectory
    q, p = (x[at].astype(np.longdouble) for x in (run.q, run.p))
    if run.every > 1:
        return advance(case, q, p, run.every)
    return case.step(q, p, near=run.q[at + 1].astype(np.longdouble))


def of_modes(case: Case, part: Callable[[Integers, States, States], Reals | np.floating]) -> Limits:
    """Limits of a check of normal modes: `part(rows, right, change)` expresses a change of the closed-form
    motion about the centres in bounds, in mode coordinates (r, n)."""
    at, change, right, motions = case.once(_mode_motions)
    return limits(right, lambda name: motions.get(name, []), change, lambda off: part(at, right, off))[0]


def _mode_motions(case: Case) -> tuple[Integers, float, States, dict[str, list[States]]]:
    """Rows, relative change, the modes' motion there, and that with each parameter changed: of a driven scene
    those of driving forces alone, of a few, each by itself."""
    at = rows(case, len(case.steps))
    steps = case.steps[at]
    change = change_of(int(steps[-1]))
    driven, motions = case.undriven is not case, {}
    for name in OF_A_DRIVE if driven else NAMES[:3]:
        some = [None] if name == "step" else every_row(case, name)[:MOST_ROWS]
        # the modes of several springs change otherwise with each of them
        others = [changed(case, name, change, one) for one in (some if driven or len(some) == 1 else [])]
        # near a step without a solution the changed map may reverse orientation
        motions[name] = [
            one.closed_at(steps)
            for one in others
            if driven or np.all(schemes.rotation(one.law.propagator).determinant > 0)
        ]
    return at, change, case.closed_at(steps), motions
