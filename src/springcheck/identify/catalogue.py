"""The rows: schemes, friction at each place of a step, schemes that other programs run, and mistakes.

Adding a mistake is one row with one sentence.  A mistake in a right scheme's stages is written as its stages,
one in a tableau as the tableau, any other as the four entries of its map.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from springcheck.identify.elsewhere import ELSEWHERE
from springcheck.identify.rows import HALF, ONE, Formula, Row, flow, stability
from springcheck.identify.tables import same
from springcheck.schemes import SCHEMES, Scheme, matrix, roundings
from springcheck.text.wording import either

EXPLICIT, IMPLICIT = "explicit friction in the force", "friction implicit in v"
KNOWN_STAGES = {"kick", "pull", "drift", "friction"}
MOST_TITLES = 4
"""Schemes that a sentence names; of more it gives the number."""


def _stepped(s: Scheme) -> Formula:
    """The map of a scheme that neither stages nor a stability function give: it is stepped."""

    def entries(a: Any, g: Any) -> tuple[Any, Any, Any, Any]:
        c = g if np.any(g) else 0.0
        m = matrix(s, h=1.0, m=np.ones(1), k=a, c=c)
        one, two, three, four = np.moveaxis(m, 0, -1).reshape(4, -1)
        return one, two, three, four

    return entries


def _of(s: Scheme, *, damped: bool) -> Row:
    """The row of a scheme, or `damped`: with friction by its own stage or in its force."""
    free = "friction" if damped else ""
    known: dict[str, Any] = {"scheme": s.name, "title": s.title, "free": free}
    if s.has("flow"):
        return Row(**known, formula=flow, law="friction" * damped, roundings=4)
    if s.b and all(not any(row[i + 1 :]) for i, row in enumerate(s.a)):
        over, under = stability(s.a, s.b)
        law = (IMPLICIT if len(under) > 1 else EXPLICIT) * damped
        return Row(**known, over=over, under=under, law=law, roundings=roundings(s))
    if s.stages and {kind for kind, _ in s.stages} <= KNOWN_STAGES:
        own = s.has("friction")
        kick = "explicit" if damped and not own else "kick"
        stages = tuple((kick if kind in ("kick", "pull") else kind, c) for kind, c in s.stages)
        law = ("exponential friction" if own else EXPLICIT) * damped
        return Row(**known, stages=stages, law=law, roundings=roundings(s))
    return Row(**known, formula=_stepped(s), law="friction" * damped, roundings=roundings(s))


_ON_A_SPRING = tuple(
    s for s in SCHEMES.values() if (s.has("one-step") and not s.has("mixes")) or s.has("flow")
)
_OF = {s.name: _of(s, damped=False) for s in _ON_A_SPRING}
PLAIN = tuple(row for name, row in _OF.items() if not SCHEMES[name].has("friction"))

KICK, DRIFT, DECAY = ("kick", ONE), ("drift", ONE), ("friction", ONE)
HALF_KICK, HALF_DRIFT, HALF_DECAY = ("kick", HALF), ("drift", HALF), ("friction", HALF)
EULER, LATE, VERLET, POSITION = (
    "semi-implicit-euler", "semi-implicit-euler-drift-kick", "velocity-verlet", "position-verlet",
)  # fmt: skip
PLACES: tuple[tuple[str, str, tuple[Any, ...]], ...] = (
    (EULER, "after the kick", (KICK, DECAY, DRIFT)),
    (EULER, "before the kick", (DECAY, KICK, DRIFT)),
    (LATE, "after the kick", (DRIFT, KICK, DECAY)),
    (LATE, "before the drift", (DECAY, DRIFT, KICK)),
    (EULER, "implicit in the kick", (("implicit", ONE), DRIFT)),
    (LATE, "implicit in the kick", (DRIFT, ("implicit", ONE))),
    (VERLET, "in each half kick, implicit", (("implicit", HALF), DRIFT, ("implicit", HALF))),
    (VERLET, "explicit before and implicit after the drift (BBK)",
     (("explicit", HALF), DRIFT, ("implicit", HALF))),
    (VERLET, "of the velocity half a step ago", (("remembered", HALF), DRIFT, ("explicit", HALF))),
    (VERLET, "before the first half kick", (DECAY, HALF_KICK, DRIFT, HALF_KICK)),
    (VERLET, "after the first half kick", (HALF_KICK, DECAY, DRIFT, HALF_KICK)),
    (VERLET, "before the second half kick", (HALF_KICK, DRIFT, DECAY, HALF_KICK)),
    (VERLET, "half before and half after the step (OBABO)",
     (HALF_DECAY, HALF_KICK, DRIFT, HALF_KICK, HALF_DECAY)),
    (VERLET, "half before and half after the drift", (HALF_KICK, HALF_DECAY, DRIFT, HALF_DECAY, HALF_KICK)),
    (POSITION, "centred in the kick", (HALF_DRIFT, ("centred", ONE), HALF_DRIFT)),
    (POSITION, "after the kick", (HALF_DRIFT, KICK, DECAY, HALF_DRIFT)),
    (POSITION, "before the step", (DECAY, HALF_DRIFT, KICK, HALF_DRIFT)),
)  # fmt: skip
"""Places of friction: scheme, place, stages."""

AT_THE_END = (
    "explicit-euler", EULER, "implicit-euler", VERLET, POSITION, "implicit-midpoint", "rk2-midpoint", "rk4",
    "ruth3", "forest-ruth", "yoshida4",
)  # fmt: skip
"""Schemes that are tried with friction as a factor at the end of each step."""

PREDICTED = {
    "of the old velocity in the second half kick": (0, 1),
    "of v + 0.65 h a in the second half kick": (13, 20),
    "of v + h a in the second half kick": (1, 1),
}
"""lambda of Groot & Warren, J. Chem. Phys. 107 (1997) 4423, by the place of the friction: that of the second
force is of v + lambda h a.  At 1/2 the map is that of explicit friction in both half kicks."""


def _predicted(over: int, under: int) -> Formula:
    share = np.longdouble(over) / under

    def entries(a: Any, g: Any) -> tuple[Any, Any, Any, Any]:
        x = a.dtype.type(share)
        pulled, slowed = -a + a * a / 4 + x * (a * g / 2), 1 - g - a / 2 + a * g / 4 + x * (g * g / 2)
        return 1 - a / 2, 1 - g / 2, pulled, slowed

    return entries


def _damped(name: str, law: str, count: int = 20, **step: Any) -> Row:
    title = SCHEMES[name].title
    return Row(scheme=name, title=title, free="friction", law=law, roundings=count, **step)


FRICTION = (
    *(_of(s, damped=True) for s in _ON_A_SPRING),
    *(_damped(name, f"friction {place}", stages=stages) for name, place, stages in PLACES),
    *(
        _damped(VERLET, f"explicit friction {place}", formula=_predicted(*x))
        for place, x in PREDICTED.items()
    ),
    *(
        replace(_OF[name], stages=(*_OF[name].stages, DECAY), free="friction", roundings=24,
                law="friction at the end of the step")
        for name in AT_THE_END
    ),
)  # fmt: skip

MANY, FAR = 18, 1.0
"""Stages from which on a map of a long step comes near many others, and largest (h w)**2 of these."""

KNOWN_ELSEWHERE = tuple(
    Row(
        scheme=x.name, title=x.title, stages=x.stages, over=x.over, under=x.under if x.over else (ONE,),
        also=x.also, roundings=8 * max(len(x.over) + len(x.under), len(x.stages)),
        most=FAR if len(x.stages) > MANY else 3600.0,
    )
    for x in ELSEWHERE.values()
)  # fmt: skip
DAMPED_ELSEWHERE = tuple(
    replace(
        row, stages=tuple(("explicit" if kind == "kick" else kind, c) for kind, c in row.stages),
        free="friction", law=EXPLICIT if len(row.under) == 1 else IMPLICIT,
    )
    for row in KNOWN_ELSEWHERE
    if len(row.stages) <= MANY
)  # fmt: skip


def _held(a: Any, g: Any) -> tuple[Any, Any, Any, Any]:
    return 1 - g * a, 1 + 0 * a, -a, 1 + 0 * a


def _theta(a: Any, t: Any) -> tuple[Any, Any, Any, Any]:
    det = 1 + t * t * a
    x, y = (1 - t * (1 - t) * a) / det, 1 / det
    return x, y, -a * y, x


def _newmark(a: Any, b: Any) -> tuple[Any, Any, Any, Any]:
    y = 1 / (1 + b * a)
    x = 1 - a * y / 2
    return x, y, -a * (1 + x) / 2, 1 - a * y / 2


def _unequal(a: Any, g: Any) -> tuple[Any, Any, Any, Any]:
    """Half kicks of g a and (1 - g) a, g the share of the first."""
    x = 1 - g * a
    return x, 1 + 0 * a, -g * a - (1 - g) * a * x, 1 - (1 - g) * a


def _stages(a: Any, g: Any) -> tuple[Any, Any, Any, Any]:
    """RK4 with the step of every stage multiplied by g."""
    x, y = 1 - g * a / 2 + g**3 * a * a / 24, 1 - g * g * a / 6
    return x, y, -a * y, x


HELD = Row(
    scheme="held-force", title="Semi-implicit Euler with one force for several substeps", formula=_held,
    free="share", start=(0.5, 0.75, 0.3),
)  # fmt: skip
"""A force that is held over n substeps: g = (n + 1)/2n where each kicks first, (n - 1)/2n where it drifts."""

PARAMETERS = (
    Row(scheme="theta", title="the theta method", formula=_theta, free="theta", start=(0.6, 0.8, 0.4)),
    Row(scheme="stages", title="RK4 whose stages take other steps", formula=_stages, free="stages",
        start=(0.02, 0.1, 0.4, 1.5, 2.5)),
    Row(scheme="newmark", title="Newmark's method, gamma 1/2", formula=_newmark, free="beta",
        start=(0.1, 0.2, 0.3)),
)  # fmt: skip
UNEQUAL = Row(
    scheme="unequal half kicks", title="Velocity Verlet whose half kicks are unequal", formula=_unequal,
    free="first", start=(0.55, 0.45, 0.7), remedy="use the same force in both half kicks",
    fault="Velocity Verlet whose half kicks are unequal",
)  # fmt: skip


def _table(*rows: Any) -> Any:
    return tuple(tuple(map(Fraction, row)) for row in rows)


_RK4 = _table((0,), ("1/2",), (0, "1/2"), (0, 0, 1))
_WEIGHTS = ("1/6", "1/3", "1/3", "1/6")
TABLEAUX: tuple[tuple[str, Any, Any], ...] = (
    ("RK4 whose fourth stage uses the slope of the second stage",
     _table((0,), ("1/2",), (0, "1/2"), (0, 1)), _WEIGHTS),
    ("RK4 whose third stage uses the slope of the first stage",
     _table((0,), ("1/2",), ("1/2",), (0, 0, 1)), _WEIGHTS),
    ("RK4 whose second stage takes a full step", _table((0,), (1,), (0, "1/2"), (0, 0, 1)), _WEIGHTS),
    ("RK4 whose third stage takes a full step", _table((0,), ("1/2",), (0, 1), (0, 0, 1)), _WEIGHTS),
    ("RK4 whose fourth stage takes half a step",
     _table((0,), ("1/2",), (0, "1/2"), (0, 0, "1/2")), _WEIGHTS),
    ("RK4 whose first slope is left out of the sum", _RK4, (0, "1/3", "1/3", "1/6")),
    ("RK4 with equal weights of its four stages", _RK4, ("1/4",) * 4),
    ("RK4 with weights 1/6 of all four stages", _RK4, ("1/6",) * 4),
    ("RK4 with weights 1, 2, 2, 1 divided by 8", _RK4, ("1/8", "1/4", "1/4", "1/8")),
    ("RK4 with weights 2, 1, 1, 2 divided by 6", _RK4, ("1/3", "1/6", "1/6", "1/3")),
    ("RK4 without its fourth stage", _RK4, ("1/6", "1/3", "1/3", 0)),
    ("Heun's method whose weights add up to 2", _table((0,), (1,)), (1, 1)),
    ("the midpoint method whose first stage takes a full step", _table((0,), (1,)), (0, 1)),
)  # fmt: skip
"""Mistakes in Runge-Kutta methods: what is wrong, stages and weights."""

OLD_FORCE = "Velocity Verlet whose second half kick uses the old force, so that one force is used for the "
OLD_FORCE += "whole step, or a Runge-Kutta method whose later stages do"
STEPS: tuple[tuple[str, str, str, Any], ...] = (
    ("old-force", OLD_FORCE, "compute the force anew after the drift, or in each stage",
     lambda a, g: (1 - a / 2, 1 + 0 * a, -a, 1 + 0 * a)),
    ("halves-swapped",
     "Velocity Verlet with its halves swapped: q + h/2 v + h**2 a, not q + h v + h**2/2 a",
     "move the factor 1/2 from h v to h**2 a",
     lambda a, g: (1 - a, 0.5 + 0 * a, -a * (1 - a / 2), 1 - a / 4)),
    ("half-drift",
     "Velocity Verlet with a drift of half the step", "drift by the whole step",
     (HALF_KICK, HALF_DRIFT, HALF_KICK)),
    ("double-drift",
     "Velocity Verlet with a drift of two steps", "drift by one step between half kicks",
     (HALF_KICK, DRIFT, DRIFT, HALF_KICK)),
    ("full-kicks",
     "Velocity Verlet with two full kicks instead of two half kicks", "halve both kicks",
     (KICK, DRIFT, KICK)),
    ("no-second-kick",
     "Velocity Verlet without its second half kick", "add the half kick after the drift",
     (HALF_KICK, DRIFT)),
    ("no-first-kick",
     "Velocity Verlet without its first half kick", "add the half kick before the drift",
     (DRIFT, HALF_KICK)),
    ("implicit-velocity",
     "An implicit velocity, but the position is moved by the old velocity",
     "move the position by the new velocity: q + h v'",
     lambda a, g: (1 + 0 * a, 1 + 0 * a, -a / (1 + a), 1 / (1 + a))),
    ("one-iteration",
     "Implicit Euler by one fixed-point iteration, so that its equation is not solved",
     "iterate until the change is rounding, or solve with the Jacobian",
     lambda a, g: (1 - a, 1 - a, -a, 1 - a)),
)  # fmt: skip
"""Mistakes in a step: name, what is wrong, what to do, stages or the four entries."""

COMPARE = "compare stages and weights with the tableau"
FAULTS = (
    *(
        Row(scheme=name, title=text, fault=text, remedy=remedy, roundings=20,
            **({"formula": step} if callable(step) else {"stages": step}))
        for name, text, remedy, step in STEPS
    ),
    *(
        Row(scheme=text, title=text, fault=text, remedy=COMPARE, roundings=30,
            **dict(zip(("over", "under"), stability(a, tuple(map(Fraction, b))), strict=True)))
        for text, a, b in TABLEAUX
    ),
)  # fmt: skip

BOTH = "write position and velocity of one step"
VIEWS: tuple[tuple[int | str, str, str], ...] = (
    (-1, "whose velocities are one step behind the positions", BOTH),
    (1, "whose velocities are one step ahead of the positions", BOTH),
    ("half before", "whose velocities are half a step behind the positions", BOTH),
    ("half after", "whose velocities are half a step ahead of the positions", BOTH),
    ("mean", "with velocities by central differences of the positions", "write the velocities of the scheme"),
    ("later", "with velocities that are the next displacement over the step",
     "write the velocities of the scheme"),
    ("earlier", "with velocities that are the last displacement over the step",
     "write the velocities of the scheme"),
)  # fmt: skip
"""Ways to record velocities: the view, in words, what to do."""


def capital(text: str) -> str:
    """A text with a capital letter."""
    return text[:1].upper() + text[1:]


RECORDED = tuple(
    Row(scheme=row.scheme, title=row.title, view=view, inner=row, roundings=30, remedy=remedy,
        fault=f"{capital(row.title)} {text}")
    for row in PLAIN
    for view, text, remedy in VIEWS
    if row.scheme in (*AT_THE_END, LATE, "exact")
)  # fmt: skip
WRONG_SIGN = tuple(
    Row(
        scheme=f"{name}, friction subtracted", title=_OF[name].title, stages=stages, free="friction",
        law="friction", remedy="add h times the derivative of the friction to the mass, do not subtract it",
        fault=f"{capital(_OF[name].title)} with an implicit friction of the wrong sign: it divides by "
        "m - h c, not by m + h c",
    )
    for name, stages in ((EULER, (("remembered", ONE), DRIFT)), (LATE, (DRIFT, ("remembered", ONE))))
)  # fmt: skip

GROUPS: dict[str, tuple[Row, ...]] = {
    "plain": PLAIN, "friction": FRICTION, "held": (HELD,), "elsewhere": KNOWN_ELSEWHERE,
    "damped elsewhere": DAMPED_ELSEWHERE, "faults": FAULTS, "recorded": RECORDED, "wrong sign": WRONG_SIGN,
    "parameters": PARAMETERS, "unequal": (UNEQUAL,),
}  # fmt: skip
ROWS = tuple(row for group in GROUPS.values() for row in group)
ORDER = {row.key: i for i, row in enumerate(ROWS)}
"""Place of each row, the simplest first."""


@cache
def distinct(group: str) -> tuple[Row, ...]:
    """One row of a group for each map."""
    kept: list[Row] = []
    for row in GROUPS[group]:
        if not any(same(row, x) for x in (*(PLAIN if group != "plain" else ()), *kept)):
            kept.append(row)
    return tuple(kept)


@cache
def aliases(row: Row) -> tuple[str, ...]:
    """Schemes of the same map."""
    alike = (x for x in ROWS if not x.fault and x is not row and same(row, x))
    names = dict.fromkeys(name for x in alike for name in (x.scheme, *x.also) if name != row.scheme)
    return (*names, *(x for x in row.also if x not in names))


def of_scheme(name: str) -> Row:
    """The row of a scheme without friction."""
    return next(row for row in (*PLAIN, *KNOWN_ELSEWHERE) if row.scheme == name)


def names() -> set[str]:
    """Every name that a step can be given."""
    return {row.scheme for row in ROWS}


def title(scheme: str) -> str:
    """Title of a scheme, with a capital letter."""
    known = SCHEMES.get(scheme) or ELSEWHERE.get(scheme)
    return capital(HELD.title if scheme == HELD.scheme else known.title if known else scheme)


def titles(schemes: Iterable[str]) -> str:
    """Titles of alternative schemes, each once: A, B, C, D or 3 more."""
    found = list(dict.fromkeys(map(title, schemes)))
    more = len(found) - MOST_TITLES
    return either([*found[:MOST_TITLES], *([f"{more} more"] if more > 0 else [])])
