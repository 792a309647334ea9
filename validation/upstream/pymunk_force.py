"""pymunk moves positions first: a spring by Body.force is explicit Euler.  pip install pymunk"""

import pymunk

M, K, H, STEPS = 3.7, 29.0, 1 / 60, 600  # ten seconds
space, body = pymunk.Space(), pymunk.Body(M, 1.0)
space.add(body)
body.position = (0.3, 0.0)
for _ in range(STEPS):
    body.force = (-K * body.position.x, 0.0)
    space.step(H)
q, v = body.position.x, body.velocity.x
law, measured = (1 + H * H * K / M) ** STEPS, (K * q * q + M * v * v) / (K * 0.3**2)
print(f"measured {measured:.15f} law {law:.15f} uncertainty 1e-11 promised 1")
