"""Kinetic energy that OpenMM reports of rigid rods in a heat bath is too large.  pip install openmm numpy"""

import numpy as np
import openmm as mm

N, FRAMES, H, RATE, T, LENGTH = 500, 4000, 0.002, 10.0, 300.0, 0.1  # OH at 2 fs, 10/ps, 300 K
M = np.array([15.999, 1.008])
reduced, thermal = M.prod() / M.sum(), 1.380649e-26 * 6.02214076e23 * T
system, e = mm.System(), np.random.default_rng(1).normal(size=(N, 3))
for i in range(2 * N):
    system.addParticle(M[i % 2])
    if i % 2:
        system.addConstraint(i - 1, i, LENGTH)
integrator = mm.LangevinMiddleIntegrator(T, RATE, H)
integrator.setConstraintTolerance(1e-10)
integrator.setRandomNumberSeed(1)
context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
ends = np.array([np.zeros((N, 3)), LENGTH * e / np.linalg.norm(e, axis=1)[:, None]])
context.setPositions(ends.transpose(1, 0, 2).reshape(-1, 3))
context.setVelocitiesToTemperature(T, 1)
integrator.step(200)
excess = []
for _ in range(FRAMES):
    integrator.step(1)
    reported = context.getState(energy=True).getKineticEnergy()._value
    context.applyVelocityConstraints(1e-10)  # the next step does it anyway
    excess.append((reported - context.getState(energy=True).getKineticEnergy()._value) / (2.5 * N * thermal))
c, a = np.exp(-RATE * H), H**2 * thermal / (reduced * LENGTH**2)
law = 1 + (1 - c * c + 2 * a * (1 + c) ** 2 + a * (1 - c * c) * (1 - c)) / 20
error = np.std(np.reshape(excess, (20, -1)).mean(axis=1)) / np.sqrt(20)  # of pieces of 0.4 ps
print(f"measured {1 + np.mean(excess):.6f} law {law:.6f} uncertainty {error:.1e} promised 1")
