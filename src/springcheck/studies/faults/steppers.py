"""A plain double-precision engine for every scheme, and the places where it can be broken.

It is the clean engine of the negative controls: the textbook step in NumPy doubles, and a recorder.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.physics.arrays import Arithmetic, Floats, Force
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Outcome, Trajectory, of_scene

State: TypeAlias = tuple[Floats, Floats]
Step: TypeAlias = Callable[[int, Floats, Floats], State]
"""(number of the step from 0, q, p) -> the next (q, p)."""


Clock: TypeAlias = Callable[[int], tuple[float, float]]
"""Number of a step from 0 -> the time at its start, and the rate of that clock."""


def textbook(
    scene: Scene,
    scheme: schemes.Scheme,
    *,
    force: Force | None = None,
    clock: Clock | None = None,
) -> Step:
    """The scheme's own step in double precision, with the scene's force or another, and a clock for a
    drive."""
    n, scene = scene.n, scene.system.clocked
    law, m, h = schemes.Law(scheme=scheme, scene=scene, h=scene.step), scene.m, scene.step

    def one(i: int, q: Floats, p: Floats) -> State:
        if len(m) > n:
            time, pace = clock(i) if clock else (i * h, 1.0)
            q, p = np.append(q, time), np.append(p, pace * scene.p[n])
        a, b = schemes.step(
            scheme, q, p, h=h, m=m, force=force or scene.system.force, stiffness=law.stiffness,
            parts=scene.system.parts, rate=law.rate,
        )  # fmt: skip
        return np.asarray(a[:n], np.float64), np.asarray(b[:n], np.float64)

    return one


def record(
    scene: Scene,
    scheme: schemes.Scheme,
    step: Step,
    *,
    start: State | None = None,
    arithmetic: Arithmetic | None = None,
    label: str = "plain",
) -> Trajectory:
    """Advance the start by `scene.steps` steps and keep every `scene.every`-th state."""
    q = np.empty((scene.frames, scene.n))
    p = np.empty_like(q)
    a, b = start or (scene.q, scene.p)
    q[0], p[0] = a, b
    with np.errstate(all="ignore"):
        for row in range(1, scene.frames):
            for i in range((row - 1) * scene.every, row * scene.every):
                a, b = step(i, a, b)
            q[row], p[row] = a, b
    return trajectory(scene, scheme, q, p, arithmetic=arithmetic, label=label)


def trajectory(
    scene: Scene,
    scheme: schemes.Scheme,
    q: Floats,
    p: Floats,
    *,
    arithmetic: Arithmetic | None = None,
    label: str = "plain",
    tolerance: float | None = None,
    calls: int | None = None,
) -> Trajectory:
    """The trajectory of recorded states up to the last finite one, with their times and energies."""
    finite = np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1)
    f = len(q) if finite.all() else int(np.argmin(finite))
    q, p = q[:f], p[:f]
    return of_scene(
        scene,
        q,
        p,
        label=label,
        scheme=scheme.name,
        energy=energies(scene, q, p) if "energy" in scene.quantities else None,
        outcome=Outcome(status="complete" if f == scene.frames else "diverged", step=(f - 1) * scene.every),
        force_calls=scene.steps if calls is None else calls,
        tolerance=tolerance,
        arithmetic=arithmetic or Arithmetic(),
        off_axis=0.0,
    )


def energies(scene: Scene, q: Floats, p: Floats) -> Floats:
    """Total energy of each frame (f,)."""
    with np.errstate(all="ignore"):
        return np.asarray(scene.system.energy(q, p), np.float64)
