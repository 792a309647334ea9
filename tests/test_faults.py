"""Negative controls: every fault is rejected by the checks that must reject it, every check has a fault that
it rejects, and relative errors of 1e-12 in stiffness, mass or step are seen."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

import clean
import springcheck
from springcheck import checks, driver, store
from springcheck.errors import SceneError
from springcheck.physics import scenefile as scenes
from springcheck.studies.faults import baths
from springcheck.studies.faults import measure as trial
from springcheck.studies.faults.measure import examine
from springcheck.studies.faults.result import FaultReport, Result
from springcheck.studies.faults.seeded import Fault
from springcheck.studies.faults.table import FAULTS

Need = Callable[[str], None]


@cache
def result(fault: Fault) -> Result:
    return examine(fault, limits=False)


@pytest.mark.campaign
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_is_rejected_by_every_check_that_must_reject_it(fault: Fault) -> None:
    passed = trial.probe(fault)
    assert fault.caught_by
    assert [check for check in fault.caught_by if passed(check, fault.size) is not False] == []


def test_every_check_rejects_a_fault_that_it_must_reject() -> None:
    named = {check for fault in FAULTS for check in fault.caught_by}
    assert named == {check.name for check in checks.ALL} | set(baths.OF_THERMOSTATS)


def test_there_are_at_least_thirty_faults_of_different_names() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 30


@pytest.mark.parametrize("name", ["stiffness", "mass", "step"])
@pytest.mark.parametrize("sign", [1, -1])
def test_relative_errors_from_1e12_up_are_rejected_by_the_step_and_the_motion(name: str, sign: int) -> None:
    fault = next(fault for fault in FAULTS if fault.name == name)
    scene = trial.scene("spring")
    for decade in range(-12, -1):
        run = fault.run(scene, size=sign * 10.0**decade)
        failed = {v.check for v in checks.judge(scene, run) if v.passed is False}
        assert {"step-defect", "closed-form", "frequency"} <= failed, decade


@pytest.mark.parametrize("label", ["own:semi-implicit-euler", "openmm:verlet", "openmm:leapfrog"])
def test_an_engine_that_was_given_a_spring_1e12_too_stiff_is_rejected(label: str, need: Need) -> None:
    need(label)
    scene = scenes.load_scene("spring-uneven")
    run = driver.run(scene.system.scaled(1 + 1e-12), label)
    failed = {v.check for v in checks.judge(scene, run) if v.passed is False}
    # the energies stored are those of the stiffer spring
    assert "step-defect" in failed


def test_a_fault_on_a_scene_that_there_is_not_is_named_with_those_that_there_are() -> None:
    with pytest.raises(SceneError, match=r"scene 'sprinng' is none of spring, .*did you mean spring"):
        examine(replace(FAULTS[0], scene="sprinng"))


def test_a_limit_is_the_smallest_size_that_is_seen() -> None:
    fault = next(fault for fault in FAULTS if fault.name == "friction")
    limits = examine(fault).limits
    assert limits["step-defect"] < 1e-14
    scene = trial.scene(fault.scene)
    for factor, seen in ((1.05, True), (0.5, False)):
        run = fault.run(scene, size=factor * limits["step-defect"])
        verdict = next(v for v in checks.judge(scene, run) if v.check == "step-defect")
        assert (verdict.passed is False) == seen
    # no step shows a friction of a rounding, but 4096 of 256 springs do
    assert limits["rounding-bias"] < 2.0**-53


def test_clean_scenes_raise_no_alarm_and_are_counted(whole: bool) -> None:
    scenes = 24 if whole else 8
    parts = [clean.clean_scene(seed) for seed in range(scenes)]
    found = clean.together(parts)
    assert found.alarms == ()
    assert found.runs == scenes
    assert all(part.verdicts >= 5 for part in parts)


def test_every_clean_run_of_the_script_is_one_that_another_process_can_carry_out() -> None:
    parts = clean.parts()
    batches = (clean.CLEAN + clean.BATHS + clean.BY_ENGINES * len(clean.judged_labels())) / clean.BATCH
    assert len(parts) == len(clean.FIXED) + batches
    assert len(pickle.loads(pickle.dumps(parts))) == len(parts)


def test_a_broken_engine_among_the_clean_ones_is_a_false_alarm_that_is_reported() -> None:
    fault = next(fault for fault in FAULTS if fault.name == "friction")
    found = clean.clean_engine(fault.run, "friction", 0)
    assert found.alarms


def test_the_report_is_one_json_document() -> None:
    results = tuple(result(fault) for fault in FAULTS[:3])
    report = FaultReport(results=results)
    document = json.loads(json.dumps(report.document(), allow_nan=False))
    assert document["faults"][0]["rejected_by"]
    assert report.status == 0
    missed = replace(results[0], missed_by=("step-defect",))
    assert replace(report, results=(missed,)).status == 1


def test_a_fault_that_only_the_rounding_law_sees_passes_everything_else() -> None:
    assert set(result(next(f for f in FAULTS if f.name == "cut-off")).rejected_by) == {
        "rounding-bias",
        "rounding-growth",
    }


def test_the_package_exposes_its_scenes_to_a_plain_run() -> None:
    scene = trial.scene("spring")
    assert [
        v for v in checks.judge(scene, springcheck.simulate(scene, "own:euler")) if v.passed is False
    ] == []


@pytest.mark.usefixtures("sketched")
def test_faults_of_the_command_line_print_one_document_and_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from springcheck import cli

    few = FAULTS[:2]
    monkeypatch.setattr(trial, "FAULTS", few)
    named = {"shadow-energy", "order"}.union(*(fault.caught_by for fault in few))
    monkeypatch.setattr(trial, "checks_of", lambda fault: tuple(sorted(named)))
    assert cli.main(["faults", "--json", "--workers", "1"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document.pop("schema") == "springcheck/faults/2"
    assert [fault["name"] for fault in document["faults"]] == [fault.name for fault in few]
    assert document["limits"]["stiffness"]["step-defect"] < 1e-14
    monkeypatch.chdir(tmp_path)
    assert cli.main(["faults", "-o", "f.h5", "--workers", "1"]) == 0
    said = capsys.readouterr().out
    assert "2 of 2 faults rejected" in said
    assert cli.main(["inspect", "f.h5"]) == 0
    assert said.partition("Stored in")[0].strip() in capsys.readouterr().out
    assert trial.stored("f.h5").document() == document
    assert cli.main(["plot", "f.h5", "--quiet"]) == 0
    assert [path.name for path in sorted(tmp_path.rglob("*.png"))] == ["faults-checks.png", "faults.png"]
    assert cli.main(["faults", "-o", "f.h5"]) == 2
    assert "--force" in capsys.readouterr().err
    assert store.check("f.h5") == []

    def interrupt(done: float, whole: float, what: str = "") -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trial.record("g.h5", progress=interrupt)
    again = trial.record("g.h5")
    assert again.resumed == 1
    assert again.document() == document


def test_a_thorough_run_reports_its_experiments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from springcheck import cli

    store = str(tmp_path / "s.h5")
    arguments = ["run", "spring-uneven", "--method", "own:semi-implicit-euler", "-o", store]
    assert cli.main([*arguments, "--thorough"]) == 0
    out = capsys.readouterr().out
    assert "Experiments with laws" in out
    assert "…" not in out
    assert cli.main([*arguments, "--force"]) == 0
    assert "Experiments" not in capsys.readouterr().out
