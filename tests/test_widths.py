"""No number, label or method is ever cut: at no width of a terminal from 60 columns on, in a pipe at none."""

from __future__ import annotations

import os
import random
import re
from collections import Counter
from pathlib import Path

import pytest

from springcheck.cli import main
from springcheck.text.lines import COLUMN_GAP, TextTable, drawn, table

WIDTHS = (60, 80, 100, 200)


def bare(text: str) -> str:
    """Without colours."""
    return re.sub(r"\x1b\[[0-9;]*m", "", text)


Patch, Captured = pytest.MonkeyPatch, pytest.CaptureFixture[str]


def shown(arguments: list[str], width: int | None, monkeypatch: Patch, capsys: Captured) -> str:
    """What a command prints on a terminal so wide, or in a pipe."""
    capsys.readouterr()
    with monkeypatch.context() as patch:
        patch.setattr("sys.stdout.isatty", lambda: width is not None, raising=False)
        patch.setenv("COLUMNS", str(width or 1))
        assert main(arguments) in (0, 1)
    return bare(capsys.readouterr().out)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of a run with a long title, and one of each study."""
    here = tmp_path_factory.mktemp("stores")
    before = Path.cwd()
    os.chdir(here)
    try:
        own = ["--method", "own:euler", "--method", "own:semi-implicit-euler", "--quiet"]
        assert main(["run", "chain", *own, "-o", "run.h5"]) == 0
        assert (
            main(["stability", "overdamped", "--method", "own:implicit-euler", "--quiet", "-o", "s.h5"]) == 0
        )
        assert main(["extremes", "--quick", "--method", "own:implicit-euler", "--quiet", "-o", "x.h5"]) == 0
    finally:
        os.chdir(before)
    return here


COMMANDS = [
    ["inspect", "run.h5", "--verdicts"],
    ["inspect", "run.h5", "--trajectory", "own:semi-implicit-euler", "--rows", "7"],
    ["inspect", "s.h5"],
    ["inspect", "x.h5"],
    ["identify", "run.h5"],
    ["list"],
]


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_every_word_of_a_pipe_is_on_every_terminal(
    arguments: list[str], folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    whole = Counter(shown(arguments, None, monkeypatch, capsys).split())
    assert sum(whole.values()) > 20
    for width in WIDTHS:
        text = shown(arguments, width, monkeypatch, capsys)
        assert not whole - Counter(text.split()), width
        if arguments[0] != "list":
            assert max(map(len, text.splitlines())) <= width


def rendered(made: TextTable, width: int) -> list[str]:
    from rich.console import Console

    console = Console(width=width, highlight=False)
    with console.capture() as captured:
        drawn([made], console)
    return captured.get().splitlines()


@pytest.mark.parametrize("seed", range(20))
def test_any_table_fits_any_terminal_with_all_its_cells(seed: int) -> None:
    rng = random.Random(seed)
    titles = ["method", *(f"column{i}" for i in range(rng.randrange(1, 14))), "why"]
    rows = [
        (
            "openmm:semi-implicit-euler"[: rng.randrange(8, 27)],
            *(f"{rng.gauss(0, 1) * 10.0 ** rng.randrange(-99, 99):.{rng.randrange(9)}e}" for _ in titles[2:]),
            " ".join("reason"[: rng.randrange(1, 7)] for _ in range(rng.randrange(1, 40))),
        )
        for _ in range(5)
    ]  # fmt: skip
    whole = Counter(word for row in rows for cell in row for word in cell.split())
    for width in (*WIDTHS, 1 << 16):
        lines = rendered(table(titles, rows, prose="why"), width)
        assert not whole - Counter(" ".join(lines).split())
        assert max(map(len, lines)) <= width
        assert all(line == line.rstrip() for line in lines)
    assert len(lines) == len(rows) + 1
    assert COLUMN_GAP == 2


def test_a_column_without_a_title_is_broken_nowhere() -> None:
    rows = [("8 openmm:semi-implicit-euler", *("6e-15" for _ in range(12)))]
    made = table(["", *map(str, range(12))], rows, left=("",))
    named = rendered(made, 80)[1::3]
    assert named
    assert all(line.startswith("8 openmm:semi-implicit-euler  6e-15") for line in named)


@pytest.mark.parametrize("width", [40, 80])
def test_explanations_break_between_words(width: int, monkeypatch: Patch, capsys: Captured) -> None:
    whole = shown(["explain", "step-defect"], None, monkeypatch, capsys)
    assert max(map(len, whole.splitlines())) > 100
    folded = shown(["explain", "step-defect"], width, monkeypatch, capsys)
    assert max(map(len, folded.splitlines())) <= width
    assert folded.split() == whole.split()
