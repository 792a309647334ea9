"""What springcheck adds to an engine that is read at every step, and to a whole command.

Claims, as ratios side by side in one run (the smaller the better):
    OpenMM read at every step: at most 8 us a frame, where the obvious loop with
        getPositions(asNumpy=True) and getVelocities(asNumpy=True) takes about 16
    ASE and SUNDIALS read at every step: at most 1.05 times a hand-written loop over the same engine
    `springcheck --help` and `list`: at most 0.3 s, and no engine is imported
    `springcheck run spring`: at most 1.5 times what importing its engines and running them bare takes

Command: python validation/reading_cost.py [REPEATS]      (default 15)

Times are processor time, so that what else runs says little; the minimum of the repeats is quoted and the
spread beside it; the repeats of the two sides take turns.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from time import process_time
from typing import Any

import numpy as np
import openmm as mm
from ase import Atoms
from ase.md.verlet import VelocityVerlet
from sksundae.cvode import CVODE

from arguments import arguments, script
from springcheck import engines, load_scene
from springcheck.engines.ase.simulation import Springs
from springcheck.engines.sundials.simulation import MOST_STEPS, absolute_tolerance
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene

FRAMES = 2000

BARE = """
import numpy, h5py, openmm, ase.md.verlet, sksundae.cvode
from springcheck import engines, load_scene
from springcheck.studies.precision import bare
scene = load_scene("spring")
for label in engines.match(("*",)):
    if engines.refusal(scene, label) is None:
        bare.measure(scene, label)
"""


def ours(scene: Scene, name: str) -> Callable[[], float]:
    """Seconds that springcheck's simulation takes for all frames."""
    label = engines.parse(name)
    driver = engines.load(label.engine)

    def once() -> float:
        simulation = driver.start(scene, engines.method(label), label, scene.step)
        q = np.empty((scene.steps, scene.n))
        p = np.empty_like(q)
        began = process_time()
        simulation.advance(1, q, p)
        return process_time() - began

    return once


def openmm_loop(scene: Scene) -> Callable[[], float]:
    """The obvious loop: public accessors, which wrap units."""

    def once() -> float:
        system = mm.System()
        system.addParticle(float(scene.m[0]))
        system.addParticle(0.0)
        bond = mm.HarmonicBondForce()
        bond.addBond(0, 1, 0.0, 2.9)
        system.addForce(bond)
        integrator = mm.VerletIntegrator(scene.step)
        context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
        context.setPositions([mm.Vec3(float(scene.q[0]), 0, 0), mm.Vec3(0, 0, 0)])
        context.setVelocities([mm.Vec3(float(scene.p[0] / scene.m[0]), 0, 0), mm.Vec3(0, 0, 0)])
        q, v = np.empty(scene.steps), np.empty(scene.steps)
        began = process_time()
        for row in range(scene.steps):
            integrator.step(1)
            state = context.getState(getPositions=True, getVelocities=True)
            q[row] = state.getPositions(asNumpy=True)._value[0, 0]
            v[row] = state.getVelocities(asNumpy=True)._value[0, 0]
        return process_time() - began

    return once


def ase_loop(scene: Scene) -> Callable[[], float]:
    """ASE's dynamics one step at a time, positions and momenta copied out."""

    def once() -> float:
        atoms = Atoms("X", positions=[[scene.q[0], 0, 0]], masses=scene.m, momenta=[[scene.p[0], 0, 0]])
        atoms.calc = Springs(scene.system, 1.0, 1.0)
        dynamics = VelocityVerlet(atoms, timestep=scene.step)
        q, p = np.empty(scene.steps), np.empty(scene.steps)
        began = process_time()
        for row in range(scene.steps):
            dynamics.run(1)
            q[row] = atoms.get_positions()[0, 0]
            p[row] = atoms.get_momenta()[0, 0]
        return process_time() - began

    return once


def sundials_loop(scene: Scene) -> Callable[[], float]:
    """CVODE from output to output, with a right-hand side written for one spring in plain NumPy."""
    m, k = float(scene.m[0]), 2.9

    def derivative(t: float, y: Floats, yp: Floats) -> None:
        yp[0] = y[1] / m
        yp[1] = -k * y[0]

    def jacobian(t: float, y: Floats, yp: Floats, out: Floats) -> None:
        out[0, 1] = 1 / m
        out[1, 0] = -k

    def once() -> float:
        solver = CVODE(
            derivative, method="Adams", rtol=scene.tolerance, atol=absolute_tolerance(scene), jacfn=jacobian,
            max_num_steps=MOST_STEPS,
        )  # fmt: skip
        solver.init_step(0.0, np.array([scene.q[0], scene.p[0]]))
        q, p = np.empty(scene.steps), np.empty(scene.steps)
        began = process_time()
        for row in range(scene.steps):
            y: Any = solver.step((row + 1) * scene.step).y
            q[row], p[row] = y
        return process_time() - began

    return once


def command(*arguments: str) -> Callable[[], float]:
    """Processor time of a whole program, in seconds."""

    def once() -> float:
        with tempfile.TemporaryDirectory() as folder:
            began = os.times()
            subprocess.run([sys.executable, *arguments], check=True, capture_output=True, cwd=folder)
            now = os.times()
            return now.children_user + now.children_system - began.children_user - began.children_system

    return once


def in_turn(repeats: int, *sides: Callable[[], float]) -> list[Floats]:
    """Repeats of each side, taken in turn after one warm-up."""
    for side in sides:
        side()
    rows = np.array([[side() for side in sides] for _ in range(repeats)])
    return list(rows.T)


def main() -> int:
    """Measure and print; the exit status says whether the claims hold."""
    repeats = arguments(__doc__, repeats=15).repeats
    scene = replace(load_scene("spring-uneven"), steps=FRAMES)
    good = True

    mine, theirs = in_turn(repeats, ours(scene, "openmm:verlet"), openmm_loop(scene))
    a, b = (np.min(side) / FRAMES * 1e6 for side in (mine, theirs))
    print(f"OpenMM read at every step: {a:.1f} us a frame (claim 8), the obvious loop {b:.1f} us")
    good &= bool(a <= 8)

    for name, loop in (("ase:velocity-verlet", ase_loop(scene)), ("sundials:adams", sundials_loop(scene))):
        mine, theirs = in_turn(repeats, ours(scene, name), loop)
        ratio = np.min(mine) / np.min(theirs)
        spread = np.percentile(mine / theirs, (25, 75))
        print(f"{name} read at every step: {ratio:.3f} of a hand-written loop (claim 1.05); "
              f"quartiles {spread[0]:.3f} {spread[1]:.3f}")  # fmt: skip
        good &= bool(ratio <= 1.05)

    for words in (["--help"], ["list"]):
        (seconds,) = in_turn(repeats, command("-m", "springcheck", *words))
        print(f"springcheck {words[0]}: {np.min(seconds):.2f} s (claim 0.3)")
        good &= bool(np.min(seconds) <= 0.3)

    whole, bare = in_turn(repeats, command("-m", "springcheck", "run", "spring"), command("-c", BARE))
    ratio = np.min(whole) / np.min(bare)
    print(f"springcheck run spring: {np.min(whole):.2f} s, {ratio:.2f} of imports and bare runs (claim 1.5)")
    good &= bool(ratio <= 1.5)
    return 0 if good else 1


if __name__ == "__main__":
    script(main)
