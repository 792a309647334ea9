"""OpenMM: particles tied by HarmonicBondForce, moved by its own integrators."""

from __future__ import annotations

from springcheck.engines.contract import ANY_POTENTIAL, EVERY_POTENTIAL, Engine, Method, Need, deferred, named

_TERMS = EVERY_POTENTIAL - {ANY_POTENTIAL}

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
    requires: Need | None = None,
    one_friction: bool = False,
    default: bool = True,
) -> Method:
    return Method(
        name=name,
        scheme=scheme,
        about=about,
        terms=_TERMS - {lacks} | ({terms} if terms else set()),
        requires=frozenset({requires} if requires else ()),
        rebuilds_velocity=rebuilds,
        one_friction=one_friction,
        default=default,
    )


ENGINE = Engine(
    name="openmm",
    title="OpenMM",
    distribution="openmm",
    platforms=_PLATFORMS,
    methods=named(
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
            requires=Need.DAMPING,
            one_friction=True,
        ),
        _method("mts", "respa8", "MTSIntegrator, fast springs 8 times a step", requires=Need.FAST_SPRINGS),
        _method(
            "langevin",
            "langevin-middle",
            "LangevinIntegrator at T = 0, started and read synchronised",
            terms="damping",
            requires=Need.DAMPING,
            one_friction=True,
            default=False,
        ),
        _method(
            "nose-hoover",
            "semi-implicit-euler",
            "NoseHooverIntegrator without a thermostat, handed p0 as it is",
            default=False,
        ),
    ),
    atlas=tuple(f"verlet@{place}" for place in ("CPU", "OpenCL-single", "OpenCL-mixed", "OpenCL-double")),
    step_seconds=8e-7,
    squares_lengths=True,
    **deferred(f"{__name__}.simulation", "arithmetic", "convention"),
)
