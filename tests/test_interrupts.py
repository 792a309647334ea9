"""Ctrl-C and SIGTERM go through everything: no outcome, no verdict, no traceback, nothing left behind.

`validation/interrupts.py` sends hundreds of signals to every command; here are a few of each.
"""

from __future__ import annotations

import importlib.util
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import forked
import springcheck
from springcheck import checks, cli, driver, engines, interrupts, store
from springcheck.cli import listing
from springcheck.engines.own import simulation
from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile
from springcheck.studies import workers
from springcheck.studies.run import measure as session

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "validation"))
_spec = importlib.util.spec_from_file_location("interrupting", ROOT / "validation" / "interrupts.py")
assert _spec is not None
assert _spec.loader is not None
interrupting = importlib.util.module_from_spec(_spec)
sys.modules["interrupting"] = interrupting
_spec.loader.exec_module(interrupting)

posix = pytest.mark.skipif(os.name != "posix", reason="signals are POSIX's")


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
def test_ctrl_c_in_an_engine_is_no_outcome() -> None:
    scene = scenefile.load_scene("spring-uneven")
    with pytest.raises(KeyboardInterrupt):
        springcheck.simulate(scene, "own:semi-implicit-euler")


@pytest.mark.usefixtures("interrupted")
def test_ctrl_c_in_an_engine_leaves_no_verdict_and_keeps_what_was_finished(tmp_path: Path) -> None:
    scene, path = scenefile.load_scene("spring-uneven"), tmp_path / "run.h5"
    with pytest.raises(KeyboardInterrupt):
        session.run(scene, path, methods=["own:*euler"], thorough=True)
    assert not path.exists()
    assert [run.label for run in store.summary(path).runs] == ["own:euler"]
    assert not list(tmp_path.rglob("*.new*"))


@pytest.mark.usefixtures("interrupted")
def test_ctrl_c_in_an_experiment_is_no_failed_verdict() -> None:
    scene = scenefile.load_scene("spring-uneven")
    with pytest.raises(KeyboardInterrupt):
        checks.judge_thoroughly(scene, "own:semi-implicit-euler", driver.run)


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
    driver.bare(scene, label)
    assert sum(calls) == 10**9
    assert calls[0] <= driver.PIECE
    monkeypatch.setattr(driver, "UNHEARD", 0.0)
    driver.bare(scene, label)
    assert max(calls[-(10**4) :]) <= driver.PIECE


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


def test_an_error_after_the_interrupt_is_the_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As where NumPy turns an interrupted import into an ImportError, or HDF5 into a RuntimeError."""

    def fails() -> None:
        raise SpringcheckError("cannot be imported")

    monkeypatch.setattr(listing, "listing", fails)
    assert cli.main(["list"]) == 2
    monkeypatch.setattr(interrupts._State, "seen", True)
    assert cli.main(["list"]) == interrupts.STATUS
    assert capsys.readouterr().err.endswith("springcheck: interrupted; nothing is kept\n")


SCRIPT = """
import sys, time
from springcheck import interrupts
interrupts.install()
try:
    {body}
except BaseException as error:
    if not interrupts.seen():
        raise
    interrupts.leave()
