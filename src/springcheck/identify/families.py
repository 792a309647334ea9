"""Families of one-step maps: the schemes of the catalogue, with friction at each place of the step; faults.

On a spring a scheme is a linear map of (q, v h) with one unknown, a = (h w)**2; friction of rate gamma adds
another, g = gamma h.  The place of the friction in the step and its discretisation change the map.  Two
families may have the same map on different springs: implicit Euler on k is semi-implicit Euler on a damped
spring of stiffness k/(1 + a).  `search.coincident` finds such pairs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from operator import mul
from typing import Any, TypeAlias

import numpy as np

from springcheck.schemes import SCHEMES, Scheme, roundings
from springcheck.schemes.elsewhere import ELSEWHERE
from springcheck.text.wording import either

Stage: TypeAlias = tuple[str, Fraction | str]
"""Kind and share of the step: drift, kick, friction (v decays), and kicks whose force has the friction of the
old v (`explicit`), of the new v (`implicit`), of their mean (`centred`), or of the v half a step ago
(`remembered`, which is also an implicit kick whose derivative has the wrong sign)."""

ONE, HALF = Fraction(1), Fraction(1, 2)

EXPLICIT = "explicit friction in the force"
IMPLICIT = "friction implicit in v"
EXPONENTIAL = "exponential friction"
CENTRED = "friction by the mean of old and new v"

HELD_SHARES = 64
"""Largest number of substeps that is told from infinitely many."""

G_ROUNDING = 1e-13
"""Error of g by rounding, beside its standard error from the fit."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Family:
    """A one-step map with unknowns a and, where `damped`, g, which `maps` evaluates."""

    name: str
    scheme: str
    stages: tuple[Stage, ...] = ()
    stability: tuple[tuple[Fraction | str, ...], tuple[Fraction | str, ...]] = ((), ())
    """Coefficients of numerator and denominator, in rising powers, of the stability function R(h L)."""
    damped: bool = False
    laws: tuple[str, ...] = ()
    """Discretisations of the friction that give this map, each at a rate of its own (`rate`)."""
    place: str = ""
    """Where in the step the friction acts."""
    flow: bool = False
    """Whether it is the exact solution."""
    path: int = 0
    """Roundings in a step."""
    formula: str = ""
    """Key of a map that stages do not give: a fault in `maps.FORMULAS`, or a scheme."""
    cause: str = ""
    remedy: str = ""
    """Of a fault: what is wrong, and what to do."""
    held: bool = False
    """Whether the force is held over substeps; g is then the share of h**2 F/m that enters the position."""

    def rate(self, law: str, g: float) -> float:
        """gamma h of a discretisation by which v decays by exp(-g) in a step."""
        if law.startswith(IMPLICIT):
            return float(np.expm1(g))
        return float(-np.expm1(-g)) if law.startswith("a factor") else g


def stability_function(
    a: tuple[tuple[Fraction, ...], ...], b: tuple[Fraction, ...]
) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
    """R(z) = 1 + z b (1 - z A)^-1 1 of a tableau with at most one implicit stage, the last.

    Hairer & Wanner, Solving Ordinary Differential Equations II, IV.3.
    """
    own = a[-1][len(b) - 1] if len(a[-1]) == len(b) else Fraction(0)
    # R = 1 + z (b 1) + z**2 (b A 1) + ..., which ends by itself once it is multiplied by 1 - own z
    series, powers = [ONE], [ONE for _ in b]
    for _ in b:
        series.append(sum(map(mul, b, powers), Fraction(0)))
        powers = [sum(map(mul, row, powers), Fraction(0)) for row in a]
    over = tuple(x - own * before for x, before in zip(series, [Fraction(0), *series], strict=False))
    return over, (ONE, -own) if own else (ONE,)


def _of(scheme: Scheme, *, damped: bool) -> Family:
    """Family of the scheme itself, or `damped`: with friction by its own stage or in its force."""
    written, flow, own = _is_written_out(scheme), scheme.has("flow"), scheme.has("friction")
    kick = "explicit" if damped and not own else "kick"
    law = EXPONENTIAL if own else IMPLICIT if scheme.has("implicit") else "friction" if flow else EXPLICIT
    return Family(
        name=scheme.name + (", damped" if damped else ""), scheme=scheme.name,
        stages=tuple((kick if kind in ("kick", "pull") else kind, c) for kind, c in scheme.stages if written),
        stability=stability_function(scheme.a, scheme.b) if scheme.b and written else ((), ()),
        damped=damped, laws=(law,) if damped else (), flow=flow, path=1 if flow else roundings(scheme),
        formula="" if written else scheme.name,
    )  # fmt: skip


