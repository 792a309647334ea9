"""Temperature: five functions to fill in, and a step to mend.

    python grade.py temperature.py              # which are right
    python grade.py temperature.py --hint       # and where to look

The spring has mass m, stiffness k and frequency w = sqrt(k/m); a bath of thermal energy kT acts on it at the
friction rate gamma.  A step of size h is made of three exact moves: B kicks (p += h F), A drifts
(q += h p/m) and O is friction with noise, p = c p + s xi: c is what friction leaves in the time of the
move, xi is a draw of mean 0 and variance 1, and s is such that a variance of p of m kT stays what it is.
A letter that stands twice in a name is done for half a step each time.
"""

import math


def baoab(q, p, h, force, mass, gamma, kT, xi):
    """One step of BAOAB, (q, p), for one draw xi."""


def kinetic(h, w, T):
    """Two temperatures, each the mean of m v**2/k_B over a long run of BAOAB in a bath at T.

    The first by the velocities as BAOAB stores them, the second by those between its two drifts (BAOA stores
    these, half a step away from the positions; so does OpenMM).
    """


def configurational(h, w):
    """k <q**2>/kT of OBABO: the temperature that positions show, over that of the bath."""


def stationary(A, G):
    """The covariance S that a step z -> A z + G xi keeps; A is (n, n), G (n, draws), xi of variance 1."""


def error(n, r):
    """The relative standard error of <q**2>, measured over n states (many) of a normal q.

    Each state has correlation r with the next and r**j with the one j later.
    """


def obabo(q, p, h, force, mass, gamma, kT, xi):
    """One step of OBABO, for a pair of draws xi.  It runs, and both of its temperatures are wrong: why?"""
    c = math.exp(-gamma * h)
    s = math.sqrt(kT * (1 - c * c))
    p = c * p + s * xi[0]
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    p = p + h / 2 * force(q)
    return q, c * p + s * xi[1]
