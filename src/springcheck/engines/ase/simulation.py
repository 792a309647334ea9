"""One spring system in ASE: `Atoms` with a short calculator of springs, moved by ase.md.

ASE counts length in A, energy in eV, mass in u, so that its time unit is A sqrt(u/eV), 10.18 fs.
Reduced scenes map to these one to one; "md" scenes (nm, ps, u) are converted at this border by the
two constants below.  No energy constant takes part: u (nm/ps)**2 is converted by lengths and times,
so the motion cannot depend on the rounding of the mole.
"""

from __future__ import annotations

import warnings
from typing import Any, ClassVar

import ase.units
import numpy as np
from ase import Atoms
from ase.calculators.calculator import Calculator, all_changes
from ase.md.verlet import VelocityVerlet

from springcheck.engines.bonds import off_axis
from springcheck.engines.contract import Label, Method
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.system import System

NANOMETRE = 10.0 * ase.units.Ang
PICOSECOND = 1000.0 * ase.units.fs


def version() -> dict[str, str]:
    """Version of ASE."""
    return {"ase": ase.__version__}


def arithmetic(label: Label) -> Arithmetic:
    """NumPy's double precision; `compare_atoms` treats positions within 1e-15 of each other as equal."""
    return Arithmetic(stale=1e-15)


class Springs(Calculator):  # type: ignore[misc]
    """The terms of a scene, as an ASE calculator.  `length` and `time` are its units."""

    implemented_properties: ClassVar[list[str]] = ["energy", "forces"]
    # compared at every step otherwise, which takes longer than the step: forces follow from positions alone
    ignored_changes: ClassVar[set[str]] = {*all_changes} - {"positions"}

    def __init__(self, system: System[Scene], length: float, time: float) -> None:
        super().__init__()
        self.force_calls = 0
        self._system = system
        self._where = system.scene.where
        self._length = length
        self._of_force = length / time**2

    def calculate(
        self, atoms: Any = None, properties: Any = ("energy",), system_changes: Any = all_changes
    ) -> None:
        super().calculate(atoms, properties, system_changes)
        x = self.atoms.positions.reshape(-1)[self._where]
        q = x if self._length == 1.0 else x / self._length
        if "forces" in properties:
            self.force_calls += 1
            forces = np.zeros((len(self.atoms), 3))
            forces.reshape(-1)[self._where] = self._system.force(q, q)
            if self._of_force != 1.0:
                forces *= self._of_force
            self.results["forces"] = forces
        if "energy" in properties:
            energy = sum(float(term.energy(q)) for term in self._system.terms)
            self.results["energy"] = energy * self._of_force * self._length


def _thermostat(
    name: str, atoms: Atoms, scene: Scene, step: float, time: float, energy: float, seed: Any
) -> Any:
    """ASE's dynamics with noise at this thermal energy [eV], of a seed or a generator.

    ASE takes kelvin, and multiplies by its own constant.
    """
    assert scene.bath is not None
    rng = seed if hasattr(seed, "standard_normal") else np.random.default_rng(seed)
    rate = scene.bath.friction
    given: dict[str, Any] = {"timestep": step * time, "temperature_K": energy / ase.units.kB, "rng": rng}
    if name == "langevin":
        from ase.md.langevin import Langevin

        return Langevin(atoms, friction=rate / time, fixcm=False, **given)
    if name == "andersen":
        from ase.md.andersen import Andersen

        return Andersen(atoms, andersen_prob=-np.expm1(-rate * step), fixcm=False, **given)
    if name == "bussi":
        from ase.constraints import FixCartesian
        from ase.md.bussi import Bussi

        # ASE counts degrees of freedom; axes without motion must not be among them
        fixed = np.ones((scene.particles, 3), np.bool_)
        fixed.reshape(-1)[scene.where] = False
        atoms.set_constraint([FixCartesian(i, mask=tuple(row)) for i, row in enumerate(fixed) if np.any(row)])
        return Bussi(atoms, taut=time / (2 * rate), **given)
    from ase.md.langevinbaoab import LangevinBAOAB

    return LangevinBAOAB(atoms, T_tau=time / rate, **given)


class _Dynamics:
    """ASE's dynamics in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float, seed: Any = None) -> None:
        length, time = (NANOMETRE, PICOSECOND) if scene.units == "md" else (1.0, 1.0)
        positions, momenta = np.zeros((2, scene.particles, 3))
        positions.reshape(-1)[scene.where] = scene.q * length
        momenta.reshape(-1)[scene.where] = scene.p * (length / time)
        self._atoms = Atoms(
            numbers=[0] * scene.particles, positions=positions, masses=scene.masses, momenta=momenta
        )
        self._atoms.calc = Springs(scene.system, length, time)
        if method.generator:
            energy = scene.thermal * (length / time) ** 2
            self._dynamics = _thermostat(method.name, self._atoms, scene, step, time, energy, seed)
        else:
            self._dynamics = VelocityVerlet(self._atoms, timestep=step * time)
        self._on_a_line = not method.generator
        self._length, self._momentum = length, length / time
        self._where, self._elsewhere = scene.where, scene.elsewhere
        self.off_axis, self._steps = 0.0, 0

    @property
    def force_calls(self) -> int:
        """Forces that ASE asked for, those of one state once: positions that are no numbers are unequal to
        themselves, and it asks twice in each step."""
        return min(int(self._atoms.calc.force_calls), 1 + self._steps)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        atoms, run = self._atoms, self._dynamics.run
        # np.errstate would do the same, but slows down every NumPy call inside it: ASE by a tenth
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            for row in range(len(q)):
                self._steps += every
                run(every)
                q[row] = atoms.arrays["positions"].reshape(-1)[self._where] / self._length
                p[row] = atoms.arrays["momenta"].reshape(-1)[self._where] / self._momentum
        if self._on_a_line:
            self.off_axis = max(self.off_axis, off_axis(atoms.positions, self._elsewhere))


start = _Dynamics
