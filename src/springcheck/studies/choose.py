"""Which methods a study of a scene takes, and why it leaves the others out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from springcheck import engines
from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """A method that was not run, or not measured, and why."""

    method: str
    reason: str


def choose(scene: Scene, patterns: Sequence[str]) -> tuple[list[Label], list[LeftOut]]:
    """Methods that can serve a scene, of those that the patterns (or the scene) name, and those left out.

    Raises MethodError when a method that is named in full cannot run: it was asked for.
    """
    named = tuple(patterns) or scene.include
    chosen: list[Label] = []
    left: list[LeftOut] = []
    try:
        matched = engines.match(named)
    except MethodError as error:
        if patterns:
            raise
        raise MethodError(f"methods.include of scene {scene.name}: {error}") from error
    for label in matched:
        reason = engines.refusal(scene, label) or engines.absence(label.engine)
        if reason is None:
            chosen.append(label)
        elif str(label) in patterns:
            raise MethodError(f"{label} cannot run scene {scene.name}: {reason}")
        else:
            left.append(LeftOut(method=str(label), reason=reason))
    if not chosen:
        raise MethodError(f"no method can serve scene {scene.name}: {left[0].reason}")
    return chosen, left
