"""`springcheck explain` and `show`: every name has words, and a shown scene is the scene."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from springcheck import checks, engines, schemes
from springcheck.cli import explain, main
from springcheck.errors import SpringcheckError
from springcheck.identify.meanings import MEANINGS
from springcheck.physics import scenefile, terms


@pytest.mark.parametrize("check", checks.ALL, ids=lambda check: check.name)
def test_a_check_says_its_sentence_and_what_it_needs(check: checks.Check) -> None:  # type: ignore[type-arg]
    said = " ".join(" ".join(explain.check_lines(check)).split())
    assert check.sentence in said
    assert check.needs in said


@pytest.mark.parametrize("name", [*schemes.SCHEMES, *schemes.ATTACHED])
def test_a_scheme_says_its_step_and_source(name: str) -> None:
    scheme, said = schemes.scheme(name), list(explain.lines(name))
    assert sum(line.startswith("  ") for line in said) >= max(1, len(scheme.stages), len(scheme.b))
    assert scheme.source in " ".join(" ".join(said).split())


@pytest.mark.parametrize("command", [["explain", "scipy-rk45"], ["judge", "a.csv", "--scheme", "scipy-rk45"]])
def test_a_scheme_that_an_engine_brings_is_known_where_no_engine_is_asked_for(
    command: list[str], tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text("t,q,p\n0,0,1\n0.1,0.0998,0.995\n0.2,0.1987,0.98\n")
    scene = ["--scene", "spring"] if command[0] == "judge" else []
    run = [sys.executable, "-m", "springcheck", *command, *scene]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "Dormand-Prince 5(4), adaptive" in done.stdout, done.stderr


def test_the_steps_are_the_formulas() -> None:
    verlet = ["  p = p + 1/2 h F", "  q = q + h p/m", "  p = p + 1/2 h F"]
    assert list(explain.lines("velocity-verlet"))[1:4] == verlet
    assert "  y = y + h (1/6 f(Y1) + 1/3 f(Y2) + 1/3 f(Y3) + 1/6 f(Y4))" in explain.lines("rk4")
    assert "Order 1; not symplectic; stable on a spring: never" in explain.lines("own:euler")


def test_every_method_is_explained_whether_its_engine_is_here_or_not() -> None:
    assert len(engines.names()) > 5
    for engine in engines.names():
        for method in engines.engine(engine).methods:
            assert next(explain.lines(f"{engine}:{method}")).startswith(f"{engine}:{method}: ")
    assert next(explain.lines("openmm:andersen")).endswith("it collides at most 2/pi as often as asked")


@pytest.mark.parametrize("name", MEANINGS)
def test_a_finding_says_formula_reach_and_limits(name: str) -> None:
    said = " ".join(explain.meaning_lines(MEANINGS[name]))
    assert MEANINGS[name].formula in said
    assert "Does not see: " in said


def test_findings_of_identify_have_their_words() -> None:
    assert {"old-force", "halves-swapped", "velocity-offset", "not-told-apart"} <= set(MEANINGS)
    # a word of two meanings has both
    said = " ".join(" ".join(explain.lines("determinant")).split())
    assert "a check of the map" in said


@pytest.mark.parametrize(
    ("name", "unknown"),
    [("rk5", "'rk5'"), ("own:rk5", "method 'own:rk5'"), ("nothing:euler", "engine 'nothing'"), ("", "''")],
)
def test_a_name_of_nothing_is_one_line(name: str, unknown: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SpringcheckError, match=unknown):
        list(explain.lines(name))
    assert main(["explain", name]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", terms.known())
def test_a_term_of_scene_files_is_explained(name: str) -> None:
    assert f"{name}, a term: " in "".join(explain.lines(name))


def test_a_shown_scene_is_the_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert len(scenefile.names()) > 20
    for name in scenefile.names():
        assert main(["show", name]) == 0
        (tmp_path / "my.toml").write_text(capsys.readouterr().out)
        assert scenefile.load_scene(tmp_path / "my.toml").digest == scenefile.load_scene(name).digest


def test_show_replaces_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine = tmp_path / "my.toml"
    assert main(["show", "spring", "-o", str(mine)]) == 0
    assert scenefile.load_scene(mine).digest == scenefile.load_scene("spring").digest
    mine.write_text("mine")
    assert main(["show", "spring", "-o", str(mine)]) == 2
    assert mine.read_text() == "mine"
    assert main(["show", "sprin"]) == 2
    assert "spring" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("asked", "word"),
    [("shadow", "shadow energy"), ("ulp", "ulp"), ("Method", "engine, method"), ("h-omega", "h omega")],
)
def test_a_word_is_found_by_its_beginning(asked: str, word: str) -> None:
    assert any(line.startswith(f"{word}: ") for line in explain.lines(asked))


@pytest.mark.parametrize(
    ("asked", "first"),
    [
        ("euler", "explicit-euler: "), ("verlet", "velocity-verlet: "), ("symplectic", "symplectic: "),
        ("kick-drift", "kick, drift: "), ("energy drift", "energy drift: "), ("rk4", "rk4: "),
    ],
)  # fmt: skip
def test_the_first_words_of_a_beginner_are_explained(asked: str, first: str) -> None:
    assert next(iter(explain.lines(asked))).startswith(first)


def test_a_fault_is_explained_with_its_command() -> None:
    said = " ".join(" ".join(explain.lines("early-momenta")).split())
    assert "half a step early" in said
    assert "--fault early-momenta" in said


def test_a_splitting_with_a_stage_of_friction_is_conformally_symplectic() -> None:
    assert "conformally symplectic" in " ".join(explain.lines("langevin-middle"))
    assert "conformally" not in " ".join(explain.lines("velocity-verlet"))


def test_a_thermostat_is_explained_by_its_stages_and_averages() -> None:
    said = "\n".join(explain.scheme_lines(schemes.scheme("obabo")))
    assert "exchange" in said
    assert "k<q**2>/kT" in said


def test_sentences_are_there_without_docstrings() -> None:
    """Python leaves docstrings out by -OO, and with them went the sentence of every check."""
    for word in ("step-defect", "quartic"):
        ran = [
            subprocess.run(
                [sys.executable, *flags, "-m", "springcheck", "explain", word],
                capture_output=True, text=True, check=True,
            ).stdout
            for flags in ([], ["-OO"])
        ]  # fmt: skip
        assert ran[0] == ran[1]


def test_a_heading_of_a_table_is_a_name_of_its_checks() -> None:
    known = (*checks.ALL, *checks.RANDOM)
    assert {check.short for check in known} - {check.name for check in known} >= {"across", "closed", "step"}
    for check in known:
        said = list(explain.lines(check.short))
        assert any(line.startswith(f"{check.name}, a check of") for line in said), check.short
    assert next(iter(explain.lines("across"))).startswith("noise-direction, a check")
    assert any(line.startswith("closed form: ") for line in explain.lines("closed"))
