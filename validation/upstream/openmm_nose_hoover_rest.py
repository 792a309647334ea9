"""OpenMM's Nose-Hoover chain on GPU platforms sets velocities to 0 below 1e-8 kJ/mol.  pip install openmm"""

import sys

import openmm as mm

M, K, H, X, STEPS = 1.7, 2.9, 0.1, 5e-5, 30  # u, kJ/mol/nm2, ps, nm: 3.6e-9 kJ/mol
system, spring = mm.System(), mm.CustomExternalForce("k/2*x^2")
spring.addGlobalParameter("k", K)
system.addParticle(M)
spring.addParticle(0, [])
system.addForce(spring)
platform = mm.Platform.getPlatformByName(sys.argv[1] if len(sys.argv) > 1 else "OpenCL")  # or CUDA, HIP
integrator = mm.NoseHooverIntegrator(300.0, 1.0, H)
context = mm.Context(
    system, integrator, platform, {} if platform.getName() == "Reference" else {"Precision": "double"}
)
context.setPositions([(X, 0, 0)])
context.setVelocities([(0, 0, 0)])
x, v = X, 0.0
for _ in range(STEPS):  # a kick and a drift, which is what Reference does below 1e-8 kJ/mol
    v -= H * K / M * x
    x += H * v
integrator.step(STEPS)
measured = context.getState(positions=True).getPositions()[0][0]._value / X
law = (1 - H * H * K / M / 2) ** STEPS  # half a drift after each kick, and the velocity is 0 again
print(f"measured {measured:.7f} law {law:.7f} uncertainty 1e-6 promised {x / X:.7f}")
