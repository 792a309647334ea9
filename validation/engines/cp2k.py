"""CP2K, by its files and `cp2k`: FIST with an external potential for a spring, ensemble NVE."""

import functools
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from springs import SPRINGS, Batch, called, placed

from springcheck.engines import Engine, named
from springcheck.engines.contract import by_name
from springcheck.errors import MethodError
from springcheck.physics.arrays import Arithmetic

DALTON = 1.66053906660e-27 / 9.1093837015e-31
"""In masses of an electron: everything else is in atomic units."""

INPUT = """
&GLOBAL; PROJECT out; RUN_TYPE MD; PRINT_LEVEL LOW; &END
&MOTION; &MD; ENSEMBLE NVE; STEPS {steps}; TIMESTEP [au_t] {step!r}; TEMPERATURE 0; COMVEL_TOL 1e9; &END
&PRINT; &RESTART OFF; &END; &RESTART_HISTORY OFF; &END
&TRAJECTORY; UNIT bohr; FORMAT XYZ; &EACH; MD 1; &END; &END
&VELOCITIES ON; UNIT bohr*au_t^-1; FORMAT XYZ; &EACH; MD 1; &END; &END; &END; &END
&FORCE_EVAL; METHOD FIST
&MM; &FORCEFIELD; &CHARGE; ATOM H; CHARGE 0; &END
&NONBONDED; &LENNARD-JONES; ATOMS H H; EPSILON 0; SIGMA 1; RCUT 1; &END; &END; &END
&POISSON; &EWALD; EWALD_TYPE none; &END; &END; &END
&EXTERNAL_POTENTIAL; ATOMS_LIST 1; FUNCTION 0.5*K*(X-A)^2; PARAMETERS K A; VALUES {k!r} {at!r}; &END
&SUBSYS; &CELL; ABC 50 50 50; PERIODIC NONE; &END; &KIND H; MASS {mass!r}; &END
&COORD; UNIT bohr; H {x!r} 0 0; &END; &VELOCITY; {v!r} 0 0; &END; &END; &END
"""


def start(scene: Any, method: Any, label: Any, step: float) -> Batch:
    """A run, which writes every step with 10 decimals."""
    if scene.n > 1:
        raise MethodError("one particle is what this program has a potential for")
    x, v, pull, at = (float(a[0, 0]) for a in placed(scene))

    def states(steps: int) -> tuple[Any, Any]:
        text = INPUT.format(
            steps=steps, step=step, k=pull, at=at, x=x, v=v, mass=float(scene.masses[0]) / DALTON
        )  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "in.inp").write_text(text.replace("; ", "\n"))
            called("OMP_NUM_THREADS=1 cp2k in.inp", folder)
            found = [
                np.array([float(line.split()[1]) for line in rows if line.startswith("  H ")])[:, None]
                for rows in (Path(folder, f"out-{x}-1.xyz").read_text().splitlines() for x in ("pos", "vel"))
            ]
        return found[0], scene.m * found[1]

    return Batch(scene, states)


@functools.cache
def version() -> dict[str, str]:
    """Version of cp2k."""
    return {"cp2k": called("cp2k --version", ".").partition("CP2K version")[2].split()[0]}


FEW = "its files have 10 decimals: it is named by the trace and the determinant of its map"
VERLET = "velocity-verlet"

ENGINE = Engine(
    name="cp2k", title="CP2K", module="struct", start=start, version=version,
    methods=named(by_name("nve", VERLET, "ensemble NVE, FIST, an external potential", SPRINGS, note=FEW)),
    arithmetic=lambda label: Arithmetic(name="10 decimals", state=1e-10, force=1e-10),
)  # fmt: skip
