"""OpenMM's VariableVerletIntegrator loses velocities in stepTo's shortest steps.  pip install openmm numpy"""

import numpy as np
import openmm as mm

M, K, X, TOLERANCE, EVERY, FRAMES = 3.7, 2.9, 0.9, 1e-3, 0.05, 119  # u, kJ/mol/nm2, nm, a length, ps
system, spring = mm.System(), mm.CustomExternalForce("k/2*x^2")
spring.addGlobalParameter("k", K)
system.addParticle(M)
spring.addParticle(0, [])
system.addForce(spring)
context = mm.Context(
    system, mm.VariableVerletIntegrator(TOLERANCE), mm.Platform.getPlatformByName("Reference")
)
context.setPositions([(X, 0, 0)])
h, t, x, v = 0.0, 0.0, X, 0.0
for end in (frame * EVERY for frame in range(1, FRAMES + 1)):
    context.getIntegrator().stepTo(end)
    while t < end:  # the law, as in ReferenceVariableVerletDynamics::update
        new = np.sqrt(TOLERANCE / np.sqrt((K * x / M) ** 2 / 3))
        new = min(new, 2 * h) if h else new
        new = h if h < new < float(np.float32(1.2)) * h else new
        new, t = (end - t, end) if new >= end - t else (new, t + new)
        moved = x + new * (v - 1 / M * K * x * 0.5 * (h + new))
        v, h, x = (moved - x) / new, new, moved  # what is left of v where new is 1e-16
state = context.getState(positions=True, velocities=True)
x_of, v_of = (z()[0][0]._value for z in (state.getPositions, state.getVelocities))
law, measured = ((a * a + M / K * b * b) / X**2 for a, b in ((x, v), (x_of, v_of)))
print(f"measured {measured:.9f} law {law:.9f} uncertainty 1e-6 promised 1")
