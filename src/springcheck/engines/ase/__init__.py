"""ASE: atoms with a short calculator of springs, moved by ase.md."""

from __future__ import annotations

from springcheck.engines.contract import EVERY_POTENTIAL, Engine, by_default, deferred, named

ENGINE = Engine(
    name="ase",
    title="ASE",
    distribution="ase",
    methods=named(
        by_default("velocity-verlet", "velocity-verlet", "ase.md.verlet.VelocityVerlet", EVERY_POTENTIAL)
    ),
    step_seconds=3e-4,
    **deferred(f"{__name__}.simulation", "arithmetic"),
)
