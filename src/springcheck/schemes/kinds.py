"""The kinds of stages that splittings are made of: a row each, and nothing else lists them.

A row says what a stage does for the time x, its part of the step: to a state of any width, and to the sizes
of what is rounded (Higham, Accuracy and Stability of Numerical Algorithms, 3.3: a running error bound is the
same calculation with every difference taken as a sum).  All else asks the row: `stepping` and `rounding`
carry it out, `linear` makes matrices of it by unit states, `explain` prints its word.  Stages that draw
random numbers are those of `springcheck.bath`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from springcheck.physics.arrays import Reals

Acting: TypeAlias = Literal["", "all", "potential", "slow", "fast"]
"""The terms whose force a stage evaluates: none, all, the potential, the slow or the fast springs."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setting:
    """The setting of a stage next to the state (..., n): masses and rates of friction (n,), the latter None
    where nothing is damped, and the force evaluated last (..., n)."""

    m: Reals
    rate: Reals | None
    force: Reals


Effect: TypeAlias = Callable[[Reals, Reals, Any, Setting], tuple[Reals, Reals]]
"""(q, p, x, setting) -> (q, p), each (..., n); x is a time of either sign."""


class StageKind(NamedTuple):
    """One kind of stage."""

    name: str
    word: str
    """What it does with {c}, its part of the step h, for readers; F is the force at the present q and p."""
    act: Effect
    sizes: Effect
    """Running error bound: the same stage on absolute values of q, p, force and draws."""
    roundings: int
    """Roundings on the longest path through it: 4 of a force, 2 of a kick."""
    evaluates: Acting = ""
    """The terms whose force it evaluates."""
    kicks: bool = False
    """Whether it moves p by a force, one that it evaluates or the one evaluated last."""
    drifts: bool = False
    """Whether it moves q."""
    friction: bool = False
    """Whether it does nothing without friction."""
    decay: Callable[[Any, Reals], Reals] | None = None
    """Factor of p over a time x at rates (n,), for a stage that only multiplies it."""


def _kick(q: Reals, p: Reals, x: Any, at: Setting) -> tuple[Reals, Reals]:
    return q, p + x * at.force


def _kick_sizes(q: Reals, p: Reals, x: Any, at: Setting) -> tuple[Reals, Reals]:
    return q, p + abs(x) * at.force


def _drift(q: Reals, p: Reals, x: Any, at: Setting) -> tuple[Reals, Reals]:
    return q + x * (p / at.m), p


def _drift_sizes(q: Reals, p: Reals, x: Any, at: Setting) -> tuple[Reals, Reals]:
    return q + abs(x) * p / at.m, p


def _decay(x: Any, rate: Reals) -> Reals:
    return np.asarray(np.exp(-x * rate))


def _friction(q: Reals, p: Reals, x: Any, at: Setting) -> tuple[Reals, Reals]:
    return q, p if at.rate is None else p * _decay(x, at.rate)


def _friction_sizes(q: Reals, p: Reals, x: Any, at: Setting) -> tuple[Reals, Reals]:
    if at.rate is None:
        return q, p
    # a rounding of y in exp(-y) costs y exp(-y) p, and the decayed p is exp(-y) p: the sum is below p
    # forwards in time; backwards p grows first
    y = -x * at.rate
    return q, p * np.where(y > 0, (1 + y) * np.exp(y), 1)


def _implicit_friction(q: Reals, p: Reals, x: Any, at: Setting) -> tuple[Reals, Reals]:
    return q, p if at.rate is None else p / (1 + x * at.rate)


def _implicit_friction_sizes(q: Reals, p: Reals, x: Any, at: Setting) -> tuple[Reals, Reals]:
    if at.rate is None:
        return q, p
    # backwards in time 1 - h c/m cancels
    y = x * at.rate
    return q, p * (1 + np.abs(y)) / np.abs(1 + y)


_ALL = (
    StageKind(name="kick", word="p = p + {c}F", act=_kick, sizes=_kick_sizes, roundings=6,
              evaluates="all", kicks=True),
    StageKind(name="held", word="p = p + {c}F, as it was last evaluated", act=_kick, sizes=_kick_sizes,
              roundings=2, kicks=True),
    StageKind(name="pull", word="p = p + {c}F of the potential", act=_kick, sizes=_kick_sizes, roundings=6,
              evaluates="potential", kicks=True),
    StageKind(name="slow", word="p = p + {c}F of the slow springs", act=_kick, sizes=_kick_sizes, roundings=6,
              evaluates="slow", kicks=True),
    StageKind(name="fast", word="p = p + {c}F of the fast springs", act=_kick, sizes=_kick_sizes, roundings=6,
              evaluates="fast", kicks=True),
    StageKind(name="drift", word="q = q + {c}p/m", act=_drift, sizes=_drift_sizes, roundings=3, drifts=True),
    # its exponent, the exponential and the product
    StageKind(name="friction", word="p = p exp(-{c}c/m)", act=_friction, sizes=_friction_sizes, roundings=3,
              friction=True, decay=_decay),
    # the sum, and the quotient
    StageKind(name="implicit-friction", word="p = p / (1 + {c}c/m)", act=_implicit_friction,
              sizes=_implicit_friction_sizes, roundings=3, friction=True),
)  # fmt: skip

KINDS: dict[str, StageKind] = {kind.name: kind for kind in _ALL}
