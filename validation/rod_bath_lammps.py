"""A rod in LAMMPS' heat bath: what a step does to it, and the temperature that follows.

Claim: a step of fix langevin, fix nve and fix rattle or shake is the map in `judged`, to rounding, friction
alone and with noise; and a rod moves at the temperature of its bath, to every order in the step.

Command: python validation/rod_bath_lammps.py    (7 s)

Friction and noise are forces, of the velocity of the drift before and one uniform draw an axis.  The kicks
before and after a place are projected along the rod of that place: what noise there is along it acts nowhere,
and no state tells it.  length/h times the sine of a drift's angle has then the map of a free particle, whose
velocity at the place has kT whatever the friction.  SHAKE stores velocities that are not projected.

Degrees of freedom are 5 a rod; LAMMPS takes 3 off, of a centre of mass that fix langevin moves: n rods are
reported at 5 n/(5 n - 3) of what they have, one at 2.5 of it, unless compute_modify says extra/dof 0.

Expected (LAMMPS 2025.7.22): steps depart by 0.006 of their bound at most; draws across the rod have variances
of 0.999 to 1.002, errors 0.0013; at friction h of 0.1 and 0.5 the centre has 1.001(5) and 1.001(2) of kT, the
rotation 0.997(6) and 1.002(3); one rod is reported at 2.5 and 100 at 1.006 of it.

Exit status 0 while departures are within their bounds and means within 5 standard errors, 1 otherwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from arguments import arguments, script
from rod_bath import (
    LENGTH,
    PULL,
    ROD,
    ROUNDINGS,
    STEP,
    THERMAL,
    TOLERANCE,
    M,
    departure,
    mean,
    measured,
    shown,
    started,
)


def lammps(q: Any, p: Any, steps: int, rate: float, thermal: float, pull: Any, fix: str = "rattle") -> Any:
    """States (f, n, 6) after the first step, and the temperature that it reports over that of 5 degrees."""
    from springcheck.engines import lammps as engine

    run = engine._library().lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
    n, about = len(q), engine.SETTINGS.format(cutoff=3.0, edges="-9 9 " * 3)
    first = "create_box 2 all bond/types 1 extra/bond/per/atom 1 extra/special/per/atom 2"
    for line in (
        *about.strip().splitlines(),
        first,
        f"mass 1 {M[0]}",
        f"mass 2 {M[3]}",
        "bond_style harmonic",
    ):
        run.command(line)
    run.command(f"bond_coeff 1 0.0 {LENGTH!r}")
    run.create_atoms(2 * n, list(range(1, 2 * n + 1)), [1, 2] * n, q.ravel().tolist())
    for i in range(1, 2 * n, 2):
        run.command(f"create_bonds single/bond 1 {i} {i + 1} special yes")
    for line in (
        "group light type 1", "fix move all nve",
        "fix pull light addforce " + " ".join(map(repr, pull[:3].tolist())),
        f"fix bath all langevin {thermal!r} {thermal!r} {1 / rate!r} 7",
        f"fix rods all {fix} {TOLERANCE} 500 0 b 1", f"timestep {STEP!r}",
    ):  # fmt: skip
        run.command(line)
    read, states, reported = run.numpy.extract_atom, [], 0.0
    read("v")[:] = (p / M).reshape(-1, 3)
    run.command("run 0 post no")
    for _ in range(steps):
        run.command("run 1 pre no post no")
        states.append((read("x").reshape(q.shape).copy(), read("v").reshape(q.shape) * M))
    if thermal:
        reported = run.extract_compute("thermo_temp", 0, 0) / (np.sum(states[-1][1] ** 2 / M) / (5 * n))
    return *map(np.array, zip(*states, strict=True)), reported


def judged(q: Any, p: Any, rate: float, thermal: float, pull: Any) -> tuple[float, Any]:
    """The departure of all steps but two, and their draws, of which those along a rod are of no rank."""
    q, p, h = q.astype(np.longdouble), p.astype(np.longdouble), np.longdouble(STEP)
    # SHAKE's, which are stored as they are; RATTLE's lie across the rod already
    p = ROD.projected(q, p)
    before, at, now = (q[1:-1] - q[:-2]) / h, q[1:-1], p[1:-1]
    noise = 2 * (now - M * before) / h - pull + M * rate * before if thermal else np.zeros_like(now)
    force = pull - M * rate * before + noise
    there = ROD.projected(at, M * before + h / 2 * force)
    end, _ = ROD.drifted(at, at + h * (now + h / 2 * force) / M, now, h)
    return departure((end, there), (q[2:], now)), noise / np.sqrt(2 * rate * M * (thermal or 1.0) / h)


def rows(rods: int = 100, steps: int = 3000) -> Any:
    """What is measured, its value, its law, and what they may differ by."""
    for friction in (0.1, 0.5):
        rate = friction / STEP
        for thermal in (0.0, THERMAL):
            for fix in ("rattle", "shake"):
                q, p, _ = lammps(*started(5), 60, rate, thermal, PULL, fix)
                of = f"friction h {friction}: departure, {'noise' if thermal else 'T = 0'}, {fix}"
                yield of, judged(q, p, rate, thermal, PULL)[0], 0.0, 1.0
        q, p, reported = lammps(*started(rods), steps, rate, THERMAL, np.zeros(6))
        one = lammps(*started(1), 10, rate, THERMAL, np.zeros(6))[2]
        for n, value in ((rods, reported), (1, one)):
            yield f"reported over stored, of {n}", value, 5 * n / (5 * n - 3), ROUNDINGS * n * 2.0**-53
        draws = judged(q, p, rate, THERMAL, np.zeros(6))[1]
        for title, values in measured(q[1:-1], p[1:-1], draws[:-1]).items():
            value, most = mean(values)
            if "along" not in title and "less" not in title:
                yield title, value, 1.0, most


def main() -> int:
    """Print what is measured beside its law; 1 where one is off."""
    arguments(__doc__)
    return int(shown(rows()))


if __name__ == "__main__":
    script(main)
