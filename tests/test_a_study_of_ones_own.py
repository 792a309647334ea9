"""A study is a folder and a line in the list: commands, inspect, plot and report then know it, unedited."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from springcheck import cli, store
from springcheck.cli import inspect

MEASURE = """
from dataclasses import dataclass, replace
from pathlib import Path
from springcheck.studies import keeper
from springcheck.studies.keeper import Piece
from springcheck.studies.tables import Rows
from springcheck.text.lines import table

@dataclass(frozen=True, kw_only=True)
class Square:
    number: int
    square: float

@dataclass(frozen=True, kw_only=True)
class Squares:
    rows: tuple
    status: int = 0
    def lines(self, options=None):
        return [table(("number", "square"), [(str(x.number), str(x.square)) for x in self.rows])]
    def document(self):
        return keeper.plain({"largest": max(x.square for x in self.rows), "nothing": float("nan")})

FORM = Rows(kind=Square, beginning="squares/", named="")

def piece(i):
    return [Square(number=i, square=float(i * i))]

def perform(options, progress):
    from functools import partial
    with keeper.kept(options.output, "squares", force=options.force, progress=progress) as kept:
        parts = [(str(i), partial(piece, i)) for i in range(4)]
        pieces = [Piece(key=key, what=f"square of {key}", measure=part, form=FORM) for key, part in parts]
        found = Squares(rows=tuple(x for rows in kept.results(pieces) for x in rows))
        kept.commit("squares", found.document())
    return found

@keeper.restoring("squares")
def stored(kept):
    return Squares(rows=tuple(x for i in range(4) for x in kept.found(FORM, str(i))))
"""
PAGE = """
from springcheck.figures.charts import Bank, Chart, Curve, Scale
def banks(found):
    numbers, squares = ([getattr(x, name) for x in found.rows] for name in ("number", "square"))
    line = Curve(name="squares", group="squares", x=numbers, y=squares)
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
    for name, text in (("__init__", STUDY), ("measure", MEASURE), ("page", PAGE)):
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
