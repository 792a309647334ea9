"""One step of many schemes in plain floats, which share nothing with the package: what `identify_made.py`
makes trajectories with."""
# ruff: noqa: D103

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from springcheck.physics.arrays import Floats

M, K, H = 3.7, 2.9, 0.1
State = tuple[float, float]
Step = Callable[[float, float, float, float], State]
"""q, v, h and k/m -> q, v."""
W2 = K / M


# schemes ------------------------------------------------------------------------------------------------


def kick_drift(q: float, v: float, h: float, w2: float) -> State:
    v = v - h * (w2 * q)
    return q + h * v, v


def drift_kick(q: float, v: float, h: float, w2: float) -> State:
    q = q + h * v
    return q, v - h * (w2 * q)


def explicit(q: float, v: float, h: float, w2: float) -> State:
    return q + h * v, v - h * (w2 * q)


def verlet(q: float, v: float, h: float, w2: float) -> State:
    v = v - h / 2 * (w2 * q)
    q = q + h * v
    return q, v - h / 2 * (w2 * q)


def position_verlet(q: float, v: float, h: float, w2: float) -> State:
    q = q + h / 2 * v
    v = v - h * (w2 * q)
    return q + h / 2 * v, v


def implicit(q: float, v: float, h: float, w2: float) -> State:
    v = (v - h * w2 * q) / (1 + h * h * w2)
    return q + h * v, v


def midpoint(q: float, v: float, h: float, w2: float) -> State:
    a = h * h * w2 / 4
    new = ((1 - a) * v - h * w2 * q) / (1 + a)
    return q + h / 2 * (v + new), new


def tableau(rows: list[list[float]], weights: list[float]) -> Step:
    """An explicit Runge-Kutta method."""

    def step(q: float, v: float, h: float, w2: float) -> State:
        slopes: list[State] = []
        for row in rows:
            x = q + h * sum(c * s[0] for c, s in zip(row, slopes, strict=True))
            u = v + h * sum(c * s[1] for c, s in zip(row, slopes, strict=True))
            slopes.append((u, -w2 * x))
        return (
            q + h * sum(c * s[0] for c, s in zip(weights, slopes, strict=True)),
            v + h * sum(c * s[1] for c, s in zip(weights, slopes, strict=True)),
        )

    return step


def collocation(rows: list[list[float]], weights: list[float]) -> Step:
    """An implicit Runge-Kutta method, its linear equations solved in extended precision."""

    def step(q: float, v: float, h: float, w2: float) -> State:
        n = len(weights)
        a, b = np.array(rows), np.array(weights)
        # q_i = q + h sum a v_j, v_i = v - h w2 sum a q_j
        both = np.eye(2 * n)
        both[:n, n:], both[n:, :n] = -h * a, h * w2 * a
        right = np.concatenate([np.full(n, q), np.full(n, v)])
        x = np.linalg.solve(both, right)
        x += np.linalg.solve(
            both, (right.astype(np.longdouble) - both @ x.astype(np.longdouble)).astype(float)
        )
        return float(q + h * (b @ x[n:])), float(v - h * w2 * (b @ x[:n]))

    return step


def splitting(*stages: tuple[str, float]) -> Step:
    def step(q: float, v: float, h: float, w2: float) -> State:
        for kind, c in stages:
            if kind == "kick":
                v = v - c * h * (w2 * q)
            else:
                q = q + c * h * v
        return q, v

    return step


def alternating(first: str, *shares: float) -> Step:
    """Kicks and drifts in turn."""
    kinds = (first, "drift" if first == "kick" else "kick")
    return splitting(*((kinds[i % 2], c) for i, c in enumerate(shares)))


