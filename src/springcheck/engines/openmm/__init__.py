"""OpenMM: particles tied by HarmonicBondForce, moved by its own integrators."""

from __future__ import annotations

from springcheck.engines import Engine
from springcheck.engines.contract import Method

_TERMS = frozenset({"wall-spring", "spring", "quartic", "cosine", "morse"})

_GPU = ("OpenCL", "CUDA", "HIP")
_PRECISIONS = ("", "-single", "-mixed", "-double")
_PLATFORMS = ("Reference", "CPU", *(name + precision for name in _GPU for precision in _PRECISIONS))


def _method(
    name: str,
    scheme: str,
    about: str,
    *,
    rebuilds: bool = False,
    lacks: str = "",
    terms: str = "",
    requires: str = "",
) -> Method:
    return Method(
        engine="openmm",
        name=name,
        scheme=scheme,
        about=about,
        terms=_TERMS - {lacks} | ({terms} if terms else set()),
        requires=frozenset({requires} if requires else ()),
        rebuilds_velocity=rebuilds,
    )


ENGINE = Engine(
    name="openmm",
    title="OpenMM",
    distribution="openmm",
    module="openmm",
    platforms=_PLATFORMS,
    methods={
        method.name: method
        for method in (
            _method(
                "verlet", "velocity-verlet", "VerletIntegrator, started and read synchronised", rebuilds=True
            ),
            _method("leapfrog", "semi-implicit-euler", "VerletIntegrator, handed p0 as it is", rebuilds=True),
            # its growing motion would turn a Morse bond over, of which OpenMM knows only the length
            _method("euler", "explicit-euler", "explicit Euler by CustomIntegrator", lacks="morse"),
            _method("semi-implicit-euler", "semi-implicit-euler", "kick-drift Euler by CustomIntegrator"),
            _method(
                "langevin-middle",
                "langevin-middle",
                "LangevinMiddleIntegrator at T = 0, started and read synchronised",
                terms="damping",
                requires="damping",
            ),
            _method(
                "mts", "respa8", "MTSIntegrator, fast springs 8 times a step", requires="springs marked fast"
            ),
        )
    },
)
