"""The mathematics of the methods: one-step maps as data, and what follows from them exactly.

A scheme is either a splitting (a sequence of kicks ``p += c h F(q)``, drifts ``q += d h p/m`` and
frictions ``p *= exp(-c h gamma)``) or a Runge-Kutta tableau.  Coefficients are exact: fractions, or
decimal strings of 40 digits where they are irrational.  `stepping.step` carries out a scheme in the width
of the numbers it is given; everything else (matrix, determinant, frequency, shadow energy, stability) is
derived from that one definition.

Sources: Hairer, Lubich & Wanner, Geometric Numerical Integration (2006), chapters I, II and VI, for
the splittings and the shadow energies; Butcher, Numerical Methods for Ordinary Differential Equations
(2016) for the tableaux; Ruth, IEEE Trans. Nucl. Sci. 30 (1983) 2669; Forest & Ruth, Physica D 43
(1990) 105; Yoshida, Phys. Lett. A 150 (1990) 262.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, Literal, TypeAlias

import numpy as np

Coefficient: TypeAlias = Fraction | str
Kind: TypeAlias = Literal["kick", "held", "drift", "pull", "friction", "implicit-friction", "slow", "fast"]
Stage: TypeAlias = tuple[Kind, Coefficient]
"""What is done for a fraction of the step: a kick by all forces at the present q and p, a kick by the force
of the kick before, which is not evaluated anew, a drift, a pull by the forces of the potential alone, the
exact decay of p by friction alone, its decay by implicit Euler, or a kick by the slow or by the fast springs
alone."""

ONE, HALF = Fraction(1), Fraction(1, 2)


FRICTION = frozenset({"friction", "implicit-friction"})
"""Stages that act by friction alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scheme:
    """One-step map of a method: a splitting (`stages`), a tableau (`a`, `b`), or neither.

    `limit` is the largest h w at which the step is bounded on a spring: 0 never, infinity always.
    A scheme with neither stages nor tableau has no step: an adaptive solver, or the exact flow (`flow`),
    which has a matrix on linear scenes and nothing else.
    """

    name: str
    title: str
    order: int
    limit: float
    symplectic: bool
    stages: tuple[Stage, ...] = ()
    a: tuple[tuple[Fraction, ...], ...] = ()
    b: tuple[Fraction, ...] = ()
    flow: bool = False
    convergence: Fraction | None = None
    """Of an adaptive solver: the power of its tolerance with which its error falls, on a smooth motion."""
    source: str = ""

    @property
    def implicit(self) -> bool:
        """Whether a step solves an equation."""
        return any(x for i, row in enumerate(self.a) for x in row[i:])

    @property
    def mixes(self) -> bool:
        """Whether slow and fast springs act at different times, so that no normal mode stays by itself."""
        return any(kind in ("slow", "fast") for kind, _ in self.stages)

    @property
    def reach(self) -> int:
        """How far a force gets within its step: 0 to the momentum, 1 to the position, 2 to a later force."""
        reach, kicked = 0, False
        for kind, _ in self.stages:
            if kind == "drift":
                reach = max(reach, int(kicked))
            elif kind == "held":
                kicked = True
            elif kind not in FRICTION:
                reach, kicked = 2 if reach else 0, True
        uses = np.array(self.a, dtype=np.float64)
        # a stage takes its position from velocities, and these from the forces of stages before
        return reach if self.stages else 2 if np.any(uses @ uses) else int(np.any(uses))

    @property
    def one_step(self) -> bool:
        """Whether `step` can carry the scheme out."""
        return bool(self.stages or self.b)


def _mirrored(*half: Stage) -> tuple[Stage, ...]:
    return (*half, *reversed(half[:-1]))


# The cube root of 2 makes Forest-Ruth's and Yoshida's fourth-order coefficients irrational:
# x1 = 1/(2 - 2**(1/3)), x0 = 1 - 2 x1; kicks and drifts are x1/2, (x0 + x1)/2, x1 and x0.
_X1 = "1.351207191959657634047687808971460826922"
_X0 = "-1.702414383919315268095375617942921653844"
_HALF_X1 = "0.675603595979828817023843904485730413461"
_HALF_X0_X1 = "-0.175603595979828817023843904485730413461"


