"""Files of DART's and MuJoCo's hinges, which `validation/hinges.py` has written."""

from __future__ import annotations

import pytest

import hinges


@pytest.mark.parametrize("name", hinges.PROGRAMS)
def test_a_hinge_is_semi_implicit_euler_of_its_angle_and_of_its_whole_inertia(name: str) -> None:
    assert hinges.defect(name, "semi-implicit-euler")["status"] == 0
    assert hinges.defect(name, "semi-implicit-euler", own=0.0)["passed"] is False
    assert hinges.defect(name, "velocity-verlet")["passed"] is False
