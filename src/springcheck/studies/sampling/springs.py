"""Equal springs in a bath, and the temperatures of their frames."""

from __future__ import annotations

import numpy as np

from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring

MASS, STIFFNESS, KT = 3.7, 2.9, 1.7
"""Mass, stiffness and kT, none of them 1."""

H_OMEGA, GAMMA_H = 0.5, 0.4
"""h omega, at which schemes differ by several percent, and gamma h, above h omega squared: below that
Euler-Maruyama is not stable."""

BLOCKS_OF_STEPS = 20
"""Blocks of steps whose means give the standard error of what all springs share."""

SEED_OF_START = 26
"""Seed of the states at the start; not tuned."""


def springs(n: int, steps: int) -> Scene:
    """Equal springs in a bath, at typical thermal states."""
    w = np.sqrt(STIFFNESS / MASS)
    walls = WallSpring(i=np.arange(n), k=np.full(n, STIFFNESS), at=np.zeros(n))
    start = np.random.default_rng(SEED_OF_START).standard_normal((2, n))
    return Scene(
        m=np.full(n, MASS), q=np.sqrt(KT / STIFFNESS) * start[0], p=np.sqrt(MASS * KT) * start[1],
        terms=(walls,), step=H_OMEGA / w, steps=steps,
        bath=Bath(temperature=KT, friction=GAMMA_H * w / H_OMEGA), quantities=("q", "p"), name="springs",
    )  # fmt: skip


def temperatures(q: Floats, p: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """k <q**2>/kT and <p**2>/m kT of frames (f, n) of `springs`, each with its standard error.

    The standard error is the larger of two: across springs as if independent, and across blocks of steps.
    """
    out = []
    for square in (STIFFNESS * q * q / KT, p * p / (MASS * KT)):
        alone = np.std(np.mean(square, axis=0)) / np.sqrt(square.shape[1])
        blocks = np.array([np.mean(block) for block in np.array_split(square, BLOCKS_OF_STEPS)])
        error = max(float(alone), float(np.std(blocks, ddof=1)) / np.sqrt(BLOCKS_OF_STEPS))
        out.append((float(np.mean(square)), error))
    return out[0], out[1]
