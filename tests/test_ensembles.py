"""An ensemble's cells are the runs that one would make one by one: what is varied stands in the file, and the
numbers of a cell are those of `run` on that file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from springcheck import cli, driver, store
from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile
from springcheck.studies.ensemble import measure, page, vary
from springcheck.studies.run.tally import Tally
from springcheck.studies.team import Processes

BOTH, SOLVED = ["own:*euler", "ase:velocity-verlet"], ["own:euler", "sundials:bdf"]


def text_of(name: str) -> str:
    return (scenefile.folder() / f"{name}.toml").read_text()


@pytest.mark.parametrize(
    ("name", "given", "methods"),
    [
        (
            "spring-uneven",
            ["spring.0.stiffness=0.5:8:4:log", "time.step=0.05,0.1"],
            ["own:*euler", "ase:velocity-verlet"],
        ),
        (
            "spring-uneven",
            ["particle.0.mass=1:5:3", "particle.0.momentum=-1:1:3"],
            ["own:euler", "sundials:bdf"],
        ),
        ("chain", ["particle.0.mass=1:5:3"], ["own:semi-implicit-euler"]),
        ("anharmonic", ["particle.0.position=0.1:0.9:3"], ["own:semi-implicit-euler"]),
        ("mathieu-tongue", ["modulated-spring.0.depth=0:0.9:3"], ["own:euler"]),
        ("diatomic", ["time.step=0.01,0.05"], ["own:semi-implicit-euler"]),
        ("rlc-circuit", ["capacitor.0.capacitance=1e-9:1e-8:3:log"], ["own:euler"]),
        # one friction for all particles of a run, and all joints as long as the largest motion asks for
        ("driven-spring", ["damping.0.coefficient=0.055,0.143"], ["openmm:langevin"]),
        ("spring-uneven", ["particle.0.position=1e-3,1e6"], ["pymunk:damped-spring"]),
        # ASE keeps its forces while no coordinate of a run moves by more than 1e-15
        (
            "spring-uneven",
            ["particle.0.position=0", "particle.0.momentum=1,1e-12,1e-13,1e-14,1e-15"],
            ["ase:velocity-verlet"],
        ),
    ],
    ids=lambda x: str(x) if isinstance(x, str) else "",
)
def test_a_cell_has_the_numbers_of_a_run_of_its_own(
    name: str, given: list[str], methods: list[str], tmp_path: Path, need: Callable[[str], None]
) -> None:
    need(methods[-1])
    scene = scenefile.load_scene(name)
    cells = vary.plan(given, text=text_of(name))
    found = measure.record(scene, cells, tmp_path / "e.h5", methods)
    varied = vary.Varied(scene, cells.text)
    assert store.check(tmp_path / "e.h5") == []
    assert found.tallies
    for tally in found.tallies:
        columns = measure.stored(tmp_path / "e.h5").of(tally.method)
        assert tally.cells == cells.cells == len(columns["steps"])
        for j in range(cells.cells):
            one = varied.whole({axis.field: float(columns[axis.field][j]) for axis in cells.axes})
            run = driver.run(one, tally.method)
            tell = Tally(one)
            tell.add(run)
            assert columns["steps"][j] == run.outcome.step
            assert measure.OUTCOMES[columns["outcome"][j]] == run.outcome.status
            assert columns["q0"][j] == pytest.approx(
                run.q[-1, 0], rel=1e-13, abs=1e-14 * np.max(np.abs(run.q))
            )
            # beside their rounding: sums over many cells are taken in another order
            assert columns["max_error"][j] == pytest.approx(tell.error, rel=1e-6, abs=1e-13)
            assert columns["energy_drift"][j] == pytest.approx(tell.drift, rel=1e-6, abs=1e-13)


def test_own_cells_are_equal_bit_for_bit_to_runs_of_their_own(tmp_path: Path) -> None:
    scene = scenefile.load_scene("spring-uneven")
    cells = vary.plan(["spring.0.stiffness=0.5:8:7:log"])
    measure.record(scene, cells, tmp_path / "e.h5", ["own:*euler"])
    varied = vary.Varied(scene, cells.text)
    for method in ("own:euler", "own:semi-implicit-euler", "own:implicit-euler"):
        columns = measure.stored(tmp_path / "e.h5").of(method)
        assert len(columns["q0"]) == 7
        for k, q in zip(columns["spring.0.stiffness"], columns["q0"], strict=True):
            assert driver.run(varied.whole({"spring.0.stiffness": float(k)}), method).q[-1, 0] == q


def test_a_cell_that_explodes_leaves_the_others_alone(tmp_path: Path) -> None:
    text = text_of("spring-uneven").replace("steps = 200", "steps = 2000")
    scene = scenefile.parse(text, name="long")
    cells = vary.plan(["spring.0.stiffness=0.01,1e6,1"])
    measure.record(scene, cells, tmp_path / "e.h5", ["own:semi-implicit-euler"])
    columns = measure.stored(tmp_path / "e.h5").of("own:semi-implicit-euler")
    assert columns["outcome"].tolist() == [0, 1, 0]
    assert columns["steps"][1] < 2000
    assert np.all(columns["max_error"][[0, 2]] < 1)


def test_a_cell_that_an_engine_gives_up_at_once_has_no_error(tmp_path: Path) -> None:
    """As such a run of its own has none: that of the start is 0, which says nothing."""
    cells = vary.plan(["spring.0.stiffness=2,1e308", "particle.0.position=1e3"])
    scene = scenefile.load_scene("spring-uneven")
    (tally,) = measure.record(scene, cells, tmp_path / "e.h5", ["own:euler"]).tallies
    columns = measure.stored(tmp_path / "e.h5").of("own:euler")
    assert columns["steps"].tolist() == [200, 0]
    for name in ("max_error", "energy_drift"):
        assert np.isnan(columns[name]).tolist() == [False, True]
        assert tally.smallest[name] == columns[name][0]


@pytest.mark.skipif(
    bool(np.finfo(np.longdouble).max == np.finfo(np.float64).max), reason="no width holds the squares"
)
def test_energies_beyond_the_range_of_double_precision_are_those_of_the_states(tmp_path: Path) -> None:
    """Of states that it holds; the energy of 1e300 was none, and that of 1e-300 was none lost."""
    cells = vary.plan(["particle.0.position=1e-300:1e300:3:log"], text=text_of("spring"))
    measure.record(scenefile.load_scene("spring"), cells, tmp_path / "e.h5", ["own:velocity-verlet"])
    low, _, high = measure.stored(tmp_path / "e.h5").of("own:velocity-verlet")["energy_drift"]
    assert low == pytest.approx(0.0025, rel=0.01)
    assert high == pytest.approx(-0.0025, rel=0.01)


def test_samples_come_from_their_seed_and_are_spread_as_asked(tmp_path: Path) -> None:
    given = ["spring.0.stiffness=1:100:log", "particle.0.mass=1:3"]
    one, again, other = (vary.plan(given, 30_000, seed) for seed in (5, 5, 6))
    assert len(one.chunks) == 3
    for chunk in one.chunks:
        for field, values in one.values(chunk).items():
            assert np.array_equal(values, again.values(chunk)[field])
            assert not np.array_equal(values, other.values(chunk)[field])
    k = np.concatenate([one.values(chunk)["spring.0.stiffness"] for chunk in one.chunks])
    # the logarithm is even: its mean is known to a standard error of log(100)/sqrt(12 * 30000)
    assert abs(np.mean(np.log(k)) - np.log(100) / 2) < 4 * np.log(100) / np.sqrt(12 * 30_000)
    assert len(np.unique(k)) == 30_000
    scene = scenefile.load_scene("spring-uneven")
    few = vary.plan(given, 50, 5)
    measure.record(scene, few, tmp_path / "one.h5", ["own:euler"])
    measure.record(scene, few, tmp_path / "two.h5", ["own:euler"], team=Processes(2))
    first, second = (measure.stored(tmp_path / f"{x}.h5").of("own:euler") for x in ("one", "two"))
    assert all(np.array_equal(first[name], second[name], equal_nan=True) for name in first)
    assert np.array_equal(first["spring.0.stiffness"], k[:50])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([], "needs --vary"),
        (["spring.0.stiffness"], "is needed"),
        (["spring.0.stiffness=1:2"], "is needed"),
        (["spring.0.stiffness=1:2:3:lag"], "is needed"),
        (["spring.0.stiffness=-1:2:3:log"], "is needed"),
        (["spring.0.stiffness=nan,1"], "is needed"),
        (["spring.0.stiffness=1,2", "spring.0.stiffness=1,2"], "given twice"),
        (["spring.0.stifness=1,2"], "stifness"),
        (["spring.7.stiffness=1,2"], "has no such number"),
        (["title=1,2"], "has no such number"),
        (["particle.momentum=1,2"], "has no such number, did you mean particle.0.momentum?"),
        (["particle.-1.mass=1,2"], "has no such number"),
        ([".=1,2"], "has no such number"),
        (["particle.0.mass=-1,1"], "mass"),
        (["spring.0.stiffness=1:2:0"], "is needed"),
        (["spring.0.stiffness=1:2:100000", "particle.0.mass=1:2:100000"], "can be run"),
    ],
)
def test_what_cannot_be_varied_is_said_in_one_line(given: list[str], words: str, tmp_path: Path) -> None:
    def record() -> None:
        scene = scenefile.load_scene("spring-uneven")
        measure.record(scene, vary.plan(given), tmp_path / "e.h5", ["own:euler"])

    with pytest.raises(SpringcheckError, match=words) as refused:
        record()
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "e.h5").exists()


@pytest.mark.parametrize(
    ("scene", "field", "words"),
    [
        ("diatomic", "box.lengths.0=3.9,4.5", "as a whole"),
        ("bath-spring", "particle.0.mass=1,2", "has a bath"),
    ],
)
def test_what_no_cell_has_of_its_own_is_refused(scene: str, field: str, words: str) -> None:
    """Cells that should differ were alike."""
    with pytest.raises(SpringcheckError, match=words):
        measure.record(scenefile.load_scene(scene), vary.plan([field]), None)


def test_the_command_line_runs_inspects_and_draws_an_ensemble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    vary_two = ["--vary", "spring.0.stiffness=0.5:8:6:log", "--vary", "time.step=0.01:0.2:5"]
    arguments = ["run", "spring-uneven", *vary_two, "--method", "own:*euler", "--workers", "2"]
    assert cli.main(arguments) == 0
    told = capsys.readouterr().out
    assert "30 cells, a grid over spring.0.stiffness, time.step" in told
    assert "no cell is judged" in told
    path = "spring-uneven-ensemble.h5"
    assert cli.main(["inspect", path, "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["studies"]["ensemble"]["methods"][0]["cells"] == 30
    assert cli.main(["plot", path, "-o", "f"]) == 0
    assert {one.name for one in Path("f").iterdir()} == {
        f"ensemble-{name}.{end}" for name in ("max_error", "energy_drift") for end in ("png", "svg")
    } | {"springcheck-figures.json"}
    assert cli.main(["plot", path, "-o", "g", "--quantity", "outcome", "--over", "time.step"]) == 0
    assert Path("g/ensemble-outcome-over-time-step.png").exists()
    capsys.readouterr()
    # a file of somebody else's in the way is told before anything is drawn
    Path("f/ensemble-max_error.svg").write_text("mine")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("springcheck.figures.render.picture", lambda bank: pytest.fail("it is drawn"))
        assert cli.main(["plot", path, "-o", "f"]) == 2
    assert "is no figure of ours as it was drawn: move it away" in capsys.readouterr().err
    for given, words in (
        (["--quantity", "max_eror"], "did you mean max_error?"),
        (["--over", "spring.0.mass"], "one or two of spring.0.stiffness, time.step are needed"),
        (["--particle", "0"], "--particle goes with a store of run, and it holds ensemble"),
        (["--particle", "0", "--quantity", "q0"], "--particle and --quantity do not go together"),
    ):
        assert cli.main(["plot", path, *given]) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1
    assert cli.main(["run", "spring-uneven", "--workers", "2"]) == 2
    assert "go with --vary" in capsys.readouterr().err


def grid_of(counts: tuple[int, ...], value: Callable[..., Any]) -> tuple[Any, dict[str, np.ndarray]]:
    """A made-up ensemble over a (logarithmic), b, ... and its cells."""
    axes = [np.geomspace(1, 100, counts[0]), *(np.linspace(0, 1, n) for n in counts[1:])]
    cells = [x.ravel() for x in np.meshgrid(*axes, indexing="ij")]
    names = tuple("abc"[: len(counts)])
    found = SimpleNamespace(fields=names, grid=True, path=None, tallies=())
    return found, {**dict(zip(names, cells, strict=True)), "max_error": value(*cells)}


def test_every_cell_of_a_grid_stands_in_its_map() -> None:
    found, cells = grid_of((5, 4), lambda a, b: a + 1000 * b)
    part = page.reduced(cells, found, "max_error", page.fields_over(found))
    x, y = part.places
    np.testing.assert_allclose(part.values, x + 1000 * y[:, None], rtol=1e-14)


def test_a_grid_of_many_cells_is_shown_by_the_medians_of_neighbours() -> None:
    found, cells = grid_of((200, 130), lambda a, b: np.log(a))
    part = page.reduced(cells, found, "max_error", page.fields_over(found))
    x = part.places[0]
    assert part.values.shape == (44, 50)
    np.testing.assert_allclose(part.values, np.broadcast_to(np.log(x), (44, 50)), atol=1e-12)
    found, cells = grid_of((2001,), lambda a: a * (1 + 0.5 * (np.arange(len(a)) % 2)))
    line = page.reduced(cells, found, "max_error", page.fields_over(found))
    (at,), (low, high) = line.places, line.ends
    assert len(at) == page.MOST_POINTS
    assert np.all((low <= at * 1.01) & (high >= 1.48 * at))


def test_one_method_that_explodes_does_not_set_the_axis_of_the_others() -> None:
    calm = np.array([-0.7, 0.4, 0.9])
    scene, wild = scenefile.load_scene("spring"), np.array([0.4, -80.0, 1e9])
    assert page._axis("q0", scene, [calm, 0.9 * calm, wild]).shown == pytest.approx((-1.8, 1.8))
    assert page._axis("q0", scene, [calm, 0.9 * calm]).shown is None
    # in whatever unit, and numbers of one sign are shown whole
    assert page._axis("q0", scene, [1e6 * calm]).shown is None
    assert page._axis("steps", scene, [np.array([3000.0, 5000.0])]).shown is None


def test_shades_of_a_map_follow_the_signs_of_its_numbers_and_not_what_explodes() -> None:
    kinds, bounds = page._kinds("q0", [np.array([-3.0, 0.5, np.nan]), np.array([1e6])])
    assert [shade for _, shade in kinds] == list(page.SIGNED_SHADES)
    np.testing.assert_allclose(bounds, -bounds[::-1])
    assert np.max(np.abs(bounds)) < 6
    kinds, bounds = page._kinds("steps", [np.array([10.0, 80.0])])
    assert kinds[0] == ("10 to 20", "s0")
    assert kinds[-1] == ("70 to 80", "s6")
    assert len(bounds) == len(kinds) - 1
    assert page._kinds("max_error", [np.array([0.0])])[0] == [("0", "s0")]
    assert [name for name, _ in page._kinds("outcome", [np.array([0.0, 2.0])])[0]] == list(page.OUTCOMES)


def test_fields_that_are_not_shown_have_the_value_in_their_middle() -> None:
    found, cells = grid_of((5, 4, 3), lambda a, b, c: a + 1000 * b + 1e6 * c)
    part = page.reduced(cells, found, "max_error", page.fields_over(found, "c,a"))
    x, y = part.places
    assert page.fixed(cells, found, ("c", "a")) == {"b": pytest.approx(2 / 3)}
    expected = y[:, None] + 2000 / 3 + 1e6 * x
    np.testing.assert_allclose(part.values, expected, rtol=1e-14)


def test_random_samples_are_put_together_in_tiles_and_nothing_is_lost() -> None:
    rng = np.random.default_rng(1)
    a, b = 10 ** rng.uniform(-3, 3, 5000), rng.uniform(-1, 1, 5000)
    cells = {"a": a, "b": b, "max_error": np.where(b > 0, 2.0, a)}
    cells["max_error"][7] = np.nan
    found: Any = SimpleNamespace(fields=("a", "b"), grid=False)
    part = page.reduced(cells, found, "max_error", ("a", "b"))
    x, y = part.places
    assert np.all(part.values[y > 0.1] == 2)
    low = part.values[y < -0.1]
    assert np.all(np.abs(np.log(low / x)) < np.log(x[1] / x[0]))
    # without a line: the other field differs, too
    line = page.reduced(cells, found, "max_error", ("a",))
    assert np.min(line.ends[0]) == np.nanmin(cells["max_error"])


def test_the_report_page_shows_an_ensemble_of_two_fields_as_maps_of_powers_of_ten(tmp_path: Path) -> None:
    given = ["spring.0.stiffness=0.5:50:5:log", "time.step=0.01:0.4:4"]
    found = measure.record(
        scenefile.load_scene("spring-uneven"), vary.plan(given), tmp_path / "e.h5", ["own:euler"]
    )
    error, _ = page.banks(found)
    (chart,) = error.charts
    columns = measure.stored(tmp_path / "e.h5").of("own:euler")
    values = columns["max_error"].reshape(5, 4).T
    assert chart.tiles
    for row, numbers in zip(chart.tiles.rows, values, strict=True):
        for kind, number in zip(row, numbers, strict=True):
            words = chart.tiles.kinds[kind][0].replace("below", "0 to").replace("and above", "to inf")
            low, high = map(float, words.split(" to "))
            assert low <= number <= high


def test_a_figure_says_what_was_found_and_where_the_limit_is() -> None:
    import springcheck

    two = ["own:euler", "own:velocity-verlet"]
    found = springcheck.ensemble("spring", {"time.step": "0.5:2.5:9"}, two)
    figure = found.figures()["ensemble-max_error"]
    title = " ".join(figure.get_suptitle().split())
    assert title.startswith("Mass on a spring: largest error over step h; smallest by own:velocity-verlet, ")
    (axes,) = figure.axes
    assert axes.get_xlabel() == "step h"
    limit = next(line for line in axes.lines if line.get_color() == "#b00020")
    assert list(limit.get_xdata()) == [2, 2], "of a spring and a mass of 1"
    grid = springcheck.ensemble(
        "spring", {"spring.0.stiffness": [1, 9, 25], "time.step": [0.1, 0.5, 0.9]}, two
    )
    euler, verlet = grid.figures()["ensemble-max_error"].axes
    assert not euler.lines, "explicit Euler is stable at no step"
    (curve,) = verlet.lines
    k = np.interp(np.asarray(curve.get_xdata(), float), [0, 1, 2], [1, 9, 25])
    h = np.interp(np.asarray(curve.get_ydata(), float), [0, 1, 2], [0.1, 0.5, 0.9])
    assert len(k) > 9
    np.testing.assert_allclose(h * np.sqrt(k), 2, rtol=1e-12)


def test_the_name_of_a_limit_stands_within_its_map() -> None:
    import springcheck

    fields = {"spring.0.stiffness": "0.5:5:20", "time.step": "0.02:1.9:25"}
    for over in (dict(fields), dict(reversed(fields.items()))):
        found = springcheck.ensemble("spring-uneven", over, ["own:velocity-verlet"])
        (axes,) = found.figures()["ensemble-max_error"].axes
        axes.figure.draw_without_rendering()
        words = next(x for x in axes.texts if x.get_text().startswith("limit")).get_window_extent()
        frame = axes.get_window_extent()
        assert frame.x0 <= words.x0 < words.x1 <= frame.x1


def test_the_limit_that_a_figure_shows_is_that_of_the_scheme() -> None:
    import springcheck

    some = ["own:euler", "own:rk4", "own:forest-ruth", "own:velocity-verlet", "own:position-verlet"]
    found = springcheck.ensemble("spring-uneven", {"time.step": "0.5:4.5:9"}, some)
    (error,) = page.banks(found, quantity="max_error")
    omega = np.sqrt(2.9 / 3.7)
    limits = {rule.name: rule.at * omega for rule in error.charts[0].rules}
    # RK4: 2 sqrt(2); Forest-Ruth: 1.573, measured by `stability`
    assert list(limits) == ["limit h ω = 2.83", "limit h ω = 1.57", "limit h ω = 2"]
    np.testing.assert_allclose(list(limits.values()), [2 * np.sqrt(2), 1.573401947, 2], rtol=1e-9)


@pytest.mark.parametrize(("name", "said"), [("overdamped", "H exact"), ("spring-uneven", "H0")])
def test_the_column_of_energies_says_whose_energy_is_taken_off(name: str, said: str, tmp_path: Path) -> None:
    cells = vary.plan(["time.step=0.001,0.002"], text=text_of(name))
    found = measure.record(scenefile.load_scene(name), cells, tmp_path / "e.h5", ["own:rk4"])
    assert f"energy: (H - {said})/(initial T + |V|)" in "\n".join(map(str, found.lines()))
    (drawn,) = page.banks(found, quantity="energy_drift")
    assert drawn.charts[0].y.name == f"|H - {said}| / (initial T + |V|) where it is largest"
