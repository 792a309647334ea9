"""OpenMM's VariableVerletIntegrator gains 0.4 % of its energy a period.  pip install openmm"""

import numpy as np
import openmm as mm

M, K, X, V, TOLERANCE, PERIODS = 3.7, 2.9, 0.3, 0.19, 1e-3, 20  # u, kJ/mol/nm2, nm, nm/ps
system, spring = mm.System(), mm.CustomExternalForce("k/2*x^2")
spring.addGlobalParameter("k", K)
system.addParticle(M)
spring.addParticle(0, [])
system.addForce(spring)
platform = mm.Platform.getPlatformByName("Reference")
context = mm.Context(system, mm.VariableVerletIntegrator(TOLERANCE), platform)
context.setPositions([(X, 0, 0)])
context.setVelocities([(V, 0, 0)])
h, x, v = 0.0, X, V
while context.getTime()._value < PERIODS * 2 * np.pi * np.sqrt(M / K):
    context.getIntegrator().step(1)
    # the law, as in ReferenceVariableVerletDynamics::update: the error is a mean over x, y and z
    new = np.sqrt(TOLERANCE / np.sqrt((K / M * x) ** 2 / 3))
    new = min(new, 2 * h) if h else new
    new = h if h < new < 1.2 * h else new
    v, h = v - K / M * x * (h + new) / 2, new
    x += h * v
state = context.getState(positions=True, velocities=True)
x_of, v_of = (z()[0][0]._value for z in (state.getPositions, state.getVelocities))
energy = K * X * X + M * V * V
law = ((K * x * x + M * (v - K / M * x * h / 2) ** 2) / energy) ** (1 / PERIODS)
measured = ((K * x_of * x_of + M * (v_of - K / M * x_of * h / 2) ** 2) / energy) ** (1 / PERIODS)
print(f"measured {measured:.9f} law {law:.9f} uncertainty 1e-7 promised 1")
