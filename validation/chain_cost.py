"""What a step costs against the length of a chain, for every engine.

Claim: a step of the own method costs as many nanoseconds a mass for 1e6 masses as for 1e3, to the width of
the caches; at 1,000 masses it takes at most twice as long as a NumPy loop written for this chain alone.

Command: python validation/chain_cost.py                  (prints the table, 20 seconds)
         python validation/chain_cost.py -o FOLDER        (and writes chain-cost.csv and its figure there)

Expected: own 2 ns a mass and step at 1,000 masses and 3.5 at 1e6, NumPy's loop 4.4 and 3.1; OpenMM 25; ASE
360 at 1,000 and 75 at 100,000; SUNDIALS 200 to 600 a force call.  None grows but by the caches.

Each figure is the least of five runs, in turn.  The chain is that of the scene long-chain, by the text of
its file; the clock runs inside `advance` alone.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from matplotlib.figure import Figure

from arguments import script
from springcheck import engines
from springcheck.figures import looks
from springcheck.figures.style import save, style
from springcheck.physics import scenefile as scenes
from springcheck.physics.scene import Scene

SIZES = (1_000, 10_000, 100_000, 1_000_000)
LABELS = {
    "own:semi-implicit-euler": 1_000_000,
    "openmm:verlet": 100_000,
    "ase:velocity-verlet": 100_000,
    "sundials:adams": 10_000,
}
"""Methods and the longest chain that each is given here."""
REPEATS = 5
WORK = 2_000_000
"""Masses times steps of one run, at least 5 steps."""


def chain(masses: int) -> Scene:
    """The scene long-chain with another number of masses."""
    text = (scenes.folder() / "long-chain.toml").read_text(encoding="utf-8")
    steps = max(5, WORK // masses)
    text = text.replace("masses = 1000", f"masses = {masses}").replace("steps = 2000", f"steps = {steps}")
    return scenes.parse(text.replace("every = 20", f"every = {steps}"), name=f"chain of {masses}")


def engine_seconds(scene: Scene, text: str) -> float:
    """Seconds of one run, all in one call, a force call where the engine chooses its own steps."""
    label = engines.parse(text)
    simulation = engines.load(label.engine).start(scene, engines.method(label), label, scene.step)
    q, p = np.empty((2, 1, scene.n))
    began = perf_counter()
    simulation.advance(scene.steps, q, p)
    seconds = perf_counter() - began
    return seconds * scene.steps / simulation.force_calls if engines.method(label).adaptive else seconds


def numpy_seconds(scene: Scene) -> float:
    """The same chain by a loop that a physicist writes with NumPy: kick, drift, no copies."""
    h, m, k = scene.step, scene.m[0], 2.9
    q, p = scene.q.copy(), scene.p.copy()
    stretch, force = np.empty(scene.n + 1), np.empty(scene.n)
    began = perf_counter()
    for _ in range(scene.steps):
        stretch[0], stretch[-1] = q[0], -q[-1]
        np.subtract(q[1:], q[:-1], out=stretch[1:-1])
        np.subtract(stretch[1:], stretch[:-1], out=force)
        force *= k * h
        p += force
        q += p * (h / m)
    return perf_counter() - began


def draw(rows: Sequence[tuple[str, int, float]], folder: Path) -> None:
    """Cost of a mass and step against the number of masses: a level line is a cost linear in their number."""
    with style():
        figure = Figure(figsize=(6.4, 4.2), layout="constrained")
        axes = figure.add_subplot()
        for name in dict.fromkeys(row[0] for row in rows):
            mine = [(masses, each) for label, masses, each in rows if label == name]
            look, mark = looks.look(looks.scheme_of(name)), looks.mark(looks.engine(name))[0]
            axes.plot(
                *zip(*mine, strict=True), color=look.color, linestyle=look.linestyle, marker=mark, label=name
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("masses in the chain")
        axes.set_ylabel("nanoseconds a mass and step")
        axes.set_title("A level line is a cost linear in the number of masses")
        axes.legend(frameon=False)
        save(figure, folder, "chain-cost")


def main() -> int:
    """Print the table; returns 1 where the own method is more than twice as slow as NumPy at 1,000 masses."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FOLDER", help="for chain-cost.csv, .png and .svg"
    )
    options = parser.parse_args()
    rows: list[tuple[str, int, float]] = []
    print(f"{'nanoseconds a mass and step':30}" + "".join(f"{masses:>12,}" for masses in SIZES))
    methods = {"a NumPy loop": SIZES[-1], **LABELS}
    best: dict[tuple[str, int], float] = {}
    for masses in SIZES:
        scene = chain(masses)
        for _ in range(REPEATS):
            for name, most in methods.items():
                if masses <= most and not (name in LABELS and engines.absence(name.partition(":")[0])):
                    seconds = numpy_seconds(scene) if name not in LABELS else engine_seconds(scene, name)
                    each = seconds / masses / scene.steps * 1e9
                    best[name, masses] = min(best.get((name, masses), np.inf), each)
    for name in methods:
        cells = [best.get((name, masses)) for masses in SIZES]
        print(f"{name:30}" + "".join(f"{'-' if x is None else format(x, '.3g'):>12}" for x in cells))
        rows += [(name, n, x) for n, x in zip(SIZES, cells, strict=True) if x is not None]
    if options.output:
        draw(rows, options.output)
        with (options.output / "chain-cost.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([("method", "masses", "nanoseconds"), *rows])
    ratio = best["own:semi-implicit-euler", 1000] / best["a NumPy loop", 1000]
    print(f"own beside NumPy at 1,000 masses: {ratio:.2f}")
    return int(ratio > 2)


if __name__ == "__main__":
    script(main)
