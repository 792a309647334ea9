"""GROMACS: md-vv-avek takes the velocities of the start for those of half a step before, md-vv does not."""

import subprocess
import tempfile
from pathlib import Path

m, k, h, x, v = 3.7, 2.9, 0.1, 0.3, 0.2
folder = Path(tempfile.mkdtemp())
for name, at, speed in (("start", x, v), ("wall", 0, 0)):
    places = f"{at:18.12f}{0:18.12f}{0:18.12f}{speed:18.13f}{0:18.13f}{0:18.13f}"
    (folder / f"{name}.gro").write_text(f"one\n1\n    1M        X    1{places}\n 9 9 9\n")
(folder / "in.top").write_text(
    "[ defaults ]\n1 1\n[ atomtypes ]\nX 1 1 0 A 0 0\n[ moleculetype ]\nM 1\n[ atoms ]\n"
    f"1 X 1 M X 1 0 {m}\n[ position_restraints ]\n1 1 {k} 0 0\n[ system ]\none\n[ molecules ]\nM 1\n"
)
for integrator in ("md-vv", "md-vv-avek"):
    more = "nsttcouple = 1\nnstpcouple = 1\nrlist = 1\nrvdw = 1\nrcoulomb = 1\ncomm-mode = none\n"
    (folder / "in.mdp").write_text(f"integrator = {integrator}\ndt = {h}\nnsteps = 1\n{more}")
    commands = "gmx grompp -f in.mdp -c start.gro -r wall.gro -p in.top -o in.tpr -maxwarn 9"
    commands += " && gmx mdrun -s in.tpr -c out.g96 -ntmpi 1 -ntomp 1 -nb cpu"
    subprocess.run(commands, shell=True, cwd=folder, check=True, capture_output=True)
    found = float((folder / "out.g96").read_text().split("VELOCITY\n")[1].split()[4])
half = [v - kicks * h / 2 * k / m * x for kicks in (1, 2)]
promised, law = (u - h / 2 * k / m * (x + h * u) for u in half)
print(f"measured {found:.6f} law {law:.6f} uncertainty 2e-6 promised {promised:.6f}")
