"""OpenMM: particles tied by HarmonicBondForce, moved by its own integrators."""

from __future__ import annotations

from functools import partial

from springcheck.engines.contract import (
    ANY_DISTANCE,
    ANY_POTENTIAL,
    DRIVEN,
    EVERY_POTENTIAL,
    Engine,
    Need,
    by_default,
    by_name,
    deferred,
    named,
    thermostat,
)

_TERMS = EVERY_POTENTIAL - {ANY_POTENTIAL} | {ANY_DISTANCE}
_DRIVEN = _TERMS | DRIVEN

_ON_A_LINE = _TERMS - {"morse"}
"""The terms that noise across the line does not bend: a bond of rest length 0 pulls along each axis alike."""

_drawn = partial(thermostat, generator="OpenMM, SFMT", terms=_ON_A_LINE, rebuilds_velocity=True)

_GPU = ("OpenCL", "CUDA", "HIP")
_PRECISIONS = ("", "-single", "-mixed", "-double")
_PLATFORMS = ("Reference", "CPU", *(name + precision for name in _GPU for precision in _PRECISIONS))


ENGINE = Engine(
    name="openmm",
    title="OpenMM",
    reference="P. Eastman et al., OpenMM 8, J. Phys. Chem. B 128, 109 (2024), doi:10.1021/acs.jpcb.3c06662",
    distribution="openmm",
    platforms=_PLATFORMS,
    methods=named(
        by_default(
            "verlet", "velocity-verlet", "VerletIntegrator, started and read synchronised", _DRIVEN,
            rebuilds_velocity=True,
        ),
        by_default(
            "leapfrog", "semi-implicit-euler", "VerletIntegrator, handed p0 as it is", _DRIVEN,
            rebuilds_velocity=True,
            note="velocities half a step early, as documented; openmm#4929"),
        # a growing motion would invert a Morse bond, of which OpenMM knows only the length
        by_default("euler", "explicit-euler", "explicit Euler by CustomIntegrator", _DRIVEN - {"morse"},
            note="a CustomIntegrator of ours, as a user may write it"),
        by_default(
            "semi-implicit-euler", "semi-implicit-euler", "kick-drift Euler by CustomIntegrator", _DRIVEN
        ),
        by_default(
            "langevin-middle", "langevin-middle",
            "LangevinMiddleIntegrator at T = 0, started and read synchronised", _DRIVEN | {"damping"},
            Need.DAMPING, one_friction=True,
        ),
        by_default("mts", "respa8", "MTSIntegrator, 8 steps of fast springs", _TERMS, Need.FAST_SPRINGS),
        by_name(
            "langevin", "langevin-middle", "LangevinIntegrator at T = 0, started and read synchronised",
            _DRIVEN | {"damping"}, Need.DAMPING, one_friction=True,
        ),
        by_name(
            "nose-hoover", "semi-implicit-euler",
            "NoseHooverIntegrator without a thermostat, handed p0 as it is", _DRIVEN,
        ),
    ),
    thermostats=named(
        _drawn("langevin-middle-bath", "baoa", "LangevinMiddleIntegrator, as it stores velocities"),
        _drawn(
            "langevin-middle-synchronised", "baoab",
            "LangevinMiddleIntegrator, half a kick added to what is read",
        ),
        _drawn("langevin-bath", "baoa", "LangevinIntegrator, as it stores velocities", default=False),
        _drawn("brownian", "brownian", "BrownianIntegrator", default=False),
        _drawn(
            "andersen", "andersen-leapfrog",
            "VerletIntegrator with AndersenThermostat, as it stores velocities",
            note="on GPU platforms it collides at most 2/pi as often as asked",
        ),
        _drawn(
            "mts-langevin", "baoab", "MTSLangevinIntegrator, one group of forces once per step",
            default=False, rebuilds_velocity=False,
        ),
    ),
    atlas=tuple(f"verlet@{place}" for place in ("CPU", "OpenCL-single", "OpenCL-mixed", "OpenCL-double")),
    any_axis=True,
    squares_lengths=True,
    **deferred(f"{__name__}.simulation", "arithmetic", "convention"),
)  # fmt: skip