RK4 = tableau([[], [0.5], [0, 0.5], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6])
HEUN = tableau([[], [1]], [0.5, 0.5])
X1 = 1 / (2 - 2 ** (1 / 3))
FOREST = alternating("drift", X1 / 2, X1, (1 - X1) / 2, 1 - 2 * X1, (1 - X1) / 2, X1, X1 / 2)
YOSHIDA = alternating("kick", X1 / 2, X1, (1 - X1) / 2, 1 - 2 * X1, (1 - X1) / 2, X1, X1 / 2)
RUTH = splitting(
    ("kick", 7 / 24), ("drift", 2 / 3), ("kick", 3 / 4), ("drift", -2 / 3), ("kick", -1 / 24), ("drift", 1)
)
KNOWN: dict[str, tuple[Step, tuple[str, ...]]] = {
    "semi-implicit Euler": (kick_drift, ("semi-implicit-euler",)),
    "drift-kick Euler": (drift_kick, ("semi-implicit-euler-drift-kick",)),
    "explicit Euler": (explicit, ("explicit-euler",)),
    "implicit Euler": (implicit, ("implicit-euler",)),
    "velocity Verlet": (verlet, ("velocity-verlet",)),
    "position Verlet": (position_verlet, ("position-verlet",)),
    "implicit midpoint": (midpoint, ("implicit-midpoint", "trapezoidal")),
    "Heun": (HEUN, ("rk2-heun", "rk2-midpoint")),
    "RK4": (RK4, ("rk4",)),
    "Ruth 3": (RUTH, ("ruth3",)),
    "Forest-Ruth": (FOREST, ("forest-ruth",)),
    "Yoshida 4": (YOSHIDA, ("yoshida4",)),
}
_S6 = math.sqrt(6.0)
_S3 = math.sqrt(3.0)
_G = 1 - 1 / math.sqrt(2)
_S = 1 / (4 - 4 ** (1 / 3))
_XI, _LA, _CHI = 0.1786178958448091, -0.2123418310626054, -0.6626458266981849e-1
BUTCHER5 = [
    [],
    [1 / 4],
    [1 / 8, 1 / 8],
    [0, -1 / 2, 1],
    [3 / 16, 0, 0, 9 / 16],
    [-3 / 7, 2 / 7, 12 / 7, -12 / 7, 8 / 7],
]
DP = [
    [],
    [1 / 5],
    [3 / 40, 9 / 40],
    [44 / 45, -56 / 15, 32 / 9],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
]
FEHLBERG = [
    [],
    [1 / 4],
    [3 / 32, 9 / 32],
    [1932 / 2197, -7200 / 2197, 7296 / 2197],
    [439 / 216, -8, 3680 / 513, -845 / 4104],
]
FEHLBERG6 = [*FEHLBERG, [-8 / 27, 2, -3544 / 2565, 1859 / 4104, -11 / 40]]
CASH = [
    [],
    [1 / 5],
    [3 / 40, 9 / 40],
    [3 / 10, -9 / 10, 6 / 5],
    [-11 / 54, 5 / 2, -70 / 27, 35 / 27],
    [1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096],
]


def theta(share: float) -> Step:
    return collocation([[0, 0], [1 - share, share]], [1 - share, share])


def newmark(beta: float) -> Step:
    """gamma = 1/2: q' = q + h v + h**2 ((1/2 - beta) a + beta a')."""

    def step(q: float, v: float, h: float, w2: float) -> State:
        new = (q + h * v - h * h * (0.5 - beta) * w2 * q) / (1 + h * h * beta * w2)
        return new, v - h / 2 * w2 * (q + new)

    return step


def rosenbrock(q: float, v: float, h: float, w2: float) -> State:
    """ROS2 of Verwer, gamma = 1 + 1/sqrt 2."""
    g = 1 + 1 / math.sqrt(2)

    def solved(x: float, u: float) -> State:
        u = (u - g * h * w2 * x) / (1 + (g * h) ** 2 * w2)
        return x + g * h * u, u

    k1 = solved(v, -w2 * q)
    k2 = solved(v + h * k1[1] - 2 * k1[0], -w2 * (q + h * k1[0]) - 2 * k1[1])
    return q + h * (1.5 * k1[0] + 0.5 * k2[0]), v + h * (1.5 * k1[1] + 0.5 * k2[1])


def tr_bdf2(q: float, v: float, h: float, w2: float) -> State:
    g = 2 - math.sqrt(2)
    d = g * h / 2
    x, u = q + d * v, v - d * w2 * q
    u = (u - d * w2 * x) / (1 + d * d * w2)
    x = x + d * u
    c1, c0, e = 1 / (g * (2 - g)), (1 - g) ** 2 / (g * (2 - g)), (1 - g) / (2 - g) * h
    y, w = c1 * x - c0 * q, c1 * u - c0 * v
    w = (w - e * w2 * y) / (1 + e * e * w2)
    return y + e * w, w


