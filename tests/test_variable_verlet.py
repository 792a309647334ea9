"""OpenMM's VariableVerletIntegrator takes the steps of its own rule, and gains the energy that these say."""

from __future__ import annotations

from typing import Any

import pytest

import variable_verlet


@pytest.fixture(autouse=True)
def _openmm(need: Any) -> None:
    need("openmm:verlet")


@pytest.mark.parametrize("name", variable_verlet.SPRINGS)
def test_every_step_is_the_rules_own_and_changes_the_energy_by_its_law(name: str) -> None:
    worst, energy = variable_verlet.judged(*variable_verlet.SPRINGS[name], 300)
    assert worst <= 8
    assert energy <= 1e-13


@pytest.mark.parametrize("wrong", ["tolerance", "held", "doubled"])
def test_another_rule_is_not_that_of_its_steps(wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = variable_verlet.rule

    def other(push: Any, h: float, tolerance: float) -> float:
        if wrong == "tolerance":
            return right(push, h, tolerance * (1 + 1e-13))
        free = right(push, 0.0, tolerance)
        new = free if wrong == "doubled" or not h else min(free, 2 * h)
        return h if wrong == "doubled" and h < new < 1.2 * h else new

    monkeypatch.setattr(variable_verlet, "rule", other)
    worst, _ = variable_verlet.judged(*variable_verlet.SPRINGS["one spring along x"], 300)
    assert worst > 8


def test_the_gain_of_a_period_is_the_sum_over_its_steps_whatever_the_spring() -> None:
    measured, law = variable_verlet.gain(1e-3)
    assert measured == pytest.approx(law, abs=1e-12)
    # 0.12 % at a tolerance of a thousandth of the amplitude
    assert measured == pytest.approx(1.2188e-3, rel=1e-4)
