"""springcheck's own methods: the blog's two loops, and every scheme of the catalogue.

Three of them run by default: explicit, semi-implicit and implicit Euler.  The others are run by name, in a
scene's `include` or by `--method`.
"""

from __future__ import annotations

from springcheck.bath import THERMOSTATS
from springcheck.engines.contract import (
    BRAKES,
    DRIVEN,
    EVERY_FORCE,
    EVERY_KIND,
    EVERY_POTENTIAL,
    SPRINGS,
    Engine,
    Method,
    Need,
    deferred,
    named,
    thermostat,
)
from springcheck.schemes import SCHEMES, Scheme

NAMES = {"explicit-euler": "euler"}
"""Methods whose names differ from their scheme's."""

ABOUT = {
    "explicit-euler": "explicit Euler: both from the old state",
    "semi-implicit-euler": "kick, then drift with the new momentum",
    "implicit-euler": "both from the new state",
}
"""The methods that a scene runs by default, and their descriptions."""

BY_DEFAULT = {"baoab", "baoa", "aboba", "obabo", "oabao", "gj-i", "bbk"}
"""The thermostats that a scene with a bath runs by default."""


def _requires(scheme: Scheme) -> frozenset[Need]:
    if scheme.has("mixes"):
        return frozenset({Need.FAST_SPRINGS})
    return frozenset({Need.DAMPING} if any(kind.friction for kind in scheme.kinds) else ())


def _terms(scheme: Scheme) -> frozenset[str]:
    if scheme.has("implicit"):
        return SPRINGS | BRAKES | {"damping"}
    return EVERY_FORCE | (BRAKES if scheme.has("plain") or scheme.b else frozenset())


def _method(scheme: Scheme) -> Method:
    return Method(
        name=NAMES.get(scheme.name, scheme.name),
        scheme=scheme.name,
        about=ABOUT.get(scheme.name, scheme.title),
        terms=DRIVEN | _terms(scheme),
        kinds=EVERY_KIND,
        requires=_requires(scheme),
        default=scheme.name in ABOUT,
    )


_SCHEMES = sorted(
    (scheme for scheme in SCHEMES.values() if scheme.has("one-step")),
    key=lambda scheme: [*ABOUT, scheme.name].index(scheme.name),
)

ENGINE = Engine(
    name="own",
    title="springcheck",
    methods=named(*map(_method, _SCHEMES)),
    any_axis=True,
    convention=lambda method: "positions and momenta belong to the same time",
    thermostats=named(
        *(
            thermostat(
                one.name, one.name, one.title, "NumPy, PCG64", EVERY_POTENTIAL, scripted=True,
                kinds=EVERY_KIND, default=one.name in BY_DEFAULT,
            )
            for one in THERMOSTATS.values()
        )
    ),
    **deferred(f"{__name__}.simulation"),
)  # fmt: skip
