"""What the judge says where it cannot tell, and of a store whose numbers are no longer those of its seal."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import clean
import springcheck
import textbook as steppers
from springcheck import checks, driver, engines, schemes
from springcheck.checks import experiments
from springcheck.checks.steps import NO_BETTER
from springcheck.cli import file, main
from springcheck.physics import scenefile
from springcheck.physics.arrays import WIDE
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Cosine, Quartic, WallSpring
from springcheck.studies.extremes import grid
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.run import measure

Need = Callable[[str], None]
LAZY = "ase:velocity-verlet"

UNTELLING = """
title = "A well, recorded so rarely that no step can be told"
[[particle]]
mass = 1.0
position = 1.0
[[quartic]]
particle = 0
coefficient = 1.3
[time]
step = 0.1
steps = 6000
[record]
every = 3000
"""


def test_a_method_of_which_nothing_could_tell_is_not_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml = tmp_path / "still.toml"
    toml.write_text(UNTELLING)
    arguments = ["run", str(toml), "-o", str(tmp_path / "a.h5"), "--method", "own:semi-implicit-euler"]
    assert main(arguments) == 2
    said = capsys.readouterr().out
    assert "not judged: own:semi-implicit-euler: nothing that applied could tell" in said
    # the same file without knowledge of its method, and on a page
    arguments = ["judge", str(tmp_path / "a.h5"), "--scene", str(toml), "--scheme", "explicit-euler"]
    assert main(arguments) == 2
    assert capsys.readouterr().out.startswith("NOT JUDGED")
    assert main(["report", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.html")]) == 0
    assert "not judged" in (tmp_path / "a.html").read_text()


def test_a_method_is_not_judged_by_facts_of_its_record_alone() -> None:
    scene = scenefile.load_scene("spring-uneven")
    run = springcheck.simulate(replace(scene, steps=20), "own:semi-implicit-euler")
    verdicts = checks.judge(replace(scene, steps=20), run)
    assert checks.not_judged(verdicts) == ()
    facts = [v for v in verdicts if v.check in ("start", "times", "grid", "energies", "line", "momentum")]
    assert checks.not_judged(facts) == (run.label,)


def is_of_numbers(data: object) -> bool:
    return (
        isinstance(data, h5py.Dataset)
        and data.dtype == np.float64
        and len(data) > 100
        and not data.is_virtual
    )


def test_a_repetition_is_held_against_the_numbers_and_not_against_their_digest(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    assert main(["run", "spring", "-o", str(path), "--method", "own:semi-implicit-euler", "--quiet"]) == 0
    assert all(one.equal for one in measure.repeat(path))
    with h5py.File(path, "r+") as file:
        found: list[h5py.Dataset] = []
        file.visititems(lambda name, x: found.append(x) if is_of_numbers(x) else None)
        assert found
        for data in found:
            data[5] = np.nextafter(data[5], 2.0)
    assert not any(one.equal for one in measure.repeat(path))


def lone(size: float) -> Scene:
    return clean.scene(
        np.array([3.7]), (clean.walls(np.array([2.9]), np.zeros(1)),), np.array([0.3 * size]),
        np.array([0.7 * size]), step=0.1, steps=60,
    )  # fmt: skip


def test_ase_keeps_its_forces_for_motions_below_1e_15_and_the_verdict_says_so(need: Need) -> None:
    need("ase:velocity-verlet")
    assert all(v.passed is not False for v in checks.judge(lone(1.0), springcheck.simulate(lone(1.0), LAZY)))
    scene = lone(1e-14)
    failed = [v for v in checks.judge(scene, springcheck.simulate(scene, LAZY)) if v.passed is False]
    (defect,) = (v for v in failed if v.check == "step-defect")
    assert "forces are reused while no position moves by more than 1e-15" in defect.why


def test_a_cell_of_the_atlas_is_judged_alone_where_company_would_refresh_its_force(need: Need) -> None:
    need("ase:velocity-verlet")
    large = grid.Spec(block="size", m=3.7, k=2.9, q=0.3, p=0.7, h=0.1, steps=20)
    small = replace(large, q=3e-15, p=7e-15)
    one, other = extremes.cells(engines.parse(LAZY), [large, small])
    assert one.outcome == "right"
    assert other.outcome == "engine's limit"
    assert "forces are reused" in other.reason


@pytest.mark.parametrize(
    ("label", "size", "passed"),
    [(LAZY, 1.0, True), (LAZY, 1e-14, False), ("openmm:verlet", 1e-14, True), ("own:euler", 1e-14, True)],
)
def test_company_changes_nothing_but_ase_s_smallest_motions(
    label: str, size: float, passed: bool, need: Need
) -> None:
    need(label)
    bench = checks.Bench(scene=lone(size), label=label, run=driver.run)
    assert experiments.company(bench).passed is passed


def test_a_run_that_left_no_frame_has_no_error(tmp_path: Path) -> None:
    well = clean.scene(
        np.array([1.0]),
        (Quartic(i=[0], b=[1.0], at=[0.0]),),
        np.array([1e60]),
        np.zeros(1),
        step=1.0,
        steps=40,
        every=20,
    )
    report = measure.run(well, tmp_path / "a.h5", methods=["own:euler"])
    (line,) = report.runs
    assert line.outcome == "diverged"
    assert line.steps == 0
    assert np.isnan(line.max_error)
    assert np.isnan(line.energy_drift)


def test_what_the_scenes_say_of_verlet_s_frequency_follows_from_their_numbers() -> None:
    """A step turns the phase by 2 asin(h w/2) instead of h w."""
    light = 2.99792458e10
    for name, number, cases in (
        ("carbon-monoxide", 2169.81358, {1.0: ("0.71 %", "15.4 1/cm"), 2.0: ("3.02 %", "65.5 1/cm")}),
        ("ch-bond", 2936.0, {2.0: ("5.96 %",)}),
    ):
        for femtoseconds, said in cases.items():
            hw = 2 * np.pi * light * number * femtoseconds * 1e-15
            excess = 2 * np.arcsin(hw / 2) / hw - 1
            shown = (f"{100 * excess:.2f} %", f"{excess * number:.1f} 1/cm")
            assert shown[: len(said)] == said
            source = (Path(__file__).parent.parent / "data" / "scenes" / f"{name}.toml").read_text()
            assert all(part in source for part in said)
    source = (Path(__file__).parent.parent / "data" / "scenes" / "morse-bond.toml").read_text()
    assert f"{2990.9463**2 / (4 * 52.8186):.2f} 1/cm" in source


def test_judge_says_what_run_says_and_counts_what_failed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = scenefile.load_scene("spring-uneven")
    run = driver.run(scene, "own:velocity-verlet")
    np.savetxt(tmp_path / "a.csv", np.c_[run.t, run.q, run.p], fmt="%.17g", delimiter=",", header="t,q,p")
    judged = ["judge", str(tmp_path / "a.csv"), "--scene", "spring-uneven", "--scheme"]
    assert main([*judged, "velocity-verlet"]) == 0
    assert capsys.readouterr().out.startswith("PASSED: velocity Verlet")
    assert main([*judged, "semi-implicit-euler"]) == 1
    said = capsys.readouterr().out
    assert said.startswith("FAILED: not semi-implicit Euler, kick-drift, from step 1.")
    assert "elocity Verlet" in said.partition("Diagnosis: ")[2]
    failed = {line.split()[0] for line in said.splitlines() if line.endswith(" roundings")}
    assert failed >= {"step-defect", "closed-form"}


def test_times_in_another_unit_are_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = driver.run(scenefile.load_scene("ch-bond"), "own:velocity-verlet")
    table = np.c_[run.t * 1000, run.q, run.p]
    names = ["t", *(f"q{i}" for i in range(run.q.shape[1])), *(f"p{i}" for i in range(run.q.shape[1]))]
    np.savetxt(tmp_path / "a.csv", table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    arguments = ["judge", str(tmp_path / "a.csv"), "--scene", "ch-bond", "--scheme", "velocity-verlet"]
    assert main(arguments) == 2
    assert "the times look like fs: frames lie" in capsys.readouterr().err


def test_times_a_thousand_times_as_far_apart_may_be_in_another_unit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without units in the scene they were 1000 steps a frame: the file failed with no word on its times."""
    scene = replace(scenefile.load_scene("spring-uneven"), steps=12)
    (tmp_path / "s.toml").write_text(scene.to_toml())
    run = driver.run(scene, "own:velocity-verlet")
    for times in (1000, 1):
        table = np.c_[run.t * times, run.q, run.p]
        np.savetxt(tmp_path / "a.csv", table, fmt="%.17g", delimiter=",", header="t,q,p", comments="")
        names = str(tmp_path / "a.csv"), "--scene", str(tmp_path / "s.toml")
        assert main(["judge", *names, "--scheme", "velocity-verlet"]) == (times != 1)
        told = " ".join(capsys.readouterr().out.split())
        assert ("as ms are for s, divide them by 1000" in told) is (times != 1)


