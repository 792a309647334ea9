"""One spring system in ASE: `Atoms` with a short calculator of springs, moved by ase.md.

ASE counts length in A, energy in eV, mass in u, so that its time unit is A sqrt(u/eV), 10.18 fs.
Reduced scenes map to these one to one; "md" scenes (nm, ps, u) are converted at this border by the
two constants below.  No energy constant takes part: u (nm/ps)**2 is converted by lengths and times,
so the motion cannot depend on the rounding of the mole.
"""

from __future__ import annotations

import warnings
from typing import Any, ClassVar

import ase.units
import numpy as np
from ase import Atoms
from ase.calculators.calculator import Calculator, all_changes
from ase.md.verlet import VelocityVerlet

from springcheck.engines.contract import Label, Method
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.system import System

NANOMETRE = 10.0 * ase.units.Ang
PICOSECOND = 1000.0 * ase.units.fs


def version() -> dict[str, str]:
    """Version of ASE."""
    return {"ase": ase.__version__}


def arithmetic(label: Label) -> Arithmetic:
    """NumPy's double precision; `compare_atoms` takes positions within 1e-15 of each other for the same."""
    return Arithmetic(stale=1e-15)


class Springs(Calculator):  # type: ignore[misc]
    """The terms of a scene along x, as an ASE calculator.  `length` and `time` are the scene's units."""

    implemented_properties: ClassVar[list[str]] = ["energy", "forces"]

    def __init__(self, system: System, length: float, time: float) -> None:
        super().__init__()
        self.force_calls = 0
        self._system = system
        self._length = length
        self._of_force = length / time**2

    def calculate(
        self, atoms: Any = None, properties: Any = ("energy",), system_changes: Any = all_changes
    ) -> None:
        super().calculate(atoms, properties, system_changes)
        x = self.atoms.positions[:, 0]
        q = x if self._length == 1.0 else x / self._length
        if "forces" in properties:
            self.force_calls += 1
            forces = np.zeros((len(q), 3))
            forces[:, 0] = self._system.force(q, q)
            if self._of_force != 1.0:
                forces *= self._of_force
            self.results["forces"] = forces
        if "energy" in properties:
            energy = sum(float(term.energy(q)) for term in self._system.terms)
            self.results["energy"] = energy * self._of_force * self._length


class _Dynamics:
    """ASE's dynamics in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        length, time = (NANOMETRE, PICOSECOND) if scene.units == "md" else (1.0, 1.0)
        positions, momenta = np.zeros((2, scene.n, 3))
        positions[:, 0] = scene.q * length
        momenta[:, 0] = scene.p * (length / time)
        numbers = np.zeros(scene.n, dtype=int)
        self._atoms = Atoms(numbers=numbers, positions=positions, masses=scene.m, momenta=momenta)
        self._atoms.calc = Springs(scene.system, length, time)
        self._dynamics = VelocityVerlet(self._atoms, timestep=step * time)
        self._length, self._momentum = length, length / time
        self.off_axis = 0.0

    @property
    def force_calls(self) -> int:
        """Forces that ASE asked for."""
        return int(self._atoms.calc.force_calls)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        atoms, run = self._atoms, self._dynamics.run
        # np.errstate would say the same, but slows down every NumPy call inside it: ASE by a tenth
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            for row in range(len(q)):
                run(every)
                q[row] = atoms.arrays["positions"][:, 0]
                p[row] = atoms.arrays["momenta"][:, 0]
            if self._length != 1.0:
                q /= self._length
                p /= self._momentum
        self.off_axis = max(self.off_axis, float(np.max(np.abs(atoms.positions[:, 1:]), initial=0.0)))


start = _Dynamics
