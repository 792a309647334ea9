"""The functions of temperature.py, as they are meant; what is behind each stands beside it."""

import math

import numpy as np


def baoab(q, p, h, force, mass, gamma, kT, xi):
    """O keeps m kT: c**2 m kT + s**2 = m kT, so s = sqrt(m kT (1 - c**2)) with c = exp(-gamma h)."""
    c = math.exp(-gamma * h)
    p = p + h / 2 * force(q)
    q = q + h / 2 * p / mass
    p = c * p + math.sqrt(mass * kT * (1 - c * c)) * xi
    q = q + h / 2 * p / mass
    return q, p + h / 2 * force(q)


def kinetic(h, w, T):
    """T (1 - (h w)**2/4) on site and T half a step away: cold velocities are no fault of the thermostat."""
    return T * (1 - (h * w) ** 2 / 4), T


def configurational(h, w):
    """1/(1 - (h w)**2/4): too hot, where OBABO's velocities are right; BAOAB is the other way round."""
    return 1 / (1 - (h * w) ** 2 / 4)


def stationary(A, G):
    """S = A S A' + G G' is linear in S: (1 - A x A) S = G G', with the Kronecker product x."""
    A, G = np.asarray(A), np.asarray(G)
    n = len(A)
    return np.linalg.solve(np.eye(n * n) - np.kron(A, A), (G @ G.T).ravel()).reshape(n, n)


def error(n, r):
    """sqrt(2/N), N = n (1 - r**2)/(1 + r**2): squares of normal numbers are correlated by r**2, r**4, ..."""
    return math.sqrt(2 / n * (1 + r * r) / (1 - r * r))


def obabo(q, p, h, force, mass, gamma, kT, xi):
    """Each O lasts half a step, c = exp(-gamma h/2), and the noise lacked sqrt(m): a mass of 1 hides that."""
    c = math.exp(-gamma * h / 2)
    s = math.sqrt(mass * kT * (1 - c * c))
    p = c * p + s * xi[0]
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    p = p + h / 2 * force(q)
    return q, c * p + s * xi[1]
