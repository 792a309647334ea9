"""The lesson: it prints what it shows, its page is its notebook, and its exercises are what they say."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import re
import runpy
import subprocess
import sys
import zipfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from springcheck.bath import THERMOSTATS, Law
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


def test_the_ten_minutes_print_what_stands_in_them() -> None:
    text, known = (LESSON / "ten-minutes.md").read_text(encoding="utf-8"), dict[str, Any]()
    parts = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", text, flags=re.DOTALL)
    assert len(parts) == 3
    for code, printed in parts:
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(code, known)
        assert out.getvalue() == printed


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
    for name in ("lesson.md", "README.md", "ten-minutes.md"):
        text = (LESSON / name).read_text()
        targets = re.findall(r"\]\(([^)#]+)\)", text)
        assert targets
        for target in targets:
            assert target.startswith("https://") or (LESSON / target).exists(), target


def test_what_learners_are_given_is_one_file_that_works_anywhere_and_has_no_solutions(
    tmp_path: Path,
) -> None:
    assert _module("build").main(["--take-along", str(tmp_path / "lesson.zip")]) == 0
    with zipfile.ZipFile(tmp_path / "lesson.zip") as file:
        file.extractall(tmp_path)
    there = {path.name for path in (tmp_path / "lesson").iterdir()}
    assert {"lesson.ipynb", "exercises.py", "grade.py", "temperature.py", "figures"} <= there
    assert not any("solutions" in name for name in there)
    command = [sys.executable, "grade.py", "temperature.py"]
    graded = subprocess.run(command, cwd=tmp_path / "lesson", capture_output=True, text=True, check=False)
    assert graded.returncode == 1
    assert graded.stdout.endswith("0 of 6; --hint says where to look\n")


def test_every_picture_of_the_lesson_says_in_words_what_it_shows() -> None:
    said = re.findall(r"!\[([^]]*)\]\(figures/", (LESSON / "lesson.md").read_text())
    assert len(said) == len(list((LESSON / "figures").iterdir()))
    assert all(len(words) > 80 and re.search(r"\d", words) for words in said)


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


@pytest.mark.parametrize("option", ["--hint", "--answer"])
def test_an_aim_by_another_name_is_told_in_a_line_and_one_that_identify_names_has_a_hint(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = VERLET.replace("two", "mine") % "(q, p + h / 3 * force(q))"
    status, out = graded(tmp_path, text.replace("velocity-verlet", "leapfrog"), capsys, option)
    assert status == 2
    assert out == (
        "mine.py: AIMS: mine: 'leapfrog' is no scheme here, did you mean velocity-verlet or "
        "semi-implicit-euler?\n"
    )
    status, out = graded(tmp_path, text.replace("velocity-verlet", "pefrl"), capsys, option)
    assert status == 1
    assert "hold it beside PEFRL" in out


def test_the_answer_is_given_to_who_asks_for_it_and_what_is_right_passes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, out = graded(tmp_path, VERLET % "q, p + h / 3 * force(q)", capsys, "--answer")
    assert "answer: The second half kick took the force of the first" in out
    assert graded(tmp_path, VERLET % "q, p + h / 2 * force(q)", capsys)[0] == 0


def test_an_implicit_step_is_told_to_iterate_further(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = re.sub(r'    "(one|two|four|five|six)": .*\n', "", (LESSON / "exercises.py").read_text())
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


QUESTIONS = _module("temperature_questions").QUESTIONS
SLIPS = [(name, said) for name, question in QUESTIONS.items() for said in question.slips]


def test_the_functions_of_temperature_are_not_yet_right_and_their_solutions_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    grade = _module("grade")
    assert grade.main([str(LESSON / "temperature.py")]) == 1
    out = capsys.readouterr().out
    assert out.count("not yet") == len(QUESTIONS) == 6
    assert out.count("nothing is returned") == 5
    assert "0 of 6" in out
    assert grade.main([str(LESSON / "temperature.py"), "--hint"]) == 1
    hints = capsys.readouterr().out
    assert hints.count("look: ") == 6
    assert "friction lasts too long" in hints
    assert "sqrt(m) is missing" in hints
    assert grade.main([str(LESSON / "temperature.py"), "--answer"]) == 1
    assert "answer: Each O lasts half a step" in capsys.readouterr().out
    assert grade.main([str(LESSON / "temperature_solutions.py")]) == 0
    assert "6 of 6" in capsys.readouterr().out


@pytest.mark.parametrize(("name", "said"), SLIPS)
def test_a_common_mistake_about_temperature_gets_its_sentence(name: str, said: str) -> None:
    right, _, look = _module("grade").answered(QUESTIONS[name].slips[said], QUESTIONS[name])
    assert (right, look) == (False, said)


def _baoab_of_a_negative_root(q, p, h, force, mass, gamma, kT, xi):  # type: ignore[no-untyped-def]
    c = np.exp(-gamma * h)
    p = p + h / 2 * force(q)
    q = q + h / 2 * p / mass
    p = c * p - np.sqrt(mass * kT * (1 - c * c)) * xi
    q = q + h / 2 * p / mass
    return q, p + h / 2 * force(q)


def _obabo_of_the_second_draw_first(q, p, h, force, mass, gamma, kT, xi):  # type: ignore[no-untyped-def]
    c = np.exp(-gamma * h / 2)
    s = np.sqrt(mass * kT * (1 - c * c))
    p = c * p + s * xi[1] + h / 2 * force(q)
    q = q + h * p / mass
    return q, c * (p + h / 2 * force(q)) + s * xi[0]


def _error_of_any_number(n, r):  # type: ignore[no-untyped-def]
    return (2 / n * (1 + 2 * sum((1 - j / n) * r ** (2 * j) for j in range(1, n)))) ** 0.5


@pytest.mark.parametrize(
    ("name", "answer"),
    [
        ("baoab", _baoab_of_a_negative_root),
        ("obabo", _obabo_of_the_second_draw_first),
        ("error", _error_of_any_number),
    ],
)
def test_another_right_answer_about_temperature_is_right(name: str, answer: Callable[..., Any]) -> None:
    """Draws are as likely as their opposites, and in either order; the law of few states holds for many."""
    right, said, _ = _module("grade").answered(answer, QUESTIONS[name])
    assert right, said


def test_an_implicit_step_that_is_solved_for_springs_alone_is_told_so() -> None:
    """It was told to iterate further, and has no iteration."""

    def solved(q, p, h, force, mass):  # type: ignore[no-untyped-def]
        k = force(0.0) - force(1.0)
        q = (q + h * p / mass) / (1 + h * h * k / mass)
        return q, p + h * force(q)

    right, _, look = _module("grade").judge(solved, "implicit-euler", look=True)
    assert not right
    assert look == "it is right for a force that is proportional to q; solve the equation for any force"


def test_what_the_grader_holds_for_right_is_what_the_laws_of_thermostats_say() -> None:
    m, k, rate, kT, h = 1.7, 2.9, 0.8, 0.6, 0.4
    w = (k / m) ** 0.5

    def law(name: str) -> Law:
        return Law(scheme=THERMOSTATS[name], h=h, m=np.array([m]), k=np.array([k]), rate=rate, thermal=kT)

    for name, draws in (("baoab", 1), ("obabo", 2)):
        columns = []
        for unit in np.eye(2 + draws):
            xi = unit[2] if draws == 1 else unit[2:]
            columns.append(QUESTIONS[name].right(*unit[:2], h, lambda q: -k * q, m, rate, kT, xi))
        found = np.array(columns).T
        assert found == pytest.approx(np.hstack([law(name).A[0], law(name).G[0]]).astype(float), rel=1e-12)
        S = QUESTIONS["stationary"].right(found[:, :2], found[:, 2:])
        assert law(name).covariance[0] == pytest.approx(S, rel=1e-12, abs=1e-15)
    kinetic = [kT * law(name).kinetic[0] for name in ("baoab", "baoa")]
    assert QUESTIONS["kinetic"].right(h, w, kT) == pytest.approx(kinetic, rel=1e-12)
    hot = law("obabo").configurational[0]
    assert QUESTIONS["configurational"].right(h, w) == pytest.approx(hot, rel=1e-12)
    n, r = 1000, 0.6
    correlation = r ** (2.0 * np.abs(np.subtract.outer(np.arange(n), np.arange(n))))
    # the ends have neighbours on one side alone: a share r**2/(n (1 - r**4)) of the whole
    assert QUESTIONS["error"].right(n, r) == pytest.approx((2 * correlation.mean()) ** 0.5, rel=1 / n)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        ("def error(n, r):\n    return 1 / 0\n", "it is no answer: ZeroDivisionError"),
        ("def error(n, r):\n    return n, r\n", "its shape is (2,)"),
        ("def error(n, r):\n    n, r\n", "nothing is returned"),
        (
            "def error(n, r):\n    return (2 / n * (1 + r * r) / (1 - r * r)) ** 0.5 + 1e-13\n",
            "error           not yet",
        ),
    ],
)
def test_an_answer_that_is_none_is_told_in_a_line(
    function: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out = graded(tmp_path, function, capsys)
    assert status == 1
    assert said in out
    assert "mine.py has no function baoab" in out
    assert out.count("\n") == 7


def test_a_grader_without_its_questions_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("grade.py", "temperature.py"):
        (tmp_path / name).write_text((LESSON / name).read_text())
    alone = runpy.run_path(str(tmp_path / "grade.py"), run_name="alone")
    assert alone["main"]([str(tmp_path / "temperature.py")]) == 2
    assert "need temperature_questions.py beside grade.py" in capsys.readouterr().out


def test_an_iteration_that_ends_early_is_told_to_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = """
import numpy as np

def stationary(A, G):
    S = G @ G.T
    for _ in range(%d):
        S = A @ S @ A.T + G @ G.T
    return S
"""
    assert "right to nine digits, not to rounding" in graded(tmp_path, text % 52, capsys, "--hint")[1]
    assert "stationary      right" in graded(tmp_path, text % 500, capsys)[1]


def test_how_to_cite_names_this_version() -> None:
    text = (LESSON.parents[1] / "CITATION.cff").read_text()
    assert re.search(r"^version: (.*)$", text, re.M)[1] == version("springcheck")  # type: ignore[index]
    assert {"cff-version", "message", "title", "authors"} <= set(re.findall(r"^([\w-]+):", text, re.M))
