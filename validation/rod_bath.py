"""A rod in OpenMM's heat bath: what a step does to it, and the temperatures that follow.

Claim: a step of LangevinMiddleIntegrator with a constraint is the map `middle`, to rounding, friction alone
and with noise; its draws have a variance of 1 along the rod as across it; its temperatures are these laws.

Command: python validation/rod_bath.py    (20 s on busy cores)

c = exp(-friction h), a = h**2 kT/(reduced mass length**2).  No draw is projected, and no velocity after
SHAKE: half the draw along the rod and the chord of the turn stay in what OpenMM stores, and in the kinetic
energy that it reports, until the next step projects them together with its kick.  Over that of the bath:
* temperature of the centre, 3 degrees of freedom: 1;
* of the rotation, 2, of velocities that are projected: 1 - a (1 - c)/8 + O(a**2), for the turn of a drift
  mixes in the draw along the rod;
* by how much what is stored is hotter, of 5: (1 - c**2 + 2 a (1 + c)**2 + a (1 - c**2) (1 - c))/20 + O(a**2).

Expected (OpenMM 8.6.1, Reference, tolerance 1e-13; a = 0.014): steps depart by 0.34 of their bound at most,
which is mostly SHAKE's tolerance; variances of draws along and across of 0.996 to 1.003, errors 0.002 (along)
and 0.0014; the centre at 0.9986(37) to 1.001(1), the rotation at 0.9976(47) to 1.0004(18); and

    friction h    stored less projected    law        the turn adds, over a    law
       0.1             0.0143(2)           0.0141           -0.017(2)              -0.0119
       0.5             0.0355(2)           0.0354           -0.049(1)              -0.0492
       1.0             0.0462(3)           0.0462           -0.0789(8)             -0.0790

Exit status 0 while departures are within their bounds and means within 5 standard errors, 1 otherwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck.physics.rods import Rods
from springcheck.physics.terms import Rod

M, LENGTH, STEP, THERMAL = np.repeat([1.3, 4.1], 3), 0.7, 0.05, 2.7
PULL, TOLERANCE, SIGMAS = np.array([3.0, -2.0, 4.0, 0.0, 0.0, 0.0]), 1e-13, 5.0
ENDS = {"a": np.arange(3), "b": np.arange(3, 6), "length": np.full(3, LENGTH)}
ROD = Rods(M, np.arange(6), (Rod(**ENDS),))
SMALL = STEP**2 * THERMAL * float(ROD.inverse_mass[0]) / LENGTH**2
SECOND = 4 * SMALL**2
"""What the laws leave out: (1 - cos)**2 of the turn makes the largest term, 1.2 a**2 of 5 degrees."""
ROUNDINGS = 64
"""A step has some 30 operations on the numbers of a state, and reading its draws doubles them."""


def middle(q: Any, p: Any, draws: Any, rate: Any, thermal: float, pull: Any) -> Any:
    """A step: kick and projection, half a drift, friction and noise, half a drift, SHAKE and its push."""
    c, p = np.exp(-rate * STEP), ROD.projected(q, p + STEP * pull)
    after = c * p + np.sqrt((1 - c * c) * thermal * M) * draws
    return ROD.drifted(q, q + STEP / 2 * (p + after) / M, after, STEP)


def started(n: int) -> tuple[Any, Any]:
    """n rods about the origin, and their thermal momenta (n, 6)."""
    rng = np.random.default_rng(5)
    e = rng.normal(size=(n, 3))
    e *= LENGTH * float(1 / ROD.inverse_mass[0]) / np.linalg.norm(e, axis=1, keepdims=True)
    q = np.concatenate([-e, e], axis=1) / M
    return q, ROD.projected(q, np.sqrt(THERMAL * M) * rng.normal(size=q.shape))


def openmm(
    q: Any, p: Any, steps: int, rate: float, thermal: float, pull: Any, place: str = "Reference"
) -> Any:
    """States (f, n, 6) as it stores them, and the kinetic energies that it reports (f,)."""
    import openmm as mm

    system, force = mm.System(), mm.CustomExternalForce("-(fx*x+fy*y+fz*z)")
    for name in ("fx", "fy", "fz"):
        force.addPerParticleParameter(name)
    for i in range(2 * len(q)):
        system.addParticle(M[i % 2 * 3])
        force.addParticle(i, pull[i % 2 * 3 :][:3])
        if i % 2:
            system.addConstraint(i - 1, i, LENGTH)
    system.addForce(force)
    integrator = mm.LangevinMiddleIntegrator(thermal / (1.380649e-26 * 6.02214076e23), rate, STEP)
    integrator.setConstraintTolerance(TOLERANCE)
    integrator.setRandomNumberSeed(3)
    context = mm.Context(system, integrator, mm.Platform.getPlatformByName(place))
    context.setPositions(q.reshape(-1, 3))
    context.setVelocities((p / M).reshape(-1, 3))
    x, v, found = np.empty((2 * len(q), 3)), np.empty((2 * len(q), 3)), []
    for _ in range(steps):
        integrator.step(1)
        state = context.getState(positions=True, velocities=True, energy=True)
        state._getVectorAsNumpy(mm.State.Positions, x)
        state._getVectorAsNumpy(mm.State.Velocities, v)
        found.append((x.reshape(q.shape).copy(), v.reshape(q.shape) * M, state.getKineticEnergy()._value))
    return [np.array(each) for each in zip(*found, strict=True)]


def departure(made: Any, found: Any) -> float:
    """Error of a step over its bound: roundings of the states, and what SHAKE's tolerance leaves."""
    size = np.max(np.abs(found[0])) + np.max(np.abs(STEP * found[1] / M))
    off = max(np.max(np.abs(made[0] - found[0])), np.max(np.abs(STEP * (made[1] - found[1]) / M)))
    return float(off / (ROUNDINGS * 2.0**-53 * size + TOLERANCE * LENGTH))


