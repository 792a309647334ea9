"""What figures show: one look for a scheme, readable units, the separatrix, and no exploding run's scale."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from springcheck import driver
from springcheck.cli import main
from springcheck.errors import SpringcheckError
from springcheck.figures import energies, frames, looks, overlay, portraits, render, style
from springcheck.figures.charts import Bank, Chart, Curve, Scale
from springcheck.figures.motion import Exact, periods, smooth
from springcheck.figures.views import views
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.run.page import of_runs

mpl.use("agg")

OWN = ("own:euler", "own:semi-implicit-euler", "own:implicit-euler")


def runs(scene: Scene, *methods: str) -> dict[str, Trajectory]:
    return {method: driver.run(scene, method) for method in methods}


def figures(scene: Scene, made: dict[str, Trajectory], **how: Any) -> dict[str, Any]:
    """As `plot` draws them, by name."""
    return {bank.name: render.picture(bank) for bank in of_runs(scene, made, made, **how)}


def test_no_two_schemes_of_the_list_share_a_look() -> None:
    assert len({looks.LOOKS[name] for name in looks.LOOKS}) == len(looks.LOOKS)
    assert looks.look("a plug-in's") == looks.look("a plug-in's")
    assert looks.look("a plug-in's") not in looks.LOOKS.values()


def test_every_engine_s_mark_is_in_the_font_of_the_figures() -> None:
    from matplotlib import font_manager, ft2font

    font = ft2font.FT2Font(font_manager.findfont("DejaVu Sans"))
    marks = [*looks.MARKS.values(), *looks._OTHER_MARKS]
    assert [sign for _, sign in marks if not font.get_char_index(ord(sign))] == []
    assert "fault" in looks.MARKS
    assert len(set(marks)) == len(marks)


def test_a_run_that_failed_is_drawn_in_red_on_top_of_the_scheme_that_it_breaks() -> None:
    scene = scenefile.load_scene("spring-uneven")
    made = runs(scene, "own:semi-implicit-euler", "own:velocity-verlet")
    right = made["own:semi-implicit-euler"]
    wrong = replace(right, label="stepper:mine", q=right.q * 1.1)
    made = {"stepper:mine": wrong, **made}
    drawn = figures(scene, made, failed=["stepper:mine"])
    assert len(drawn) == 4
    for figure in drawn.values():
        (line,) = [
            x
            for axes in figure.axes
            for x in axes.lines
            if x.get_label() == "stepper:mine" and x.get_linestyle() != "None"
        ][:1]
        assert "stepper:mine is wrong (red)" in figure.get_suptitle().replace("\n", " ")
        assert line.get_color() == looks.FAILED
        # only marks stand above it
        above = [x for x in figure.axes[0].lines if x.get_zorder() > line.get_zorder()]
        assert all(x.get_linestyle() == "None" for x in above)
        texts = [x.get_text() for x in figure.legends[0].get_texts()]
        schemes_of = [text for text in texts if text not in ("exact solution", "start", "separatrix")]
        assert schemes_of[0].startswith("FAILED: stepper:mine")
        assert schemes_of[1].startswith("semi-implicit Euler")


def test_marks_of_runs_that_lie_on_one_another_stand_apart() -> None:
    scene = scenefile.load_scene("free")
    made = runs(
        scene, *(f"own:{name}" for name in ("euler", "semi-implicit-euler", "velocity-verlet", "rk4"))
    )
    axes = figures(scene, made)["phase-portrait"].axes[0]
    marks = [x for x in axes.lines if x.get_label() in made and x.get_linestyle() == "None"]
    first = [x.get_xdata()[0] for x in marks]
    assert len(first) == len(set(first)) == 4


@pytest.mark.parametrize(("steps", "dots"), [(2000, False), (10_000, True)])
def test_points_of_many_periods_are_not_joined_to_chords_that_the_exact_solution_never_takes(
    steps: int, dots: bool
) -> None:
    """Of 159 periods it has nine points in each, and lines between them miss its circle by 5 % of it."""
    scene = replace(scenefile.load_scene("spring"), steps=steps)
    made = runs(scene, "own:rk4")
    few = {label: run.at(slice(None, None, 7)) for label, run in made.items()}
    for shown in (made, few):
        (chart,) = of_runs(scene, shown, shown)[0].charts
        exactly = next(x for x in chart.curves if x.name == "exact solution")
        run = next(x for x in chart.curves if x.name == "own:rk4")
        assert (exactly.dots, exactly.line) == (dots, not dots)
        assert run.dots == (shown is few)


def test_every_colour_is_seen_on_white_and_on_black() -> None:
    assert {look.color for look in (*looks.LOOKS.values(), *looks._REST)} <= set(looks.ON_SCREEN)
    css = (Path(looks.__file__).parents[1] / "cli" / "page" / "page.css").read_text()
    white, black = re.findall(r"--paper: (#[0-9a-f]+)", css)[:2]
    assert (white, black) == ("#fff", "#161616")
    for pair in looks.ON_SCREEN.values():
        for colour, paper in zip(pair, ("#ffffff", black), strict=True):
            high, low = sorted((luminance(colour), luminance(paper)), reverse=True)
            # the least that the Web Content Accessibility Guidelines 2.1 (1.4.11) ask of a graphic
            assert (high + 0.05) / (low + 0.05) >= 3, (colour, paper)
    for shades in zip(*looks.ON_SCREEN.values(), strict=True):
        assert len(set(shades)) == len(shades)


def test_names_in_the_colour_of_a_curve_are_read_on_white_and_on_black() -> None:
    css = (Path(looks.__file__).parents[1] / "cli" / "page" / "page.css").read_text()
    (share,) = re.findall(r"svg \.name .*color-mix\(in srgb, var\(--of\) (\d+)%, var\(--ink\)\)", css)
    inks, papers = (re.findall(rf"--{name}: (#[0-9a-f]+)", css)[:2] for name in ("ink", "paper"))
    papers[0] = {"#fff": "#ffffff"}[papers[0]]
    for pair in (*looks.ON_SCREEN.values(), looks.FAILED_ON_SCREEN):
        for colour, ink, paper in zip(pair, inks, papers, strict=True):
            both = zip(bytes.fromhex(colour[1:]), bytes.fromhex(ink[1:]), strict=True)
            mixed = "#" + bytes(round((int(share) * a + (100 - int(share)) * b) / 100) for a, b in both).hex()
            high, low = sorted((luminance(mixed), luminance(paper)), reverse=True)
            # 1.4.3 asks more of text
            assert (high + 0.05) / (low + 0.05) >= 4.5, (mixed, paper)


def luminance(colour: str) -> float:
    """Of #rrggbb, relative to white, as those guidelines define it."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))