print("went on")
"""


def signalled(body: str, *numbers: int) -> tuple[int, str, str]:
    """Run a program that says when it is ready, and send it signals -> status, output, errors."""
    with begun([sys.executable, "-c", SCRIPT.format(body=body)]) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        for number in numbers:
            process.send_signal(number)
            time.sleep(0.02)  # else the system makes one of them
        out, err = process.communicate(timeout=30)
    return process.returncode, out, err


READY = "print('ready', flush=True); "


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
def test_a_program_that_swallows_the_interrupt_ends_all_the_same() -> None:
    body = READY + "\n    while True:\n        try: time.sleep(60)\n        except BaseException: pass"
    assert signalled(body, signal.SIGINT) == (130, "", "springcheck: interrupted\n")


@posix
def test_an_interrupt_in_a_destructor_is_raised_outside_of_it() -> None:
    body = (
        "interrupts.GRACE = 0.3\n    class Slow:\n        def __del__(self):\n            "
        + READY
        + "time.sleep(60)\n"
        "    slow = Slow(); del slow\n    time.sleep(60)"
    )
    assert signalled(body, signal.SIGINT) == (130, "", "springcheck: interrupted\n")


@posix
def test_an_interrupt_waits_where_files_must_not_be_left_half_done() -> None:
    body = (
        "interrupts.GRACE = 60\n    with interrupts.held(): "
        + READY
        + "time.sleep(0.3); print('done', flush=True)\n    time.sleep(60)"
    )
    assert signalled(body, signal.SIGTERM) == (130, "done\n", "springcheck: interrupted\n")


CAUGHT = """
import os, signal, sys, time
from springcheck import __main__
from springcheck.cli import listing
def deaf():
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(60)
listing.listing = deaf
sys.argv[1:] = ["list"]
sys.exit(__main__.main())
"""


@posix
def test_the_one_line_is_said_where_a_library_s_messages_are_still_caught() -> None:
    """The signal may come between the catching of standard error and the place that gives it back."""
    done = subprocess.run(
        [sys.executable, "-c", CAUGHT], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "springcheck: interrupted; nothing is kept\n"


ANSWERED = """
import os, signal, sys
from springcheck import __main__, interrupts
from springcheck.cli import output
place, shown, finish = {place!r}, output.show, interrupts.finish
def signalled(number):
    os.kill(os.getpid(), number)
def show(lines):
    if place == "before":
        signalled(signal.SIGINT)
    shown(lines)
    if place == "shown":
        signalled(signal.SIGINT)
def finished():
    finish()
    if place == "finished":
        signalled(signal.SIGTERM)
output.show, interrupts.finish = show, finished
sys.argv[1:] = ["list"]
sys.exit(__main__.main())
"""


@posix
@pytest.mark.parametrize("place", ["never", "shown", "finished", "before"])
def test_an_answer_is_printed_whole_or_not_at_all(place: str) -> None:
    """With its last line a command has ended: exit status 130 beside verdicts would take them back."""
    words = [sys.executable, "-c", ANSWERED.format(place=place)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert done.stderr == ""
    assert done.returncode == 0
    assert done.stdout.count("\n") > 10


def test_no_answer_is_printed_once_an_interrupt_was_swallowed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(interrupts._State, "seen", True)
    assert cli.main(["list"]) == interrupts.STATUS
    assert capsys.readouterr().out == ""


@posix
def test_an_interrupt_ends_a_command_whose_reader_takes_no_more() -> None:
    body = "interrupts.GRACE = 0.3\n    with interrupts.last(): " + READY + "print('x' * 10**7)"
    out, into = os.pipe()
    with begun([sys.executable, "-c", SCRIPT.format(body=body)], stdout=into) as process:
        os.close(into)
        assert os.read(out, 5) == b"ready"
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == interrupts.STATUS
        assert process.stderr is not None
        assert process.stderr.read() == "springcheck: interrupted\n"
    os.close(out)


COMMITTED = """from springcheck import store
    from springcheck.physics import scenefile
    from springcheck.store import adopt
    import os, signal
    settled = adopt.settled
    def once(folder):
        os.kill(os.getpid(), signal.SIGINT)
        settled(folder)
    adopt.settled = once
    journal = store.open_new("s.h5", "run")
    journal.commit(scenefile.load_scene("spring"))"""


@posix
def test_a_commit_that_has_replaced_the_store_takes_its_journal_away(tmp_path: Path) -> None:
    """An interrupt between the two would leave a complete store beside a journal that says it is not."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(body=COMMITTED)],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "springcheck: interrupted; s.h5 is complete\n"
    assert [path.name for path in tmp_path.iterdir()] == ["s.h5"]
    assert store.summary(tmp_path / "s.h5").complete


