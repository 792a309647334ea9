"""Frames between which no collision took place: there Andersen's steps are those of velocity Verlet, or of
leapfrog, to rounding, and so tell the spring and the number of steps; their share tells the friction."""

from __future__ import annotations

import numpy as np

from springcheck.physics.arrays import Floats
from springcheck.thermal import chance
from springcheck.thermal.catalogue import THERMOSTATS
from springcheck.thermal.laws import Law
from springcheck.thermal.likelihood import Candidate

TRIPLES = 30000
"""Threes of frames by which a map is tried, of which 24 are of one that holds for every tenth frame."""

NO_COLLISION = 1e-7
"""Digits over the motion, to which a map holds between collisions."""

FEWEST_OF_EACH = 10
"""Frames with and without a collision, of which there must be so many: three of them make the map."""

TOGETHER_BY_CHANCE = 1e-9
"""Chance below which frames with a collision stand together, as a part that moves otherwise does."""

MOST_A_FRAME = 20
"""Steps from frame to frame at most."""


def between_collisions(q: Floats, v: Floats, h: float) -> list[Candidate]:
    """Schemes with collisions, if between many of the frames h apart of q and v (f,) one map of determinant 1
    holds to rounding, and between many not."""
    sizes, n = np.array([np.std(q), np.std(v)]), len(q) - 1
    z = np.stack([(q - q[0]) / sizes[0], v / sizes[1]], axis=1)
    known, after = np.column_stack([z[:-1], np.ones(n)]), z[1:]
    rng, few = np.random.default_rng(0), slice(0, n, max(n // 250, 1))
    rows = rng.integers(n, size=(TRIPLES, 3))
    rows = rows[np.abs(np.linalg.det(known[rows])) > 1e-6]
    maps = np.linalg.solve(known[rows], after[rows])
    best = int(np.argmax(np.sum(np.abs(maps[:, :, 0] @ known[few].T - after[few, 0]) < NO_COLLISION, axis=1)))
    off = np.max(np.abs(known @ maps[best] - after), axis=1)
    still = off < NO_COLLISION
    share = float(np.mean(still))
    if not FEWEST_OF_EACH <= np.sum(still) <= n - FEWEST_OF_EACH:
        return []
    spread = (still - share) / np.sqrt(share * (1 - share))
    if not chance.neighbours(spread[:, None]) > TOGETHER_BY_CHANCE:
        return []
    A = np.linalg.lstsq(known[still], after[still], rcond=None)[0][:2].T * sizes[:, None] / sizes
    if not (abs(np.linalg.det(A) - 1) < NO_COLLISION and A[0, 1] * A[1, 0] < 0):
        return []
    verlet = abs(A[0, 0] - A[1, 1]) < NO_COLLISION
    names = [name for name, one in THERMOSTATS.items() if one.collides and verlet == one.synchronised]
    return [y for name in names for y in _of_scheme(name, A, h, share, n, float(np.var(v)))]


def _of_scheme(name: str, A: Floats, h: float, share: float, n: int, size: float) -> list[Candidate]:
    """What a scheme means by a map A of so many steps, of whose frames a share has none with a collision."""
    found: list[Candidate] = []
    turned, frequency = float(np.arccos(np.trace(A) / 2)), float(np.sqrt(-A[1, 0] / A[0, 1]))
    for steps in range(1, MOST_A_FRAME + 1):
        angles = np.concatenate([2 * np.pi * np.arange(steps) + x for x in (turned, -turned)]) / steps
        angles = angles[(angles > 0) & (angles < np.pi)]
        # of Verlet A01 = h sin(n y) / sin y and A10 = -sin(n y) sin y / h; of leapfrog 2 sin(y/2) for sin y
        of_step = np.sin(angles) if THERMOSTATS[name].synchronised else 2 * np.sin(angles / 2)
        fits = (np.abs(of_step - frequency * h / steps) < 1e-6) & (np.sin(steps * angles) * A[0, 1] > 0)
        for angle in angles[fits]:
            w, rate = 2 * np.sin(angle / 2) * steps / h, -np.log(share) / h
            law = Law(
                scheme=THERMOSTATS[name], h=h / steps, m=np.ones(1), k=np.array([w * w]), rate=float(rate),
                thermal=1.0,
            )  # fmt: skip
            heat = size / float(law.covariance[0, 1, 1])
            found.append(
                Candidate(
                    scheme=name, omega=float(w), omega_error=0.0, friction=float(rate),
                    friction_error=float(np.sqrt((1 - share) / (share * n)) / h), thermal=heat,
                    thermal_error=heat * float(law.error_of_variances(n, steps)[0, 1]), strides=(steps,),
                )
            )  # fmt: skip
    return found[:1]
