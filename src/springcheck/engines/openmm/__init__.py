"""OpenMM: particles tied by HarmonicBondForce, moved by its own integrators."""

from __future__ import annotations

from typing import Any

from springcheck.engines.contract import ANY_POTENTIAL, EVERY_POTENTIAL, Engine, Method, Need, deferred, named

_TERMS = EVERY_POTENTIAL - {ANY_POTENTIAL}

_GPU = ("OpenCL", "CUDA", "HIP")
_PRECISIONS = ("", "-single", "-mixed", "-double")
_PLATFORMS = ("Reference", "CPU", *(name + precision for name in _GPU for precision in _PRECISIONS))


_LANGEVIN: dict[str, Any] = {
    "scheme": "langevin-middle",
    "terms": _TERMS | {"damping"},
    "requires": frozenset({Need.DAMPING}),
    "one_friction": True,
}


def _method(name: str, scheme: str, about: str, **more: Any) -> Method:
    return Method(name=name, scheme=scheme, about=about, **{"terms": _TERMS, **more})


ENGINE = Engine(
    name="openmm",
    title="OpenMM",
    distribution="openmm",
    platforms=_PLATFORMS,
    methods=named(
        _method(
            "verlet", "velocity-verlet", "VerletIntegrator, started and read synchronised",
            rebuilds_velocity=True,
        ),
        _method(
            "leapfrog", "semi-implicit-euler", "VerletIntegrator, handed p0 as it is", rebuilds_velocity=True
        ),
        # its growing motion would turn a Morse bond over, of which OpenMM knows only the length
        _method("euler", "explicit-euler", "explicit Euler by CustomIntegrator", terms=_TERMS - {"morse"}),
        _method("semi-implicit-euler", "semi-implicit-euler", "kick-drift Euler by CustomIntegrator"),
        Method(
            name="langevin-middle", about="LangevinMiddleIntegrator at T = 0, started and read synchronised",
            **_LANGEVIN,
        ),
        _method(
            "mts", "respa8", "MTSIntegrator, fast springs 8 times a step",
            requires=frozenset({Need.FAST_SPRINGS}),
        ),
        Method(
            name="langevin", about="LangevinIntegrator at T = 0, started and read synchronised",
            default=False, **_LANGEVIN,
        ),
        _method(
            "nose-hoover", "semi-implicit-euler",
            "NoseHooverIntegrator without a thermostat, handed p0 as it is", default=False,
        ),
    ),
    atlas=tuple(f"verlet@{place}" for place in ("CPU", "OpenCL-single", "OpenCL-mixed", "OpenCL-double")),
    step_seconds=8e-7,
    squares_lengths=True,
    **deferred(f"{__name__}.simulation", "arithmetic", "convention"),
)  # fmt: skip
