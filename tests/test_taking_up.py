"""A study that was killed or interrupted is taken up by the same command: what was finished is not lost."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import springcheck
from springcheck import cli, engines, interrupts, store
from springcheck.engines.contract import Label
from springcheck.errors import StoreError
from springcheck.physics import scenefile as scenes
from springcheck.studies import keeper
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.precision import measure as precision
from springcheck.studies.precision.points import POINTS
from springcheck.studies.run import measure as session
from springcheck.studies.stability import measure as stability
from springcheck.studies.stability.result import Limit
from stores import raising

pytestmark = pytest.mark.usefixtures("steady_clock")

OWN = ["own:euler", "own:implicit-euler", "own:semi-implicit-euler"]


def killed(arguments: Sequence[str], path: Path, tables: int) -> dict[str, store.Table]:
    """Start a command, kill it (SIGKILL) once so many tables are there; what it had finished."""
    environment = os.environ | {"PYTHONPATH": str(Path(springcheck.__file__).parents[1])}
    parts = path.with_name(path.name + ".parts")
    with subprocess.Popen(
        [sys.executable, "-m", "springcheck", *arguments, "-o", str(path), "--quiet"], env=environment
    ) as process:
        while process.poll() is None and len(list(parts.glob("table-*.h5"))) < tables:
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL, "it ended before it could be killed"
    return dict(store.tables_of(path))


def equal(one: store.Table, other: store.Table) -> bool:
    """Bit for bit."""
    return one.columns.keys() == other.columns.keys() and all(
        np.array_equal(
            a := np.asarray(one.columns[name]), np.asarray(other.columns[name]), a.dtype.kind == "f"
        )
        for name in one.columns
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ["stability", "overdamped", *(x for name in OWN for x in ("--method", name))],
        ["extremes", "--quick", *(x for name in OWN for x in ("--method", name))],
    ],
    ids=lambda arguments: str(arguments[0]),
)
def test_a_killed_study_is_taken_up_and_nothing_of_it_measured_again(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "study.h5"
    kept = killed(arguments, path, 1)
    assert cli.main([*arguments, "-o", str(path)]) == 0
    assert f"  {len(kept)} " in capsys.readouterr().out
    whole = dict(store.tables_of(path))
    assert 0 < len(kept) < len(whole)
    for name, table in kept.items():
        assert equal(table, whole[name]), name
    assert store.check(path) == []
    assert store.summary(path).complete
    assert cli.main([*arguments, "-o", str(path)]) == 2
    assert "--force" in capsys.readouterr().err


def test_a_killed_study_of_precision_keeps_its_points(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "study.h5"
    arguments = [
        "precision",
        "spring-uneven",
        *(x for name in OWN for x in ("--method", name)),
    ]
    begun = killed([*arguments, "--budget", "600"], path, 3)
    kept = {name: POINTS.found(table) for name, table in begun.items()}
    # what the killed call took counts, on a slow machine more
    budget = 3 + sum(point.spent_seconds for points in kept.values() for point in points)
    assert cli.main([*arguments, "-o", str(path), "--json", "--budget", f"{budget:.0f}"]) == 0
    whole = {name: POINTS.found(table) for name, table in store.tables_of(path).items() if ":" in name}
    assert sum(map(len, kept.values())) >= 3
    for name, points in kept.items():
        assert whole[name][: len(points)] == points
        assert len(whole[name]) > len(points)
    assert len(json.loads(capsys.readouterr().out)["points"]) == sum(map(len, whole.values()))
    assert store.summary(path).complete


def test_points_are_read_back_as_they_were() -> None:
    scene = scenes.load_scene("anharmonic")
    found = precision.record(scene, [engines.parse(name) for name in OWN[::2]], budget=0.4)
    assert len(found.sweeps) == len(OWN[::2])
    for method in found.sweeps:
        points = method.points
        # how many there are is a matter of the machine
        assert len(points) > 1
        assert POINTS.found(POINTS.table(method.method, points)) == list(points)


@pytest.mark.usefixtures("steady_clock")
def test_an_interrupted_study_of_precision_goes_on(tmp_path: Path) -> None:
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "study.h5"
    labels = list(map(engines.parse, OWN))
    with pytest.raises(KeyboardInterrupt):
        precision.record(scene, labels, path, budget=2.0, progress=raising(3 + 12))
    assert not path.exists()
    assert not store.summary(path).complete
    done = [point for table in store.tables_of(path).values() for point in POINTS.found(table)]
    with pytest.raises(StoreError, match=r"another command, or of other versions"):
        precision.record(scene, labels[:2], path, budget=2.0)
    second = precision.record(scene, labels, path, budget=2.0)
    assert second.resumed == len(done) > 0
    assert set(done) < set(second.points)
    assert store.summary(path).complete
    assert store.check(path) == []


def test_a_study_whose_budget_was_spent_when_it_was_killed_measures_nothing_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "study.h5"
    labels = [engines.parse("own:euler")]

    def full(*_: object, **__: object) -> None:
        raise StoreError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(store.Journal, "commit", full)
        with pytest.raises(StoreError, match="full"):
            precision.record(scene, labels, path, budget=0.5)
    (table,) = [t for name, t in store.tables_of(path).items() if name == "precision/own:euler"]
    before = POINTS.found(table)
    found = precision.record(scene, labels, path, budget=0.5)
    assert [p for p in found.points if p.complete] == [p for p in before if p.complete]
    assert found.seconds >= sum(point.spent_seconds for point in before)


def test_an_interrupted_study_says_that_the_same_command_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    measured: list[Label] = []
    measure = stability.measure

    def interrupted(label: Label) -> Limit:
        if len(measured) == 2:
            raise KeyboardInterrupt
        measured.append(label)
        return measure(label)

    methods = [x for name in OWN for x in ("--method", name)]
    arguments = ["stability", "spring-uneven", *methods, "-o", str(tmp_path / "study.h5")]
    with monkeypatch.context() as patch:
        patch.setattr(stability, "measure", interrupted)
        assert cli.main(arguments) == interrupts.STATUS
    assert capsys.readouterr().err == (
        "springcheck: interrupted; finished work is saved; the same command continues\n"
    )
    for command in ("plot", "report"):
        assert cli.main([command, str(tmp_path / "study.h5")]) == 2
        assert "yet: give the command that writes it again, it goes on" in capsys.readouterr().err
    again: list[Label] = []
    monkeypatch.setattr(stability, "measure", lambda label: (again.append(label), measure(label))[1])
    assert cli.main(arguments) == 0
    assert len(measured) == 2
    assert again
    assert not set(map(str, measured)) & set(map(str, again))


def test_work_of_another_version_or_machine_is_not_taken_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "study.h5"
    with pytest.raises(KeyboardInterrupt):
        extremes.record(path, OWN, quick=True, progress=raising(2))
    machine = store.machine()
    for what in ("springcheck", "processor", "numpy"):
        other = machine | {what: "another"}
        with monkeypatch.context() as patch:
            patch.setattr(store, "machine", lambda other=other: other)
            with pytest.raises(StoreError, match="other versions"):
                extremes.record(path, OWN, quick=True)
    with pytest.raises(StoreError, match="another command"):
        extremes.record(path, OWN)
    assert extremes.record(path, OWN, quick=True).resumed == 1


def test_runs_of_another_version_are_not_taken_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "run.h5"
    started: list[str] = []

    def interrupting(done: float, whole: float, what: str = "") -> None:
        if what not in started:
            started.append(what)
        if len(started) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        session.run(scene, path, methods=OWN, progress=interrupting)
    machine = store.machine()
    with monkeypatch.context() as patch:
        patch.setattr(store, "machine", lambda: machine | {"springcheck": "another"})
        with pytest.raises(StoreError, match="other versions"):
            session.run(scene, path, methods=OWN)
    assert session.run(scene, path, methods=OWN).resumed == (started[0],)


def test_every_version_that_a_study_runs_on_is_in_its_command() -> None:
    labels = [engines.parse(name) for name in ("own:euler", "sundials:bdf")]
    text = keeper.command("stability", labels, "a scene")
    assert text.splitlines()[0] == "stability"
    for line in ("own:euler", "sundials:bdf", f"numpy {np.__version__}", "a scene"):
        assert line in text.splitlines()
    if engines.absence("sundials") is None:
        assert f"scikit-sundae {engines.installed_version('sundials')}" in text.splitlines()
    assert "openmm" not in text


def test_a_study_of_stability_can_be_forced_to_start_over(tmp_path: Path) -> None:
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "study.h5"
    with pytest.raises(KeyboardInterrupt):
        stability.record(scene, path, OWN, progress=raising(3))
    assert stability.record(scene, path, OWN, force=True).resumed == 0


def test_a_forced_study_goes_on_with_what_it_has_finished_itself(tmp_path: Path) -> None:
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "study.h5"
    old = stability.record(scene, path, ["own:euler"])
    before = path.read_bytes()
    for piece in (2, 3):
        with pytest.raises(KeyboardInterrupt):
            stability.record(scene, path, OWN, force=True, progress=raising(piece))
        assert path.read_bytes() == before
    whole = stability.record(scene, path, OWN, force=True)
    assert whole.resumed >= 2
    assert len(whole.limits) > len(old.limits)
    # finished: the next one starts over
    assert stability.record(scene, path, OWN, force=True).resumed == 0
