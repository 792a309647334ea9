"""The engine of the README is complete and short, passes every check, and each check rejects a broken one."""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import springcheck.engines
from springcheck import conformance, driver, engines
from springcheck.cli import main
from springcheck.engines import Engine
from springcheck.physics.scenefile import load_scene

README = Path(springcheck.engines.__file__).parent / "README.md"
CODE = re.search(r"```python\n(\"\"\"my_engine.*?)```", README.read_text(), re.DOTALL).group(1)  # type: ignore[union-attr]


def made(code: str) -> Engine:
    space: dict[str, Any] = {"__name__": "my_engine"}
    exec(code, space)
    return space["ENGINE"]  # type: ignore[no-any-return]


def test_the_example_takes_at_most_sixty_lines() -> None:
    assert len(CODE.splitlines()) <= 60


def test_the_example_passes_every_check() -> None:
    found = conformance.checks_of(made(CODE))
    names = [x.name for x in found]
    right = [name for name in names if name.startswith("right on uneven-")]
    assert len(right) > 6
    assert names == ["declaring imports no library", *right, *conformance.TESTS]
    for check in found:
        check()


BATH = """        for row in range(len(q)):
            for _ in range(every):
                self.kick(self.h / 2)
                for drift in (0, 1):
                    self.q = [x + self.h / 2 * y / m for x, y, m in zip(self.q, self.p, self.m, strict=True)]
                    if not drift:
                        c = np.exp(-self.gamma * self.h)
                        a = np.sqrt((1 - c * c) * self.kT * np.array(self.m))
                        self.p = (c * np.array(self.p) + a * self.rng.standard_normal(len(self.m))).tolist()
                self.kick(self.h / 2)
            q[row], p[row] = self.q, self.p
"""


