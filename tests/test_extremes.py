"""The atlas of extreme cases: no cell is silently wrong, and one that is made wrong is found."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import extreme
import finer_atlas
import long_cells
import solver_cells
import springcheck
from springcheck import engines, store
from springcheck.cli import main
from springcheck.engines.contract import Stopped
from springcheck.errors import MethodError
from springcheck.figures import render
from springcheck.physics.arrays import WIDE
from springcheck.studies.extremes import STUDY, grid, judging, page, running
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.extremes import result as keeping

Need = Callable[[str], None]
METHODS = [
    str(label)
    for label in engines.match(("*",))
    if "particles" in engines.method(label).kinds and not engines.method(label).adaptive
]
GPU = [
    *(f"openmm:verlet@OpenCL-{precision}" for precision in ("single", "mixed")),
    "openmm:euler@OpenCL-double",
]

pytestmark = [
    pytest.mark.skipif(not WIDE, reason="the study needs a wider range than double's"),
]


@pytest.mark.campaign
@pytest.mark.parametrize("name", [*METHODS, *GPU])
def test_no_cell_is_silently_wrong(name: str, need: Need) -> None:
    need(name)
    atlas = extremes.record(None, [name], quick=True)
    assert not atlas.wrong, atlas.wrong[:3]
    assert len(atlas.cells) >= 100
    assert atlas.counts()["right"] >= 20


def test_a_long_run_is_judged_up_to_where_its_forces_leave_fixed_point(need: Need) -> None:
    need("openmm:euler@OpenCL-double")
    label = engines.parse("openmm:euler@OpenCL-double")
    found = long_cells.last(label, long_cells.lengths(label, quick=True))
    cells = [cell for cell in found if "overflows beyond 2**31" in cell.reason]
    assert {cell.parameters["h_w"] for cell in cells} == {1.0, 1.9}
    # growth is (1 + (h w)**2)**(1/2) a step and the first force 2**10: 42 steps, and 28, to 2**31
    assert all("grown out of range after step 0:" in cell.reason for cell in cells)
    assert {cell.outcome for cell in cells} == {"unstable, as theory says"}


@pytest.mark.parametrize("name", ["sundials:adams", "sundials:bdf"])
def test_no_cell_of_a_solver_is_silently_wrong(name: str, need: Need) -> None:
    need(name)
    cells = solver_cells.cells([name], quick=True)
    assert len(cells) >= 100
    assert [cell for cell in cells if cell.outcome == "silently wrong"] == []
    assert sum(cell.outcome == "right" for cell in cells) >= 20


def test_a_solver_has_no_cells_in_the_atlas_and_it_is_said_why() -> None:
    atlas = extremes.record(None, ["own:euler", "sundials:bdf"], quick=True)
    assert {cell.method for cell in atlas.cells} == {"own:euler"}
    assert "it chooses its own steps" in atlas.left_out[0].reason


def test_cells_of_a_solver_in_a_store_are_no_map(need: Need) -> None:
    need("sundials:bdf")
    atlas = extremes.record(None, ["own:euler"], quick=True)
    solved = [solver_cells.solve(engines.parse("sundials:bdf"), spec) for spec in solver_cells.specs()[:65:5]]
    (bank,) = page.banks(replace(atlas, cells=(*atlas.cells, *solved)))
    assert {cell.block for cell in solved} == {"force"}
    assert [chart.title for chart in bank.charts] == ["own:euler"]


@pytest.mark.parametrize("name", ["own:semi-implicit-euler", "own:euler", "own:implicit-euler", "own:rk4"])
def test_no_long_run_is_silently_wrong(name: str) -> None:
    label = engines.parse(name)
    cells = long_cells.last(label, long_cells.lengths(label, quick=True))
    assert len(cells) >= 16
    assert {cell.outcome for cell in cells} <= {"right", "unstable, as theory says"}


def test_the_whole_grid_has_two_thousand_cells_for_three_methods_alone() -> None:
    assert 3 * len(grid.specs()) >= 2000


def test_fixed_point_forces_have_their_window(need: Need) -> None:
    need("openmm:verlet@OpenCL-double")
    forces = [spec for spec in grid.specs() if spec.block == "force"]
    (window,) = extremes.windows(running.cells(engines.parse("openmm:verlet@OpenCL-double"), forces))
    # 2**-32 of resolution leaves single precision from 2**-8 on; beyond 2**31 the sum overflows
    assert 1e-3 <= window.low <= 1e-2
    assert 1e8 <= window.high <= 1e9
    assert "right for forces between 1e-2 and 1e8" in window.sentence


def broken(change: Callable[[Any, Any], None], monkeypatch: pytest.MonkeyPatch) -> list[judging.Cell]:
    """Cells of an engine whose numbers are changed behind its back."""
    right = running.raw

    def wrong(scene: Any, label: Any) -> Any:
        q, p, said = right(scene, label)
        change(q, p)
        return q, p, said

    monkeypatch.setattr(running, "raw", wrong)
    specs = [spec for spec in grid.specs() if spec.block == "force"]
    return running.cells(engines.parse("own:semi-implicit-euler"), specs)


def test_a_step_that_is_a_little_off_is_silently_wrong_in_every_normal_cell(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def change(q: Any, p: Any) -> None:
        with np.errstate(all="ignore"):
            q[7] *= 1 + 1e-13

    cells = broken(change, monkeypatch)
    wrong = [cell for cell in cells if cell.outcome == "silently wrong"]
    assert len(wrong) > 0.9 * len(cells)


def test_a_nan_in_an_ordinary_cell_is_silently_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    def change(q: Any, p: Any) -> None:
        q[7] = np.nan

    cells = broken(change, monkeypatch)
    ordinary = [cell for cell in cells if 1e-30 < cell.parameters["force"] < 1e30]
    assert {cell.outcome for cell in ordinary if cell.parameters["h_w"] < 3} == {"silently wrong"}


def test_an_engine_that_does_not_move_is_not_excused_by_forces_that_it_keeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    step = "def frozen(q, p, h, force, mass):\n    return q, p + h * force(q)\n"
    (tmp_path / "frozen.py").write_text(step)
    for name, few in {"FORCE_DECADES": (0, 3), "SIZE_DECADES": (0,), "STEP_DECADES": (0,)}.items():
        monkeypatch.setattr(grid, name, few)
    monkeypatch.chdir(tmp_path)
    asked = ["extremes", "--stepper", "frozen.py:frozen", "--method", "stepper:frozen"]
    assert main([*asked, "--scheme", "frozen=semi-implicit-euler"]) == 1
    cells = STUDY.stored(Path("extremes.h5")).cells
    plane = [cell for cell in cells if cell.block == "force"]
    assert len(plane) == 24
    assert {cell.outcome for cell in plane} == {"silently wrong"}
    assert not any("by more than 0" in cell.reason for cell in cells)


def test_a_function_whose_scheme_is_unknown_is_told_how_to_state_it() -> None:
    def frozen(q: Any, p: Any, h: Any, force: Any, mass: Any) -> Any:
        return q, p + h * force(q)

    with pytest.raises(MethodError, match="its scheme is not known; scheme= NAME states it"):
        springcheck.extremes(frozen, quick=True)


def test_a_stage_that_overflows_inside_a_step_is_a_reason() -> None:
    # beyond its limit Yoshida's second stage goes 1.5 times as far as both ends of a step
    spec = grid.force_cell(1.99, 300)
    (cell,) = running.cells(engines.parse("own:yoshida4"), [spec])
    assert cell.outcome == "unstable, as theory says"
    assert "a step forms numbers beyond 1.8e+308" in cell.reason


def test_an_engine_that_gives_up_over_some_cells_takes_no_others_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    right, label = running.raw, engines.parse("own:semi-implicit-euler")
    specs = [spec for spec in grid.specs() if spec.block == "force" and 1e-3 < spec.force < 1e3][:40]
    fine = running.cells(label, specs)

    def gives_up(scene: Any, label: Any) -> Any:
        q, p, _ = right(scene, label)
        if not np.any(scene.q == specs[7].q):
            return q, p, None
        q[3] = p[3] = np.nan
        return q[:4], p[:4], Stopped(2, "it stops")

    monkeypatch.setattr(running, "raw", gives_up)
    found = running.cells(label, specs)
    assert [cell.parameters for cell in found] == [cell.parameters for cell in fine]
    stopped = [i for i, cell in enumerate(found) if "it stops" in cell.reason]
    assert stopped == [i for i, spec in enumerate(specs) if spec.q == specs[7].q]
    assert all(found[i] == fine[i] for i in range(40) if i not in stopped)


def test_bad_input_is_refused_with_a_reason() -> None:
    answers = extreme.refusals()
    assert len(answers) >= 25
    assert [what for what, said in answers.items() if not said or "Traceback" in said] == []


def test_the_document_has_the_promised_fields() -> None:
    atlas = extremes.record(None, ["own:implicit-euler"], quick=True)
    found = json.loads(json.dumps(atlas.document(), allow_nan=False))
    fields = {"method", "parameters", "outcome", "reason", "value", "bound"}
    assert all(fields <= set(cell) for cell in found["cells"])
    assert found["windows"][0]["sentence"].startswith("springcheck (own:implicit-euler): right for forces")


def test_a_window_of_forces_says_at_which_steps_it_is_all_that_was_tried() -> None:
    # at h w = 2.5 the smallest force is at the engine's limit
    specs = [grid.force_cell(turn, decade) for turn in (0.1, 1.0, 2.5) for decade in (-300, 0, 300)]
    cells = running.cells(engines.parse("own:implicit-euler"), specs)
    assert [cell.outcome for cell in cells if cell.outcome != "right"] == ["engine's limit"]
    (window,) = extremes.windows(cells)
    assert "forces between 1e-300 and 1e300 at h w from 0.01 to 1.9, in" in window.sentence
    assert window.sentence.endswith("all that was tried there")
    # explicit Euler is nowhere right at h w = 1.9
    specs = [grid.force_cell(turn, decade) for turn in (0.1, 1.9) for decade in (0, 3)]
    (window,) = extremes.windows(running.cells(engines.parse("own:euler"), specs))
    assert "at h w from 0.01 to 1.9, or unstable as theory says, in" in window.sentence


def test_an_enormous_step_of_a_free_particle_stays_finite_in_implicit_euler() -> None:
    spec = grid.Spec(block="step", m=3.7, k=0.0, q=0.8, p=0.0, h=3e300)
    (cell,) = running.cells(engines.parse("own:implicit-euler"), [spec])
    assert cell.outcome == "right"


def test_the_atlas_is_stored_whole_and_drawn(tmp_path: Path) -> None:
    atlas = extremes.record(tmp_path / "extremes.h5", ["own:euler"], quick=True)
    assert store.check(tmp_path / "extremes.h5") == []
    table = store.tables_of(tmp_path / "extremes.h5")["extremes/own:euler"]
    columns = {name: np.asarray(column) for name, column in table.columns.items()}
    assert (table.signal, table.axes) == ("outcome_number", ("log10_force", "log10_h_w"))
    assert [keeping.OUTCOMES[i] for i in columns["outcome_number"]] == [cell.outcome for cell in atlas.cells]
    for name in ("force", "h_w"):
        wanted = np.array([cell.parameters[name] for cell in atlas.cells])
        assert np.array_equal(columns[name], wanted)
        drawn = np.isfinite(columns[f"log10_{name}"])
        assert np.array_equal(drawn, (wanted > 0) & np.isfinite(wanted))
        np.testing.assert_allclose(columns[f"log10_{name}"][drawn], np.log10(wanted[drawn]), rtol=1e-15)
    assert {path.suffix for path in STUDY.draw(atlas, tmp_path)} == {".png", ".svg"}


def test_a_cell_that_could_not_be_measured_has_a_shade_of_its_own() -> None:
    atlas = extremes.record(None, ["own:semi-implicit-euler"], quick=True)
    untold = next(cell for cell in atlas.cells if cell.block == "force")
    cells = tuple(replace(cell, outcome="not measured") if cell is untold else cell for cell in atlas.cells)
    for shown, count in ((atlas, 0), (replace(atlas, cells=cells), 1)):
        drawn = render.picture(page.banks(shown)[0])
        (image,) = drawn.axes[0].images
        wanted = keeping.OUTCOMES.index("not measured")
        assert np.any(np.ma.filled(image.get_array(), -1) == wanted) == bool(count)
        assert [text.get_text() for text in drawn.legends[0].get_texts()].count("not measured") == count


def test_a_finer_atlas_has_every_decade_of_force_at_more_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # few decades
    few = {"SIZE_DECADES": (0,), "FORCE_DECADES": (-20, 0, 20)}
    for name, value in few.items():
        monkeypatch.setattr(grid, name, value)
    monkeypatch.setattr(finer_atlas, "EVERY_DECADE", range(-20, 21))
    base = extremes.record(None, ["own:implicit-euler"])
    method, path = ["own:implicit-euler"], tmp_path / "fine.h5"
    fine = finer_atlas.record(path, method, 800)
    assert 800 <= len(fine.cells) < 800 + 41
    assert set(map(repr, base.cells)) <= set(map(repr, fine.cells))
    ((plane,),) = (bank.charts for bank in page.banks(fine))
    assert plane.tiles is not None
    assert list(plane.x.values) == list(range(-20, 21))
    assert len(plane.y.values) > len(grid.CELL_TURNS)
    assert all(-1 not in row for row in plane.tiles.rows)
    assert not fine.wrong
    assert extremes.stored(path).counts() == fine.counts()
    # few more cells complete the rows that there are
    some = finer_atlas.record(None, method, len(base.cells) + 1)
    ((plane,),) = (bank.charts for bank in page.banks(some))
    assert (list(plane.x.values), len(plane.y.values)) == (list(range(-20, 21)), len(grid.CELL_TURNS))