def test_an_interrupt_as_the_new_store_is_opened_leaves_no_half_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then libhdf5 has the file open, and nothing but a frame of h5py knows of it."""
    right, scene = h5py.h5f.open, scenefile.load_scene("spring")

    def opened(name: Any, *rest: Any, **named: Any) -> Any:
        handle = right(name, *rest, **named)
        if os.fsdecode(name).endswith("collection.new"):
            raise KeyboardInterrupt
        return handle

    with store.open_new(tmp_path / "s.h5", "run") as journal:
        with monkeypatch.context() as patch:
            patch.setattr(h5py.h5f, "open", opened)
            with pytest.raises(KeyboardInterrupt):
                journal.commit(scene)
        assert sorted(path.name for path in journal.folder.iterdir()) == ["command", "lock"]
        journal.commit(scene)
    assert store.summary(tmp_path / "s.h5").complete


@posix
@pytest.mark.parametrize(
    "body",
    [
        # as its removal begins
        "import shutil; right = shutil.rmtree\n"
        "    def removed(name, **how): os.kill(os.getpid(), signal.SIGINT); right(name, **how)\n"
        "    shutil.rmtree = removed\n"
        "    with interrupts.folder() as made: (made / 'file').touch()",
        # where nobody comes to remove it in time
        "interrupts.GRACE = 0.1\n"
        "    with interrupts.folder() as made:\n"
        "        (made / 'file').touch(); os.kill(os.getpid(), signal.SIGINT)\n"
        "        while True:\n"
        "            try: time.sleep(60)\n"
        "            except BaseException: pass",
    ],
)
def test_no_temporary_folder_outlives_an_interrupt(body: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(body="import os, signal\n    " + body)],
        env=os.environ | {"TMPDIR": str(tmp_path)}, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "springcheck: interrupted\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc to look for processes in")
@pytest.mark.parametrize("swallowed", [False, True])
def test_a_program_that_was_called_ends_with_all_that_it_has_started(swallowed: bool) -> None:
    words = ["sh", "-c", "sleep 60 & kill -TERM $PPID; wait"]
    body = f"interrupts.called({words}, 60)"
    if swallowed:
        body = (
            "def deaf(*_, **__):\n"
            "        while True:\n"
            "            try: time.sleep(60)\n"
            "            except BaseException: pass\n"
            f"    interrupts.GRACE = 0.1; import subprocess; subprocess.Popen.communicate = deaf; {body}"
        )
    with begun([sys.executable, "-c", SCRIPT.format(body=body)], start_new_session=True) as process:
        out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (130, "", "springcheck: interrupted\n")
    assert interrupting._left(process.pid) == 0


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc to look for processes in")
@pytest.mark.parametrize("signals", [("SIGHUP",), ("SIGQUIT",), ("SIGINT", "SIGINT")])
def test_a_command_ends_with_its_grandchildren_whatever_signal_comes(
    signals: tuple[str, ...], tmp_path: Path
) -> None:
    """A terminal sends its signals to every process of the group, the program's parent among them."""
    (tmp_path / "slow.sh").write_text(f"#!/bin/sh\nsleep 60 &\ntouch {tmp_path}/begun\nsleep 60\n")
    (tmp_path / "slow.sh").chmod(0o755)
    command = ["run", "spring", "--command", "x=./slow.sh {scene} {out}", "--method", "command:x"]
    words = [sys.executable, "-m", "springcheck", *command]
    with begun(words, cwd=tmp_path, start_new_session=True) as process:
        while not (tmp_path / "begun").exists() and process.poll() is None:
            time.sleep(0.05)
        for name in signals:
            os.killpg(process.pid, getattr(signal, name))
            time.sleep(0.05)
        _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err.startswith("springcheck: interrupted")
    assert interrupting._left(process.pid) == 0


HELD = """import os, time
def held():
    open("begun", "w").write(str(os.getpid()))
    {act}
from springcheck.engines import Engine, Method, named
ENGINE = Engine(name="held", title="", version=held, start=held,
                methods=named(Method(name="m", scheme="velocity-verlet", about="")))
"""


@posix
def test_a_program_ends_with_the_parent_that_waits_for_it(tmp_path: Path) -> None:
    """What kills the parent alone, as a queue's limit of time does, was meant for the program."""
    (tmp_path / "held.py").write_text(HELD.format(act="time.sleep(60)"))
    words = [
        sys.executable,
        "-m",
        "springcheck",
        "run",
        "spring",
        "--engine",
        "held.py",
        "--method",
        "held:m",
    ]
    with begun(words, cwd=tmp_path) as process:
        until = time.monotonic() + 30
        while not (tmp_path / "begun").exists() or not (tmp_path / "begun").read_text():
            assert process.poll() is None
            assert time.monotonic() < until
            time.sleep(0.02)
        program = int((tmp_path / "begun").read_text())
        assert program != process.pid
        process.kill()
        # its ends of the pipes are closed when it is gone
        try:
            process.communicate(timeout=5)
        except subprocess.TimeoutExpired:
            os.kill(program, signal.SIGKILL)
            raise


