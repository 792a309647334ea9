"""Scripts under validation/ begin by `arguments`, end by `script`: one line for what their user can mend."""

import ast
import importlib
import re
import runpy
import signal
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from arguments import arguments, script
from springcheck import interrupts
from springcheck.errors import SpringcheckError

FOLDER = Path(__file__).parents[1] / "validation"
SCRIPTS = sorted(path for path in FOLDER.glob("*.py") if "__main__" in path.read_text(encoding="utf-8"))
STARTED_BY_OTHERS = {"forked.py"}
"""No person gives it a command: it reads jobs from a pipe, and what it forks returns as the program does."""


@pytest.fixture(autouse=True)
def _signals_stay_with_pytest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "install", lambda: None)


def test_every_script_is_ended_by_the_one_function_and_looks_at_its_command_line() -> None:
    assert len(SCRIPTS) > 20
    for path in SCRIPTS:
        if path.name not in STARTED_BY_OTHERS:
            text = path.read_text(encoding="utf-8")
            assert text.endswith('\n\nif __name__ == "__main__":\n    script(main)\n'), path.name
            assert re.search(r"arguments\(__doc__|parse_args\(", text), path.name


def _imported(part: ast.stmt) -> list[str]:
    if isinstance(part, ast.ImportFrom):
        return [str(part.module).split(".")[0]]
    return [name.name.split(".")[0] for name in part.names] if isinstance(part, ast.Import) else []


def test_a_script_begins_with_what_tests_need_and_says_in_one_line_what_else_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    project = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    needed = {re.split(r"[^\w-]", line)[0] for line in lines} | {"sksundae", "springcheck"}
    beside = {path.stem for path in FOLDER.glob("*.py")}
    for path in SCRIPTS:
        body = ast.parse(path.read_text(encoding="utf-8")).body
        found = {name for part in body for name in _imported(part)}
        assert found - needed - beside - sys.stdlib_module_names == set(), path.name
    monkeypatch.setitem(sys.modules, "selenium", None)
    monkeypatch.setattr("sys.argv", ["h5web.py"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(FOLDER / "h5web.py"), run_name="__main__")
    assert ended.value.code == 2
    assert re.fullmatch(r"h5web\.py: .*selenium.*\n", capsys.readouterr().err)


def _interrupted() -> int:
    signal.raise_signal(signal.SIGINT)
    return 0


def _mistaken() -> None:
    raise SpringcheckError("no such method")


def _unreadable() -> None:
    Path("missing.csv").open(encoding="utf-8").close()


def _left_behind() -> None:
    try:
        raise KeyboardInterrupt
    finally:
        Path("missing").rmdir()


def _without_a_library() -> None:
    importlib.import_module("no_such_library")


@pytest.mark.parametrize(
    ("main", "status", "said"),
    [
        (_interrupted, 130, "springcheck: interrupted\n"),
        (_mistaken, 2, "mine.py: no such method\n"),
        (_unreadable, 2, "mine.py: [Errno 2] No such file or directory: 'missing.csv'\n"),
        (_without_a_library, 2, "mine.py: No module named 'no_such_library'\n"),
        (_left_behind, 130, "springcheck: interrupted\n"),
        (lambda: 1, 1, ""),
    ],
)
def test_a_script_ends_with_one_line_and_its_status(
    main: Callable[[], int | None],
    status: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("sys.argv", ["somewhere/mine.py"])
    with pytest.raises(SystemExit) as ended:
        script(main)
    assert ended.value.code == status
    assert capsys.readouterr().err == said


def test_an_error_that_an_interrupt_became_is_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Files that cannot be removed, a document that was not printed to its end."""
    monkeypatch.setattr(interrupts, "seen", lambda: True)
    with pytest.raises(SystemExit) as ended:
        script(lambda: 1 // 0)
    assert ended.value.code == 130
    assert capsys.readouterr().err == "springcheck: interrupted\n"


def test_a_defect_of_a_script_keeps_its_traceback() -> None:
    with pytest.raises(ZeroDivisionError):
        script(lambda: 1 // 0)


def test_words_of_a_script_follow_from_its_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    defaults = {"what": ("compare", "write"), "count": 7, "first": int, "fast": False, "files": list[str]()}
    monkeypatch.setattr("sys.argv", ["mine.py"])
    assert vars(arguments(None, **defaults)) == {
        "what": "compare", "count": 7, "first": None, "fast": False, "files": [],
    }  # fmt: skip
    monkeypatch.setattr("sys.argv", ["mine.py", "write", "8", "9", "a", "b", "--fast"])
    assert vars(arguments(None, **defaults)) == {
        "what": "write", "count": 8, "first": 9, "fast": True, "files": ["a", "b"],
    }  # fmt: skip