_ON_A_SPRING = tuple(
    s for s in SCHEMES.values() if (s.has("one-step") and not s.has("mixes")) or s.has("flow")
)


def _is_written_out(scheme: Scheme) -> bool:
    """Whether stages or a stability function give its map, friction included; otherwise it is stepped."""
    solved = any(x for i, row in enumerate(scheme.a[:-1]) for x in row[i:])
    return not solved and all(kind.evaluates or kind.drifts or kind.decay for kind in scheme.kinds)


UNDAMPED = tuple(_of(s, damped=False) for s in _ON_A_SPRING)
DECAY = (IMPLICIT, EXPONENTIAL)
SCALED = (EXPONENTIAL, IMPLICIT, "a factor 1 - gamma h")


def _placed(
    scheme: str, place: str, laws: tuple[str, ...], *stages: Stage, after: Family | None = None
) -> Family:
    """Family of a scheme with friction in a place: these stages, after the step of `after` if given."""
    return Family(
        name=f"{scheme}, friction {place}", scheme=scheme, stages=(*(after.stages if after else ()), *stages),
        stability=after.stability if after else ((), ()), damped=True, laws=laws, place=place,
        path=roundings(SCHEMES[scheme]) + 3,
    )  # fmt: skip


KICK, DRIFT, DECAYS, WRONG = ("kick", ONE), ("drift", ONE), ("friction", ONE), ("remembered", ONE)
HALF_KICK, HALF_DRIFT, HALF_DECAY = ("kick", HALF), ("drift", HALF), ("friction", HALF)
EULER, EULER_LATE, VERLET, POSITION = (
    "semi-implicit-euler", "semi-implicit-euler-drift-kick", "velocity-verlet", "position-verlet",
)  # fmt: skip

PREDICTED = {
    "of the old velocity in the second half kick": Fraction(0),
    "of v + 0.65 h a in the second half kick": Fraction(13, 20),
    "of v + h a in the second half kick": ONE,
}
"""lambda of Groot & Warren, J. Chem. Phys. 107 (1997) 4423, by the place of the friction: that of the second
force is of v + lambda h a.  At 1/2 the map is that of explicit friction in both half kicks."""

OF_HALF_A_STEP_AGO = f"{VERLET}, friction of the velocity half a step ago"

DAMPED = (
    *(_of(s, damped=True) for s in _ON_A_SPRING if _is_written_out(s)),
    _placed(EULER, "after the kick", DECAY, KICK, DECAYS, DRIFT),
    _placed(EULER_LATE, "after the kick", DECAY, DRIFT, KICK, DECAYS),
    _placed(EULER_LATE, "before the drift", DECAY, DECAYS, DRIFT, KICK),
    _placed(VERLET, "in each half kick", (IMPLICIT,), ("implicit", HALF), DRIFT, ("implicit", HALF)),
    _placed(VERLET, "explicit before and implicit after the drift (BBK)", (CENTRED,),
            ("explicit", HALF), DRIFT, ("implicit", HALF)),
    _placed(VERLET, "of the velocity half a step ago", (EXPLICIT,),
            ("remembered", HALF), DRIFT, ("explicit", HALF)),
    *(replace(_placed(VERLET, place, (EXPLICIT,)), formula=place) for place in PREDICTED),
    _placed(VERLET, "before the first half kick", DECAY, DECAYS, HALF_KICK, DRIFT, HALF_KICK),
    _placed(VERLET, "after the first half kick", DECAY, HALF_KICK, DECAYS, DRIFT, HALF_KICK),
    _placed(VERLET, "before the second half kick", DECAY, HALF_KICK, DRIFT, DECAYS, HALF_KICK),
    _placed(VERLET, "half before and half after the step (OBABO)", (EXPONENTIAL,),
            HALF_DECAY, HALF_KICK, DRIFT, HALF_KICK, HALF_DECAY),
    _placed(VERLET, "half before and half after the drift", (EXPONENTIAL,),
            HALF_KICK, HALF_DECAY, DRIFT, HALF_DECAY, HALF_KICK),
    _placed(POSITION, "centred in the kick", (CENTRED,), HALF_DRIFT, ("centred", ONE), HALF_DRIFT),
    _placed(POSITION, "after the kick", DECAY, HALF_DRIFT, KICK, DECAYS, HALF_DRIFT),
    _placed(POSITION, "before the step", DECAY, DECAYS, HALF_DRIFT, KICK, HALF_DRIFT),
    *(
        _placed(name, "at the end of the step", SCALED, DECAYS, after=_of(SCHEMES[name], damped=False))
        for name in ("explicit-euler", EULER, "implicit-euler", VERLET, POSITION, "implicit-midpoint",
                     "rk2-midpoint", "rk4", "ruth3", "forest-ruth", "yoshida4")
    ),
)  # fmt: skip


