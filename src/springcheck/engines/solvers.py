"""How far an adaptive solver has to integrate between two outputs."""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene

MOST_RADIANS = 3e7
"""Between two outputs.  Each takes three internal steps or more: 1e8 of them, an hour at 40 us."""


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
    """MethodError where a solver would not come to its first output in an hour.

    The steps of an `explicit` one stay as short as the fastest rate, though nothing moves as fast any more.
    """
    found = [(followed(scene, step), "motion", 3.0), (driven(scene, step), "drive", 3.0)]
    if explicit and np.isfinite(fastest := turned(scene, step)):
        # the limit of DOP853 on the negative real axis is 6, that of RK45 3
        found.append((fastest, "fastest rate, which bounds the steps of an explicit solver,", 1 / 6))
    radians, what, each = max(found)
    if radians > MOST_RADIANS:
        raise MethodError(
            f"{label}: the {what} turns through {radians:.3g} radians between two frames, which takes "
            f"{each * radians:.0e} internal steps or more, hours and longer; {MOST_RADIANS:.0e} radians are "
            "the most, take shorter steps or record more frames"
        )