def far_and_near() -> Scene:
    """A mass at a wall 1e9 away, whose motion is some ulp of its place, beside one at the origin."""
    return clean.scene(
        np.array([3.7, 1.3]),
        (clean.walls(np.array([2.9, 1.7]), np.array([1e9, 0.0])),),
        np.array([1e9 + 1e-6, 0.3]),
        np.array([0.0, 0.7]),
        step=0.1,
        steps=60,
    )


def test_a_motion_below_the_rounding_of_its_place_is_named(tmp_path: Path) -> None:
    scene = far_and_near()
    run = springcheck.simulate(scene, "own:velocity-verlet")
    (right,) = checks.judge(scene, run, [checks.step_defect])
    assert right.passed is True
    assert f"q of particle 0, p of particle 0 {checks.BLIND}" in right.why
    # it may stand still, the other one may not
    for j, passed in ((0, True), (1, False)):
        q, p = run.q.copy(), run.p.copy()
        q[:, j], p[:, j] = q[0, j], p[0, j]
        (found,) = checks.judge(scene, replace(run, q=q, p=p), [checks.step_defect])
        assert found.passed is passed
    report = measure.run(scene, tmp_path / "a.h5", methods=["own:velocity-verlet"])
    said = "\n".join(str(line) for line in report.lines())
    assert f"own:velocity-verlet: q of particle 0, p of particle 0 {checks.BLIND}" in said


