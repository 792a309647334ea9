"""A plain double-precision engine for every scheme, and the places where it can be broken.

It is the clean engine of the negative controls: the textbook step in NumPy doubles, and a recorder.
What a fault changes it hands over as a function: the scene that is moved, the step, or the records.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from springcheck import mechanics, schemes
from springcheck.model import Arithmetic, Floats, Outcome, Scene, Timing, Trajectory

State: TypeAlias = tuple[Floats, Floats]
Step: TypeAlias = Callable[[int, Floats, Floats], State]
"""(number of the step from 0, q, p) -> the next (q, p)."""


def textbook(scene: Scene, scheme: schemes.Scheme, h: float | None = None) -> Step:
    """The scheme's own step in double precision."""
    force = mechanics.force(scene.terms)
    stiff = mechanics.stiffness(scene, scene.q).astype(np.float64) if scheme.implicit else None
    length = scene.step if h is None else h

    def step(i: int, q: Floats, p: Floats) -> State:
        a, b = schemes.step(scheme, q, p, h=length, m=scene.m, force=force, stiffness=stiff)
        return np.asarray(a, np.float64), np.asarray(b, np.float64)

    return step


def record(
    scene: Scene,
    scheme: schemes.Scheme,
    step: Step,
    *,
    label: str = "plain",
    arithmetic: Arithmetic | None = None,
) -> Trajectory:
    """Carry the start through `scene.steps` steps and keep every `scene.every`-th state."""
    q = np.empty((scene.frames, scene.n))
    p = np.empty_like(q)
    q[0], p[0] = scene.q, scene.p
    a, b = scene.q, scene.p
    with np.errstate(all="ignore"):
        for row in range(1, scene.frames):
            for i in range((row - 1) * scene.every, row * scene.every):
                a, b = step(i, a, b)
            q[row], p[row] = a, b
        energy = np.asarray(mechanics.energy(scene, q, p), np.float64) if "energy" in scene.quantities else None
    return Trajectory(
        label=label,
        scheme=scheme.name,
        t=np.arange(scene.frames) * scene.every * scene.step,
        q=q,
        p=p,
        energy=energy,
        step=scene.step,
        every=scene.every,
        outcome=Outcome(status="complete", step=scene.steps),
        timing=Timing(start=0.0, run=0.0),
        force_calls=scene.steps,
        arithmetic=arithmetic or Arithmetic(),
    )
