"""What judging costs: its time over that of a NumPy loop of the same steps, by masses, steps, stride, scheme.

Claim: the time of judging grows with masses times steps, and a wrong run is diagnosed in a few seconds.

Second route: a loop of NumPy over the same steps, with slices for the neighbours of a uniform chain, as a
reader would write it.  Times are the least of a few, in processor time of one core.

Command: python validation/judging_cost.py [--long]

Recorded on an Intel Xeon whose two cores were shared with other work:

    method                 masses  steps every      a loop    judged   loops  diagnosed  memory
    own:velocity-verlet         1 20,000     1   108.56 ms     0.09 s     0.8     0.62 s      9 MB
    own:velocity-verlet         1 20,000   100   112.01 ms     0.05 s     0.4     1.85 s      0 MB
    own:velocity-verlet        16  4,000     1    19.86 ms     0.22 s    11.1     0.57 s     13 MB
    own:velocity-verlet        16  4,000   100    19.80 ms     0.30 s    15.2     7.83 s      0 MB
    own:velocity-verlet       100  1,000     1     5.11 ms     0.48 s    94.5     1.92 s     11 MB
    own:velocity-verlet       100  1,000  1000     5.13 ms     1.02 s   198.0     1.13 s      0 MB
    own:velocity-verlet     1,000    100     1     0.86 ms     0.63 s   733.7     1.85 s      9 MB
    own:velocity-verlet     1,000    400    20     3.31 ms     0.85 s   256.9     5.57 s      0 MB
    own:velocity-verlet     1,000    400   400     5.33 ms     1.08 s   203.1     0.71 s      0 MB
    own:velocity-verlet    10,000     20     1     0.74 ms     1.60 s  2144.7     3.74 s     18 MB
    own:rk4                 1,000     50    50     0.42 ms     0.34 s   794.3     6.85 s      5 MB
    own:implicit-midpoint   1,000     50    50     0.53 ms     1.46 s  2769.0     6.42 s     24 MB

10,000 masses over 400 steps between two frames take 4.6 s, 350 loops.  With extended tangents, and limits of
detection by further runs, these took 28 s, 1,000 masses 3.5 s, and implicit midpoint 43 s.

So judging is far above the 5 times of a loop that were aimed for, on a chain of 1,000 masses 200 to 700: the
motion of the reference is extended, of which a NumPy operation takes 4 ns a number where one of doubles takes
0.3, and 16 tangents go along.  A spring by itself is judged in less than a loop takes.

A million masses over 20 steps in five frames (--long) took 124 s and 3.1 GB before that.

Exit status 0 where every right run passes and every wrong one fails with a diagnosis; 1 otherwise.
"""

from __future__ import annotations

import argparse
import resource
from dataclasses import replace
from time import process_time as clock

import numpy as np

from arguments import script
from springcheck import checks
from springcheck.api import simulate
from springcheck.identify.scenes import diagnosis
from springcheck.physics.builders import chain
from springcheck.physics.scene import Scene

CASES = (
    (1, 20_000, 1), (1, 20_000, 100), (16, 4_000, 1), (16, 4_000, 100), (100, 1_000, 1), (100, 1_000, 1_000),
    (1_000, 100, 1), (1_000, 400, 20), (1_000, 400, 400), (10_000, 20, 1), (10_000, 100, 100),
    (10_000, 400, 400),
)  # fmt: skip
SHORT = ((1_000, 50, 50),)
METHODS = {"own:velocity-verlet": CASES, "own:rk4": SHORT, "own:implicit-midpoint": SHORT}
M, K, STEP = 1.7, 2.9, 0.1


def scene(n: int, steps: int, every: int) -> Scene:
    """A uniform chain of `n` masses between walls, with random starts."""
    rng = np.random.default_rng(11)
    return chain(n, M, K, q=rng.normal(size=n), p=rng.normal(size=n), step=STEP, steps=steps, every=every)


def loop(given: Scene) -> None:
    """Velocity Verlet by slices."""
    q, p = np.pad(given.q, 1), given.p.copy()
    pull = K * (q[2:] - 2 * q[1:-1] + q[:-2])
    for _ in range(given.steps):
        p = p + STEP / 2 * pull
        q[1:-1] += STEP / M * p
        pull = K * (q[2:] - 2 * q[1:-1] + q[:-2])
        p = p + STEP / 2 * pull


def seconds(work: object, times: int = 3) -> float:
    """The least processor time of a function."""
    found = []
    for _ in range(times):
        began = clock()
        work()  # type: ignore[operator]
        found.append(clock() - began)
    return min(found)


def one(method: str, n: int, steps: int, every: int) -> bool:
    """Print a row; whether the right run passes, and a stiffer one fails."""
    given = scene(n, steps, every)
    run = simulate(given, method)
    simple = seconds(lambda: loop(given))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    judged = seconds(lambda: checks.judge(given, run), 1)
    most = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3
    wrong = simulate(given.system.scaled(1.001), method)
    verdicts = checks.judge(given, replace(wrong, label=run.label))
    told = seconds(lambda: checks.explained(given, wrong, verdicts, diagnosis), 1)
    good = checks.status(checks.judge(given, run)) == 0 and checks.status(verdicts) == 1
    print(
        f"{method:22} {n:>6,} {steps:>6,} {every:>5} {1e3 * simple:8.2f} ms {judged:8.2f} s "
        f"{judged / simple:7.1f} {told:8.2f} s {most:6.0f} MB {'' if good else '!'}",
        flush=True,
    )
    return good


def main() -> int:
    """Print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--long", action="store_true", help="a million masses too")
    given = parser.parse_args()
    print("method                 masses  steps every      a loop    judged   loops  diagnosed  memory")
    rows = [(method, *case) for method, cases in METHODS.items() for case in cases]
    rows += [("own:velocity-verlet", 1_000_000, 20, 4)] * given.long
    return 0 if min([one(*row) for row in rows]) else 1


if __name__ == "__main__":
    script(main)
