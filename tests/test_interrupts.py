"""Ctrl-C and SIGTERM end a program within two seconds, in one line, with no outcome and no verdict.

`validation/interrupts.py` sends a hundred signals to every command; here are a few of each.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import interrupts as interrupting
import springcheck
from springcheck import checks, cli, driver, engines, interrupts, store
from springcheck.engines.own import simulation
from springcheck.physics import scenefile
from springcheck.studies.precision import bare
from springcheck.studies.run import measure as session

posix = pytest.mark.skipif(os.name != "posix", reason="signals are POSIX's")
in_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc to look for processes in")


@contextmanager
def begun(words: Sequence[str], **how: Any) -> Iterator[subprocess.Popen[str]]:
    """A program whose output is caught; it ends with this context: a test of one that does not fails."""
    pipe = subprocess.PIPE
    with subprocess.Popen(words, **{"stdout": pipe, "stderr": pipe, "text": True, **how}) as process:
        try:
            yield process
        finally:
            process.kill()


class Interrupted:
    """A simulation that Ctrl-C meets in its third call."""

    def __init__(self, inner: Any) -> None:
        self._inner, self._calls = inner, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def advance(self, every: int, q: Any, p: Any) -> None:
        self._calls += 1
        if self._calls == 3:
            raise KeyboardInterrupt
        self._inner.advance(every, q, p)


@pytest.fixture
def interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second own method of a run is interrupted within its chunks."""
    start = simulation.start

    def wrapped(scene: Any, method: Any, label: Any, step: float) -> Any:
        begun = start(scene, method, label, step)
        return Interrupted(begun) if label.method == "semi-implicit-euler" else begun

    monkeypatch.setattr(simulation, "start", wrapped)
    monkeypatch.setattr(driver, "FIRST", 2)
    monkeypatch.setattr(driver, "QUICK", 0.0)


@pytest.mark.usefixtures("interrupted")
def test_ctrl_c_in_an_engine_is_no_outcome_and_no_failed_verdict() -> None:
    scene = scenefile.load_scene("spring-uneven")
    with pytest.raises(KeyboardInterrupt):
        springcheck.simulate(scene, "own:semi-implicit-euler")
    with pytest.raises(KeyboardInterrupt):
        checks.judge_thoroughly(scene, "own:semi-implicit-euler", driver.run)


@pytest.mark.usefixtures("interrupted")
def test_ctrl_c_in_an_engine_keeps_what_was_finished(tmp_path: Path) -> None:
    scene, path = scenefile.load_scene("spring-uneven"), tmp_path / "run.h5"
    with pytest.raises(KeyboardInterrupt):
        session.run(scene, path, methods=["own:*euler"], thorough=True)
    assert not path.exists()
    assert [run.label for run in store.summary(path).runs] == ["own:euler"]
    assert not list(tmp_path.rglob("*.new*"))


def test_an_engine_is_asked_for_few_steps_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []

    class Counting:
        force_calls = 0

        def advance(self, every: int, q: Any, p: Any) -> None:
            calls.append(every * len(q))
            q[:], p[:] = 0.0, 0.0

    monkeypatch.setattr(simulation, "start", lambda *_: Counting())
    scene = replace(scenefile.load_scene("spring-uneven"), steps=10**9, every=10**8)
    assert springcheck.simulate(scene, "own:euler").outcome.step == sum(calls) == 10**9
    assert max(calls) <= driver.PIECE
    calls.clear()
    label = engines.parse("own:euler")
    bare.measure(scene, label)
    assert sum(calls) == 10**9
    assert calls[0] <= driver.PIECE


