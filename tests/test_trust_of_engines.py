"""An engine that fails is an error, and one that changes the process changes nothing for others."""

from __future__ import annotations

import locale
import os
import signal
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import springcheck
from springcheck import driver, engines
from springcheck.cli import main
from springcheck.engines import Engine, Label, Method, named
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene

FAILS = """
from springcheck.engines import Engine, Method, named

def start(scene, method, label, step):
    raise RuntimeError("out of order")

ENGINE = Engine(
    name="mine", title="Mine", start=start, version=lambda: {"mine": "1"},
    methods=named(Method(name="x", scheme="velocity-verlet", about="")),
)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(FAILS)
    return tmp_path


@pytest.mark.parametrize("asked", [["--method", "mine:*"], ["--method", "mine:x"], []])
def test_a_requested_engine_that_fails_is_an_error_and_the_others_are_stored(
    folder: Path, asked: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    reports = ["--junit", "j.xml", "--summary", "s.md"]
    others = ["--method", "own:euler"] if asked else []
    assert main(["run", "spring", "--engine", "mine.py", *asked, *others, *reports]) == 2
    out, err = capsys.readouterr()
    assert "not run: mine:x" in out
    assert [line for line in err.splitlines() if "mine:x" in line and "out of order" in line]
    assert "own:euler" in springcheck.read("spring.h5")
    (suite,) = ElementTree.parse("j.xml").getroot()
    assert suite.attrib["errors"] == "1"
    (case,) = (x.attrib["classname"] for x in suite if x.find("error") is not None)
    assert case == "mine:x"
    lines = [line for line in Path("s.md").read_text().splitlines() if line]
    assert "nothing judged" not in lines[0]
    assert lines[1].startswith("mine:x")


def test_an_engine_of_ours_that_is_installed_and_fails_is_an_error_though_nobody_named_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from springcheck.engines.own import simulation

    def broken(*_: object) -> None:
        raise RuntimeError("out of order")

    right = simulation.start
    monkeypatch.setattr(
        simulation, "start", lambda scene, method, *more: (
            broken() if method.name == "euler" else right(scene, method, *more)
        )
    )  # fmt: skip
    assert main(["run", "spring"]) == 2
    assert "own:euler failed" in capsys.readouterr().err
    assert "own:semi-implicit-euler" in springcheck.read("spring.h5")


class Rude:
    """A simulation of a loop that changes what it can of the process at every call."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        self.force_calls = 0
        self._scene, self._step = scene, step
        self._q, self._p = scene.q.copy(), scene.p.copy()
        with pytest.raises(ValueError, match="read-only"):
            scene.q[0] = 0.0
        with pytest.raises(ValueError, match="WRITEABLE"):
            scene.q.setflags(write=True)
        with pytest.raises(ValueError, match="read-only"):
            scene.terms[0].arrays["k"][0] = 0.0
        self._change()

    def _change(self) -> None:
        from ctypes import CDLL, util

        os.chdir("/")
        np.seterr(all="raise")
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        # towards 0, as C's FE_TOWARDZERO is on x86-64
        CDLL(util.find_library("m")).fesetround(0xC00)
        for name in ("C.UTF-8", "POSIX"):
            locale.setlocale(locale.LC_ALL, name)

    def advance(self, every: int, q: np.ndarray, p: np.ndarray) -> None:
        m, h = self._scene.m, self._step
        for row in range(len(q)):
            for _ in range(every):
                self.force_calls += 1
                self._p = self._p + h * self._scene.system.force(self._q, self._p)
                self._q = self._q + h * self._p / m
            q[row], p[row] = self._q, self._p
        self._change()


def test_an_engine_that_changes_the_process_changes_nothing_for_others(folder: Path) -> None:
    found = Engine(
        name="rude", title="Rude", start=Rude, version=lambda: {"rude": "1"},
        methods=named(Method(name="x", scheme="semi-implicit-euler", about="")),
    )  # fmt: skip
    scene = load_scene("spring-uneven")
    before = (
        os.getcwd(), np.geterr(), signal.getsignal(signal.SIGTERM), locale.setlocale(locale.LC_ALL),
        1.0 + 2.0**-53 * 1.5,
    )  # fmt: skip
    right = driver.run(scene, "own:rk4")
    with engines.while_here(found, "this test", "1"):
        driver.run(scene, "rude:x")
        third = np.array([1.0])
        after = (
            os.getcwd(), np.geterr(), signal.getsignal(signal.SIGTERM), locale.setlocale(locale.LC_ALL),
            float((third + 2.0**-53 * 1.5)[0]),
        )  # fmt: skip
    assert after == before
    assert np.array_equal(driver.run(scene, "own:rk4").q, right.q)


def test_a_command_that_prints_endlessly_is_ended(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "spring", "--command", "x=yes {scene} {out}", "--method", "command:x"]) == 2
    assert "more than 64 MiB of output" in capsys.readouterr().err
