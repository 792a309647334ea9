"""OpenMM keeps the lengths of a SETTLE triangle in single precision on Reference too.  pip install openmm"""

import numpy as np
import openmm as mm

LEG, BASE = 0.09572, 0.15139  # nm: a water
system = mm.System()
for m in (15.99943, 1.007947, 1.007947):
    system.addParticle(m)
for a, b, length in ((0, 1, LEG), (0, 2, LEG), (1, 2, BASE)):
    system.addConstraint(a, b, length)
platform = mm.Platform.getPlatformByName("Reference")  # which computes in double precision
context = mm.Context(system, mm.VerletIntegrator(0.001), platform)
down = np.sqrt(LEG**2 - BASE**2 / 4)
context.setPositions([(0, 0, 0), (BASE / 2, -down, 0), (-BASE / 2, -down, 0)])
context.applyConstraints(1e-14)
x = np.array(context.getState(positions=True).getPositions()._value)
measured, law = np.linalg.norm(x[1] - x[0]) / LEG, float(np.float32(LEG)) / LEG
print(f"measured {measured:.16f} law {law:.16f} uncertainty 1e-15 promised 1")
