"""The command line: what it prints, what it writes, and its exit status."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import springcheck
from springcheck import checks, engines, schemes, store
from springcheck.cli import main
from springcheck.physics import scenefile as scenes
from springcheck.studies.run import judging

pytestmark = pytest.mark.usefixtures("own_folder")

OWN = ["--method", "own:*euler"]


def document(capsys: pytest.CaptureFixture[str]) -> dict:
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


def test_the_main_job_runs_every_engine_and_passes(
    capsys: pytest.CaptureFixture[str], need: Callable[[str], None]
) -> None:
    for label in ("openmm:verlet", "ase:velocity-verlet", "sundials:adams"):
        need(label)
    assert main(["run", "spring", "--json"]) == 0
    found = document(capsys)
    assert found["scene"] == "spring"
    assert Path(found["store"]).is_file()
    methods = {run["method"]: run for run in found["runs"]}
    assert {
        "own:euler", "own:semi-implicit-euler", "own:implicit-euler", "openmm:verlet", "openmm:leapfrog",
        "openmm:euler", "openmm:semi-implicit-euler", "ase:velocity-verlet", "sundials:adams", "sundials:bdf",
    } <= set(methods)  # fmt: skip
    assert set(methods["own:euler"]) >= {
        "method", "scheme", "outcome", "max_error", "error_below", "energy_drift",
        "start_seconds", "run_seconds", "force_calls",
    }  # fmt: skip
    # with the blog's numbers explicit Euler multiplies the energy by 1.01**200 = 7.316
    assert methods["own:euler"]["energy_drift"] == pytest.approx(1.01**200 - 1, rel=1e-12)
    labels = found["comparison"]["labels"]
    difference = np.array(found["comparison"]["max_difference"])
    assert labels[0] == "exact"
    assert difference.shape == (len(labels), len(labels))
    assert np.array_equal(difference, difference.T)
    where = {label: i for i, label in enumerate(labels)}
    assert difference[where["openmm:leapfrog"], where["own:semi-implicit-euler"]] <= 1e-13
    assert difference[where["openmm:verlet"], where["ase:velocity-verlet"]] <= 1e-13
    assert difference[where["sundials:adams"], where["exact"]] <= 1e-9
    verdicts = found["verdicts"]
    assert {"method", "check", "value", "bound", "unit", "passed", "why"} <= set(verdicts[0])
    assert all(v["passed"] is not False for v in verdicts)
    assert sum(v["passed"] is True for v in verdicts) > 60


def test_the_text_names_methods_motions_and_the_store(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "spring", *OWN, "-o", "some.h5"]) == 0
    text = capsys.readouterr().out
    for word in ("own:euler", "own:semi-implicit-euler", "complete", "0 failed", "plot some.h5"):
        assert word in text
    assert max(len(line) for line in text.splitlines()) <= 80


def test_a_scene_of_ones_own_runs_by_its_path(capsys: pytest.CaptureFixture[str]) -> None:
    text = (scenes.folder() / "spring-uneven.toml").read_text()
    Path("mine.toml").write_text(text.replace("3.7", "4.9"))
    assert main(["run", "mine.toml", *OWN, "--json"]) == 0
    assert document(capsys)["scene"] == "mine"
    assert Path("mine.h5").is_file()


def test_what_is_stored_is_what_the_library_gives() -> None:
    assert main(["run", "spring-uneven", *OWN, "--quiet"]) == 0
    scene = springcheck.load_scene("spring-uneven")
    stored = springcheck.read("spring-uneven.h5")
    for label, run in stored.items():
        again = springcheck.simulate(scene, label)
        assert np.array_equal(run.t, again.t)
        assert np.array_equal(run.q, again.q)
        assert np.array_equal(run.p, again.p)
        assert np.array_equal(run.energy, again.energy)


def test_inspect_shows_the_store_and_the_numbers_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "spring", *OWN, "--quiet"])
    assert main(["inspect", "spring.h5", "--trajectory", "own:euler", "--rows", "3", "--verdicts"]) == 0
    text = capsys.readouterr().out
    for word in ("own:implicit-euler", "step-defect", "201", "one product, no accumulation"):
        assert word in " ".join(text.split())
    assert main(["inspect", "spring.h5", "--trajectory", "own:euler", "--rows", "201", "--json"]) == 0
    found = document(capsys)
    assert found["trajectory"]["q"] == springcheck.read("spring.h5")["own:euler"].q.tolist()
    assert [run["label"] for run in found["trajectories"]] == [
        "own:euler", "own:semi-implicit-euler", "own:implicit-euler",
    ]  # fmt: skip


PICTURES = ("phase-portrait", "position", "energy", "error")


def test_plot_draws_four_pictures_twice(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "spring", *OWN, "--quiet"])
    assert main(["plot", "spring.h5", "-o", "pictures"]) == 0
    written = {Path(line).name for line in capsys.readouterr().out.splitlines()}
    assert written == {f"{a}.{b}" for a in PICTURES for b in ("png", "svg")}
    assert all((Path("pictures") / name).stat().st_size > 10_000 for name in written)
    assert main(["plot", "spring.h5", "--trajectory", "own:euler", "-o", "one"]) == 0
    assert {path.name for path in Path("one").iterdir()} >= {"states.png", "states.svg"}
    assert "spring.h5, own:euler: 201 frames" in Path("one/states.svg").read_text()
    for more in (
        ["--step", "0.1"],
        ["--trajectory", "own:nothing"],
    ):
        assert main(["plot", "spring.h5", *more]) == 2


def test_list_has_a_page_for_each_kind(capsys: pytest.CaptureFixture[str]) -> None:
    names = {
        "scenes": scenes.names(),
        "methods": ("own:euler", "openmm:verlet", "sundials:bdf"),
        "checks": [check.name for check in (*checks.ALL, *checks.RANDOM)],
        "terms": ("spring", "wall-spring"),
        "schemes": ("velocity-verlet", "rk4"),
    }
    assert main(["list"]) == 0
    overview = capsys.readouterr().out
    assert len(overview.splitlines()) <= 24
    for kind, known in names.items():
        assert f"springcheck list {kind}" in overview
        assert main(["list", kind]) == 0
        page = capsys.readouterr().out
        assert max(map(len, page.splitlines())) <= 80
        assert set(known) <= set(page.split())
    assert main(["list", "--json"]) == 0
    assert {scene["name"] for scene in document(capsys)["scenes"]} == set(scenes.names())


@pytest.mark.parametrize("scene", ["pendulum", "kepler"])
def test_identify_with_a_scene_names_the_scheme_of_any_force(scene: str) -> None:
    springcheck.simulate(springcheck.load_scene(scene), "own:rk4").save(Path("run.csv"))
    done = [sys.executable, "-m", "springcheck", "identify", "run.csv", "--scene", scene]
    ran = subprocess.run(done, capture_output=True, text=True, check=False)
    assert ran.stdout.startswith("run.csv: rk4"), ran.stderr


def test_cite_names_what_a_store_used(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "spring", "--method", "own:euler", "--method", "openmm:verlet", "--quiet"])
    assert main(["cite", "spring.h5"]) == 0
    said = capsys.readouterr().out
    assert "@software{springcheck," in said.splitlines()
    assert engines.engine("openmm").reference in said
    assert schemes.scheme("velocity-verlet").source in said
    assert engines.engine("ase").reference not in said
    assert main(["cite"]) == 0
    assert engines.engine("ase").reference in capsys.readouterr().out


def test_check_and_export(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "spring", *OWN, "--quiet"])
    assert main(["check", "spring.h5"]) == 0
    assert main(["export", "spring.h5", "own:euler", "euler.h5md"]) == 0
    assert Path("euler.h5md").stat().st_size > 1000
    damaged = bytearray(Path("spring.h5").read_bytes())
    states = springcheck.read("spring.h5")["own:euler"].q.tobytes()
    damaged[damaged.index(states) + 100] ^= 1
    Path("damaged.h5").write_bytes(damaged)
    capsys.readouterr()
    assert main(["check", "damaged.h5"]) == 1
    assert capsys.readouterr().out.strip()


def test_a_failed_verdict_is_exit_status_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from springcheck.engines.own import simulation

    start = simulation.start

    def wrong(scene, method, label, step):  # type: ignore[no-untyped-def]
        return start(scene, method, label, step * (1 + 1e-12))

    monkeypatch.setattr(simulation, "start", wrong)
    assert main(["run", "spring-uneven", "--method", "own:semi-implicit-euler"]) == 1
    text = capsys.readouterr().out
    assert "FAILED own:semi-implicit-euler step-defect" in text


def test_the_command_works_as_a_program(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "springcheck", "run", "spring", *OWN],
        capture_output=True, text=True, check=False, cwd=tmp_path, env=os.environ | {"NO_COLOR": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "own:implicit-euler" in done.stdout
    assert done.stderr == ""


def test_a_stored_run_is_repeated_bit_for_bit(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    main(["run", "spring-uneven", *OWN, "--quiet"])
    assert main(["run", "--from", "spring-uneven.h5"]) == 0
    assert capsys.readouterr().out.count("equal bit for bit") == 3
    from springcheck.engines.own import simulation

    start = simulation.start

    def wrong(scene, method, label, step):  # type: ignore[no-untyped-def]
        return start(scene, method, label, step * (1 + 1e-14))

    monkeypatch.setattr(simulation, "start", wrong)
    assert main(["run", "--from", "spring-uneven.h5", "--method", "own:euler", "--json"]) == 1
    (repeat,) = document(capsys)["repeats"]
    assert repeat["equal"] is False
    assert 1e-16 < repeat["difference"] < 1e-11
    assert {path.name for path in Path().iterdir()} == {"spring-uneven.h5"}


def test_a_store_in_a_folder_that_is_read_only_is_run_again(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["run", "spring", "--method", "own:euler", "--quiet"]) == 0
    made: list[str | None] = []
    folder = tempfile.mkdtemp

    def noted(suffix: str | None, prefix: str | None, dir: Path | None) -> str:
        made.append(dir and str(dir))
        return folder(suffix, prefix)

    monkeypatch.setattr(tempfile, "mkdtemp", noted)
    assert main(["run", "--from", "spring.h5"]) == 0
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert main(["run", "--from", "spring.h5"]) == 0
    assert made == [str(Path.cwd()), None]
    assert capsys.readouterr().out == "own:euler: equal bit for bit\n" * 2


def test_force_never_overwrites_a_scene(capsys: pytest.CaptureFixture[str]) -> None:
    text = (scenes.folder() / "spring.toml").read_text()
    Path("mine.toml").write_text(text)
    assert main(["run", "mine.toml", *OWN, "--force", "-o", "mine.toml"]) == 2
    assert "is a scene's" in capsys.readouterr().err
    assert Path("mine.toml").read_text() == text


def test_a_scene_file_may_begin_with_a_byte_order_mark_and_end_its_lines_as_on_windows() -> None:
    text = (scenes.folder() / "spring.toml").read_text()
    Path("marked.toml").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert main(["run", "marked.toml", *OWN, "--quiet"]) == 0
    assert main(["run", "--from", "marked.h5"]) == 0


def test_an_unfinished_store_can_be_looked_at(capsys: pytest.CaptureFixture[str]) -> None:
    scene = springcheck.load_scene("spring-uneven")
    run = springcheck.simulate(scene, "own:euler")
    with store.open_new("some.h5", "some command") as journal, journal.draft("own:euler", scene) as draft:
        draft.append(run.t, run.q, run.p, run.energy)
        draft.finish(store.attributes(run))
    assert main(["inspect", "some.h5"]) == 0
    text = capsys.readouterr().out
    assert "unfinished" in text
    assert "own:euler" in text


def test_a_store_of_a_study_has_nothing_to_run_again(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stability", "spring", "--method", "own:euler", "--quiet", "-o", "study.h5"]) == 0
    assert main(["run", "--from", "study.h5"]) == 2
    assert "no trajectory to run again" in capsys.readouterr().err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_output_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "springcheck", "list"],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("springcheck: ")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("step = 0.1", "step = 1e300"),
        ("mass = 1.0", "mass = 1e-308"),
        ("mass = 1.0", "mass = 9e307"),
        ("momentum = 1.0", "momentum = 0.0"),
        ("stiffness = 1.0", "stiffness = 1e300"),
    ],
)
def test_extreme_numbers_make_a_report_and_no_warnings(
    old: str, new: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (scenes.folder() / "spring.toml").read_text()
    assert old in text
    Path("extreme.toml").write_text(text.replace(old, new))
    # a warning is an error here
    assert main(["run", "extreme.toml", "--json"]) in (0, 1, 2)
    captured = capsys.readouterr()
    assert captured.err == ""
    assert json.loads(captured.out)["runs"]


# beyond four pieces of 16 steps: four of 4 steps, and the last, each with the frame before it
@pytest.mark.parametrize(("steps", "judged"), [(64, 65), (65, 22), (1000, 25)])
def test_of_a_long_run_some_pieces_are_judged_and_it_is_said(
    steps: int, judged: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(judging, "PIECE_NUMBERS", 16)
    monkeypatch.setattr(judging, "LONG_PIECE", 4)
    monkeypatch.setattr(judging, "MOST_PIECES", 4)
    text = (scenes.folder() / "spring-uneven.toml").read_text().replace("steps = 200", f"steps = {steps}")
    Path("long.toml").write_text(text)
    assert main(["run", "long.toml", "--method", "own:euler", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["judged_frames"] == judged
