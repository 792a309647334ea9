"""The census of teaching code: its table is what its script judges."""

from __future__ import annotations

import csv
import runpy
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "validation" / "teaching"


def test_five_steps_are_judged_as_the_table_has_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert runpy.run_path(str(FOLDER / "census.py"))["main"]("--check") == 0
    assert capsys.readouterr().out == "as in census.csv\n"


def test_the_table_has_forty_steps_with_their_sources() -> None:
    with (FOLDER / "census.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len({row["step"] for row in rows}) == len(rows) == 40
    assert all(row["source"] and row["named"] and row["read"] in ("excerpt", "memory") for row in rows)
    assert {row["as_named"] == "-" for row in rows if not row["scheme"]} == {True}
