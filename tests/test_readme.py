"""What the README and the documents beside it show works when pasted, and their links lead somewhere."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import springcheck
from springcheck.physics.terms import known

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
DATA = (ROOT / "data" / "README.md").read_text()
DOCUMENTS = sorted(
    path
    for path in (
        ROOT / "README.md",
        *ROOT.glob("*/README.md"),
        *ROOT.glob(".github/*.md"),
        *ROOT.glob("src/**/README.md"),
    )
    if path.exists()
)


def blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.S)


@pytest.mark.parametrize(("name", "scene"), [("Sextic", "sextic"), ("Yukawa", "yukawa")])
def test_a_term_that_is_pasted_goes_through_every_command(name: str, scene: str, tmp_path: Path) -> None:
    (term,) = (block for block in blocks("python", DATA) if f"class {name}" in block)
    assert len(term.splitlines()) <= 40
    (tmp_path / "term.py").write_text(term)
    (text,) = (block for block in blocks("toml", DATA) if f"[[{scene}]]" in block)
    (tmp_path / "well.toml").write_text(text)

    def done(*words: str) -> str:
        command = [sys.executable, "-m", "springcheck", *words, "--engine", "term.py"]
        found = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
        assert found.returncode == 0, found.stdout + found.stderr
        return found.stdout

    said = done("run", "well.toml", "-o", "well.h5")
    assert "0 failed" in said
    for method in ("own:euler", "ase:velocity-verlet", "sundials:bdf"):
        assert method in said
    assert (name == "Yukawa") == ("openmm:verlet  " in said)
    done("plot", "well.h5")
    done("report", "well.h5", "-o", "well.html")
    done("precision", "well.toml", "--method", "own:rk4", "--budget", "3", "--quiet")
    done(
        "judge", "well.h5", "--scene", "well.toml", "--scheme", "explicit-euler", "--trajectory", "own:euler"
    )


def test_the_table_of_terms_has_every_term_with_its_formula_and_columns() -> None:
    for term in known().values():
        assert term.formula in DATA, term.key
        for column in (x for x in term.columns if x.field != "number"):
            assert f"`{column.name}`" in DATA, (term.key, column.name)


def test_the_scene_of_the_readme_is_read(tmp_path: Path) -> None:
    scene = next(block for block in blocks("toml", DATA) if "R. Ghosh" in block)
    (tmp_path / "shown.toml").write_text(scene)
    assert springcheck.load_scene(tmp_path / "shown.toml").steps == 200


def test_the_python_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from springcheck.cli import main

    monkeypatch.chdir(tmp_path)
    assert main(["run", "spring", "--method", "own:*euler", "--method", "openmm:verlet", "--quiet"]) == 0
    for block in (*blocks("python"), *blocks("python", DATA)):
        if "@register" not in block:
            exec(compile(block, "README", "exec"), {})


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_what_a_document_names_is_there(document: Path) -> None:
    text = document.read_text()
    for path in re.findall(r"`((?:validation|data|src|tests)/[\w/.-]+)`", text):
        assert (ROOT / path).exists(), path
    for link in re.findall(r"\]\((?!https?:)([^)#]+)\)", text):
        assert (document.parent / link).exists(), link


@pytest.mark.parametrize(
    ("document", "most"),
    [("README.md", 900), ("validation/README.md", 1500), (".github/CHANGELOG.md", 300)],
)
def test_a_document_ends(document: str, most: int) -> None:
    assert len((ROOT / document).read_text(encoding="utf-8").split()) <= most


def test_the_package_page_has_no_link_into_a_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a package index a relative link is dead: Hatch's hook makes addresses of them."""
    plugin = ModuleType("hatchling.metadata.plugin.interface")
    plugin.MetadataHookInterface = object  # type: ignore[attr-defined]
    for name in ("hatchling", "hatchling.metadata", "hatchling.metadata.plugin", plugin.__name__):
        monkeypatch.setitem(sys.modules, name, plugin)
    hook = runpy.run_path(str(ROOT / ".github" / "readme.py"))["Readme"]()
    hook.root = str(ROOT)
    found: dict[str, Any] = {"urls": {"Source": "https://example.org/springcheck"}}
    hook.update(found)
    text = found["readme"]["text"]
    assert "](https://example.org/springcheck/raw/HEAD/data/figures/phase-portrait.png)" in text
    assert re.findall(r"\]\((?!https?:)[^)]+\)", text) == []
