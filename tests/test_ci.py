"""One step in anybody's CI: JUnit and summary say what was found, and name the cause of real bugs."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from springcheck.cli import ci, main

HERE = Path(__file__).parent
EXAMPLES = HERE / "ci-examples"
ACTION = HERE.parents[0] / ".github" / "actions" / "judge"

BUILD = {
    ".c": ("cc", "{source} -o {program}"),
    ".cpp": ("c++", "{source} -o {program}"),
    ".rs": ("rustc", "{source} -o {program}"),
    ".js": ("node", ""),
    ".py": (sys.executable, ""),
}
"""What builds a program; what needs no building runs it."""

STATED = "--stiffness 2.9 --mass 3.7 --step 0.1"
"""Or the scene, of those in a bath."""

BUGS = [
    ("odeint_150.cpp", "velocity-verlet", STATED, "halves swapped"),
    ("erf_3594.c", "velocity-verlet", STATED, "drift of half the step"),
    ("lethe_2082.cpp", "velocity-verlet", STATED, "not velocity Verlet, but semi-implicit Euler"),
    ("hymd_53.py", "velocity-verlet", STATED, "second half kick uses the old force"),
    ("hymd_86.py", "bussi", "two-csvr.toml", "the coupling acts on one of both alone"),
    (
        "espresso_3343.py",
        "lammps-langevin",
        "two-langevin.toml",
        "random numbers of coordinate 1 are",
    ),
    ("gym_907.py", "semi-implicit-euler", STATED, "not semi-implicit Euler, kick-drift, but explicit Euler"),
    ("f1tenth_52.js", "rk4", STATED, "not classical Runge-Kutta (RK4), but"),
    ("traer_2.js", "", STATED, "the position moves by v / h, not by h v"),
    (
        "jorbit_85.py",
        "velocity-verlet",
        STATED.replace("0.1", "-0.1"),
        "The motion runs forwards while its times fall",
    ),
    ("maple_47.rs", "velocity-verlet", STATED, "but for one kick of -0.00537 of the velocity at frame 100"),
    ("mujoco_warp_1662.py", "", f"{STATED} --friction 0.4", "implicit friction of the wrong sign"),
]


def built(source: Path, folder: Path) -> str:
    """The command that writes the trajectory of an example; skips without its language."""
    tool, how = BUILD[source.suffix]
    if shutil.which(tool) is None:
        pytest.skip(f"no {tool} here")
    if not how:
        return f"'{tool}' '{source}' > trajectory.csv"
    program = folder / source.stem
    subprocess.run(
        [tool, *how.format(source=source, program=program).split()], check=True, capture_output=True
    )
    return f"'{program}' > trajectory.csv"


def shell() -> str:
    bash = shutil.which("bash")
    if bash is None or os.name == "nt":
        pytest.skip("no bash here")
    return bash


def judged(folder: Path, **given: str) -> tuple[int, str, str]:
    """The action's script in a folder: status, the summary's first sentence, standard error."""
    summary, output = folder / "summary.md", folder / "output"
    variables = {f"JUDGE_{name.upper()}": value for name, value in given.items()}
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    known = {**os.environ, "PATH": path, "GITHUB_STEP_SUMMARY": str(summary), "GITHUB_OUTPUT": str(output)}
    ran = subprocess.run(
        [shell(), str(ACTION / "judge.sh")], env={**known, **variables}, cwd=folder, check=False,
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert output.read_text() == f"status={ran.returncode}\n"
    return ran.returncode, first_sentence(summary), ran.stderr


def first_sentence(summary: Path) -> str:
    text = summary.read_text() if summary.exists() else ""
    return text.splitlines()[2].partition(". What to do")[0] if text else ""


def judged_here(
    folder: Path, command: str, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> tuple[int, str]:
    """What the action's script calls, in this process and without its pictures: half of a second each."""
    monkeypatch.chdir(folder)
    subprocess.run([shell(), "-c", command], check=True)
    Path("springcheck-report").mkdir()
    reports = {"junit": "springcheck-report/junit.xml", "summary": "summary.md"}
    status = main([*words, *(x for name, path in reports.items() for x in (f"--{name}", path))])
    return status, first_sentence(Path("summary.md"))


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "scheme", "options", "cause"), BUGS)
def test_the_first_sentence_of_the_summary_is_the_cause_of_a_real_bug(
    name: str, scheme: str, options: str, cause: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command, trajectory, error = built(EXAMPLES / name, tmp_path), "trajectory.csv", ""
    # one by its numbers and one by its scene
    by_action = name in (BUGS[0][0], "hymd_86.py")
    if by_action:
        given = {"command": command, "trajectory": trajectory, "scheme": scheme}
        given |= {"options": options} if options.startswith("--") else {"scene": str(EXAMPLES / options)}
        status, sentence, error = judged(tmp_path, **given)
    else:
        scene = str(EXAMPLES / options) if options.endswith(".toml") else options
        stated = options.startswith("--")
        words = ["identify", trajectory] if stated else ["judge", trajectory, "--scene", scene]
        words += ["--scheme", scheme] * bool(scheme) + (options.split() if stated else [])
        status, sentence = judged_here(tmp_path, command, words, monkeypatch)
    assert status == 1, error
    assert cause in sentence
    reports = tmp_path / "springcheck-report"
    assert ElementTree.parse(reports / "junit.xml").find(".//failure") is not None
    assert bool(list(reports.glob("*.png"))) == by_action


def test_the_action_judges_an_engine_of_the_contract(tmp_path: Path) -> None:
    status, sentence, error = judged(tmp_path, engine=str(HERE / "plugin-example" / "springcheck_pefrl.py"))
    assert status == 0, error
    assert "none failed" in sentence


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "give one of trajectory, program and engine"),
        ({"trajectory": "a", "engine": "b"}, "give one of"),
        ({"trajectory": "nosuch.csv"}, "there is no such file"),
        ({"trajectory": "a.csv", "command": "exit 3"}, "the command that makes the trajectory failed"),
        ({"trajectory": "a.csv", "scheme": "nosuch"}, "neither in the catalogue"),
    ],
)  # fmt: skip
def test_the_action_says_in_a_line_what_is_missing(given: dict[str, str], said: str, tmp_path: Path) -> None:
    status, _, error = judged(tmp_path, **given)
    assert status == 2
    assert said in error
    assert "Traceback" not in error


