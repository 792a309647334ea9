"""A bond between two unlike masses along no axis, by GROMACS, LAMMPS and MuJoCo, from files that they write.

Claim: `springcheck identify` names the scheme of each file from its states, of a pair that rests in its
middle and of one that drifts, in double and in single precision; `judge` passes it and no other scheme.

Command: python validation/bonds_in_space.py             (reads what is stored; 20 s)
         python validation/bonds_in_space.py --write     (runs `gmx`, `gmx_d`, LAMMPS and MuJoCo anew)

m = 3.7 and 1.3, k = 2.9, rest length 0.9, 40 steps of 0.1.  GROMACS 2022.5 of Debian: `md`, whose velocities
belong half a step back, and `md-vv`; LAMMPS 2025.7.22.4: `bond_style harmonic` and `fix nve`, its dump with
times; MuJoCo 4.0.0: a spatial tendon between two bodies on three slide joints each.  Expected, with the
angular frequency sqrt(k/mu) = 1.7362468:

  gromacs-md-rest.trr              semi-implicit-euler  1.73624682  judged
  gromacs-md-drift.trr             semi-implicit-euler  1.73624682  judged
  gromacs-md-vv-rest.trr           velocity-verlet      1.73624682  judged
  gromacs-md-vv-drift.trr          velocity-verlet      1.73624682  judged
  gromacs-single-md-rest.trr       semi-implicit-euler  1.73624687  judged
  gromacs-single-md-drift.trr      semi-implicit-euler  1.73624686  judged
  lammps-rest.dump                 velocity-verlet      1.73624682  judged
  lammps-drift.dump                velocity-verlet      1.73624682  judged
  mujoco-rest.npz                  semi-implicit-euler  1.73624682  judged
  mujoco-drift.npz                 semi-implicit-euler  1.73624682  judged

Exit status 0 while the claim holds, 1 otherwise.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments, script
from documents import told
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene

FOLDER = Path(__file__).parents[1] / "data" / "reference" / "bonds"

SCHEMES = {
    "gromacs-md": "semi-implicit-euler",
    "gromacs-md-vv": "velocity-verlet",
    "gromacs-single-md": "semi-implicit-euler",
    "lammps": "velocity-verlet",
    "mujoco": "semi-implicit-euler",
}
ENDINGS = {"gromacs": ".trr", "lammps": ".dump", "mujoco": ".npz"}
STATES = ("rest", "drift")
CASES = {
    f"{name}-{state}{ENDINGS[name.partition('-')[0]]}": scheme
    for name, scheme in SCHEMES.items()
    for state in STATES
}
"""Each file, and the scheme that made it."""


def scene_of(name: str) -> Path:
    """The scene of a file: at rest as a whole, or drifting."""
    return FOLDER / ("drift.toml" if "drift" in name else "rest.toml")


def _start(scene: Scene) -> tuple[Any, Any, Any, float, float]:
    """Masses (2,), positions and velocities (2, 3), stiffness and rest length."""
    bond: Any = scene.terms[0]
    q, v = scene.q.reshape(-1, 3), (scene.p / scene.m).reshape(-1, 3)
    return scene.masses, q, v, float(bond.k[0]), float(bond.rest[0])


GROMACS = """integrator = {integrator}
dt = {step!r}
nsteps = {steps}
nstxout = 1
nstvout = 1
nstcalcenergy = 1
comm-mode = none
cutoff-scheme = verlet
verlet-buffer-tolerance = -1
rlist = 1.2
"""


def gromacs(scene: Scene, path: Path, name: str) -> None:
    """A trajectory of every step, in the precision of the file's name."""
    masses, q, v, k, rest = _start(scene)
    rows = [
        f"{1:5d}{'M':<5s}{f'A{i + 1}':>5s}{i + 1:5d}" + "".join(f"{x:25.17f}" for x in q[i])
        + "".join(f"{x:25.18f}" for x in v[i])
        for i in (0, 1)
    ]  # fmt: skip
    m = masses.tolist()
    topology = [
        "[ defaults ]", "1 1 no 1.0 1.0",
        "[ atomtypes ]", *(f"T{i} 0 {m[i]!r} 0.0 A 0.0 0.0" for i in (0, 1)),
        "[ moleculetype ]", "M 3", "[ atoms ]",
        *(f"{i + 1} T{i} 1 M A{i} {i + 1} 0.0 {m[i]!r}" for i in (0, 1)),
        # type 6: harmonic, and no chemical bond that excludes others
        "[ bonds ]", f"1 2 6 {rest!r} {k!r}", "[ exclusions ]", "1 2", "2 1",
        "[ system ]", "one", "[ molecules ]", "M 1", "",
    ]  # fmt: skip
    program, integrator = "gmx" if "single" in name else "gmx_d", "md-vv" if "md-vv" in name else "md"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "x.top").write_text("\n".join(topology))
        (folder / "x.gro").write_text("\n".join(["start", "2", *rows, "20.0 20.0 20.0", ""]))
        settings = GROMACS.format(integrator=integrator, step=scene.step, steps=scene.steps)
        (folder / "x.mdp").write_text(settings)
        for command in (
            f"{program} grompp -f x.mdp -c x.gro -p x.top -o x.tpr -maxwarn 5",
            f"{program} mdrun -s x.tpr -o x.trr -nt 1",
        ):
            subprocess.run(command.split(), cwd=folder, check=True, capture_output=True)
        path.write_bytes((folder / "x.trr").read_bytes())


