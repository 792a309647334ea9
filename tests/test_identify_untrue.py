"""Sentences that were false of motions that no scheme explains: what is said of them now is true of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import springcheck
from springcheck.identify.thermal import one_factor
from springcheck.physics.arrays import Floats

M, K = 2.3, 7.1
W = (K / M) ** 0.5
Step = Callable[[float, float], tuple[float, float]]


def orbit(step: Step, frames: int, q: float = 0.6, p: float = 1.7) -> tuple[Floats, Floats]:
    states = [(q, p)]
    while len(states) < frames:
        states.append(step(*states[-1]))
    q_, p_ = np.array(states).T
    return q_, p_


def verlet(q: float, p: float, h: float) -> tuple[float, float]:
    p = p - h / 2 * K * q
    q = q + h * p / M
    return q, p - h / 2 * K * q


def position_verlet(q: float, p: float, h: float) -> tuple[float, float]:
    q = q + h / 2 * p / M
    p = p - h * K * q
    return q + h / 2 * p / M, p


def significant(x: Floats, digits: int) -> Floats:
    return np.array([float(f"{y:.{digits}g}") for y in x])


def rescaled(h: float, frames: int, digits: int = 17) -> tuple[Floats, Floats, Floats]:
    """Position Verlet whose states are rescaled to the first energy after each step."""

    def step(q: float, p: float) -> tuple[float, float]:
        q, p = position_verlet(q, p, h)
        factor = ((1.7**2 / M + K * 0.36) / (p * p / M + K * q * q)) ** 0.5
        return q * factor, p * factor

    q, p = orbit(step, frames)
    return h * np.arange(frames), significant(q, digits), significant(p, digits)


def berendsen(h: float, frames: int) -> tuple[Floats, Floats]:
    """The velocity of one particle, brought a hundredth nearer to a temperature after each step."""

    def step(q: float, p: float) -> tuple[float, float]:
        q, p = verlet(q, p, h)
        return q, float(np.copysign((p * p + 0.01 * (3.1 * M - p * p)) ** 0.5, p))

    return orbit(step, frames)


@pytest.mark.parametrize("h", [0.05, 0.1])
def test_harmonics_of_a_force_that_is_not_linear_are_no_memory(h: float) -> None:
    """A few harmonics obey a map of several states, as a scheme of several steps does."""
    t, q, p = rescaled(h / W, 401)
    found = springcheck.identify(t, q, p, mass=M)
    assert "follows from the" not in found.statement


def test_a_fault_is_no_cause_where_a_scheme_of_the_stated_stiffness_fits_as_well() -> None:
    causes = []
    for h in (0.035, 0.038, 0.041, 0.044):
        t, q, p = rescaled(h / W, 201, 5)
        found = springcheck.identify(t, q, p, mass=M, stiffness=K, step=h / W)
        causes += [x.cause for x in found.explanations]
    assert causes
    assert not [x for x in causes if "stage" in x]
    # the schemes of that map are all said
    assert not [x for x in causes if x.startswith("The map is Exact flow's")]


def test_a_velocity_that_a_program_rescales_is_no_noise() -> None:
    """Its factor follows from the state, that of a thermostat does not."""
    h = 0.056 / W
    q, p = berendsen(h, 251)
    found = springcheck.identify(h * np.arange(len(q)), q, p, mass=M)
    assert found.candidates == ()
    assert "takes noise" not in found.statement


def test_a_speed_that_is_one_in_all_frames_has_no_dry_friction() -> None:
    """It pushes along the velocity, where friction pushes against it."""
    h = 0.18 / W

    def step(q: float, p: float) -> tuple[float, float]:
        q, p = verlet(q, p, h)
        return q, float(np.copysign(2.1, p))

    q, p = orbit(step, 401)
    found = springcheck.identify(h * np.arange(len(q)), q, p, mass=M)
    assert "friction acts" not in found.statement


@pytest.mark.parametrize("box", [1.9, 1.6484018655959447, 0.5242136516435979])
@pytest.mark.parametrize("digits", [17, 5])
@pytest.mark.parametrize("h", [0.1, 0.4])
def test_a_box_has_the_length_by_which_positions_jump(box: float, digits: int, h: float) -> None:
    q, p = orbit(lambda q, p: verlet(q, p, h / W), 301, 0.3 * box, M * W * 0.57 * box)
    wrapped = significant((q + box / 2) % box - box / 2, digits)
    found = springcheck.identify(h / W * np.arange(301), wrapped, significant(p, digits), mass=M)
    assert "are wrapped into a box of " in found.statement
    told = float(found.statement.partition("a box of ")[2].partition(",")[0])
    assert told == pytest.approx(box, rel=1e-5 if digits > 9 else 1e-3)


def test_a_short_arc_of_a_smooth_motion_shows_no_factor() -> None:
    """Of few turns the constants of a force come near any smooth motion; rounding is what a factor leaves."""
    t = np.linspace(0, 0.5, 200)
    q = np.stack([np.sin(1.3 * t + 0.2 * t**3), np.exp(0.7 * t) + 0.1 * t**4], axis=1)
    v = np.stack(
        [np.cos(1.3 * t + 0.2 * t**3) * (1.3 + 0.6 * t**2), 0.7 * np.exp(0.7 * t) + 0.4 * t**3], axis=1
    )
    assert one_factor(t[1], q, v) is None


def test_two_coordinates_of_unlike_maps_are_not_called_one_scheme() -> None:
    """r-RESPA of five steps of the fast springs, written with three decimals."""
    m, fast, slow = np.array([11.3, 5.2]), np.array([141.5, 50.4]), np.array([9.9, 15.1])
    h = 1 / float(np.max(np.sqrt((fast + slow) / m)))
    q, p, states = np.array([0.4, -1.1]), np.array([19.0, 8.0]), []
    for _ in range(41):
        states.append((q, p))
        p = p - h / 2 * slow * q
        for _ in range(5):
            p = p - h / 10 * fast * q
            q = q + h / 5 * p / m
            p = p - h / 10 * fast * q
        p = p - h / 2 * slow * q
    q, p = (np.round([x[i] for x in states], 3) for i in (0, 1))
    found = springcheck.identify(h * np.arange(41), q, p, mass=m)
    assert "single steps depart" not in found.statement
