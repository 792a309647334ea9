"""Noise is called noise, a wrong mass a wrong mass, and no whole turn is supposed without need."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from springcheck import identify
from springcheck.identify.result import Identification
from springcheck.identify.unknown import MAP_OF, ONE_MAP

M, K, H = 3.7, 2.9, 0.1


def verlet(q, p, h, force, mass):
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return q, p + h / 2 * force(q)


def drifting(q, p, h, force, mass):
    q = q + h / 2 * p / mass
    p = p + h * force(q)
    return q + h / 2 * p / mass, p


def kicking(q, p, h, force, mass):
    p = p + h * force(q)
    return q + h * p / mass, p


def euler(q, p, h, force, mass):
    return q + h * p / mass, p + h * force(q)


def newmark(q, p, h, force, mass, beta=1 / 6):
    a = h * h * K / mass
    new = ((1 - (0.5 - beta) * a) * q + h * p / mass) / (1 + beta * a)
    return new, p + h / 2 * (force(q) + force(new))


def told(step: Any, factor: float = 1.0, **stated: float | None) -> Identification:
    rows = [(0.3, 0.7)]
    for _ in range(200):
        rows.append(step(*rows[-1], H, lambda x: -K * x, M * factor))
    q, p = np.array(rows).T
    return identify(H * np.arange(201), q, p, **{"mass": M, "step": H, **stated})


@pytest.mark.parametrize("size", [1e-1, 1e-3, 1e-6])
@pytest.mark.parametrize("where", ["q", "p"])
def test_kicks_of_one_number_alone_are_noise_and_no_factor_of_momenta(where: str, size: float) -> None:
    """What is left of the other number is rounding, which goes with the state."""
    rng = np.random.default_rng(0)

    def step(q, p, h, force, mass):
        q, p = verlet(q, p, h, force, mass)
        kick = size * rng.standard_normal()
        return (q + kick, p) if where == "q" else (q, p + kick)

    found = identify(step)
    assert "noise" in found.statement.lower()
    assert "white noise" not in found.statement
    assert "bussi" not in found.statement
    assert found.candidates == ()


def test_kicks_that_outlast_a_step_are_no_white_noise() -> None:
    rng, kick = np.random.default_rng(1), 0.0

    def step(q, p, h, force, mass):
        nonlocal kick
        kick = 0.8 * kick + 1e-5 * rng.standard_normal()
        q, p = verlet(q, p, h, force, mass)
        return q, p + kick

    statement = told(step).statement
    assert statement.startswith("No known cause alone explains what one map leaves over, and it is no white")
    assert statement.endswith("of the state's size in each, in the velocity")


@pytest.mark.parametrize(
    ("what", "much", "remedy"),
    [
        (
            "position",
            (1e-3, 0.0),
            "a drift that is not the velocity's, such as a removed centre-of-mass motion",
        ),
        (
            "velocity",
            (0.0, 1e-3 * M),
            "a constant force, or a Jacobian by differences, which rounds to one side",
        ),
    ],
)
def test_a_constant_added_in_every_frame_is_said_with_where_to_look(
    what: str, much: tuple[float, float], remedy: str
) -> None:
    def step(q, p, h, force, mass):
        q, p = verlet(q, p, h, force, mass)
        return q + much[0], p + much[1]

    found = told(step)
    assert found.statement == f"Velocity Verlet with a constant added to the {what} in every frame: 0.001"
    assert [x.remedy for x in found.explanations] == [f"look for {remedy}"]


@pytest.mark.parametrize("factor", [1.001, 1.027027, 0.9, 1.1, 1.66054, 2.0, 0.5, 10.0])
@pytest.mark.parametrize(
    ("step", "name"),
    [
        (verlet, "Velocity Verlet"), (drifting, "Position Verlet"), (euler, "Explicit Euler"),
        (kicking, "Semi-implicit Euler, kick-drift"),
    ],
)  # fmt: skip
def test_a_mass_that_is_not_the_stated_one_is_named(step: Any, name: str, factor: float) -> None:
    """The scale of velocities and the stiffness show the same factor; on a spring it is Newmark's too."""
    found = told(step, factor, stiffness=K)
    assert f"{name} in a mass {factor:.6g} times the stated one" in found.statement
    assert "Newmark" not in found.statement


def test_a_mass_a_ten_trillionth_off_is_not_said_to_be_the_stated_one() -> None:
    """It was 1 times the stated one."""
    assert "in a mass 1.0000000000001 times the stated one" in told(verlet, 1 + 1e-13, stiffness=K).statement


def test_the_stated_stiffness_of_momenta_without_a_mass_is_that_of_every_candidate() -> None:
    found = told(verlet, mass=None, stiffness=K)
    assert len(found.candidates) > 1
    for one in found.candidates:
        assert one.stiffness == pytest.approx((K,), rel=1e-12)


def test_without_a_stated_stiffness_mass_and_units_are_both_possible() -> None:
    for factor, scale in ((2.0, "0.5"), (1.027027, "0.973684")):
        statement = told(kicking, factor).statement
        assert f"{scale} times as large" in statement
        assert f"mass{' were' * (factor != 2)} {factor:.6g} times as large" in statement


def test_newmark_of_a_chosen_beta_is_named_beside_the_mass_that_it_looks_like() -> None:
    statement = told(newmark, stiffness=K).statement
    method = "Newmark's method with beta = 0.166667, gamma = 0.5; or Velocity Verlet in a mass 1.00131 times"
    assert statement.startswith(f"{ONE_MAP}: {MAP_OF}{method}")


def test_a_thousandth_of_the_step_is_no_whole_turn() -> None:
    found = identify(lambda q, p, h, force, mass: verlet(q, p, h * 1e-3, force, mass))
    assert found.statement.startswith("Velocity Verlet, but times are 1000 times what was stepped")
    assert not found.omega[0] > 1


@pytest.mark.parametrize("factor", [20, 100, 1000])
def test_explicit_euler_on_a_far_stiffer_spring_has_no_negative_friction(factor: float) -> None:
    """Its determinant bends between two phases of the table by more than rounding."""
    found = identify(lambda q, p, h, force, mass: euler(q, p, h, lambda x: factor * force(x), mass))
    assert f"Explicit Euler, but of a spring {factor} times as stiff as stated" in found.statement
