"""A study is a folder and a line in the list: commands, inspect, plot and report then know it, unedited."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from springcheck import cli, store
from springcheck.cli import inspect

MEASURE = """
from dataclasses import dataclass
from functools import partial
from squares_study.result import FORM, Square, Squares
from springcheck.studies import keeper
from springcheck.studies.keeper import Piece

def squared(i):
    return [Square(method=str(i), square=float(i * i))]

def perform(options, progress):
    pieces = [Piece(key=str(i), what=f"square of {i}", measure=partial(squared, i), form=FORM)
              for i in range(4)]
    def measure(kept):
        return Squares(rows=tuple(x for rows in kept.results(pieces) for x in rows), about="squares")
    return keeper.study("squares", options.output, [], measure, force=options.force, progress=progress)
"""
RESULT = """
from dataclasses import dataclass
from typing import ClassVar
from springcheck.figures.charts import Bank, Chart, Curve, Scale
from springcheck.studies import keeper
from springcheck.studies.study import Studied
from springcheck.studies.tables import Rows
from springcheck.text.lines import table

@dataclass(frozen=True, kw_only=True)
class Square:
    method: str
    square: float

FORM = Rows(kind=Square, beginning="squares/")

@dataclass(frozen=True, kw_only=True)
class Squares(Studied):
    forms: ClassVar = {"rows": FORM}
    rows: tuple
    about: str
    status: ClassVar = 0
    title: ClassVar = "Squares of whole numbers"

    def tables(self):
        return [table(("number", "square"), [(x.method, str(x.square)) for x in self.rows])]

    def document(self):
        return keeper.plain({"largest": max(x.square for x in self.rows), "nothing": float("nan")})

    def banks(self, **chosen):
        numbers = [float(x.method) for x in self.rows]
        line = Curve(name="squares", group="squares", x=numbers, y=[x.square for x in self.rows])
        chart = Chart(title="Squares.", x=Scale(name="number"), y=Scale(name="square"), curves=[line])
        return [Bank(name="squares", title="Drawn", charts=[chart])]
"""
STUDY = """
from springcheck.studies.arguments import store_arguments
from springcheck.studies.study import Study
STUDY = Study(
    name="squares",
    about="squares of whole numbers",
    arguments=store_arguments("squares.h5"),
    package="squares_study",
)
"""


def test_a_folder_and_a_line_make_a_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "squares_study"
    folder.mkdir()
    for name, text in (("__init__", STUDY), ("measure", MEASURE), ("result", RESULT)):
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    import squares_study  # type: ignore[import-not-found]

    for module in (cli, inspect):
        monkeypatch.setattr(module, "STUDIES", (*module.STUDIES, squares_study.STUDY))
    assert cli.main(["squares", "-o", "squares.h5"]) == 0
    out = capsys.readouterr().out
    assert "9.0" in out
    assert cli.main(["squares", "-o", "squares.h5"]) == 2
    assert "--force" in capsys.readouterr().err
    assert store.check("squares.h5") == []
    assert cli.main(["inspect", "squares.h5"]) == 0
    assert "9.0" in capsys.readouterr().out
    assert cli.main(["inspect", "squares.h5", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["studies"] == {"squares": {"largest": 9.0, "nothing": None}}
    assert cli.main(["plot", "squares.h5", "-o", "pictures"]) == 0
    assert (tmp_path / "pictures" / "squares.png").stat().st_size > 1000
    assert cli.main(["report", "squares.h5"]) == 0
    assert "9.0</td>" in (report := (tmp_path / "squares.html").read_text())
    assert "Squares." in report
    for name in [name for name in sys.modules if name.startswith("squares_study")]:
        del sys.modules[name]
