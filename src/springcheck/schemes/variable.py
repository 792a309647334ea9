"""Steps of a scheme whose lengths follow a rule, from one time to another: see `Scheme.rule`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from springcheck.physics.arrays import Reals, by_identity
from springcheck.physics.scene import Scene
from springcheck.schemes.catalogue import Scheme
from springcheck.schemes.law import Law
from springcheck.schemes.lookup import scheme as named


def allowed(scene: Scene) -> float:
    """Error of a step that the tolerance of a scene allows [L]: the tolerance times the largest amplitude."""
    return float(scene.tolerance * np.max(scene.system.amplitudes[0]))


@by_identity
class Taken(NamedTuple):
    """A step: its length, of either sign, the states (n,) at its ends, and the longest that its rule
    allows."""

    h: float
    start: tuple[Reals, Reals]
    end: tuple[Reals, Reals]
    longest: float


def push_of(scene: Scene, force: Reals) -> Reals:
    """Size of forces (n,), or of their errors, as a rule takes it: root mean square of force over mass."""
    return np.asarray(np.sqrt(np.sum((force / scene.m) ** 2) / (3 * scene.particles)))


def taken(
    scheme: Scheme, scene: Scene, state: tuple[Reals, Reals], *, before: float, times: tuple[float, float],
    tolerance: float, last: float | None = None,
) -> Iterator[Taken]:  # fmt: skip
    """Steps from a state at the first of two times to the second, which the last one is shortened to meet.

    `before` is the length of the step before, 0 at the start; the tolerance is a length.  Lengths and times
    are summed up in double precision, as an engine does.  Where the length of the last step is known it is
    taken as it is, if it leaves less than half of what the rule allows: roundings do not determine the number
    of steps.
    """
    assert scheme.rule is not None
    law = Law(scheme=named(scheme.steps_of), scene=scene, h=0.0)
    clock, end = (abs(time) for time in times)
    sign = 1.0 if times[1] >= times[0] else -1.0
    while clock < end or last is not None:
        push = push_of(scene, scene.system.force(*state))
        h, left = scheme.rule(float(push), before, tolerance), end - clock
        ends = not h < left if last is None else not left - last >= h / 2
        if not ends and clock + h == clock:
            # the motion escapes in finite time, and no step ends there
            return
        before = h if not ends else left if last is None else last
        clock += before
        after = replace(law, h=sign * before).step(*state)
        yield Taken(sign * before, state, after, h)
        state = after
        if ends or not np.all(np.isfinite(after)):
            return
