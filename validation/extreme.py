"""The atlas of extreme cases: the README's windows and its figure.

Claim: over every method and thousands of cells from 1e-300 to 1e300 no result is wrong without a named
reason; and what is called right is right: cells of four methods, each run alone, against the scheme's own
motion in 60 digits.

Command: python validation/extreme.py [FOLDER]       (default: figures; about two minutes)

Printed: 10602 cells, 6427 right, 2025 unstable as theory says, 2145 at an engine's limit, 5 not measured
(single precision may round as far as a step goes), none silently wrong; 38 inputs that make no sense are
refused in a line: scene files, and scenes that a method cannot serve.
Right at h w from 0.01 to 1.9 for forces between 1e-300 and 1e300, all that is tried there: the own
methods; 1e-11 and 1e300: ASE (its forces are kept while nothing moves by more than 1e-15); 1e-150 and
1e150: OpenMM on Reference and CPU (it squares lengths); 1e-2 and 1e8: OpenMM on OpenCL in every
precision mode; 1e-200 and 1e300: CVODE.

    ase:velocity-verlet: 462 cells that are right, each alone: off by 8.6e-15 at most, 0 wrong
    own:semi-implicit-euler: 528 cells that are right, each alone: off by 5.1e-15 at most, 0 wrong
    openmm:verlet: 474 cells that are right, each alone: off by 1.3e-07 at most, 0 wrong
    openmm:leapfrog: 474 cells that are right, each alone: off by 1.2e-07 at most, 0 wrong

(OpenMM rebuilds velocities from positions, to eps/(h w) of them, and h w is 1e-8 there.)
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import mpmath
import numpy as np

import long_cells
import solver_cells
from arguments import arguments, script
from springcheck import driver, engines, schemes
from springcheck.errors import SpringcheckError
from springcheck.physics.scenefile import parse
from springcheck.studies.extremes import STUDY, grid
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.extremes.judging import Cell

ALONE = ("ase:velocity-verlet", "own:semi-implicit-euler", "openmm:verlet", "openmm:leapfrog")
SMALL = 1e-13
"""Error of 20 steps from which a cell is wrong, relative to the amplitude."""


SPRING = """
title = "A spring"
[[particle]]
mass = 3.7
position = 0.3
momentum = 0.7
[[spring]]
ends = ["wall", 0]
stiffness = 2.9
[time]
step = 0.1
steps = 20
"""

CHANGES = (
    ("mass = 3.7", "mass = 0.0"), ("mass = 3.7", "mass = -3.7"), ("mass = 3.7", "mass = nan"),
    ("mass = 3.7", "mass = inf"), ("mass = 3.7", 'mass = "3.7"'), ("mass = 3.7", "mass = 1e400"),
    ("position = 0.3", "position = nan"), ("position = 0.3", "position = -inf"),
    ("momentum = 0.7", "momentum = inf"), ("stiffness = 2.9", "stiffness = nan"),
    ("stiffness = 2.9", "stiffness = 1e999"), ("stiffness = 2.9", "stifness = 2.9"),
    ('ends = ["wall", 0]', 'ends = ["wall", 1]'), ('ends = ["wall", 0]', 'ends = ["wall", "wall"]'),
    ("step = 0.1", "step = 0.0"), ("step = 0.1", "step = inf"), ("step = 0.1", "step = nan"),
    ("steps = 20", "steps = 0"), ("steps = 20", "steps = -1"), ("steps = 20", "steps = 2.5"),
    ("steps = 20", "steps = 20\ntolerance = 0.0"), ("steps = 20", "steps = 20\ntolerance = 1.0"),
)  # fmt: skip
"""What makes no scene of it."""


def refusals() -> dict[str, str]:
    """Input that must be refused, and the line that says so; "" where it was taken without a word."""
    found = {}
    for old, new in CHANGES:
        found[f"{new} instead of {old}"] = _said(partial(parse, SPRING.replace(old, new), name="extreme"))
    braked = parse(SPRING + "[[damping]]\nparticle = 0\ncoefficient = 0.37\n", name="braked")
    for label in engines.match(("*",)):
        for scene in (parse(SPRING, name="spring"), braked):
            if engines.refusal(scene, label) and not engines.absence(label.engine):
                short = replace(scene, steps=1, every=1)
                found[f"{scene.name} by {label}"] = _said(partial(driver.run, short, label))
    return found


def _said(call: Callable[[], object]) -> str:
    try:
        call()
    except SpringcheckError as error:
        return str(error)
    return ""


def off_alone(cell: Cell) -> float:
    """The error of a cell's last frame, run alone, beside its amplitude: by a scheme of kicks and drifts."""
    method = engines.method(engines.parse(cell.method))
    values = {name: cell.parameters[name] for name in ("m", "k", "q", "p", "h")}
    spec = grid.Spec(block=cell.block, steps=int(cell.parameters["steps"]), **values)
    with np.errstate(all="ignore"):
        run = driver.run(grid.scene([spec], method.requires), cell.method)
    if len(run.t) <= spec.steps:
        return np.inf
    with mpmath.workdps(60):
        m, k, q, p, h = (mpmath.mpf(x) for x in values.values())
        scale = mpmath.sqrt(abs(k) * m) or m / abs(h * spec.steps)
        size = abs(scale * q) + abs(p)
        for _ in range(spec.steps):
            for kind, c in schemes.scheme(method.scheme).stages:
                ch: Any = h * c.numerator / c.denominator if not isinstance(c, str) else h * mpmath.mpf(c)
                if kind == "kick":
                    p = p - ch * k * q
                else:
                    q = q + ch * p / m
            size = max(size, abs(scale * q) + abs(p))
        off = scale * abs(mpmath.mpf(float(run.q[-1, 0])) - q) + abs(mpmath.mpf(float(run.p[-1, 0])) - p)
        return float(off / size) if size else float(off)


