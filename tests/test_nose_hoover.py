"""Nose-Hoover chains: deterministic, the bath's own variables carried along the states of the motion.

The law has a second route: the energy of motion and chain together is conserved to the second order of the
step, and is the one that the engines themselves work out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from clean import clean_bath
from springcheck import checks, driver, engines
from springcheck.errors import MethodError
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.studies.faults import baths
from springcheck.studies.faults.table import FAULTS
from springcheck.thermal import THERMOSTATS, Stepper

CHAINS = ("nose-hoover", "nose-hoover-fourth", "nose-hoover-middle")
ENGINES = ("ase:nose-hoover", "openmm:nose-hoover-bath", "lammps:nvt")


def springs(n: int, steps: int = 300, step: float = 0.05) -> Scene:
    return replace(baths.springs(n, steps=steps), step=step, p=np.linspace(0.9, -0.4, n))


def energy_of(stepper: Stepper) -> float:
    """Energy of a chain: its momenta's, kT for each place, and N kT for the first."""
    (s, y), of = np.split(stepper.chain, 2), stepper.of_chain
    places = of["freedoms"] * y[0] + np.sum(y[1:])
    return float(np.sum(s * s / (2 * of["Q"])) + of["thermal"] * places)


def energies(scene: Scene, name: str) -> np.ndarray:
    """Of motion and chain, at whole steps."""
    scheme = THERMOSTATS[name]
    stepper = Stepper(
        scheme, h=scene.step, m=scene.m, rate=0.8, thermal=1.7, width=np.longdouble,
        freedoms=scheme.freedoms(scene.n, scene.particles),
    )  # fmt: skip
    q, p, found = scene.q.astype(np.longdouble), scene.p.astype(np.longdouble), []
    for _ in range(scene.steps + 1):
        # of leapfrog half a kick late
        at = p if scheme.synchronised else p + scene.step / 2 * scene.system.potential_force(q, p)
        found.append(scene.system.energy(q, at) + energy_of(stepper))
        q, p = stepper(q, p, scene.system.potential_force, [])
    return np.array(found, float)


@pytest.mark.parametrize("name", CHAINS)
def test_the_energy_of_motion_and_chain_is_conserved_to_second_order(name: str) -> None:
    spans = []
    for h, steps in ((0.05, 200), (0.025, 400), (0.0125, 800)):
        found = energies(springs(3, steps, h), name)
        # leapfrog is handed p0 for half a step early: another motion, whose energy is its own
        spans.append(np.ptp(found))
    assert np.log2(spans[0] / spans[1]) == pytest.approx(2, abs=0.1)
    assert np.log2(spans[1] / spans[2]) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("label", [*(f"own:{name}" for name in CHAINS), *ENGINES])
@pytest.mark.parametrize("n", [1, 3])
def test_every_chain_is_judged_to_rounding(label: str, n: int, need: Callable[[str], None]) -> None:
    need(label)
    scene = springs(n, 60)
    verdicts = checks.judge(scene, driver.run(scene, label, seed=3)) + checks.judge_thoroughly(
        scene, label, driver.run, seed=3
    )
    assert not [v for v in verdicts if v.passed is False]
    assert {"noise-direction", "noise-size"} <= {v.check for v in verdicts if v.passed}
    said = {v.check: v.why for v in verdicts if v.passed is None}
    assert said["draws-variance"] == said["seed-kept"] == "it takes no draws: its bath is a chain"


@pytest.mark.parametrize("share", [0.7, 1.3])
def test_a_chain_of_openmm_rests_below_the_kinetic_energy_that_its_source_says(
    share: float, need: Callable[[str], None]
) -> None:
    need(label := "openmm:nose-hoover-bath")
    # at its lowest point, where no force acts in the first step
    scene = springs(1, 8)
    scene = replace(scene, q=0 * scene.q, p=np.sqrt(2e-8 * share * scene.m))
    (found,) = checks.judge(scene, driver.run(scene, label, seed=3), [checks.thermal.noise_direction])
    assert found.passed, found.why


SAID: dict[str, tuple[str, Callable[[Any], float]]] = {
    "ase:nose-hoover": ("nose-hoover-fourth", lambda x: x._dynamics._thermostat.get_thermostat_energy()),
    "openmm:nose-hoover-bath": ("nose-hoover-middle", lambda x: x._integrator.computeHeatBathEnergy()._value),
}
"""The energy of its bath that an engine says."""


@pytest.mark.parametrize("label", SAID)
def test_the_energy_that_an_engine_says_of_its_bath_is_that_of_the_law(
    label: str, need: Callable[[str], None]
) -> None:
    need(label)
    scene, (name, said) = springs(3, 100), SAID[label]
    simulation = engines.start(scene, engines.parse(label), 1)
    stepper = Stepper(
        THERMOSTATS[name], h=scene.step, m=scene.m, rate=0.8, thermal=1.7, width=np.longdouble, freedoms=9
    )
    q, p = np.empty((2, 1, 3))
    a, b = scene.q, scene.p
    for _ in range(100):
        simulation.advance(1, q, p)
        a, b = stepper(a, b, scene.system.potential_force, [])
        known = energy_of(stepper)
        assert float(said(simulation)) == pytest.approx(known, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("name", ["chain-temperature", "chain-time", "nose-hoover-fourth-for-nose-hoover"])
def test_a_chain_that_is_not_the_one_it_claims_is_rejected(name: str) -> None:
    (fault,) = (one for one in FAULTS if one.name == name)
    scene = springs(3, 60)
    verdicts = checks.judge(scene, fault.run(scene, size=fault.size, seed=3))
    assert [v.check for v in verdicts if v.passed is False] == ["noise-direction"]


def test_a_chain_is_known_from_the_start_alone() -> None:
    scene = springs(2, 60)
    run = driver.run(scene, "own:nose-hoover", seed=3)
    later = replace(run, t=run.t[20:], q=run.q[20:], p=run.p[20:], energy=None)
    (found,) = checks.judge(scene, later, [checks.thermal.noise_direction], piece=True)
    assert (found.passed, found.why) == (None, "the state of its chain is known from the start alone")


def test_a_chain_starts_from_rest_which_a_factor_of_all_momenta_cannot() -> None:
    scene = replace(springs(2, 20), p=np.zeros(2))
    assert driver.run(scene, "own:nose-hoover", seed=1).outcome.status == "complete"
    with pytest.raises(MethodError, match="are all 0"):
        driver.run(scene, "own:bussi", seed=1)


@pytest.mark.parametrize("case", [710, 1270])
def test_a_chain_that_stops_a_motion_too_hot_for_it_is_no_alarm(case: int) -> None:
    """Random baths of 10,000, whose kinetic energy is 1e17 kT and more."""
    assert clean_bath(case).alarms == ()


def test_a_chaotic_chain_is_judged_as_far_as_it_predicts() -> None:
    """Much friction on free particles: roundings grow to all of the chain, and shrink again without it."""
    scene = replace(
        springs(2, 400, step=0.0135), m=np.array([3.7, 0.4]), p=np.array([1.14, 0.24]), terms=(),
        bath=Bath(temperature=1.0, friction=105.0),
    )  # fmt: skip
    run = driver.run(scene, "own:nose-hoover")
    (found,) = checks.judge(scene, run, [checks.thermal.noise_direction])
    assert found.passed
    assert "judged to step" in found.why
    # a chain of another friction is another one from the first step on
    other = replace(scene, bath=Bath(temperature=1.0, friction=105.0 * (1 + 1e-9)))
    (found,) = checks.judge(other, run, [checks.thermal.noise_direction])
    assert found.passed is False
    assert "first at step" in found.why
