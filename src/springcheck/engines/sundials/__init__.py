"""SUNDIALS through scikit-sundae: CVODE's Adams and BDF, and IDA for circuits, judged by tolerance."""

from __future__ import annotations

from springcheck.engines import Engine
from springcheck.engines.contract import ANY_POTENTIAL, Method


def _method(name: str, about: str) -> Method:
    return Method(
        engine="sundials",
        name=name,
        scheme=name,
        about=about,
        adaptive=True,
        terms=frozenset({ANY_POTENTIAL, "wall-spring", "spring", "quartic", "cosine", "morse", "damping"}),
        kinds=frozenset({"particles", "circuit", "rotor"}),
    )


ENGINE = Engine(
    name="sundials",
    title="SUNDIALS (scikit-sundae)",
    distribution="scikit-sundae",
    module="sksundae",
    methods={
        method.name: method
        for method in (
            _method("adams", "CVODE, Adams-Moulton of orders 1 to 12"),
            _method("bdf", "CVODE, backward differentiation of orders 1 to 5"),
            Method(
                engine="sundials",
                name="ida",
                scheme="ida",
                about="IDA: Kirchhoff's laws as they stand, unsolved for the currents",
                adaptive=True,
                terms=frozenset({"wall-spring", "spring", "damping"}),
                kinds=frozenset({"circuit"}),
            ),
        )
    },
)
