"""ASE: atoms with a short calculator of springs, moved by ase.md."""

from __future__ import annotations

from functools import partial

from springcheck.engines.contract import (
    EVERY_POTENTIAL,
    Engine,
    by_default,
    deferred,
    named,
    thermostat,
)

_drawn = partial(thermostat, generator="NumPy, PCG64", terms=EVERY_POTENTIAL, rebuilds_velocity=True)

ENGINE = Engine(
    name="ase",
    title="ASE",
    reference="A. H. Larsen et al., The atomic simulation environment, J. Phys.: Condens. Matter 29, 273002 "
    "(2017), doi:10.1088/1361-648X/aa680e",
    distribution="ase",
    methods=named(
        by_default("velocity-verlet", "velocity-verlet", "ase.md.verlet.VelocityVerlet", EVERY_POTENTIAL),
    ),
    thermostats=named(
        _drawn("langevin", "vanden-eijnden-ciccotti", "ase.md.langevin.Langevin", scripted=True),
        _drawn("langevin-baoab", "baoab", "ase.md.langevinbaoab.LangevinBAOAB"),
        _drawn("andersen", "andersen-after-kick", "ase.md.andersen.Andersen"),
        _drawn("bussi", "bussi-unsigned", "ase.md.bussi.Bussi", scripted=True, default=False),
    ),
    any_axis=True,
    **deferred(f"{__name__}.simulation", "arithmetic"),
)  # fmt: skip
