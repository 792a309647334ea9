"""tmd-industries/tmd#171: SHAKE pushes the ends along the rod as it lies after the drift, not before it."""

m, length, h = (1.3, 3.7), 0.6, 0.1
x, v = [[0.35, -0.2], [0.83, -0.56]], [[-0.1996, -0.6328], [0.3404, 0.0872]]
print("t,q0,q1,q2,q3,v0,v1,v2,v3")
for i in range(201):
    print(i * h, *x[0], *x[1], *v[0], *v[1], sep=",")
    x = [[a + h * b for a, b in zip(x[j], v[j])] for j in (0, 1)]
    r = [b - a for a, b in zip(*x)]  # before the drift it belongs, and is measured after it here
    part = (length / sum(a * a for a in r) ** 0.5 - 1) / (1 / m[0] + 1 / m[1])
    push = [[-part * a / m[0] for a in r], [part * a / m[1] for a in r]]
    x = [[a + b for a, b in zip(x[j], push[j])] for j in (0, 1)]
    v = [[a + b / h for a, b in zip(v[j], push[j])] for j in (0, 1)]
    # velocities along the rod are taken off, as RATTLE does
    r = [b - a for a, b in zip(*x)]
    along = sum(a * (c - b) for a, b, c in zip(r, *v)) / length**2 / (1 / m[0] + 1 / m[1])
    v = [[a + along * b / m[0] for a, b in zip(v[0], r)], [a - along * b / m[1] for a, b in zip(v[1], r)]]