@pytest.mark.parametrize("at", [1e6, 1e9])
def test_what_far_walls_hide_of_a_motion_is_named_with_its_size(at: float) -> None:
    k = np.array([2.9, 2.9, 1.7])
    walls = WallSpring(i=np.array([0, 0, 1]), k=k, at=np.array([at, -at, 0.0]))
    start = np.array([0.3, 0.3]), np.array([0.2, 0.7])
    scene = clean.scene(np.array([3.7, 1.3]), (walls,), *start, step=0.1, steps=60)
    run = springcheck.simulate(scene, "own:velocity-verlet")
    (right,) = checks.judge(scene, run, [checks.step_defect])
    assert right.passed is True
    found = re.search(
        r"; q of particle 0 \((\S+)\), p of particle 0 \((\S+)\) cannot be judged to", right.why
    )
    assert found is not None
    assert "particle 1" not in right.why
    # what passes of either is below what is said of it, and a little more fails
    for name, size in zip("qp", map(float, found.groups()), strict=True):
        for part, passed in ((0.4, True), (2.0, False)):
            states = getattr(run, name).copy()
            states[7, 0] += part * size
            (kicked,) = checks.judge(scene, replace(run, **{name: states}), [checks.step_defect])
            assert kicked.passed is passed, (name, part)
    assert float(found[1]) < 1e-14 * at