def alone(cells: Sequence[Cell]) -> int:
    """Print what the cells that are called right come to alone; how many of them are wrong."""
    wrong = 0
    for label in ALONE:
        right = [c for c in cells if c.method == label and c.outcome == "right" and c.block != "length"]
        rebuilds = engines.method(engines.parse(label)).rebuilds_velocity
        found = [(off_alone(cell), cell) for cell in right]
        limits = [SMALL * (1 + rebuilds / (cell.parameters["h_w"] or 1)) for cell in right]
        bad = [cell for (off, cell), limit in zip(found, limits, strict=True) if not off <= limit]
        most = max((off for off, _ in found), default=0.0)
        said = f"off by {most:.1e} at most, {len(bad)} wrong"
        print(f"{label}: {len(right)} cells that are right, each alone: {said}")
        wrong += len(bad)
    return wrong


def main() -> int:
    """Print counts, reasons and windows, and draw the atlas; 1 where a cell is silently wrong."""
    folder = arguments(__doc__, folder=Path("figures")).folder
    began = time.perf_counter()
    atlas = extremes.record()
    every = (*atlas.cells, *solver_cells.cells(), *long_cells.cells())
    atlas = replace(atlas, cells=every, windows=tuple(extremes.windows(every)))
    print(f"{len(atlas.cells)} cells in {time.perf_counter() - began:.0f} s: {dict(atlas.counts())}")
    for window in atlas.windows:
        print(window.sentence)
    for left in (x for x in atlas.left_out if x.method not in {cell.method for cell in every}):
        print(f"left out {left.method}: {left.reason}")
    for cell in atlas.wrong:
        print(f"silently wrong: {cell}")
    for path in STUDY.draw(atlas, folder):
        print(path)
    answers = refusals()
    taken = [what for what, said in answers.items() if not said]
    print(f"{len(answers)} inputs that must be refused; taken without a word: {', '.join(taken) or 'none'}")
    wrong = alone(atlas.cells)
    return 0 if atlas.passed and not wrong and not taken else 1


if __name__ == "__main__":
    script(main)