def lammps(scene: Scene, path: Path) -> None:
    """A dump with unwrapped positions and times, every number with all of its digits."""
    from springcheck.engines import lammps as engine

    masses, q, v, k, rest = _start(scene)
    program = engine._library().lammps(cmdargs=["-log", "none", "-screen", "none"])
    atoms = [f"create_atoms {i + 1} single " + " ".join(repr(float(x)) for x in q[i]) for i in (0, 1)]
    speeds = ["set atom {} vx {!r} vy {!r} vz {!r}".format(i + 1, *v[i].tolist()) for i in (0, 1)]
    for command in (
        "units lj", "atom_style bond", "boundary p p p", "region b block 0 20 0 20 0 20",
        "create_box 2 b bond/types 1 extra/bond/per/atom 1 extra/special/per/atom 1", "pair_style zero 3.0",
        "bond_style harmonic", *(f"mass {i + 1} {float(masses[i])!r}" for i in (0, 1)), *atoms,
        "pair_coeff * *", f"bond_coeff 1 {k / 2!r} {rest!r}", "create_bonds single/bond 1 1 2", *speeds,
        f"timestep {scene.step!r}", "fix 1 all nve",
        f"dump d all custom 1 {path} id type mass xu yu zu vx vy vz",
        "dump_modify d sort id format float %.17g units yes time yes", f"run {scene.steps}",
    ):  # fmt: skip
        program.command(command)
    program.close()


def mujoco(scene: Scene, path: Path) -> None:
    """Positions of the bodies and velocities of their joints at every step, as an .npz of t, q, v and m."""
    import mujoco as library

    masses, q, v, k, rest = _start(scene)
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    bodies = "".join(
        f'<body pos="{" ".join(map(repr, q[i].tolist()))}">{slides}<site name="s{i}"/>'
        f'<inertial pos="0 0 0" mass="{float(masses[i])!r}" diaginertia="1 1 1"/></body>'
        for i in (0, 1)
    )
    model = library.MjModel.from_xml_string(
        f'<mujoco><option timestep="{scene.step!r}" gravity="0 0 0"/><worldbody>{bodies}</worldbody><tendon>'
        f'<spatial stiffness="{k!r}" springlength="{rest!r}"><site site="s0"/><site site="s1"/></spatial>'
        "</tendon></mujoco>"
    )
    data = library.MjData(model)
    data.qvel[:] = v.reshape(-1)
    frames = []
    for _ in range(scene.steps + 1):
        library.mj_forward(model, data)
        frames.append((data.time, data.xpos[1:].copy(), data.qvel.reshape(2, 3).copy()))
        library.mj_step(model, data)
    t, where, speed = (np.array(x) for x in zip(*frames, strict=True))
    np.savez(path, t=t, q=where, v=speed, m=masses)


def write(name: str) -> None:
    """Run the program of a file."""
    scene, path = scenefile.load_scene(scene_of(name)), FOLDER / name
    if name.startswith("gromacs"):
        gromacs(scene, path, name)
    else:
        (lammps if name.startswith("lammps") else mujoco)(scene, path)


def named(name: str) -> dict[str, Any]:
    """What `identify` says of a file."""
    return told("identify", str(FOLDER / name))


def judged(name: str, scheme: str) -> dict[str, Any]:
    """What `judge` says of a file and a scheme."""
    return told("judge", str(FOLDER / name), "--scene", str(scene_of(name)), "--scheme", scheme)


def main() -> int:
    """Read what is stored; returns the exit status."""
    options = arguments(__doc__, write=False)
    right = True
    for name, scheme in CASES.items():
        if options.write:
            write(name)
        found = named(name)
        others = set(SCHEMES.values()) - {scheme}
        passes = judged(name, scheme)["status"] == 0 and all(judged(name, x)["status"] == 1 for x in others)
        right &= passes and found["scheme"] == scheme
        omega = np.ravel(found["omega"])[0]
        print(f"  {name:32} {found['scheme']!s:20} {omega:<11.9g} {'judged' if passes else 'WRONG'}")
    return 0 if right else 1


if __name__ == "__main__":
    script(main)