def test_the_action_file_hands_every_input_to_the_script() -> None:
    text = (ACTION / "action.yml").read_text()
    script = (ACTION / "judge.sh").read_text()
    for name in ("command", "trajectory", "program", "engine", "scene", "scheme", "options"):
        assert f"JUDGE_{name.upper()}: ${{{{ inputs.{name} }}}}" in text
        assert f"${{JUDGE_{name.upper()}:-" in script
    assert "inputs." not in script


def written(tmp_path: Path) -> list[str]:
    return ["--junit", str(tmp_path / "j.xml"), "--summary", str(tmp_path / "s.md")]


def test_a_run_reports_each_verdict_as_a_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = str(tmp_path / "r.h5")
    run = ["run", "spring", "--method", "own:euler", "--method", "own:rk4", "-o", store, "--force", "--json"]
    assert main([*run, *written(tmp_path)]) == 0
    verdicts = json.loads(capsys.readouterr().out)["verdicts"]
    suite = ElementTree.parse(tmp_path / "j.xml").getroot()[0]
    assert [(x.get("classname"), x.get("name")) for x in suite] == [
        (v["method"], v["check"]) for v in verdicts
    ]
    skipped = sum(v["passed"] is None for v in verdicts)
    assert (suite.get("tests"), suite.get("failures"), suite.get("skipped")) == (
        str(len(verdicts)), "0", str(skipped)
    )  # fmt: skip
    assert f"{len(verdicts) - skipped} checks passed" in (tmp_path / "s.md").read_text()
    assert main([*run, "--fault", "stiffness", *written(tmp_path)]) == 1
    suite = ElementTree.parse(tmp_path / "j.xml").getroot()[0]
    assert int(suite.get("failures", "0")) == len(suite.findall("testcase/failure")) > 0
    assert (tmp_path / "s.md").read_text().count("### springcheck run") == 2


def test_a_mistake_is_an_error_in_the_report(tmp_path: Path) -> None:
    assert (
        main(["judge", str(tmp_path / "no.csv"), "--scene", "spring", "--scheme", "rk4", *written(tmp_path)])
        == 2
    )
    suite = ElementTree.parse(tmp_path / "j.xml").getroot()[0]
    assert suite.get("errors") == "1"
    assert "there is no such file" in str(suite.find("testcase/error").get("message"))  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--junit", "", "a name is needed"),
        ("--junit", ".", "it is a folder"),
        ("--summary", "no/such/s.md", "there is no folder"),
        ("--junit", "a.csv", "reads or writes that file otherwise"),
        ("--junit", "notes.txt", "the file is no such report"),
    ],
)
def test_a_report_takes_no_other_files_place(
    option: str,
    value: str,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text("t,q,v\n0,1,0\n")
    Path("notes.txt").write_text("mine")
    assert main(["identify", "a.csv", option, value]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert Path("notes.txt").read_text() == "mine"
    assert Path("a.csv").read_text() == "t,q,v\n0,1,0\n"


@pytest.mark.parametrize("before", [b"", ci.HEAD])
def test_a_full_disk_leaves_a_report_as_it_was(
    before: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    if before:
        Path("j.xml").write_bytes(before)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert main(["identify", "none.csv", "--junit", "j.xml"]) == 2
    assert "j.xml: the disk is full" in capsys.readouterr().err
    assert {x.name: x.read_bytes() for x in Path().iterdir()} == ({"j.xml": before} if before else {})


def test_what_a_file_says_breaks_no_report() -> None:
    case = ci.Case(subject="a\x00<b>", name="x", passed=False, why="\x1b[31m | `code` ]]> \ufffe")
    suite = ElementTree.fromstring(ci.junit("judge", [case]))[0]
    assert suite[0].get("classname") == "a?<b>"
    text = ci.summary("judge", [case, case], 1)
    assert "\x1b" not in text
    assert "\\| \\`code\\`" in text


def test_every_document_says_its_schema(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = str(tmp_path / "r.h5")
    for words in (
        ["run", "spring", "--method", "own:euler", "-o", store],
        ["inspect", store],
        ["identify", store],
        ["list"],
    ):
        assert main([*words, "--json"]) == 0
        document = json.loads(capsys.readouterr().out)
        assert next(iter(document.items())) == ("schema", f"springcheck/{words[0]}/1")


def test_a_scheme_that_is_not_the_one_asked_for_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = str(tmp_path / "r.h5")
    assert main(["run", "spring", "--method", "own:euler", "-o", store, "--quiet"]) == 0
    assert main(["identify", store, "--scheme", "explicit-euler"]) == 0
    assert main(["identify", store, "--scheme", "rk4", "--json"]) == 1
    said = capsys.readouterr().out
    unlike = json.loads(said[said.index("{") :])["unlike"]
    assert unlike == "these states are not classical Runge-Kutta (RK4), but explicit Euler"
    assert main(["identify", store, "--scheme", "rk44"]) == 2
    assert "neither in the catalogue" in capsys.readouterr().err