def _tableau(*rows: tuple[int | str, ...]) -> tuple[tuple[Fraction, ...], ...]:
    return tuple(tuple(Fraction(x) for x in row) for row in rows)


RK4_ROWS = ((0,), ("1/2",), (0, "1/2"), (0, 0, 1))
RK4_WEIGHTS = ("1/6", "1/3", "1/3", "1/6")
WRONG_RK4: tuple[tuple[str, tuple[Any, ...], tuple[Any, ...]], ...] = (
    ("RK4 whose fourth stage uses the slope of the second stage",
     ((0,), ("1/2",), (0, "1/2"), (0, 1)), RK4_WEIGHTS),
    ("RK4 whose third stage uses the slope of the first stage",
     ((0,), ("1/2",), ("1/2",), (0, 0, 1)), RK4_WEIGHTS),
    ("RK4 whose second stage takes a full step", ((0,), (1,), (0, "1/2"), (0, 0, 1)), RK4_WEIGHTS),
    ("RK4 whose third stage takes a full step", ((0,), ("1/2",), (0, 1), (0, 0, 1)), RK4_WEIGHTS),
    ("RK4 whose fourth stage takes half a step", ((0,), ("1/2",), (0, "1/2"), (0, 0, "1/2")), RK4_WEIGHTS),
    ("RK4 whose first slope is left out of the sum", RK4_ROWS, (0, "1/3", "1/3", "1/6")),
    ("RK4 with equal weights of its four stages", RK4_ROWS, ("1/4", "1/4", "1/4", "1/4")),
    ("RK4 with weights 1/6 of all four stages", RK4_ROWS, ("1/6", "1/6", "1/6", "1/6")),
    ("RK4 with weights 1, 2, 2, 1 divided by 8", RK4_ROWS, ("1/8", "1/4", "1/4", "1/8")),
    ("RK4 with weights 2, 1, 1, 2 divided by 6", RK4_ROWS, ("1/3", "1/6", "1/6", "1/3")),
    ("RK4 without its fourth stage", RK4_ROWS, ("1/6", "1/3", "1/3", 0)),
    ("Heun's method whose weights add up to 2", ((0,), (1,)), (1, 1)),
    ("the midpoint method whose first stage takes a full step", ((0,), (1,)), (0, 1)),
)  # fmt: skip
"""Mistakes in Runge-Kutta methods: what is wrong, stages and weights."""

MOST_TITLES = 4
"""Schemes that a sentence names; of more it gives the number."""


def title(scheme: str) -> str:
    """Title of a scheme, with a capital letter."""
    known = SCHEMES.get(scheme) or ELSEWHERE.get(scheme)
    name = known.title if known else scheme
    return name[0].upper() + name[1:]


def titles(schemes: Iterable[str]) -> str:
    """Titles of alternative schemes, each once: A, B, C, D or 3 more."""
    names = list(dict.fromkeys(map(title, schemes)))
    more = len(names) - MOST_TITLES
    return either([*names[:MOST_TITLES], *([f"{more} more"] if more > 0 else [])])


def _fault(name: str, cause: str, remedy: str, *stages: Stage) -> Family:
    return Family(
        name=f"fault: {name}", scheme=name, formula="" if stages else name, stages=stages, cause=cause,
        remedy=remedy, path=20,
    )  # fmt: skip


LAGGED = (
    EULER, EULER_LATE, VERLET, POSITION, "rk4", "exact", "explicit-euler", "implicit-euler", "rk2-midpoint",
    "implicit-midpoint", "ruth3", "forest-ruth", "yoshida4",
)  # fmt: skip
"""Schemes whose velocities may be recorded a step ahead of the positions, or behind."""

