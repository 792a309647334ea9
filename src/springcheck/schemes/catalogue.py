"""The mathematics of the methods: one-step maps as data, and what follows from them exactly.

A scheme is either a splitting (a sequence of stages: see `kinds`) or a Runge-Kutta tableau.  Coefficients
are exact: fractions, or decimal strings of 40 digits where they are irrational.  `stepping.step` carries out
a scheme in the width of the numbers it is given; everything else (matrix, determinant, frequency, shadow
energy, stability) is derived from that one definition.

Sources: Hairer, Lubich & Wanner, Geometric Numerical Integration (2006), chapters I, II and VI, for
the splittings and the shadow energies; Butcher, Numerical Methods for Ordinary Differential Equations
(2016) for the tableaux; Ruth, IEEE Trans. Nucl. Sci. 30 (1983) 2669; Forest & Ruth, Physica D 43
(1990) 105; Yoshida, Phys. Lett. A 150 (1990) 262.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np

from springcheck.schemes.kinds import KINDS, Acting, StageKind

Coefficient: TypeAlias = Fraction | str
Stage: TypeAlias = tuple[str, Coefficient]
"""What is done, by its name in `KINDS`, and for which fraction of the step."""

Trait: TypeAlias = Literal[
    "named", "one-step", "flow", "adaptive", "splitting", "explicit", "implicit", "symplectic", "reversible",
    "mixes", "friction", "plain", "random",
]  # fmt: skip
"""What a scheme may be: of a known fixed step, the exact flow, or adaptive; made of stages; explicit or
implicit; its own adjoint (reversible); taking slow and fast springs at different times, so that no normal
mode stays by itself (mixes); with a stage of friction alone; made of kicks by all forces and drifts alone
(plain); random."""

ONE, HALF = Fraction(1), Fraction(1, 2)


@dataclass(frozen=True, kw_only=True)
class Scheme:
    """One-step map of a method: a splitting (`stages`), a tableau (`a`, `b`), or neither.

    `limit` is the largest h w at which the step is bounded on a spring: 0 never, infinity always.  A scheme
    with neither stages nor tableau has no step: an adaptive solver, or the exact flow (`flow`), which has a
    matrix on linear scenes and nothing else.
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
    """Power of the tolerance with which an adaptive solver's error falls, on a smooth motion."""
    thermostat: ClassVar[bool] = False
    """Whether it has noise, and a step that `springcheck.bath` carries out."""
    source: str = ""
    unnamed: bool = False
    """It stands for a step, fixed or not, whose scheme nobody has named."""

    @cached_property
    def kinds(self) -> tuple[StageKind, ...]:
        """The kind of each stage."""
        return tuple(KINDS[name] for name, _ in self.stages)

    @cached_property
    def traits(self) -> frozenset[Trait]:
        """Traits of the scheme that other modules ask for."""
        one_step = bool(self.stages or self.b)
        implicit = any(x for i, row in enumerate(self.a) for x in row[i:])
        facts: dict[Trait, bool] = {
            "named": not self.unnamed,
            "one-step": one_step,
            "flow": self.flow,
            "adaptive": not (one_step or self.flow or self.unnamed or self.thermostat),
            "splitting": bool(self.stages),
            "explicit": one_step and not implicit,
            "implicit": implicit,
            "symplectic": self.symplectic,
            "reversible": one_step and self._is_symmetric,
            "mixes": any(kind.evaluates in ("slow", "fast") for kind in self.kinds),
            "friction": any(kind.friction for kind in self.kinds),
            "plain": bool(self.kinds) and all(k.drifts or k.evaluates == "all" for k in self.kinds),
            "random": self.thermostat,
        }
        return frozenset(name for name, is_so in facts.items() if is_so)

    def has(self, *traits: Trait) -> bool:
        """Whether it has all of these traits."""
        return self.traits.issuperset(traits)

    @property
    def braked_order(self) -> int:
        """Order where forces depend on the velocity: kicks by them are steps of explicit Euler along p, whose
        errors of first order no real coefficients cancel."""
        return 1 if any(kind.evaluates in ("all", "slow") for kind in self.kinds) else self.order

    @property
    def _is_symmetric(self) -> bool:
        """Whether it is its own adjoint."""
        if self.stages:
            return self.stages == tuple(reversed(self.stages))
        s = len(self.b)
        if self.b != tuple(reversed(self.b)):
            return False
        full = [row + (row[0] * 0,) * (s - len(row)) for row in self.a]
        return all(full[s - 1 - i][s - 1 - j] + full[i][j] == self.b[j] for i in range(s) for j in range(s))

    @property
    def reach(self) -> int:
        """How far a force propagates within its step: 0 to the momentum, 1 to the position, 2 to a later
        force."""
        reach, kicked = 0, False
        for kind in self.kinds:
            if kind.evaluates:
                reach = 2 if reach else 0
            kicked = kicked or kind.kicks
            if kind.drifts:
                reach = max(reach, int(kicked))
        uses = np.array(self.a, dtype=np.float64)
        # a stage takes its position from velocities, and these from the forces of stages before
        return reach if self.stages else 2 if np.any(uses @ uses) else int(np.any(uses))

    @property
    def evaluations(self) -> list[tuple[Acting, Coefficient, bool]]:
        """Each evaluation of the force within a step: of which terms, for which part of the step, and
        whether at the position where the step starts or ends."""
        if not self.stages:
            return [("all", ONE, not any(row)) for row in self.a]
        drifts = [kind.drifts for kind in self.kinds]
        return [
            (kind.evaluates, c, not any(drifts[:i]) or not any(drifts[i:]))
            for i, (kind, (_, c)) in enumerate(zip(self.kinds, self.stages, strict=True))
            if kind.evaluates
        ]