def test_a_slow_engine_is_asked_for_fewer_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks of at most 0.2 s, between which Ctrl-C is noticed."""
    now, seconds = [0.0], []

    class Slow:
        force_calls = 0

        def advance(self, every: int, q: Any, p: Any) -> None:
            seconds.append(0.004 * len(q))
            now[0] += seconds[-1]
            q[:], p[:] = 0.0, 0.0

    monkeypatch.setattr(simulation, "start", lambda *_: Slow())
    monkeypatch.setattr(driver, "perf_counter", lambda: now[0])
    springcheck.simulate(replace(scenefile.load_scene("spring-uneven"), steps=4000), "own:euler")
    assert max(seconds[4:]) <= 0.21
    assert min(seconds[4:-1]) >= 0.05


def test_openmm_moves_in_pieces_as_it_does_in_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    if engines.absence("openmm") is not None:
        pytest.skip("OpenMM is not installed")
    from springcheck.engines.openmm import simulation as openmm

    scene = replace(scenefile.load_scene("spring-uneven"), steps=2100, every=1050)
    for method in ("verlet", "leapfrog", "euler", "semi-implicit-euler"):
        pieces = springcheck.simulate(scene, f"openmm:{method}")
        with monkeypatch.context() as patch:
            patch.setattr(openmm, "ATTENTIVE", 10**6)
            whole = springcheck.simulate(scene, f"openmm:{method}")
        assert np.array_equal(pieces.q, whole.q)
        assert np.array_equal(pieces.p, whole.p)


SCRIPT = """
import sys, time
from springcheck import interrupts, processes
interrupts.install()
try:
    {body}
except BaseException as error:
    if not interrupts.seen():
        raise
    interrupts.leave()