FAULTS = (
    _fault("old force", "Velocity Verlet whose second half kick uses the old force, "
           "so that one force is held over the whole step, or a Runge-Kutta method whose later stages do",
           "compute the force anew after the drift, or in each stage"),
    _fault("halves swapped",
           "Velocity Verlet with its halves swapped: q + h/2 v + h**2 a, not q + h v + h**2/2 a",
           "move the factor 1/2 from h v to h**2 a"),
    _fault("half drift", "Velocity Verlet with a drift of half the step", "drift by the whole step",
           HALF_KICK, HALF_DRIFT, HALF_KICK),
    _fault("double drift", "Velocity Verlet with a drift of two steps",
           "drift by one step between half kicks", HALF_KICK, DRIFT, DRIFT, HALF_KICK),
    _fault("full kicks", "Velocity Verlet with two full kicks instead of two half kicks", "halve both kicks",
           KICK, DRIFT, KICK),
    _fault("no second kick", "Velocity Verlet without its second half kick",
           "add the half kick after the drift", HALF_KICK, DRIFT),
    _fault("no first kick", "Velocity Verlet without its first half kick",
           "add the half kick before the drift", DRIFT, HALF_KICK),
    _fault("implicit velocity", "An implicit velocity, but the position is moved by the old velocity",
           "move the position by the new velocity: q + h v'"),
    _fault("one iteration", "Implicit Euler by one fixed-point iteration, so that its equation is not solved",
           "iterate until the change is rounding, or solve with the Jacobian"),
    *(
        Family(
            name=f"fault: {cause}", scheme=cause, cause=cause, path=30,
            remedy="compare stages and weights with the tableau",
            stability=stability_function(_tableau(*rows), _tableau(weights)[0]),
        )
        for cause, rows, weights in WRONG_RK4
    ),
    *(
        _fault(
            f"{name} {side}",
            f"{title(name)} whose velocities are one step {side} "
            f"{'the' if side == 'behind' else 'of the'} positions",
            "write position and velocity of the same step",
        )
        for name in LAGGED
        for side in ("behind", "ahead")
    ),
)  # fmt: skip
"""One-step maps of schemes that are written down or recorded wrongly."""

SUBTRACTED = tuple(
    Family(
        name=f"fault: {name}, friction subtracted", scheme=name, stages=stages, damped=True, laws=(IMPLICIT,),
        path=roundings(SCHEMES[name]) + 3,
        cause=f"{title(name)} with an implicit friction of the wrong sign: it divides by m - h c, "
        "not by m + h c",
        remedy="add h times the derivative of the friction to the mass, do not subtract it",
    )
    for name, stages in ((EULER, (WRONG, DRIFT)), (EULER_LATE, (DRIFT, WRONG)))
)  # fmt: skip
"""Faults with friction: each has the map of a damped scheme on another spring, so that only a stated
stiffness tells it."""

HELD = Family(name="held-force", scheme="held-force", damped=True, held=True, path=16)

KNOWN_ELSEWHERE, DAMPED_ELSEWHERE = (
    tuple(
        Family(
            name=one.name + damped, scheme=one.name,
            stages=tuple(("explicit" if damped and kind == "kick" else kind, c) for kind, c in one.stages),
            path=8 * max(len(one.over) + len(one.under), len(one.stages)),
            stability=(one.over, one.under) if one.over else ((), ()),
            damped=bool(damped), laws=(EXPLICIT if len(one.under) == 1 else IMPLICIT,) if damped else (),
        )
        for one in ELSEWHERE.values()
    )
    for damped in ("", ", damped")
)  # fmt: skip
"""Schemes that are named where none of the catalogue fits, and with friction in their force."""

FAMILIES = {
    family.name: family
    for family in (*UNDAMPED, *DAMPED, HELD, *FAULTS, *SUBTRACTED, *KNOWN_ELSEWHERE, *DAMPED_ELSEWHERE)
}


def substeps(share: float, error: float) -> tuple[range, bool, bool]:
    """Numbers of substeps over which a force may be held, empty where no integer fits; whether each substep
    kicks before it drifts; and whether infinitely many, a force held over the whole step, have that share.
    `error` is the standard error of the share from the fit.

    The position advances by (n + 1)/2n of h**2 F/m where substeps kick first, by (n - 1)/2n where they drift
    first.
    """
    if math.isnan(share + error):
        # noise left the fit without a share
        return range(0), False, False
    off, room = abs(2 * share - 1), 12 * (error + G_ROUNDING)
    least = math.ceil(1 / (off + room))
    most = min(1 / (off - room), HELD_SHARES) if off > room else HELD_SHARES
    return range(max(least, 2), math.floor(most) + 1), share > 0.5, off <= room
