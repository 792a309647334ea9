"""ASE's Bussi thermostat never turns a velocity round.  pip install ase"""

import numpy as np
from ase import Atoms, units
from ase.calculators.calculator import Calculator
from ase.md.bussi import Bussi


class Free(Calculator):
    implemented_properties = ("energy", "forces")

    def calculate(self, atoms, properties, changes):
        self.results = {"energy": 0.0, "forces": np.zeros_like(atoms.positions)}


class Script:
    """The first normal number is -3, the sum of the squares of the others 1."""

    standard_gamma = lambda self, shape: 0.5  # noqa: E731
    standard_normal = lambda self, size=(): np.full(size, -3.0)  # noqa: E731


T, H, TAU = 300.0, 1.0, 2.0
atoms = Atoms("Ar", calculator=Free())
atoms.set_velocities([[0.01, 0, 0]])
energy, mean = atoms.get_kinetic_energy(), 1.5 * units.kB * T
Bussi(atoms, H, T, TAU, rng=Script()).step()
c = np.exp(-H / TAU)
b = (1 - c) * mean / 3 / energy
alpha = np.sqrt(c + b * (1 + 9) - 6 * np.sqrt(c * b)) * np.sign(-3 + np.sqrt(c / b))
measured = atoms.get_velocities()[0, 0] / 0.01
print(f"measured {measured:.15f} law {abs(alpha):.15f} uncertainty 1e-14 promised {alpha:.15f}")
