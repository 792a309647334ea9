"""BAOAB-RESPA: a thermostat that takes fast springs several times between two half kicks of the slow ones."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import checks, driver, engines
from springcheck.checks.seeds import Seeded, noise_map
from springcheck.identify.thermal import of_bath
from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory
from springcheck.thermal import Stepper, Thermostat
from springcheck.thermal.catalogue import by_groups
from springcheck.thermal.heat import heated_of
from springcheck.thermal.likelihood import SUBSTEPS_TRIED, likely_apart

LABELS = (
    "own:baoab-respa2", "openmm:mts-langevin-2", "own:baoab-respa3", "openmm:mts-langevin-3",
    "openmm:mts-langevin-4",
)  # fmt: skip


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
    verdicts += checks.judge_thoroughly(scene, label, driver.run, seed=5)
    assert [f"{v.check}: {v.why}" for v in verdicts if v.passed is False] == []
    passed = {v.check for v in verdicts if v.passed}
    assert {"noise-map", "draws-variance", "draws-mean", "draws-neighbours", "seed-kept"} <= passed
    assert ("noise-size" in passed) is not joined


@pytest.mark.parametrize("label", ["own:baoab", "openmm:mts-langevin"])
def test_springs_that_are_not_taken_apart_are_another_map(label: str) -> None:
    here(label)
    for made, claimed in ((label, "baoab-respa2"), (LABELS[0], "baoab")):

        def play(scene: Scene, label: str, seed: Any, claimed: str = claimed) -> Trajectory:
            return replace(driver.run(scene, label, seed=seed), scheme=claimed)

        wrong = Seeded(scene=two_scales(), label=made, seed=5, play=play)
        assert noise_map(wrong).passed is False


@pytest.mark.parametrize("joined", [False, True], ids=["apart", "joined"])
@pytest.mark.parametrize("wrong", [{"temperature": 2.1}, {"friction": 1.2}])
def test_sums_of_many_draws_a_step_show_another_bath(wrong: dict[str, float], joined: bool) -> None:
    scene = two_scales(joined=joined)
    assert scene.bath is not None
    run = driver.run(scene, "own:baoab-respa4", seed=5)
    told = checks.judge(replace(scene, bath=replace(scene.bath, **wrong)), run)
    assert "draws-variance" in {v.check for v in checks.shared(told) if v.passed is False}


def test_three_draws_a_step_are_not_told_by_forces_that_are_not_linear() -> None:
    scene = two_scales()
    well = Quartic(i=np.arange(2), b=np.array([1.1, 0.7]), at=np.zeros(2))
    scene = replace(scene, terms=(*scene.terms, well), steps=100)
    verdicts = springcheck.judge(scene, driver.run(scene, "own:baoab-respa3", seed=5))
    assert [v.check for v in verdicts if v.passed is False] == []
    (variance,) = (v for v in verdicts if v.check == "draws-variance")
    assert variance.passed is None
    assert "linear forces alone" in variance.why


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


@pytest.mark.parametrize(("substeps", "frames"), [(2, 20_000)])
def test_a_long_file_of_it_is_told_with_its_substeps_and_its_share_of_fast_springs(
    substeps: int, frames: int
) -> None:
    scene = two_scales(steps=frames)
    run = driver.run(scene, f"own:baoab-respa{substeps}", seed=3)
    tried = likely_apart(run.q[:, 0], run.p[:, 0] / scene.m[0], scene.step)
    found = [x for x in tried if x.strides == (1,)]
    assert found[0].scheme == f"baoab-respa{substeps}"
    assert found[1].nats > 13.8
    assert found[0].fast == pytest.approx(41 / 43.9, abs=0.03)


@pytest.mark.campaign
@pytest.mark.parametrize(("substeps", "every"), [(3, 1), (4, 3), (20, 1)])
def test_a_short_file_of_it_is_listed_with_every_count_that_it_leaves_open(substeps: int, every: int) -> None:
    q, v = stepped(by_groups(substeps), 1000 * every)
    t = every * np.arange(1000.0)
    found = of_bath(t, q[::every, None], v[::every, None], None, np.ones(1))
    assert found is not None
    assert found.scheme is None
    names = [one.scheme for one in found.candidates]
    assert f"baoab-respa{min(substeps, SUBSTEPS_TRIED[-1])}" in names
    assert sum("respa" in one for one in found.choice) <= 2
    assert found.statement.count("baoab-respa") == 1
    assert substeps <= 12 or "12 or more" in found.statement


def stepped(scheme: Thermostat, steps: int) -> tuple[Floats, Floats]:
    """Positions and velocities by a scheme of unit step and mass, half of its spring fast."""
    rng, k = np.random.default_rng(4), 0.65**2
    stepper = Stepper(scheme, h=1.0, m=np.ones(1), rate=0.17, thermal=1.0, width=np.float64)
    parts = dict.fromkeys(("slow", "fast"), lambda q, p: -k / 2 * q)
    q, p, out = np.ones(1), np.zeros(1), np.empty((2, steps))
    for i in range(steps):
        out[:, i] = q[0], p[0]
        q, p = stepper(q, p, parts, list(rng.normal(size=(scheme.draws, 1))))
    return out[0], out[1]


def test_obabo_is_not_told_as_it() -> None:
    scene = two_scales(steps=1000)
    other = driver.run(scene, "own:obabo", seed=3)
    found = likely_apart(other.q[:, 0], other.p[:, 0] / scene.m[0], scene.step)
    assert found[0].scheme == "obabo"
    assert all(x.nats > 13.8 for x in found if x.scheme.startswith("baoab-respa"))
