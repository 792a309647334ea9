"""Claim: one identification takes tens of milliseconds, and two seconds where it takes longest.

    python validation/identify_speed.py [CALLS [SRC]]

Processor time of a call on trajectories of 101 frames that `identify_census` draws, by class: plain
(without friction) and damped in double precision, held forces, single precision, text, a systematic error
that no scheme explains; of trajectories as they are drawn, whatever their class; and 16 oscillators at
once. With SRC, the folder `src` of another checkout, the same trajectories go to its package in turn with
this one, twice each, and the ratio of the two is printed; the shortest time of each trajectory counts,
after one call that is not timed.

Printed for 2 calls on two cores that others used as well (median and most):
    plain 15.0 and 16.1 ms.  damped 58.7 and 59.0.  held 17.5 and 18.0.  single 73.1 and 120.8
    text 60.6 and 98.1.  systematic error 143.0 and 201.2.  16 oscillators 103.6.  as drawn 76.2 and 385.4
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from arguments import arguments, script
from identify_census import Draw, written
from springcheck.errors import IdentificationError
from springcheck.identify import identify
from springcheck.physics.arrays import Floats

ROUNDS = 2

MIXED = 10
"""Trajectories as they are drawn, for each call of a class."""

AS_DRAWN = "as drawn"


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


def _seconds(draw: Draw) -> float | None:
    """Processor time of one call on a trajectory, None where it overflows."""
    try:
        with np.errstate(all="ignore"):
            t, q, v = draw.move()
    except OverflowError:
        return None
    if not np.max(np.abs(q)) < 1e30:
        return None
    q, v = written(q, draw.form), written(v, draw.form)
    begun = time.process_time()
    with contextlib.suppress(IdentificationError):
        identify(t, q, v=v, mass=draw.m, stiffness=draw.k if draw.stated else None)
    return time.process_time() - begun


def measure(calls: int) -> dict[str, list[float]]:
    """Seconds of each call, by class."""
    names = ("plain", "damped", "held", "single", "text", "systematic error")
    seconds: dict[str, list[float]] = {name: [] for name in names}
    for _ in range(2):
        _seconds(Draw(np.random.default_rng([8, 0])))
    number = 0
    while any(len(x) < calls for x in seconds.values()):
        draw = Draw(np.random.default_rng([8, number]))
        number += 1
        mine = seconds[_class(draw)]
        if len(mine) < calls and (spent := _seconds(draw)) is not None:
            mine.append(spent)
    drawn = (_seconds(Draw(np.random.default_rng([9, number]))) for number in range(MIXED * calls))
    t, q, v = _many()
    begun = time.process_time()
    identify(t, q, v=v, mass=np.ones(16))
    many = [time.process_time() - begun]
    return seconds | {"16 oscillators": many, AS_DRAWN: [x for x in drawn if x is not None]}


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
    mean = float(np.mean(best["new"][AS_DRAWN]))
    print(f"mean as drawn {1e3 * mean:.1f} ms: {2 * 3600 / mean:.3g} calls an hour on two cores")


if __name__ == "__main__":
    script(main)
