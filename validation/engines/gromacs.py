"""GROMACS, by its files and `gmx`: position restraints for springs; md, md-vv and sd."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from springs import SPRINGS, Batch, called, placed

from springcheck.engines import Engine, named
from springcheck.engines.contract import by_name, thermostat
from springcheck.formats.molecular import read_trr
from springcheck.physics.arrays import Arithmetic

BOLTZMANN = 0.00831446261815324  # kJ/mol/K
INPUT = (
    "integrator = {integrator}; dt = {step!r}; nsteps = {steps}; nstxout = 1; nstvout = 1; "
    "nstlist = 1000000000; nstcalcenergy = 1000000; nsttcouple = 1; nstpcouple = 1; "
    "verlet-buffer-tolerance = -1; rlist = 1; rcoulomb = 1; rvdw = 1; comm-mode = none; "
)
TOPOLOGY = "[ defaults ]\n1 1 no 1 1\n[ atomtypes ]\nX 1 1 0 A 0 0\n"


def shift(scene: Any) -> float:
    """Offset of the positions in the files: gmx wraps negative ones into the box."""
    return 8.0 if np.any(scene.q < 0) else 0.0


def files(folder: Path, scene: Any, name: str, step: float, steps: int, seed: int) -> None:
    """What gmx reads: each particle is a molecule."""
    x, v, pull, at = placed(scene)
    m = scene.masses
    if name == "md-vv-avek":
        v += step / 2 * pull / m[:, None] * (x - at)
    for file, place in (("start", x + shift(scene)), ("walls", at + shift(scene))):
        rows = (f"{1:5d}M        X{1:5d}" + "".join(f"{a:18.12f}" for a in (*one, *speed))
                for one, speed in zip(place, v, strict=True))  # fmt: skip
        (folder / f"{file}.gro").write_text("\n".join(["springs", str(len(m)), *rows, " 30 30 30", ""]))
    parts = [("atoms", f"X 1 M X {{n}} 0 {a!r}") for a in m.tolist()]
    held = [("position_restraints", f"1 {a!r} {b!r} {c!r}") for a, b, c in pull.tolist()]
    kinds = [
        "".join(f"[ {lines[i][0]} ]\n1 {lines[i][1].format(n=1)}\n" for lines in (parts, held))
        for i in range(len(m))
    ]
    known = list(dict.fromkeys(kinds))
    text = TOPOLOGY + "".join(f"[ moleculetype ]\nM{i} 1\n{kind}" for i, kind in enumerate(known))
    text += "[ system ]\nsprings\n[ molecules ]\n" + "".join(f"M{known.index(one)} 1\n" for one in kinds)
    (folder / "in.top").write_text(text)
    options = INPUT.format(integrator=name, step=step, steps=steps)
    if name == "sd":
        options += f"tc-grps = System; tau-t = {1 / scene.bath.friction!r}; ld-seed = {seed}; "
        options += f"ref-t = {scene.thermal / BOLTZMANN!r}"
    (folder / "in.mdp").write_text(options.replace("; ", "\n") + "\n")


def start(scene: Any, method: Any, label: Any, step: float, seed: int = 1) -> Batch:
    """A run, which writes every step."""

    def states(steps: int) -> tuple[Any, Any]:
        with tempfile.TemporaryDirectory() as folder:
            files(Path(folder), scene, method.name, step, steps, seed)
            called("gmx grompp -f in.mdp -c start.gro -r walls.gro -p in.top -o in.tpr -maxwarn 9", folder)
            called("gmx mdrun -s in.tpr -o out.trr -ntmpi 1 -ntomp 1 -nb cpu", folder)
            found = read_trr(Path(folder, "out.trr"), [], None)
        x, v = (np.asarray(a, float).reshape(len(a), -1)[:, scene.where] for a in (found.q, found.v))
        return x - shift(scene), scene.m * v

    return Batch(scene, states)


LATE = "the velocities of its files, also of the start, are those of half a step before: documented"
AVEK = "it takes the velocities of its start for those of half a step before: upstream/gromacs_avek.md"
MD, VERLET = "semi-implicit-euler", "velocity-verlet"
ENGINE = Engine(
    name="gromacs", title="GROMACS", module="struct", start=start, any_axis=True,
    version=lambda: {"gromacs": called("gmx --version", ".").partition("GROMACS version:")[2].split()[0]},
    methods=named(
        by_name("md", MD, "integrator = md, position restraints", SPRINGS, note=LATE),
        by_name("md-vv", VERLET, "integrator = md-vv, position restraints", SPRINGS),
        by_name("md-vv-avek", VERLET, "md-vv-avek, started half a kick back", SPRINGS, note=AVEK),
    ),
    thermostats=named(thermostat("sd", "baoa", "integrator = sd", "ThreeFry", SPRINGS, note=LATE)),
    # in a bath positions are rounded with the shift, at 8
    arithmetic=lambda x: Arithmetic(
        name="single", state=2.0 ** (-20 if x.method == "sd" else -24), force=2.0**-24,
    ),
)  # fmt: skip
