"""Claim: one identification takes milliseconds, and half a second where it takes longest.

    python validation/identify_speed.py [CALLS [SRC]]

Processor time of a call on trajectories of 101 frames that `identify_census` draws, by class: plain (without
friction) and damped in double precision, single precision, text, a systematic error that no scheme explains;
and 16 oscillators at once.  With SRC, the folder `src` of another checkout, the same trajectories go to its
package in turn with this one, twice each, and the ratio of the two is printed; the shortest time of each
trajectory counts, after one call that is not timed.

Printed for 15 calls on two idle cores (median and most):
    plain 4.7 and 18.9 ms.  damped 9.6 and 31.6.  held 6.5 and 9.8.  single 12.0 and 106.9
    text 17.7 and 87.5.  systematic error 22.8 and 105.3.  16 oscillators 34.7
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from arguments import arguments
from identify_census import Draw, written
from springcheck.errors import IdentificationError
from springcheck.identify import identify
from springcheck.physics.arrays import Floats

ROUNDS = 2


def _class(draw: Draw) -> str:
    if draw.error:
        return "systematic error"
    if draw.form != "double":
        return draw.form
    return "held" if draw.held else "damped" if draw.g else "plain"


def _many() -> tuple[Floats, Floats, Floats]:
    """Velocity Verlet of 16 springs of unlike stiffness, 400 steps: times, positions, velocities."""
    k = np.linspace(0.5, 4.0, 16)
    q, v = np.linspace(0.3, 1.7, 16), np.linspace(-1.0, 0.9, 16)
    states = [(q, v)]
    for _ in range(400):
        v = v - 0.05 * k * q
        q = q + 0.1 * v
        v = v - 0.05 * k * q
        states.append((q, v))
    qs, vs = np.array(states).swapaxes(0, 1)
    return np.asarray(0.1 * np.arange(401), np.float64), qs, vs


def measure(calls: int) -> dict[str, list[float]]:
    """Seconds of each call, by class."""
    seconds: dict[str, list[float]] = {
        name: [] for name in ("plain", "damped", "held", "single", "text", "systematic error")
    }
    number = 0
    while any(len(x) < calls for x in seconds.values()):
        draw = Draw(np.random.default_rng([8, number]))
        number += 1
        mine = seconds[_class(draw)]
        if len(mine) >= calls:
            continue
        try:
            with np.errstate(all="ignore"):
                t, q, v = draw.move()
        except OverflowError:
            continue
        if not np.max(np.abs(q)) < 1e30:
            continue
        q, v = written(q, draw.form), written(v, draw.form)
        if not any(seconds.values()):
            identify(t, q, v=v, mass=draw.m)
        begun = time.process_time()
        try:
            identify(t, q, v=v, mass=draw.m, stiffness=draw.k if draw.stated else None)
        except IdentificationError:
            continue
        finally:
            mine.append(time.process_time() - begun)
    t, q, v = _many()
    begun = time.process_time()
    identify(t, q, v=v, mass=np.ones(16))
    return seconds | {"16 oscillators": [time.process_time() - begun]}


def main() -> None:
    """Print the times of every class, and how many times shorter they are than another checkout's."""
    given = arguments(__doc__, calls=20, src="", child=0)
    if given.child:
        print(json.dumps(measure(given.calls)))
        return
    here = Path(__file__).resolve().parents[1] / "src"
    folders = {"new": here, **({"old": Path(given.src).resolve()} if given.src else {})}
    best: dict[str, dict[str, Floats]] = {name: {} for name in folders}
    for _ in range(ROUNDS):
        for name, folder in folders.items():
            run = subprocess.run(
                [sys.executable, __file__, str(given.calls), "", "1"],
                env=os.environ | {"PYTHONPATH": str(folder)}, capture_output=True, text=True, check=True,
            )  # fmt: skip
            for kind, values in json.loads(run.stdout).items():
                best[name][kind] = np.minimum(best[name].get(kind, np.inf), values)
    for kind, new in best["new"].items():
        text = f"{kind:18s} {1e3 * float(np.median(new)):7.1f} ms, {1e3 * float(np.max(new)):7.1f} at most"
        if "old" in best:
            old = best["old"][kind]
            text += f"; before {1e3 * float(np.median(old)):7.1f} and {1e3 * float(np.max(old)):7.1f}: "
            text += f"{float(np.sum(old) / np.sum(new)):.1f} times shorter"
        print(text)


if __name__ == "__main__":
    main()
