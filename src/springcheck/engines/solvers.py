"""What adaptive solvers take, and how far they have to integrate between two outputs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.driven import CLOCK
from springcheck.physics.scene import Scene

OF_CVODE, OF_DOP853 = (3.0, 40e-6), (1 / 6, 250e-6)
"""Internal steps a radian, at least, and seconds of one: of CVODE, and of DOP853 where friction bounds steps:
its limit on the negative real axis is 6.  Steps of RK45 are half as long, and take half of the time."""

MOST_SECONDS, MOST_RADIANS = 3600.0, 3e7
"""Between two outputs: an hour, and the radians of CVODE in it."""


def turned(scene: Scene, step: float) -> float:
    """Angle [rad] of the fastest rate at the start between two outputs."""
    system = scene.system
    with np.errstate(all="ignore"):
        rows = system.gershgorin(scene.q) / scene.m
        return abs(step) * scene.every * float(np.max(np.sqrt(rows) + system.friction_rates))


def followed(scene: Scene, step: float) -> float:
    """Angle [rad] that a solver has to resolve between two outputs, 0 where no such bound is known.  That of
    the fastest mode that moves by more than the tolerance, until friction has damped it below."""
    system, duration = scene.system, abs(step) * scene.every
    radians = turned(scene, step)
    if not MOST_RADIANS < radians < np.inf or not system.is_linear or not system.has_modes:
        return radians if MOST_RADIANS < radians < np.inf and not system.is_damped else 0.0
    modes = system.modes
    w = np.sqrt(np.maximum(modes.w2 - modes.rate**2 / 4, 0))
    size = np.abs(modes.start.u) * np.sqrt(np.abs(modes.w2)) + np.abs(modes.start.v)
    moves = (size > scene.tolerance * np.max(size)) & (size > 0)
    lives = -2 * np.log(scene.tolerance) / np.where(modes.rate > 0, modes.rate, 1)
    turns = w * np.where(modes.rate > 0, np.minimum(duration, lives), duration)
    return float(np.max(turns[moves])) if np.any(moves) else 0.0


def driven(scene: Scene, step: float) -> float:
    """Angle [rad] of the fastest drive between two outputs, which a solver resolves as well."""
    drives: list[Any] = [term for term in scene.terms if term.kind == "drive"]
    with np.errstate(over="ignore"):
        turns = [np.max(np.abs(term.frequency * step)) * scene.every for term in drives if len(term)]
    return float(max(turns, default=0.0))


def refuse_hours(scene: Scene, label: Label, step: float, *, explicit: bool = False) -> None:
    """MethodError where a solver would not come to its first output in `MOST_SECONDS`.

    The steps of an `explicit` one stay as short as the fastest rate, though nothing moves as fast any more.
    """
    found = [(followed(scene, step), "motion", *OF_CVODE), (driven(scene, step), "drive", *OF_CVODE)]
    if explicit and np.isfinite(fastest := turned(scene, step)):
        found.append((fastest, "fastest rate, which bounds the steps of an explicit solver,", *OF_DOP853))
    radians, what, each, seconds = max(found, key=lambda one: one[0] * one[2] * one[3])
    if (took := radians * each * seconds) > MOST_SECONDS:
        raise MethodError(
            f"{label}: the {what} turns through {radians:.3g} radians between two frames, which takes "
            f"{each * radians:.0e} internal steps or more, some {took / 3600:.2g} hours; one is the "
            "most, take shorter steps or record more frames"
        )


def timed(scene: Any) -> tuple[Callable[[float, Floats, Floats], Floats], ...]:
    """For a solver with its own time, as functions of (t, q, p): the force (n,) [M L/T2], and the derivatives
    (2n, 2n) of (p/m, force) by (q, p)."""
    system, n = scene.system, scene.n
    if not system.is_driven:
        return lambda t, q, p: system.force(q, p), lambda t, q, p: system.jacobian(q, p)
    clocked = system.clocked.system
    kept = np.append(np.arange(n), np.arange(n + 1, 2 * n + 1))

    def force(t: float, q: Floats, p: Floats) -> Floats:
        return np.asarray(clocked.force(np.append(q, t), np.append(p, CLOCK))[:n], np.float64)

    return force, lambda t, q, p: clocked.jacobian(np.append(q, t), np.append(p, CLOCK))[np.ix_(kept, kept)]
