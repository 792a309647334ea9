"""ASE keeps its forces while no position moves by more than 1e-15.

Claim: a calculator of ASE returns the forces that it has until some coordinate of some atom differs by more
than 1e-15 (absolute, in the unit of the positions: `compare_atoms(..., tol=1e-15)`) from where they were
computed.  A step of h overlooks an atom with h |v| < 1e-15, so that a spring of amplitude A and frequency w
is on a wrong course from A w h of some 1e-13 down: near its turning points first, and everywhere from
A w h = 1e-15 on.  The same steps in Python with that one rule give every count.  A neighbour that moves more
brings all forces up to date, so that small and large atoms side by side show nothing.

Command: python validation/ase_small_moves.py          (ASE alone, without springcheck; 2 s)

Expected (ase 3.29.0; m = k = 1, h = 0.1, 200 steps of VelocityVerlet, positions in Angstrom):

    amplitude   kept   by the rule   largest error, of A   beside a neighbour of amplitude 1
        1e+00      0             0                     0                                   0
        1e-11      0             0                     0                                   0
        1e-12      2             2               0.00016                                   0
        1e-13     16            16                0.0027                                   0
        1e-14     98            98                  0.31                                   0
        1e-15    173           173                   4.8                                   0
        1e-16    180           180                    41                                   0

Exit status 0 while this holds of the installed ASE, 1 otherwise.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import ase
import numpy as np
from ase import Atoms
from ase.calculators.calculator import Calculator, all_changes
from ase.md.verlet import VelocityVerlet

from arguments import arguments, script

STEP, STEPS, LIMIT = 0.1, 200, 1e-15
AMPLITUDES = (1.0, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15, 1e-16)


class Spring(Calculator):  # type: ignore[misc]
    """Springs of stiffness 1 to x = 0; it counts how often ASE asks."""

    implemented_properties: ClassVar[list[str]] = ["forces"]
    calls = 0

    def calculate(
        self, atoms: Any = None, properties: Any = ("forces",), system_changes: Any = all_changes
    ) -> None:
        """What ASE calls where it takes the atoms for changed."""
        super().calculate(atoms, properties, system_changes)
        self.calls += 1
        self.results["forces"] = -self.atoms.positions


def by_ase(amplitudes: list[float]) -> tuple[list[float], int]:
    """Positions of the first atom after each step, and in how many steps ASE computed no force."""
    positions = np.zeros((len(amplitudes), 3))
    positions[:, 0] = amplitudes
    atoms = Atoms(numbers=[0] * len(amplitudes), positions=positions, masses=[1.0] * len(amplitudes))
    atoms.calc = Spring()
    dynamics = VelocityVerlet(atoms, timestep=STEP)
    found = []
    for _ in range(STEPS):
        dynamics.run(1)
        found.append(float(atoms.positions[0, 0]))
    # one call for the start, and one a step
    return found, STEPS + 1 - atoms.calc.calls


def by_hand(x: float, limit: float) -> tuple[list[float], int]:
    """The same steps in Python, with the force kept while x moves by no more than a limit."""
    v, at, kept, found = 0.0, x, 0, []
    for _ in range(STEPS):
        v += 0.5 * STEP * -at
        x += STEP * v
        if abs(x - at) > limit:
            at = x
        else:
            kept += 1
        v += 0.5 * STEP * -at
        found.append(x)
    return found, kept


def main() -> int:
    """Print the table; the exit status is 1 where ASE does otherwise."""
    arguments(__doc__)
    status = 0
    print(f"ase {ase.__version__}; m = k = 1, h = {STEP}, {STEPS} steps")
    print("amplitude   kept   by the rule   largest error, of A   beside a neighbour of amplitude 1")
    for amplitude in AMPLITUDES:
        right, _ = by_hand(amplitude, 0.0)
        _, predicted = by_hand(amplitude, LIMIT)
        alone, kept = by_ase([amplitude])
        beside, _ = by_ase([amplitude, 1.0])
        off, other = (
            max(abs(a - b) for a, b in zip(one, right, strict=True)) / amplitude for one in (alone, beside)
        )
        print(f"{amplitude:9.0e} {kept:6} {predicted:13} {off:21.2g} {other:35.2g}")
        status |= kept != predicted or other != 0 or (off > 1e-5) != (kept > 0) or not math.isfinite(off)
    return int(status)


if __name__ == "__main__":
    script(main)