@posix
def test_a_program_that_somebody_kills_is_not_begun_anew(tmp_path: Path) -> None:
    """As the kernel does where memory runs out: the engine that was called has not ended it."""
    (tmp_path / "held.py").write_text(HELD.format(act="os.kill(os.getpid(), 9)"))
    words = [
        sys.executable,
        "-m",
        "springcheck",
        "run",
        "spring",
        "--engine",
        "held.py",
        "--method",
        "held:m",
    ]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, "")


@posix
def test_a_signal_is_heard_after_a_library_has_taken_it_in_c() -> None:
    """UCX, which MPI loads, prints its state at SIGHUP from then on, and so nothing ended."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(body="""import ctypes, os, signal, time
    from springcheck.engines import foreign
    with foreign("x", "x"):
        ctypes.CDLL(None).signal(signal.SIGHUP, ctypes.cast(1, ctypes.c_void_p))
    os.kill(os.getpid(), signal.SIGHUP)
    time.sleep(5)""")],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (130, "springcheck: interrupted\n")


SLOW_DISK = """interrupts.GRACE = 0.1
    import ctypes, os, signal, threading
    from springcheck import driver, store
    from springcheck.physics import scenefile
    right, calls = os.fsync, []
    def slow(file):
        calls.append(file)
        if len(calls) == {number}:
            threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
            # a thread beside this one gets it, which stays in the system's call
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
            ctypes.CDLL(None).sleep(30)
        right(file)
    os.fsync = slow
    scene = scenefile.load_scene("spring")
    journal = store.open_new("s.h5", "run")
    journal.save(driver.run(scene, "own:euler"), scene)
    journal.commit(scene)"""


@posix
@pytest.mark.parametrize("number", [1, 4, 6])
def test_a_disk_that_does_not_answer_leaves_no_half_written_file(number: int, tmp_path: Path) -> None:
    """The claim, a trajectory and the store, each as it is synced: nobody comes back to remove it."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(body=SLOW_DISK.format(number=number))],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "springcheck: interrupted\n")
    left = {1: {"lock"}, 4: {"lock", "command"}, 6: {"lock", "command", "run-own%3Aeuler.h5"}}
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} == left[number]


SHOWN = """
import os, signal, sys
from springcheck import __main__
right = os.fsync
def synced(file):
    os.kill(os.getpid(), signal.SIGINT)
    right(file)
os.fsync = synced
sys.argv[1:] = ["show", "spring", "-o", "my.toml"]
sys.exit(__main__.main())
"""


@posix
def test_an_interrupt_leaves_no_file_half_written(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SHOWN], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "springcheck: interrupted; no file is half written\n"
    assert [*tmp_path.iterdir()] == []


@posix
def test_a_signal_that_the_shell_has_ignored_stays_ignored() -> None:
    body = READY + "time.sleep(0.2)"
    script = f"import signal; signal.signal(signal.SIGINT, signal.SIG_IGN){SCRIPT.format(body=body)}"
    with begun([sys.executable, "-c", script]) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=30)[0] == "went on\n"


def doubled(number: int) -> int:
    return 2 * number


def failing() -> int:
    raise SpringcheckError("a part went wrong")


def test_workers_carry_out_every_part_once() -> None:
    parts = [partial(doubled, i) for i in range(9)]
    assert sorted(workers.carried_out(parts, 1)) == sorted(workers.carried_out(parts, 2))
    with pytest.raises(SpringcheckError, match="a part went wrong"):
        list(workers.carried_out([failing, *parts], 2))


def test_a_worker_that_dies_is_an_error() -> None:
    with pytest.raises(SpringcheckError, match="exit status 7"):
        list(workers.carried_out([partial(os._exit, 7), partial(doubled, 1)], 2))