@pytest.mark.parametrize(
    ("largest", "unit", "factor", "shown"),
    [
        (2.35e-7, "C", 1e9, "nC"),
        (4e-4, "s", 1e6, "\N{MICRO SIGN}s"),
        (0.2, "ps", 1e3, "fs"),
        (4e3, "ps", 1e-3, "ns"),
        (0.117, "nm", 1e3, "pm"),
        (20.0, "ps", 1.0, "ps"),
        (999.0, "J", 1.0, "J"),
        (1000.0, "J", 1e-3, "kJ"),
        (1e-3, "s", 1e3, "ms"),
        (0.05, "\N{GREEK SMALL LETTER PI}", 1.0, "\N{GREEK SMALL LETTER PI}"),
        (0.05, "kg m/s", 1.0, "kg m/s"),
        (0.05, "", 1.0, ""),
        (0.0, "s", 1.0, "s"),
    ],
)
def test_axes_are_in_units_in_which_numbers_are_read_easily(
    largest: float, unit: str, factor: float, shown: str
) -> None:
    found, name = looks.prefixed(largest, unit)
    assert name == shown
    assert found == pytest.approx(factor, rel=1e-12)


def test_a_legend_has_one_entry_for_each_scheme() -> None:
    scene = scenefile.load_scene("spring")
    one = driver.run(scene, "own:euler")
    import dataclasses

    same = {name: dataclasses.replace(one, label=name) for name in ("own:euler", "x:a", "x:b", "y:c")}
    (group,) = overlay.Runs(scene, same).groups
    assert looks.members(run.label for run in group.members).split() == [
        looks.mark("own")[1], "own", looks.mark("x")[1], "x", "(2)", looks.mark("y")[1], "y",
    ]  # fmt: skip
    figure = figures(scene, same)["energy"]
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 2  # the exact solution, and the scheme


