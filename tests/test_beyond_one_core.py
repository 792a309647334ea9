"""A study measured by several processes is the study measured by one: every number, bit for bit, and every
piece is kept as it is finished."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springcheck import cli, engines, store
from springcheck.physics import scenefile
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.precision import measure as precision
from springcheck.studies.stability import measure as stability
from springcheck.studies.team import Processes
from springcheck.text.wording import count
from stores import raising

OWN = ("own:euler", "own:implicit-euler", "own:semi-implicit-euler")


def values(path: Path) -> dict[str, Any]:
    """Every number and text of the tables of a store, NaN equal to NaN."""
    found = {}
    for name, table in store.tables_of(path).items():
        columns = {key: repr(np.asarray(column).tolist()) for key, column in table.columns.items()}
        found[name] = (columns, repr(sorted(table.attributes.items())), table.signal, table.axes)
    return found


@pytest.mark.parametrize("name", ["extremes", "stability"])
def test_the_stores_of_one_and_of_two_workers_are_equal_value_for_value(
    name: str, tmp_path: Path, whole: bool
) -> None:
    one, two = tmp_path / "one.h5", tmp_path / "two.h5"
    methods = OWN if whole else OWN[:2]
    for path, team in ((one, Processes(1)), (two, Processes(2))):
        if name == "extremes":
            extremes.record(path, methods, quick=True, team=team)
        else:
            stability.record(scenefile.load_scene("overdamped"), path, methods, team=team)
        assert store.check(path) == []
    assert values(one) == values(two)
    assert len(values(one)) >= len(methods)
    assert json.loads(store.document(one, name)) == json.loads(store.document(two, name))


def test_what_workers_have_finished_is_taken_up_by_one_alone(tmp_path: Path) -> None:
    path = tmp_path / "extremes.h5"
    with pytest.raises(KeyboardInterrupt):
        extremes.record(path, OWN, quick=True, team=Processes(2), progress=raising(2))
    kept = values(path)
    assert len(kept) == 1
    atlas = extremes.record(path, OWN, quick=True)
    assert atlas.resumed == 1
    whole = values(path)
    assert {name: whole[name] for name in kept} == kept


@pytest.mark.parametrize("number", ["0", "-1", "two", "1.5", "9999"])
def test_a_senseless_number_of_workers_is_refused(number: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        cli.main(["extremes", "--workers", number])
    assert refused.value.code == 2
    assert "from 1 to 4096" in capsys.readouterr().err


def test_errors_by_workers_are_those_of_one_and_times_are_measured_alone(tmp_path: Path) -> None:
    scene = scenefile.load_scene("spring-uneven")
    labels = [engines.parse(name) for name in OWN]
    began = os.times().children_user
    many = precision.record(scene, labels, tmp_path / "two.h5", budget=1.2, team=Processes(2))
    # CPU time of children: the workers have run, and have ended
    assert os.times().children_user > began
    alone = precision.record(scene, labels, tmp_path / "one.h5", budget=1.0)

    def errors(study: Any) -> dict[Any, Any]:
        return {(x.method, x.steps): x.accuracy for x in study.points if x.complete}

    both = errors(many).keys() & errors(alone).keys()
    # how many of each a budget of seconds pays for depends on who else is at work
    assert {str(method) for method, _ in both} == set(OWN)
    assert all(errors(many)[place] == errors(alone)[place] for place in both)
    for method in OWN:
        points = [point for point in many.of(method) if point.complete]
        timed = [bool(point.run_seconds_repeats) for point in points]
        # coarse to fine: those that are timed come first, no point stands twice
        assert timed == sorted(timed, reverse=True)
        assert len({point.steps for point in points}) == len(points)
    assert any(point.run_seconds_repeats for point in many.points)
    assert precision.stored(tmp_path / "two.h5").points == many.points
    # who measured: the workers' errors and the times of this process
    assert {piece for piece, _ in store.measured_by(tmp_path / "two.h5")} == {f"precision/{x}" for x in OWN}
    first, *others = many.methods
    untimed_first = replace(first.points[0], run_seconds_repeats=())
    fewer = replace(many, methods=(replace(first, points=(untimed_first, *first.points[1:])), *others))
    before, after = (
        sum(x.complete and not x.run_seconds_repeats for x in points)
        for points in (many.points, fewer.points)
    )
    said = "\n".join(map(str, fewer.lines()))
    assert after == before + 1
    assert f"{count(after, 'point')} of errors alone: workers measure no times" in said
