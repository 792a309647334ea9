"""What a check would have seen: the smallest relative change of stiffness, step or friction beyond its bound.

A run of an engine that is off by a fraction x departs from the right one by x D to first order, D the
derivative of the scheme's own motion: taken here as the quotient of two such motions in extended precision.
A check sees it where x D exceeds the bound, so its limit is the least bound/D.  What it sees besides are the
roundings of the engine, which fill a quarter of a bound at most: three limits fail for certain, and a tenth
of one passes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck import schemes
from springcheck.checks.case import Case, advance
from springcheck.physics import exact
from springcheck.physics.arrays import ROUNDOFF, Arithmetic, Extended, Integers, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.trajectory import NOT_KNOWN, Limits

CHANGE = 2.0**-20
"""Relative change of which the quotients are taken, over the phase of the motion: what is left out of them is
this fraction."""

ROUNDING = np.longdouble(64 * ROUNDOFF)
"""Of a motion in extended precision: a change that is not well above it is not known."""

LARGEST = 2.0**-5
"""Relative change up to which effects are as large as it is small."""

LOOKED_AT = 64
"""Frames at which a limit is worked out, at equal distances: it is that of all frames or a little more."""

NUMBERS = 1 << 16
"""Positions of which it is worked out at most, of very many particles at fewer frames."""

States: TypeAlias = tuple[Extended, Extended]
Part: TypeAlias = Callable[[States], Reals | np.floating]
NAMES = ("stiffness", "step", "friction")
"""Limits that are relative changes of a scene's own numbers."""


def limits(right: States, motion: Callable[[str], States | None], change: float, part: Part) -> Limits:
    """The limits of a check: `motion(name)` is the right one with a parameter larger by `change`, None where
    it has none, and `part` says how many bounds changes (r, n) of it are."""
    found: dict[str, float | None] = {}
    with np.errstate(all="ignore"):
        unknown = _largest(part((np.abs(right[0]) * ROUNDING, np.abs(right[1]) * ROUNDING)))
        for name in NAMES:
            wrong = motion(name)
            size = 0.0 if wrong is None else _largest(part((wrong[0] - right[0], wrong[1] - right[1])))
            known = size > 8 * unknown and change < LARGEST * size
            found[name] = change / size if known else None
    return Limits(**found)


def _largest(parts: Reals | np.floating) -> float:
    return float(np.max(np.where(np.isfinite(parts), np.abs(parts), 0), initial=0.0))


def change_of(steps: int) -> float:
    """The relative change whose effect on so many steps is still small."""
    return CHANGE / max(1.0, 2.0 * steps)


def rows(case: Case, count: int, told: NDArray[np.bool_] | None = None) -> Integers:
    """Some of so many rows, or of those that are told, at equal distances, the last among them."""
    chosen = np.arange(count) if told is None else np.flatnonzero(told)
    most = max(2, min(LOOKED_AT, NUMBERS // case.scene.n))
    if len(chosen) > most:
        chosen = chosen[np.linspace(0, len(chosen) - 1, most).round().astype(int)]
    return np.asarray(chosen)


def changed(case: Case, name: str, change: float) -> Case | None:
    """The case with its stiffness, step or friction larger by a fraction; None where it has none."""
    run, scene = case.trajectory, case.judged
    # the parameters are the judged ones already: they are not rounded once more
    how = replace(run.arithmetic, parameters=Arithmetic().parameters, excess=0.0)
    run = replace(run, arithmetic=how)
    if name == "step":
        # the times too, from which the number of the first frame follows
        run = replace(run, step=run.step * (1 + change), t=run.t * (1 + change))
        return Case(trajectory=run, scene=scene)
    mine = [term for term in scene.terms if term.is_potential == (name == "stiffness")]
    if not any(np.any(term.parameters[0] != 0) for term in mine):
        return None
    return Case(trajectory=run, scene=_scaled(scene, mine, 1 + change))


def _scaled(scene: Scene, mine: Iterable[Term], factor: float) -> Scene:
    chosen = {id(term) for term in mine}
    # friction by the rule of all terms: by its own it is no part of what is scaled
    terms = (Term.scaled(term, factor) if id(term) in chosen else term for term in scene.terms)
    return scene.derived(terms=tuple(terms))


def of_steps(
    case: Case, told: NDArray[np.bool_], part: Callable[[Integers, States], Reals | np.floating]
) -> Limits:
    """The limits of the steps from each frame to the next, of those that are told (f-1,)."""
    at = rows(case, len(told), told)
    change = change_of(case.trajectory.every)

    def motion(name: str) -> States | None:
        other = changed(case, name, change)
        return None if other is None else _ends(other, at)

    return limits(_ends(case, at), motion, change, lambda off: part(at, off))


def of_exact(case: Case, part: Part) -> Limits:
    """The limits of a check of the exact solution."""
    at = rows(case, len(case.steps))
    # an anharmonic solution is known to a few roundings of a double at worst
    change = change_of(int(case.steps[-1])) if case.scene.system.is_linear else 2.0**-14

    def motion(name: str) -> States | None:
        other = changed(case, name, change)
        return None if other is None else _solution(other, at)

    right = _solution(case, at)
    return NOT_KNOWN if right is None else limits(right, motion, change, part)


def _solution(case: Case, at: Integers) -> States | None:
    if not exact.has_true_motion(case.scene):
        return None
    return exact.true_motion(case.scene, case.steps[at], case.trajectory.step)


def _ends(case: Case, at: Integers) -> States:
    """The scheme's own next frame after these frames."""
    run = case.trajectory
    q, p = (x[at].astype(np.longdouble) for x in (run.q, run.p))
    if run.every > 1:
        return advance(case, q, p, run.every)
    return case.step(q, p, near=run.q[at + 1].astype(np.longdouble))


def of_modes(case: Case, part: Callable[[Integers, States, States], Reals | np.floating]) -> Limits:
    """The limits of a check of normal modes: `part(rows, right, change)` says how many bounds a change of
    the closed-form motion about the centres is, in mode coordinates (r, n)."""
    at, change, right, motions = case.once(_mode_motions)
    return limits(right, motions.get, change, lambda off: part(at, right, off))


def _mode_motions(case: Case) -> tuple[Integers, float, States, dict[str, States]]:
    """Rows, relative change, the modes' motion there, and that with each parameter changed."""
    at = rows(case, len(case.steps))
    steps = case.steps[at]
    change = change_of(int(steps[-1]))

    def states(matrices: Extended) -> States:
        return schemes.propagate(matrices, *case.mode_start, steps, area_preserving=case.area_preserving)

    with np.errstate(all="ignore"):
        found = ((name, changed_matrices(case, name, change)) for name in NAMES)
        # beside a step without a solution the change may reverse orientation
        motions = {
            name: states(matrices)
            for name, matrices in found
            if matrices is not None and np.all(schemes.rotation(matrices).determinant > 0)
        }
        return at, change, states(case.matrices), motions


def changed_matrices(case: Case, name: str, change: float) -> Extended | None:
    """One-step matrices of the modes with one parameter larger by a fraction; None where it is none."""
    more = {key: 1 + np.longdouble(change if key == name else 0) for key in NAMES}
    modes = case.system.modes
    if not (name == "step" or np.any({"stiffness": modes.w2, "friction": modes.rate}[name] != 0)):
        return None
    one = np.ones(1, dtype=np.longdouble)
    h: Any = np.longdouble(case.trajectory.step) * more["step"]
    return schemes.matrix(
        case.scheme, h=h, m=one, k=modes.w2 * more["stiffness"], c=modes.rate * more["friction"]
    )
