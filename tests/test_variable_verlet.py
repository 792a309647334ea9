"""OpenMM's VariableVerletIntegrator takes the steps of its own rule, and gains the energy that these say."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import springcheck
import variable_verlet
from springcheck import checks, schemes
from springcheck.engines.openmm import ENGINE
from springcheck.errors import MethodError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.schemes.variable import allowed, taken


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


LABEL = "openmm:variable-verlet"


def judged(scene: Scene) -> dict[str, Any]:
    return {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, LABEL))}


@pytest.mark.parametrize("step", [0.1, -0.07])
@pytest.mark.parametrize("tolerance", [1e-2, 3e-4])
@pytest.mark.parametrize("name", ["spring-uneven", "chain", "orbit", "anharmonic"])
def test_between_frames_openmm_takes_the_steps_of_its_rule(name: str, tolerance: float, step: float) -> None:
    scene = replace(scenefile.load_scene(name), step=step, steps=40, tolerance=tolerance)
    found = judged(scene)
    assert found["replay"].passed is True
    assert not [v.check for v in found.values() if v.passed is False]
    assert found["step-defect"].passed is None


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_the_gain_of_energy_a_period_is_said_beside_the_sum_over_the_steps(tolerance: float) -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), step=0.37, steps=40, tolerance=tolerance)
    found = judged(scene)["energy-gain"]
    assert found.passed is True
    words = ("the fastest mode adds ", "by the sum over the steps ")
    measured, law = (float(found.why.partition(word)[2].split()[0].rstrip(",;")) for word in words)
    assert measured == pytest.approx(law, rel=1e-3)
    assert found.bound < 1e-8


def test_what_nothing_anchors_and_what_is_heavy_counts_in_the_mean_as_in_openmm() -> None:
    """Anchors are particles of OpenMM's own, over which its mean runs as well."""
    free = Scene(
        m=[3.7, 0.9], q=[0.0, 1.3], p=[0.4, -0.3], step=0.1, steps=40, tolerance=1e-3,
        terms=(Spring(a=[0], b=[1], k=[2.9], rest=[1.0]),),
    )  # fmt: skip
    held = replace(free, terms=(*free.terms, WallSpring(i=[0, 1], k=[0.7, 1.1], at=[0.1, 1.2])))
    for scene in (free, held):
        assert judged(scene)["replay"].passed is True


def test_a_tolerance_that_takes_too_many_steps_is_refused_and_one_that_takes_many_is_not_replayed() -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), steps=20, tolerance=1e-9)
    with pytest.raises(MethodError, match="at most 1e"):
        springcheck.simulate(replace(scene, steps=200, tolerance=1e-16), LABEL)
    found = judged(scene)
    assert found["replay"].passed is None
    assert "not replayed" in found["replay"].why
    assert found["tolerance"].passed is True


def test_steps_by_a_rule_meet_the_times_of_frames_and_follow_the_rule_between() -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), tolerance=1e-4)
    scheme = schemes.SCHEMES["variable-verlet"]
    steps = list(
        taken(scheme, scene, (scene.q, scene.p), before=0.0, times=(0.0, 5.0), tolerance=allowed(scene))
    )
    lengths = np.array([step.h for step in steps])
    assert np.sum(lengths) == pytest.approx(5.0, rel=1e-14)
    # after the first ones, and but for the last
    assert np.max(lengths[1:] / lengths[:-1]) <= 2
    grown = lengths[1:-1] / lengths[:-2]
    assert not np.any((grown > 1) & (grown < 1.2))


def test_the_method_is_run_by_name_alone_and_known_as_adaptive() -> None:
    method = ENGINE.methods["variable-verlet"]
    assert method.adaptive
    assert not method.default
    assert schemes.scheme(method.scheme).has("adaptive")
