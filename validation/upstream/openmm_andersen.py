"""OpenMM's AndersenThermostat draws the half-step velocities of VerletIntegrator.  pip install openmm"""

import numpy as np
import openmm as mm

N, T, H, RATE = 6000, 300.0, 0.002, 1.0  # kelvin, ps, collisions a ps: the settings of the user guide
M, K = 6.860, 476_976.0  # u, kJ/mol/nm2: the carbonyl bond of Amber's protein force fields
KT = 0.00831446261815324 * T
system, springs = mm.System(), mm.CustomExternalForce("k/2*(x^2+y^2+z^2)")
springs.addGlobalParameter("k", K)
for i in range(N):
    system.addParticle(M)
    springs.addParticle(i, [])
thermostat = mm.AndersenThermostat(T, RATE)
thermostat.setRandomNumberSeed(1)
system.addForce(springs)
system.addForce(thermostat)
integrator = mm.VerletIntegrator(H)
context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
rng = np.random.default_rng(1)
context.setPositions(rng.normal(size=(N, 3)) * np.sqrt(KT / K))
context.setVelocities(rng.normal(size=(N, 3)) * np.sqrt(KT / M))
integrator.step(8000)  # p = 0.002: what is left of the start is exp(-8) of the difference
squares = np.zeros((N, 3))
for _ in range(400):
    integrator.step(11)
    squares += context.getState(positions=True).getPositions(asNumpy=True)._value ** 2 * K / KT / 400
a, p = H * H * K / M, 1 - np.exp(-RATE * H)
law, error = (1 - p / 2) / (1 - a / 2), squares.std() / np.sqrt(3 * N)
print(f"measured {squares.mean():.6f} law {law:.6f} uncertainty {error:.6f} promised {1 / (1 - a / 4):.6f}")
