"""What game loops, solvers and programs with one mistake write: each is told by one sentence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from springcheck.identify import identify
from springcheck.identify.storage import storage

M, K, H = 2.3, 5.9, 0.05
Q, V = 0.4, -0.3


def loop(step: Callable[..., Any], steps: Any, *more: Any) -> tuple[Any, Any, Any]:
    """Times, positions, velocities of a step function over steps of these lengths."""
    state, rows, t = (Q, V, *more), [(0.0, Q, V)], 0.0
    for h in steps:
        state = step(h, *state)
        t += h
        rows.append((t, *state[:2]))
    return tuple(np.array(rows).T)  # type: ignore[return-value]


def euler(h: float, q: float, v: float) -> tuple[float, float]:
    v = v - h * K / M * q
    return q + h * v, v


def verlet(h: float, q: float, v: float) -> tuple[float, float]:
    v = v - h / 2 * K / M * q
    q = q + h * v
    return q, v - h / 2 * K / M * q


def rk4(h: float, q: float, v: float, stage: float = 1.0) -> tuple[float, float]:
    z = np.array([q, v])
    L, c = np.array([[0, 1], [-K / M, 0]]), h * stage
    k1 = L @ z
    k2 = L @ (z + c / 2 * k1)
    k3 = L @ (z + c / 2 * k2)
    k4 = L @ (z + c * k3)
    z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return float(z[0]), float(z[1])


UNEVEN = 0.016 + 0.004 * np.random.default_rng(3).random(200)


@pytest.mark.parametrize(("step", "name"), [
    (euler, "semi-implicit-euler"), (verlet, "velocity-verlet"), (rk4, "rk4"),
])  # fmt: skip
@pytest.mark.parametrize("stated", [{}, {"mass": M, "stiffness": K}])
def test_each_step_of_a_game_loop_is_compared_with_one_of_its_own_length(
    step: Any, name: str, stated: Any
) -> None:
    t, q, v = loop(step, UNEVEN)
    found = identify(t, q, v=v, **stated)
    assert (found.scheme, found.fits) == (name, True), found
    assert found.omega[0] == pytest.approx(np.sqrt(K / M), rel=1e-9)
    # another stiffness than the stated one is no scheme's
    if stated:
        other = identify(t, q, v=v, mass=M, stiffness=1.01 * K)
        assert (other.fits, "0.99009901 times as stiff" in other.statement) == (False, True), other


def test_a_step_with_a_largest_length_is_told_with_it() -> None:
    lengths = np.where(np.arange(300) % 25 == 7, 0.064, 0.016)
    t, q, v = loop(lambda h, q, v: euler(min(h, 0.032), q, v), lengths)
    assert "the step taken is 0.032 where times are 0.064 apart" in identify(t, q, v=v, mass=M).statement


@pytest.mark.parametrize("scaled", [False, True])
def test_a_displacement_that_is_not_scaled_with_the_step_is_told(scaled: bool) -> None:
    rows, t, x, before, last = [], 0.0, Q, Q - 0.015 * V, 0.015
    for i in range(200):
        rows.append((t, x))
        h = 0.015 if i < 90 else 0.03
        share, pull = (h / last, h * (h + last) / 2) if scaled else (1.0, h * h)
        x, before, last, t = x + share * (x - before) - pull * K / M * x, x, h, t + h
    times, q = np.array(rows).T
    said = identify(times, q, mass=M, stiffness=K).statement
    assert ("moved on by the last displacement as it was" in said) == (not scaled), said


def test_stages_of_h_twice_are_told_from_stages_of_another_length() -> None:
    t, q, v = loop(lambda h, q, v: rk4(h, q, v, stage=h), np.full(200, H))
    assert identify(t, q, v=v, mass=M, stiffness=K).statement.startswith("RK4 with h twice in its stages")
    t, q, v = loop(lambda h, q, v: rk4(h, q, v, stage=0.7), np.full(200, H))
    assert "stages of 0.7 times their steps" in identify(t, q, v=v, mass=M, stiffness=K).statement


def test_forces_that_are_never_cleared_are_told() -> None:
    def step(h: float, q: float, v: float, force: float) -> tuple[float, float, float]:
        force -= 0.02 * K * q
        v += h * force / M
        return q + h * v, v, force

    t, q, v = loop(step, np.full(120, H), 0.0)
    assert "never cleared" in identify(t, q, v=v, mass=M, stiffness=0.02 * K).statement


@pytest.mark.parametrize(("back", "word"), [(1.0, ""), (-1.0, "wrong sign")])
def test_forces_that_are_not_opposite_are_told(back: float, word: str) -> None:
    m, joint, h = np.array([2.3, 1.1]), 1.7, 0.1
    matrix = np.array([[-K - joint, joint], [back * joint, -3.1 - joint]])
    q, v, rows = np.array([0.4, -0.15]), np.array([-0.3, 0.2]), []
    for _ in range(200):
        rows.append((q, v))
        v = v + h * (matrix @ q) / m
        q = q + h * v
    found = identify(
        h * np.arange(200), np.array([x for x, _ in rows]), v=np.array([x for _, x in rows]), mass=m
    )
    assert ("not opposite" in found.statement) == bool(word), found
    assert word in found.statement


def test_steps_of_a_solver_far_from_the_times_are_told() -> None:
    steps = 0.0028 + 0.0002 * np.random.default_rng(1).random(200)
    _, q, v = loop(rk4, steps)
    said = identify(H * np.arange(len(q)), q, v=v, mass=M, stiffness=K).statement
    assert said.startswith("times are 17"), said


def test_an_implicit_scheme_of_other_programs_is_told_with_what_its_solver_leaves() -> None:
    """ESDIRK32 with an error of 1e-11 that its solver leaves in every step."""
    rng, z = np.random.default_rng(2), H * np.array([[0, 1], [-K / M, 0]])
    over, under = np.eye(2) - z / 2 - z @ z / 4 + z @ z @ z / 24, np.linalg.matrix_power(np.eye(2) - z / 2, 3)
    state, rows = np.array([Q, V]), []
    for _ in range(120):
        rows.append(state)
        state = np.linalg.solve(under, over @ state) + 1e-11 * rng.normal(size=2)
    q, v = np.array(rows).T
    said = identify(H * np.arange(120), q, v=v, mass=M, stiffness=K).statement
    assert "third order" in said
    assert "solved to" in said


def test_rows_of_small_numbers_have_more_decimals_as_numpy_prints_them() -> None:
    t, q, v = loop(verlet, np.full(200, H))
    rows = [[float(x) for x in str(row)[1:-1].split()] for row in np.array([t, q, v]).T]
    t, q, v = np.array(rows).T
    assert storage(q).decimals == 8
    assert identify(t, q, v=v, mass=M, stiffness=K).scheme == "velocity-verlet"


def test_damping_by_a_factor_of_each_frame_shows_in_positions() -> None:
    x, before, rows = Q, Q - H * V, []
    for _ in range(200):
        rows.append(x)
        x, before = x + 0.9 * (x - before) - H * H * K / M * x, x
    said = identify(H * np.arange(200), np.array(rows), mass=M, stiffness=K, friction=0.23).statement
    assert "times the stated (20 to 21.3 by where it acts)" in said, said


@pytest.mark.parametrize(("late", "word"), [(-0.5, "half a step behind"), (0.5, "half a step ahead")])
def test_velocities_of_rk4_half_a_step_off_are_told(late: float, word: str) -> None:
    t, q, v = loop(rk4, np.full(200, H))
    said = identify(t, q, v=v - late * H * K / M * q, mass=M, stiffness=K).statement
    assert word in said, said


def test_a_drift_by_another_mass_is_told_with_it() -> None:
    def step(h: float, q: float, v: float) -> tuple[float, float]:
        v = v - h * K / M * q
        return q + h * v * M / 3.1, v

    t, q, v = loop(step, np.full(200, H))
    assert "moved by p / 3.1, where the mass is 2.3" in identify(t, q, v=v, mass=M, stiffness=K).statement


def test_a_step_that_takes_the_size_of_a_negative_step_is_told() -> None:
    t, q, v = loop(verlet, np.full(200, H))
    assert "each step is |h|, not h" in identify(-t, q, v=v, mass=M, stiffness=K).statement


def test_a_damped_motion_of_sixteen_steps_to_a_frame_is_named_without_its_step() -> None:
    def step(h: float, q: float, v: float) -> tuple[float, float]:
        q, v = verlet(h, q, v)
        return q, v * np.exp(-0.35 * h)

    t, q, v = loop(step, np.full(1600, H))
    found = identify(t[::16], q[::16], v=v[::16], mass=M, stiffness=K)
    assert (found.scheme, found.stride) == ("velocity-verlet", 16), found
