"""What `import springcheck` offers: its names are pinned, short to look at, and take a name for an object."""

from __future__ import annotations

import inspect
import os
import pydoc
import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import springcheck
from springcheck.api import studies as api
from springcheck.errors import SpringcheckError
from springcheck.physics.terms import Quartic
from springcheck.physics.trajectory import Comparison
from springcheck.studies import STUDIES

NAMES = [
    "Scene", "Trajectory", "Verdict", "__version__", "chain", "compare", "exact",
    "explain", "extremes", "identify", "judge", "load_scene", "methods", "plot", "precision",
    "read", "report", "run", "sampling", "simulate", "spring", "stability",
]  # fmt: skip


def test_the_names_are_these_and_each_is_there() -> None:
    assert dir(springcheck) == sorted(springcheck.__all__) == NAMES
    for name in NAMES:
        assert getattr(springcheck, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'integrate'"):
        springcheck.integrate  # noqa: B018


def test_each_study_has_its_function_and_no_function_is_of_a_study_that_is_gone() -> None:
    assert {study.name for study in STUDIES} <= set(NAMES)
    used = set(re.findall(r"springcheck\.studies\.(\w+)", inspect.getsource(api)))
    assert {name for name in used if find_spec(f"springcheck.studies.{name}") is None} == set()


@pytest.mark.parametrize("name", ["simulate", "compare", "identify", "run", "precision", "report"])
def test_help_of_a_function_is_its_own_text_whatever_room_has_its_name(name: str) -> None:
    from springcheck import api
    from springcheck.identify import files

    assert files.__name__ == "springcheck.identify.files"
    found = getattr(springcheck, name)
    assert found is getattr(api, name)
    shown = pydoc.plain(pydoc.render_doc(found))
    assert shown.startswith(f"Python Library Documentation: function {name} in module springcheck.api.")
    assert inspect.cleandoc(found.__doc__).splitlines()[0] in shown


def test_run_is_the_whole_job_and_simulate_one_method(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    report = springcheck.run("spring", "own:*euler", path="spring.h5")
    assert report.status == 0
    assert Path("spring.h5").is_file()
    alone = springcheck.simulate("spring", "own:euler")
    assert np.array_equal(springcheck.read("spring.h5")["own:euler"].q, alone.q)
    verdicts = springcheck.judge("spring", alone)
    assert [v.passed for v in verdicts if v.passed is not None] == [True] * sum(
        v.passed is not None for v in verdicts
    )
    by_file = springcheck.identify("spring.h5")
    (by_arrays, by_object) = (
        springcheck.identify(alone.t, alone.q[:, 0], alone.p[:, 0]),
        springcheck.identify(alone),
    )
    assert {by_file["own:euler"].scheme, by_arrays.scheme, by_object.scheme} == {by_object.scheme}
    assert by_object.scheme == "explicit-euler"


def test_the_exact_solution_of_the_unit_spring_is_the_sine() -> None:
    found = springcheck.exact("spring")
    np.testing.assert_allclose(found.q[:, 0], np.sin(found.t), rtol=0, atol=4e-15)
    same = springcheck.compare("spring", [found, springcheck.simulate("spring", "own:implicit-euler")])
    assert same.labels == ("exact", "own:implicit-euler")
    assert same.max_difference[0, 1] > 0.1


def test_what_is_shown_is_short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = springcheck.simulate("spring", "own:euler")
    assert repr(run) == "Trajectory('own:euler', 201 frames, 1 particle, t = 0 to 20, complete)"
    shown = Comparison(labels=("a", "<b>"), max_difference=np.array([[0, 0.5], [0.5, 0]]))
    assert repr(shown) == "Comparison of a, <b>: differences up to 0.5"
    none = np.full((3, 3), np.nan)
    none[1, 0] = none[0, 1] = 0.5
    for labels, said in (
        ("a", "no two runs to compare"),
        ("ab", "differences up to 0.5"),
        ("abc", "differences up to 0.5 between those that are complete"),
    ):
        size = len(labels)
        compared = Comparison(labels=tuple(labels), max_difference=none[:size, :size])
        assert repr(compared) == f"Comparison of {', '.join(labels)}: {said}"
    assert "nan" not in repr(Comparison(labels=("a", "b"), max_difference=none[1:, 1:]))
    spring = springcheck.load_scene("spring")
    assert repr(spring) == "Scene('spring', 1 particle, 1 wall-spring, 200 steps of 0.1)"
    start = springcheck.judge(spring, run)[0]
    assert repr(start) == "Verdict(own:euler start: passed, 0 of 0)"
    report = springcheck.run(spring, "own:euler", path="shown.h5")
    found = springcheck.identify(run, mass=1.0)
    assert repr(found) == "Identification(named: Explicit Euler: double arithmetic explains every step)"
    assert str(found).startswith("the states: explicit-euler, 1 step per frame\n")
    assert "  stiffness:              1\n" in str(found)
    assert repr(report).startswith("Report('spring', 1 method: ")
    assert len(repr(report)) < 100


def test_what_is_no_scene_and_no_trajectory_is_refused_in_one_line() -> None:
    chain = springcheck.load_scene("chain")
    coupled = replace(
        chain, terms=(*chain.terms, Quartic(i=np.array([0]), b=np.array([-9.0]), at=np.array([0.1])))
    )
    run = springcheck.simulate("spring", "own:euler")
    for call, words in (
        (lambda: springcheck.simulate(3, "own:euler"), "scene = 3: a Scene or a text or a path is needed"),
        (lambda: springcheck.judge("spring", "spring.h5"), "a Trajectory is needed"),
        (lambda: springcheck.judge("sprung", run), "spring"),
        (lambda: springcheck.identify(run.t), "needs t, q and p"),
        (lambda: springcheck.exact(coupled), "no reference solution: "),
    ):
        with pytest.raises(SpringcheckError, match=words) as refused:
            call()
        assert "\n" not in str(refused.value)


def test_plots_go_onto_axes_of_ones_own() -> None:
    mpl.use("agg")
    from matplotlib.figure import Figure

    one, other = (springcheck.simulate("spring", f"own:{name}") for name in ("euler", "implicit-euler"))
    for draw, x, y in (
        (springcheck.plot.phase, one.q[:, 0], one.p[:, 0]),
        (springcheck.plot.position, one.t, one.q[:, 0]),
        (springcheck.plot.energy, one.t, (one.energy - one.energy[0]) / one.energy[0]),
    ):
        axes = Figure().add_subplot()
        assert draw(one, other, ax=axes) is axes
        np.testing.assert_array_equal(axes.lines[0].get_xydata(), np.column_stack([x, y]))
        assert [line.get_label() for line in axes.lines] == [one.label, other.label]
    assert springcheck.plot.phase(one).lines


def test_a_trajectory_is_a_table_where_the_libraries_are_there() -> None:
    run = springcheck.simulate("chain", "own:euler")
    if not os.environ.get("SPRINGCHECK_REQUIRE_TOOLS"):
        pytest.importorskip("pandas")
        pytest.importorskip("xarray")
    table = run.to_dataframe()
    assert np.array_equal(table["q1"].to_numpy(), run.q[:, 1])
    assert np.array_equal(table["energy"].to_numpy(), run.energy)
    assert np.array_equal(table.index.to_numpy(), run.t)
    assert np.array_equal(run.to_xarray()["p"].to_numpy(), run.p)


def test_a_library_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(SpringcheckError, match="python -m pip install pandas"):
        springcheck.simulate("spring", "own:euler").to_dataframe()
