"""OpenMM's SHAKE keeps inverse masses in single precision where all else is double.  pip install openmm"""

import numpy as np
import openmm as mm

M, LENGTH, P, STEPS = (3.7, 1.3), 0.3, 4.0, 200  # amu, nm, momentum of each in amu nm/ps
system, integrator = mm.System(), mm.VerletIntegrator(0.01)
for m in M:
    system.addParticle(m)
system.addConstraint(0, 1, LENGTH)
integrator.setConstraintTolerance(1e-13)
platform = mm.Platform.getPlatformByName("OpenCL")  # CUDA and HIP share the code
context = mm.Context(system, integrator, platform, {"Precision": "double"})
context.setPositions([(0, 0, 0), (LENGTH, 0, 0)])
context.setVelocities([(0, -P / M[0], 0), (0, P / M[1], 0)])  # they turn about their centre, which is at rest
p = np.empty((STEPS, 2, 3))
for i in range(STEPS):
    integrator.step(1)
    p[i] = np.reshape(M, (2, 1)) * context.getState(velocities=True).getVelocities(asNumpy=True)._value
# an impulse g along the rod is taken for m float(1/m) g of each momentum
off = [m * float(np.float32(1 / m)) - 1 for m in M]
law = np.abs((off[0] - off[1]) * (p[:, 0] - [0, -P, 0])).max() / P
measured = np.abs(p.sum(1)).max() / P
print(f"measured {measured:.8e} law {law:.8e} uncertainty 1e-13 promised 0")