print("went on")
"""


def signalled(body: str, *numbers: int, line: str = "ready\n", **how: Any) -> tuple[int, str, str]:
    """Run a program that says when it is ready, and send it signals -> status, output, errors."""
    with begun([sys.executable, "-c", SCRIPT.format(body=body)], **how) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == line
        for number in numbers:
            process.send_signal(number)
            time.sleep(0.02)  # else the system makes one of them
        out, err = process.communicate(timeout=30)
    return process.returncode, out, err


READY = "print('ready', flush=True); "
DEAF = "\n    while True:\n        try: time.sleep(60)\n        except BaseException: pass"


@posix
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_program_with_one_line(number: int) -> None:
    assert signalled(READY + "time.sleep(60)", number) == (130, "", "springcheck: interrupted\n")


@posix
def test_a_second_signal_prints_nothing_and_spoils_no_tidying_up() -> None:
    body = (
        "interrupts.GRACE = 60\n    try: " + READY + "time.sleep(60)\n    finally:\n        time.sleep(0.3)"
    )
    body += "; print('tidied up', flush=True)"
    assert signalled(body, *[signal.SIGINT] * 5) == (130, "tidied up\n", "springcheck: interrupted\n")


@posix
@pytest.mark.parametrize(
    "body",
    [
        READY + DEAF,
        # native code that does not return
        "import ctypes; " + READY + "ctypes.CDLL(None).sleep(60); time.sleep(60)",
        # a destructor, from which nothing can be raised
        "class Slow:\n        def __del__(self):\n            " + READY + "time.sleep(60)\n"
        "    slow = Slow(); del slow\n    time.sleep(60)",
    ],
)
def test_a_program_that_does_not_hear_the_interrupt_ends_all_the_same(body: str) -> None:
    began = time.monotonic()
    assert signalled(body, signal.SIGINT) == (130, "", "springcheck: interrupted\n")
    assert time.monotonic() - began < 20


@posix
def test_a_signal_that_the_shell_has_ignored_stays_ignored() -> None:
    body = READY + "time.sleep(0.2)"
    script = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN){SCRIPT.format(body=body)}"
    with begun([sys.executable, "-c", script]) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=30)[0] == "went on\n"


@posix
@pytest.mark.parametrize("deaf", [False, True])
def test_no_temporary_folder_outlives_an_interrupt(deaf: bool, tmp_path: Path) -> None:
    body = "\n    with processes.folder() as made:\n        (made / 'file').touch(); " + READY
    body += "time.sleep(60)" if not deaf else DEAF.replace("\n    ", "\n        ")
    found = signalled(
        "interrupts.GRACE = 0.1" + body, signal.SIGINT, env=os.environ | {"TMPDIR": str(tmp_path)}
    )
    assert found == (130, "", "springcheck: interrupted\n")
    assert list(tmp_path.iterdir()) == []


COMMITTED = """from springcheck import store
    from springcheck.physics import scenefile
    from springcheck.store import journal
    import os, signal
    right = journal._remove
    def once(*given):
        os.kill(os.getpid(), signal.SIGINT)
        right(*given)
    made = store.open_new("s.h5", "run")
    journal._remove = once
    made.commit(scenefile.load_scene("spring"))"""


@posix
def test_an_interrupt_after_a_commit_leaves_a_complete_store(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(body=COMMITTED)],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "springcheck: interrupted; s.h5 is complete\n"
    assert store.summary(tmp_path / "s.h5").complete
    with pytest.raises(store.StoreError, match="exists"):
        store.open_new(tmp_path / "s.h5", "run")
    assert [path.name for path in tmp_path.iterdir()] == ["s.h5"]


@in_proc
@pytest.mark.parametrize("deaf", [False, True])
def test_a_program_that_was_called_ends_with_all_that_it_has_started(deaf: bool) -> None:
    words = ["sh", "-c", "sleep 60 & kill -TERM $PPID; wait"]
    body = f"processes.called({words}, 60)"
    if deaf:
        never = DEAF.replace("\n    ", "\n        ")
        body = f"interrupts.GRACE = 0.1\n    def deaf(*_, **__):{never}"
        body += f"\n    import subprocess; subprocess.Popen.wait = deaf; processes.called({words}, 60)"
    with begun([sys.executable, "-c", SCRIPT.format(body=body)], start_new_session=True) as process:
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (130, "", "springcheck: interrupted\n")
    assert interrupting.left(process.pid) == 0


def test_a_program_that_prints_endlessly_or_does_not_end_is_ended() -> None:
    from springcheck import processes

    done = processes.called(["sh", "-c", "while :; do echo xxxxxxxxxxxxxxxxxxxxxxxx; done"], 60, most=1 << 20)
    assert done.returncode != 0
    assert len(done.stdout) < 1 << 21
    assert b"more than 1 MiB of output" in done.stderr
    with pytest.raises(subprocess.TimeoutExpired):
        processes.called(["sleep", "60"], 0.1)
    done = processes.called(["sh", "-c", "echo out; echo err >&2; exit 3"], 60)
    assert (done.returncode, done.stdout, done.stderr) == (3, b"out\n", b"err\n")


COMMANDS = {
    "run --thorough": ("run", "spring-uneven", "--thorough", "--method", "own:*euler"),
    "run --from": ("run", "--from", "input.h5"),
    "stability": ("stability", "spring-uneven", "--method", "own:*euler"),
    "plot": ("plot", "input.h5", "-o", "figures"),
}


@in_proc
@pytest.mark.parametrize("name", COMMANDS)
def test_an_interrupted_command_leaves_nothing(name: str, tmp_path: Path) -> None:
    """Everything but the two seconds, which a loaded machine may not have."""
    given = tmp_path / "input.h5"
    session.run(scenefile.load_scene("spring-uneven"), given, methods=["own:*euler"])
    moment = 1.0
    while True:
        folder = tmp_path / str(moment)
        folder.mkdir()
        shutil.copy(given, folder)
        trial = interrupting.interrupted(COMMANDS[name], folder, moment, number=signal.SIGINT, again=0.1)
        # a signal that came too late has interrupted nothing
        if not trial.too_late:
            break
        moment /= 2
    assert trial.before or [what for what in trial.wrong if not what.endswith(" s")] == []


CRASH = """import os, signal
def start(scene, method, label, step):
    os.kill(os.getpid(), signal.SIGSEGV)
from springcheck.engines import Engine, Method, named
ENGINE = Engine(name="bad", title="", version=dict, start=start,
                methods=named(Method(name="m", scheme="velocity-verlet", about="")))
"""


@posix
def test_a_native_crash_ends_the_program_with_its_signal_and_what_was_finished_is_there(
    tmp_path: Path,
) -> None:
    (tmp_path / "bad.py").write_text(CRASH)
    command = ["run", "spring", "--engine", "bad.py", "--method", "own:euler", "-o", "s.h5"]
    words = [sys.executable, "-m", "springcheck", *command]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout) == (-signal.SIGSEGV, "")
    assert [run.label for run in store.summary(tmp_path / "s.h5").runs] == ["own:euler"]


def test_ctrl_c_of_a_caller_in_python_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from springcheck.cli import listing

    def stopped() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(listing, "listing", stopped)
    assert cli.main(["list"]) == interrupts.STATUS
    assert capsys.readouterr().err == "springcheck: interrupted; nothing was saved\n"
