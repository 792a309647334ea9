"""Thermostats held against their laws: draws of four engines, false alarms over many seeds, files that name
themselves, and a figure of the two temperatures against the step.

Command: python validation/thermostats.py [SEEDS]    (some minutes; `--figure` draws it alone)

* draws: n springs side by side, every step's draw of each from its positions; mean, variance and fourth
  moment of all, with their standard errors, and the seconds that engine and statistics take;
* false alarms: verdicts of right thermostats over seeds 1, 2, ... in their order, none left out;
* files: random springs, steps, frictions and temperatures, 1,000 frames each, identified with nothing stated.

Printed by `thermostats.py 40` on two cores that many others used as well, hence two times for each:

    draws
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
    false alarms
      40 seeds of 8 schemes: 0 runs failed; 1600 chances,
        the smallest 3.0e-03; below a level lie 1.06 of 0.1, 0.88 of 0.01, 0.00 of 0.001
    files
      400 files: 102 named, 282 listed, 16 nothing said, 0 WRONG NAME, 0 missing in the list
      omega of BAOAB and BAOA: off by 2e-15 (median), 2e-13 at most
"""

from __future__ import annotations

from pathlib import Path
from time import perf_counter, process_time

import numpy as np

import springcheck
from arguments import arguments, script
from springcheck import checks, driver, engines
from springcheck.bath import THERMOSTATS, Law
from springcheck.engines.contract import Label
from springcheck.identify.bath_states import identify_thermal
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring

H, M, K, RATE, THERMAL = 0.35, 3.7, 2.9, 0.8, 1.7
MANY_DRAWS = 200_000_000
"""Their variance has a standard error of 1e-4."""
FIGURE = Path(__file__).parents[1] / "data" / "figures" / "thermostats.png"


def springs(
    n: int,
    steps: int,
    *,
    h: float = H,
    m: float = M,
    k: float = K,
    rate: float = RATE,
    in_space: bool = False,
) -> Scene:
    """So many equal springs in a bath, none of whose numbers is 1; in space three of each particle."""
    walls = WallSpring(i=np.arange(n), k=np.full(n, k), at=np.zeros(n))
    return Scene(
        m=np.full(n, m), q=np.full(n, 0.3), p=np.full(n, 0.2), terms=(walls,), step=h, steps=steps,
        bath=Bath(temperature=THERMAL, friction=rate), name="springs",
        places=np.arange(n) if in_space else None,
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
    simulation = engines.Started(springs(n, steps, in_space=True), engines.parse(label), 7)
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


def false_alarms(seeds: int) -> None:
    """Chances of right thermostats over many seeds."""
    names = ("baoab", "baoa", "obabo", "gj-i", "bbk", "gj-i-half", "lammps-langevin", "andersen")
    scene, found, failed = springs(3, 300), [], 0
    for seed in range(1, seeds + 1):
        for name in names:
            run = driver.run(scene, Label(engine="own", method=name), seed=seed)
            verdicts = checks.judge(scene, run)
            failed += any(v.passed is False for v in verdicts)
            found += [v.value for v in verdicts if v.passed is not None and v.unit.startswith("decades")]
    chances = 10.0 ** -np.array(found)
    below = ", ".join(f"{np.mean(chances < x) / x:.2f} of {x:g}" for x in (0.1, 0.01, 0.001))
    print(
        f"  {seeds} seeds of {len(names)} schemes: {failed} runs failed; {len(chances)} chances, the "
        f"smallest {chances.min():.1e}; below a level lie {below}"
    )


def files(number: int) -> None:
    """Random files of every family, and what is said of them."""
    rng, names = np.random.default_rng(20261122), [x for x in THERMOSTATS if x != "andersen-leapfrog"]
    tally = dict.fromkeys(("named", "listed", "nothing said", "WRONG NAME", "missing in the list"), 0)
    digits = []
    for i in range(number):
        name = names[i % len(names)]
        m, w = rng.uniform(0.3, 9), np.exp(rng.uniform(-2, 3))
        x, turn = rng.uniform(0.02, 0.9), rng.uniform(0.1, 1)
        if name == "euler-maruyama":
            turn = min(turn, 0.5 * x)
        scene = springs(1, 1000, h=turn / w, m=m, k=m * w * w, rate=x * w / turn)
        run = driver.run(scene, Label(engine="own", method=name), seed=int(rng.integers(1, 10**8)))
        found = identify_thermal(run.t, run.q[:, 0], run.p[:, 0] / m)
        if found is None or not found.candidates:
            tally["nothing said"] += 1
        elif found.named:
            right = found.candidates[0].scheme == name
            tally["named" if right else "WRONG NAME"] += 1
        else:
            kept = [y.scheme for y in found.candidates if y.nats < 20]
            tally["listed" if name in kept else "missing in the list"] += 1
        if found and name in ("baoab", "baoa") and found.candidates:
            digits.append(abs(found.candidates[0].omega / w - 1))
    print(f"  {number} files: " + ", ".join(f"{value} {word}" for word, value in tally.items()))
    print(f"  omega of BAOAB and BAOA: off by {np.median(digits):.0e} (median), {max(digits):.0e} at most")


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
    given = arguments(__doc__, seeds=60, figure=False)
    if not given.figure:
        print("draws")
        for label, n in (
            ("own:baoab", 30000), ("openmm:langevin-middle-bath", 30000), ("openmm:brownian", 30000),
            ("ase:langevin-baoab", 30000), ("lammps:gjf-1", 6000),
        ):  # fmt: skip
            if not engines.absence(label.partition(":")[0]):
                draws(label, n, MANY_DRAWS // n)
        print("false alarms")
        false_alarms(given.seeds)
        print("files")
        files(10 * given.seeds)
    print("figure")
    figure()


if __name__ == "__main__":
    script(main)
