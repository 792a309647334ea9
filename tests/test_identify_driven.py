"""Identify on driven motions: what drives them is said with its numbers, and no scheme that is not theirs."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck.physics import scenefile as scenes
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Drive

ONE = np.array([0])


def driven(*, damped: bool = True, **drive: float) -> Scene:
    scene = scenes.load_scene("driven-spring")
    given = {"amplitude": 0.43, "frequency": 0.87, "phase": 0.6} | drive
    terms = [x for x in scene.terms if x.key == "wall-spring" or (damped and x.key == "damping")]
    made: Any = Drive(i=ONE, **{name: np.array([x]) for name, x in given.items()})
    return replace(scene, terms=(*terms, made))


def said(scene: Scene, label: str, **stated: float) -> str:
    run = springcheck.simulate(scene, label)
    found = springcheck.identify(run.t, run.q, run.p, **stated)
    assert not found.fits
    assert found.scheme is None
    return found.statement


NAMES = {"velocity-verlet": "velocity Verlet", "rk4": "classical Runge-Kutta (RK4)",
         "semi-implicit-euler": "semi-implicit Euler, kick-drift", "implicit-midpoint": "implicit midpoint",
         "position-verlet": "position Verlet"}  # fmt: skip


@pytest.mark.campaign
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("damped", [True, False])
def test_amplitude_frequency_phase_and_scheme_of_a_drive_are_said(name: str, damped: bool) -> None:
    why = said(driven(damped=damped), f"own:{name}", mass=3.7, stiffness=2.9)
    assert f"the force 0.43 cos(0.87 t + 0.6) by {NAMES[name]}, the phase at the first frame" in why


def test_of_a_drive_without_friction_no_scheme_with_a_friction_stage_is_said() -> None:
    """Each has then the map of the scheme without that stage."""
    why = said(driven(damped=False), "own:velocity-verlet", mass=3.7, stiffness=2.9)
    assert why.endswith("the force 0.43 cos(0.87 t + 0.6) by velocity Verlet, the phase at the first frame")


def test_an_amplitude_below_zero_is_a_phase_beyond_a_quarter_turn() -> None:
    why = said(
        driven(amplitude=-0.013, frequency=7.1, phase=-1.0), "own:velocity-verlet", mass=3.7, stiffness=2.9
    )
    assert f"0.013 cos(7.1 t + {np.pi - 1:.9g}) by velocity Verlet" in why


def test_without_a_stated_stiffness_every_scheme_of_the_map_is_said_with_its_amplitude() -> None:
    """Position Verlet and the implicit midpoint have one map on springs of unlike stiffness."""
    why = said(driven(damped=False), "own:implicit-midpoint", mass=3.7)
    assert "by position Verlet" in why
    assert "0.43 cos(0.87 t + 0.6) by implicit midpoint" in why


def test_a_drive_of_which_no_scheme_is_told_is_one_for_each_unit_of_mass_too() -> None:
    """0.43 on a mass of 3.7 that is not stated was "about 0.12", as of a force."""
    q, v, states = 0.3, 0.7 / 3.7, []
    for n in range(401):
        states.append((q, v))
        # the second half kick takes the drive at another time
        drives = [0.43 * np.cos(1.37 * (n + x) * 0.1 + 0.6) for x in (0, 0.37)]
        v += 0.05 * (drives[0] - 2.9 * q) / 3.7
        q += 0.1 * v
        v += 0.05 * (drives[1] - 2.9 * q) / 3.7
    q, v = np.array(states).T
    found = springcheck.identify(0.1 * np.arange(401), q, v=v)
    assert "about 0.12 cos(1.37 t + 0.63) for each unit of mass, or" in found.statement
    found = springcheck.identify(0.1 * np.arange(401), q, v=v, mass=3.7, stiffness=2.9)
    assert "about 0.43 cos(1.37 t + 0.63), the phase" in found.statement


def test_a_drive_of_two_frequencies_is_given_no_scheme() -> None:
    scene = driven(damped=False)
    both: Any = Drive(i=ONE, amplitude=np.array([0.3]), frequency=np.array([7.1]), phase=np.array([0.2]))
    why = said(replace(scene, terms=(*scene.terms, both)), "own:velocity-verlet", mass=3.7, stiffness=2.9)
    assert " by " not in why.partition("each frame")[2]


def test_springs_that_couple_two_axes_are_no_field() -> None:
    """The same size of coupling, symmetric: real in the normal modes."""
    scene = scenes.load_scene("chain")
    run = springcheck.simulate(scene, "own:velocity-verlet")
    found = springcheck.identify(run.t, run.q[:, :2], run.p[:, :2], mass=scene.m[:2])
    assert "magnetic" not in found.statement


@pytest.mark.parametrize(
    ("name", "label", "says"),
    [
        ("two-scales", "own:semi-implicit-euler", "Semi-implicit Euler, kick-drift"),
    ],
)
def test_explicit_schemes_in_a_field_and_stiff_modes_are_no_friction_drive_or_noise(
    name: str, label: str, says: str
) -> None:
    scene = springcheck.load_scene(name)
    run = springcheck.simulate(scene, label)
    found = springcheck.identify(run, mass=scene.m)
    assert says in found.statement
    # of a circle alone a negative friction is not excluded
    assert not re.search("friction|drives|Noise|coupled", found.statement.partition("circular orbit")[0])


@pytest.mark.parametrize("damped", [True, False])
def test_a_drive_smaller_than_the_motion_is_not_taken_for_the_spring(damped: bool) -> None:
    """The motion of the spring was said to be the drive: without friction two waves look alike."""
    scene = replace(driven(damped=damped, amplitude=0.073, frequency=1.3, phase=-1.1), q=[1.41])
    wave = "the force 0.073 cos(1.3 t - 1.1) by velocity Verlet"
    assert wave in said(scene, "own:velocity-verlet", mass=3.7, stiffness=2.9)
    open_ended = said(scene, "own:velocity-verlet", mass=3.7)
    assert wave in open_ended
    assert ("do not tell which; give the stiffness" in open_ended) != damped
