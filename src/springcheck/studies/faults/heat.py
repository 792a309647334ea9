"""The faults of thermostats: data over `baths`, as those of `table` are over `seeded`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from springcheck.physics.rods import Rods
from springcheck.studies.faults import baths
from springcheck.studies.faults.rigid import Late
from springcheck.studies.faults.seeded import Fault, Make
from springcheck.thermal import THERMOSTATS
from springcheck.thermal.catalogue import PROJECT, Act

_DIRECTION, _MATRIX, _MAP = ("noise-direction",), ("noise-matrix",), ("noise-map",)
_VARIANCE, _SHAPE, _SCALE = ("draws-variance",), ("draws-shape",), ("draws-variance", "noise-size")
_LAG, _REPEAT, _KEPT, _APART = ("draws-neighbours",), ("draws-repeat",), ("seed-kept",), ("seeds-apart",)
_COMPANY = ("draws-particles",)


def _bath(
    name: str, about: str, by: tuple[str, ...], make: Make, scheme: str = "baoab", **more: Any
) -> Fault:
    return Fault(name, about, by, make, scheme=scheme, **{"scene": "bath", **more})


def _runs(other: str, claimed: str, by: tuple[str, ...]) -> Fault:
    about = f"the thermostat {other} under the name of {claimed}"
    return _bath(f"{other}-for-{claimed}", about, by, baths.broken(runs=other), scheme=claimed)


OF_NOISE = (
    _bath("mass-not-in-noise", "the noise lacks the root of the mass", _SCALE,
          baths.broken(baths.by(lambda s, x: 1 / np.sqrt(s.m)))),
    _bath("mass-for-its-root", "the noise has the mass in the place of its root", _SCALE,
          baths.broken(baths.by(lambda s, x: np.sqrt(s.m)))),
    _bath("noise-size", "the noise is too large", _VARIANCE, baths.broken(baths.by(lambda s, x: 1 + x)),
          size=0.01, scene="wide bath"),
    _bath("temperature", "the temperature is too high", _MATRIX, baths.broken(thermal=lambda s, x: 1 + x),
          size=2e-12),
    _bath("temperature-power", "the noise grows with another power of the temperature than 1/2",
          ("noise-size",), baths.broken(thermal=lambda s, x: s.thermal**x), size=1e-11),
    _bath("decay-of-variance", "noise of 1 - c in the place of 1 - c**2", _SCALE,
          baths.broken(baths.by(lambda s, x: 1 / np.sqrt(1 + np.exp(-baths.forgetting(s)))))),
    _bath("calories", "calories for joules", _VARIANCE, baths.broken(thermal=lambda s, x: 4.184)),
    _bath("boltzmann", "Boltzmann's constant of five digits", _MATRIX,
          baths.broken(thermal=lambda s, x: 8.3145 / 8.31446261815324)),
    _bath("uniform-draws", "uniform draws", _SHAPE, baths.broken(baths.of_rank(
          lambda u: np.sqrt(12) * (u - 0.5)))),
    _bath("coins", "draws of 1 or -1", _SHAPE, baths.broken(baths.of_rank(lambda u: np.sign(u - 0.5)))),
    _bath("heavy-tails", "draws of Student's distribution with five degrees of freedom", _SHAPE,
          baths.broken(baths.of_rank(baths.heavy))),
    _bath("cut-draws", "draws are cut off at 2", _VARIANCE,
          baths.broken(lambda right, s, x: np.clip(right[-1], -2, 2))),
    _bath("off-centre", "draws are not centred", ("draws-mean",),
          baths.broken(lambda right, s, x: right[-1] + x), size=0.05),
    _bath("draws-twice", "each draw is used in two steps", _LAG,
          baths.broken(lambda right, s, x: right[(len(right) - 1) // 2 * 2])),
    _bath("antithetic", "every other draw is the opposite of the one before", _LAG,
          baths.broken(lambda right, s, x: -right[-2] if len(right) % 2 == 0 else right[-1])),
    _bath("coloured", "a part of each draw is that of the step before", _LAG,
          baths.broken(baths.neighbour), size=0.1),
    _bath("chain-temperature", "the chain's temperature is too high", _DIRECTION,
          baths.broken(thermal=lambda s, x: 1 + x), scheme="nose-hoover", size=1e-12),
    _bath("chain-time", "the chain's frequency is that of a circle: 2 pi over its time", _DIRECTION,
          baths.broken(rate=lambda s, x: 2 * np.pi), scheme="nose-hoover"),
    _runs("nose-hoover-fourth", "nose-hoover", _DIRECTION),
    _bath("restart-64", "the generator begins anew every 64 steps", _REPEAT, baths.broken(baths.again(64))),
    _bath("restart-500", "the generator begins anew every 500 steps", _REPEAT,
          baths.broken(baths.again(500))),
    _bath("one-draw", "one draw for all particles", _COMPANY,
          baths.broken(lambda right, s, x: np.full(s.n, right[-1][0]))),
    _bath("draw-for-two", "one draw for each two particles", _COMPANY,
          baths.broken(lambda right, s, x: np.repeat(right[-1][::2], 2)[: s.n])),
    _bath("seed-ignored", "the seed is ignored", _KEPT, baths.broken(seed=lambda seed: None)),
    _bath("seed-fixed", "the seed is always 1", _KEPT, baths.broken(seed=lambda seed: 1)),
    _bath("seeds-in-a-row", "seeds begin at neighbouring places of one stream of numbers", _APART,
          baths.broken(seed=baths.Row)),
    _bath("seed-of-particle", "a generator for each particle, of the seed and its number", _APART,
          baths.broken(seed=baths.Each)),
)  # fmt: skip

THERMAL_STEPS = (
    _runs("baoa", "baoab", _DIRECTION), _runs("gj-i-half", "gj-i", _DIRECTION),
    _runs("aboba", "baoab", _DIRECTION), _runs("obabo", "baoab", _DIRECTION), _runs("baoab", "obabo", _LAG),
    _runs("gj-ii", "baoab", _DIRECTION), _runs("gj-i", "baoab", _MAP), _runs("baoab", "gj-ii", _DIRECTION),
    _runs("lammps-langevin", "bbk", _MAP), _runs("bbk", "lammps-langevin", _MAP),
    _runs("andersen-leapfrog", "andersen", _DIRECTION),
    _bath("collision-after-kick", "Andersen's collision after the first half kick, which is lost", _VARIANCE,
          baths.broken(runs="andersen-after-kick"), scheme="andersen", scene="wide bath"),
    _bath("collision-chance", "collisions with the chance gamma h", ("collisions",), baths.broken(
          collision=lambda s, x: (g := baths.forgetting(s)) / -np.expm1(-g)), scheme="andersen"),
    _bath("collision-mass", "collisions without the root of the mass", _VARIANCE,
          baths.broken(baths.by(lambda s, x: 1 / np.sqrt(s.m))), scheme="andersen"),
    _runs("bussi-after", "bussi", _DIRECTION),
    _bath("degrees-of-freedom", "a factor counts one degree of freedom too many", _MATRIX,
          baths.broken(lambda right, s, x: np.append(right[-1], right[-1][0])), scheme="bussi"),
    _bath("energy-for-momentum", "kinetic energies forget as momenta should", (*_MATRIX, *_VARIANCE),
          baths.broken(rate=lambda s, x: 0.5), scheme="bussi"),
    _bath("target-energy", "the kinetic energy aimed at is too large", _MATRIX,
          baths.broken(thermal=lambda s, x: 1 + x), scheme="bussi", size=1e-11),
    _bath("friction-of-half", "the friction of half a step for the whole", _VARIANCE,
          baths.broken(rate=lambda s, x: 0.5)),
    _bath("bath-friction", "the friction of the bath is too large", _MAP,
          baths.broken(rate=lambda s, x: 1 + x), size=1e-9),
    _bath("half-kick-lost", "the last half kick is left out", _DIRECTION,
          baths.broken(runs=baths.BROKEN_STAGES["half kick lost"])),
    _bath("half-kick-old", "the last half kick has the old force", _DIRECTION,
          baths.broken(runs=baths.BROKEN_STAGES["old force"])),
    _bath("whole-drifts", "two whole drifts in the place of half ones", _DIRECTION,
          baths.broken(runs=baths.BROKEN_STAGES["whole drifts"])),
    _bath("noise-in-position", "noise acts on positions too", _DIRECTION, baths.jumping, size=1e-9),
    _bath("bath-step", "every step in a bath is too long", _DIRECTION, baths.broken(h=lambda s, x: 1 + x),
          size=1e-9),
    _bath("bath-stiffness", "every force in a bath is too large", _DIRECTION,
          baths.broken(k=lambda s, x: 1 + x), size=1e-9),
    _bath("bath-masses", "all masses of the step are 1", _DIRECTION, baths.broken(m=lambda s, x: 1 / s.m)),
)  # fmt: skip

_BAOAB, _BAOA, _LAMMPS, _VEC = (
    THERMOSTATS[name].held for name in ("baoab", "baoa", "lammps-langevin", "vanden-eijnden-ciccotti")
)


def _rod(name: str, about: str, by: tuple[str, ...], scheme: str = "baoab", **wrong: Any) -> Fault:
    size = wrong.pop("size", None)
    return _bath(
        f"hot-rod-{name}", about, by, baths.broken(**wrong), scheme=scheme, size=size, scene="hot rod"
    )


RODS_IN_BATHS = (
    _rod("not-projected", "momenta along a rod in a bath are left as its last drift leaves them",
         ("rod-velocity",), runs=tuple(act for act in _BAOAB if act != PROJECT)),
    _rod("held-once", "lengths are brought back after both halves of the drift, not after each", _DIRECTION,
         runs=(*_BAOAB[:3], _BAOAB[5], _BAOAB[2], Act("shake"), *_BAOAB[-3:])),
    _rod("after-drift", "a rod in a bath pushes along where it lies after the drift", _DIRECTION,
         hold=lambda s, x: Late(s.m, s.places, s.terms)),
    _rod("masses-alike", "a rod in a bath takes the masses of its ends for equal", _DIRECTION,
         hold=lambda s, x: Rods(np.full(s.n, np.mean(s.m)), s.places, s.terms)),
    _rod("length", "a rod in a bath is too long", ("rod-length",), size=1e-10, hold=lambda s, x: Rods(
         s.m, s.places, [replace(one, length=one.length * (1 + x)) for one in s.terms
                         if one.kind == "constraint"])),
    _rod("draws-projected", "momenta along a rod are taken off amid its drift", _DIRECTION, "baoa",
         runs=(*_BAOA[:4], PROJECT, *_BAOA[4:])),
    _rod("friction-on-site", "friction of the velocity on site, not of the half step before", _DIRECTION,
         "lammps-langevin", runs=(_LAMMPS[6], *_LAMMPS[1:3], *_LAMMPS[4:])),
    _rod("jump-not-held", "noise of positions is added after lengths are brought back", ("rod-length",),
         "vanden-eijnden-ciccotti", runs=(*_VEC[:5], _VEC[6], _VEC[5], *_VEC[7:])),
)  # fmt: skip
