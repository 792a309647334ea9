"""OpenMM's SETTLE takes two unlike masses at the base of a triangle for alike.  pip install openmm"""

import numpy as np
import openmm as mm

LEG, BASE = 5 / 64, 6 / 64  # nm, the same in single precision; a semi-heavy water, HDO
MASSES = np.array([15.999, 1.008, 2.014])
system = mm.System()
for m in MASSES:
    system.addParticle(m)
for a, b, length in ((0, 1, LEG), (0, 2, LEG), (1, 2, BASE)):
    system.addConstraint(a, b, length)
integrator = mm.VerletIntegrator(0.001)
context = mm.Context(system, integrator, mm.Platform.getPlatformByName("Reference"))
start = np.array([(0, 0, 0), (BASE / 2, -4 / 64, 0), (-BASE / 2, -4 / 64, 0)])
context.setPositions(start)  # at rest, and nothing acts
integrator.step(1)
x = np.array(context.getState(positions=True).getPositions()._value)
measured = np.linalg.norm(MASSES @ (x - start)) / MASSES.sum()
law = abs(MASSES[2] - MASSES[1]) * BASE / 2 / MASSES.sum()
print(f"measured {measured:.16f} law {law:.16f} uncertainty 1e-15 promised 0")
