"""The seconds per step of a study of precision are the engine's own: springcheck adds nothing to them.

Claim: what the study times (`studies.precision.bare`: the engine started by springcheck, stepped in one call,
read once) lies within 5 % of the same engine driven by a bare loop written by hand below, without
springcheck's driver, measured in turn with it in this run; minimum of the repeats of each.  Runs take some
10 ms, so that some of three hundred fall between the interruptions of a busy machine.

Command: python validation/timing_overhead.py        (30 s)

Expected (AMD EPYC, one core, openmm 8.6, ase 3.29, numba 0.68):

                               bare loop   springcheck   ratio
    openmm:verlet                85.1 ns       88.1 ns    1.04
    ase:velocity-verlet          68.8 us       69.3 us    1.01
    own:euler                    3.15 ns       3.19 ns    1.01
    own:semi-implicit-euler      6.33 ns       6.33 ns    1.00
    own:implicit-euler           6.98 ns       6.98 ns    1.00

The bare loop of ASE has the calculator of a scene with any terms: one written for a single spring, which
compares positions alone as well, takes 61 us a step in the place of 69.
Next to other busy programs ASE's ratio alone wavers by some 5 %; run this on a quiet machine.

Exit status 0 when every ratio is within 5 % of 1, 1 otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numba
import numpy as np
import openmm
from ase import Atoms
from ase.md.verlet import VelocityVerlet

from arguments import arguments, script
from springcheck import engines
from springcheck.engines.ase.simulation import Springs
from springcheck.physics import scenefile as scenes
from springcheck.studies.precision import bare

M, K, Q, P = 3.7, 2.9, 0.3, 0.7
WITHIN = 0.05
Run = Callable[[int, float], float]


def openmm_verlet(steps: int, h: float) -> float:
    """A particle on a bond to a fixed one, as OpenMM's manual would have it."""
    system = openmm.System()
    system.addParticle(M)
    system.addParticle(0.0)
    bond = openmm.HarmonicBondForce()
    bond.addBond(0, 1, 0.0, K)
    system.addForce(bond)
    integrator = openmm.VerletIntegrator(h)
    context = openmm.Context(system, integrator, openmm.Platform.getPlatformByName("Reference"))
    context.setPositions([[Q, 0, 0], [0, 0, 0]])
    context.setVelocities([[P / M, 0, 0], [0, 0, 0]])
    integrator.step(1)
    began = perf_counter()
    integrator.step(steps)
    context.getState(positions=True, velocities=True)
    return perf_counter() - began


def ase_verlet(steps: int, h: float) -> float:
    """One atom, with the calculator of a scene, and `VelocityVerlet.run`."""
    atoms = Atoms("H", positions=[[Q, 0, 0]], masses=[M], momenta=[[P, 0, 0]])
    atoms.calc = Springs(scenes.load_scene("spring-uneven").system, 1.0, 1.0)
    dynamics = VelocityVerlet(atoms, timestep=h)
    began = perf_counter()
    dynamics.run(steps)
    return perf_counter() - began


@numba.njit  # type: ignore[untyped-decorator]
def _euler(steps: int, h: float, m: float, k: float, q: float, p: float) -> tuple[float, float]:
    for _ in range(steps):
        q, p = q + (p / m) * h, p + (-k * q) * h
    return q, p


@numba.njit  # type: ignore[untyped-decorator]
def _semi_implicit_euler(steps: int, h: float, m: float, k: float, q: float, p: float) -> tuple[float, float]:
    for _ in range(steps):
        p = p + (-k * q) * h
        q = q + (p / m) * h
    return q, p


@numba.njit  # type: ignore[untyped-decorator]
def _implicit_euler(steps: int, h: float, m: float, k: float, q: float, p: float) -> tuple[float, float]:
    inverse = 1 / (1 + h * h * (k / m))
    for _ in range(steps):
        p = (p + (-k * q) * h) * inverse
        q = q + (p / m) * h
    return q, p


def compiled(loop: Callable[..., tuple[float, float]]) -> Run:
    """A timed call of a compiled loop."""

    def run(steps: int, h: float) -> float:
        loop(1, h, M, K, Q, P)
        began = perf_counter()
        loop(steps, h, M, K, Q, P)
        return perf_counter() - began

    return run


BARE: dict[str, tuple[Run, int]] = {
    "openmm:verlet": (openmm_verlet, 50_000),
    "ase:velocity-verlet": (ase_verlet, 50),
    "own:euler": (compiled(_euler), 1_500_000),
    "own:semi-implicit-euler": (compiled(_semi_implicit_euler), 1_000_000),
    "own:implicit-euler": (compiled(_implicit_euler), 1_000_000),
}


def main() -> int:
    """Measure in turn, print a line for each method, compare."""
    repeats = arguments(__doc__, repeats=300).repeats
    scene = scenes.load_scene("spring-uneven")
    best: dict[str, list[float]] = {name: [np.inf, np.inf] for name in BARE}
    for _ in range(repeats):
        for name, (loop, steps) in BARE.items():
            h = scene.step * scene.steps / steps
            here = replace(scene, step=h, steps=steps, every=steps)
            found = bare.measure(here, engines.parse(name)).timing.run
            by_hand = loop(steps, h)
            best[name] = [min(best[name][0], by_hand / steps), min(best[name][1], found / steps)]
    print(f"{'':28}{'bare loop':>12}{'springcheck':>14}{'ratio':>8}")
    worst = 0.0
    for name, (by_hand, found) in best.items():
        worst = max(worst, abs(found / by_hand - 1))
        print(f"{name:28}{by_hand * 1e9:9.4g} ns{found * 1e9:11.4g} ns{found / by_hand:8.3f}")
    return 0 if worst <= WITHIN else 1


if __name__ == "__main__":
    script(main)
