"""Cascella-Group-UiO/HyMD#53: the second kick takes the force of the step before."""

m, k, h = 3.7, 2.9, 0.1
q, v = 0.3, 0.19
print("t,q,v")
for i in range(201):
    print(i * h, q, v, sep=",")
    force = -k * q
    v += h / 2 * force / m
    q += h * v
    v += h / 2 * force / m
