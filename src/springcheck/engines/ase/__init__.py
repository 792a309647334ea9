"""ASE: atoms with a short calculator of springs, moved by ase.md."""

from __future__ import annotations

from springcheck.engines.contract import ANY_POTENTIAL, Engine, Method, deferred, named

ENGINE = Engine(
    name="ase",
    title="ASE",
    distribution="ase",
    methods=named(
        Method(
            name="velocity-verlet",
            scheme="velocity-verlet",
            about="ase.md.verlet.VelocityVerlet",
            terms=frozenset({ANY_POTENTIAL, "wall-spring", "spring", "quartic", "cosine", "morse"}),
        )
    ),
    step_seconds=3e-4,
    **deferred(f"{__name__}.simulation"),
)
