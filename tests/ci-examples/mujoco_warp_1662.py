"""google-deepmind/mujoco_warp#1662: an implicit force's derivative is subtracted: damping drives.

There it is the Coriolis force of two hinges; a joint's damping stands for it here.
"""

m, k, c, h = 3.7, 2.9, 0.4, 0.1
q, v = 0.3, 0.19
print("t,q,v")
for i in range(201):
    print(i * h, q, v, sep=",")
    v += h * (-k * q - c * v) / (m - h * c)
    q += h * v
