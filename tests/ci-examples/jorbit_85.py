"""ben-cassese/jorbit#85: abs(dt), so that a run backwards in time goes forwards."""

m, k, h = 3.7, 2.9, -0.1
q, v = 0.3, 0.19
print("t,q,v")
for i in range(201):
    print(i * h, q, v, sep=",")
    dt = abs(h)
    v -= dt / 2 * k / m * q
    q += dt * v
    v -= dt / 2 * k / m * q
