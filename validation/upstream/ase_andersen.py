"""ASE's Andersen thermostat is 5.6 % too hot at andersen_prob=0.1, for any step.  pip install ase"""

import numpy as np
from ase import Atoms, units
from ase.calculators.calculator import Calculator
from ase.md.andersen import Andersen

N, M, K, H, T, P = 20_000, 3.7, 2.9, 0.1, 300.0, 0.1  # u, eV/A2, ASE's unit of time, kelvin
KT = units.kB * T


class Springs(Calculator):
    implemented_properties = ("energy", "forces")

    def calculate(self, atoms, properties, changes):
        self.results = {"energy": K / 2 * (atoms.positions**2).sum(), "forces": -K * atoms.positions}


rng = np.random.RandomState(1)
atoms = Atoms(["H"] * N, positions=rng.normal(size=(N, 3)) * np.sqrt(KT / K), calculator=Springs())
atoms.set_masses([M] * N)
atoms.set_velocities(rng.normal(size=(N, 3)) * np.sqrt(KT / M))
dynamics = Andersen(atoms, H, temperature_K=T, andersen_prob=P, fixcm=False, rng=rng)
squares = np.zeros((N, 3))
for step in range(200 + 1500):  # 200 steps to forget the start at the right temperature
    dynamics.step()
    squares += (step >= 200) * atoms.positions**2 * K / KT / 1500
a = H * H * K / M
law, measured = (1 - P / 2) / ((1 - P) * (1 - a / 2)), squares.mean()
error, promised = squares.std() / np.sqrt(3 * N), 1 / (1 - a / 4)
print(f"measured {measured:.6f} law {law:.6f} uncertainty {error:.6f} promised {promised:.6f}")
