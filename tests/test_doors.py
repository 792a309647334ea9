"""A function and a program in any language run beside the engines; every mistake in them is one line."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from springcheck import doors, driver
from springcheck.cli import main
from springcheck.errors import MethodError
from springcheck.physics.scenefile import load_scene
from springcheck.studies import team
from springcheck.studies.choose import choose

EXAMPLES = Path(__file__).parent / "command-examples"


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


VERLET = """
def leapfrog(q, p, h, force, mass):
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return q, p + h / 2 * force(q)
"""


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:  # type: ignore[type-arg]
    status = main(["run", "spring-uneven", "--method", "own:euler", "--json", *arguments])
    out = capsys.readouterr()
    assert not out.err
    return {"status": status} | json.loads(out.out)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["run", "spring", "--method", "own:euler", *arguments]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    return lines[0]


def test_a_students_function_is_found_to_be_its_scheme_and_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(VERLET)
    found = run(capsys, "--stepper", "mine.py:leapfrog")
    assert [one["scheme"] for one in found["runs"]] == ["explicit-euler", "velocity-verlet"]
    assert found["status"] == 0
    judged = {v["check"] for v in found["verdicts"] if v["method"] == "stepper:leapfrog" and v["passed"]}
    assert {"step-defect", "closed-form"} <= judged


def test_a_function_whose_scheme_is_not_known_has_a_limit_by_the_scheme_that_is_stated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was left out as one that has `no fixed step and no limit`."""
    (tmp_path / "mine.py").write_text(VERLET.replace("/ 2", "/ 2.2"))
    mine = ["--method", "stepper:*", "--stepper", "mine.py:leapfrog"]
    assert main(["stability", "spring", *mine, "--method", "own:euler"]) == 0
    assert "its scheme is not known; --scheme NAME states it" in " ".join(capsys.readouterr().out.split())
    main(["stability", "spring", *mine, "--scheme", "velocity-verlet", "--force"])
    assert "stepper:leapfrog  " in capsys.readouterr().out


def test_a_function_that_is_not_the_scheme_that_it_claims_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(VERLET)
    assert run(capsys, "--stepper", "mine.py:leapfrog", "--scheme", "position-verlet")["status"] == 1


def test_what_is_brought_runs_beside_the_default_methods_and_not_beside_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(VERLET)

    def ran(scene: str, *arguments: str) -> list[str]:
        main(["run", scene, "--steps", "2", "--json", "--force", *arguments])
        return [one["method"] for one in json.loads(capsys.readouterr().out)["runs"]]

    # multiple-time-steps names its methods itself
    for scene in ("spring", "multiple-time-steps"):
        default = ran(scene)
        assert sorted(ran(scene, "--stepper", "mine.py:leapfrog")) == sorted([*default, "stepper:leapfrog"])
    assert "own:rk4" in map(str, choose(load_scene("spring"), ["*"])[0])


@pytest.mark.usefixtures("sketched")
def test_a_wrong_function_runs_among_the_engines_without_a_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(VERLET.replace("h * p / mass", "1.01 * h * p / mass"))
    found = run(capsys, "--stepper", "mine.py:leapfrog")
    assert found["runs"][1]["scheme"] == "unknown"
    # nothing of it failed, and nothing of its scheme was judged
    assert found["status"] == 2
    assert all(v["passed"] is not False for v in found["verdicts"])
    assert main(["run", "spring", "--method", "own:euler", "--stepper", "mine.py:leapfrog", "--force"]) == 2
    said = " ".join(capsys.readouterr().out.split())
    assert "springcheck identify --stepper FILE.py:leapfrog looks for it" in said
    assert main(["plot", "spring-uneven.h5", "--quiet"]) == 0


def test_arrays_serve_where_numbers_do_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (
        "def f(q, p, h, force, mass):\n"
        "    p[0] += h * force(q)[0]\n    q[0] += h * p[0] / mass[0]\n    return q, p\n"
    )
    (tmp_path / "mine.py").write_text(text)
    assert run(capsys, "--stepper", "mine.py:f")["runs"][1]["scheme"] == "semi-implicit-euler"
    # of several masses it moves the first alone
    assert main(["run", "chain", "--stepper", "mine.py:f", "--quiet", "--method", "own:euler"]) == 1


