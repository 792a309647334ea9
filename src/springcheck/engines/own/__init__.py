"""springcheck's own methods: the blog's two loops and their relatives."""

from __future__ import annotations

from springcheck.engines import Engine
from springcheck.engines.contract import Method

_KINDS = frozenset({"particles", "circuit", "rotor"})
_LINEAR = frozenset({"wall-spring", "spring", "damping"})
_TERMS = _LINEAR | {"quartic", "cosine", "morse"}


def _method(name: str, scheme: str, about: str, terms: frozenset[str] = _TERMS) -> Method:
    return Method(engine="own", name=name, scheme=scheme, about=about, terms=terms, kinds=_KINDS)


ENGINE = Engine(
    name="own",
    title="springcheck",
    distribution="",
    module="",
    methods={
        method.name: method
        for method in (
            _method("euler", "explicit-euler", "explicit Euler: both from the old state"),
            _method("semi-implicit-euler", "semi-implicit-euler", "kick, then drift with the new momentum"),
            _method("implicit-euler", "implicit-euler", "both from the new state", _LINEAR),
        )
    },
)