def test_a_legend_counts_every_method_of_a_curve_that_several_share() -> None:
    mine = ["own:euler", "openmm:euler", "lammps:bond"]
    curve = Curve(name="own:euler and 2 more", group="explicit-euler", x=[0.0], y=[0.0], methods=mine)
    scale = Scale(name="x")
    figure = render.picture(Bank(title="", charts=[Chart(title="", x=scale, y=scale, curves=[curve])]))
    (text,) = figure.legends[0].get_texts()
    assert text.get_text().endswith(looks.members(mine))


def test_the_separatrix_of_a_pendulum_is_the_motion_that_stops_at_its_top() -> None:
    scene = scenefile.load_scene("pendulum")
    shown = views(scene)
    assert len(shown) == 4
    for i, view in enumerate(shown):
        ((x, y),) = view.separatrices(-1, 1)
        depth = scene.terms[0].depth[i]  # type: ignore[attr-defined]
        expected = 2 * np.sqrt(scene.m[i] * depth) * np.cos(np.pi * x / 2)
        np.testing.assert_allclose(y, expected, atol=1e-6 * np.max(expected))


def test_angles_go_round_with_a_gap_where_they_come_in_again() -> None:
    view = views(scenefile.load_scene("pendulum"))[3]
    x, y = view.wrapped(np.array([0.5, 0.9, 1.3, 1.7]), np.arange(4.0))
    np.testing.assert_allclose(x, [0.5, 0.9, np.nan, -0.7, -0.3])
    np.testing.assert_array_equal(y, [0, 1, np.nan, 2, 3])


def test_a_free_pair_is_shown_by_its_bond_and_a_particle_where_it_is_asked_for() -> None:
    scene = scenefile.load_scene("carbon-monoxide")
    (bond,) = views(scene)
    q, p = scene.q[None, :], scene.p[None, :]
    x, y = bond.pick(q, p)
    assert x[0] == scene.q[1] - scene.q[0]
    # of the relative motion, the kinetic energy beside that of the centre
    kinetic = float(np.sum(scene.p**2 / (2 * scene.m))) - float(np.sum(scene.p)) ** 2 / (2 * np.sum(scene.m))
    assert y[0] ** 2 / (2 * bond.mass) == pytest.approx(kinetic, rel=1e-13)
    (one,) = views(scene, 1)
    assert one.pick(q, p) == (scene.q[1], scene.p[1])
    with pytest.raises(SpringcheckError, match="--particle 2: scene carbon-monoxide has particles 0 to 1"):
        views(scene, 2)


def test_what_grows_does_not_set_the_scale_and_what_is_large_does() -> None:
    t = np.linspace(0, 20, 400)
    truth = np.sin(t)
    assert frames.frame([truth, 5 * truth], truth).high == pytest.approx(5, rel=0.2)
    grown = frames.frame([truth, truth * np.exp(t)], truth)
    assert grown.high == pytest.approx(1, rel=0.5)
    assert grown.clipped
    left = grown.leaves(truth * np.exp(t))
    assert left is not None
    assert t[left] == pytest.approx(1, abs=0.5)
    # a value that differs by roundings is one value, not a picture of its roundings
    flat = frames.frame([np.array([7.0, 7 + 1e-14])], np.array([7.0, 7.0]))
    assert flat.half > 0.1