def test_several_functions_and_programs_run_in_one_call(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(VERLET + "\n\n" + VERLET.replace("def leapfrog", "def other"))
    (tmp_path / "else.py").write_text(VERLET)
    names = ("mine.py:leapfrog", "mine.py:other", "else.py:leapfrog")
    program = f"sh {EXAMPLES / 'euler.sh'} {{scene}} {{out}}"
    commands = ("--command", f"one={program}", "--command", f"two={program}") if shutil.which("awk") else ()
    found = run(capsys, *(x for name in names for x in ("--stepper", name)), *commands)
    assert [one["method"] for one in found["runs"]] == [
        "own:euler", "stepper:mine-leapfrog", "stepper:other", "stepper:else-leapfrog",
        *(("command:one", "command:two") if commands else ()),
    ]  # fmt: skip
    assert all(v["passed"] is not False for v in found["verdicts"])
    assert found["status"] == (2 if commands else 0)


def test_a_scheme_is_stated_for_one_of_several(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.py").write_text(VERLET)
    command = ("--command", f"one=sh {EXAMPLES / 'euler.sh'} {{scene}} {{out}}")
    if shutil.which("awk"):
        found = run(capsys, "--stepper", "mine.py:leapfrog", *command, "--scheme", "one=semi-implicit-euler")
        assert [x["scheme"] for x in found["runs"][1:]] == ["velocity-verlet", "semi-implicit-euler"]
        assert found["status"] == 0
    assert "no function and no program has this name" in refused(
        capsys, "--stepper", "mine.py:leapfrog", "--scheme", "leapfroq=rk4"
    )


def test_names_that_would_be_one_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.py").write_text(VERLET)
    stepper = ("--stepper", "mine.py:leapfrog")
    assert "two functions would have one name" in refused(capsys, *stepper, *stepper)
    command = ("--command", "a=cat {scene} {out}")
    assert "two commands have this name" in refused(capsys, *command, *command)


def test_workers_run_what_a_call_brings(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(VERLET)
    shutil.copy(Path(__file__).parent / "plugin-example" / "springcheck_pefrl.py", tmp_path / "plug.py")
    what = doors.Brought(engines=("plug.py",), steppers=("mine.py:leapfrog",))
    labels = what.bring()
    assert labels == ["pefrl:pefrl", "stepper:leapfrog"]
    scene = load_scene("spring-uneven")
    parts = [partial(driver.run, scene, label) for label in labels]
    alone = dict(team.Processes(1).carried_out(parts))
    both = dict(team.Processes(2, what).carried_out(parts))
    for number in (0, 1):
        assert np.array_equal(alone[number].q, both[number].q)
        assert np.array_equal(alone[number].p, both[number].p)
    with pytest.raises(MethodError, match=r"unknown engine 'pefrl'|which is not given here"):
        list(team.Processes(2).carried_out(parts))


BAD_FUNCTIONS = [
    (
        "    return q.real_part, p",
        "AttributeError: 'float' object has no attribute 'real_part' (mine.py, line 3)",
    ),
    ("    return q, p, h", "returned tuple of 3; a step returns (q, p) (mine.py, line 2)"),
    ("    return q", "f: returned float; a step returns (q, p) (mine.py, line 2)"),
    ("    return None", "returned NoneType"),
    ("    return q, undefined", "NameError: name 'undefined' is not defined (mine.py, line 3)"),
    ("    raise ValueError('no\\nidea')", "ValueError: no idea (mine.py, line 3)"),
    ("    return 'a', p", "returned no numbers; a step returns (q, p) (mine.py, line 2)"),
    ("    return q, [q, [p]]", "returned no numbers"),
    ("    return q + 1j, p", "returned complex numbers, and no real numbers"),
    ("    return [1, 2, 3], p", "returned shapes (3,)"),
]


@pytest.mark.parametrize(("line", "said"), BAD_FUNCTIONS)
def test_a_mistake_in_a_function_is_shown_with_its_line(
    line: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(f"\ndef f(q, p, h, force, mass):\n{line}\n")
    assert said in refused(capsys, "--stepper", "mine.py:f")


def test_functions_that_cannot_be_found_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.py").write_text(VERLET)
    assert "it has leapfrog" in refused(capsys, "--stepper", "mine.py:leapfroq")
    assert "there is no such file" in refused(capsys, "--stepper", "other.py:f")
    assert "no module" in refused(capsys, "--stepper", "nowhere_at_all:f")
    (tmp_path / "broken.py").write_text("x = (\n")
    assert "SyntaxError" in refused(capsys, "--stepper", "broken.py:f")


def test_a_motion_that_explodes_is_said_to_explode(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text("def f(q, p, h, force, mass):\n    return q**9 + 10.0, p\n")
    # its scheme was not stated, so that nothing judges it
    assert main(["run", "spring", "--stepper", "mine.py:f", "--method", "own:euler"]) == 2
    assert "explodes" in " ".join(capsys.readouterr().out.split())
    (tmp_path / "mine.py").write_text("def f(q, p, h, force, mass):\n    return q * float('nan'), p\n")
    # that it ended is judged of any scheme
    assert main(["run", "spring", "--stepper", "mine.py:f", "--method", "own:euler", "--force"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "nan in place of numbers from the next frame on" in said
    assert "explodes" not in said


def program(tmp_path: Path, body: str) -> str:
    path = tmp_path / "engine"
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)
    return "mine=./engine {scene} {out}"


ROWS = "0,0,1"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("echo no licence >&2; exit 3", "ended with status 3: no licence"),
        ("true", "wrote no file {out}"),
        (": > $2", "is empty"),
        ("echo hello > $2", "holds no row of numbers"),
        ("printf 't,q,p\\n0,0,1\\n1,x,2\\n' > $2", "line 3: 'x' is no number"),
        ("printf 't,q,p\\n0,0,1\\n0.1,1\\n' > $2", "line 3: numbers in this row: 2, in the first: 3"),
        ("printf 't,q\\n0,0\\n' > $2", "no momenta or velocities"),
        ("printf '0,0,1\\n' > $2", "have no names"),
        ("printf 't,q,p\\n0,0,1\\n' > $2", "too few rows: 1, "),
        ("printf 't,q,p\\n0,0,1\\n0.2,0,1\\n' > $2", "row 2 is at t = 0.2, not 0.1"),
        ("printf 't,q,p\\n0,5,1\\n0.1,0,1\\n' > $2", "its first row is not the scene's start"),
        ("printf 't,q,p\\n0,0,1\\n0.1,nan,1\\n' > $2", "row 2 of q is not finite"),
        ("printf 't,q,q2,p,p2\\n0,0,0,1,1\\n' > $2", "positions in a row of its output: 2, not 1"),
        ("printf 'PK\\003\\004xx' > $2", "NumPy cannot read it"),
        ("exec sleep 20", "did not end within 1 s"),
    ],
)
def test_whatever_a_program_does_wrong_is_one_line(
    body: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in refused(capsys, "--command", program(tmp_path, body), "--timeout", "1")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("nowhere", "not of the form"),
        ("a=./nothing {scene} {out}", "there is no program './nothing'"),
        ("a=cat {scene}", "no {out} among its arguments"),
        ("a=cat '{scene} {out}", "No closing quotation"),
    ],
)
def test_a_command_that_cannot_be_called_is_one_line(
    command: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in refused(capsys, "--command", command)


def test_a_program_in_c_is_judged_by_the_scheme_that_it_states(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    subprocess.run(
        [compiler, "-O2", "-ffp-contract=off", "-o", "verlet", EXAMPLES / "verlet.c", "-lm"], check=True
    )
    command = ("--command", "c=./verlet {scene} {out}")
    found = run(capsys, *command, "--scheme", "velocity-verlet")
    assert found["status"] == 0
    judged = {v["check"] for v in found["verdicts"] if v["method"] == "command:c" and v["passed"]}
    assert {"start", "times", "step-defect", "closed-form", "frequency"} <= judged
    assert run(capsys, *command, "--scheme", "rk4", "-o", "x.h5")["status"] == 1


def test_mended_code_runs_again_and_the_others_are_shown_all_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    # mended within the second, in as many letters: bytecode that is kept would be that of the mistake
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    code = "def mine(q, p, h, force, mass):\n    p = p + h * fores(q)\n    return q + h * p / mass, p\n"
    (tmp_path / "mine.py").write_text(code)
    command = ["run", "spring", "--method", "own:euler", "--method", "own:rk4", "--stepper", "mine.py:mine"]
    for _ in range(2):
        assert main(command) == 2
        said, why = capsys.readouterr()
        assert "own:rk4" in said
        assert "not run: stepper:mine" in said
        assert "mine failed: NameError" in why
        assert "(mine.py, line 2)" in why
    (tmp_path / "mine.py").write_text(code.replace("fores", "force"))
    assert main(command) == 0
    assert "stepper:mine" in capsys.readouterr().out
    assert (tmp_path / "spring.h5").exists()
    assert not (tmp_path / "spring.h5.parts").exists()


def test_a_stored_run_of_a_function_asks_for_it_again() -> None:
    """It was of an unknown engine."""
    Path("mine.py").write_text(VERLET)
    assert main(["run", "spring", "--stepper", "mine.py:leapfrog", "-o", "s.h5", "--quiet"]) == 0
    command = [sys.executable, "-m", "springcheck", "run", "--from", "s.h5"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 2
    assert "engine of --stepper FILE.py:FUNCTION, which is not given" in ran.stderr
