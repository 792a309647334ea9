"""A chain of a million equal masses: closed form and verdicts in memory linear in its length.

Claim: the modes of a uniform chain between walls are sines, so that its exact solution takes a fast sine
transform and O(n) memory; a run of a million masses is judged by every check that a short chain is judged
by, and the memory a mass does not grow with the number of masses.

Second route: the same motion by `scipy.fft.dst` in double precision, with the frequencies
2 sqrt(k/m) sin(pi j / (2 (n + 1))); the two differ by its rounding alone, less than 1e-9 of the largest
position.

Command: python validation/long_chain.py [--masses 10000 100000 1000000] [--steps 20]

Recorded on an Intel Xeon whose two cores were shared with much other work; seconds are of processor time, the
first run of a process compiles, memory is the most of the process:

       10,000 masses, closed form: 0.02 s, off scipy's by 6.6e-16
      own:euler                run   0.15 s, judged   0.50 s: 8 passed, 4 left out
      own:semi-implicit-euler  run   0.04 s, judged   0.48 s: 8 passed, 4 left out
      openmm:verlet            run   0.11 s, judged   0.54 s: 9 passed, 3 left out
    memory: 167 MB, 11079 bytes a mass
      100,000 masses, closed form: 0.98 s, off scipy's by 1.1e-15
      own:euler                run   0.58 s, judged   9.00 s: 8 passed, 4 left out
      own:semi-implicit-euler  run   0.09 s, judged   8.53 s: 8 passed, 4 left out
      openmm:verlet            run   0.35 s, judged   9.01 s: 9 passed, 3 left out
    memory: 551 MB, 4849 bytes a mass
    1,000,000 masses, closed form: 11.86 s, off scipy's by 1.2e-15
      own:euler                run   1.68 s, judged 123.83 s: 8 passed, 4 left out

The last process had taken 3062 MB at most by then, less a mass than the others; the two other methods of a
million masses were not waited for.

Judging an implicit scheme takes longer: own:implicit-euler 100 s for 100,000 masses.

Exit status 0 where every verdict passed and the routes agree; 1 otherwise.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
from collections import Counter
from time import process_time as clock

import numpy as np
from scipy import fft

from arguments import script
from springcheck.api import judge, simulate
from springcheck.physics import exact
from springcheck.physics.builders import chain
from springcheck.physics.scene import Scene

METHODS = ("own:euler", "own:semi-implicit-euler", "openmm:verlet")
M, K, STEP = 1.7, 2.9, 0.1
AGREE = 1e-9


def scene(n: int, steps: int) -> Scene:
    """`n` masses with random starts, five frames."""
    rng = np.random.default_rng(11)
    return chain(
        n, M, K, q=rng.normal(size=n), p=rng.normal(size=n), step=STEP, steps=steps, every=steps // 5
    )


def by_scipy(given: Scene, t: float) -> np.ndarray:
    """Positions at t by another route."""
    n = given.n
    w = 2 * np.sqrt(K / M) * np.sin(np.pi * np.arange(1, n + 1) / (2 * (n + 1)))
    y, v = (fft.dst(x, type=1, norm="ortho") for x in (given.q, given.p / M))
    return fft.dst(y * np.cos(w * t) + v / w * np.sin(w * t), type=1, norm="ortho")


def peak() -> float:
    """Most memory so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def one(n: int, steps: int) -> bool:
    """Print what a chain of `n` masses takes; whether all of it is right."""
    given = scene(n, steps)
    before = peak()
    began = clock()
    q, _ = exact.true_motion(given, np.array([steps]), STEP)
    seconds = clock() - began
    other = by_scipy(given, steps * STEP)
    off = float(np.max(np.abs(q[0] - other)) / np.max(np.abs(other)))
    print(f"{n:>9,} masses, closed form: {seconds:.2f} s, off scipy's by {off:.1e}", flush=True)
    good = off <= AGREE
    for method in METHODS:
        began = clock()
        run = simulate(given, method)
        ran = clock() - began
        began = clock()
        verdicts = judge(given, run)
        took = clock() - began
        said = Counter({True: "passed", False: "failed", None: "left out"}[x.passed] for x in verdicts)
        good &= not said["failed"] and said["passed"] > 0
        counts = ", ".join(f"{count} {word}" for word, count in said.items())
        print(f"  {method:24} run {ran:6.2f} s, judged {took:6.2f} s: {counts}", flush=True)
    print(f"memory: {peak():.0f} MB, {(peak() - before) * 1e6 / n:.0f} bytes a mass", flush=True)
    return good


def main() -> int:
    """Print a table for each length, each in a process of its own."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--masses", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--steps", type=int, default=20)
    given = parser.parse_args()
    if len(given.masses) == 1:
        return 0 if one(given.masses[0], given.steps) else 1
    each = [[sys.executable, __file__, "--steps", str(given.steps), "--masses", str(n)] for n in given.masses]
    return max(subprocess.run(command, check=False).returncode for command in each)


if __name__ == "__main__":
    script(main)
