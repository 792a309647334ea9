"""ASE: atoms with a short calculator of springs, moved by ase.md."""

from __future__ import annotations

from springcheck.engines.contract import (
    EVERY_POTENTIAL,
    NO_NUMBERS,
    RODS,
    Engine,
    Need,
    by_default,
    deferred,
    named,
    thermostat,
)

_DRAWS = "NumPy, PCG64"

ENGINE = Engine(
    name="ase",
    title="ASE",
    distribution="ase",
    methods=named(
        by_default("velocity-verlet", "velocity-verlet", "ase.md.verlet.VelocityVerlet", EVERY_POTENTIAL),
        by_default(
            "rattle", "velocity-verlet", "ase.md.verlet.VelocityVerlet with FixBondLengths, tolerance 1e-13",
            EVERY_POTENTIAL | RODS, Need.RODS, rebuilds_velocity=True,
        ),
    ),
    thermostats=named(
        thermostat(
            "langevin", "vanden-eijnden-ciccotti", "ase.md.langevin.Langevin", _DRAWS, EVERY_POTENTIAL,
            scripted=True, rebuilds_velocity=True,
        ),
        thermostat(
            "langevin-rods", "vanden-eijnden-ciccotti",
            "ase.md.langevin.Langevin with FixBondLengths, tolerance 1e-13", _DRAWS, EVERY_POTENTIAL | RODS,
            scripted=True, rebuilds_velocity=True, requires=frozenset({Need.RODS}),
        ),
        thermostat(
            "langevin-baoab", "baoab", "ase.md.langevinbaoab.LangevinBAOAB", _DRAWS, EVERY_POTENTIAL,
            rebuilds_velocity=True,
        ),
        thermostat(
            "andersen", "andersen-after-kick", "ase.md.andersen.Andersen", _DRAWS, EVERY_POTENTIAL,
            rebuilds_velocity=True,
        ),
        thermostat(
            "bussi", "bussi-unsigned", "ase.md.bussi.Bussi", _DRAWS, EVERY_POTENTIAL, scripted=True,
            rebuilds_velocity=True, default=False,
        ),
        thermostat(
            "nose-hoover", "nose-hoover-fourth", "ase.md.nose_hoover_chain.NoseHooverChainNVT", NO_NUMBERS,
            EVERY_POTENTIAL, default=False,
            note="it counts three degrees of freedom for each atom, whatever is fixed of it",
        ),
    ),
    any_axis=True,
    **deferred(f"{__name__}.simulation", "arithmetic"),
)  # fmt: skip
