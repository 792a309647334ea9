"""What the README and the documents beside it show works when pasted, and their links lead somewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

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


def test_a_term_that_is_pasted_as_the_readme_says_is_served(tmp_path: Path) -> None:
    (term,) = (block for block in blocks("python", DATA) if "class Sextic" in block)
    (tmp_path / "sextic.py").write_text(term)
    (scene,) = (block for block in blocks("toml", DATA) if "sextic" in block)
    (tmp_path / "well.toml").write_text(scene)
    done = subprocess.run(
        [sys.executable, "-m", "springcheck", "run", "well.toml", "--engine", "sextic.py",
         "--method", "ase:*", "--method", "own:*euler", "--method", "sundials:*"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    # no exact solution is known of it, so nothing tells how far a solver may be off
    assert done.returncode == 2, done.stdout + done.stderr
    assert "not judged: sundials:adams, sundials:bdf: nothing" in done.stdout
    assert "not judged: ase" not in done.stdout
    assert "ase:velocity-verlet" in done.stdout
    assert "0 failed" in done.stdout


def test_the_table_of_terms_has_every_term_with_its_formula_and_columns() -> None:
    for term in known().values():
        assert term.formula in DATA, term.key
        for column in term.columns:
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
        if "class Sextic" not in block:
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
