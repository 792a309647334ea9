"""GROMACS' sd integrator names itself: a short trajectory of one restrained particle at 300 K.

Claim: from 1,000 frames in GROMACS' mixed precision, nothing stated but the mass, `springcheck identify`
names BAOA, its velocities half a step early, and omega to 1e-6.  GROMACS (2022.5 of Debian 12) does not
install by pip, so the frames are stored as data/reference/thermostats/gromacs-sd.csv.

Run:   python validation/gromacs_sd.py         (what the stored frames say)
       python validation/gromacs_sd.py write   (with `gmx`: the frames anew, in seconds)
"""

import csv
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck import identify

HERE = Path(__file__).parents[1] / "data" / "reference" / "thermostats" / "gromacs-sd.csv"

MASS, STIFFNESS, STEP, TAU, FRAMES = 12.011, 20000.0, 0.01, 0.1, 1000
"""u, kJ/mol/nm2, ps, ps (1/friction), and frames."""

TOPOLOGY = f"""[ defaults ]
1 1 no 1.0 1.0
[ atomtypes ]
X {MASS} 0.0 A 0.0 0.0
[ moleculetype ]
X 0
[ atoms ]
1 X 1 X X 1 0.0 {MASS}
[ position_restraints ]
1 1 {STIFFNESS} {STIFFNESS} {STIFFNESS}
[ system ]
one
[ molecules ]
X 1
"""

COORDINATES = "one\n    1\n    1X      X    1{:8.3f}{:8.3f}{:8.3f}\n   4.00000   4.00000   4.00000\n"

PARAMETERS = f"""integrator = sd
dt = {STEP}
nsteps = {FRAMES - 1}
nstxout = 1
nstvout = 1
nstlog = 0
nstenergy = 0
cutoff-scheme = verlet
comm-mode = none
tc-grps = system
tau-t = {TAU}
ref-t = 300
gen-vel = yes
gen-temp = 300
gen-seed = 7
ld-seed = 42
refcoord-scaling = no
"""

FRAME_BYTES, HEAD, FROM = 144, 84, 36
"""Bytes of a .trr frame of one particle, of its head, and of the box before positions and velocities."""


def frames() -> np.ndarray:
    """Positions and velocities along x (f, 2), in float32 as GROMACS writes them."""
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        (at / "topol.top").write_text(TOPOLOGY)
        (at / "conf.gro").write_text(COORDINATES.format(0.02, 0.01, -0.015))
        (at / "rest.gro").write_text(COORDINATES.format(0, 0, 0))
        (at / "sd.mdp").write_text(PARAMETERS)
        for words in (
            "grompp -f sd.mdp -c conf.gro -r rest.gro -p topol.top -o sd.tpr -maxwarn 5",
            "mdrun -s sd.tpr -deffnm sd -ntmpi 1 -ntomp 1 -nb cpu",
        ):
            subprocess.run(["gmx", *words.split()], cwd=at, check=True, capture_output=True)
        raw = np.frombuffer((at / "sd.trr").read_bytes(), ">u1").reshape(-1, FRAME_BYTES)
    numbers = raw[:, HEAD + FROM :].copy().view(">f4")
    x, v = numbers[:, 0].astype(np.float64), numbers[:, 3].astype(np.float64)
    # positions are put back into the box of 4 nm
    return np.stack([np.where(x > 2, x - 4, x), v], axis=1)


def main() -> int:
    """Write, or name what is stored."""
    if arguments(__doc__, what=("name", "write")).what == "write":
        with HERE.open("w", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(("t", "q", "v"))
            for i, (x, v) in enumerate(frames()):
                rows.writerow((f"{i * STEP:.2f}", f"{x:.9g}", f"{v:.9g}"))
    found: Any = identify(HERE, mass=MASS)
    (found,) = found.values()
    print(found)
    omega = np.sqrt(STIFFNESS / MASS)
    print(f"omega is {omega:.6f}: off by {abs(found.omega[0] / omega - 1):.1e}")
    return 0 if found.scheme == "baoa" else 1


if __name__ == "__main__":
    script(main)