def _mirrored(*half: Stage) -> tuple[Stage, ...]:
    return (*half, *reversed(half[:-1]))


# The cube root of 2 makes Forest-Ruth's and Yoshida's fourth-order coefficients irrational:
# x1 = 1/(2 - 2**(1/3)), x0 = 1 - 2 x1; kicks and drifts are x1/2, (x0 + x1)/2, x1 and x0.
_X1 = "1.351207191959657634047687808971460826922"
_X0 = "-1.702414383919315268095375617942921653844"
_HALF_X1 = "0.675603595979828817023843904485730413461"
_HALF_X0_X1 = "-0.175603595979828817023843904485730413461"


_EIGHT: tuple[Stage, ...] = 8 * _mirrored(("fast", Fraction(1, 16)), ("drift", Fraction(1, 8)))


def splitting(
    name: str, title: str, order: int, limit: float, stages: tuple[Stage, ...], source: str, *,
    symplectic: bool = True,
) -> Scheme:  # fmt: skip
    """A splitting into kicks, drifts and the like."""
    return Scheme(
        name=name, title=title, order=order, limit=limit, symplectic=symplectic, stages=stages, source=source
    )


def _tableau(
    name: str, title: str, order: int, limit: float, a: Any, b: Any, source: str, *, symplectic: bool = False
) -> Scheme:
    """A Runge-Kutta tableau: rows of `a`, weights `b`."""
    return Scheme(
        name=name, title=title, order=order, limit=limit, symplectic=symplectic,
        a=tuple(tuple(map(Fraction, row)) for row in a), b=tuple(map(Fraction, b)), source=source,
    )  # fmt: skip


def solver(name: str, title: str, source: str, convergence: Fraction | None = None) -> Scheme:
    """An adaptive solver, which has no step of its own."""
    return Scheme(
        name=name, title=title, order=0, limit=np.inf, symplectic=False, convergence=convergence,
        source=source,
    )  # fmt: skip


