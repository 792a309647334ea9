"""ASE: momenta under FixInternals lose all drift and rotation at every step.  pip install ase"""

import numpy as np
from ase import Atoms
from ase.calculators.calculator import Calculator
from ase.constraints import FixInternals
from ase.md.verlet import VelocityVerlet


class Nothing(Calculator):
    """No force acts."""

    implemented_properties = ("energy", "forces")

    def calculate(self, *arguments, **options):
        super().calculate(*arguments, **options)
        self.results = {"energy": 0.0, "forces": np.zeros((len(self.atoms), 3))}


atoms = Atoms("OH2", [(0, 0, 0), (0.76, 0.59, 0), (-0.76, 0.59, 0)], calculator=Nothing())
atoms.set_velocities(np.tile([0, 0, 0.01], (3, 1)))  # it drifts across its plane, as a free water does
before = atoms.get_kinetic_energy()
atoms.set_constraint(FixInternals(bonds=[[None, [0, 1]], [None, [0, 2]]], epsilon=1e-12))
VelocityVerlet(atoms, timestep=0.1).run(1)
measured = atoms.get_kinetic_energy() / before
# one translation and two rotations are taken off, which are all that three atoms can do across a plane
print(f"measured {measured:.16f} law 0 uncertainty 1e-15 promised 1")
