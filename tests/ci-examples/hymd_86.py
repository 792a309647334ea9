"""Cascella-Group-UiO/HyMD#86: the coupling of the CSVR thermostat does not reach its random part.

As the thread describes it: tau changes how fast the kinetic energy relaxes, and hardly what it fluctuates by.
"""

import random
from math import exp, sqrt

m, k, kT, h, tau = (15.999, 3.7), (2300.0, 900.0), 2.4943, 0.005, 0.4
random.seed(86)
q, v = [0.01, -0.02], [0.3, 0.5]
print("t,q0,q1,v0,v1")
for i in range(2001):
    print(i * h, *q, *v, sep=",")
    K, n = sum(a * b * b for a, b in zip(m, v)) / 2, 2
    c, c1 = exp(-h / tau), exp(-h)  # the second is for want of tau
    draws = [random.gauss(0, 1) for _ in range(n)]
    b = (1 - c1) * kT / (2 * K)
    alpha = sqrt(c + b * sum(x * x for x in draws) + 2 * draws[0] * sqrt(c * b))
    v = [alpha * x if draws[0] + sqrt(c / b) > 0 else -alpha * x for x in v]
    v = [b - h / 2 * c / a * d for a, b, c, d in zip(m, v, k, q)]
    q = [a + h * b for a, b in zip(q, v)]
    v = [b - h / 2 * c / a * d for a, b, c, d in zip(m, v, k, q)]
