"""Error against run time on a stiff lattice of up to a million masses.

A chain of masses between two walls whose links differ by twelve decades in stiffness, so that their rates
sqrt(k/m) differ by six: every fifth link is stiff, 1e6 to 1e12, the others about 1.  Stiff links start at
rest and unstretched, and what moves is the lattice of the pairs that they form.  The run ends at t = 2, about
a third of a period of a soft link.

Claim: an implicit method pays by its step, not by the fastest rate (an explicit one needs h w < 2, a million
steps), and a step costs as many nanoseconds a mass for any number of them, to the width of the caches:

* own:implicit-midpoint and own:trapezoidal (tridiagonal factors, found once) show order 2 in the positions,
  own:implicit-euler order 1;
* SUNDIALS' BDF with its sparse solver agrees with them, and for the same error takes longer.

The error is the largest over all masses, of the positions at the end, relative to the largest position: the
fast modes are not damped, and no method that steps over them has their momenta.  The reference is implicit
midpoint by eight times as many steps; what is left of its own error follows from half as many, by Richardson,
and is printed.  BDF is the second route: its error at the tightest tolerance must be below 100 times that
tolerance and the reference's own.  From a tolerance of 1e-7 on it sees the fast modes and follows them: more
than 4 minutes for a thousand masses.

Command: python validation/stiff_lattice.py [--masses 1000000] [--most-seconds 150] [-o FOLDER for the figure]

Recorded with 1,000,000 masses on an Intel Xeon whose two cores were shared with much other work; seconds are
of processor time, the reference is off by 2.3e-06:

    method                    steps      error  start s    run s  ns a mass and step
    own:implicit-euler           25   2.56e-01     1.36     0.21                 8.2
    own:implicit-euler          200   3.87e-02     1.31     1.59                 7.9
    own:implicit-midpoint        25   9.59e-03     1.33     0.21                 8.4
    own:implicit-midpoint       200   1.48e-04     1.21     1.67                 8.3
    own:trapezoidal              25   9.59e-03     1.42     0.32                12.8
    own:trapezoidal             200   1.48e-04     1.45     2.48                12.4
    sundials:bdf, 1e-3     35 calls   6.74e-03     0.88    11.73               335.1 a mass and call
    sundials:bdf, 1e-4     44 calls   1.05e-03     0.97    16.43               373.4 a mass and call
    sundials:bdf, 1e-5     66 calls   1.95e-04     1.23    23.81               360.8 a mass and call
    sundials:bdf, 1e-6     75 calls   5.36e-05     1.20    21.00               279.9 a mass and call

Exit status 0 where the orders are 1 and 2 to 0.15 and BDF agrees with the reference, 1 otherwise.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from time import process_time

import numpy as np
from matplotlib.figure import Figure

from arguments import script
from springcheck import engines
from springcheck.engines.own import simulation
from springcheck.figures import looks
from springcheck.figures.style import save, style
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring

END = 2.0
STEPS = (25, 50, 100, 200)
REFERENCE = 8 * STEPS[-1]
METHODS = ("implicit-euler", "implicit-midpoint", "trapezoidal")
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6)
BLOCK = 5
"""Masses from one stiff link to the next."""


def lattice(n: int, steps: int = 1, tolerance: float = 1e-6) -> Scene:
    """`n` masses in a chain, every fifth link stiff; masses that a stiff link joins move together."""
    rng = np.random.default_rng(17)
    m = rng.uniform(0.5, 2, n)
    stiff = np.arange(n - 1) % BLOCK == 0
    k = np.where(stiff, 10.0 ** rng.uniform(6, 12, n - 1), rng.uniform(0.5, 2, n - 1))
    links = Spring(a=np.arange(n - 1), b=np.arange(1, n), k=k, rest=np.zeros(n - 1))
    walls = WallSpring(i=np.array([0, n - 1]), k=np.ones(2), at=np.zeros(2))
    first = np.arange(n) - (np.arange(n) % BLOCK == 1)
    q, v = rng.normal(size=n)[first], rng.normal(size=n)[first]
    return Scene(
        name="stiff lattice",
        m=m,
        q=q,
        p=m * v,
        terms=(walls, links),
        step=END / steps,
        steps=steps,
        every=steps,
        tolerance=tolerance,
    )


def own(scene: Scene, scheme: str) -> tuple[Floats, float, float]:
    """State at the end (2, n), and seconds of start and run."""
    began = process_time()
    started = simulation.prepare(scene, scheme, scene.step, compiled=True)
    ready = process_time()
    q, p = np.empty((2, 1, scene.n))
    started.advance(scene.steps, q, p)
    return np.vstack([q, p]), ready - began, process_time() - ready


def bdf(scene: Scene) -> tuple[Floats, float, float, int]:
    """The same by SUNDIALS' BDF with a sparse Jacobian, and its evaluations of the force."""
    label = engines.parse("sundials:bdf")
    began = process_time()
    started = engines.start(scene, label)
    ready = process_time()
    q, p = np.empty((2, 1, scene.n))
    started.advance(1, q, p)
    return np.vstack([q, p]), ready - began, process_time() - ready, started.force_calls


