"""ASE: atoms with a short calculator of springs, moved by ase.md."""

from __future__ import annotations

from functools import partial

from springcheck.engines.contract import (
    EVERY_POTENTIAL,
    RODS,
    Engine,
    Need,
    by_default,
    deferred,
    named,
    thermostat,
)

_drawn = partial(thermostat, generator="NumPy, PCG64", terms=EVERY_POTENTIAL, rebuilds_velocity=True)

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
        _drawn("langevin", "vanden-eijnden-ciccotti", "ase.md.langevin.Langevin", scripted=True),
        _drawn(
            "langevin-rods", "vanden-eijnden-ciccotti",
            "ase.md.langevin.Langevin with FixBondLengths, tolerance 1e-13", scripted=True,
            terms=EVERY_POTENTIAL | RODS, requires=frozenset({Need.RODS}),
        ),
        _drawn("langevin-baoab", "baoab", "ase.md.langevinbaoab.LangevinBAOAB"),
        _drawn("andersen", "andersen-after-kick", "ase.md.andersen.Andersen"),
        _drawn("bussi", "bussi-unsigned", "ase.md.bussi.Bussi", scripted=True, default=False),
    ),
    any_axis=True,
    # of A sqrt(u/eV)
    picosecond=98.22694788,
    **deferred(f"{__name__}.simulation", "arithmetic"),
)  # fmt: skip