def test_errors_are_distances_from_the_exact_solution() -> None:
    scene = scenefile.load_scene("spring")
    run = driver.run(scene, "own:euler")
    exact = Exact(scene)
    # m = k = 1 from (0, 1): the distance in the plane
    expected = np.hypot(run.q[:, 0] - np.sin(run.t), run.p[:, 0] - np.cos(run.t))
    np.testing.assert_allclose(exact.error(run), expected, rtol=1e-9, atol=1e-15)
    axes = figures(scene, {"own:euler": run})["error"].axes[0]
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_ydata(), float), expected[1:], rtol=1e-9)


@pytest.mark.parametrize("name", ["free", "inverted", "chain", "long-chain", "van-der-pol", "diatomic"])
def test_a_scene_has_the_pictures_that_suit_it(name: str) -> None:
    scene = scenefile.load_scene(name)
    if name == "long-chain":
        from dataclasses import replace

        scene = replace(scene, steps=40)
    labels = ["own:implicit-euler"] if name == "van-der-pol" else ["own:semi-implicit-euler", "own:euler"]
    found = figures(scene, runs(scene, *labels))
    assert set(found) == {"phase-portrait", "position", "energy", "error"}
    for picture in found.values():
        for axes in picture.axes:
            assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def test_many_periods_are_shown_by_the_first_and_the_last_ones() -> None:
    scene = scenefile.load_scene("stiff-spring")
    made = runs(scene, "own:implicit-euler")
    figure = figures(scene, made)["position"]
    first, last = (axes.get_xlim() for axes in figure.axes)
    omega = np.sqrt(14800 / 0.37)
    assert (last[1] - last[0]) * omega / (2 * np.pi) == pytest.approx(6, rel=0.15)
    assert first[1] < last[0]
    t = np.linspace(0, 20 * np.pi, 1501)
    assert periods(np.sin(t)) == pytest.approx(10, abs=0.6)


def test_one_particle_is_drawn_beside_the_others_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "chain", "--method", "own:euler", "--quiet"]) == 0
    assert main(["plot", "chain.h5", "--particle", "2"]) == 0
    names = {Path(line).name for line in capsys.readouterr().out.splitlines()}
    assert names == {
        f"{one}-particle-2.{end}" for one in ("phase-portrait", "position") for end in ("png", "svg")
    }
    assert main(["plot", "chain.h5", "--particle", "3"]) == 2
    assert "particles 0 to 2" in capsys.readouterr().err


def test_a_coarse_atlas_has_no_gaps_between_its_cells() -> None:
    from springcheck.studies.extremes import result

    row = [0, -1, -1, 1, -1, -1, 2, -1, -1, -1, -1, -1, -1]
    assert result._filled(row) == [0, 0, 1, 1, 1, 2, 2, 2, 2, -1, -1, -1, -1]


def test_the_exact_solution_is_a_smooth_line_where_a_stiff_motion_decays_at_once() -> None:
    t, q, p = smooth(scenefile.load_scene("detest-b1"), 0.0, 20.0) or pytest.fail("it has one")
    assert np.all(np.diff(t) > 0)
    assert (t[0], t[-1]) == (0, pytest.approx(20))
    jumps = np.hypot(*(np.diff(x, axis=0) / np.ptp(x, axis=0) for x in (q, p)))
    assert np.max(jumps) < 0.1


def test_the_titles_of_energies_say_how_far_they_are_off_and_who_gains_and_loses() -> None:
    scene = scenefile.load_scene("spring")
    made = runs(scene, *OWN)
    found = {bank.name: bank for bank in of_runs(scene, made, made)}
    # (1 + (h w)**2)**200 - 1
    assert found["energy"].foot.endswith(" to 632 % (explicit Euler)")
    said = "explicit Euler gains energy; implicit Euler loses energy; semi-implicit Euler"
    assert said in found["phase-portrait"].foot


