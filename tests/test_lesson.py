"""The lesson: it prints what it shows, its page is its notebook, and its exercises are what they say."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import pytest

from springcheck.identify import identify_stepper

LESSON = Path(__file__).parents[1] / "validation" / "lesson"


def _module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, LESSON / f"{name}.py")
    assert spec
    assert spec.loader
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def test_the_lesson_prints_what_stands_in_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert _module("build").main(["--check"]) == 0, capsys.readouterr().out


def test_the_notebook_is_one() -> None:
    notebook = json.loads((LESSON / "lesson.ipynb").read_text())
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    names = [cell["id"] for cell in notebook["cells"]]
    assert len(set(names)) == len(names)
    for cell in notebook["cells"]:
        needed = {"cell_type", "id", "metadata", "source"}
        if cell["cell_type"] == "code":
            needed |= {"execution_count", "outputs"}
        assert set(cell) == needed


def test_what_the_lesson_points_to_is_there() -> None:
    for name in ("lesson.md", "README.md"):
        text = (LESSON / name).read_text()
        for target in re.findall(r"\]\(([^)#]+)\)", text):
            assert target.startswith("https://") or (LESSON / target).exists(), target


AIMS = _module("exercises").AIMS


@pytest.mark.parametrize("name", AIMS)
def test_an_exercise_is_broken_and_its_solution_is_not(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(LESSON)
    exercises, solutions = _module("exercises"), _module("solutions")
    broken = identify_stepper(getattr(exercises, name))
    assert not (broken.fits and broken.scheme == AIMS[name])
    mended = identify_stepper(getattr(solutions, name))
    assert mended.fits
    assert mended.scheme == AIMS[name]


def test_the_grader_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    exercises = (LESSON / "exercises.py").read_text()
    mended = exercises.replace("    return q + h * p / mass, p + h * force(q)\n", "    return 1.0\n", 1)
    short = re.sub(r'    "(three|four|five|six)": .*\n', "", mended)
    (tmp_path / "exercises.py").write_text(short)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "exercises", raising=False)
    assert _module("grade").main(["exercises.py"]) == 1
    said = capsys.readouterr().out
    assert "0 of 2" in said
    assert "it is no stepper" in said
    (tmp_path / "right.py").write_text((LESSON / "solutions.py").read_text())
    assert _module("grade").main(["right.py"]) == 0
    assert "2 of 2" in capsys.readouterr().out


def test_how_to_cite_names_this_version() -> None:
    text = (LESSON.parents[1] / "CITATION.cff").read_text()
    assert re.search(r"^version: (.*)$", text, re.M)[1] == version("springcheck")  # type: ignore[index]
    assert {"cff-version", "message", "title", "authors"} <= set(re.findall(r"^([\w-]+):", text, re.M))