def judged(q: Any, p: Any, rate: Any, thermal: float, pull: Any) -> tuple[float, Any]:
    """The departure of all steps, and their draws: a drift and what is stored after it tell SHAKE's push."""
    q, p, rate = q.astype(np.longdouble), p.astype(np.longdouble), np.longdouble(rate)
    c, before = np.exp(-rate * STEP), ROD.projected(q[:-1], p[:-1] + STEP * pull)
    after = before - 2 * (M * (q[1:] - q[:-1]) - STEP * p[1:]) / STEP
    draws = (after - c * before) / np.sqrt((1 - c * c) * thermal * M) if thermal else 0 * after
    return departure(middle(q[:-1], p[:-1], draws, rate, thermal, pull), (q[1:], p[1:])), draws


def mean(values: Any) -> tuple[float, float]:
    """Mean of values (f, n), and SIGMAS standard errors of it over the rods, which are independent."""
    each = np.mean(np.asarray(values, float), axis=0)
    return float(np.mean(each)), SIGMAS * float(np.std(each) / np.sqrt(len(each)))


def measured(q: Any, p: Any, draws: Any) -> dict[str, Any]:
    """Values (f, n) whose means have a law: squares of draws, and temperatures over the bath's."""
    e, energy = ROD.ways(q[:-1]) / LENGTH, p * p / M / THERMAL
    held = ROD.projected(q, p)
    along = [np.sum(draws[..., j : j + 3] * e, -1) ** 2 for j in (0, 3)]
    across = [np.sum(draws[..., j : j + 3] ** 2, -1) / 2 - x / 2 for j, x in zip((0, 3), along, strict=True)]
    way = ROD.apart(held / M)
    return {
        "draws along, light end": along[0], "draws along, heavy end": along[1],
        "draws across, light end": across[0], "draws across, heavy end": across[1],
        "temperature of the centre": np.sum((held[..., :3] + held[..., 3:]) ** 2, -1) / np.sum(M) / THERMAL,
        "of the rotation": np.sum(way**2, -1) / float(ROD.inverse_mass[0]) / THERMAL / 2,
        "of what is stored less projected": np.sum(energy - held**2 / M / THERMAL, axis=-1) / 5,
    }  # fmt: skip


def turned_off(a: float, c: float, n: int, steps: int = 60) -> tuple[float, float]:
    """Rotational temperature of the map in the frame of its rod, less that of one that does not turn, over a.

    Draws along the rod come with either sign, so that what is of first order in them goes.
    """
    rng, size = np.random.default_rng(7), np.sqrt(a)
    free = size * rng.normal(size=(n, 2))
    u, kept = np.stack([free, free]), []
    for _ in range(steps):
        *across, along = size * np.sqrt(1 - c * c) * rng.normal(size=(3, n))
        w, free = c * u + np.transpose(across), c * free + np.transpose(across)
        sine = np.linalg.norm(u + w, axis=-1) / 2
        f, cosine = (u + w) / (2 * sine[..., None]), np.sqrt(1 - sine**2)
        mixed = (cosine - 1) * np.sum((w - u) * f, -1) / 2 - sine * np.stack([along, -along]) / 2
        u = w + f * mixed[..., None]
        kept.append(np.sum(u**2 - free**2, axis=(0, 2)) / (4 * a * a))
    return mean(kept[steps // 2 :])


def rows(rods: int = 400, steps: int = 1200) -> Any:
    """What is measured, its value, its law, and what they may differ by."""
    for friction in (0.1, 0.5, 1.0):
        rate, c = friction / STEP, float(np.exp(-friction))
        for thermal in (0.0, THERMAL):
            q, p = started(20)
            if not thermal:
                # the fastest turns by h w = 0.5
                p *= 0.5 / STEP / np.max(ROD.rates(q, p))
            q, p, _ = openmm(q, p, 50, rate, thermal, PULL)
            of = f"friction h {friction}: departure of a step, {'noise' if thermal else 'T = 0'}"
            yield of, judged(q, p, rate, thermal, PULL)[0], 0.0, 1.0
        q, p, kinetic = openmm(*started(rods), steps, rate, THERMAL, np.zeros(6))
        off = np.max(np.abs(2 * kinetic / np.sum(p * p / M, axis=(1, 2)) - 1))
        yield "kinetic energy, reported over stored, less 1", float(off), 0.0, 2 * rods * 6 * 2.0**-53
        hot = (1 - c * c + SMALL * (2 * (1 + c) ** 2 + (1 - c * c) * (1 - c))) / 20
        laws = 1.0, 1.0, 1.0, 1.0, 1.0, 1 - SMALL * (1 - c) / 8, hot
        found = measured(q, p, judged(q, p, rate, THERMAL, np.zeros(6))[1])
        for (title, values), law in zip(found.items(), laws, strict=True):
            value, most = mean(values)
            yield title, value, law, most + SECOND * title.startswith("of")
        yield (
            "what turning adds, over a",
            *(x := turned_off(0.005, c, 100 * rods))[:1],
            (c - 1) / 8,
            x[1],
        )


def shown(found: Any) -> bool:
    """Print rows beside their laws: whether one of them is wrong."""
    wrong = False
    for title, value, law, most in found:
        off = not abs(value - law) <= most
        wrong |= off
        print(f"{title:46} {value:12.3e} {law:12.3e} +- {most:.1e}{' WRONG' * off}")
    return wrong


def main() -> int:
    """Print what is measured beside its law; 1 where one is off."""
    arguments(__doc__)
    return int(shown(rows()))


if __name__ == "__main__":
    script(main)
