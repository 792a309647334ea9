"""What reading every state adds to MuJoCo and REBOUND.

Claim: read at every step, each takes at most 1.2 times a hand-written loop over the same engine.
Run:   python validation/reading_established.py [REPEATS]      (default 9; a few seconds)

The minimum of the repeats of each side is quoted; the two take turns.
"""

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck import engines, load_scene

FRAMES = 20_000


def mujoco_loop(simulation: Any) -> Callable[[], None]:
    """The loop that a user of MuJoCo writes, on the model that the engine has made."""
    import mujoco

    model, data = simulation._model, simulation._data
    q, v = np.empty(FRAMES), np.empty(FRAMES)

    def loop() -> None:
        for row in range(FRAMES):
            mujoco.mj_step(model, data)
            q[row] = data.qpos[0]
            v[row] = data.qvel[0]

    return loop


def rebound_loop(simulation: Any) -> Callable[[], None]:
    """The loop that a user of REBOUND writes, on the simulation that the engine has made."""
    sim = simulation._simulation
    q, v = np.empty(FRAMES), np.empty(FRAMES)

    def loop() -> None:
        particle = sim.particles[0]
        for row in range(FRAMES):
            sim.steps(1)
            q[row] = particle.x
            v[row] = particle.vx

    return loop


LOOPS = {"mujoco:joint-spring": mujoco_loop, "rebound:leapfrog": rebound_loop}


def main() -> int:
    """Print both times and their ratio; the exit status says whether the claim holds."""
    options = arguments(__doc__, repeats=9)
    scene = replace(load_scene("spring-uneven"), steps=FRAMES, every=1)
    q, p = np.empty((FRAMES, 1)), np.empty((FRAMES, 1))
    held = True
    for name, hand in LOOPS.items():
        label = engines.parse(name)
        ours, theirs = [], []
        for _ in range(options.repeats):
            simulation = engines.start(scene, label)
            began = perf_counter()
            simulation.advance(1, q, p)
            ours.append(perf_counter() - began)
            loop = hand(engines.start(scene, label))
            began = perf_counter()
            loop()
            theirs.append(perf_counter() - began)
        ratio = min(ours) / min(theirs)
        held = held and ratio <= 1.2
        print(
            f"{name}: {min(ours) / FRAMES * 1e6:.2f} us a step, by hand {min(theirs) / FRAMES * 1e6:.2f}: "
            f"{ratio:.2f}"
        )
    return 0 if held else 1


if __name__ == "__main__":
    script(main)
