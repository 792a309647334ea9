"""Real engines, named from what they wrote: scheme, steps to a frame, convention and arithmetic.

GPU-type platforms of OpenMM cut forces off at multiples of 2**-32 in every mode and keep stiffnesses in
single precision.  An adaptive solver has no step, whatever fits within the scatter of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import springcheck
from springcheck.identify import Identification, identify
from springcheck.physics.trajectory import Trajectory

PRECISIONS = {"double": "fixed-point force", "mixed": "mixed", "single": "single"}
GRID = (("spring", (1, 5)), ("spring-uneven", (2, 10)))
"""Scenes and steps to a frame."""

SCHEMES_OF = {
    "verlet": "velocity-verlet",
    "leapfrog": "semi-implicit-euler",
    "euler": "explicit-euler",
    "semi-implicit-euler": "semi-implicit-euler",
}


MASSES = {name: springcheck.load_scene(name).m for name, _ in GRID}


def run(scene: str, label: str, every: int, tolerance: float = 1e-12) -> tuple[Trajectory, Identification]:
    chosen = replace(springcheck.load_scene(scene), every=every, tolerance=tolerance)
    made = springcheck.simulate(chosen, label)
    return made, identify(made.t, made.q, made.p, mass=chosen.m)


@pytest.mark.campaign
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("method", SCHEMES_OF)
def test_openmm_on_a_gpu_type_platform_is_named_with_its_arithmetic(
    method: str, precision: str, need: Callable[[str], None]
) -> None:
    label = f"openmm:{method}@OpenCL-{precision}"
    need(label)
    # every method and every precision meets both scenes: a context of such a platform takes longer than its
    # steps, so one run serves both strides too
    scene, strides = GRID[(list(SCHEMES_OF).index(method) + list(PRECISIONS).index(precision)) % 2]
    made, _ = run(scene, label, 1)
    for every in strides:
        found = identify(made.t[::every], made.q[::every], made.p[::every], mass=MASSES[scene])
        told = found.scheme, found.stride, found.precision, found.fits
        assert told == (SCHEMES_OF[method], every, PRECISIONS[precision], True), (scene, every, found)


@pytest.mark.parametrize(
    ("label", "scheme"),
    [
        ("openmm:verlet", "velocity-verlet"),
        ("openmm:leapfrog", "semi-implicit-euler"),
        ("openmm:semi-implicit-euler", "semi-implicit-euler"),
        ("openmm:euler@CPU", "explicit-euler"),
        ("ase:velocity-verlet", "velocity-verlet"),
        ("own:implicit-euler", "implicit-euler"),
    ],
)
def test_engines_in_double_precision_are_called_that(
    label: str, scheme: str, need: Callable[[str], None]
) -> None:
    need(label)
    for scene, strides in GRID:
        for every in strides:
            _, found = run(scene, label, every)
            told = found.scheme, found.stride, found.precision, found.fits
            assert told == (scheme, every, "double", True), (scene, every, found)


def test_a_stated_stiffness_is_compared_in_the_single_precision_of_the_platform(
    need: Callable[[str], None],
) -> None:
    need("openmm:verlet@OpenCL-double")
    made, _ = run("spring-uneven", "openmm:verlet@OpenCL-double", 1)
    right = identify(made.t, made.q, made.p, mass=3.7, stiffness=2.9, step=0.1)
    assert right.fits
    assert any("in single precision" in note for note in right.notes)
    assert not identify(made.t, made.q, made.p, mass=3.7, stiffness=2.9 * (1 + 1e-6)).fits


@pytest.mark.parametrize("label", ["sundials:adams", "sundials:bdf"])
def test_sundials_is_no_scheme_of_many_small_steps(label: str, need: Callable[[str], None]) -> None:
    need(label)
    for scene, strides in GRID:
        for every in strides:
            for tolerance in (1e-12, 1e-9):
                _, found = run(scene, label, every, tolerance)
                told = found.scheme, found.fits, found.nearest
                assert told == (None, False, "exact"), (scene, every, tolerance, found)


@pytest.mark.parametrize("method", ["RK45", "DOP853", "LSODA"])
def test_no_tolerance_makes_an_adaptive_solver_a_scheme(method: str) -> None:
    m, k, t = 0.05, 40.0, np.arange(151) * 0.02
    for tolerance in (1e-3, 1e-7, 1e-11):
        z = solve_ivp(
            lambda t, z: [z[1] / m, -k * z[0]],
            (0, t[-1]),
            [0.1, 0.03],
            method=method,
            t_eval=t,
            rtol=tolerance,
            atol=tolerance / 100,
        ).y
        assert identify(t, z[0], z[1], mass=m).verdict == "none"


def test_errors_of_the_size_of_a_coarse_force_but_in_positions_are_not_taken_for_one() -> None:
    # the same size in drifts is no force's: explicit Euler moves positions by velocities alone
    m, k, h = 3.7, 2.9, 0.1
    noise = np.random.default_rng(3)
    for where in ("force", "noise", "position"):
        q, p = [0.3], [0.7]
        for _ in range(200):
            off = 2.0**-32 * noise.uniform(-1, 0)
            force, shift = -k * q[-1], off * (where == "position")
            if where == "force":
                force = np.floor(force * 2.0**32) / 2.0**32
            if where == "noise":
                force += off
            q.append(q[-1] + h * p[-1] / m + h * shift)
            p.append(p[-1] + h * force)
        found = identify(h * np.arange(201), np.array(q), np.array(p), mass=m)
        told = (found.scheme, found.precision, found.fits)
        assert told == (
            ("explicit-euler", "fixed-point force", True) if where == "force" else (None, "unknown", False)
        )
