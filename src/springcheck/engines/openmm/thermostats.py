"""OpenMM's integrators with a heat bath."""

from __future__ import annotations

from typing import Any

import openmm as mm

from springcheck.physics.scene import Scene

BOLTZMANN = 1.380649e-23 * 6.02214076e23 / 1000
"""kT of a kelvin [kJ/mol] as OpenMM has it."""


def thermostat(scene: Scene, name: str, step: float, seed: int, system: mm.System) -> mm.Integrator:
    """An integrator with noise of this seed, at the thermal energy of the scene."""
    assert scene.bath is not None
    temperature, rate = scene.thermal / BOLTZMANN, scene.bath.friction
    if name == "andersen":
        made: Any = mm.VerletIntegrator(step)
        noise: Any = mm.AndersenThermostat(temperature, rate)
        system.addForce(noise)
    elif name == "brownian":
        noise = made = mm.BrownianIntegrator(temperature, rate, step)
    elif name == "mts-langevin":
        noise = made = mm.MTSLangevinIntegrator(temperature, rate, step, [(0, 1)])
        for force in system.getForces():
            force.setForceGroup(0)
    else:
        kind = mm.LangevinIntegrator if name == "langevin-bath" else mm.LangevinMiddleIntegrator
        noise = made = kind(temperature, rate, step)
    if name.startswith("mts"):
        made.setGlobalVariableByName("kT", scene.thermal)
    noise.setRandomNumberSeed(seed)
    return made
