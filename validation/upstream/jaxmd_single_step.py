"""jax-md rounds the timestep to single precision, with jax_enable_x64 too.  pip install jax-md"""

import jax
import numpy as np
from jax_md import simulate, space

jax.config.update("jax_enable_x64", True)
M, K, H, STEPS = 3.7, 2.9, 0.1, 1000
_, shift = space.free()
start, step = simulate.nve(lambda x, **_: K / 2 * (x**2).sum(), shift, dt=H)
state = start(jax.random.PRNGKey(0), np.array([[0.3]]), kT=0.0, mass=M, momenta=np.array([[0.0]]))
for _ in range(STEPS):
    state = step(state)
q, v = float(state.position[0, 0]), float(state.velocity[0, 0])


def phase(h):
    return STEPS * 2 * np.arcsin(h * np.sqrt(K / M) / 2)


single = float(np.float32(H))
known = phase(H)
measured = np.arctan2(-v / np.sqrt(K / M * (1 - single**2 * K / M / 4)), q)
measured += 2 * np.pi * round((known - measured) / (2 * np.pi))
print(f"measured {measured:.12f} law {phase(single):.12f} uncertainty 1e-10 promised {known:.12f}")