def thermostat() -> str:
    head, _, tail = CODE.partition("        for row in range(len(q)):")
    start = "        self.rng, self.gamma = np.random.default_rng(seed), scene.bath.friction\n"
    start += "        self.kT = scene.bath.thermal(scene.units)\n"
    method = 'Method(name="bath", scheme="baoab", about="", terms={"wall-spring"}, generator="PCG64")'
    text = f"import numpy as np\n{head}{BATH}{tail[tail.index(chr(10) * 2) :]}"
    for old, new in (
        ("def __init__(self, scene, step):\n", f"def __init__(self, scene, step, seed):\n{start}"),
        ("    start=", f"    thermostats=named({method}),\n    start="),
        ("label, step: Simulation(scene, step)", "label, step, seed=None: Simulation(scene, step, seed)"),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


def refusals(checks: Iterable[conformance.Check]) -> Iterator[str]:
    """What the checks that fail say, each as it is asked for."""
    for check in checks:
        try:
            check()
        except AssertionError as error:
            yield str(error)


def test_a_thermostat_passes_and_a_broken_one_does_not() -> None:
    def checks(code: str) -> list[conformance.Check]:
        return [x for x in conformance.checks_of(made(code)) if x.label.method == "bath"]

    right = checks(thermostat())
    assert right[-1].name == "seeds"
    for check in right:
        check()
    for said, old, new in (
        ("draws-variance", "(1 - c * c)", "(1 - c)"),
        ("noise-direction", "self.h / 2 * y / m", "self.h / 2 * y / m**1.0000001"),
        ("two seeds give one trajectory", "default_rng(seed)", "default_rng(3)"),
        ("two runs of one seed differ", "default_rng(seed)", "default_rng()"),
    ):
        assert old in thermostat()
        # the first check that fails for it is enough, and that of the seeds stands last
        failed = refusals(reversed(checks(thermostat().replace(old, new))))
        assert any(said in text for text in failed), said


def test_an_engine_may_bring_thermostats_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was refused: "it has no methods"."""
    head, _, tail = thermostat().partition("    methods=")
    code = head + tail[tail.index("    thermostats=") :]
    assert not made(code).methods
    # the steps are those of the thermostat above, beside which methods stand
    first, *right, seeds = conformance.checks_of(made(code))
    for check in (first, right[-1], seeds):
        check()
    (tmp_path / "bath.py").write_text(code)
    arguments = ["run", "bath-spring", "--steps", "300", "--engine", str(tmp_path / "bath.py"), "--json"]
    assert main([*arguments, "-o", str(tmp_path / "a.h5")]) == 0
    runs = json.loads(capsys.readouterr().out)["runs"]
    assert "mine:bath" in {run["method"] for run in runs}
    arguments[1] = "spring"
    assert main([*arguments, "-o", str(tmp_path / "b.h5")]) == 2
    assert "no method matches 'mine:*' for a scene without a bath" in capsys.readouterr().err


STEP, ROW, COUNT = (
    "                self.q = ",
    "        for row in range(len(q)):",
    "        self.force_calls = 0\n",
)
HALF = f"self.kick(self.h / 2)\n{STEP}"
MOVED = "        scene.q.base.setflags(write=True)\n        scene.q.base[0] += 1e-3\n"

FAULTS = [
    ("right on", HALF, f"self.kick(self.h)\n{STEP}"),
    ("right on", "self.q[i] - at", "self.q[i]"),
    ("right on", "self.h * y / m", "self.h * y"),
    ("right on", "self.h * y / m", "(1 + 1e-12) * self.h * y / m"),
    ("rows in parts", ROW, f"        self.p = [x + 1e-9 for x in self.p]\n{ROW}"),
    ("frames apart", "for _ in range(every)", "for _ in range(min(every, 9))"),
    ("scene untouched", COUNT, COUNT + MOVED),
    ("negative step", "self.h = step", "self.h = abs(step)"),
    # of two springs of one particle the second is lost; a root of a stiffness below 0 crashes
    ("refusals", "in self.springs:", "in {x[0]: x for x in self.springs}.values():"),
    ("refusals", "out[i] -= k *", "out[i] -= k**0.5 * k**0.5 *"),
    ("versions", '{"mine": "1.0"}', '{"mine": 1.0}'),
]  # fmt: skip


@pytest.mark.parametrize(("name", "old", "new"), FAULTS)
def test_each_check_rejects_a_broken_engine(name: str, old: str, new: str) -> None:
    assert old in CODE
    found = [x for x in conformance.checks_of(made(CODE.replace(old, new, 1))) if x.name.startswith(name)]
    said = list(refusals(found))
    assert said
    if name == "right on":
        # what the states show, and how many verdicts failed
        assert all(re.search(r" is not velocity-verlet on uneven-\d+", one) for one in said)
        assert all(re.search(r"\n\d+ of \d+ failed: ", one) for one in said)


def test_every_check_has_a_broken_engine_that_it_rejects() -> None:
    assert {name for name, *_ in FAULTS} == {"right on", *conformance.TESTS}


def test_a_wrong_engine_is_told_what_its_states_show() -> None:
    wrong = made(CODE.replace("self.h * y / m", "self.h * y", 1))
    check = next(x for x in conformance.checks_of(wrong) if x.name == "right on uneven-1")
    with pytest.raises(AssertionError, match=r"on uneven-1: .*mass") as caught:
        check()
    assert "Diagnosis: " not in str(caught.value)


def test_pytest_shows_the_sentence_and_no_frames_of_ours(tmp_path: Path) -> None:
    code = CODE.replace("self.h * y / m", "self.h * y", 1)
    (tmp_path / "my_engine.py").write_text(code)
    (tmp_path / "test_mine.py").write_text(
        "from my_engine import ENGINE\n"
        "from springcheck.conformance import parametrize_with_checks\n\n"
        "@parametrize_with_checks(ENGINE)\ndef test_springcheck(check):\n    check()\n"
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "uneven-1"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "is not velocity-verlet on uneven-1: " in done.stdout
    assert "conformance.py:" not in done.stdout
    assert "test_mine.py:6" in done.stdout


def test_what_is_refused_in_words_is_no_fault() -> None:
    refusing = CODE.replace(
        "        self.force_calls = 0\n",
        "        self.force_calls = 0\n"
        "        if any(k < 0 for term in scene.terms for k in term.k):\n"
        "            from springcheck.errors import MethodError\n"
        "            raise MethodError('a stiffness of 0 or more is needed')\n",
        1,
    )
    next(x for x in conformance.checks_of(made(refusing)) if x.name == "refusals")()


@pytest.mark.parametrize("eager", [False, True])
def test_an_engine_that_imports_its_library_as_it_is_declared_is_rejected(
    eager: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"declared_{'eagerly' if eager else 'lazily'}"
    (tmp_path / "library_of_mine.py").write_text("")
    code = CODE.replace('    name="mine",', '    name="mine",\n    distribution="library-of-mine",')
    (tmp_path / f"{name}.py").write_text(("import library_of_mine\n" if eager else "") + code)
    monkeypatch.syspath_prepend(tmp_path)
    check = conformance.checks_of(importlib.import_module(name).ENGINE)[0]
    if not eager:
        check()
        (tmp_path / f"{name}.py").write_text("1 / 0")
        with pytest.raises(AssertionError, match="cannot be imported by itself"):
            check()
        return
    with pytest.raises(AssertionError, match="importing declared_eagerly imports library_of_mine"):
        check()


def test_a_wrong_trajectory_is_told_in_words() -> None:
    scene = load_scene("spring-uneven")
    run = driver.run(scene, "own:euler")
    conformance.assert_right(scene, run)
    with pytest.raises(
        AssertionError, match=r"own:euler is not rk4 on spring-uneven: .*xplicit Euler.*\n  step-defect: "
    ):
        conformance.assert_right(scene, replace(run, scheme="rk4"))


@pytest.mark.campaign
@conformance.parametrize_with_checks(engines.engine("ase"))
def test_an_engine_of_ours(check: conformance.Check, need: Any) -> None:
    need("ase:velocity-verlet")
    check()


BARE = """
import sys
from dataclasses import replace

class Nothing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in "scipy h5py matplotlib numba openmm ase rich jinja2".split():
            raise ModuleNotFoundError(f"no {name}", name=name)

sys.meta_path.insert(0, Nothing())
from springcheck import driver
from springcheck.conformance import assert_right
from springcheck.physics.scenefile import load_scene

scene = load_scene("spring-uneven")
run = driver.run(scene, "own:velocity-verlet")
assert_right(scene, run)
try:
    assert_right(scene, replace(run, scheme="semi-implicit-euler"))
except AssertionError as error:
    print(error)
"""


def test_one_s_own_engine_is_judged_where_neither_scipy_nor_h5py_are_installed() -> None:
    done = subprocess.run([sys.executable, "-c", BARE], capture_output=True, text=True, check=True)
    assert "own:velocity-verlet is not semi-implicit-euler on spring-uneven" in done.stdout
    assert "with SciPy installed, this line says what they are" in done.stdout
    assert "step-defect" in done.stdout
