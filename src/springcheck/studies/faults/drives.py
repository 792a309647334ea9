"""What is wrong with engines that take a drive at another time, or another drive."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from springcheck import schemes
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Drive
from springcheck.studies.faults.steppers import Step, textbook


def late(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """The time is taken later by a part of the step."""
    return textbook(scene, scheme, clock=lambda i: ((i + size) * scene.step, 1.0))


def held(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """The drive of the step's start is held over all of its stages."""
    return textbook(scene, scheme, clock=lambda i: (i * scene.step, 0.0))


def other(scene: Scene, *, amplitude: Any = 1.0, frequency: float = 1.0, phase: float = 1.0) -> Scene:
    """With columns of every drive multiplied."""
    terms = (
        replace(
            term,
            amplitude=term.amplitude * amplitude,
            frequency=term.frequency * frequency,
            phase=term.phase * phase,
        )
        if isinstance(term, Drive)
        else term
        for term in scene.terms
    )
    return replace(scene, terms=tuple(terms))
