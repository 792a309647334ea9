"""PyBullet slows every body by a drag that nobody set.  pip install pybullet"""

import numpy as np
import pybullet

M, V, STEPS = 3.7, 1.9, 2400  # kg, m/s; the step is PyBullet's own, 1/240 s, so ten seconds
pybullet.connect(pybullet.DIRECT)
body = pybullet.createMultiBody(baseMass=M)
pybullet.resetBaseVelocity(body, [V, 0, 0])
law = V
for _ in range(STEPS):
    pybullet.stepSimulation()
    law -= float(np.float32(0.04)) * (1 + abs(law)) * law / 240
print(f"measured {pybullet.getBaseVelocity(body)[0][0]:.15f} law {law:.15f} uncertainty 1e-13 promised {V}")
