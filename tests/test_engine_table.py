"""Plug-in files beside the table of engines: an outsider needs `--engine` and the commands alone."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import pytest

from springcheck import engines
from springcheck.errors import MethodError

FOLDER = Path(__file__).parents[1] / "validation/engines"
FILES = sorted(file for file in FOLDER.glob("*.py") if "ENGINE = Engine(" in file.read_text(encoding="utf-8"))


@pytest.fixture(autouse=True)
def _beside_one_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.setattr(engines.registry, "_brought", {})


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_plug_in_file_is_an_engine_and_imports_no_library(file: Path) -> None:
    before = set(sys.modules)
    found = engines.from_file(file)
    assert found is not None
    assert found.methods
    ours = {"springs", "bodies", "springcheck", "numpy"}
    new = {name.partition(".")[0] for name in set(sys.modules) - before}
    assert new <= ours | sys.stdlib_module_names


def test_a_row_is_measured_by_a_plug_in_file_and_the_others_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pymunk")
    import table

    before = (FOLDER / "engines.csv").read_text(encoding="utf-8")
    rows = {row["method"]: row for row in csv.DictReader(before.splitlines())}
    rows["pymunk:force"]["amplitude"] = "0.0"
    monkeypatch.setattr(table, "TABLE", tmp_path / "engines.csv")
    with table.TABLE.open("w", encoding="utf-8") as file:
        writer = csv.DictWriter(file, table.COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows.values())
    words = ["--method", "pymunk:*", "--engine", str(FOLDER / "pymunk_.py")]
    monkeypatch.setattr("sys.argv", ["table.py", *words])
    assert table.main() == 0
    found = {row["method"]: row for row in csv.DictReader(table.TABLE.read_text().splitlines())}
    assert list(found) == list(rows)
    assert {x: found[x]["scheme"] for x in found} == {x: rows[x]["scheme"] for x in rows}
    assert found["pymunk:force"]["amplitude"] == "2.7048"
    assert found["pymunk:damped-spring"]["limit"] == "2.0000"


def test_every_row_of_an_engine_that_the_package_ships_names_one_of_its_methods() -> None:
    with (FOLDER / "engines.csv").open(encoding="utf-8") as file:
        names = [row["method"] for row in csv.DictReader(file)]
    assert len(names) == len(set(names))
    for name in names:
        if name.partition(":")[0] in engines.registry.MODULES:
            try:
                engines.method(engines.parse(name))
            except MethodError as error:
                assert "no platform" in str(error), name  # noqa: PT017