_SUNDIALS = "Hindmarsh et al., ACM TOMS 31 (2005) 363"
_HLW = "Hairer, Lubich & Wanner, I.1.2"
_TUCKERMAN = "Tuckerman, Berne & Martyna, J. Chem. Phys. 97 (1992) 1990"
_ZHANG = "Zhang et al., J. Phys. Chem. A 123 (2019) 6056"
_RUTH: tuple[Stage, ...] = (
    ("kick", Fraction(7, 24)), ("drift", Fraction(2, 3)), ("kick", Fraction(3, 4)),
    ("drift", Fraction(-2, 3)), ("kick", Fraction(-1, 24)), ("drift", ONE),
)  # fmt: skip

_ALL = (
    _tableau("explicit-euler", "explicit Euler", 1, 0.0, [[0]], [1], "Euler 1768"),
    splitting("semi-implicit-euler", "semi-implicit Euler, kick-drift", 1, 2.0,
              (("kick", ONE), ("drift", ONE)), f"{_HLW}; the blog's own"),
    splitting("semi-implicit-euler-drift-kick", "semi-implicit Euler, drift-kick", 1, 2.0,
              (("drift", ONE), ("kick", ONE)), _HLW),
    _tableau("implicit-euler", "implicit Euler", 1, np.inf, [[1]], [1], _HLW),
    splitting("velocity-verlet", "velocity Verlet", 2, 2.0, _mirrored(("kick", HALF), ("drift", ONE)),
              "Swope et al., J. Chem. Phys. 76 (1982) 637"),
    splitting("position-verlet", "position Verlet", 2, 2.0, _mirrored(("drift", HALF), ("kick", ONE)),
              _TUCKERMAN),
    _tableau("implicit-midpoint", "implicit midpoint", 2, np.inf, [[HALF]], [1], _HLW, symplectic=True),
    _tableau("trapezoidal", "trapezoidal rule (Newmark average acceleration)", 2, np.inf,
             [[0, 0], [HALF, HALF]], [HALF, HALF],
             "Newmark, J. Eng. Mech. Div. 85 (1959) 67, beta 1/4, gamma 1/2"),
    _tableau("rk2-midpoint", "explicit midpoint (RK2)", 2, 0.0, [[0, 0], [HALF, 0]], [0, 1], "Runge 1895"),
    _tableau("rk2-heun", "Heun (RK2)", 2, 0.0, [[0, 0], [1, 0]], [HALF, HALF], "Heun 1900"),
    _tableau("rk4", "classical Runge-Kutta (RK4)", 4, float(np.sqrt(8.0)),
             [[0, 0, 0, 0], [HALF, 0, 0, 0], [0, HALF, 0, 0], [0, 0, 1, 0]],
             [Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6)], "Kutta 1901"),
    splitting("ruth3", "Ruth, third order", 3, 2.507481170952355, _RUTH, "Ruth 1983"),
    splitting("forest-ruth", "Forest-Ruth, fourth order, drift first", 4, 1.5734019474345401,
              _mirrored(("drift", _HALF_X1), ("kick", _X1), ("drift", _HALF_X0_X1), ("kick", _X0)),
              "Forest & Ruth 1990"),
    splitting("yoshida4", "Yoshida, fourth order, kick first", 4, 1.5734019474345401,
              _mirrored(("kick", _HALF_X1), ("drift", _X1), ("kick", _HALF_X0_X1), ("drift", _X0)),
              "Yoshida 1990"),
    splitting("langevin-middle",
              "Langevin middle (BAOAB) at T = 0: half kick, half drift, friction, half drift, half kick",
              2, 2.0, _mirrored(("pull", HALF), ("drift", HALF), ("friction", ONE)),
              f"Leimkuhler & Matthews, Appl. Math. Res. Express 2013, 34; {_ZHANG}"),
    splitting("respa8", "r-RESPA: velocity Verlet of the slow springs around 8 of the fast ones", 2, 16.0,
              (("slow", HALF), *_EIGHT, ("slow", HALF)),
              f"{_TUCKERMAN}; the limit is that of a fast spring alone, in company it resonates first just "
              "below h w = 16 sin(pi/16)"),
    splitting("langevin-middle-early",
              "Langevin middle at T = 0, momenta half a step early: kick, half drift, friction, half drift",
              1, 2.0, (("pull", ONE), ("drift", HALF), ("friction", ONE), ("drift", HALF)),
              f"{_ZHANG}; as OpenMM's integrator stores it"),
    Scheme(name="exact", title="exact flow", order=0, limit=np.inf, symplectic=True, flow=True,
           source="the solution of the equation of motion"),
    solver("adams", "CVODE Adams-Moulton, orders 1-12", _SUNDIALS, Fraction(12, 13)),
    solver("bdf", "CVODE BDF, orders 1-5", _SUNDIALS, Fraction(5, 6)),
    solver("ida", "IDA BDF, orders 1-5, of a circuit's equations", _SUNDIALS),
)  # fmt: skip