def test_methods_of_no_known_scheme_have_a_line_each() -> None:
    """The second was marks alone, on the line of the first, and the report page did not draw it."""
    scene = scenefile.load_scene("spring")
    made = {f"stepper:{x}": driver.run(scene, f"own:{x}") for x in ("euler", "velocity-verlet")}
    made = {label: replace(run, label=label, scheme="unknown") for label, run in made.items()}
    for bank in of_runs(scene, made, made):
        for chart in bank.charts:
            lines = {one.name: one.group for one in chart.curves if one.name in made and not one.over}
            assert len(lines) == len({*lines.values()}) == len({*lines} & {*made}), bank.name
        assert all("no scheme that is known" in x.title for x in bank.charts[0].curves if x.name in made)
    headings = [bank.foot for bank in of_runs(scene, made, made)]
    assert "stepper:euler gains energy; stepper:velocity-verlet conserves it on average" in headings[0]


def test_marks_on_an_edge_are_whole_and_none_lies_beyond_it() -> None:
    """Of a run of one step half of its only error was drawn."""
    for steps, step in ((1, 0.1), (12, 0.5), (12, -0.5)):
        scene = replace(scenefile.load_scene("spring"), steps=steps, step=step)
        for figure in figures(scene, runs(scene, *OWN)).values():
            for axes in figure.axes:
                ends = [sorted(axes.get_xlim()), sorted(axes.get_ylim())]
                for line in axes.lines:
                    if line.get_marker() != "o":
                        continue
                    assert not line.get_clip_on()
                    for x, (low, high) in zip(line.get_data(), ends, strict=True):
                        assert np.all((low <= x) & (x <= high))


def test_an_axis_of_energies_shows_no_millionths() -> None:
    ys = energies._scale([np.array([1.0, 1 + 3e-8]), np.array([1.0, 1 - 1e-9])], np.ones(2))
    assert ys.half >= 0.01
    assert ys.low < 1 < ys.high
    scene = scenefile.load_scene("free")
    made = runs(scene, "own:semi-implicit-euler")
    (title,) = (bank.foot for bank in of_runs(scene, made, made) if bank.name == "energy")
    assert title == "Free mass: a straight line: all keep the energy exactly"


def test_an_orbit_that_has_collapsed_at_once_has_spiralled_in() -> None:
    scene = scenefile.load_scene("stiff-spring")
    made = runs(scene, "own:implicit-euler", "own:velocity-verlet", "own:semi-implicit-euler")
    assert "implicit Euler loses energy; 2 conserve it on average" in of_runs(scene, made, made)[0].foot


def test_a_run_that_stays_by_an_exact_motion_that_runs_away_has_not_left_it() -> None:
    """Off the top of a hill e**20 away RK4 is off by 5e3 of the start, 1e-5 of the motion."""
    spring = scenefile.load_scene("spring")
    (term,) = spring.terms
    scene = replace(spring, terms=(replace(term, k=-term.k),))
    made = runs(scene, "own:rk4", "own:velocity-verlet")
    for bank in of_runs(scene, made, made):
        if bank.name != "energy":
            assert "leave" not in bank.foot, bank.foot


def test_each_method_in_a_bath_has_a_line_and_states_of_its_own() -> None:
    """Of one scheme, with noise of their own; and the name of the bath has a row above those of methods."""
    bath = scenefile.load_scene("bath-uneven").bath
    scene = replace(scenefile.load_scene("carbon-monoxide"), bath=bath, steps=600)
    run = driver.run(scene, "own:baoa", seed=1)
    both = {
        run.label: run,
        "lammps:baoa": replace(driver.run(scene, "own:baoa", seed=2), label="lammps:baoa"),
    }
    banks = {bank.name: bank for bank in of_runs(scene, both, both)}
    assert [x.name for x in banks["phase-portrait"].charts[0].curves if not x.over] == list(both)
    assert "(phase portrait of particle 0 of 2" in banks["phase-portrait"].foot
    # of one seed engines may draw the same noise
    assert "one random motion of each method" in banks["position"].foot
    assert "a few periods" not in banks["position"].foot


