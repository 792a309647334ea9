"""espressomd/espresso#3343: two degrees of freedom of a Langevin thermostat take the same random numbers.

Uniform numbers, and the friction of the half-step velocity, as that engine's Langevin thermostat has them.
"""

import random
from math import sqrt

m, k, gamma, kT, h = (2.3, 3.7), (2.9, 5.3), 0.8, 1.7, 0.1
random.seed(3343)
q, v, f = [0.3, -0.4], [0.19, 0.5], [0.0, 0.0]
print("t,q0,q1,v0,v1")
for i in range(2001):
    print(i * h, *q, *v, sep=",")
    v = [b + h / 2 * c / a for a, b, c in zip(m, v, f)]
    q = [a + h * b for a, b in zip(q, v)]
    noise = random.random() - 0.5  # one for both
    f = [-c * d - gamma * a * b + sqrt(24 * kT * gamma * a / h) * noise for a, b, c, d in zip(m, v, k, q)]
    v = [b + h / 2 * c / a for a, b, c in zip(m, v, f)]