_EIGHT: tuple[Stage, ...] = 8 * _mirrored(("fast", Fraction(1, 16)), ("drift", Fraction(1, 8)))


def _row(*numbers: int | Fraction) -> tuple[Fraction, ...]:
    return tuple(Fraction(x) for x in numbers)


_ALL = (
    Scheme(
        name="explicit-euler",
        title="explicit Euler",
        order=1,
        limit=0.0,
        symplectic=False,
        a=(_row(0),),
        b=_row(1),
        source="Euler 1768",
    ),
    Scheme(
        name="semi-implicit-euler",
        title="semi-implicit Euler, kick-drift",
        order=1,
        limit=2.0,
        symplectic=True,
        stages=(("kick", ONE), ("drift", ONE)),
        source="Hairer, Lubich & Wanner, I.1.2; the blog's own",
    ),
    Scheme(
        name="semi-implicit-euler-drift-kick",
        title="semi-implicit Euler, drift-kick",
        order=1,
        limit=2.0,
        symplectic=True,
        stages=(("drift", ONE), ("kick", ONE)),
        source="Hairer, Lubich & Wanner, I.1.2",
    ),
    Scheme(
        name="implicit-euler",
        title="implicit Euler",
        order=1,
        limit=np.inf,
        symplectic=False,
        a=(_row(1),),
        b=_row(1),
        source="Hairer, Lubich & Wanner, I.1.2",
    ),
    Scheme(
        name="velocity-verlet",
        title="velocity Verlet",
        order=2,
        limit=2.0,
        symplectic=True,
        stages=_mirrored(("kick", HALF), ("drift", ONE)),
        source="Swope et al., J. Chem. Phys. 76 (1982) 637",
    ),
    Scheme(
        name="position-verlet",
        title="position Verlet",
        order=2,
        limit=2.0,
        symplectic=True,
        stages=_mirrored(("drift", HALF), ("kick", ONE)),
        source="Tuckerman, Berne & Martyna, J. Chem. Phys. 97 (1992) 1990",
    ),
    Scheme(
        name="implicit-midpoint",
        title="implicit midpoint",
        order=2,
        limit=np.inf,
        symplectic=True,
        a=((HALF,),),
        b=_row(1),
        source="Hairer, Lubich & Wanner, I.1.2",
    ),
    Scheme(
        name="trapezoidal",
        title="trapezoidal rule (Newmark average acceleration)",
        order=2,
        limit=np.inf,
        symplectic=False,
        a=(_row(0, 0), _row(HALF, HALF)),
        b=_row(HALF, HALF),
        source="Newmark, J. Eng. Mech. Div. 85 (1959) 67, beta 1/4, gamma 1/2",
    ),
    Scheme(
        name="rk2-midpoint",
        title="explicit midpoint (RK2)",
        order=2,
        limit=0.0,
        symplectic=False,
        a=(_row(0, 0), _row(HALF, 0)),
        b=_row(0, 1),
        source="Runge 1895",
    ),
    Scheme(
        name="rk2-heun",
        title="Heun (RK2)",
        order=2,
        limit=0.0,
        symplectic=False,
        a=(_row(0, 0), _row(1, 0)),
        b=_row(HALF, HALF),
        source="Heun 1900",
    ),
    Scheme(
        name="rk4",
        title="classical Runge-Kutta (RK4)",
        order=4,
        limit=float(np.sqrt(8.0)),
        symplectic=False,
        a=(_row(0, 0, 0, 0), _row(HALF, 0, 0, 0), _row(0, HALF, 0, 0), _row(0, 0, 1, 0)),
        b=_row(Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6)),
        source="Kutta 1901",
    ),
    Scheme(
        name="ruth3",
        title="Ruth, third order",
        order=3,
        limit=2.507481170952355,
        symplectic=True,
        stages=(
            ("kick", Fraction(7, 24)),
            ("drift", Fraction(2, 3)),
            ("kick", Fraction(3, 4)),
            ("drift", Fraction(-2, 3)),
            ("kick", Fraction(-1, 24)),
            ("drift", ONE),
        ),
        source="Ruth 1983",
    ),
    Scheme(
        name="forest-ruth",
        title="Forest-Ruth, fourth order, drift first",
        order=4,
        limit=1.5734019474345401,
        symplectic=True,
        stages=_mirrored(("drift", _HALF_X1), ("kick", _X1), ("drift", _HALF_X0_X1), ("kick", _X0)),
        source="Forest & Ruth 1990",
    ),
    Scheme(
        name="yoshida4",
        title="Yoshida, fourth order, kick first",
        order=4,
        limit=1.5734019474345401,
        symplectic=True,
        stages=_mirrored(("kick", _HALF_X1), ("drift", _X1), ("kick", _HALF_X0_X1), ("drift", _X0)),
        source="Yoshida 1990",
    ),
    Scheme(
        name="langevin-middle",
        title="Langevin middle scheme at T = 0: half pull, half drift, friction, half drift, half pull",
        order=2,
        limit=2.0,
        symplectic=True,
        stages=_mirrored(("pull", HALF), ("drift", HALF), ("friction", ONE)),
        source="Leimkuhler & Matthews, Appl. Math. Res. Express 2013, 34; Zhang et al., "
        "J. Phys. Chem. A 123 (2019) 6056",
    ),
    Scheme(
        name="respa8",
        title="r-RESPA: velocity Verlet of the slow springs around 8 of the fast ones",
        order=2,
        limit=16.0,
        symplectic=True,
        stages=(("slow", HALF), *_EIGHT, ("slow", HALF)),
        source="Tuckerman, Berne & Martyna, J. Chem. Phys. 97 (1992) 1990; the limit is that of a fast "
        "spring alone, in company it resonates from h w = 16 sin(pi/16) on",
    ),
    Scheme(
        name="langevin-middle-early",
        title="Langevin middle at T = 0, momenta half a step early: pull, half drift, friction, half drift",
        order=1,
        limit=2.0,
        symplectic=True,
        stages=(("pull", ONE), ("drift", HALF), ("friction", ONE), ("drift", HALF)),
        source="Zhang et al., J. Phys. Chem. A 123 (2019) 6056; as OpenMM's integrator stores it",
    ),
    Scheme(
        name="exact",
        title="exact flow",
        order=0,
        limit=np.inf,
        symplectic=True,
        flow=True,
        source="the solution of the equation of motion",
    ),
    Scheme(
        name="adams",
        title="CVODE Adams-Moulton, orders 1-12",
        order=0,
        limit=np.inf,
        symplectic=False,
        convergence=Fraction(12, 13),
        source="Hindmarsh et al., ACM TOMS 31 (2005) 363",
    ),
    Scheme(
        name="bdf",
        title="CVODE BDF, orders 1-5",
        order=0,
        limit=np.inf,
        symplectic=False,
        convergence=Fraction(5, 6),
        source="Hindmarsh et al., ACM TOMS 31 (2005) 363",
    ),
    Scheme(
        name="ida",
        title="IDA BDF, orders 1-5, of a circuit's equations",
        order=0,
        limit=np.inf,
        symplectic=False,
        source="Hindmarsh et al., ACM TOMS 31 (2005) 363",
    ),
)

SCHEMES: dict[str, Scheme] = {scheme.name: scheme for scheme in _ALL}


def number(c: Coefficient, width: Any) -> Any:
    """A coefficient rounded once to a float of this width (np.float64, np.longdouble)."""
    return _rounded(c, width)


@lru_cache(maxsize=4096)
def _rounded(c: Coefficient, width: Any) -> Any:
    return width(c.numerator) / width(c.denominator) if isinstance(c, Fraction) else width(c)