def test_what_is_off_by_more_than_recording_it_rounds_fails_or_is_named() -> None:
    """Two opposite forces hide much more of a momentum than a right engine loses of it."""
    at, k, depth = np.zeros(1), np.array([-0.43]), np.array([0.151])
    wave = Cosine(i=np.array([0]), depth=depth, wave=np.array([2.7]), at=at)
    terms = (WallSpring(i=np.array([0]), k=k, at=at), wave)
    start = np.array([1.6e-3]), np.array([8e-4])
    scene = clean.scene(np.array([3.3]), terms, *start, step=0.057, steps=10)
    scheme = schemes.SCHEMES["implicit-euler"]
    run = steppers.record(scene, scheme, steppers.textbook(scene, scheme))
    (right,) = checks.judge(scene, run, [checks.step_defect])
    assert right.passed is True
    assert NO_BETTER not in right.why or not WIDE
    seen = []
    for off in 24.0 * 4.0 ** np.arange(6):
        p = run.p.copy()
        p[5] += off * np.spacing(np.max(np.abs(p))) / 2
        (found,) = checks.judge(scene, replace(run, p=p), [checks.step_defect])
        assert found.passed is False or re.search(r"p of particle 0 \(\S+\).* cannot be judged to", found.why)
        seen.append(found.passed)
    assert seen[0] is True
    assert seen[-1] is False


def test_nothing_is_named_that_stays_by_right() -> None:
    """The momentum of a free particle does not move, and any other one is seen."""
    free = clean.scene(
        np.array([3.7, 1.3]),
        (clean.walls(np.array([0.0, 1.7]), np.zeros(2)),),
        np.array([0.3, 0.3]),
        np.array([0.2, 0.7]),
        step=0.1,
        steps=60,
    )
    (found,) = checks.judge(free, springcheck.simulate(free, "own:velocity-verlet"), [checks.step_defect])
    assert checks.BLIND not in found.why


def test_what_would_be_seen_is_of_the_spring_that_shows_least() -> None:
    """A weak spring beside a stiff one on the same particle is seen 1e3 times worse."""
    strong, weak = 2.9, 2.9e-3
    walls = clean.walls(np.array([strong, weak]), np.array([0.0, 0.0]))
    near = replace(walls, i=np.array([0, 0]))
    single = clean.scene(np.array([3.7]), (near,), np.array([0.3]), np.array([0.7]), step=0.1, steps=60)
    (both,) = checks.judge(single, springcheck.simulate(single, "own:velocity-verlet"), [checks.step_defect])
    alone = lone(1.0)
    (lonely,) = checks.judge(alone, springcheck.simulate(alone, "own:velocity-verlet"), [checks.step_defect])
    assert both.sees.stiffness is not None
    assert lonely.sees.stiffness is not None
    assert 300 < both.sees.stiffness / lonely.sees.stiffness < 3e4


def test_a_friction_that_the_scene_does_not_have_is_the_cause(tmp_path: Path) -> None:
    """Its verdicts failed without one, as the scheme is the one that was asked for."""
    scene = scenefile.load_scene("spring-uneven")
    m, k, h, q, p = 3.7, 2.9, scene.step, 0.3, 0.7
    rows = []
    for i in range(scene.steps + 1):
        rows.append((i * h, q, p))
        p -= h / 2 * k * q
        q += h * p / m
        p = (p - h / 2 * k * q) * (1 - 2e-4)
    np.savetxt(tmp_path / "a.csv", rows, fmt="%.17g", delimiter=",", header="t,q,p", comments="")
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme="velocity-verlet").verdicts
    said = checks.cause_of(found)
    assert said.startswith("Velocity Verlet with friction")
    assert said.endswith("its c/m is 0.002, and the scene has none")
