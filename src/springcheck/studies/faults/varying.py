"""Faults of methods with variable steps: another rule, or another state."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from springcheck.physics.arrays import Floats
from springcheck.physics.trajectory import Trajectory
from springcheck.schemes.catalogue import Rule
from springcheck.schemes.variable import allowed, taken
from springcheck.studies.faults.seeded import Case, Fault, each
from springcheck.studies.faults.steppers import trajectory


def looser(rule: Rule, x: float) -> Rule:
    """The rule with another tolerance."""
    return lambda push, before, tolerance: rule(push, before, tolerance * (1 + x))


def grows(rule: Rule) -> Rule:
    """The rule without its threshold for growth."""
    return lambda push, before, tolerance: min(rule(push, 0.0, tolerance), 2 * before or np.inf)


def jumps(rule: Rule) -> Rule:
    """The rule without its limit on growth from one step to the next."""
    return lambda push, before, tolerance: max(rule(push, 0.0, tolerance), rule(push, before, tolerance))


def doubles(rule: Rule) -> Rule:
    """The rule with its hundredth step twice as long."""
    number = itertools.count(1)
    return lambda push, before, tolerance: (1 + (next(number) == 100)) * rule(push, before, tolerance)


def one_other(last: Floats, x: float) -> Floats:
    """The last steps (f,), changed at the frame in the middle."""
    return np.asarray(last * np.where(np.arange(len(last)) == len(last) // 2, 1 + x, 1.0))


def varying(
    c: Case, other: Callable[[Rule], Rule] = lambda rule: rule, *, braked: float = 0.0,
    told: Callable[[Floats], Floats] | None = None,
) -> Trajectory:  # fmt: skip
    """Steps by another rule, with momenta that lose a part after each frame; `told` maps the last steps (f,)
    to those that are recorded, if any are."""
    scene, rule = c.scene, c.scheme.rule
    assert rule is not None
    broken, before, calls = replace(c.scheme, rule=other(rule)), 0.0, 0
    state, states, lasts = (scene.q, scene.p), [(scene.q, scene.p)], [0.0]
    for i in range(scene.frames - 1):
        times = float(i * scene.every * scene.step), float((i + 1) * scene.every * scene.step)
        for step in taken(broken, scene, state, before=before, times=times, tolerance=allowed(scene)):
            before, calls, end = abs(step.h), calls + 1, step.end
        state = np.asarray(end[0], np.float64), np.asarray(end[1], np.float64) * (1 - braked)
        states.append(state)
        lasts.append(before)
    q, p = np.array(states).swapaxes(0, 1)
    made = trajectory(scene, c.scheme, q, p, tolerance=scene.tolerance, calls=calls)
    return replace(made, last_step=told and told(np.array(lasts)[: len(made.t)]))


BOTH_CHECKS = ("replay", "energy-gain")

VARYING = each(
    Fault("rule-of-another-tolerance", "steps are chosen by too large a tolerance", BOTH_CHECKS,
          lambda c: varying(c, lambda rule: looser(rule, c.x)), size=1e-9),
    Fault("rule-that-holds-no-step", "steps grow by any little, where the rule holds them", BOTH_CHECKS,
          lambda c: varying(c, grows)),
    Fault("rule-that-jumps", "a step may be longer than twice the one before", BOTH_CHECKS,
          lambda c: varying(c, jumps)),
    Fault("varying-steps-with-friction", "momenta lose a fraction at every frame", BOTH_CHECKS,
          lambda c: varying(c, braked=c.x), size=1e-9),
    Fault("rule-of-another-tolerance-told",
          "steps are chosen by too large a tolerance, and the last before each frame is recorded",
          ("replay",), lambda c: varying(c, lambda rule: looser(rule, c.x), told=lambda last: last),
          size=1e-12),
    Fault("step-twice-as-long", "one step is twice as long as the rule says", BOTH_CHECKS,
          lambda c: varying(c, doubles, told=lambda last: last)),
    Fault("last-step-not-its-own", "the last step before one frame is recorded as another", ("replay",),
          lambda c: varying(c, told=lambda last: one_other(last, c.x)), size=1e-12),
    scheme="variable-verlet", scene="varying steps",
)  # fmt: skip
