"""What is wrong with engines that turn velocities in a magnetic field, Boris' rotation written out; and with
those that take a drive at another time, or another drive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.physics.arrays import Floats
from springcheck.physics.magnetic import Magnetic
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Drive
from springcheck.studies.faults import seeded
from springcheck.studies.faults.seeded import Fault
from springcheck.studies.faults.steppers import State, Step, textbook

Turn: TypeAlias = Callable[[float, complex, float], complex]
"""(tangent of half the angle, v_x + i v_y, size) -> the velocity after the field has turned it."""


def cayley(t: float, v: complex, size: float = 0.0) -> complex:
    """Boris' rotation by -2 atan(t), in a form without functions."""
    return v * (1 - 1j * t) / (1 + 1j * t)


def turning(turn: Turn, *, first: float = 0.5, mass: bool = True) -> seeded.Make:
    """Boris' scheme with another turn, another part of the kick before it, or a field not over the mass."""

    def of(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        term = next((term for term in scene.terms if isinstance(term, Magnetic)), None)
        if term is None:
            return textbook(scene, scheme)
        m, h, pull = float(scene.m[0]), scene.step, scene.system.potential_force
        t = float(term.strength[0]) * h / 2 / (m if mass else 1)

        def step(i: int, q: Floats, p: Floats) -> State:
            q = q + h / 2 * p / m
            kick = h * pull(q, p)
            x, y = (p + first * kick) / m
            v = turn(t, complex(x, y), size)
            p = m * np.array([v.real, v.imag]) + (1 - first) * kick
            return q + h / 2 * p / m, p

        return step

    return seeded.stepping(of)


def _field(name: str, about: str, make: seeded.Make, size: float | None = None) -> Fault:
    return Fault(name, about, ("step-defect", "gyration"), make, scheme="boris", size=size, scene="field")


FIELDS = (
    _field("field-sign", "the field turns velocities the other way", turning(lambda t, v, x: cayley(-t, v))),
    _field("field-half-angle", "the field turns velocities by half of the angle",
           turning(lambda t, v, x: v * (1 - 1j * t) / abs(1 + 1j * t))),
    _field("field-exact-angle", "the field turns velocities by Omega h, not by 2 atan(Omega h/2)",
           turning(lambda t, v, x: v * np.exp(-2j * t))),
    _field("field-gains-speed", "the field is a force at the start of the step: the speed grows",
           turning(lambda t, v, x: v * (1 - 2j * t))),
    _field("field-loses-speed", "the second half of the rotation is left out, and its denominator is not",
           turning(lambda t, v, x: v / (1 + 1j * t))),
    _field("field-speed", "the rotation loses a part of the speed",
           turning(lambda t, v, x: cayley(t, v) * (1 - x)), 1e-12),
    _field("field-strength", "the field is too strong",
           turning(lambda t, v, x: cayley(t * (1 + x), v)), 1e-12),
    _field("field-over-mass", "the field is not divided by the mass", turning(cayley, mass=False)),
    _field("field-after-kick", "the whole kick comes before the rotation", turning(cayley, first=1.0)),
    _field("field-before-kick", "the whole kick comes after the rotation", turning(cayley, first=0.0)),
)  # fmt: skip


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
