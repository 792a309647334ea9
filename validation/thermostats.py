"""Thermostats held against their laws: draws of four engines, false alarms over many seeds, files that name
themselves, and a figure of the two temperatures against the step.

Command: python validation/thermostats.py [figure]        (some minutes; `figure` draws it alone)

* draws: n springs side by side, every step's draw of each from its positions; mean, variance and fourth
  moment of all, with their standard errors, and the seconds that engine and statistics take;
* false alarms: verdicts of right thermostats over seeds 1, 2, ... in their order, none left out;
* files: random springs, steps, frictions and temperatures, 1,000 frames each, identified with nothing stated.

Printed by `thermostats.py 40` on two cores that others used as well:

    draws
      own:baoab                      2e+07 draws: mean -3.4e-04 +- 2e-04, variance 1 -9.8e-05 +- 3e-04,
        fourth 2.9991 +- 0.0022, 5 s
      openmm:langevin-middle-bath    2e+07 draws: mean +1.4e-04 +- 2e-04, variance 1 +2.7e-04 +- 3e-04,
        fourth 3.0013 +- 0.0022, 10 s
      openmm:brownian                2e+07 draws: mean +3.7e-04 +- 2e-04, variance 1 -3.7e-04 +- 3e-04,
        fourth 2.9995 +- 0.0022, 10 s
      ase:langevin-baoab             2e+07 draws: mean -3.9e-04 +- 2e-04, variance 1 +6.5e-05 +- 3e-04,
        fourth 3.0019 +- 0.0022, 28 s
      lammps:gjf-1                   4e+06 draws: mean +5.8e-04 +- 5e-04, variance 1 +1.5e-04 +- 7e-04,
        fourth 3.0037 +- 0.0049, 2 s
    false alarms
      40 seeds of 8 schemes: 0 runs failed; 1600 chances,
        the smallest 3.0e-03; below a level lie 1.06 of 0.1, 0.88 of 0.01, 0.00 of 0.001
    files
      400 files: 102 named, 282 listed, 16 nothing said, 0 WRONG NAME, 0 missing in the list
      omega of BAOAB and BAOA: off by 2e-15 (median), 2e-13 at most
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import perf_counter

import numpy as np

from springcheck import checks, driver, engines
from springcheck.engines.contract import Label
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.thermal import THERMOSTATS, Law
from springcheck.thermal.states import identify_thermal

H, M, K, RATE, THERMAL = 0.35, 3.7, 2.9, 0.8, 1.7
FIGURE = Path(__file__).parents[1] / "data" / "figures" / "thermostats.png"


def springs(n: int, steps: int, *, h: float = H, m: float = M, k: float = K, rate: float = RATE) -> Scene:
    """So many equal springs in a bath, none of whose numbers is 1."""
    walls = WallSpring(i=np.arange(n), k=np.full(n, k), at=np.zeros(n))
    return Scene(
        m=np.full(n, m), q=np.full(n, 0.3), p=np.full(n, 0.2), terms=(walls,), step=h, steps=steps,
        bath=Bath(temperature=THERMAL, friction=rate), name="springs",
    )  # fmt: skip


def law(scheme: str, h: float = H, rate: float = RATE) -> Law:
    """The law of a scheme on one of them."""
    return Law(scheme=THERMOSTATS[scheme], h=h, m=np.array([M]), k=np.array([K]), rate=rate, thermal=THERMAL)


def draws(label: str, n: int, steps: int) -> None:
    """Moments of the draws of a method of one draw a step, from its positions."""
    method = engines.method(engines.parse(label))
    known = law(method.scheme)
    A, g = known.A[0].astype(float), float(known.G[0, 0, 0])
    began = perf_counter()
    simulation = engines.start(springs(n, steps), engines.parse(label), 7)
    q, p = np.empty((2, 1, n))
    old = np.full(n, 0.3), np.full(n, 0.2)
    sums = np.zeros(3)
    for _ in range(steps):
        simulation.advance(1, q, p)
        xi = (q[0] - A[0, 0] * old[0] - A[0, 1] * old[1]) / g
        square = xi * xi
        sums += xi.sum(), square.sum(), (square * square).sum()
        old = q[0].copy(), p[0].copy()
    total = n * steps
    mean, variance, fourth = sums / total
    print(
        f"  {label:30} {total:.0e} draws: mean {mean:+.1e} +- {total**-0.5:.0e}, "
        f"variance 1 {variance - 1:+.1e} "
        f"+- {(2 / total) ** 0.5:.0e}, fourth {fourth:.4f} +- {(96 / total) ** 0.5:.4f}, "
        f"{perf_counter() - began:.0f} s"
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


MARKS = (
    ("own:baoab", "o"), ("own:obabo", "o"), ("own:oabao", "o"), ("own:aboba", "o"), ("own:bbk", "o"),
    ("openmm:langevin-middle-bath", "s"), ("openmm:andersen", "s"), ("ase:langevin", "^"),
    ("ase:langevin-baoab", "^"), ("ase:andersen", "^"), ("lammps:langevin", "D"), ("lammps:gjf-1", "D"),
)  # fmt: skip


def figure() -> None:
    """Configurational and kinetic temperature against h w: laws as lines, engines as marks."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt
    from matplotlib.lines import Line2D

    w = np.sqrt(K / M)
    turns = np.linspace(0.02, 1.5, 120)
    schemes = list(dict.fromkeys(engines.method(engines.parse(label)).scheme for label, _ in MARKS))
    colours = dict(zip(schemes, plt.colormaps["tab20"](np.linspace(0, 1, len(schemes))), strict=True))
    panels, axes = plt.subplots(1, 2, figsize=(11, 5.2), sharex=True, sharey=True)
    rate = 0.4 * w
    for scheme in schemes:
        laws = [law(scheme, h=x / w, rate=rate) for x in turns]
        style = ("-", "--", "-.", ":")[schemes.index(scheme) % 4]
        for axis, values in zip(axes, ("configurational", "kinetic"), strict=True):
            heights = [getattr(one, values)[0] for one in laws]
            axis.plot(turns, heights, style, color=colours[scheme], lw=1.4, label=scheme)
    n, steps = 4000, 300
    for label, mark in MARKS:
        if engines.absence(label.partition(":")[0]):
            continue
        scheme = engines.method(engines.parse(label)).scheme
        for turn in (0.4, 0.8, 1.2):
            scene = springs(n, steps, h=turn / w, rate=rate)
            simulation = engines.start(scene, engines.parse(label), 7)
            q, p = np.empty((2, 40, n))
            simulation.advance(2, q, p)
            simulation.advance(5, q, p)
            found = K * np.mean(q * q) / THERMAL, np.mean(p * p) / (M * THERMAL)
            for axis, value in zip(axes, found, strict=True):
                axis.plot(turn, value, mark, color=colours[scheme], ms=6, mfc="none", mew=1.2)
    for axis, title in zip(axes, ("configurational: k<q$^2$>/kT", "kinetic: <p$^2$>/m kT"), strict=True):
        axis.set(title=title, xlabel="h $\\omega$", ylim=(0.4, 1.8), xlim=(0, 1.5))
        axis.axhline(1, color="0.6", lw=0.6, zorder=0)
    axes[0].set_ylabel("temperature over that of the bath")
    marks = {"own": "o", "OpenMM": "s", "ASE": "^", "LAMMPS": "D"}
    handles = [Line2D([], [], marker=m, color="0.3", mfc="none", ls="") for m in marks.values()]
    axes[1].legend(handles, list(marks), fontsize=8, frameon=False, loc="upper left")
    panels.suptitle(
        "Thermostats on a spring: laws as lines, engines as marks (friction 0.4 $\\omega$)", fontsize=11
    )
    panels.tight_layout(rect=(0, 0.1, 1, 1))
    panels.legend(
        *axes[0].get_legend_handles_labels(), fontsize=8, frameon=False, ncols=6, loc="lower center"
    )
    panels.savefig(FIGURE, dpi=110)
    print(f"  {FIGURE.name} written")


def main() -> None:
    """All of it, or the figure alone."""
    if sys.argv[1:] != ["figure"]:
        print("draws")
        for label, n in (
            ("own:baoab", 20000), ("openmm:langevin-middle-bath", 20000), ("openmm:brownian", 20000),
            ("ase:langevin-baoab", 20000), ("lammps:gjf-1", 4000),
        ):  # fmt: skip
            if not engines.absence(label.partition(":")[0]):
                draws(label, n, 1000)
        print("false alarms")
        false_alarms(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
        print("files")
        files(10 * (int(sys.argv[1]) if len(sys.argv) > 1 else 60))
    print("figure")
    figure()


if __name__ == "__main__":
    main()
