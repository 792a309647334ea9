"""libRoadRunner's `rk45` takes one step to each output interval.  pip install libroadrunner"""

import numpy as np
import roadrunner

M, K, N, EPSILON = 2.3, 5.9, 20, 1e-12  # a spring, 20 outputs to t = 1, and the integrator's own tolerance
ns = 'xmlns="http://www.sbml.org/sbml/level3/version1/core" level="3" version="1"'
math = '<math xmlns="http://www.w3.org/1998/Math/MathML">'
model = f"""<sbml {ns}><model><listOfParameters>
    <parameter id="x" value="0.4" constant="false"/><parameter id="v" value="-0.3" constant="false"/>
    </listOfParameters><listOfRules><rateRule variable="x">{math}<ci>v</ci></math></rateRule>
    <rateRule variable="v">{math}<apply><times/><cn>{-K / M!r}</cn><ci>x</ci></apply></math></rateRule>
    </listOfRules></model></sbml>"""
engine = roadrunner.RoadRunner(model)
engine.setIntegrator("rk45")
measured = engine.simulate(0, 1, N + 1, ["x"])[-1, 0]

A = np.array([[0, 1], [-K / M, 0]])
rows = [[], [1 / 4], [3 / 32, 9 / 32], [1932 / 2197, -7200 / 2197, 7296 / 2197]]  # Fehlberg's method
rows += [[439 / 216, -8, 3680 / 513, -845 / 4104], [-8 / 27, 2, -3544 / 2565, 1859 / 4104, -11 / 40]]
y, h, done = np.array([0.4, -0.3]), 0.5, 0
while done < N:  # what it does: one accepted step, and the next output is due
    k = np.zeros((6, 2))
    for i, row in enumerate(rows):
        k[i] = A @ (y + h * np.dot(row, k[:i]) if i else y)
    error = np.linalg.norm(np.dot([1 / 360, 0, -128 / 4275, -2197 / 75240, 1 / 50, 2 / 55], k))
    if error <= EPSILON:
        y, done = y + h * np.dot([25 / 216, 0, 1408 / 2565, 2197 / 4104, -1 / 5, 0], k), done + 1
    h *= np.clip(0.84 * (EPSILON / error) ** 0.25, 0.1, 4)
w = np.sqrt(K / M)
promised = 0.4 * np.cos(w) - 0.3 / w * np.sin(w)
print(f"measured {measured:.6f} law {y[0]:.6f} uncertainty 1e-5 promised {promised:.6f}")
