"""Which schemes, and which mistakes, take the recorded steps with the scene's force, whatever it is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from springcheck.identify.catalogue import COMPARE, OLD_FORCE, TABLEAUX, capital
from springcheck.identify.catalogue import STEPS as MISTAKES
from springcheck.identify.result import Candidate, Explanation, Identification, nothing
from springcheck.identify.rows import HALF, ONE
from springcheck.identify.storage import BINARY, storage
from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.driven import CLOCK
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.schemes import ATTACHED, SCHEMES, Law, Scheme, matrix, propagate, scheme, title
from springcheck.text.wording import count, either

OF_ERROR = 1e-3
"""Largest difference from a scheme's step, relative to its truncation error: that of an engine's solver of
implicit steps.  Other schemes differ by about 1."""

MOST_FRAMES = 400
"""Frames whose steps are compared where a scene is stated."""

STEPS, MOST_STEPS = 24, 100
"""Recorded frames that are compared, and most steps from one to the next."""


FIRST = 3
"""Frames by which most schemes are excluded before the others are compared."""


def _mistake(text: str, **step: Any) -> Scheme:
    return Scheme(name=text, title=text, order=0, limit=0.0, symplectic=False, **step)


WRONG = {
    one.name: one
    for one in (
        _mistake(OLD_FORCE, stages=(("kick", HALF), ("drift", ONE), ("held", HALF))),
        *(_mistake(text, stages=step) for _, text, _, step in MISTAKES if not callable(step)),
        *(
            _mistake(
                capital(text),
                b=tuple(map(Fraction, b)),
                a=tuple(tuple(map(Fraction, (*row, *[0] * (len(b) - len(row))))) for row in a),
            )
            for text, a, b in TABLEAUX
        ),
    )
}
"""Mistakes as schemes, by their sentences."""

WRONG_REMEDIES = {text: remedy for _, text, remedy, _ in MISTAKES}


def takers(
    names: Iterable[str], scene: Scene, h: float, q: Reals, p: Reals, least: float = 2.0**-49, *,
    every: int = 1,
) -> tuple[str, ...]:  # fmt: skip
    """The schemes of `names` that take each row of q, p (f, n) to the next by `every` steps of h [T].  Their
    error is estimated by twice as many of half the length.  `least` is the distance from a scheme's step,
    relative to the state, that may be rounding."""
    start, end = (q[:-1].astype(np.longdouble), p[:-1].astype(np.longdouble)), (q[1:], p[1:])
    size = [np.max(np.abs(x), axis=1, keepdims=True) for x in end]
    found = []
    for name in names:
        if len(q) > FIRST and not takers([name], scene, h, q[:FIRST], p[:FIRST], least, every=every):
            continue
        whole, half = (Law(scheme=WRONG.get(name) or scheme(name), scene=scene, h=h / n) for n in (1, 2))
        once = twice = start
        with np.errstate(all="ignore"):
            for _ in range(every):
                once, twice = whole.step(*once), half.step(*half.step(*twice))
            room = [
                np.maximum(OF_ERROR * np.minimum(np.max(np.abs(a - b), axis=1, keepdims=True), c), least * c)
                for a, b, c in zip(once, twice, size, strict=True)
            ]
            if all(np.all(np.abs(a - b) <= c) for a, b, c in zip(once, end, room, strict=True)):
                found.append(name)
    return tuple(found)


def is_step_of(scheme: Scheme, names: Iterable[str], scene: Scene, run: Trajectory) -> bool:
    """Whether the scheme's steps from the first frames are those of one of `names` on this scene, to
    rounding, as of multiple time steps and velocity Verlet where no spring is fast."""
    start = [x[:STEPS].astype(np.longdouble) for x in (run.q, run.p)]
    one_step = [x for name in names if (x := SCHEMES.get(name)) and x.has("one-step")]
    if not scheme.has("one-step"):
        return False
    own, *others = (Law(scheme=x, scene=scene, h=run.step).step(*start) for x in (scheme, *one_step))
    return any(
        all(np.all(np.abs(x - y) <= 2.0**-49 * np.max(np.abs(x))) for x, y in zip(own, other, strict=True))
        for other in others
    )


def springs_of(scene: Scene) -> Floats:
    """Mass, stiffness and friction (3, n) [M, M/T2, M/T] of each coordinate, the last two NaN where other
    forces act, or some join two coordinates."""
    system, kinds = scene.system, {term.kind for term in scene.terms}
    alone = system.is_linear and system.is_separate and kinds <= {"potential", "friction"}
    if not alone or scene.bath:
        return np.stack([scene.m, *np.full((2, scene.n), np.nan)])
    c = system.friction_rates * scene.m
    return np.stack([scene.m, system.hessian_diagonal(scene.q), c]).astype(np.float64)


def has_a_start(
    scheme: Scheme, h: float, springs: Sequence[Floats], steps: Integers, q: Floats, p: Floats,
    roundoff: float, last: Sequence[Floats],
) -> bool:  # fmt: skip
    """Whether a scheme leads from some start to all of these states q, p (f, n) of oscillators with mass,
    stiffness and friction `springs` [M, M/T2, M/T] after so many steps (f,), as far as their digits show.

    A start and an equilibrium are fitted by least squares, in units of the last digit, at least those of the
    decimals of text (2, n), `last`, and of what a program in single precision rounds on its way.  Numbers
    that are rounded are half a unit off at most, and cut off one unit: so is then the root mean square with
    the start that is best.
    """
    for j, (m, k, c) in enumerate(np.transpose(springs)):
        units = [_unit(x[:, j], steps, roundoff, unit[j]) for x, unit in zip((q, p), last, strict=True)]
        with np.errstate(all="ignore"):
            one_step = matrix(scheme, h=h, m=np.array([m]), k=np.array([k]), c=np.array([c]))
            try:
                ways = [
                    np.stack(propagate(one_step, y, z, steps, area_preserving=False))[:, :, 0]
                    for y, z in np.eye(2, dtype=np.longdouble)[:, :, None]
                ]
            except ValueError:
                return True
            # an equilibrium displaces positions alone
            ways.append(np.stack([np.ones(len(steps)), np.zeros(len(steps))]))
            design = (np.array(ways) / np.stack(units)).reshape(3, -1).T.astype(np.float64)
            size = np.max(np.abs(design), axis=0)
        if not (k and np.all(np.isfinite(design)) and np.all(size > 0)):
            return True
        wanted = np.concatenate([q[:, j] / units[0], p[:, j] / units[1]])
        left = wanted - design / size @ np.linalg.lstsq(design / size, wanted)[0]
        if not np.mean(left * left) <= 1:
            return False
    return True


def _unit(x: Floats, steps: Integers, roundoff: float, least: float) -> Floats:
    """The last digit of numbers (f,), and one rounding of each of so many steps: in single precision where
    digits do not exclude it, or in the shorter format that they are stored in."""
    form = storage(x)
    unit = 2 * roundoff * np.max(np.abs(x)) if form.name == "double" else form.quantum(x)
    # a 0 is written with no digit, and is that of a start mostly
    unit = np.where(unit > 0, unit, np.min(unit, where=unit > 0, initial=np.max(unit)))
    unit = np.maximum(unit, least)
    coarse = form.name in BINARY or np.max(unit) >= 2.0**-24 * np.max(np.abs(x))
    own = 2.0 ** -BINARY.get(form.name, BINARY["single"]) if coarse else 2.0**-53
    return np.asarray(unit + own * steps * np.maximum.accumulate(np.abs(x)))


def _taking(scene: Scene, run: Trajectory, frames: slice, least: float = 2.0**-49) -> tuple[str, ...]:
    """Schemes and mistakes that take each of these frames to the next."""
    if run.every > MOST_STEPS:
        return ()
    q, p, system = run.q[frames], run.p[frames], scene.system
    if system.is_driven:
        t = run.t[frames, None]
        q, p = np.hstack([q, t]), np.hstack([p, np.full_like(t, CLOCK)])
    # without what they take apart such schemes are others
    idle = {"mixes"} if not any(term.fast for term in scene.terms) else set[str]()
    idle |= {"friction"} if not system.is_damped or system.brakes_by_place else set()
    found: tuple[str, ...] = ()
    for known in (SCHEMES, WRONG, ATTACHED):
        here = {x: {*y.traits, *(kind.evaluates for kind in y.kinds)} for x, y in known.items()}
        names = [name for name, traits in here.items() if "one-step" in traits and not idle & traits]
        # a force that is held is that of a plain scheme where it is constant
        found = found or takers(names, system.clocked, run.step, q, p, least, every=run.every)
    return found


def on_scene(scene: Scene, run: Trajectory, notes: tuple[str, ...] = ()) -> Identification:
    """The scheme, or the mistake, whose steps with the scene's force are those of a run."""
    least = max(2.0**-49, 8 * run.arithmetic.state)
    found = _taking(scene, run, slice(MOST_FRAMES), least)
    steps = f", {count(run.every, 'step')} to a frame" if run.every > 1 else ""
    if not found:
        some = _taking(scene, run, slice(STEPS + 1), least)
        cause = f"No scheme known here takes the recorded steps with the force of {scene.name}{steps}"
        if some:
            whose = either([title(name) for name in some])
            cause = f"The first steps are those of {whose} with the force of {scene.name}, later ones are not"
        remedy = "look at the scene's numbers; `springcheck judge` says where steps depart from a scheme"
        return nothing([Explanation(cause, remedy, shown=bool(some))], scene.n, notes=notes)
    if found[0] in WRONG:
        because = Explanation(f"{found[0]}{steps}", WRONG_REMEDIES.get(found[0], COMPARE), local=True)
        return nothing([because], scene.n, notes=notes)
    none = (math.nan,) * scene.n
    each = tuple(
        Candidate(
            scheme=name, aliases=(), stride=run.every, step=run.step, turns=0, omega=none, stiffness=None,
            friction=none,
        )
        for name in found
    )  # fmt: skip
    one = found[0] if len(found) == 1 else None
    return Identification(
        verdict="named" if one else "not told apart", scheme=one, nearest=one, candidates=each, step=run.step,
        stride=run.every, omega=none, friction=none, determinant=none, fits=True, notes=notes,
        statement=f"{either([title(x) for x in found])}{steps}: each step is its own on {scene.name}",
    )  # fmt: skip