def test_workers_of_a_program_without_a_file_are_refused_in_one_line() -> None:
    """Each would run the program again, and end as it looks for the file "<stdin>"."""
    code = (
        "import operator\nfrom functools import partial\nfrom springcheck.studies import workers\n"
        "from springcheck.errors import SpringcheckError\n"
        "try:\n    list(workers.carried_out([partial(operator.add, 1, 2)] * 3, 2))\n"
        "except SpringcheckError as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-"], input=code, capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "need the program as a file, which <stdin> is not" in done.stdout


@posix
def test_a_worker_that_dies_before_it_reads_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then the system resets the connection instead of closing it."""
    monkeypatch.setattr(workers, "_work", os._exit)
    with pytest.raises(SpringcheckError, match="a worker process has ended by itself"):
        list(workers.carried_out([partial(len, "x" * 10**7)] * 2, 2))


@posix
def test_workers_end_when_they_are_left() -> None:
    found = workers.carried_out([partial(time.sleep, 600), partial(doubled, 1), partial(doubled, 2)], 2)
    next(found)
    began = time.process_time()
    found.close()
    assert time.process_time() - began < 60


LIMITED = {
    "run --thorough": ("run", "spring-uneven", "--thorough", "--method", "own:*euler"),
    "run --from": ("run", "--from", "input.h5"),
    "stability": ("stability", "spring-uneven", "--method", "own:*euler"),
    "extremes": ("extremes", "--quick", "--method", "own:euler"),
    "faults": ("faults",),
    "plot": ("plot", "input.h5", "-o", "figures"),
    "identify": ("identify", "input.h5"),
}


@pytest.fixture(scope="module")
def uneven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("uneven") / "input.h5"
    session.run(scenefile.load_scene("spring-uneven"), path, methods=["own:*euler"])
    return path


def at_work(start: Callable[..., Any], *given: Any) -> Any:
    """A command that has forked the process which does its work: from there on each signal is ours."""
    command = start(*given)
    while not (command.ended() or Path(f"/proc/{command.pid}/task/{command.pid}/children").read_text()):
        time.sleep(0.001)
    return command


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc to look for processes in")
@pytest.mark.parametrize("name", LIMITED)
def test_an_interrupted_command_leaves_nothing(
    name: str, tmp_path: Path, uneven: Path, server: forked.Warm, whole: bool
) -> None:
    """Everything but the two seconds, which a loaded machine may not have."""
    rng = random.Random(f"{name} 20261121")
    # every third command imports what it needs as it goes, every second gets a second signal
    number = list(LIMITED).index(name)
    start, latest = (server, 0.6) if number % 3 else (interrupting.Fresh, 1.2)
    begin = partial(at_work, start)
    for again in (0.0, 0.1) if whole else (0.1 * (number % 2),):
        moment = rng.uniform(latest / 6, latest)
        # a signal that came too late has interrupted nothing
        while True:
            folder = tmp_path / f"{again} {moment}"
            folder.mkdir()
            shutil.copy(uneven, folder)
            trial = interrupting.interrupted(
                LIMITED[name], folder, moment, number=signal.SIGINT, again=again, start=begin
            )
            if not trial.too_late:
                break
            moment /= 2
        assert not trial.before, (trial.status, trial.err)
        assert [what for what in trial.wrong if not what.endswith(" s")] == []


HALF_MADE = """
import os, signal
from springcheck import interrupts

class Half:
    def __init__(self):
        {fails}
        self.made = True

    def __del__(self):
        self.made

interrupts.install()
try:
    Half()
except (KeyboardInterrupt, ValueError):
    pass
interrupts.leave()
"""


@posix
def test_an_object_that_an_interrupt_left_half_made_is_not_mentioned() -> None:
    """A library's destructor then misses what its constructor had not set yet."""

    def said(fails: str) -> str:
        code = HALF_MADE.format(fails=fails)
        return subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
        ).stderr

    assert said("os.kill(os.getpid(), signal.SIGINT)") == "springcheck: interrupted\n"
    # its own mistakes are
    assert "AttributeError" in said("raise ValueError")
