"""Thermostats held against their laws: draws of four engines, and the figure of temperatures and limits.

Claim: the draws of thermostats have mean 0, variance 1 and fourth moment 3 to what 2e8 of them show, and
temperatures and stability limits follow the law of each scheme.
Command: python validation/thermostats.py    (some minutes; `--figure` draws the figure alone)

Draws: n springs side by side, every step's draw of each from its positions.  Printed on two cores that many
others used as well, hence two times for each:

      own:baoab                      2.0e+08 draws: mean -1.3e-04 +- 7e-05, variance 1 +2.8e-05 +- 1e-04,
        fourth 3.0004 +- 0.0007, 67 s, 5 s of a processor
      openmm:langevin-middle-bath    2.0e+08 draws: mean +1.3e-05 +- 7e-05, variance 1 -1.2e-05 +- 1e-04,
        fourth 2.9996 +- 0.0007, 125 s, 9 s of a processor
      openmm:brownian                2.0e+08 draws: mean +1.3e-05 +- 7e-05, variance 1 -1.2e-05 +- 1e-04,
        fourth 2.9996 +- 0.0007, 120 s, 10 s of a processor
      ase:langevin-baoab             2.0e+08 draws: mean -1.3e-04 +- 7e-05, variance 1 +2.8e-05 +- 1e-04,
        fourth 3.0004 +- 0.0007, 53 s, 10 s of a processor
      lammps:gjf-1                   2.0e+08 draws: mean -2.1e-05 +- 7e-05, variance 1 +1.3e-04 +- 1e-04,
        fourth 3.0015 +- 0.0007, 62 s, 9 s of a processor
"""

from __future__ import annotations

from pathlib import Path
from time import perf_counter, process_time

import numpy as np

import springcheck
from arguments import arguments, script
from springcheck import engines
from springcheck.bath import THERMOSTATS, Law
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring

H, M, K, RATE, THERMAL = 0.35, 3.7, 2.9, 0.8, 1.7
MANY_DRAWS = 200_000_000
"""Their variance has a standard error of 1e-4."""
FIGURE = Path(__file__).parents[1] / "data" / "figures" / "thermostats.png"


def springs(n: int, steps: int) -> Scene:
    """So many equal springs in a bath, none of whose numbers is 1; three of each particle."""
    walls = WallSpring(i=np.arange(n), k=np.full(n, K), at=np.zeros(n))
    return Scene(
        m=np.full(n, M), q=np.full(n, 0.3), p=np.full(n, 0.2), terms=(walls,), step=H, steps=steps,
        bath=Bath(temperature=THERMAL, friction=RATE), name="springs", places=np.arange(n),
    )  # fmt: skip


def law(scheme: str, h: float = H, rate: float = RATE) -> Law:
    """The law of a scheme on one of them."""
    return Law(scheme=THERMOSTATS[scheme], h=h, m=np.array([M]), k=np.array([K]), rate=rate, thermal=THERMAL)


def draws(label: str, n: int, steps: int) -> None:
    """Moments of the draws of a method of one draw a step, from its positions along all three axes."""
    method = engines.method(engines.parse(label))
    known = law(method.scheme)
    A, g = known.A[0].astype(float), float(known.G[0, 0, 0])
    began, of_processor = perf_counter(), process_time()
    simulation = engines.Started(springs(n, steps), engines.parse(label), 7)
    rows = max(1, 300_000 // n)
    q, p = np.empty((2, rows + 1, n))
    q[0], p[0], sums = 0.3, 0.2, np.zeros(3)
    for _ in range(0, steps, rows):
        simulation.advance(1, q[1:], p[1:])
        xi = (q[1:] - A[0, 0] * q[:-1] - A[0, 1] * p[:-1]) / g
        square = xi * xi
        sums += xi.sum(), square.sum(), np.vdot(square, square)
        q[0], p[0] = q[-1], p[-1]
    total = n * rows * -(-steps // rows)
    mean, variance, fourth = sums / total
    print(
        f"  {label:30} {total:.1e} draws: mean {mean:+.1e} +- {total**-0.5:.0e}, "
        f"variance 1 {variance - 1:+.1e} "
        f"+- {(2 / total) ** 0.5:.0e}, fourth {fourth:.4f} +- {(96 / total) ** 0.5:.4f}, "
        f"{perf_counter() - began:.0f} s, {process_time() - of_processor:.0f} s of a processor",
        flush=True,
    )


METHODS = (
    "own:baoab", "own:obabo", "own:oabao", "own:aboba", "own:bbk", "openmm:langevin-middle-bath",
    "openmm:andersen", "ase:langevin", "ase:langevin-baoab", "ase:andersen", "lammps:langevin",
    "lammps:gjf-1",
)  # fmt: skip


def figure() -> None:
    """Configurational and kinetic temperature against h w: laws as lines, engines as marks."""
    from springcheck.figures.style import style

    here = [label for label in METHODS if not engines.absence(label.partition(":")[0])]
    with style():
        drawn = springcheck.sampling(here).figures()["sampling"]
        drawn.savefig(FIGURE, dpi=110)
    print(f"  {FIGURE.name} written")


def main() -> None:
    """All of it, or the figure alone."""
    if not arguments(__doc__, figure=False).figure:
        print("draws")
        for label, n in (
            ("own:baoab", 30000), ("openmm:langevin-middle-bath", 30000), ("openmm:brownian", 30000),
            ("ase:langevin-baoab", 30000), ("lammps:gjf-1", 6000),
        ):  # fmt: skip
            if not engines.absence(label.partition(":")[0]):
                draws(label, n, MANY_DRAWS // n)
    print("figure")
    figure()


if __name__ == "__main__":
    script(main)
