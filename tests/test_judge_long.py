"""Long runs: every step is judged where no closed form tells what happened between pieces, or none passes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clean
import textbook as steppers
from springcheck import checks, schemes
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic
from springcheck.physics.trajectory import Outcome
from springcheck.studies import keeper
from springcheck.studies.run import judging
from springcheck.studies.run.result import Report

Change = Callable[[int, Floats, Floats, Floats, Floats], tuple[Floats, Floats]]


def wells(steps: int) -> Scene:
    """64 Duffing oscillators."""
    rng, each = np.random.default_rng(3), np.ones(64)
    terms = (clean.walls(each, 0 * each), Quartic(i=np.arange(64), b=each, at=0 * each))
    start = rng.normal(size=64), rng.normal(size=64)
    made = clean.scene(10 ** rng.uniform(-0.3, 0.3, 64), terms, *start, step=0.05, steps=steps)
    return replace(made, quantities=("q", "p"))


def springs(steps: int) -> Scene:
    return replace(wells(steps), terms=(clean.walls(np.ones(64), np.zeros(64)),))


FAULTS: dict[str, Change] = {
    "right": lambda i, q0, p0, q, p: (q, p),
    "stands still": lambda i, q0, p0, q, p: (q0, p0) if 70 < i < 310 else (q, p),
    "one momentum trebled": lambda i, q0, p0, q, p: (
        q,
        p * np.where((np.arange(64) == 5) & (i == 200), 3, 1),
    ),
}


def judged(tmp_path: Path, scene: Scene, change: Change) -> Report:
    """The report on a run of an engine to which this happens after each step."""
    scheme = schemes.SCHEMES["velocity-verlet"]
    right = steppers.textbook(scene, scheme)
    run = steppers.record(scene, scheme, lambda i, q, p: change(i, q, p, *right(i, q, p)), label="own:plain")
    path = tmp_path / "a.h5"
    with keeper.open_new(path, "test", force=True) as journal:
        with journal.draft(run.label, scene) as draft:
            draft.append(run.t, run.q, run.p, None)
            draft.finish(keeper.attributes(run))
        return judging.judge(scene, path, journal.finished(), [])


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces so small that 400 steps of 64 particles are long."""
    monkeypatch.setattr(judging, "PIECE_NUMBERS", 64 * 16)
    monkeypatch.setattr(judging, "LONG_PIECE", 64 * 4)


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("fault", FAULTS)
def test_every_step_of_a_long_anharmonic_run_is_judged(tmp_path: Path, fault: str) -> None:
    report = judged(tmp_path, wells(400), FAULTS[fault])
    assert report.judged_frames == 401
    assert report.status == (fault != "right")
    # steps 72 to 310 stand still, 16 frames a piece: the frames off were counted in the first of them alone
    (step,) = (v for v in report.verdicts if v.check == "step-defect")
    assert ("; of 25 pieces of the run 16 fail" in step.why) == (fault == "stands still"), step.why
    assert ("pieces of the run" in step.why) == (fault == "stands still")


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_closed_form_tells_what_happened_between_the_pieces_of_springs(tmp_path: Path, fault: str) -> None:
    report = judged(tmp_path, springs(400), FAULTS[fault])
    assert report.judged_frames < 100
    assert report.status == (fault != "right")
    said = "\n".join(str(line) for line in report.lines())
    assert "error, energy and same motion are of these" in said


@pytest.mark.usefixtures("small")
def test_pieces_alone_pass_nothing_where_no_closed_form_joins_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(judging, "MOST_NUMBERS", 64 * 100)
    report = judged(tmp_path, wells(400), FAULTS["right"])
    assert report.judged_frames < 100
    assert report.status == 2
    assert report.not_judged == ("own:plain",)
    (why,) = {v.why for v in report.verdicts if v.check == "step-defect"}
    assert "no formula covers the steps between them" in why


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("steps", [187, 188, 396])
def test_a_run_that_ends_early_takes_nothing_from_the_errors_of_others(tmp_path: Path, steps: int) -> None:
    # its last piece begins between those of the other, and may be as long
    scene, runs = springs(400), {}
    for name, end in (("semi-implicit-euler", steps), ("velocity-verlet", 400)):
        scheme = schemes.SCHEMES[name]
        run = steppers.record(scene, scheme, steppers.textbook(scene, scheme), label=f"own:{name}")
        how = "stopped" if end < 400 else "complete"
        runs[run.label] = replace(run.at(slice(end + 1)), outcome=Outcome(status=how, step=end))
    with keeper.open_new(tmp_path / "a.h5", "test") as journal:
        for run in runs.values():
            journal.save(run, scene)
        sources = journal.finished()
        both = judging.judge(scene, tmp_path / "a.h5", sources, [])
        alone = [judging.judge(scene, tmp_path / "a.h5", {name: sources[name]}, []) for name in runs]
    assert [run.max_error for run in both.runs] == [one.runs[0].max_error for one in alone]
    assert both.comparison.labels == ("exact", *runs)
    differences = both.comparison.max_difference
    assert differences[0, 2] == alone[1].comparison.max_difference[0, 1]
    assert np.isnan(differences[1, [0, 2]]).all()


def test_a_closed_form_that_forgets_does_not_join_pieces() -> None:
    def bridges(scene: Scene, name: str) -> bool:
        scheme = schemes.SCHEMES[name]
        run = steppers.record(replace(scene, steps=2), scheme, steppers.textbook(scene, scheme))
        return checks.bridges(checks.Case(trajectory=run, scene=scene))

    assert bridges(springs(10**6), "velocity-verlet")
    assert bridges(springs(10**6), "explicit-euler")
    assert bridges(springs(10**4), "rk4")
    assert not bridges(springs(10**9), "rk4")
    assert not bridges(springs(10**4), "implicit-euler")
    assert not bridges(wells(10**4), "velocity-verlet")
