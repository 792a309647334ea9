"""OpenMM's CustomIntegrator on OpenCL and CUDA takes forces 2.3e-10 too large.  pip install openmm"""

import openmm as mm

M, K, H, X = 1.0, 16.0, 1.0, 0.25  # a force of -4 and all numbers powers of two: nothing is rounded
system, spring = mm.System(), mm.CustomExternalForce("k/2*x^2")
spring.addGlobalParameter("k", K)
system.addParticle(M)
spring.addParticle(0, [])
system.addForce(spring)
integrator = mm.CustomIntegrator(H)
integrator.addComputePerDof("v", "v+dt*f/m")
platform = mm.Platform.getPlatformByName("OpenCL")
context = mm.Context(system, integrator, platform, {"Precision": "double"})
context.setPositions([(X, 0, 0)])
context.setVelocities([(0, 0, 0)])
integrator.step(1)
measured = context.getState(velocities=True).getVelocities()[0][0]._value / (-H * K / M * X)
print(f"measured {measured:.16f} law {2**32 / (2**32 - 1):.16f} uncertainty 4e-16 promised 1")
