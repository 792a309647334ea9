"""Negative controls: each check rejects every fault that it must reject, and a check without a fault fails.

Relative errors of 1e-12 in stiffness, mass or step are seen, and no clean engine is rejected.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import bathed as baths
import clean
from fault_table import FAULTS, scene
from springcheck import checks, cli, driver, store
from springcheck.checks.seeds import SEEDED
from springcheck.physics import scenefile as scenes
from textbook import Fault

Need = Callable[[str], None]

RECORDED = {check.name for check in (*checks.CHECKS, *checks.RANDOM)}
EXPERIMENTS = {check.name: check for check in (*checks.THOROUGH, *SEEDED)}
BY_NAME = {fault.name: fault for fault in FAULTS}


def rejecting(fault: Fault) -> set[str]:
    """Of the checks that must reject a fault, those that do."""
    where = scene(fault.scene)
    found = {v.check for v in checks.judge(where, fault.run(where)) if v.passed is False}
    asked = [name for name in fault.caught_by if name not in RECORDED]
    bench = checks.Bench(scene=where, label=fault.name, run=fault.run)
    subject = baths.subject(fault, None) if fault.random else bench
    return found | {name for name in asked if EXPERIMENTS[name](subject).passed is False}  # type: ignore[operator]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_is_rejected_by_every_check_that_must_reject_it(fault: Fault) -> None:
    assert fault.caught_by
    assert set(fault.caught_by) - rejecting(fault) == set()


def test_every_check_has_a_fault_that_it_must_reject() -> None:
    named = {check for fault in FAULTS for check in fault.caught_by}
    assert named == RECORDED | set(EXPERIMENTS)
    assert len(BY_NAME) == len(FAULTS)


@pytest.mark.parametrize("name", ["stiffness", "mass", "step"])
@pytest.mark.parametrize("sign", [1, -1])
def test_relative_errors_from_1e12_up_are_rejected_by_the_step_and_the_motion(name: str, sign: int) -> None:
    for decade in range(-12, -1):
        run = BY_NAME[name].run(scene("spring"), size=sign * 10.0**decade)
        failed = {v.check for v in checks.judge(scene("spring"), run) if v.passed is False}
        assert {"step-defect", "closed-form", "frequency"} <= failed, decade


@pytest.mark.parametrize("label", ["own:semi-implicit-euler", "openmm:verlet", "openmm:leapfrog"])
def test_an_engine_that_was_given_a_spring_1e12_too_stiff_is_rejected(label: str, need: Need) -> None:
    need(label)
    where = scenes.load_scene("spring-uneven")
    run = driver.run(where.system.scaled(1 + 1e-12), label)
    # the energies stored are those of the stiffer spring
    assert "step-defect" in {v.check for v in checks.judge(where, run) if v.passed is False}


def test_the_detection_limit_of_a_friction_is_below_ten_roundings() -> None:
    where = scene("spring")
    for size, seen in ((1e-15, True), (1e-17, False)):
        run = BY_NAME["friction"].run(where, size=size)
        (verdict,) = [v for v in checks.judge(where, run) if v.check == "step-defect"]
        assert (verdict.passed is False) == seen


def test_a_fault_that_only_the_rounding_law_sees_passes_everything_else() -> None:
    fault, where = BY_NAME["cut-off"], scene("spring")
    bench = checks.Bench(scene=where, label=fault.name, run=fault.run)
    verdicts = [*checks.judge(where, fault.run(where)), *(one(bench) for one in checks.THOROUGH)]
    assert {v.check for v in verdicts if v.passed is False} == {"rounding-bias", "rounding-growth"}


def test_clean_scenes_raise_no_alarm_and_are_counted(whole: bool) -> None:
    runs = 24 if whole else 8
    parts = [clean.clean_scene(seed) for seed in range(runs)]
    found = clean.together(parts)
    assert found.alarms == ()
    assert found.runs == runs
    assert all(part.verdicts >= 5 for part in parts)


def test_a_broken_engine_among_the_clean_ones_is_a_false_alarm_that_is_reported() -> None:
    assert clean.clean_engine(BY_NAME["friction"].run, "friction", 0).alarms


# run --fault


@pytest.mark.usefixtures("own_folder")
def test_a_fault_is_a_method_among_the_others_and_is_rejected(capsys: pytest.CaptureFixture[str]) -> None:
    euler = ["--method", "own:euler"]
    command = ["run", "spring-uneven", *euler, "--fault", "stiffness", "--fault", "mass=1e-6"]
    assert cli.main([*command, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    failed = {v["method"] for v in found["verdicts"] if v["passed"] is False}
    assert failed == set(found["faults"]) == {"fault:stiffness", "fault:mass"}
    assert "1e-06" in found["faults"]["fault:mass"]
    whole = store.read_one("spring-uneven.h5", "fault:mass")
    right = driver.run(scenes.load_scene("spring-uneven"), "own:velocity-verlet")
    # a phase of 200 steps of h w = 0.0885 with a mass that is 1e-6 too large
    assert abs(whole.q - right.q).max() == pytest.approx(0.3 * 200 * 0.0885 * 0.5e-6, rel=1)
    assert cli.main(["run", "--from", "spring-uneven.h5"]) == 2
    assert "broken on purpose" in capsys.readouterr().err
    assert cli.main(["run", "--from", "spring-uneven.h5", *euler]) == 0


@pytest.mark.usefixtures("own_folder")
@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("stifness", ("stiffness", "early-momenta", "text-file")),
        ("", ("stiffness", "early-momenta", "text-file")),
        ("first-order=2", ("no size",)),
        ("mass=-1", ("above 0",)),
    ],
)
def test_a_fault_that_there_is_not_is_answered_with_all_names(
    given: str, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", "spring", "--method", "own:euler", "--fault", given]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert all(word in said for word in words)
    assert not list(Path().glob("*.h5"))


@pytest.mark.usefixtures("own_folder")
def test_a_fault_that_a_scene_does_not_show_or_that_a_bath_excludes_is_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for arguments, words in (
        (["spring", "--method", "own:euler", "--fault", "momentum-for-velocity"], "shows nothing"),
        (["bath-spring", "--method", "own:baoab", "--fault", "mass"], "bath"),
    ):
        assert cli.main(["run", *arguments]) == 2
        assert words in capsys.readouterr().err


def test_every_fault_of_the_classroom_is_rejected_on_its_uneven_spring() -> None:
    from springcheck.studies.run import faulty

    where = replace(scenes.load_scene("spring-uneven"), steps=2100)
    for one in faulty.FAULTS:
        made = faulty.Broken(one, None).made(where)
        assert any(v.passed is False for v in checks.judge(where, made)), one.name
