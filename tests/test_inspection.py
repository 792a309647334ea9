"""A stored study is shown and drawn as the fresh one is: from the file alone, to the last bit."""

from __future__ import annotations

import errno
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import springcheck
from springcheck import engines, store
from springcheck.cli import main, output
from springcheck.errors import StoreError
from springcheck.figures import frames, render
from springcheck.figures.frames import Frame
from springcheck.figures.motion import true_motion
from springcheck.figures.style import save
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.studies.extremes import STUDY as EXTREMES
from springcheck.studies.extremes import grid
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.precision import STUDY as PRECISION
from springcheck.studies.precision import measure as precision
from springcheck.studies.run import measure as session
from springcheck.studies.run.drawable import drawable
from springcheck.studies.run.page import of_runs
from springcheck.studies.stability import STUDY as STABILITY
from springcheck.studies.stability import measure as stability

Need = Callable[[str], None]


def same(a: Any, b: Any) -> bool:
    """Equal bit for bit, NaN equal to NaN."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    both_nan = isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b)
    return a == b or both_nan


def assert_same_rows(fresh: tuple[Any, ...], kept: tuple[Any, ...]) -> None:
    assert len(fresh) == len(kept)
    for one, other in zip(fresh, kept, strict=True):
        for field in fields(one):
            assert same(getattr(one, field.name), getattr(other, field.name)), (one.method, field.name)


def test_a_study_of_stability_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "study.h5"
    fresh = stability.record(scene, path, ["own:*euler"])
    kept = STABILITY.stored(path)
    assert_same_rows(fresh.limits, kept.limits)
    assert kept.left_out == fresh.left_out
    assert kept.document() == fresh.document()
    assert store.check(path) == []


def test_what_a_stored_study_of_stability_fails_is_still_seen(tmp_path: Path) -> None:
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "study.h5"
    right = stability.measure(engines.parse("own:semi-implicit-euler"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stability, "measure", lambda _: replace(right, limit=1.01 * right.limit))
        wrong = stability.record(scene, path, ["own:semi-implicit-euler"])
    assert STABILITY.stored(path).failures == wrong.failures != []


def test_the_atlas_is_read_back_as_it_was(tmp_path: Path) -> None:
    fresh = extremes.record(tmp_path / "extremes.h5", ["own:euler"], quick=True)
    kept = EXTREMES.stored(tmp_path / "extremes.h5")
    assert kept.document() == fresh.document()
    assert kept.counts() == fresh.counts()
    assert kept.windows == fresh.windows


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for the stores of `stores`, which are measured once."""
    return tmp_path_factory.mktemp("stores")


