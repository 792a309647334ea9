"""A rod in the heat baths of ASE and LAMMPS: their steps are their maps, and no others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rod_bath_ase
import rod_bath_lammps
from rod_bath import PULL, ROD, STEP, THERMAL, M, departure, mean, measured, started

RATE = 0.5 / STEP


@pytest.mark.parametrize("thermal", [0.0, THERMAL])
def test_ase_takes_its_step_by_draws_that_are_not_projected(thermal: float, need: Any) -> None:
    need("ase:velocity-verlet")
    q, p, draws, freedoms = rod_bath_ase.ase(*started(3), 20, RATE, thermal, PULL)
    assert rod_bath_ase.judged(q, p, draws, RATE, thermal) <= 1
    assert freedoms == 15
    if thermal:
        # another step is none of its own: draws along the rods gone, or those of positions left in velocities
        flat = np.stack([ROD.projected(q[:-1], one) for one in draws])
        assert rod_bath_ase.judged(q, p, flat, RATE, thermal) > 1e6


def test_the_turn_cools_a_rod_in_ase_by_its_law() -> None:
    found, most, law = rod_bath_ase.lost(0.5, 0.002, 4000)
    assert abs(found - law) <= most < 0.2 * abs(law)


@pytest.mark.parametrize("fix", ["rattle", "shake"])
@pytest.mark.parametrize("thermal", [0.0, THERMAL])
def test_lammps_takes_its_step(thermal: float, fix: str, need: Any) -> None:
    need("lammps:rattle")
    q, p, reported = rod_bath_lammps.lammps(*started(20), 60, RATE, thermal, PULL, fix)
    found, draws = rod_bath_lammps.judged(q, p, RATE, thermal, PULL)
    assert found <= 1
    # velocities that are not projected tell the one from the other
    off = departure((q, ROD.projected(q, p)), (q, p))
    assert off <= 1 if fix == "rattle" else off > 1e6
    if thermal:
        for title, values in list(measured(q[1:-1], p[1:-1], draws[:-1]).items())[2:4]:
            value, most = mean(values)
            assert abs(value - 1) <= most, title
        if fix == "rattle":
            assert reported == pytest.approx(100 / 97, rel=1e-12)


def test_another_friction_departs_from_the_step_of_lammps(need: Any) -> None:
    need("lammps:rattle")
    q, p, _ = rod_bath_lammps.lammps(*started(3), 20, RATE, 0.0, PULL)
    assert rod_bath_lammps.judged(q, p, RATE * (1 + 1e-6), 0.0, PULL)[0] > 100
    assert rod_bath_lammps.judged(q, p * (1 + 1e-6 * (M > 2)), RATE, 0.0, PULL)[0] > 100
