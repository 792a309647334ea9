"""Slips of the hand: one line that says what, where and what to do, exit status 2, and no traceback."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import springcheck
from springcheck.cli import main
from springcheck.physics import scenefile

SPRING = (scenefile.folder() / "spring.toml").read_text()

STEPPERS = """
import sys
print("a module that prints")

def step(q, p, h, force, mass):
    print("a stepper that prints")
    p = p + h * force(q)
    return q + h * p / mass, p

def leaves(q, p, h, force, mass):
    sys.exit(7)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with a store, hostile scenes, loops of links, and steppers."""
    monkeypatch.chdir(tmp_path)
    Path("deep.toml").write_text(SPRING + "\nx = " + "[" * 3000 + "]" * 3000 + "\n")
    Path("digits.toml").write_text(SPRING.replace("steps = 200", "steps = " + "1" * 4400))
    Path("steppers.py").write_text(STEPPERS)
    Path("loop.h5").symlink_to("other.h5")
    Path("other.h5").symlink_to("loop.h5")
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "steppers", raising=False)


@pytest.fixture
def stored(folder: None) -> None:
    assert main(["run", "spring", "--method", "own:euler", "--quiet", "-o", "a.h5"]) == 0


def refused(capsys: pytest.CaptureFixture[str], arguments: list[str], *words: str) -> None:
    capsys.readouterr()
    try:
        status = main(arguments)
    except SystemExit as left:
        status = int(str(left.code))
    said = capsys.readouterr()
    assert status == 2
    assert said.out == ""
    assert said.err.startswith("springcheck: ")
    assert said.err.count("\n") == 1
    assert len(said.err) <= 500
    for word in words:
        assert word in said.err


@pytest.mark.parametrize("command", ["inspect", "check", "plot", "identify"])
@pytest.mark.parametrize(
    ("name", "word"),
    [("", "empty"), (".", "folder"), (os.devnull, "device"), ("loop.h5", "loop.h5"), ("none.h5", "none.h5")],
)
def test_a_name_that_is_no_file(
    command: str, name: str, word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(capsys, [command, name], word)


@pytest.mark.usefixtures("stored")
@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("identify a.h5 --step 1e-300", ("--step 1e-300",)),
        ("identify a.h5 --step 1e-50", ("--step 1e-50",)),
        ("identify a.h5 --mass 5e-324", ("--mass 4.94066e-324",)),
        ("run spring --method own:euler -o loop.h5", ("loop.h5", "symbolic links")),
        ("run deep.toml", ("deep.toml", "nested too deep")),
        ("run digits.toml", ("digits.toml", "4300 digits")),
        ("run --from a.h5 -o x.h5", ("-o", "--from")),
        ("run --from a.h5 --force", ("--force", "--from")),
        ("run --from a.h5 --thorough", ("--thorough", "--from")),
        ("run --from a.h5 --verdicts", ("--verdicts", "--from")),
        ("identify --stepper steppers:step --mass 3", ("--mass", "--stepper")),
        ("identify --stepper steppers:step --trajectory x", ("--trajectory", "--stepper")),
        ("plot a.h5 -o picture.png", ("-o picture.png", "a folder is needed")),
        ("run spring --engine .", (".: it is a folder, a Python file is needed",)),
        ("inspect a.h5 --rows 3", ("--rows", "--trajectory")),
        ("inspect a.h5 --rows " + "x" * 5000, ("--rows", "xx .. xx")),
    ],
)
def test_numbers_names_and_options_that_serve_nothing(
    line: str, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    refused(capsys, line.split(), *words)
    assert not Path("x.h5").exists()
    assert not Path("picture.png").exists()


@pytest.mark.usefixtures("stored")
@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("runn spring", "did you mean run?"),
        ("run sprin", "did you mean spring?"),
        ("run spring --forse", "did you mean --force?"),
        (
            "inspect a.h5 --force",
            "--force: unknown or too many arguments; `springcheck inspect -h` shows them",
        ),
        ("run spring --metod=own:euler", "did you mean --method?"),
        ("run spring --method own:eular", "did you mean own:euler?"),
        ("run spring --method own:euler-cromer", "did you mean own:semi-implicit-euler?"),
        ("run spring --method own:rk2", "did you mean own:rk2-midpoint or own:rk2-heun?"),
        # adaptive: no relation of rk4
        ("run spring --method own:rk45", "did you mean scipy:rk45?"),
        ("run spring --method own:adams", "did you mean sundials:adams?"),
        ("explain rk45", "chooses its steps"),
        (
            "judge a.h5 --scene spring --scheme RK45",
            "--method scipy:rk45`",
        ),
        ("judge a.h5 --scene spring --scheme ode45", "chooses its steps"),
        (
            "judge a.h5 --scene spring --scheme leapfrog",
            "did you mean velocity-verlet or semi-implicit-euler?",
        ),
        ("run spring --method openmm:verlet@cpu", "did you mean openmm:verlet@CPU?"),
        ("run spring --method own:euler@cpu", "springcheck has no platforms: own:euler is all"),
        ("run spring --method opemm:verlet", "did you mean openmm"),
        ("inspect a.h5 --trajectory own:eular", "did you mean own:euler?"),
    ],
)
def test_a_mistyped_word_gets_the_nearest_one(
    line: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(capsys, line.split(), meant)


@pytest.mark.parametrize("option", ["-o", "--output"])
@pytest.mark.parametrize(
    "command", [["run", "spring"], ["stability", "spring"], ["extremes"], ["plot", "steppers.py"]]
)
def test_an_empty_output_is_no_default(
    command: list[str], option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(capsys, [*command, option, ""], "-o", "empty")


def test_a_quiet_study_that_measures_nothing_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    scene = SPRING.replace("step = 0.1", "step = 1e300")
    Path("far.toml").write_text(scene)
    refused(capsys, ["precision", "far.toml", "--method", "own:euler", "--quiet"], "nothing was measured")


def test_a_stepper_may_print_and_may_not_set_the_exit_status(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["identify", "--stepper", "steppers:step", "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["trajectory"] == "steppers:step"
    assert "a module that prints" in said.err
    assert "a stepper that prints" in said.err
    assert main(["identify", "--stepper", "steppers:leaves"]) == 2
    assert "SystemExit: 7" in capsys.readouterr().err.splitlines()[-1]


def program(line: str, *, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    home = str(Path(springcheck.__file__).parents[1])
    return subprocess.run(
        ["sh", "-c", f"exec {sys.executable} -m springcheck {line}"],
        env=os.environ | {"PYTHONPATH": home} | (environment or {}),
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.skipif(os.name != "posix", reason="a shell is needed")
def test_any_title_in_a_pipe_of_any_encoding() -> None:
    Path("title.toml").write_text(
        SPRING.replace('title = "', 'title = "F\u00e4der \u2603 '), encoding="utf-8"
    )
    done = program("run title.toml --method own:euler", environment={"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout.startswith(r"F\xe4der \u2603 Mass on a spring")


@pytest.mark.skipif(os.name != "posix", reason="a shell is needed")
def test_closed_streams_lead_nowhere_and_not_into_the_store() -> None:
    # a report that nobody gets is said, as on a full disk, and none is missed where --quiet prints nothing
    unsaid = "springcheck: cannot write the output: standard output is closed\n"
    for i, (closed, status, said) in enumerate(
        ((">&-", 2, unsaid), (">&- --quiet", 0, ""), ("2>&-", 0, ""), ("<&-", 0, ""), (">&- 2>&- <&-", 2, ""))
    ):
        done = program(f"run spring --method own:euler -o {i}.h5 {closed}")
        assert (done.returncode, done.stderr) == (status, said), closed
        assert main(["check", f"{i}.h5"]) == 0
    assert (done := program("list >&-")).returncode == 2
    assert done.stderr == unsaid


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize(
    "line", ["list", "run spring --method own:euler --json", "check 0.h5", "--version", "--help"]
)
def test_a_full_disk_is_one_line(line: str) -> None:
    main(["run", "spring", "--method", "own:euler", "--quiet", "-o", "0.h5"])
    done = program(f"{line} > /dev/full")
    assert done.returncode == 2
    assert done.stderr == "springcheck: cannot write the output: No space left on device\n"


@pytest.mark.skipif(os.name != "posix", reason="a shell is needed")
@pytest.mark.parametrize(
    ("line", "unbuffered"),
    [("list", ""), ("list", "1"), ("identify 0.h5", ""), ("--help", ""), ("run nothing", "")],
)
def test_what_nobody_reads_any_more_ends_without_a_word_as_by_sigpipe(line: str, unbuffered: str) -> None:
    """`springcheck identify FILE | head -4` is no mistake: the exit status is a shell's 128 + 13."""
    if "0.h5" in line:
        main(["run", "spring", "--method", "own:euler", "--quiet", "-o", "0.h5"])
    ours, theirs = os.pipe()
    os.close(ours)
    home = str(Path(springcheck.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-m", "springcheck", *line.split()], stdout=theirs,
        # where a mistake is printed
        stderr=theirs if "nothing" in line else subprocess.PIPE,
        env=os.environ | {"PYTHONUNBUFFERED": unbuffered, "PYTHONPATH": home}, check=False,
    )  # fmt: skip
    os.close(theirs)
    assert (done.returncode, done.stderr or b"") == (141, b"")


@pytest.mark.skipif(os.name != "posix", reason="a shell is needed")
def test_a_mistake_of_ours_is_one_line_and_shows_its_place_when_asked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from springcheck import __main__, cli, interrupts

    def wrong() -> int:
        raise ZeroDivisionError("division\nby zero")

    monkeypatch.setattr(cli, "main", wrong)
    monkeypatch.setattr(interrupts, "install", lambda: None)
    assert __main__._main() == 2
    said = capsys.readouterr().err
    assert said.startswith(
        "springcheck: ZeroDivisionError: division by zero; this is a mistake in springcheck"
    )
    assert said.count("\n") == 1
    monkeypatch.setenv("SPRINGCHECK_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        __main__.main()


def test_a_step_that_an_adaptive_solver_cannot_follow_is_refused_with_its_radians(
    capsys: pytest.CaptureFixture[str],
) -> None:
    line = "run spring --step 1e9 --steps 3 --method sundials:adams"
    refused(capsys, line.split(), "sundials:adams", "1e+09 radians", "3e+09 internal steps", "shorter steps")
    assert not Path("spring.h5").exists()


def test_a_run_that_decays_into_subnormal_numbers_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    Path("s.toml").write_text(SPRING.replace("steps = 200", "steps = 160000") + "\n[record]\nevery = 1600\n")
    assert main(["run", "s.toml", "--method", "own:implicit-euler"]) == 0
    assert "own:implicit-euler: it has decayed below 2.2e-308" in (capsys.readouterr().out)
    assert springcheck.simulate(springcheck.load_scene("spring"), "own:implicit-euler").outcome.message == ""


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--method", "verlet"], "did you mean openmm:verlet?"),
        (["--method", "@cpu"], "a platform goes with a method, as openmm:"),
        (["--set", "stiffness=2"], "--set stiffness=2: which one? spring.0.stiffness"),
        (["--set", "spring.0.stiffness=2 N/m"], "a number alone is needed, in the scene's unit, as 2"),
        (
            ["--stepper", "three.py:step"],
            "three.py:step: step(q, p, h) cannot be called as a step: step(q, p, h,",
        ),
    ],
)
def test_a_slip_is_answered_with_what_was_meant(
    arguments: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "three.py").write_text("def step(q, p, h):\n    return q, p\n")
    assert main(["run", "spring", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1


def test_every_method_runs_by_all_and_by_a_star(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], whole: bool
) -> None:
    path = str(tmp_path / "a.h5")
    assert main(["run", "spring", "--steps", "20", "-o", path]) == 0
    assert "methods left out: --left-out" in capsys.readouterr().out
    assert main(["run", "spring", "--steps", "20", "-o", path, "--force", "--left-out"]) == 0
    (line,) = [one for one in capsys.readouterr().out.splitlines() if "--all runs them" in one]
    assert "own:rk4" in line
    assert "own:euler" not in line
    counts = []
    for arguments in (["--all"], ["--method", "*"])[: 2 if whole else 1]:
        short = ["--steps", "20", "-o", path, "--force", "--json"]
        assert main(["run", "spring", *arguments, *short]) in (0, 1, 2)
        document = json.loads(capsys.readouterr().out)
        counts.append(len(document["runs"]))
        assert document["others"] == []
        assert "own:rk4" in {run["method"] for run in document["runs"]}
    assert counts[0] == counts[-1] > 25


def test_run_says_which_methods_its_step_is_too_long_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", "multiple-time-steps", "--step", "0.347", "--steps", "200", "--method", "own:respa8"]
    main([*arguments, "--method", "own:implicit-euler", "-o", str(tmp_path / "a.h5")])
    said = capsys.readouterr().out
    assert "h = 0.347 is beyond the limit of r-RESPA" in said
    assert " here, 0.34679839: own:respa8" in said
    main(["run", "spring", "--method", "own:euler", "-o", str(tmp_path / "b.h5")])
    assert "beyond" not in capsys.readouterr().out


@pytest.mark.usefixtures("stored")
def test_a_store_whose_ending_is_left_out_is_proposed(capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, ["plot", "a"], "did you mean a.h5?")


def test_a_value_that_is_missing_is_asked_for_in_one_line_and_a_negative_one_is_refused_as_it_was_typed(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for words in (["--temperature", "-K"], ["--temperature"]):
        with pytest.raises(SystemExit) as left:
            main(["run", "spring", *words])
        assert left.value.code == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "--temperature: a value is needed" in said
        assert "--temperature=-" in said
    for words in (["--temperature=-5K"], ["--temperature", "-5K"], ["--temperature", "-.5K"]):
        assert main(["run", "spring", *words]) == 2
        typed = words[-1].removeprefix("--temperature=")
        assert f"--temperature {typed}: a finite number >= 0 is needed" in capsys.readouterr().err