@pytest.fixture
def stores(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, steady_clock: object) -> Path:
    """A folder with a store of every study."""
    if not any(made.iterdir()):
        monkeypatch.chdir(made)
        main(["stability", "overdamped", "--method", "own:implicit-euler", "--quiet", "-o", "stability.h5"])
        main(["extremes", "--quick", "--method", "own:implicit-euler", "--quiet", "-o", "extremes.h5"])
        scene = scenes.load_scene("spring-uneven")
        precision.record(scene, [engines.parse("own:implicit-euler")], "precision.h5", budget=0.5)
    monkeypatch.chdir(tmp_path)
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_plot_and_inspect_serve_every_study(stores: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pictures = {
        "stability": {"stability"},
        "extremes": {"extremes"},
        "precision": {"precision"},
    }
    words = {
        "stability": ("limit of h w", "own:implicit-euler", "always stable"),
        "extremes": ("extreme cases", "Right for forces from", "none silently wrong"),
        "precision": ("error against run time", "own:implicit-euler", "of the methods measured"),
    }
    for name, expected in pictures.items():
        capsys.readouterr()
        assert main(["plot", f"{name}.h5", "-o", "pictures"]) == 0
        written = {Path(line) for line in capsys.readouterr().out.splitlines()}
        assert {path.name for path in written} == {
            f"{one}.{end}" for one in expected for end in ("png", "svg")
        }
        assert all((stores / path).stat().st_size > 10_000 for path in written)
        assert main(["inspect", f"{name}.h5"]) == 0
        text = " ".join(capsys.readouterr().out.split())
        assert all(word in text for word in words[name]), text
        assert "trajectory frames" not in text
        assert main(["inspect", f"{name}.h5", "--json"]) == 0
        shown = json.loads(capsys.readouterr().out)
        kept = json.loads(store.document(f"{name}.h5", name))
        # rows are in tables, and read from there
        tables, _, _ = (kept.pop(part) for part in ("tables", "fields", "kind"))
        assert {field: bool(rows) for field, rows in tables.items()}.items() <= {
            (field, True) for field in ("cells", "limits", "points")
        }
        assert kept.items() <= shown["studies"][name].items()


def test_a_stored_study_is_drawn_without_any_engine(stores: Path) -> None:
    code = (
        "import sys; from springcheck.cli import main; from springcheck.figures import style\n"
        "style._drawn = lambda figure: (b'', b'')\n"
        "for path in sys.argv[1:]:\n"
        "    assert main(['plot', path, '-o', path + '-pictures', '--quiet']) == 0\n"
        "    assert main(['inspect', path, '--json']) == 0\n"
        "print(*{'openmm', 'ase', 'sksundae', 'numba'} & set(sys.modules), file=sys.stderr)"
    )
    paths = [str(path) for path in stores.glob("*.h5")]
    assert len(paths) == 3
    home = str(Path(springcheck.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", code, *paths], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": home},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr.strip() == ""


def test_a_store_that_lacks_a_part_of_its_study_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = scenes.load_scene("spring-uneven")
    for name, text, why in (
        (
            "stability",
            '{"kind": "Stability", "fields": {}, "tables": {"limits": ["stability/limits/own:euler"]}}',
            "lacks 'stability/limits/own:eul",
        ),
        ("extremes", '{"kind": "Atlas", "tables": []}', "lacks 'fields'"),
        ("precision", "{", "is no JSON"),
    ):
        path = tmp_path / f"{name}.h5"
        with store.open_new(path, name) as journal:
            journal.commit(scene, documents={name: text})
        for command in (["plot", str(path), "-o", str(tmp_path)], ["inspect", str(path)]):
            assert main(command) == 2
            said = capsys.readouterr().err
            assert why in said, said
            assert said.count("\n") == 1
    with pytest.raises(StoreError, match="holds no document 'extremes'"):
        EXTREMES.stored(tmp_path / "stability.h5")


def test_a_study_with_nothing_to_draw_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "special.h5"
    few = [spec for spec in grid.specs(quick=True) if spec.block == "special"][:20]
    monkeypatch.setattr(grid, "specs", lambda *, quick=False: few)
    extremes.record(path, ["own:euler"], quick=True)
    assert main(["plot", str(path), "-o", str(tmp_path)]) == 2
    assert "can be drawn" in capsys.readouterr().err


def long_scene(steps: int, step: float) -> str:
    return f"""
title = "A long run"
[[particle]]
mass = 3.7
position = 0.3
momentum = 0.7
[[spring]]
ends = ["wall", 0]
stiffness = 2.9
[time]
step = {step}
steps = {steps}
"""


@pytest.mark.parametrize(("step", "end"), [(0.2, True), (0.002, False)])
def test_a_long_run_is_drawn_where_its_motion_can_be_followed(tmp_path: Path, step: float, end: bool) -> None:
    scene = scenes.parse(long_scene(20_000, step), name="long")
    path = tmp_path / "long.h5"
    session.run(scene, path, methods=["own:semi-implicit-euler"])
    found = drawable(path)
    whole = store.read_one(path, "own:semi-implicit-euler")
    run, followed = (x["own:semi-implicit-euler"] for x in (found.runs, found.followed))
    np.testing.assert_array_equal(run.q, whole.q[::5])
    np.testing.assert_array_equal(followed.q, whole.q[-500:] if end else whole.q[::5])
    np.testing.assert_array_equal(followed.t, whole.t[-500:] if end else whole.t[::5])
    assert any("the last 500 frames" in note for note in found.notes) == end
    truth = true_motion(scene, [followed])
    assert truth is not None
    t, q, _ = truth
    assert (t[0], t[-1]) == pytest.approx((followed.t[0], followed.t[-1]))
    # 1,500 parts of one length, and closer ones at the start, where a stiff motion may decay
    assert 1400 < len(t) <= 1501 + 200
    np.testing.assert_allclose(q, exact.true_motion(scene, t / step, step)[0], atol=1e-12)
    assert of_runs(scene, found.runs, found.followed)


def test_a_part_of_a_run_is_called_one_and_errors_are_those_of_all_of_it(tmp_path: Path) -> None:
    scene = springcheck.spring(m=2.7, k=0.3, q=-1.3, p=0.4, step=0.37, steps=80_000)
    path = tmp_path / "long.h5"
    session.run(scene, path, methods=["own:velocity-verlet"])
    # 54 steps are a whole turn and 3.4 steps: between the frames drawn a slow wave seems to be
    found = drawable(path, 1500)
    assert found.followed is not found.runs
    phase, position, _, error = of_runs(scene, found.runs, found.followed)
    # its phase, (h w)**3 / 24 a step, is half a turn behind in the middle and nearly a whole one at the end
    for bank, most in ((phase, "200 %"), (position, "100 %"), (error, "200 %")):
        assert f"{most} (velocity Verlet)" in f"{bank.heading} {bank.foot}"
    for bank in (phase, position):
        assert "from t = 29415.4 on" in f"{bank.heading} {bank.foot}"


def test_a_run_that_ended_early_has_no_part_in_the_end_of_the_others(tmp_path: Path) -> None:
    """Its own last frames stood beside theirs, from other times: as "the first and the last 6 periods"."""
    scene = scenes.parse(long_scene(60_000, 0.9), name="long")
    session.run(scene, tmp_path / "long.h5", methods=["own:velocity-verlet", "own:euler"])
    found = drawable(tmp_path / "long.h5")
    assert len(found.runs["own:euler"].t) > 1
    assert [*found.followed] == ["own:velocity-verlet"]
    assert any("without own:euler, which ended before" in note for note in found.notes)
    position = of_runs(scene, found.runs, found.followed)[1]
    first = (60_000 - 499) * 0.9
    for chart in position.charts:
        curves = [np.asarray(one.x) for one in chart.curves if one.name == "own:velocity-verlet"]
        assert len(curves[0]) > 40
        assert all(first - 1e-6 <= np.min(x) for x in curves)


def test_what_has_left_a_picture_before_its_first_frame_is_said_so(tmp_path: Path) -> None:
    scene = springcheck.spring(m=2.7, k=0.3, q=-1.3, p=0.4, step=0.37, steps=4000)
    path = tmp_path / "spiral.h5"
    session.run(scene, path, methods=["own:velocity-verlet", "own:euler"])
    found = drawable(path, 1000)
    phase = of_runs(scene, found.runs, found.followed)[0].charts[0]
    assert phase.note == "outside: explicit Euler before 1.3e+03"


def test_what_explodes_leaves_the_picture_to_the_others(tmp_path: Path) -> None:
    scene, path = scenes.load_scene("two-scales"), tmp_path / "two-scales.h5"
    session.run(scene, path, methods=["own:euler", "own:implicit-euler"])
    found = drawable(path)
    assert np.max(np.abs(found.runs["own:euler"].q)) > 1e200
    for bank in of_runs(scene, found.runs, found.followed):
        name, picture = bank.name, render.picture(bank)
        for axes in picture.axes:
            assert max(np.abs(axes.get_ylim())) <= 1000, name
            assert "outside: explicit Euler at 0.05" in axes.get_title(loc="right"), name
            lines = [line for line in axes.lines if line.get_label() == "own:implicit-euler"]
            assert lines, name
            low, high = axes.get_ylim()
            y = np.concatenate([np.asarray(line.get_ydata(), float) for line in lines])
            assert np.mean((low <= y) & (y <= high)) > 0.9, name


def drawn(tmp_path: Path, name: str, *methods: str) -> dict[str, Any]:
    scene, path = scenes.load_scene(name), tmp_path / f"{name}.h5"
    session.run(scene, path, methods=methods)
    found = drawable(path)
    return {bank.name: render.picture(bank) for bank in of_runs(scene, found.runs, found.followed)}


def test_a_line_that_leaves_the_picture_leaves_it_towards_the_next_state(tmp_path: Path) -> None:
    axes = drawn(tmp_path, "two-scales", "own:euler", "own:implicit-euler")["phase-portrait"].axes[0]
    (line,) = (x for x in axes.lines if x.get_label() == "own:euler" and x.get_marker() != "o")
    q, p = line.get_data()
    run = store.read_one(tmp_path / "two-scales.h5", "own:euler")
    true = np.arctan2(run.p[1, 0] - run.p[0, 0], run.q[1, 0] - run.q[0, 0])
    assert np.arctan2(p[1] - p[0], q[1] - q[0]) == pytest.approx(true, abs=1e-5)
    # from there on it is gone
    assert len(q) == len(p) == 2


def test_a_state_brought_nearer_keeps_its_direction_at_any_size() -> None:
    q, p = np.array([3e-201, 3e300, -0.2]), np.array([-4e-201, 4e300, 0.1])
    small, large = (Frame(-x, x, clipped=True) for x in (1e-200, 1e301))
    near_q, near_p = frames.nearer(q, p, small, small)
    np.testing.assert_allclose(near_p * (q[:2] / 3), near_q * (p[:2] / 3), rtol=1e-15)
    assert np.max(np.abs([near_q, near_p])) == pytest.approx(1e-194)
    np.testing.assert_array_equal(frames.nearer(q, p, large, large), (q, p))


def test_with_friction_energies_are_drawn_beside_that_of_the_true_motion(tmp_path: Path) -> None:
    upper, *_, lower = drawn(tmp_path, "rlc-circuit", "own:euler", "sundials:adams")["energy"].axes
    truth = upper.lines[0]
    assert truth.get_label() == "exact solution"
    # R/L = 22 Ohm / 3.3 mH: amplitudes fall with exp(-R t/2L), energies with exp(-R t/L) on average
    t, energy = truth.get_data()
    assert lower.get_xlabel() == "time t (\N{MICRO SIGN}s)"
    rate = np.polyfit(np.asarray(t, float) / 1e6, np.log(np.asarray(energy, float)), 1)[0]
    assert rate == pytest.approx(-22 / 3.3e-3, rel=0.02)
    adams = next(line for line in lower.lines if line.get_label() == "sundials:adams")
    assert np.max(adams.get_ydata()) < 1e-8
    assert lower.get_ylabel() == "|energy - exact| / initial energy"


def test_without_friction_energies_are_drawn_beside_the_start_s(tmp_path: Path) -> None:
    upper, lower = drawn(tmp_path, "spring-uneven", "own:euler")["energy"].axes
    assert upper.lines[0].get_label() == "exact solution"
    np.testing.assert_array_equal(upper.lines[0].get_ydata(), 1.0)
    assert lower.get_ylabel() == "|energy - initial| / initial energy"


def test_drawing_says_nothing_beside_the_names_of_its_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    text = scenes.load_scene("spring").to_toml().replace("Mass on a spring", "\\u8cea\\u91cf")
    (tmp_path / "mass.toml").write_text(text)
    path = str(tmp_path / "mass.h5")
    assert main(["run", str(tmp_path / "mass.toml"), "--method", "own:*euler", "--quiet", "-o", path]) == 0
    assert main(["plot", path, "-o", str(tmp_path / "figures")]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 8
    assert caplog.records == []


def test_a_figure_that_cannot_be_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = Figure()
    (png, _) = save(figure, tmp_path, "picture")
    before = png.read_bytes()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StoreError, match="the disk is full"):
        save(figure, tmp_path, "picture")
    assert png.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"picture.png", "picture.svg"}


def test_a_disk_without_room_for_figures_or_an_export_is_left_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, into = str(tmp_path / "s.h5"), tmp_path / "full"
    assert main(["run", "spring", "--method", "own:euler", "--quiet", "-o", path]) == 0
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
    into.mkdir()
    for line in (["plot", path, "-o", str(into / "a")], ["export", path, "own:euler", str(into / "a.h5md")]):
        assert main(line) == 2
        said = capsys.readouterr().err
        assert f"are needed, and 1 kB are free in {into}: make room" in said
        assert ".new" not in said
        assert [*into.iterdir()] == []


@pytest.mark.usefixtures("steady_clock")
def test_a_study_of_precision_is_read_back_with_all_that_follows_from_its_points(
    tmp_path: Path, need: Need, capsys: pytest.CaptureFixture[str]
) -> None:
    need("sundials:bdf")
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "study.h5"
    labels = [engines.parse(name) for name in ("own:semi-implicit-euler", "sundials:bdf")]
    fresh = precision.record(scene, labels, path, budget=0.5)
    kept = PRECISION.stored(path)
    assert kept.points == fresh.points
    assert kept.sweeps[0].fit == fresh.sweeps[0].fit
    fit = kept.sweeps[0].fit
    assert fit is not None
    assert fit.order == pytest.approx(1, abs=0.01)
    assert kept.document() == fresh.document()
    for study in (fresh, kept):
        output.show(study.lines())
    text = capsys.readouterr().out
    assert text[: len(text) // 2] == text[len(text) // 2 :]


def test_a_study_of_precision_that_lacks_a_table_is_refused(tmp_path: Path) -> None:
    scene, path = scenes.load_scene("spring-uneven"), tmp_path / "study.h5"
    with store.open_new(path, "precision") as journal:
        journal.commit(scene, documents={"precision": '{"kind": "Path", "fields": {}, "tables": {}}'})
    with pytest.raises(StoreError, match="lacks a class of results"):
        PRECISION.stored(path)


def test_the_numbers_of_a_trajectory_have_the_units_of_its_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(tmp_path / "co.h5")
    assert main(["run", "carbon-monoxide", "--method", "own:euler", "-o", path, "--quiet"]) in (0, 1)
    capsys.readouterr()
    assert main(["inspect", path, "--trajectory", "own:euler", "--rows", "3"]) == 0
    heading = capsys.readouterr().out.splitlines()[2]
    assert [x.strip() for x in heading.split("  ") if x] == [
        "t (ps)", "q0 (nm)", "q1 (nm)", "p0 (u nm/ps)", "p1 (u nm/ps)",
    ]  # fmt: skip
