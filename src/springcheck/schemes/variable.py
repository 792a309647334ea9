"""Steps of a scheme whose lengths follow a rule, from one time to another: see `Scheme.rule`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from springcheck.physics.arrays import Reals
from springcheck.physics.scene import Scene
from springcheck.schemes.catalogue import Scheme
from springcheck.schemes.law import Law
from springcheck.schemes.lookup import scheme as named


def allowed(scene: Scene) -> float:
    """What the tolerance of a scene allows a step to be off [L]: so much of the largest amplitude."""
    return float(scene.tolerance * np.max(scene.system.amplitudes[0]))


class Taken(NamedTuple):
    """A step: its length, of either sign, and the states (n,) at its start and end."""

    h: float
    start: tuple[Reals, Reals]
    end: tuple[Reals, Reals]


def taken(
    scheme: Scheme, scene: Scene, state: tuple[Reals, Reals], *, before: float, times: tuple[float, float],
    tolerance: float,
) -> Iterator[Taken]:  # fmt: skip
    """Steps from a state at the first of two times to the second, which the last one is shortened to meet.

    `before` is the length of the step before, 0 at the start; the tolerance is a length.  Lengths and times
    are summed up in double precision, as an engine does.
    """
    assert scheme.rule is not None
    law = Law(scheme=named(scheme.steps_of), scene=scene, h=0.0)
    clock, end = (abs(time) for time in times)
    sign = 1.0 if times[1] >= times[0] else -1.0
    while clock < end:
        force = scene.system.force(*state)
        push = np.sqrt(np.sum((force / scene.m) ** 2) / (3 * scene.particles))
        h, left = scheme.rule(float(push), before, tolerance), end - clock
        last = not h < left
        if not last and clock + h == clock:
            # the motion escapes in finite time, and no step ends there
            return
        before = left if last else h
        clock += before
        after = replace(law, h=sign * before).step(*state)
        yield Taken(sign * before, state, after)
        state = after
        if last or not np.all(np.isfinite(after)):
            return
