"""A rod in OpenMM's heat bath: its step is a map and draws, none of them projected, and is no other step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rod_bath
from rod_bath import ROD, STEP, THERMAL, M

RATE = 0.5 / STEP


@pytest.mark.parametrize("place", ["Reference", "CPU"])
@pytest.mark.parametrize("thermal", [0.0, THERMAL])
def test_openmm_takes_the_step(thermal: float, place: str, need: Any) -> None:
    need(f"openmm:verlet@{place}")
    q, p, kinetic = rod_bath.openmm(*rod_bath.started(30), 60, RATE, thermal, rod_bath.PULL, place)
    departure, draws = rod_bath.judged(q, p, RATE, thermal, rod_bath.PULL)
    assert departure <= 1
    assert kinetic == pytest.approx(np.sum(p * p / (2 * M), axis=(1, 2)), rel=1e-13)
    if thermal:
        for title, values in list(rod_bath.measured(q, p, draws).items())[:4]:
            value, most = rod_bath.mean(values)
            assert abs(value - 1) <= most, title


def made(wrong: str = "", thermal: float = THERMAL, rods: int = 60, steps: int = 60) -> tuple[Any, Any]:
    """States of an own loop, one of whose parts is wrong."""
    rng, (q, p), out = np.random.default_rng(4), rod_bath.started(rods), []
    c = np.exp(-RATE * STEP)
    for _ in range(steps):
        noise = np.sqrt((1 - c * c) * thermal * M) * rng.normal(size=q.shape)
        if wrong == "draws projected":
            noise = ROD.projected(q, noise)
        if wrong == "one mass":
            noise = noise / np.sqrt(M) * np.sqrt(np.mean(M))
        p = p + STEP * rod_bath.PULL
        if wrong != "kick not projected":
            p = ROD.projected(q, p)
        after = c * p + noise
        end, pushed = ROD.drifted(q, q + STEP / 2 * (p + after) / M, after, STEP)
        if wrong == "rod after the drift":
            # as if the push lay along where the rod has come to
            drifted = q + STEP / 2 * (p + after) / M
            end, pushed = ROD.drifted(drifted, drifted, after, STEP)
        if wrong == "no push on momenta":
            pushed = after
        if wrong == "projected at its end":
            pushed = ROD.projected(end, pushed)
        q, p = end, pushed
        out.append((q, p))
    return np.array([q for q, _ in out]), np.array([p for _, p in out])


def test_an_own_loop_of_the_map_is_accepted() -> None:
    q, p = made()
    departure, draws = rod_bath.judged(q, p, RATE, THERMAL, rod_bath.PULL)
    assert departure <= 1
    for title, values in list(rod_bath.measured(q, p, draws).items())[:4]:
        value, most = rod_bath.mean(values)
        assert abs(value - 1) <= most, title


@pytest.mark.parametrize(
    "wrong", ["kick not projected", "rod after the drift", "no push on momenta", "projected at its end"]
)
def test_another_step_departs(wrong: str) -> None:
    assert rod_bath.judged(*made(wrong, 0.0), RATE, 0.0, rod_bath.PULL)[0] > 1e6


@pytest.mark.parametrize(
    ("wrong", "seen"),
    [("draws projected", "draws along, light end"), ("one mass", "draws across, light end")],
)
def test_noise_of_another_size_shows_in_its_draws(wrong: str, seen: str) -> None:
    q, p = made(wrong)
    departure, draws = rod_bath.judged(q, p, RATE, THERMAL, rod_bath.PULL)
    assert departure <= 1
    value, most = rod_bath.mean(rod_bath.measured(q, p, draws)[seen])
    assert abs(value - 1) > 3 * most


def test_a_rod_has_five_degrees_of_freedom_and_what_is_stored_is_hotter() -> None:
    q, p = made(rods=400)
    hot, most = rod_bath.mean(
        rod_bath.measured(q, p, np.zeros_like(q[1:]))["of what is stored less projected"]
    )
    c = np.exp(-0.5)
    law = (1 - c * c + rod_bath.SMALL * (2 * (1 + c) ** 2 + (1 - c * c) * (1 - c))) / 20
    assert abs(hot - law) <= most + rod_bath.SECOND
    # counting six takes a sixth off, more than is stored too much
    assert abs((hot + 1) * 5 / 6 - 1 - law) > 10 * most
    assert rod_bath.turned_off(0.005, c, 4000)[0] == pytest.approx((c - 1) / 8, rel=0.5)
