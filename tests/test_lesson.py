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


def graded(folder: Path, text: str, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    """Exit status and words of the grader for a file."""
    (folder / "mine.py").write_text(text)
    status = _module("grade").main([str(folder / "mine.py"), *options])
    return status, capsys.readouterr().out


VERLET = """
AIMS = {"two": "velocity-verlet"}

def two(q, p, h, force, mass):
    print("noise")
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return %s
"""


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        ("(p + h / 2 * force(q), q)", "(q, p) look exchanged"),
        ("q, (p + h / 2 * force(q)) / mass", "momentum or velocity?"),
        ("q, p + h / 3 * force(q)", "hold it beside"),
    ],
)
def test_a_hint_names_the_slip_and_only_where_it_is_asked_for(
    returned: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out = graded(tmp_path, VERLET % returned, capsys)
    assert status == 1
    assert said not in out
    assert "noise" not in out
    assert out.splitlines()[0] == "two    not yet"
    status, out = graded(tmp_path, VERLET % returned, capsys, "--hint")
    assert said in out
    assert "answer" not in out
    status, out = graded(tmp_path, VERLET % returned, capsys, "--answer")
    assert "answer: The second half kick took the force of the first" in out
    assert graded(tmp_path, VERLET % "q, p + h / 2 * force(q)", capsys)[0] == 0


def test_an_implicit_step_is_told_to_iterate_further(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (LESSON / "exercises.py").read_text()
    out = graded(tmp_path, text, capsys, "--hint")[1].splitlines()
    third = next(i for i, line in enumerate(out) if line.startswith("three"))
    assert "iterate further" in out[third + 1]


def test_what_never_ends_or_cannot_be_read_is_answered_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for text, said in (("def two(:\n", "SyntaxError"), ("import nothing_there\n", "nothing_there")):
        status, out = graded(tmp_path, text, capsys)
        assert (status, out.count("\n")) == (2, 1)
        assert said in out
    assert _module("grade").main([str(tmp_path / "no.py")]) == 2
    assert "no such file" in capsys.readouterr().out
    endless = VERLET.replace('print("noise")', "while True: pass") % "q, p"
    grade = _module("grade")
    monkeypatch.setattr(grade, "SECONDS", 0.2)
    (tmp_path / "mine.py").write_text(endless)
    assert grade.main([str(tmp_path / "mine.py")]) == 1
    assert "does a loop in it never end?" in capsys.readouterr().out


def test_how_to_cite_names_this_version() -> None:
    text = (LESSON.parents[1] / "CITATION.cff").read_text()
    assert re.search(r"^version: (.*)$", text, re.M)[1] == version("springcheck")  # type: ignore[index]
    assert {"cff-version", "message", "title", "authors"} <= set(re.findall(r"^([\w-]+):", text, re.M))
