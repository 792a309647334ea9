"""openmmtools' splittings by name: its LangevinIntegrator, whose letters V, R and O are B, A and O here.

python validation/engines/table.py --thermostats --method 'openmmtools:*' --engine .../openmmtools_.py
"""

from __future__ import annotations

import contextlib
import io
from typing import Any

from springcheck.engines import Engine, Label, Method
from springcheck.physics.scene import Scene

SPLITTINGS = {
    "V R O R V": "baoab", "O V R V O": "obabo", "R V O V R": "aboba", "O R V R O": "oabao",
    "R O V O R": "aoboa", "V O R O V": "boaob",
}  # fmt: skip
"""The schemes that they are."""


def _integrators() -> Any:
    # it says on standard error that a library of its own would be faster with another
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        from openmmtools import integrators
    return integrators


def start(scene: Scene, method: Method, label: Label, step: float, seed: int | None = None) -> Any:
    """OpenMM's own simulation of the scene, moved by an integrator of openmmtools."""
    import openmm as mm

    from springcheck.engines.openmm import simulation
    from springcheck.engines.openmm.thermostats import BOLTZMANN

    integrators = _integrators()

    def made(scene: Scene, name: str, step: float, seed: int = 0, system: Any = None) -> Any:
        unit = mm.unit
        if scene.bath is None:
            return integrators.VelocityVerletIntegrator(step * unit.picosecond)
        found = integrators.LangevinIntegrator(
            temperature=scene.thermal / BOLTZMANN * unit.kelvin,
            collision_rate=scene.bath.friction / unit.picosecond, timestep=step * unit.picosecond,
            splitting=method.about.partition("'")[2].rstrip("'"),
        )  # fmt: skip
        found.setRandomNumberSeed(seed)
        return found

    before = simulation.thermostat, simulation._integrator
    simulation.thermostat, simulation._integrator = made, made  # type: ignore[assignment]
    try:
        return simulation.start(scene, method, label, step, **({} if seed is None else {"seed": seed}))
    finally:
        simulation.thermostat, simulation._integrator = before


def version() -> dict[str, str]:
    """Versions of openmmtools and of OpenMM."""
    from importlib.metadata import version as of

    return {name: of(name) for name in ("openmmtools", "openmm")}


TERMS = frozenset({"wall-spring", "spring"})

ENGINE = Engine(
    name="openmmtools",
    title="openmmtools",
    distribution="openmmtools",
    methods={
        "velocity-verlet": Method(
            name="velocity-verlet",
            scheme="velocity-verlet",
            about="VelocityVerletIntegrator",
            terms=TERMS,
            default=False,
        )
    },
    thermostats={
        name: Method(
            name=name,
            scheme=name,
            about=f"LangevinIntegrator, splitting '{letters}'",
            terms=TERMS,
            generator="OpenMM, SFMT",
            rebuilds_velocity=True,
        )
        for letters, name in SPLITTINGS.items()
    },
    start=start,
    version=version,
    any_axis=True,
    squares_lengths=True,
)