def test_a_title_of_the_frames_drawn_says_so() -> None:
    """Of a run of more frames than are drawn the rest may be further off than "largest"."""
    scene = scenefile.load_scene("spring-uneven")
    (made,) = runs(scene, "own:semi-implicit-euler").values()
    few = replace(made.at(slice(None, None, 4)), every=4 * made.every)
    for run in (made, few):
        said = [bank.foot for bank in of_runs(scene, {run.label: run}, {run.label: run})]
        most = [heading for heading in said if "largest" in heading]
        assert len(most) >= 2
        assert all(("of the frames drawn" in heading) == (run is few) for heading in most), most


def test_frames_too_far_apart_to_be_joined_are_dots() -> None:
    for name, dots in (("spring", False), ("ch-bond", True)):
        scene = scenefile.load_scene(name)
        made = runs(scene, "own:velocity-verlet")
        bank = of_runs(scene, made, made)[0]
        (curve,) = (x for x in bank.charts[0].curves if x.name in made)
        assert curve.dots == dots
        assert curve.line != dots


def test_in_a_bath_every_scheme_has_a_panel_and_its_temperatures() -> None:
    scene = replace(scenefile.load_scene("bath-spring"), steps=4000)
    made = {x: driver.run(scene, x, seed=3) for x in ("own:baoab", "own:obabo")}
    found = {bank.name: bank for bank in of_runs(scene, made, made)}
    assert set(found) == {"phase-portrait", "position", "temperature"}
    assert len(found["phase-portrait"].charts) == 2
    kinetic = found["temperature"].charts[1]
    measured = {x.name: float(x.x[0]) for x in kinetic.curves if x.name in made}
    assert measured["own:baoab"] == pytest.approx(
        np.mean(made["own:baoab"].p ** 2) / scene.m[0] / scene.thermal, rel=0.3
    )
    for axes in render.picture(found["temperature"]).axes:
        bars = [y.get_xdata() for y in axes.lines if y.get_linestyle() == "-" and len(y.get_xdata()) == 2]
        low, high = axes.get_xlim()
        ends = [x for bar in bars for x in bar if x not in (0, 1)]
        assert len(ends) == 2 * len(made)
        assert low <= min(ends) <= max(ends) <= high
        assert "two standard errors" in axes.get_title(loc="left")


def test_the_title_of_errors_says_who_is_nearest_and_who_is_farthest() -> None:
    scene = scenefile.load_scene("spring")
    made = runs(scene, *OWN)
    figure = figures(scene, made)["error"]
    title = " ".join(figure.get_suptitle().split())
    assert title == "Largest distance from the exact solution 4.9 % to 171 %"
    title = " ".join(figure.get_supxlabel().split())
    assert re.search(
        r"exact solution 4\.9 % \(semi-implicit Euler, kick-drift\) to 171 % \(explicit Euler\)$",
        title,
    ), title


def test_a_file_of_any_program_says_what_it_does_and_joins_no_frames_too_far_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from springcheck.cli import drawing

    said: list[Any] = []
    drawn = render.picture
    monkeypatch.setattr(render, "picture", lambda bank: said.append(bank) or drawn(bank))
    monkeypatch.chdir(tmp_path)
    for step, dots in ((0.1, False), (1.7, True)):
        t = step * np.arange(400)
        rows = np.stack([t, np.exp(0.01 * t) * np.cos(t), -np.exp(0.01 * t) * np.sin(t)], axis=1)
        np.savetxt("mine.csv", rows, delimiter=",", header="t,q,p", comments="", fmt="%.17g")
        drawing.draw_foreign(Path("mine.csv"), Path(f"figures-{dots}"))
        portrait, motion = said[-1].charts
        assert portrait.curves[0].dots == dots
        assert portrait.curves[0].line != dots
        assert motion.curves[0].line
    assert said[0].heading == "mine.csv: 400 frames"


