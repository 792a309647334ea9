"""The faults of thermostats, a row each."""

from __future__ import annotations

import numpy as np

from springcheck.bath import THERMOSTATS
from springcheck.bath.catalogue import HALF, ONE, Act
from springcheck.studies.faults.baths import by, forgetting, heavy, of_rank, played
from springcheck.studies.faults.seeded import Fault, each

_DIRECTION, _MATRIX, _MAP = ("noise-direction",), ("noise-matrix",), ("noise-map",)
_VARIANCE, _SHAPE, _SCALE = ("draws-variance",), ("draws-shape",), ("draws-variance", "noise-size")
_PAST, _TIES = ("draws-independent",), ("draws-differ",)

A, B = Act("drift", HALF), Act("kick", HALF)
O = THERMOSTATS["baoab"].acts[2]  # noqa: E741 - the letter of the literature


def _runs(other: str, claimed: str, caught_by: tuple[str, ...]) -> Fault:
    about = f"the thermostat {other} under the name of {claimed}"
    return Fault(f"{other}-for-{claimed}", about, caught_by, lambda c: played(c, runs=other), scheme=claimed)


OF_NOISE = each(
    Fault("mass-not-in-noise", "the noise lacks the root of the mass", _SCALE,
          lambda c: played(c, by(1 / np.sqrt(c.scene.m)))),
    Fault("mass-for-its-root", "the noise has the mass in the place of its root", _SCALE,
          lambda c: played(c, by(np.sqrt(c.scene.m)))),
    Fault("noise-size", "the noise is too large", _VARIANCE, lambda c: played(c, by(1 + c.x)), size=0.01,
          scene="wide bath"),
    Fault("temperature", "the temperature is too high", _MATRIX, lambda c: played(c, thermal=1 + c.x),
          size=2e-12),
    Fault("temperature-power", "the noise grows with another power of the temperature than 1/2",
          ("noise-size",), lambda c: played(c, thermal=c.scene.thermal**c.x), size=1e-11),
    Fault("decay-of-variance", "noise of 1 - c in the place of 1 - c**2", _VARIANCE,
          lambda c: played(c, by(1 / np.sqrt(1 + np.exp(-forgetting(c.scene)))))),
    Fault("calories", "calories for joules", _VARIANCE, lambda c: played(c, thermal=4.184)),
    Fault("boltzmann", "Boltzmann's constant of five digits", _MATRIX,
          lambda c: played(c, thermal=8.3145 / 8.31446261815324)),
    Fault("uniform-draws", "uniform draws", _SHAPE,
          lambda c: played(c, of_rank(lambda u: np.sqrt(12) * (u - 0.5)))),
    Fault("coins", "draws of 1 or -1", (*_SHAPE, *_TIES),
          lambda c: played(c, of_rank(lambda u: np.sign(u - 0.5)))),
    Fault("heavy-tails", "draws of Student's distribution with five degrees of freedom", _SHAPE,
          lambda c: played(c, of_rank(heavy))),
    Fault("cut-draws", "draws are cut off at 2", (*_VARIANCE, *_TIES),
          lambda c: played(c, lambda right: np.clip(right[-1], -2, 2))),
    Fault("off-centre", "draws are not centred", _PAST,
          lambda c: played(c, lambda right: right[-1] + c.x), size=0.05),
    Fault("draws-twice", "each draw is used in two steps", _TIES,
          lambda c: played(c, lambda right: right[(len(right) - 1) // 2 * 2])),
    Fault("antithetic", "every other draw is the opposite of the one before", (*_PAST, *_TIES),
          lambda c: played(c, lambda right: -right[-2] if len(right) % 2 == 0 else right[-1])),
    Fault("coloured", "a part of each draw is that of the step before", _PAST, size=0.1,
          make=lambda c: played(c, lambda right: (
              (right[-1] + c.x * right[-2]) / np.sqrt(1 + c.x * c.x) if right[1:] else right[-1]))),
    Fault("restart-64", "the generator begins anew every 64 steps", _TIES,
          lambda c: played(c, lambda right: right[(len(right) - 1) % 64])),
    Fault("restart-500", "the generator begins anew every 500 steps", _TIES,
          lambda c: played(c, lambda right: right[(len(right) - 1) % 500])),
    Fault("one-draw", "one draw for all particles", (*_PAST, *_TIES),
          lambda c: played(c, lambda right: np.full(c.scene.n, right[-1][0]))),
    Fault("draw-for-two", "one draw for each two particles", (*_PAST, *_TIES),
          lambda c: played(c, lambda right: np.repeat(right[-1][::2], 2)[: c.scene.n])),
    scheme="baoab", scene="bath",
)  # fmt: skip

THERMAL_STEPS = each(
    _runs("baoa", "baoab", _DIRECTION), _runs("gj-i-half", "gj-i", _DIRECTION),
    _runs("aboba", "baoab", _DIRECTION), _runs("obabo", "baoab", _DIRECTION), _runs("baoab", "obabo", _PAST),
    _runs("gj-ii", "baoab", _DIRECTION), _runs("gj-i", "baoab", _MAP), _runs("baoab", "gj-ii", _DIRECTION),
    _runs("lammps-langevin", "bbk", _MAP), _runs("bbk", "lammps-langevin", _MAP),
    _runs("andersen-leapfrog", "andersen", _DIRECTION), _runs("andersen", "andersen-after", _DIRECTION),
    Fault("collision-after-kick", "Andersen's collision after the first half kick, which is lost", _VARIANCE,
          lambda c: played(c, runs="andersen-after-kick"), scheme="andersen", scene="wide bath"),
    Fault("collision-chance", "collisions with the chance gamma h", ("collisions",), lambda c: played(
        c, collision=forgetting(c.scene) / -np.expm1(-forgetting(c.scene))), scheme="andersen"),
    Fault("collision-mass", "collisions without the root of the mass", _VARIANCE,
          lambda c: played(c, by(1 / np.sqrt(c.scene.m))), scheme="andersen"),
    _runs("bussi-after", "bussi", _DIRECTION),
    Fault("degrees-of-freedom", "a factor counts one degree of freedom too many", _MATRIX,
          lambda c: played(c, lambda right: np.append(right[-1], right[-1][0])), scheme="bussi"),
    Fault("energy-for-momentum", "kinetic energies forget as momenta should", (*_MATRIX, *_VARIANCE),
          lambda c: played(c, rate=0.5), scheme="bussi"),
    Fault("target-energy", "the kinetic energy aimed at is too large", _MATRIX,
          lambda c: played(c, thermal=1 + c.x), scheme="bussi", size=1e-11),
    Fault("friction-of-half", "the friction of half a step for the whole", _VARIANCE,
          lambda c: played(c, rate=0.5)),
    Fault("bath-friction", "the friction of the bath is too large", _MAP,
          lambda c: played(c, rate=1 + c.x), size=1e-9),
    Fault("drag-alone", "the drag is too strong for its noise", _PAST, lambda c: played(
        c, by(np.sqrt(np.expm1(-2 * (x := forgetting(c.scene))) / np.expm1(-2 * x * (1 + c.x)))),
        rate=1 + c.x), size=0.2, scene="wide bath"),
    Fault("force-with-two-draws", "every force is too large beside draws that reach every state",
          _PAST, lambda c: played(c, k=1 + c.x), scheme="obabo", size=0.1, scene="wide bath"),
    Fault("half-kick-lost", "the last half kick is left out", _DIRECTION,
          lambda c: played(c, runs=(B, A, O, A))),
    Fault("half-kick-old", "the last half kick has the old force", _DIRECTION,
          lambda c: played(c, runs=(B, A, O, A, Act("held", HALF)))),
    Fault("whole-drifts", "two whole drifts in the place of half ones", _DIRECTION,
          lambda c: played(c, runs=(B, Act("drift", ONE), O, Act("drift", ONE), B))),
    Fault("noise-in-position", "noise acts on positions too", _DIRECTION,
          lambda c: played(c, runs=(B, A, O, A, B, Act("jump", lambda x: c.x * x))), size=1e-9),
    Fault("bath-step", "every step in a bath is too long", _DIRECTION, lambda c: played(c, h=1 + c.x),
          size=1e-9),
    Fault("bath-stiffness", "every force in a bath is too large", _DIRECTION,
          lambda c: played(c, k=1 + c.x), size=1e-9),
    Fault("bath-masses", "all masses of the step are 1", _DIRECTION,
          lambda c: played(c, m=1 / c.scene.m)),
    scheme="baoab", scene="bath",
)  # fmt: skip
