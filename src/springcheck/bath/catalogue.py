"""Thermostats as data: the stages of random schemes, written once.

A step takes draws: independent numbers of mean 0 and variance 1, some of which may be those of the step
before.  Coefficients are functions of x = gamma h, the friction rate times the step; exact if rational.

Sources: Leimkuhler & Matthews, Appl. Math. Res. Express 2013, 34 (splittings by their letters); Sivak,
Chodera & Crooks, J. Phys. Chem. B 118 (2014) 6466; Zhang et al., J. Phys. Chem. A 123 (2019) 6056 (BAOA);
Groenbech-Jensen, Mol. Phys. 118 (2020) e1662506 (GJ); Brunger, Brooks & Karplus, Chem. Phys. Lett. 105
(1984) 495 (BBK); Vanden-Eijnden & Ciccotti, Chem. Phys. Lett. 429 (2006) 310; Andersen, J. Chem. Phys. 72
(1980) 2384; Ermak & McCammon, J. Chem. Phys. 69 (1978) 1352 (Brownian); Bussi, Donadio & Parrinello, J. Chem.
Phys. 126 (2007) 014101, and the sign: Bussi & Parrinello, Comput. Phys. Commun. 179 (2008) 26.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import count
from math import inf
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np

from springcheck.bath.decays import GJ, MOST_FRICTION, Decay, decay
from springcheck.schemes import Scheme

Part: TypeAlias = Fraction | Callable[[Any], Any]
"""A fraction of the step, or a function of x = gamma h."""

ONE, HALF = Fraction(1), Fraction(1, 2)


class Act(NamedTuple):
    """One stage: its kind, its fraction of the step, and which draw of the step it takes."""

    kind: Literal[
        "kick", "held", "drift", "exchange", "damp", "undamp", "noise", "jump",
        "creep", "rebuild", "collide", "rescale", "scale",
    ]  # fmt: skip
    part: Part = ONE
    draw: int = 0


@dataclass(frozen=True, kw_only=True)
class Thermostat(Scheme):
    """A random scheme: p and q of one step, by stages that friction and noise belong to."""

    thermostat: ClassVar[bool] = True
    order: int = 0
    limit: float = 2.0
    symplectic: bool = False
    acts: tuple[Act, ...]
    draws: int = 1
    """Number of draws of each coordinate that act in a step, carried ones included."""
    carried: int = 0
    """How many draws, the first ones, are the last ones of the step before."""
    uniform: bool = False
    """Whether draws are uniform instead of normal."""
    synchronised: bool = True
    """Whether the momentum that it stores belongs to the time of the position."""
    most: float = inf
    """Limit of gamma h, from which on the variance of its noise is negative."""
    cancels: int = 0
    """`Arithmetic.cancels` of its coefficients as they are published, in terms of 1 - c2."""

    @property
    def fresh(self) -> int:
        """New draws a step."""
        return self.draws - self.carried

    @property
    def full_rank(self) -> bool:
        """Whether the noise of every step has rank two, by a drift between its draws: no combination of
        (q', p', q, p) is free of it."""
        drawn = [i for i, act in enumerate(self.acts) if act.kind in ("exchange", "noise")]
        return self.draws > 1 and any(act.kind == "drift" for act in self.acts[drawn[0] : drawn[-1]])

    @property
    def collides(self) -> bool:
        """Whether noise comes by collisions, each with a probability."""
        return any(act.kind == "collide" for act in self.acts)

    @property
    def rescales_after(self) -> bool:
        """Whether that factor comes after kicks and drifts."""
        return self.rescales and self.acts[0].kind == "kick"

    @property
    def rescales(self) -> bool:
        """Whether all momenta get one factor, of their kinetic energy and the draws of all: no linear map."""
        return any(act.kind in ("rescale", "scale") for act in self.acts)


def value_of(part: Part, x: Any) -> Any:
    """A fraction of the step, or a function of x = gamma h, in the width of x."""
    if callable(part):
        return part(x)
    return x.dtype.type(part.numerator) / x.dtype.type(part.denominator)


def splitting(letters: str) -> tuple[Act, ...]:
    """The stages of a splitting by its letters: A drift, B kick, O exchange with the bath; letters that come
    n times take an nth of the step each."""
    times, draws = Counter(letters), count()
    return tuple(
        Act("exchange", decay(times[letter]), next(draws))
        if letter == "O"
        else Act("drift" if letter == "A" else "kick", Fraction(1, times[letter]))
        for letter in letters
    )


_SAID = {
    "BAOAB": "VRORV; ASE's LangevinBAOAB",
    "BAOA": "LF-middle; OpenMM's LangevinMiddle as it stores velocities, GROMACS sd",
    "ABOBA": "RVOVR",
    "OBABO": "OVRVO, VVVR; Bussi & Parrinello, GPUMD",
    "OABAO": "ORVRO",
    "AOBOA": "ROVOR",
    "BOAOB": "VOROV",
}


def _by_letters(letters: str) -> Thermostat:
    acts, middle = splitting(letters), letters == "BAOA"
    return Thermostat(
        name=letters.lower(), title=f"{letters}: {_SAID[letters]}", acts=acts,
        draws=letters.count("O"), synchronised=not middle, source="Leimkuhler & Matthews 2013",
    )  # fmt: skip


def _gj(number: str) -> tuple[Thermostat, Thermostat]:
    """BAOAB with c2 in the place of exp(-x), kicks and drifts longer by q; and the same motion with the
    velocity of the half step, whose noise acts again in the next one."""
    c2 = GJ[number]

    def half(x: Any) -> Any:
        return c2.stretch(x) / 2

    def root(x: Any) -> Any:
        return np.sqrt(c2.lost(x) / x)

    kick, drift = Act("kick", half), Act("drift", half)
    on_site = Thermostat(
        name=f"gj-{number}", title=f"GJ-{number.upper()}, on-site velocity",
        acts=(kick, drift, Act("exchange", c2), drift, kick), most=MOST_FRICTION.get(number, inf),
        # 1 - c2 loses one power of 1/x, one more where c2 is (sqrt(1 + 4x) - 1)/2x, a difference itself
        cancels=1 + (number == "iv"),
        source="Groenbech-Jensen 2020; VII: Finkelstein et al., J. Chem. Phys. 155 (2021) 184104; "
        "VIII: Groenbech-Jensen, J. Stat. Phys. 191 (2024) 137",
    )  # fmt: skip
    first, last = (Act("noise", lambda x: root(x) / 2, i) for i in range(2))
    acts = Act("damp", c2.lost), first, Act("kick", root), last, Act("drift", root)
    return on_site, replace(
        on_site, name=f"gj-{number}-half", title=f"GJ-{number.upper()}, half-step velocity", acts=acts,
        draws=2, carried=1, synchronised=False,
    )  # fmt: skip


def _of_x(*coefficients: Fraction | int) -> Callable[[Any], Any]:
    """A polynomial in x, the constant first."""

    def value(x: Any) -> Any:
        total = np.zeros_like(x)
        for c in reversed(coefficients):
            total = total * x + value_of(Fraction(c), x)
        return total

    return value


_VEC_PART = _of_x(HALF, Fraction(-1, 8))
_VEC_PUSH = (
    Act("damp", _of_x(0, HALF, Fraction(-1, 8))), Act("kick", _VEC_PART), Act("noise", _VEC_PART, 0),
    Act("noise", lambda x: -x / (4 * np.sqrt(3 * np.ones_like(x))), 1),
)  # fmt: skip
_VERLET = (Act("kick", HALF), Act("drift"), Act("kick", HALF))

ENERGY_LEFT = Decay(lambda x: np.exp(-2 * x), lambda x: -np.expm1(-2 * x))
"""What a step of Bussi's thermostat leaves of a kinetic energy, which relaxes at twice a momentum's rate."""

_OTHERS = (
    Thermostat(
        name="bbk", title="BBK, each random force used in two half kicks",
        acts=(
            Act("damp", _of_x(0, HALF)), Act("kick", HALF), Act("noise", HALF, 0), Act("drift"),
            Act("kick", HALF), Act("noise", HALF, 1), Act("undamp", _of_x(0, HALF)),
        ),
        draws=2, carried=1, source="Brunger, Brooks & Karplus 1984",
    ),
    Thermostat(
        name="lammps-langevin", title="LAMMPS fix langevin with fix nve, friction of the half-step velocity",
        acts=(
            Act("damp", _of_x(0, 1)), Act("kick", HALF), Act("noise", HALF, 0),
            Act("undamp", _of_x(0, -HALF)), Act("drift"), Act("damp", _of_x(0, HALF)), Act("kick", HALF),
            Act("noise", HALF, 1),
        ),
        draws=2, carried=1, uniform=True,
        source="Schneider & Stoll, Phys. Rev. B 17 (1978) 1302; as LAMMPS runs it",
    ),
    Thermostat(
        name="vanden-eijnden-ciccotti", title="Vanden-Eijnden & Ciccotti, eq. 23; ASE's Langevin",
        acts=(
            *_VEC_PUSH, Act("drift"), Act("jump", lambda x: 1 / (2 * np.sqrt(3 * np.ones_like(x))), 1),
            *_VEC_PUSH,
        ),
        draws=2, source="Vanden-Eijnden & Ciccotti 2006",
    ),
    Thermostat(
        name="euler-maruyama", title="Euler-Maruyama: both from the old state",
        acts=(Act("kick", Fraction(0)), Act("drift"), Act("damp", _of_x(0, 1)), Act("held"), Act("noise")),
        source="Maruyama 1955",
    ),
    Thermostat(
        name="brownian", title="Brownian (overdamped) steps, the velocity (x' - x)/h",
        acts=(Act("creep", lambda x: 1 / x), Act("jump", lambda x: 1 / x), Act("rebuild")),
        synchronised=False, source="Ermak & McCammon 1978; OpenMM's BrownianIntegrator",
    ),
    Thermostat(
        name="andersen", title="Andersen: collision, then velocity Verlet",
        acts=(Act("collide"), Act("kick", HALF), Act("drift"), Act("kick", HALF)), source="Andersen 1980",
    ),
    Thermostat(
        name="andersen-after-kick", title="Andersen, the collision after the first half kick, which is lost",
        acts=(Act("kick", HALF), Act("collide"), Act("drift"), Act("kick", HALF)), source="as ASE runs it",
    ),
    Thermostat(
        name="andersen-after", title="velocity Verlet, then Andersen's collision",
        acts=(*_VERLET, Act("collide")), source="Frenkel & Smit 2002, algorithm 14",
    ),
    Thermostat(
        name="andersen-leapfrog", title="Andersen on the half-step velocities of leapfrog",
        acts=(Act("collide"), Act("kick"), Act("drift")), synchronised=False,
        source="as OpenMM's VerletIntegrator with AndersenThermostat runs it",
    ),
    Thermostat(
        name="bussi", title="Bussi: one factor for all momenta, then velocity Verlet",
        acts=(Act("rescale", ENERGY_LEFT), *_VERLET), source="Bussi & Parrinello 2008",
    ),
    Thermostat(
        name="bussi-unsigned", title="Bussi without the sign of the factor, then velocity Verlet",
        acts=(Act("scale", ENERGY_LEFT), *_VERLET), source="Bussi et al. 2007; as ASE runs it",
    ),
    Thermostat(
        name="bussi-after", title="velocity Verlet, then Bussi without the sign of the factor",
        acts=(*_VERLET, Act("scale", ENERGY_LEFT)), source="Bussi et al. 2007; as LAMMPS runs it",
    ),
)  # fmt: skip

NO_NORMAL_NUMBERS = "it takes no generator of normal numbers"
"""Why a method cannot be given a scripted generator."""

_ON_SITE, _HALF_STEP = zip(*map(_gj, GJ), strict=True)

THERMOSTATS: dict[str, Thermostat] = {
    one.name: one for one in (*map(_by_letters, _SAID), *_ON_SITE, *_HALF_STEP, *_OTHERS)
}
