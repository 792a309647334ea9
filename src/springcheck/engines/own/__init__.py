"""springcheck's own methods: the blog's two loops and their relatives."""

from __future__ import annotations

from springcheck.engines.contract import Engine, Method, deferred, named

_KINDS = frozenset({"particles", "circuit", "rotor"})
_LINEAR = frozenset({"wall-spring", "spring", "damping"})
_TERMS = _LINEAR | {"quartic", "cosine", "morse"}


def _method(name: str, scheme: str, about: str, terms: frozenset[str] = _TERMS) -> Method:
    return Method(name=name, scheme=scheme, about=about, terms=terms, kinds=_KINDS)


ENGINE = Engine(
    name="own",
    title="springcheck",
    methods=named(
        _method("euler", "explicit-euler", "explicit Euler: both from the old state"),
        _method("semi-implicit-euler", "semi-implicit-euler", "kick, then drift with the new momentum"),
        _method("implicit-euler", "implicit-euler", "both from the new state", _LINEAR),
    ),
    # compiled
    step_seconds=4e-9,
    **deferred(f"{__name__}.simulation"),
)
