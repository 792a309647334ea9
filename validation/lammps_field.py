"""LAMMPS in a magnetic field, by `fix addforce` with variables of the velocity: which scheme is that?

Claim: no fix of LAMMPS turns velocities in a field.  Given as a force, v_fx = B vy and v_fy = -B vx, it
is taken with the velocity of half a step before, for both half kicks about each position.  So those of half
steps make explicit Euler, u' = (1 + h W J) u with W = B/m and J (x, y) = (y, -x): from step to step |v| grows
by sqrt(1 + (h W)**2) and it turns by atan(h W), where Boris keeps it and turns by 2 atan(h W/2);
x' = x + h u'.  A step needs the velocity of half a step before beside its state, so it is no scheme of the
catalogue, and no method here.

Command: python validation/lammps_field.py

Printed (LAMMPS 2025.7.22, x86-64), 400 steps at h W = 0.135294: |v| grows by 0.00911075 a step, by the law
0.00911075; off by 4.7e-15 of the largest position and velocity.
"""

from __future__ import annotations

import numpy as np

from arguments import arguments, script
from springcheck.engines.lammps import _library
from springcheck.physics.arrays import Floats

M, B, H, STEPS = 1.7, 2.3, 0.1, 400
START = np.array([[0.3, -0.2], [0.7 / M, 0.4 / M]])
LAST = 1e-13
"""Bound after 400 steps, each of which rounds a growing state."""


def by_lammps() -> Floats:
    """Positions and velocities (frames, 2, 2) of one atom in the plane."""
    run = _library().lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
    for line in (
        "units lj", "atom_style full", "atom_modify map array sort 0 0.0", "boundary s s s",
        "region all block -1 1 -1 1 -1 1 units box", "create_box 1 all", f"mass 1 {M!r}",
    ):  # fmt: skip
        run.command(line)
    run.create_atoms(1, [1], [1], [*START[0].tolist(), 0.0])
    for line in (
        "pair_style zero 1.0 nocoeff", "pair_coeff * *", "neighbor 0.3 nsq",
        f"variable fx atom {B!r}*vy", f"variable fy atom -({B!r})*vx",
        "fix field all addforce v_fx v_fy 0.0", "fix move all nve", f"timestep {H!r}",
    ):  # fmt: skip
        run.command(line)
    run.numpy.extract_atom("v")[0, :2] = START[1]
    run.command("run 0 post no")
    found = [START]
    for _ in range(STEPS):
        run.command("run 1 pre no post no")
        found.append(np.stack([run.numpy.extract_atom(name)[0, :2] for name in "xv"]))
    return np.array(found)


def by_law() -> Floats:
    """The same by the law, of complex numbers z = x + i y, on which J is -i."""
    x, v = START @ [1, 1j]
    turn = -1j * H * B / M
    # LAMMPS computes forces once before the first step, with the velocities of the start
    u = v * (1 + turn / 2)
    found = [(x, v)]
    for _ in range(STEPS):
        x = x + H * u
        v = u * (1 + turn / 2)
        found.append((x, v))
        u = u * (1 + turn)
    z = np.array(found)
    return np.stack([z.real, z.imag], axis=-1)


def off() -> float:
    """The largest distance between the two, relative to the largest position and velocity."""
    one, other = by_lammps(), by_law()
    return float(np.max(np.abs(one - other) / np.max(np.abs(other), axis=(0, 2), keepdims=True)))


def main() -> int:
    """Print both; exit status 1 where they are not one."""
    arguments(__doc__)
    found = by_lammps()
    speed = np.sqrt(np.sum(found[:, 1] ** 2, axis=-1))
    grown = (speed[-1] / speed[1]) ** (1 / (STEPS - 1)) - 1
    law = np.sqrt(1 + (H * B / M) ** 2) - 1
    most = off()
    print(f"h W = {H * B / M:.6f}: |v| grows by {grown:.6g} a step, law {law:.6g}; off by {most:.1e}")
    return int(not most < LAST)


if __name__ == "__main__":
    script(main)
