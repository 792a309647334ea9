"""GROMACS' SHAKE, LINCS and SETTLE beside their law, from trajectories of its double precision.

Claim: md-vv with any of the three turns a rigid dumbbell, or a rigid triangle, by asin(h w) a step and keeps
lengths to rounding where it is asked for as much; `springcheck judge` reads the .trr files and says so.  What
SHAKE and LINCS leave by default is told.

Command: python validation/gromacs.py             (judges what is stored; 5 s)
         python validation/gromacs.py --write     (runs `gmx_d` anew, of Debian's gromacs)

Trajectories and their scenes are in data/reference/gromacs: 40 steps of 0.1, far from the border of a box of
20 nm.  Expected with GROMACS 2022.5 (step-defect and turn in their own units, length relative):

  dumbbell-shake           step-defect 1.3e+00  rod-length 5.2e-16  turn 3.7e-16  passed
  dumbbell-lincs           step-defect 1.2e+00  rod-length 4.7e-16  turn 9.2e-16  passed
  dumbbell-lincs-as-it-is  step-defect 1.1e+00  rod-length 5.9e-16  turn 6.0e-16  passed
  dumbbell-shake-as-it-is  step-defect 8.3e+10  rod-length 6.4e-05  turn 4.8e-05  rejected
  triangle-shake           step-defect 4.4e+01  rod-length 4.8e-14  turn 3.5e-14  passed
  triangle-lincs           step-defect 4.8e+07  rod-length 1.2e-13  turn 9.8e-14  rejected
  triangle-settle          step-defect 1.9e+00  rod-length 8.2e-15  turn 4.8e-15  passed
  triangle-lincs-as-it-is  step-defect 1.1e+10  rod-length 6.1e-05  turn 2.1e-05  rejected

One rod takes no expansion of LINCS; velocities of a triangle, which it does not iterate, keep what order 8
leaves.

Exit status 0 while the claim holds, 1 otherwise.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

from arguments import arguments, script
from documents import told
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene

FOLDER = Path(__file__).parents[1] / "data" / "reference" / "gromacs"

ALGORITHMS = {
    "shake": "constraint-algorithm = shake\nshake-tol = 1e-13",
    "shake-as-it-is": "constraint-algorithm = shake",
    "lincs": "constraint-algorithm = lincs\nlincs-order = 8\nlincs-iter = 8",
    "lincs-as-it-is": "constraint-algorithm = lincs",
    "settle": "",
}

TOLD = {"step-defect", "rod-length", "rod-velocity"}

CASES: dict[str, set[str]] = {
    **{f"dumbbell-{name}": set() for name in ("shake", "lincs", "lincs-as-it-is")},
    "dumbbell-shake-as-it-is": TOLD | {"turn"},
    **{f"triangle-{name}": set() for name in ("shake", "settle")},
    "triangle-lincs": TOLD,
    "triangle-lincs-as-it-is": TOLD | {"turn"},
}
"""Each trajectory, and the checks that reject it: what no tolerance declares is an error."""

RUN = """integrator = {integrator}
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


def molecule(scene: Scene, held: list[str]) -> str:
    """The topology of particles that feel nothing but what is said of them."""
    masses, n = scene.masses.tolist(), scene.particles
    return "\n".join([
        "[ defaults ]", "1 1 no 1.0 1.0", "[ atomtypes ]",
        *(f"T{i} 0 {m!r} 0.0 A 0.0 0.0" for i, m in enumerate(masses, 1)),
        "[ moleculetype ]", "M 3", "[ atoms ]",
        *(f"{i} T{i} 1 M A{i} {i} 0.0 {m!r}" for i, m in enumerate(masses, 1)), *held, "[ exclusions ]",
        *(" ".join(map(str, [i, *(j for j in range(1, n + 1) if j != i)])) for i in range(1, n + 1)),
        "[ system ]", "one", "[ molecules ]", "M 1", "",
    ])  # fmt: skip


def _held(scene: Scene, settle: bool) -> list[str]:
    """The rods of a scene."""
    rods = scene.system.rods
    assert rods is not None
    if settle:
        return ["[ settles ]", f"1 1 {float(rods.length[0])!r} {float(rods.length[2])!r}"]
    return ["[ constraints ]", *(f"{a + 1} {b + 1} 2 {x!r}" for (a, b), x, _ in rods.joints())]


def _start(scene: Scene) -> str:
    """A .gro file of the start, with all digits."""
    q, v = scene.q.reshape(-1, 3), (scene.p / scene.m).reshape(-1, 3)
    rows = [
        f"{1:5d}{'M':<5s}{f'A{i + 1}':>5s}{i + 1:5d}" + "".join(f"{x:25.17f}" for x in q[i])
        + "".join(f"{x:25.18f}" for x in v[i])
        for i in range(len(q))
    ]  # fmt: skip
    return "\n".join(["start", str(len(q)), *rows, "20.0 20.0 20.0", ""])


def run(
    scene: Scene,
    held: list[str],
    path: Path,
    *,
    program: str = "gmx_d",
    integrator: str = "md-vv",
    more: str = "",
) -> None:
    """Run GROMACS on a scene and keep its trajectory, of every step."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "x.top").write_text(molecule(scene, held))
        (folder / "x.gro").write_text(_start(scene))
        settings = RUN.format(integrator=integrator, step=scene.step, steps=scene.steps)
        (folder / "x.mdp").write_text(f"{settings}{more}\n")
        for command in (
            f"{program} grompp -f x.mdp -c x.gro -p x.top -o x.tpr -maxwarn 5",
            f"{program} mdrun -s x.tpr -o x.trr -nt 1",
        ):
            subprocess.run(command.split(), cwd=folder, check=True, capture_output=True)
        path.write_bytes((folder / "x.trr").read_bytes())


def write(name: str) -> None:
    """Run GROMACS in double precision and keep its trajectory."""
    which, _, algorithm = name.partition("-")
    scene = scenefile.load_scene(FOLDER / f"{which}.toml")
    held = _held(scene, algorithm == "settle")
    run(scene, held, FOLDER / f"{name}.trr", more=ALGORITHMS[algorithm])


def judged(name: str) -> dict[str, dict[str, float]]:
    """The verdicts of `springcheck judge` by check."""
    scene = FOLDER / f"{name.partition('-')[0]}.toml"
    found = told("judge", str(FOLDER / f"{name}.trr"), "--scene", str(scene), "--scheme", "velocity-verlet")
    return {one["check"]: one for one in found["verdicts"]}


def main() -> int:
    """Judge what is stored; returns the exit status."""
    options = arguments(__doc__, write=False)
    right = True
    for name, rejected in CASES.items():
        if options.write:
            write(name)
        found = judged(name)
        failed = {check for check, one in found.items() if one["passed"] is False}
        right &= failed == rejected
        said = " rejected by " + " ".join(sorted(failed)) if failed else " passed"
        shown = (f"{check} {found[check]['value']:.1e}" for check in ("step-defect", "rod-length", "turn"))
        print(f"{name:24}", "  ".join(shown), said)
    return 0 if right else 1


if __name__ == "__main__":
    script(main)