def test_an_exact_line_has_no_chords_over_its_jumps() -> None:
    ys = frames.Frame(-2.0, 2.0)
    x = np.concatenate([np.linspace(-2, -1, 700), np.linspace(1, 2, 700)])
    parted, _ = portraits._parted(x, 0 * x, ys, ys)
    assert np.flatnonzero(np.isnan(parted)).tolist() == [700]


@pytest.mark.parametrize("wide", [1.0, 3.0])
def test_names_of_axes_of_equal_scales_stay_inside_the_picture(tmp_path: Path, wide: float) -> None:
    x = np.linspace(-wide, wide, 9)
    curves = [
        Curve(name=f"own:{name}", group=name, title="a title of a few words", x=x, y=x / wide, marks=True)
        for name in list(looks.LOOKS)[:14]
    ]
    chart = Chart(title="", x=Scale(name="q"), y=Scale(name="p"), curves=curves, equal=True)
    with style.style():
        figure = render.picture(Bank(title="", charts=[chart]))
        style.save(figure, tmp_path, "a")
    assert figure.axes[0].yaxis.label.get_window_extent().x0 >= 0


@pytest.mark.parametrize(("high", "labels"), [(1.2, 3), (1e4, 5)])
def test_a_logarithmic_axis_can_be_read_however_short_it_is(high: float, labels: int) -> None:
    """From 0.14 to 1.2, as what <q**2> is off by thermostats, there is one power of ten alone."""
    y = np.geomspace(0.14, high, 9)
    curves = [Curve(name="own:euler", group="explicit-euler", x=np.arange(9), y=y, line=True)]
    chart = Chart(title="", x=Scale(name="t"), y=Scale(name="error", log=True), curves=curves)
    (axes,) = render.picture(Bank(title="", charts=[chart])).axes
    axes.figure.draw_without_rendering()
    (low, top), ticks = axes.get_ylim(), (*axes.yaxis.get_major_ticks(), *axes.yaxis.get_minor_ticks())
    assert len([x for x in ticks if low <= x.get_loc() <= top and x.label1.get_text()]) >= labels


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"a": 1e-3, "b": 0.5}, "off by 0.1 % (a) to 50 % (b)"),
        ({"a": 1e-3, "b": np.nan}, "off by 0.1 % (a); b leaves the chart"),
        ({"a": 1e-3, "b": 11.0, "c": np.inf}, "off by 0.1 % (a); 2 of 3 leave the chart"),
        # "3 of 3 leave it" was all that was said, of nothing
        ({"a": 11.0, "b": np.inf}, "2 of 2 leave the chart"),
        ({"a": 11.0}, "a leaves the chart"),
        ({"a": 0.0, "b": 0.0}, "off by 0 (a)"),
        ({}, ""),
    ],
)
def test_a_heading_says_who_left_what(numbers: dict[str, float], said: str) -> None:
    assert portraits.extremes(numbers, "off by {}") == said


def test_energies_beyond_double_precision_are_drawn_without_a_warning() -> None:
    """Over the start's energy, which is below 1, the last finite one overflows."""
    scene = scenefile.load_scene("multiple-time-steps")
    found = runs(scene, "own:velocity-verlet")
    assert of_runs(scene, found, found)


def test_a_title_without_names_drops_brackets_within_brackets() -> None:
    said = "largest state error 4e-07 (classical Runge-Kutta (RK4)) to 39 % (explicit Euler)"
    assert overlay.short(said) == "Largest state error 4e-07 to 39 %"
