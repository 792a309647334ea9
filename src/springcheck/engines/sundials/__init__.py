"""SUNDIALS through scikit-sundae: CVODE's Adams and BDF, and IDA for circuits, judged by tolerance."""

from __future__ import annotations

from springcheck.engines.contract import EVERY_FORCE, EVERY_KIND, SPRINGS, Engine, Method, deferred, named


def _method(name: str, about: str) -> Method:
    return Method(
        name=name,
        scheme=name,
        about=about,
        adaptive=True,
        terms=EVERY_FORCE,
        kinds=EVERY_KIND,
    )


ENGINE = Engine(
    name="sundials",
    title="SUNDIALS (scikit-sundae)",
    distribution="scikit-sundae",
    module="sksundae",
    methods=named(
        _method("adams", "CVODE, Adams-Moulton of orders 1 to 12"),
        _method("bdf", "CVODE, backward differentiation of orders 1 to 5"),
        Method(
            name="ida",
            scheme="ida",
            about="IDA: Kirchhoff's laws as they stand, unsolved for the currents",
            adaptive=True,
            terms=SPRINGS | {"damping"},
            kinds=frozenset({"circuit"}),
        ),
    ),
    step_seconds=6e-5,
    **deferred(f"{__name__}.simulation", "internal_steps"),
)
