"""BAOAB-RESPA: a thermostat that takes fast springs twice between two half kicks of the slow ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import springcheck
from springcheck import driver, engines
from springcheck.checks.seeds import SEEDED, by_engine, noise_map
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.studies.run.tally import heated_of
from springcheck.thermal import THERMOSTATS
from springcheck.thermal.likelihood import FULL_RANK, likely

LABELS = ("own:baoab-respa2", "openmm:mts-langevin-2")


def two_scales(*, joined: bool = False, steps: int = 400) -> Scene:
    """Slow and fast springs on the walls, or a fast one between two particles; nothing is 1."""
    first, n = np.array([0]), 2
    slow = WallSpring(i=np.arange(n), k=np.array([2.9, 1.1]), at=np.zeros(n))
    fast = WallSpring(i=np.arange(n), k=np.array([41.0, 17.0]), at=np.zeros(n), fast=True)
    bond = Spring(a=first, b=first + 1, k=np.array([21.7]), rest=np.array([0.6]), fast=True)
    return Scene(
        m=np.array([3.7, 1.3]), q=np.array([0.3, -0.2]), p=np.array([0.7, 0.4]),
        terms=(slow, bond if joined else fast), step=0.25, steps=steps,
        bath=Bath(temperature=1.7, friction=0.8), name="two-scales",
    )  # fmt: skip


def here(label: str) -> None:
    if reason := engines.absence(label.partition(":")[0]):
        pytest.skip(reason)


@pytest.mark.parametrize("joined", [False, True], ids=["apart", "joined"])
@pytest.mark.parametrize("label", LABELS)
def test_groups_of_springs_are_kicked_by_their_own_steps(label: str, joined: bool) -> None:
    here(label)
    scene = two_scales(joined=joined)
    verdicts = springcheck.judge(scene, driver.run(scene, label, seed=5))
    verdicts += [check(by_engine(scene, label, 5)) for check in SEEDED]
    assert [f"{v.check}: {v.why}" for v in verdicts if v.passed is False] == []
    passed = {v.check for v in verdicts if v.passed}
    assert {"noise-map", "draws-variance", "draws-mean", "draws-neighbours", "seed-kept"} <= passed
    assert ("noise-size" in passed) is not joined


@pytest.mark.parametrize("label", ["own:baoab", "openmm:mts-langevin"])
def test_springs_that_are_not_taken_apart_are_another_map(label: str) -> None:
    here(label)
    claimed = replace(by_engine(two_scales(), label, 5), scheme=THERMOSTATS["baoab-respa2"])
    assert noise_map(claimed).passed is False
    wrong = replace(by_engine(two_scales(), LABELS[0], 5), scheme=THERMOSTATS["baoab"])
    assert noise_map(wrong).passed is False


def test_its_temperatures_are_those_of_its_law() -> None:
    scene = two_scales(steps=20_000)
    found = heated_of(scene, [driver.run(scene, LABELS[0], seed=8)])
    assert abs(found.kinetic - found.kinetic_law) < 5 * found.kinetic_error
    assert abs(found.configurational - found.configurational_law) < 5 * found.configurational_error
    # at h omega = 0.9 the inner steps are those of BAOAB at half of that, and the slow kicks move it little
    assert 0.02 < 1 - found.kinetic_law < 0.1


def test_joined_particles_have_no_law_by_modes() -> None:
    scene = two_scales(joined=True, steps=300)
    found = heated_of(scene, [driver.run(scene, LABELS[0], seed=8)])
    assert np.isnan(found.kinetic_law)
    assert found.kinetic > 0


def test_a_file_of_it_is_told_with_its_share_of_fast_springs() -> None:
    scene = two_scales(steps=1000)
    run = driver.run(scene, LABELS[0], seed=3)
    for j, fast in enumerate([41 / 43.9, 17 / 18.1]):
        found = likely(FULL_RANK, run.q[:, j], run.p[:, j] / scene.m[j], scene.step)
        assert found[0].scheme == "baoab-respa2"
        assert found[1].nats > 13.8
        assert found[0].fast == pytest.approx(fast, abs=0.1)
    other = driver.run(scene, "own:obabo", seed=3)
    found = likely(FULL_RANK, other.q[:, 0], other.p[:, 0] / scene.m[0], scene.step)
    assert found[0].scheme == "obabo"
    assert {x.scheme: x.nats for x in found}["baoab-respa2"] > 13.8
