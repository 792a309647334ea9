"""The atlas of extreme cases: what is called right is right, by the scheme's motion in 60 digits.

Claim: over every default method and thousands of cases from 1e-300 to 1e300 no result is wrong without a
named reason; and the cases of four methods that are called right, each run alone, agree with the scheme's own
motion in 60 digits.

Command: python validation/extreme.py       (about a minute)

Expected: none silently wrong; `ase:velocity-verlet` and `own:semi-implicit-euler` wrong by at most 1e-14 of
the amplitude, OpenMM's Verlet methods by 2e-7, since they rebuild velocities from positions, to eps/(h w),
and h w is 1e-8 there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mpmath
import numpy as np

from arguments import arguments, script
from springcheck import driver, engines, schemes
from springcheck.studies.extremes import grid
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.extremes.judging import Cell

ALONE = ("ase:velocity-verlet", "own:semi-implicit-euler", "openmm:verlet", "openmm:leapfrog")
SMALL = 1e-13
"""Error of 20 steps from which a cell is wrong, relative to the amplitude."""


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
        right = [c for c in cells if c.method == label and c.outcome == "right" and c.block != "stiff"]
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
    """Print counts and ranges; 1 where a case is silently wrong."""
    arguments(__doc__)
    atlas = extremes.record()
    print(f"{len(atlas.cells)} cases: {dict(atlas.counts())}")
    for window in atlas.windows:
        print(f"{window.method}: right for forces from {window.low:.0e} to {window.high:.0e}")
    for cell in atlas.wrong:
        print(f"silently wrong: {cell}")
    return int(not atlas.passed or bool(alone(atlas.cells)))


if __name__ == "__main__":
    script(main)
