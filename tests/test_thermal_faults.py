"""Thermostats that are broken on purpose are among the faults; what is right beside them passes.

A test of all faults holds each of them to the checks that must reject it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from clean import clean_bath
from springcheck import checks, cli, driver, engines
from springcheck.bath import THERMOSTATS, chance
from springcheck.physics.trajectory import Verdict
from springcheck.studies.faults import baths
from springcheck.studies.faults.measure import probe, scene
from springcheck.studies.faults.seeded import Case as Broken
from springcheck.studies.faults.seeded import Fault
from springcheck.studies.faults.table import FAULTS


def test_there_are_forty_faults_of_thermostats_at_least() -> None:
    assert sum(fault.random for fault in FAULTS) >= 45


@pytest.mark.parametrize("name", ["baoab", "obabo", "bbk", "gj-i-half", "lammps-langevin", "andersen"])
def test_what_is_right_passes_here(name: str) -> None:
    right = Fault(name, "", (), baths.played, scheme=name, scene="bath")
    passed = probe(right)
    found = {check: passed(check, None) for check in baths.OF_THERMOSTATS}
    assert [check for check, one in found.items() if one is False] == []
    assert sum(one is True for one in found.values()) >= 9


def test_right_thermostats_raise_no_alarm_in_random_baths() -> None:
    """Among these were alarms of coefficients that cancel, of noise below rounding, of rare collisions, of
    draws that were told apart by the mass of another particle."""
    for seed in (4, 17, 21, 41, 50, 63, 70, 85, 88, 110, 137, 141, 953, 1216, 1344, 2284, 284, 588, 891):
        found = clean_bath(seed)
        assert found.alarms == ()
        assert found.verdicts >= 4


def test_skewed_draws_are_rejected_whose_even_moments_are_all_right() -> None:
    """Draws of a normal number's size, positive where that exceeds sqrt(2 log 2) and negative below, have a
    mean of 0, as half of exp(-x**2/2) lies beyond, and no even moment tells them from normal ones."""

    def lopsided(right: Sequence[np.ndarray]) -> np.ndarray:
        return np.copysign(right[-1], np.abs(right[-1]) - np.sqrt(2 * np.log(2)))

    for name in ("baoab", "obabo", "bbk", "andersen"):
        fault = Fault(name, "", (), lambda c: baths.played(c, lopsided), scheme=name, scene="bath")
        found = {v.check: v.passed for v in checks.judge(scene("bath"), fault.run(scene("bath")))}
        assert found["draws-shape"] is False
        assert found["draws-mean"] is not False
        assert found["draws-variance"] is not False


def test_noise_below_rounding_hides_the_draws_and_not_the_map() -> None:
    far = scene("bath").derived(q=np.full(40, 1e12))
    right = Fault("right", "", (), baths.played, scheme="baoab", scene="bath")
    said = {v.check: v for v in checks.judge(far, right.run(far))}
    assert said["noise-direction"].passed is True
    assert said["draws-variance"].passed is None
    assert "rounding hides the draws" in said["draws-variance"].why
    for name in ("bath-stiffness", "half-kick-old", "bath-step"):
        fault = next(fault for fault in FAULTS if fault.name == name)
        found = {v.check: v.passed for v in checks.judge(far, fault.run(far))}
        assert found["noise-direction"] is False, name


def test_the_largest_correlation_of_two_seeds_has_the_chance_of_its_null() -> None:
    rng = np.random.default_rng(5)
    found = np.array([chance.crossed(*rng.standard_normal((2, 300))) for _ in range(1000)])
    for level in (0.5, 0.1, 0.01):
        assert np.mean(found <= level) < level + 5 * np.sqrt(level / len(found))
    x = rng.standard_normal(400)
    assert chance.crossed(x[40:], x[:-40]) < 1e-12
    assert chance.crossed(x[:-40], x[40:]) < 1e-12


def test_a_broken_thermostat_runs_among_the_others(
    capsys: pytest.CaptureFixture[str], tmp_path: object
) -> None:
    out = ["-o", f"{tmp_path}/f.h5", "--force", "--method", "own:baoab"]
    heat = ["--temperature", "300K", "--seed", "3", "--fault", "bath-step=1e-6"]
    assert cli.main(["run", "spring", *heat, *out]) == 1
    assert "noise-direction" in capsys.readouterr().out
    for arguments, said in (
        (["--fault", "bath-step"], "--fault bath-step: it needs a scene with a bath: --temperature"),
        (["--fault", "mass", "--temperature", "300K"], "--fault mass: it needs a scene with no bath"),
    ):
        methods = out if "mass" in arguments else [*out[:3], "--method", "own:euler"]
        assert cli.main(["run", "spring", *arguments, *methods]) == 2
        assert said in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    "label",
    [
        "own:baoab",
        "own:aoboa",
        "own:oabao",
        "own:gj-i-half",
        "own:andersen",
        "own:bbk",
        "openmm:langevin-middle-bath",
        "ase:langevin",
    ],
)
def test_experiments_with_seeds_pass_for_what_is_right(label: str) -> None:
    if reason := engines.absence(label.partition(":")[0]):
        pytest.skip(reason)
    found = checks.judge_thoroughly(baths.springs(3), label, driver.run, seed=5)
    assert [v.why for v in found if v.passed is False] == []
    assert sum(v.passed is True for v in found) >= 2


@pytest.mark.parametrize("scheme", ["baoab", "baoa"])
def test_a_drag_without_its_noise_is_seen_from_the_stated_limit_on(scheme: str) -> None:
    """It is missed in a run of 20; a tenth of it is seen in none."""
    at = baths.springs(3, steps=2000)
    x = baths.forgetting(at)

    def judged(seed: int, off: float) -> Verdict:
        right_noise = baths.by(np.sqrt(np.expm1(-2 * x) / np.expm1(-2 * x * (1 + off))))
        broken = Broken(scene=at, scheme=THERMOSTATS[scheme], seed=seed, x=0.0)
        run = baths.played(broken, right_noise, rate=1 + off)
        return checks.shared([checks.thermal.draws_state(checks.Case(trajectory=run, scene=at))])[0]

    limit = judged(0, 0.0).sees.friction
    assert limit is not None
    assert 0.2 < limit < 0.8
    for off, least, most in ((limit, 10, 12), (-limit, 10, 12), (0.1 * limit, 0, 0)):
        seen = sum(judged(seed, off).passed is False for seed in range(12))
        assert least <= seen <= most
