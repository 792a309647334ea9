"""openai/gym#907: positions move by the old velocities."""

m, k, h = 3.7, 2.9, 0.1
q, v = 0.3, 0.19
print("t,q,v")
for i in range(201):
    print(i * h, q, v, sep=",")
    q, v = q + h * v, v - h * k / m * q
