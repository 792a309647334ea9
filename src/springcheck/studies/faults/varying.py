"""What is wrong with engines that choose the lengths of their steps: another rule, or another state."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.schemes.catalogue import Rule
from springcheck.schemes.variable import allowed, taken
from springcheck.studies.faults.seeded import Fault, Make
from springcheck.studies.faults.steppers import State, trajectory

Other: TypeAlias = Callable[[Rule, float], Rule]
"""(rule, size) -> the rule that the engine follows."""


def right(rule: Rule, size: float) -> Rule:
    """The rule as it is."""
    return rule


def looser(rule: Rule, size: float) -> Rule:
    """Another tolerance."""
    return lambda push, before, tolerance: rule(push, before, tolerance * (1 + size))


def grows(rule: Rule, size: float) -> Rule:
    """Steps grow by any little, and are not held."""
    return lambda push, before, tolerance: min(rule(push, 0.0, tolerance), 2 * before or np.inf)


def jumps(rule: Rule, size: float) -> Rule:
    """After a short step the next one may be of any length."""
    return lambda push, before, tolerance: max(rule(push, 0.0, tolerance), rule(push, before, tolerance))


def doubles(rule: Rule, size: float) -> Rule:
    """The hundredth step is twice as long."""
    number = itertools.count(1)
    return lambda push, before, tolerance: (1 + (next(number) == 100)) * rule(push, before, tolerance)


def as_taken(last: Floats, size: float) -> Floats:
    """The last steps (f,) as they were."""
    return last


def one_other(last: Floats, size: float) -> Floats:
    """That of the frame in the middle is another one."""
    return np.asarray(last * np.where(np.arange(len(last)) == len(last) // 2, 1 + size, 1.0))


def varying(
    other: Other = right, after: Callable[[State, float], State] = lambda state, size: state,
    told: Callable[[Floats, float], Floats] | None = None,
) -> Make:  # fmt: skip
    """Steps by another rule, what is done to the state after each frame, and what is told of the last steps,
    if anything is."""

    def make(scene: Scene, scheme: schemes.Scheme, size: float) -> Trajectory:
        assert scheme.rule is not None
        broken, before, calls = replace(scheme, rule=other(scheme.rule, size)), 0.0, 0
        state, states, lasts = (scene.q, scene.p), [(scene.q, scene.p)], [0.0]
        for i in range(scene.frames - 1):
            times = float(i * scene.every * scene.step), float((i + 1) * scene.every * scene.step)
            for step in taken(broken, scene, state, before=before, times=times, tolerance=allowed(scene)):
                before, calls, end = abs(step.h), calls + 1, step.end
            state = after((np.asarray(end[0], np.float64), np.asarray(end[1], np.float64)), size)
            states.append(state)
            lasts.append(before)
        q, p = np.array(states).swapaxes(0, 1)
        made = trajectory(scene, scheme, q, p, tolerance=scene.tolerance, calls=calls)
        return replace(made, last_step=told and told(np.array(lasts)[: len(made.t)], size))

    return make


def _fault(
    name: str, about: str, make: Make, size: float | None = None, checks: tuple[str, ...] = ("replay",)
) -> Fault:
    return Fault(name, about, checks, make, scheme="variable-verlet", size=size, scene="varying steps")


BOTH_CHECKS = ("replay", "energy-gain")


VARYING = (
    _fault("rule-of-another-tolerance", "steps are chosen by too large a tolerance", varying(looser), 1e-9,
           BOTH_CHECKS),
    _fault("rule-that-holds-no-step", "steps grow by any little, where the rule holds them", varying(grows),
           checks=BOTH_CHECKS),
    _fault("rule-that-jumps", "a step may be longer than twice the one before", varying(jumps),
           checks=BOTH_CHECKS),
    _fault("varying-steps-with-friction", "momenta lose a fraction at every frame",
           varying(after=lambda state, x: (state[0], state[1] * (1 - x))), 1e-9, BOTH_CHECKS),
    _fault("rule-of-another-tolerance-told",
           "steps are chosen by too large a tolerance, and the last before each frame is recorded",
           varying(looser, told=as_taken), 1e-12),
    _fault("step-twice-as-long", "one step is twice as long as the rule says",
           varying(doubles, told=as_taken), checks=BOTH_CHECKS),
    _fault("last-step-not-its-own", "the last step before one frame is recorded as another",
           varying(told=one_other), 1e-12),
)  # fmt: skip
