"""springcheck's own methods: the blog's two loops, and every scheme of the catalogue beside them.

Three of them belong to what a scene runs unasked: explicit, semi-implicit and implicit Euler.  The others
are there for whoever names them, in a scene's `include` or by `--method`.
"""

from __future__ import annotations

from springcheck.engines.contract import EVERY_FORCE, SPRINGS, Engine, Method, Need, deferred, named
from springcheck.schemes import SCHEMES, Scheme

NAMES = {"explicit-euler": "euler"}
"""Methods named otherwise than their scheme."""

ABOUT = {
    "explicit-euler": "explicit Euler: both from the old state",
    "semi-implicit-euler": "kick, then drift with the new momentum",
    "implicit-euler": "both from the new state",
}
"""The methods that a scene runs unasked, and what to say of them."""


def _requires(scheme: Scheme) -> frozenset[Need]:
    if scheme.mixes:
        return frozenset({Need.FAST_SPRINGS})
    return frozenset({Need.DAMPING} if any(kind == "friction" for kind, _ in scheme.stages) else ())


def _method(scheme: Scheme) -> Method:
    return Method(
        name=NAMES.get(scheme.name, scheme.name),
        scheme=scheme.name,
        about=ABOUT.get(scheme.name, scheme.title),
        terms=SPRINGS | {"damping"} if scheme.implicit else EVERY_FORCE,
        kinds=frozenset({"particles", "circuit", "rotor"}),
        requires=_requires(scheme),
        default=scheme.name in ABOUT,
    )


_SCHEMES = sorted(
    (scheme for scheme in SCHEMES.values() if scheme.one_step),
    key=lambda scheme: (*ABOUT, scheme.name).index(scheme.name) if scheme.name in ABOUT else len(ABOUT),
)

ENGINE = Engine(
    name="own",
    title="springcheck",
    methods=named(*map(_method, _SCHEMES)),
    # compiled
    step_seconds=4e-9,
    convention=lambda method: "positions and momenta belong to the same time",
    **deferred(f"{__name__}.simulation"),
)
