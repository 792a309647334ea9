"""SUNDIALS through scikit-sundae: CVODE's Adams and BDF, and IDA for circuits, judged by tolerance."""

from __future__ import annotations

from springcheck.engines.contract import (
    BRAKES,
    DRIVEN,
    EVERY_FORCE,
    EVERY_KIND,
    SPRINGS,
    Engine,
    by_default,
    deferred,
    named,
)

_TERMS = EVERY_FORCE | DRIVEN | BRAKES
_SOLVER = {"adaptive": True, "kinds": EVERY_KIND}

ENGINE = Engine(
    name="sundials",
    title="SUNDIALS (scikit-sundae)",
    reference="A. C. Hindmarsh et al., SUNDIALS, ACM Trans. Math. Softw. 31, 363 (2005), "
    "doi:10.1145/1089014.1089020",
    distribution="scikit-sundae",
    module="sksundae",
    methods=named(
        by_default("adams", "adams", "CVODE, Adams-Moulton of orders 1 to 12", _TERMS, **_SOLVER),
        by_default("bdf", "bdf", "CVODE, backward differentiation of orders 1 to 5", _TERMS, **_SOLVER),
        by_default(
            "ida", "ida", "IDA: Kirchhoff's laws as they stand, unsolved for the currents",
            SPRINGS | {"damping"}, adaptive=True, kinds=frozenset({"circuit"}),
        ),
    ),
    any_axis=True,
    **deferred(f"{__name__}.simulation"),
)  # fmt: skip
