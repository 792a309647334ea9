"""The atlas of extreme cases: no cell is silently wrong, and one that is made wrong is found."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import driver, engines, store
from springcheck.cli import main
from springcheck.engines.contract import Stopped
from springcheck.errors import MethodError
from springcheck.figures import looks, render
from springcheck.physics.arrays import WIDE
from springcheck.studies.extremes import STUDY, grid, judging, stiff
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.extremes import result as keeping
from springcheck.text.lines import as_text

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


def test_the_whole_grid_has_two_thousand_cells_for_three_methods_alone() -> None:
    assert 3 * len(grid.specs()) >= 2000


def test_fixed_point_forces_have_their_window(need: Need) -> None:
    need("openmm:verlet@OpenCL-double")
    forces = [spec for spec in grid.specs() if spec.block == "force"]
    (window,) = keeping.windows(extremes.cells(engines.parse("openmm:verlet@OpenCL-double"), forces))
    # 2**-32 of resolution leaves single precision from 2**-8 on; beyond 2**31 the sum overflows
    assert 1e-3 <= window.low <= 1e-2
    assert 1e8 <= window.high <= 1e9


def broken(change: Callable[[Any, Any], None], monkeypatch: pytest.MonkeyPatch) -> list[judging.Cell]:
    """Cells of an engine whose numbers are changed behind its back."""
    right = extremes.raw

    def wrong(scene: Any, label: Any) -> Any:
        q, p, said = right(scene, label)
        change(q, p)
        return q, p, said

    monkeypatch.setattr(extremes, "raw", wrong)
    specs = [spec for spec in grid.specs() if spec.block == "force"]
    return extremes.cells(engines.parse("own:semi-implicit-euler"), specs)


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
    (cell,) = extremes.cells(engines.parse("own:yoshida4"), [spec])
    assert cell.outcome == "unstable, as theory says"
    assert "a step forms numbers beyond 1.8e+308" in cell.reason


def test_an_engine_that_gives_up_over_some_cells_takes_no_others_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    right, label = extremes.raw, engines.parse("own:semi-implicit-euler")
    specs = [spec for spec in grid.specs() if spec.block == "force" and 1e-3 < spec.force < 1e3][:40]
    fine = extremes.cells(label, specs)

    def gives_up(scene: Any, label: Any) -> Any:
        q, p, _ = right(scene, label)
        if not np.any(scene.q == specs[7].q):
            return q, p, None
        q[3] = p[3] = np.nan
        return q[:4], p[:4], Stopped(2, "it stops")

    monkeypatch.setattr(extremes, "raw", gives_up)
    found = extremes.cells(label, specs)
    assert [cell.parameters for cell in found] == [cell.parameters for cell in fine]
    stopped = [i for i, cell in enumerate(found) if "it stops" in cell.reason]
    assert stopped == [i for i, spec in enumerate(specs) if spec.q == specs[7].q]
    assert all(found[i] == fine[i] for i in range(40) if i not in stopped)


def test_the_document_has_the_promised_fields() -> None:
    atlas = extremes.record(None, ["own:implicit-euler"], quick=True)
    found = json.loads(json.dumps(atlas.document(), allow_nan=False))
    fields = {"method", "parameters", "outcome", "reason", "value", "bound"}
    assert all(fields <= set(cell) for cell in found["cells"])
    assert found["windows"][0]["low"] == 1e-300


def test_a_range_is_that_of_calm_steps_and_counts_what_theory_calls_unstable() -> None:
    # at h w = 2.5 the smallest force is at the engine's limit
    specs = [grid.force_cell(turn, decade) for turn in (0.1, 1.0, 2.5) for decade in (-300, 0, 300)]
    cells = extremes.cells(engines.parse("own:implicit-euler"), specs)
    assert [cell.outcome for cell in cells if cell.outcome != "right"] == ["engine's limit"]
    (window,) = keeping.windows(cells)
    assert (window.low, window.high) == (1e-300, 1e300)
    # explicit Euler is nowhere right at h w = 1.9
    specs = [grid.force_cell(turn, decade) for turn in (0.1, 1.9) for decade in (0, 3)]
    (window,) = keeping.windows(extremes.cells(engines.parse("own:euler"), specs))
    assert (window.low, window.high) == (1.0, 1e3)


def test_methods_of_one_range_share_a_line_and_the_table_fits_80_columns() -> None:
    atlas = extremes.record(None, ["own:euler", "own:implicit-euler"], quick=True)
    text = as_text(atlas.lines(), 80)
    assert max(map(len, text.splitlines())) <= 80
    assert [line for line in text.splitlines() if line.startswith("own (2)")]
    assert keeping.named(["a:b", "a:c", "a:b@P-x", "a:b@P-y", "d:e"]) == "a (2), a@P (2), d:e"


@pytest.mark.parametrize(
    ("name", "outcomes"),
    [
        ("own:implicit-midpoint", ["right"] * 6),
        ("own:rk4", ["right"] + ["unstable, as theory says"] * 5),
        ("sundials:bdf", ["right"] * 6),
        ("sundials:adams", ["right"] * 3 + ["engine's limit"] * 3),
    ],
)
def test_stiffness_up_to_1e12_is_survived_by_implicit_methods_alone(
    name: str, outcomes: list[str], need: Need
) -> None:
    need(name)
    cells = stiff.cells(engines.parse(name))
    assert [cell.outcome for cell in cells] == outcomes
    for cell, ratio in zip(cells, grid.RATIOS, strict=True):
        assert cell.parameters["k"] == ratio * stiff.SOFT
    if name == "sundials:adams":
        # by the root of the ratio: 10 times as many a row
        assert "about 9e+04 force calls" in cells[3].reason


def test_a_stiff_step_that_is_wrong_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = driver.run

    def wrong(scene: Any, label: Any) -> Any:
        run = plain(scene, label)
        return replace(run, q=run.q * (1 + 1e-9))

    monkeypatch.setattr(driver, "run", wrong)
    assert "silently wrong" in {x.outcome for x in stiff.cells(engines.parse("own:implicit-midpoint"))}


def test_red_is_for_what_is_wrong() -> None:
    assert dict(keeping.OUTCOME_LOOKS)["silently wrong"][1] == "wrong"
    assert render.TILES_SHADED["wrong"].lower() == looks.FAILED.lower()
    assert render.TILES_SHADED["limit"] != render.TILES_SHADED["wrong"]


def test_an_enormous_step_of_a_free_particle_stays_finite_in_implicit_euler() -> None:
    spec = grid.Spec(block="step", m=3.7, k=0.0, q=0.8, p=0.0, h=3e300)
    (cell,) = extremes.cells(engines.parse("own:implicit-euler"), [spec])
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
        drawn = render.picture(shown.banks()[0])
        (image,) = drawn.axes[0].images
        wanted = keeping.OUTCOMES.index("not measured")
        assert np.any(np.ma.filled(image.get_array(), -1) == wanted) == bool(count)
        assert [text.get_text() for text in drawn.legends[0].get_texts()].count("not measured") == count
