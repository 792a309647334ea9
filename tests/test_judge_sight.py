"""What a verdict says that it would have seen: an engine that is off by three limits fails, by a tenth of one
passes; and the limits are kept and shown wherever verdicts are."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clean
import springcheck
from springcheck import checks, schemes, store
from springcheck.checks import experiments
from springcheck.cli import main
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, Spring, WallSpring
from springcheck.physics.trajectory import NOT_KNOWN, Limits, Trajectory, Verdict
from springcheck.store import tables

VALIDATION = Path(__file__).parent.parent / "validation"
sys.path.insert(0, str(VALIDATION))
_spec = importlib.util.spec_from_file_location("detection", VALIDATION / "detection.py")
assert _spec is not None
assert _spec.loader is not None
detection = importlib.util.module_from_spec(_spec)
sys.modules["detection"] = detection
_spec.loader.exec_module(detection)

Need = Callable[[str], None]

WELL = clean.scene(
    np.array([1.3]), (Quartic(i=np.array([0]), b=np.array([2.3]), at=np.zeros(1)),), np.array([0.9]),
    np.array([0.4]), step=0.05, steps=30,
)  # fmt: skip
SCENES: dict[str, Scene] = {
    "h w = 0.002": detection.spring(0.002, 30),
    "h w = 0.3": detection.spring(0.3, 30),
    "h w = 1.9": detection.spring(1.9, 30),
    "damped": detection.spring(0.1, 30, damped=True),
    "every 10 steps": replace(detection.spring(0.2, 60), every=10),
    "chain": replace(scenefile.load_scene("chain"), steps=20),
    "well": WELL,
    "well, every 6 steps": replace(WELL, every=6),
    "free chain": clean.scene(
        np.array([1.3, 0.7, 2.1]),
        (Spring(a=np.array([0, 1]), b=np.array([1, 2]), k=np.array([1.1, 3.7]), rest=np.array([0.9, 1.2])),),
        np.array([0.2, 1.0, 1.9]), np.array([0.4, -0.3, 0.5]), step=0.05, steps=20,
    ),
}  # fmt: skip


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["semi-implicit-euler", "velocity-verlet", "rk4", "implicit-euler"])
@pytest.mark.parametrize("where", SCENES)
def test_three_limits_fail_and_a_tenth_of_one_passes(where: str, name: str) -> None:
    tried, wrong = detection.wrong(SCENES[where], schemes.SCHEMES[name])
    assert wrong == []
    assert tried >= (3 if where == "free chain" else 2)


def test_a_spring_whose_effect_drowns_in_the_references_rounding_has_its_own_limit() -> None:
    """A quartic beside a wall spring, so near their place that half a percent of it is a rounding."""
    walls = WallSpring(i=np.array([0, 1]), k=np.array([2.3e-4, 9.1e-4]), at=np.zeros(2))
    wells = Quartic(i=np.array([0, 1]), b=np.array([9.3e-6, 2.1e-6]), at=np.zeros(2))
    start = np.array([2e-4, 6.7]), np.array([2e-6, 0.1])
    scene = clean.scene(np.array([0.141, 0.039]), (walls, wells), *start, step=0.02, steps=15)
    scheme = schemes.SCHEMES["explicit-euler"]
    tried, wrong = detection.wrong(scene, scheme)
    assert wrong == []
    assert tried == 2
    sees = checks.judge(scene, detection.planted(scene, scheme), [checks.step_defect])[0].sees
    assert sees.stiffness is not None
    assert 1e-3 < sees.stiffness < 2.0**-5


@pytest.mark.campaign
@pytest.mark.parametrize("experiment", detection.EXPERIMENTS, ids=lambda experiment: experiment.name)
def test_the_limits_of_experiments_hold_likewise(experiment: checks.Check) -> None:
    cases = [("h w = 0.3", "semi-implicit-euler")]
    if experiment.family == "map":
        cases += [("h w = 1.9", "implicit-midpoint"), ("free chain", "forest-ruth")]
    for where, name in cases:
        found = detection.wrong_experiment(experiment, SCENES[where], schemes.SCHEMES[name])
        assert found == (1, [])


def test_limits_are_as_small_as_rounding_allows() -> None:
    sees = detection.least(detection.spring(0.1, 200), "velocity-verlet")
    assert 1e-16 < sees.stiffness < 1e-14
    assert 1e-16 < sees.step < 1e-14
    assert sees.friction is None
    assert detection.least(detection.spring(0.1, 200, damped=True), "velocity-verlet").friction < 1e-11


def test_an_adaptive_solver_s_tolerance_says_what_it_hides(need: Need) -> None:
    need("sundials:bdf")
    scene = replace(detection.spring(0.1, 60), tolerance=1e-8)
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, "sundials:bdf"))}
    limit = found["tolerance"].sees.stiffness
    assert limit is not None
    assert 1e-9 < limit < 1e-2
    wrong = springcheck.simulate(scene.system.scaled(1 + 3 * limit), "sundials:bdf")
    (seen,) = checks.judge(scene, wrong, [checks.tolerance])
    assert seen.passed is False


@pytest.mark.parametrize("every", [1, 7])
@pytest.mark.parametrize("shorter", [1, 1000])
def test_recorded_times_are_no_part_of_what_shows_a_wrong_step_of_a_driven_scene(
    shorter: int, every: int
) -> None:
    scene = scenefile.load_scene("driven-spring")
    scene = replace(scene, step=scene.step / shorter, steps=140, every=every)
    right = springcheck.simulate(scene, "own:velocity-verlet")
    (seen,) = checks.judge(scene, right, [checks.step_defect])
    assert seen.sees.step is not None
    for part, passed in ((3.0, False), (0.1, True)):
        of = replace(scene, step=scene.step * (1 + part * seen.sees.step))
        wrong = replace(springcheck.simulate(of, "own:velocity-verlet"), t=right.t, step=scene.step)
        (found,) = checks.judge(scene, wrong, [checks.step_defect])
        assert found.passed is passed


def verdict(**limits: float | None) -> Verdict:
    return Verdict(
        method="m", check="c", value=1.0, bound=2.0, unit="", passed=True, why="", sees=Limits(**limits)
    )


def test_of_the_pieces_of_a_run_the_one_that_sees_most_counts() -> None:
    (found,) = checks.worst([[verdict(stiffness=3e-13)], [verdict(stiffness=1e-14, step=2e-9)]])
    assert found.sees == Limits(stiffness=1e-14, step=2e-9)
    assert Limits.least([]) == NOT_KNOWN
    assert str(found.sees) == "smallest detectable errors: stiffness 1.0e-14, step 2.0e-09"
    assert str(NOT_KNOWN) == ""
    assert "phase-space area per step 3.0e-15" in verdict(area=3e-15).reason
    exact = replace(verdict(), bound=0.0)
    assert exact.reason == "any other value would fail"


def test_limits_are_stored_and_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.h5"
    asked = ["run", "spring-uneven", "-o", str(path), "--method", "own:*euler"]
    assert main(asked) == 0
    assert "Smallest detectable stiffness error: " in capsys.readouterr().out
    found = [v for v in store.verdicts(path) if v.check == "step-defect"]
    assert all(v.sees.stiffness is not None and v.sees.stiffness < 1e-13 for v in found)
    assert main(["inspect", str(path), "--verdicts"]) == 0
    assert "smallest detectable errors: stiffness" in capsys.readouterr().out
    assert main(["inspect", str(path), "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    sees = {v["check"]: v["sees"] for v in shown["verdicts"]}
    assert sees["step-defect"]["stiffness"] < 1e-13
    assert set(sees["start"].values()) == {None}


def test_a_store_of_before_has_fewer_limits() -> None:
    table = tables.of_verdicts([verdict(stiffness=3e-13, area=2e-15)])
    columns = {
        name: np.array(x, object if isinstance(x, list) else None) for name, x in table.columns.items()
    }
    assert tables.to_verdicts(replace(table, columns=columns))[0].sees.area == 2e-15
    del columns["sees_area"]
    assert tables.to_verdicts(replace(table, columns=columns))[0].sees == Limits(stiffness=3e-13)


def test_the_matrix_says_it_of_its_single_steps() -> None:
    scene, scheme = detection.spring(0.3, 20), schemes.SCHEMES["velocity-verlet"]

    def bench(name: str = "", x: float = 0.0) -> checks.Bench:
        def run(other: Scene, label: str) -> Trajectory:
            made: Trajectory = detection.planted(other, scheme, name, x)
            return made

        return checks.Bench(scene=scene, label="", run=run)

    for name in ("stiffness", "step"):
        limit = getattr(experiments.propagator(bench()).sees, name)
        assert experiments.propagator(bench(name, 3 * limit)).passed is False
        assert experiments.propagator(bench(name, limit / 10)).passed is True


def test_of_a_motion_that_explodes_no_limit_is_stated_that_its_first_order_does_not_tell() -> None:
    """A wall that pushes into a quartic with a step too long for it: the seventh step leaves by 1e5."""
    at = np.array([-0.247])
    terms = (
        WallSpring(i=np.array([0]), k=np.array([-113.0]), at=at),
        Quartic(i=np.array([0]), b=np.array([54.2]), at=at),
    )
    start = np.array([0.1014]), terms, np.array([0.00612]), np.array([-0.0171])
    scene, scheme = clean.scene(*start, step=0.0323, steps=7), schemes.SCHEMES["position-verlet"]
    bench = checks.Bench(scene=scene, label="", run=lambda made, label: detection.planted(made, scheme))
    verdict = experiments.reversibility(bench)
    assert verdict.passed is True
    assert verdict.sees == NOT_KNOWN