ALL_RK3 = ("rk3-kutta", "rk3-ssp", "bogacki-shampine", "rk3-heun", "rk3-ralston")
MISSING: dict[str, tuple[Step, tuple[str, ...]]] = {
    "Kutta's third order": (tableau([[], [0.5], [-1, 2]], [1 / 6, 2 / 3, 1 / 6]), ALL_RK3),
    "SSP(3,3)": (tableau([[], [1], [0.25, 0.25]], [1 / 6, 1 / 6, 2 / 3]), ALL_RK3),
    "Bogacki-Shampine": (tableau([[], [0.5], [0, 0.75]], [2 / 9, 1 / 3, 4 / 9]), ALL_RK3),
    "Fehlberg, order 4": (tableau(FEHLBERG, [25 / 216, 0, 1408 / 2565, 2197 / 4104, -1 / 5]), ("fehlberg4",)),
    "Fehlberg, order 5": (
        tableau(FEHLBERG6, [16 / 135, 0, 6656 / 12825, 28561 / 56430, -9 / 50, 2 / 55]),
        ("fehlberg5",),
    ),
    "Dormand-Prince 5": (
        tableau(DP, [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]),
        ("dormand-prince5",),
    ),
    "Cash-Karp 5": (
        tableau(CASH, [37 / 378, 0, 250 / 621, 125 / 594, 0, 512 / 1771]),
        ("cash-karp5",),
    ),
    "Butcher's fifth order": (
        tableau(BUTCHER5, [7 / 90, 0, 32 / 90, 12 / 90, 32 / 90, 7 / 90]),
        ("rk5-butcher",),
    ),
    "theta 0.6": (theta(0.6), ("theta",)),
    "theta 2/3": (theta(2 / 3), ("theta",)),
    "Newmark 1/6": (newmark(1 / 6), ("newmark",)),
    "Newmark 1/12 (Fox-Goodwin)": (newmark(1 / 12), ("newmark",)),
    "SDIRK2": (collocation([[_G, 0], [1 - _G, _G]], [1 - _G, _G]), ("sdirk2",)),
    "TR-BDF2": (tr_bdf2, ("tr-bdf2",)),
    "Gauss 4": (
        collocation([[1 / 4, 1 / 4 - _S3 / 6], [1 / 4 + _S3 / 6, 1 / 4]], [0.5, 0.5]),
        ("gauss4",),
    ),
    "Radau IIA 3": (collocation([[5 / 12, -1 / 12], [3 / 4, 1 / 4]], [3 / 4, 1 / 4]), ("radau3",)),
    "Radau IIA 5": (
        collocation(
            [
                [(88 - 7 * _S6) / 360, (296 - 169 * _S6) / 1800, (-2 + 3 * _S6) / 225],
                [(296 + 169 * _S6) / 1800, (88 + 7 * _S6) / 360, (-2 - 3 * _S6) / 225],
                [(16 - _S6) / 36, (16 + _S6) / 36, 1 / 9],
            ],
            [(16 - _S6) / 36, (16 + _S6) / 36, 1 / 9],
        ),
        ("radau5",),
    ),
    "Rosenbrock ROS2": (rosenbrock, ("ros2",)),
    "PEFRL": (
        alternating(
            "drift",
            _XI,
            (1 - 2 * _LA) / 2,
            _CHI,
            _LA,
            1 - 2 * (_CHI + _XI),
            _LA,
            _CHI,
            (1 - 2 * _LA) / 2,
            _XI,
        ),
        ("pefrl",),
    ),
    "McLachlan, second order": (
        alternating("drift", 0.1931833275037836, 0.5, 1 - 2 * 0.1931833275037836, 0.5, 0.1931833275037836),
        ("mclachlan2",),
    ),
}
"""Families that people run.  Their names here are those that a catalogue may give them."""

UNKNOWN: dict[str, Step] = {
    "three stages, order 2": tableau([[], [0.4], [0.1, 0.7]], [0.2, 0.35, 0.45]),
    "four stages, order 1": tableau([[], [0.3], [0.2, 0.2], [0.1, 0.3, 0.5]], [0.3, 0.2, 0.3, 0.2]),
    "Suzuki's fourth order": alternating(
        "kick", _S / 2, _S, _S, _S, (1 - 3 * _S) / 2, 1 - 4 * _S, (1 - 3 * _S) / 2, _S, _S, _S, _S / 2
    ),
    "Blanes-Moan, six stages": alternating(
        "drift",
        0.0792036964311957,
        0.209515106613362,
        0.353172906049774,
        -0.143851773179818,
        -0.0420650803577195,
        0.434336666566456,
        1 - 2 * (0.0792036964311957 + 0.353172906049774 - 0.0420650803577195),
        0.434336666566456,
        -0.0420650803577195,
        -0.143851773179818,
        0.353172906049774,
        0.209515106613362,
        0.0792036964311957,
    ),
    "Lobatto IIIC 2": collocation([[0.5, -0.5], [0.5, 0.5]], [0.5, 0.5]),
    "SDIRK3 of Alexander": collocation(
        [
            [0.4358665215084590, 0, 0],
            [0.2820667392457705, 0.4358665215084590, 0],
            [1.208496649176010, -0.6443631706844690, 0.4358665215084590],
        ],
        [1.208496649176010, -0.6443631706844690, 0.4358665215084590],
    ),
    "Ralston 2 with a weight of 0.7": tableau([[], [2 / 3]], [0.3, 0.7]),
}
"""Families that no catalogue held when these cases were made."""

NAMED_SINCE = {
    "Suzuki's fourth order": ("suzuki4",),
    "Blanes-Moan, six stages": ("blanes-moan4-drift-first",),
    "Lobatto IIIC 2": ("lobatto-iiic2",),
    "SDIRK3 of Alexander": ("sdirk3",),
}
"""Of those, what one holds by now."""


def march(
    step: Step, steps: int, h: float, w2: float, start: State = (0.3, 0.7 / M), every: int = 1
) -> tuple[Floats, Floats]:
    """Positions and velocities of every `every`-th state."""
    q, v = start
    rows = [(q, v)]
    for i in range(steps):
        q, v = step(q, v, h, w2)
        if (i + 1) % every == 0:
            rows.append((q, v))
    out = np.array(rows)
    return out[:, 0], out[:, 1]


MEMORY = r"memory|two-step|multistep|multi-step|step before|Adams|BDF|earlier"
"""Words that say that a scheme remembers more than a state."""
