"""What the states of a known scene show: one diagnosis for `identify --scene`, `judge` and `run`.

Schemes and mistakes are tried by their steps with the scene's forces, whatever these are; then the states of
linear oscillators by themselves; then one number of the scene that may be another.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from springcheck.bath import THERMOSTATS
from springcheck.checks import driven, noise, other
from springcheck.checks.case import Case
from springcheck.errors import IdentificationError
from springcheck.identify.catalogue import capital
from springcheck.identify.files import MOST_FAILED, MOST_RANDOM, chosen
from springcheck.identify.report import identify_arrays
from springcheck.identify.result import UNTOLD, Explanation, Identification, nothing
from springcheck.identify.steps import on_scene
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.schemes import SCHEMES, scheme, title

MOST_ALONE = 8
"""Coordinates up to which a number that is another is sought by every scheme, where none is claimed."""

LOOK = "look at that number in the program, and at its unit"
DRIVE = "look at where the program takes the time of the drive, and at the drive's numbers"
OTHER_FORCE = "compare its springs and masses with those of the scene"


def of_scene(
    scene: Scene, run: Trajectory, notes: tuple[str, ...] = (), *, about: int = 0, claimed: str = ""
) -> Identification:
    """The scheme, or the mistake, of the steps around a frame; of a `claimed` scheme that the steps are not
    to rounding, what is another."""
    most = MOST_RANDOM if claimed in THERMOSTATS else MOST_FAILED
    first = max(0, min(about - most // 2, len(run.t) - most))
    part = run.at(slice(first, first + most))
    if claimed in THERMOSTATS:
        return _alone(scene, part).noting(*notes)
    found = on_scene(scene, part, notes)
    told = found.fits and claimed not in {x.scheme for x in found.candidates}
    if told or any(x.local for x in found.explanations):
        return found
    if scene.system.is_driven and claimed:
        case = Case(trajectory=part, scene=scene, piece=True)
        if said := (driven.found(case) if run.every == 1 else "") or driven.summed(case):
            return nothing([Explanation(said, DRIVE, local=True)], scene.n, notes=notes)
    alone = None
    # of few digits a scheme or a cause may be read that is none
    if scene.system.is_linear and not scene.system.is_driven and run.arithmetic.is_double:
        with suppress(IdentificationError):
            alone = _alone(scene, part).noting(*notes)
    # of few digits it is the arithmetic that is another
    rough = alone is not None and alone.fits and alone.precision not in ("double", UNTOLD, "unknown")
    if alone and scene.system.is_separate and (rough or any(x.local for x in alone.explanations)):
        return alone
    names = [claimed] * bool(claimed) + [x.scheme for x in (alone.candidates if alone and alone.fits else ())]
    if not names and scene.n <= MOST_ALONE:
        names = [name for name, one in SCHEMES.items() if one.has("one-step")]
    for name in dict.fromkeys(names) if claimed or not found.fits else ():
        if said := other.found(Case(trajectory=replace(part, scheme=name), scene=scene, piece=True)):
            because = Explanation(f"{capital(title(name))} with another number: {said}", LOOK, local=True)
            return nothing([because], scene.n, notes=notes)
    if alone is None or found.fits or not (alone.fits or scene.system.is_separate):
        return found
    if scene.system.is_separate or alone.scheme is None:
        return alone
    cause = f"{capital(title(alone.scheme))} of other forces than those of {scene.name}"
    return nothing([Explanation(cause, OTHER_FORCE, local=True)], scene.n, notes=notes)


def _alone(scene: Scene, run: Trajectory) -> Identification:
    """What the states show by themselves, with the masses of the scene, and its springs where each particle
    has its own."""
    which, _ = chosen(run.q, run.p, [])
    k = scene.system.hessian_diagonal(scene.q).astype(np.float64) if scene.system.is_separate else None
    k = k if scene.system.is_linear else None
    return identify_arrays(
        run.t, run.q[:, which], run.p[:, which], mass=scene.m[which],
        stiffness=None if k is None else k[which],
    )  # fmt: skip


def diagnosis(scene: Scene, run: Trajectory, about: int, few: bool = False) -> str:
    """What explains that a run is not its scheme's around a frame, and what to do, in sentences; "" where
    nothing known here does.  `few` steps that are off alone are explained by what acts in frames alone."""
    if run.scheme in THERMOSTATS and (said := noise.found(Case(trajectory=run, scene=scene))):
        return said
    try:
        found = of_scene(scene, run, about=about, claimed=run.scheme)
    except IdentificationError:
        return ""
    first = next(iter(found.explanations), None)
    names = {x.scheme for x in found.candidates}
    if run.scheme in THERMOSTATS:
        # that it is random is no cause, nor which schemes it may be of where its own is one of them
        other_one = bool(names) and (run.scheme not in names or first is not None)
        if not other_one and not any(x.local for x in found.explanations):
            return ""
    elif few and not (first and first.local):
        return ""
    elif first is None and run.scheme in (found.scheme, *found.aliases):
        return _of_its_own(scene, run, found)
    elif not first.shown if first else run.scheme in names:
        return ""
    remedy = f". What to do: {first.remedy}" if first and first.remedy else ""
    return f"{first.cause if first else found.statement}{remedy}"


def _of_its_own(scene: Scene, run: Trajectory, found: Identification) -> str:
    """Of the states of its own scheme: their number of steps, their friction, or their arithmetic."""
    if found.stride not in (None, run.every) and not scheme(run.scheme).flow:
        return f"{found.statement}, of {found.step:.9g} and not of {run.step:.9g}"
    rates = [x for one in found.candidates if one.law and one.scheme == found.scheme for x in one.friction]
    if rates and not scene.system.is_damped:
        size = " to ".join(dict.fromkeys(f"{x:.3g}" for x in (min(rates), max(rates))))
        return f"{found.statement}; its c/m is {size}, and the scene has none"
    # that they are of the scheme which they failed to be is no cause, but that they are so in single may be
    plain = found.precision in ("double", UNTOLD, "unknown") or not run.arithmetic.is_double
    return "" if plain else found.statement