SCHEMES: dict[str, Scheme] = {scheme.name: scheme for scheme in _ALL}


def _force_held(n: int) -> tuple[Stage, ...]:
    """Kick and drift, n times per step, by the one force of its beginning."""
    part = Fraction(1, n)
    again: tuple[Stage, ...] = (("held", part), ("drift", part))
    return (("kick", part), ("drift", part), *(again * (n - 1)))


_ATTACHED = (
    *(
        splitting(
            f"force-held-{n}", f"semi-implicit Euler, {n} substeps by one force", 1, 0.0, _force_held(n),
            "a control force constant for a frame of n substeps (frame_skip): [[1 - g a, h/m], [-h k, 1]] "
            "with g = (n + 1)/2n and a = (h w)**2, determinant 1 + a (n - 1)/2n", symplectic=False,
        )
        for n in (2, 4, 5, 10)
    ),
    splitting(
        "force-held-rk4", "constant force over the step (RK4 of that force)", 1, 0.0,
        (("kick", HALF), ("drift", ONE), ("held", HALF)),
        "one force for infinitely many substeps; velocity Verlet that kicks twice by the old "
        "force; determinant 1 + (h w)**2/2", symplectic=False,
    ),
    splitting(
        "semi-implicit-euler-implicit-friction",
        "semi-implicit Euler, friction implicit: v' = (v + h F/m) / (1 + h c/m)", 1, 2.0,
        (("pull", ONE), ("implicit-friction", ONE), ("drift", ONE)),
        "MuJoCo documentation, Computation, Numerical integration: (M + h D) v' = M v + h F",
        symplectic=False,
    ),
    Scheme(
        name="implicit-euler-4", title="implicit Euler, four substeps", order=1, limit=float("inf"),
        symplectic=False, b=(Fraction(1, 4),) * 4,
        a=tuple((Fraction(1, 4),) * (i + 1) + (Fraction(0),) * (3 - i) for i in range(4)),
        source="a spring that a solver of soft constraints takes implicitly in each of four substeps",
    ),
)  # fmt: skip

ATTACHED: dict[str, Scheme] = {scheme.name: scheme for scheme in _ATTACHED}
"""Schemes that follow from how a spring is attached to an engine, next to those that people choose: a force
that is set once and held over substeps, friction that is taken implicitly where the force is not, or a spring
that is solved for in every substep."""

UNKNOWN = Scheme(
    name="unknown",
    title="no scheme that is known here",
    order=0,
    limit=np.inf,
    symplectic=False,
    unnamed=True,
    source="none: only what needs no scheme is judged",
)
"""What a function, command or file claims that states no scheme, where none is found."""


def number(c: Coefficient, width: Any) -> Any:
    """A coefficient rounded once to a float of this width (np.float64, np.longdouble)."""
    return _rounded(c, width)


@lru_cache(maxsize=4096)
def _rounded(c: Coefficient, width: Any) -> Any:
    return width(c.numerator) / width(c.denominator) if isinstance(c, Fraction) else width(c)
