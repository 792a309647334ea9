"""A pendulum on a hinge by DART and by MuJoCo, from files of its angle that they write.

Claim: `springcheck judge` passes the angle and its rate as semi-implicit Euler of the pendulum, to rounding,
and not as velocity Verlet; and it sees the inertia of 1e-12 about its own centre that a body of theirs must
have.

Command: python validation/hinges.py             (reads what is stored; 2 s)
         python validation/hinges.py --write     (runs dartpy and MuJoCo anew)

1.3 on an arm of 0.9 in a gravity of 9.81, from 1.1 rad at -0.7 rad/T, 200 steps of 0.01; dartpy 6.20.0,
MuJoCo 4.0.0.  Expected, the step defect in roundings:

  dart.csv    3.3 of 13 passed; without that inertia 1.1e+04 of 13 FAILED; as Verlet 9.9e+12 of 19 FAILED
  mujoco.csv  2.7 of 13 passed; without that inertia 1.1e+04 of 13 FAILED; as Verlet 9.9e+12 of 19 FAILED

Exit status 0 while the claim holds, 1 otherwise.
"""

from __future__ import annotations

import csv
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments, script
from documents import told

FOLDER = Path(__file__).parents[1] / "data" / "reference" / "hinges"
MASS, ARM, GRAVITY, OWN, STEP, STEPS, START = 1.3, 0.9, 9.81, 1e-12, 0.01, 200, (1.1, -0.7)

SCENE = """title = "A pendulum on a hinge: q is its angle"
units = "reduced"
[[particle]]
mass = {inertia!r}
position = {angle!r}
momentum = {momentum!r}
[[cosine]]
particle = 0
depth = {depth!r}
length = 1.0
[time]
step = {step!r}
steps = {steps}
"""


def scene(own: float) -> str:
    """The pendulum with so much inertia about its own centre."""
    inertia = MASS * ARM**2 + own
    return SCENE.format(
        inertia=inertia, angle=START[0], momentum=inertia * START[1], depth=MASS * GRAVITY * ARM,
        step=STEP, steps=STEPS,
    )  # fmt: skip


def dart() -> list[tuple[float, float]]:
    """Angles and rates by DART's world."""
    import dartpy

    world, body = dartpy.simulation.World(), dartpy.dynamics.Skeleton("pendulum")
    world.setGravity([0, 0, -GRAVITY])
    world.setTimeStep(STEP)
    joint, node = body.createRevoluteJointAndBodyNodePair()
    joint.setAxis([0, 1, 0])
    node.setInertia(dartpy.dynamics.Inertia(MASS, np.array([0, 0, -ARM]), OWN * np.eye(3)))
    world.addSkeleton(body)
    body.setPosition(0, START[0])
    body.setVelocity(0, START[1])
    found = []
    for _ in range(STEPS + 1):
        found.append((float(body.getPosition(0)), float(body.getVelocity(0))))
        world.step()
    return found


def mujoco() -> list[tuple[float, float]]:
    """The same by MuJoCo's semi-implicit integrator, without what it damps."""
    import mujoco as library

    model = library.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{STEP!r}" gravity="0 0 {-GRAVITY!r}"/>'
        f'<worldbody><body><joint type="hinge" axis="0 1 0"/><inertial pos="0 0 {-ARM!r}" mass="{MASS!r}" '
        f'diaginertia="{OWN!r} {OWN!r} {OWN!r}"/></body></worldbody></mujoco>'
    )
    data: Any = library.MjData(model)
    data.qpos[0], data.qvel[0] = START
    found = []
    for _ in range(STEPS + 1):
        found.append((float(data.qpos[0]), float(data.qvel[0])))
        library.mj_step(model, data)
    return found


PROGRAMS = {"dart": dart, "mujoco": mujoco}


def defect(name: str, scheme: str, own: float = OWN) -> dict[str, Any]:
    """The verdict of the step defect on a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hinge.toml"
        path.write_text(scene(own))
        found = told("judge", str(FOLDER / f"{name}.csv"), "--scene", str(path), "--scheme", scheme)
    (verdict,) = (one for one in found["verdicts"] if one["check"] == "step-defect")
    return {**verdict, "status": found["status"]}


def main() -> int:
    """Read what is stored; returns the exit status."""
    right = True
    again = arguments(__doc__, write=False).write
    for name, program in PROGRAMS.items():
        if again:
            with (FOLDER / f"{name}.csv").open("w", newline="") as file:
                rows = csv.writer(file, lineterminator="\n")
                rows.writerow(("t", "q", "v"))
                rows.writerows((repr(i * STEP), repr(q), repr(v)) for i, (q, v) in enumerate(program()))
        ours, bare = defect(name, "semi-implicit-euler"), defect(name, "semi-implicit-euler", 0.0)
        other = defect(name, "velocity-verlet")
        right &= ours["status"] == 0 and bare["passed"] is False and other["passed"] is False
        said = [
            f"{x['value']:.2g} of {x['bound']:.0f} {'passed' if x['passed'] else 'FAILED'}"
            for x in (ours, bare, other)
        ]
        print(f"  {name + '.csv':10}  {said[0]}; without that inertia {said[1]}; as Verlet {said[2]}")
    return 0 if right else 1


if __name__ == "__main__":
    script(main)
