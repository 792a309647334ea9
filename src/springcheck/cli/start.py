"""Explanations of a first frame that is not its scene's start, and of masses that contradict the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats import States
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene

CLOSE_STATE = 1e-6
"""Distance, relative to the amplitude, within which a state explains a first frame."""


def contradicted(path: Path, states: States, scene: Scene) -> None:
    """StoreError where the file's momenta are not its velocities times the scene's masses."""
    if states.p is None or states.v is None:
        return
    axes = states.q.shape[1]
    m = np.repeat(scene.m, max(1, axes // scene.n))
    if scene.places is not None and axes == 3 * scene.particles:
        m = np.zeros(axes)
        m[scene.where] = scene.m
    if len(m) != axes:
        return
    p, v = states.p[:, m > 0], states.v[:, m > 0]
    m = m[m > 0]
    off, *sizes = (np.max(np.abs(x), axis=0) for x in (p - m * v, p, m * v))
    size = np.maximum(*sizes)
    if not np.any(bad := off > max(1e-9, 10 * states.roundoff) * size):
        return
    i = int(np.argmax(bad))
    seen = float(np.sum(p[:, i] * v[:, i]) / (np.sum(v[:, i] ** 2) or 1.0))
    raise StoreError(
        f"{path}: momenta and velocities contradict each other: p/v = {seen:.6g}, and the mass in scene "
        f"{scene.name} is {m[i]:.6g}; keep one of the two"
    )


def clock(states: States, scene: Scene) -> list[str]:
    """A note where frames lie a power of 1000 times as far apart as in the scene, and are as many: units of
    time are that far apart."""
    if not len(states.t) == scene.frames > 1:
        return []
    times = abs(float(states.t[1] - states.t[0])) / (scene.step * scene.every)
    whole = 1000.0 ** round(np.log10(times) / 3) if 0 < times < np.inf else 1.0
    if whole == 1 or abs(times / whole - 1) > 1e-6:
        return []
    return [
        f"as many frames as in the scene lie {whole:g} times as far apart: if the times are in another unit, "
        f"as ms are for s, divide them by {whole:g}"
    ]


def differs(scene: Scene, states: States, q: Floats, p: Floats) -> str:
    """Why the first frame q, p (n,) of a file is not the scene's start, with a remedy, as far as known."""
    rates = "velocities" if states.p is None else "momenta"
    kick = scene.step / 2 * np.asarray(scene.system.force(q, p), np.float64)
    of_q, of_p = _factor(q, scene.q), _factor(p, scene.p)
    leapfrog = "the scene's, as in a leapfrog; `springcheck identify` reads all frames"
    with np.errstate(all="ignore"):
        guesses = (
            # nearly right: no mass and no unit explains the rest
            (q, p, ""),
            (q, p * scene.m, "its momenta are the scene's velocities; name their columns v, as t,q,v"),
            (q, p / scene.m, f"its {rates} are the scene's times the masses; name momenta p, as t,q,p"),
            (q, p + kick, f"its {rates} are half a kick before {leapfrog}"),
            (q, p - kick, f"its {rates} are half a kick after {leapfrog}"),
            (q / of_q, p / of_p, f"positions are {of_q:g} times the scene's, and {rates} {of_p:g} times: "
                                 "other units?"),
        )  # fmt: skip
        close = [why for x, y, why in guesses if scene.system.norm(x - scene.q, y - scene.p) <= CLOSE_STATE]
    if close and close[0]:
        return close[0]
    i = int(np.argmax(np.maximum(np.abs(q - scene.q), np.abs(p - scene.p))))
    name, x, own = ("q", q, scene.q) if abs(q - scene.q)[i] >= abs(p - scene.p)[i] else ("p", p, scene.p)
    return f"{name}[{i}] is {x[i]:.15g} there, and {own[i]:.15g} in the scene; give a scene that starts so"


def _factor(x: Floats, own: Floats) -> float:
    """The power of ten nearest to the ratio of x to the scene's largest number; 1 where there is none."""
    i = int(np.argmax(np.abs(own)))
    ratio = x[i] / own[i] if own[i] else 1.0
    return float(10.0 ** np.rint(np.log10(ratio))) if 0 < ratio < np.inf else 1.0
