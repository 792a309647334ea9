"""Which schemes take a step: of a nonlinear force there is no map to fit, but each scheme's own step."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from springcheck.physics.arrays import Reals
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.schemes import SCHEMES, Law, title
from springcheck.text.wording import either

OF_ERROR = 1e-3
"""Largest difference from a scheme's step, relative to its truncation error: that of an engine's solver of
implicit steps.  Other schemes differ by about 1."""

STEPS = 24
"""Recorded steps that are compared."""


def takers(
    names: Iterable[str], scene: Scene, h: float, q: Reals, p: Reals, least: float = 2.0**-49
) -> tuple[str, ...]:
    """The schemes of `names` that take each row of q, p (f, n) to the next by a step of h [T].  The error of
    a step is estimated by two of half its length.  `least` is the distance from a scheme's step, relative to
    the state, that may be rounding."""
    start, end = (q[:-1].astype(np.longdouble), p[:-1].astype(np.longdouble)), (q[1:], p[1:])
    size = [np.max(np.abs(x), axis=1, keepdims=True) for x in end]
    found = []
    for name in names:
        whole, half = (Law(scheme=SCHEMES[name], scene=scene, h=h / n) for n in (1, 2))
        with np.errstate(all="ignore"):
            once, twice = whole.step(*start), half.step(*half.step(*start))
            room = [
                np.maximum(OF_ERROR * np.max(np.abs(a - b), axis=1, keepdims=True), least * c)
                for a, b, c in zip(once, twice, size, strict=True)
            ]
            if all(np.all(np.abs(a - b) <= c) for a, b, c in zip(once, end, room, strict=True)):
                found.append(name)
    return tuple(found)


def seen_to_take(scene: Scene, run: Trajectory, about: int) -> str:
    """One sentence on the schemes of the catalogue that take the recorded steps around a frame; "" where none
    does, where not all forces are potentials, and where frames are several steps apart."""
    if run.every != 1 or any(term.kind != "potential" for term in scene.terms):
        return ""
    first = max(0, min(about - STEPS // 2, len(run.t) - STEPS))
    frames = slice(first, first + STEPS + 1)
    # r-RESPA without fast springs is velocity Verlet
    others = {"friction"} if any(term.fast for term in scene.terms) else {"friction", "mixes"}
    names = [name for name, x in SCHEMES.items() if x.has("one-step") and not x.traits & others]
    found = takers(names, scene, run.step, run.q[frames], run.p[frames])
    # that steps which failed are nearly the scheme's own is no cause
    titles = [title(name) for name in found if run.scheme not in found]
    return f"Every step recorded there is that of {either(titles)}" if titles else ""
