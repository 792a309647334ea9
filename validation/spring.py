"""The blog's story in one page: explicit Euler spirals outwards, semi-implicit Euler does not.

Claim: with m = k = 1, q0 = 0, p0 = 1, dt = 0.1 and 200 steps (R. Ghosh, Modelling a Spring System in
Hamiltonian Mechanics, 2026) explicit Euler multiplies the energy by 1.01**200 = 7.316 and the amplitude
by 2.705, in springcheck's own loop and in OpenMM alike; semi-implicit Euler keeps its shadow energy
H - (hk/2m) q p to rounding; OpenMM's VerletIntegrator handed p0 as it is *is* the semi-implicit Euler,
and handed a synchronised start it is ASE's velocity Verlet.

Command: python validation/spring.py [FOLDER]      (default: validation-output; figures and store go there)

Expected:
    own:euler                    energy x 7.316, amplitude x 2.705
    own:semi-implicit-euler      shadow energy kept to 1e-15 or so
    openmm:leapfrog  to own:semi-implicit-euler   below 1e-13   (here 6e-15)
    openmm:euler     to own:euler                 below 1e-12   (here 0)
    openmm:verlet    to ase:velocity-verlet       below 1e-13   (here 6e-15)
    sundials:adams   to the exact solution        below 1e-9    (here 1e-10)
    every verdict passed
"""

from pathlib import Path

import numpy as np

from arguments import arguments, script
from springcheck import load_scene
from springcheck.checks import compare, judge
from springcheck.driver import run
from springcheck.figures.render import picture
from springcheck.figures.style import save, style
from springcheck.studies.run.page import of_runs

METHODS = [
    "own:euler", "own:semi-implicit-euler", "own:implicit-euler", "openmm:euler", "openmm:leapfrog",
    "openmm:verlet", "ase:velocity-verlet", "sundials:adams",
]  # fmt: skip

PAIRS = [
    ("openmm:leapfrog", "own:semi-implicit-euler", 1e-13),
    ("openmm:euler", "own:euler", 1e-12),
    ("openmm:verlet", "ase:velocity-verlet", 1e-13),
    ("sundials:adams", "exact", 1e-9),
]


def main() -> int:
    """Run, compare, plot; the exit status says whether all of it came out."""
    folder = arguments(__doc__, folder=Path("validation-output")).folder
    scene = load_scene("spring")
    runs = {label: run(scene, label) for label in METHODS}
    good = True

    energy = scene.system.energy(runs["own:euler"].q, runs["own:euler"].p)
    growth = float(energy[-1] / energy[0])
    print(f"own:euler: energy x {growth:.4g}, amplitude x {np.sqrt(growth):.4g}")
    good &= abs(growth / 1.01**200 - 1) < 1e-12

    q, p = runs["own:semi-implicit-euler"].q[:, 0], runs["own:semi-implicit-euler"].p[:, 0]
    shadow = p**2 / 2 + q**2 / 2 - scene.step / 2 * q * p
    kept = float(np.max(np.abs(shadow / shadow[0] - 1)))
    print(f"own:semi-implicit-euler: shadow energy kept to {kept:.1e}")
    good &= kept < 200 * 13 * 2.0**-53

    found = compare.compare(scene, runs)
    where = {label: i for i, label in enumerate(found.labels)}
    for one, other, bound in PAIRS:
        difference = found.max_difference[where[one], where[other]]
        if one == "openmm:euler":
            difference /= np.sqrt(growth)
        print(f"{one} to {other}: {difference:.1e} (bound {bound:g})")
        good &= bool(difference <= bound)

    verdicts = [verdict for each in runs.values() for verdict in judge(scene, each)]
    failed = [verdict for verdict in verdicts if verdict.passed is False]
    print(f"{sum(v.passed is True for v in verdicts)} verdicts passed, {len(failed)} failed")
    with style():
        for bank in of_runs(scene, runs, runs):
            print(*save(picture(bank), folder, bank.name), sep="\n")
    return 0 if good and not failed else 1


if __name__ == "__main__":
    script(main)