def error(state: Floats, reference: Floats) -> float:
    """Largest difference of positions, relative to the largest position."""
    return float(np.max(np.abs(state[0] - reference[0])) / np.max(np.abs(reference[0])))


def draw(rows: Sequence[tuple[str, float, float]], n: int, folder: Path) -> None:
    """Error against run time, a line a method."""
    with style():
        figure = Figure(figsize=(7.2, 4.2), layout="constrained")
        axes = figure.add_subplot()
        for name in dict.fromkeys(row[0] for row in rows):
            look, mark = looks.look(looks.scheme_of(name)), looks.mark(looks.engine(name))[0]
            mine = [(seconds, off) for label, seconds, off in rows if label == name]
            axes.loglog(
                *zip(*mine, strict=True), color=look.color, linestyle=look.linestyle, marker=mark, label=name
            )
        axes.set_xlabel("processor time of the run [s]")
        axes.set_ylabel("error of the positions at t = 2")
        axes.set_title(f"A stiff lattice of {n:,} masses, rates over six decades")
        axes.legend(frameon=False)
        save(figure, folder, "stiff-lattice")


def main() -> int:
    """Print the table; 1 where an order is wrong or BDF disagrees."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--masses", type=int, default=1_000_000)
    parser.add_argument("--most-seconds", type=float, default=150, help="of BDF: no tighter tolerance beyond")
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="for stiff-lattice.png and .svg")
    options = parser.parse_args()
    n = options.masses
    # the first call compiles or loads
    own(lattice(100), "implicit-euler")
    finer, _, _ = own(lattice(n, REFERENCE // 2), "implicit-midpoint")
    reference, _, seconds = own(lattice(n, REFERENCE), "implicit-midpoint")
    left = error(finer, reference) / 3
    print(f"{n:,} masses to t = {END:g}", flush=True)
    print(f"reference: {REFERENCE:,} steps in {seconds:.1f} s, off by {left:.1e}")
    print(f"{'method':28}{'steps':>8}{'error':>11}{'start s':>9}{'run s':>9}{'ns a mass and step':>20}")
    passed = True
    rows: list[tuple[str, float, float]] = []
    for scheme in METHODS:
        errors = []
        for steps in STEPS:
            state, start, run = own(lattice(n, steps), scheme)
            errors.append(error(state, reference))
            rows.append((f"own:{scheme}", run, errors[-1]))
            each = run / steps / n * 1e9
            print(f"own:{scheme:24}{steps:8}{errors[-1]:11.2e}{start:9.2f}{run:9.2f}{each:20.1f}")
        order = float(np.log2(errors[-2] / errors[-1]))
        right = abs(order - (1 if scheme == "implicit-euler" else 2)) <= 0.15
        passed &= right
        print(f"  order of the last two: {order:.2f}{'' if right else '  WRONG'}")
    took, last, tightest = 0.0, np.inf, 0.0
    print(f"{'':28}{'calls':>8}{'':29}{'ns a mass and call':>20}", flush=True)
    for tolerance in TOLERANCES:
        if took * 1.5 > options.most_seconds:
            print(f"  tolerances from {tolerance:g} on left out: beyond {options.most_seconds:g} s")
            break
        state, start, took, calls = bdf(lattice(n, 1, tolerance))
        last, tightest = error(state, reference), tolerance
        rows.append(("sundials:bdf", took, last))
        each = took / calls / n * 1e9
        name = f"sundials:bdf, {tolerance:g}"
        print(f"{name:28}{calls:8}{last:11.2e}{start:9.2f}{took:9.2f}{each:20.1f}", flush=True)
    agrees = last <= 100 * tightest + left
    if options.output:
        draw(rows, n, options.output)
    print(f"BDF and the reference agree to {last:.1e}{'' if agrees else '  TOO MUCH'}")
    return 0 if passed and agrees else 1


if __name__ == "__main__":
    script(main)
