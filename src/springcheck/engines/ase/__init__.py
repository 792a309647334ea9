"""ASE: atoms with a short calculator of springs, moved by ase.md."""

from __future__ import annotations

from springcheck.engines import Engine
from springcheck.engines.contract import ANY_POTENTIAL, Method

ENGINE = Engine(
    name="ase",
    title="ASE",
    distribution="ase",
    module="ase",
    methods={
        "velocity-verlet": Method(
            engine="ase",
            name="velocity-verlet",
            scheme="velocity-verlet",
            about="ase.md.verlet.VelocityVerlet",
            terms=frozenset({ANY_POTENTIAL, "wall-spring", "spring", "quartic", "cosine", "morse"}),
        )
    },
)
