"""i-PI by its scripting interface, in atomic units: its harmonic driver, nve and nvt of one bead."""

import os
import signal
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from springs import SPRINGS, placed

from springcheck.engines import Engine, named
from springcheck.engines.contract import by_name, installed_version, thermostat
from springcheck.errors import MethodError

DYNAMICS = (
    "<dynamics mode='{mode}' splitting='{splitting}'><timestep units='atomic_unit'>{step!r}</timestep>"
    "{bath}</dynamics>"
)
LANGEVIN = "<thermostat mode='langevin'><tau units='atomic_unit'>{tau!r}</tau></thermostat>"
INPUT = """<simulation verbosity='quiet'><output prefix='{folder}/out'></output>
<prng><seed>{seed}</seed></prng>
<ffdirect name='spring' threaded='False'><latency>1e-6</latency>
<pes>harmonic</pes><parameters>{{k1: {k!r}}}</parameters></ffdirect>
<system><initialize nbeads='1'><file mode='xyz'>{folder}/start.xyz</file>
<masses mode='manual' units='atomic_unit'>[{masses}]</masses></initialize>
<forces><force forcefield='spring'></force></forces>
<ensemble><temperature units='atomic_unit'>{kT!r}</temperature></ensemble>
<motion mode='dynamics'><fixcom>False</fixcom>{dynamics}</motion></system></simulation>
"""


class Simulation:
    """A run of all particles at once; the driver has one stiffness, along all three axes."""

    def __init__(self, scene: Any, method: Any, label: Any, step: float, seed: int = 1) -> None:
        from ipi.scripting import InteractiveSimulation
        from ipi.utils.softexit import softexit

        x, v, pull, at = placed(scene)
        k = float(np.max(pull))
        if len(np.unique(pull[:, 0])) > 1 or np.any(at):
            raise MethodError("i-PI's harmonic driver has one stiffness, and its wall at 0")
        mode, _, splitting = method.name.partition("-")
        bath = scene.bath if method.generator else None
        dynamics = DYNAMICS.format(
            mode=mode, splitting=splitting or "obabo", step=step,
            bath=LANGEVIN.format(tau=1 / bath.friction) if bath else "",
        )  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            rows = "".join("H 0 0 0\n" for _ in x)
            Path(folder, "start.xyz").write_text(f"{len(x)}\n# CELL(abcABC): 99 99 99 90 90 90\n{rows}")
            text = INPUT.format(
                folder=folder, seed=seed, k=k, masses=", ".join(map(repr, scene.masses.tolist())),
                kT=float(scene.thermal) if bath else 1.0, dynamics=dynamics,
            )  # fmt: skip
            before, kept = os.getcwd(), [(x, signal.getsignal(x)) for x in (signal.SIGINT, signal.SIGTERM)]
            os.chdir(folder)
            try:
                self._run = InteractiveSimulation(text)
            finally:
                os.chdir(before)
                # it takes both for itself, and writes a file RESTART after every call and at the end
                softexit.flist.clear()
                self._run.chk.write = lambda **how: None
                for number, handler in kept:
                    signal.signal(number, handler)
        self._where, self.force_calls = scene.where, 0
        beads = self._run.syslist[0].beads
        beads.q[0], beads.p[0] = x.ravel(), (v * scene.masses[:, None]).ravel()

    def advance(self, every: int, q: Any, p: Any) -> None:
        """Fill rows of positions and momenta, each `every` steps after the one before."""
        for i in range(len(q)):
            self._run.run(every, write_outputs=False)
            beads = self._run.syslist[0].beads
            q[i], p[i] = (np.array(a[0])[self._where] for a in (beads.q, beads.p))
        self.force_calls += every * len(q)


ENGINE = Engine(
    name="ipi", title="i-PI", distribution="ipi", start=Simulation, version=installed_version("ipi"),
    methods=named(by_name("nve", "velocity-verlet", "dynamics, mode nve, one bead", SPRINGS)),
    thermostats=named(
        thermostat("nvt-obabo", "obabo", "langevin thermostat, splitting obabo", "NumPy, MT19937", SPRINGS),
        thermostat("nvt-baoab", "baoab", "langevin thermostat, splitting baoab", "NumPy, MT19937", SPRINGS),
    ),
)  # fmt: skip
