"""OpenMM's AndersenThermostat on GPU platforms collides 2/pi as often as asked.  pip install openmm"""

import sys
from math import erf, exp, sqrt

import numpy as np
import openmm as mm

N, STEPS, H, RATE = 100_000, 250, 0.002, 1.0  # ps, collisions a ps: the settings of the user guide
system = mm.System()
for _ in range(N):
    system.addParticle(12.0)
thermostat = mm.AndersenThermostat(300.0, RATE)
thermostat.setRandomNumberSeed(1)
system.addForce(thermostat)
platform = mm.Platform.getPlatformByName(sys.argv[1] if len(sys.argv) > 1 else "OpenCL")  # or CUDA, HIP
integrator = mm.VerletIntegrator(H)
context = mm.Context(system, integrator, platform)
context.setPositions(np.zeros((N, 3)))
context.setVelocities(np.ones((N, 3)))
before, hits = 1.0, 0
for _ in range(STEPS):
    integrator.step(1)  # without forces nothing but a collision changes a velocity
    v = context.getState(velocities=True).getVelocities(asNumpy=True)._value[:, 0]
    hits, before = hits + np.count_nonzero(np.abs(v - before) > 1e-4), v.copy()
p = 1 - exp(-RATE * H)
law = erf(erf(p / sqrt(2)) / sqrt(2))  # |w| < erf(p/sqrt(2)) of a normal w, where erf^-1 would give p
unit = N * STEPS * H
print(
    f"measured {hits / unit:.4f} law {law / H:.4f} uncertainty {sqrt(hits) / unit:.4f} promised {p / H:.4f}"
)
