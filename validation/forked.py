"""Commands in processes that are forked from one which has imported everything: a campaign runs thousands.

One line of JSON asks for a job, commands one after another in one folder, and two lines answer it: the id
of its process at once, and the job's exit status in the end.
"""

from __future__ import annotations

import contextlib
import gc
import io
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MEMORY = 4 << 30
"""Address space of a job [B]."""

CRASHED = 99
"""Exit status of a job that ended in an exception."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What one command of a job did: seconds of the processor, peak memory of the job so far [B]."""

    command: tuple[str, ...]
    status: int
    seconds: float
    memory: int
    out: str
    err: str


class Warm:
    """The process that forks; `before` are words in front of it, such as strace's."""

    def __init__(self, *before: str) -> None:
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [*before, sys.executable, __file__],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ, **threads},
        )  # fmt: skip

    def start(
        self, commands: Sequence[Sequence[str]], folder: Path, temporary: Path | str, **more: Any
    ) -> Warm:
        """Start a job in a folder.  `whole`: nothing is left out (see `_shortened`)."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._answers, self._commands = Path(temporary).with_suffix(".answers"), commands
        job = {"commands": commands, "folder": str(folder), "temporary": str(temporary), **more}
        print(json.dumps({**job, "answers": str(self._answers)}), file=self._process.stdin, flush=True)
        self.pid = int(self._process.stdout.readline())
        return self

    def learn(self, commands: Sequence[Sequence[str]], folder: Path) -> None:
        """Run commands in the process that forks: fonts, templates and tables are then there for all."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps({"commands": commands, "folder": str(folder)}), file=self._process.stdin, flush=True)
        self._process.stdout.readline()

    def __call__(self, command: Sequence[str], folder: Path, temporary: str) -> Warm:
        """Start one command, which ends as a program does."""
        return self.start([command], folder, temporary, alone=True)

    def ended(self) -> bool:
        """Whether the job has ended: a zombie until it is waited for."""
        with contextlib.suppress(OSError):
            return self._stat(self.pid)[0] == "Z"
        return True

    def seconds(self) -> float:
        """Processor time of the job and its workers so far: wall time would measure the machine's load."""
        found, pids = 0, [self.pid]
        while pids:
            pid = pids.pop()
            with contextlib.suppress(OSError):
                found += sum(map(int, self._stat(pid)[11:15]))
                pids += map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
        return found / os.sysconf("SC_CLK_TCK")

    def _stat(self, pid: int) -> list[str]:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()

    def results(self) -> list[Result]:
        """Wait for the job -> what its commands did, up to the one with which it ended."""
        assert self._process.stdout is not None
        status, seconds, memory = json.loads(self._process.stdout.readline())
        found: list[Result] = []
        kept = self._answers.read_text() if self._answers.exists() else ""
        for number, command in enumerate(self._commands):
            try:
                out, err = (self._stream(number, name) for name in ("out", "err"))
            except FileNotFoundError:
                break
            said = kept.splitlines()[number : number + 1]
            state = json.loads(said[0]) if said else (status, seconds, memory)
            status_of = dict(zip(("status", "seconds", "memory"), state, strict=True))
            found.append(Result(command=tuple(command), **status_of, out=out, err=err))
        self._answers.unlink(missing_ok=True)
        return found

    def _stream(self, number: int, name: str) -> str:
        path = self._answers.with_suffix(f".{number}.{name}")
        text = path.read_bytes().decode(errors="backslashreplace")
        path.unlink()
        return text

    def wait(self) -> tuple[int, str, str]:
        """Exit status, output and errors of the one command of a job."""
        only = self.results()[-1]
        return only.status, only.out, only.err

    def close(self) -> None:
        """End it."""
        self._process.communicate()


def _serve() -> None:
    """Fork a process for each line; in it, this returns what main returns."""
    from springcheck import __main__ as program
    from springcheck import cli

    _import()
    for line in sys.stdin:
        job = json.loads(line)
        if "answers" not in job:
            with (
                contextlib.chdir(job["folder"]),
                redirect_stdout(io.StringIO()),
                redirect_stderr(io.StringIO()),
            ):
                for command in job["commands"]:
                    cli.main(command)
            print(flush=True)
            continue
        gc.freeze()
        child = os.fork()
        if child == 0:
            os.setsid()
            os.dup2(os.open(os.devnull, os.O_RDWR), 0)
            os.chdir(job["folder"])
            os.environ["TMPDIR"] = tempfile.tempdir = job["temporary"]
            answers = Path(job["answers"])
            if job.get("alone"):
                _streams(answers, 0)
                sys.argv[1:] = job["commands"][0]
                sys.exit(program.main())
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            if not job.get("whole", True):
                _shortened()
            _perform(job["commands"], answers)
        print(child, flush=True)
        # it stays a zombie as long as it may get a signal: its number is not given away
        os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)
        _, raw, usage = os.wait4(child, 0)
        seconds, memory = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024
        print(json.dumps([os.waitstatus_to_exitcode(raw), seconds, memory]), flush=True)


def _streams(answers: Path, number: int) -> None:
    for stream, name in ((1, "out"), (2, "err")):
        file = os.open(answers.with_suffix(f".{number}.{name}"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, stream)
        os.close(file)


def _perform(commands: Sequence[Sequence[str]], answers: Path) -> None:
    """Run commands as the program does, signals and all; keep what each did, and leave."""
    from springcheck import __main__ as program
    from springcheck import interrupts

    interrupts.install()
    interrupts.install, interrupts.finish = (lambda: None), (lambda: None)
    before = 0.0
    for number, command in enumerate(commands):
        _streams(answers, number)
        interrupts._State.errors = 2
        sys.argv[1:] = command
        try:
            # this process is forked already: one that waits for another would carry out what follows as well
            status = program._main()
            sys.stdout.flush()
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
        except BaseException:
            traceback.print_exc()
            status = CRASHED
        sys.stderr.flush()
        usage = [resource.getrusage(x) for x in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        seconds = sum(x.ru_utime + x.ru_stime for x in usage)
        with answers.open("a") as file:
            said = [status, seconds - before, max(x.ru_maxrss for x in usage) * 1024]
            print(json.dumps(said), file=file)
        before = seconds
    os._exit(0)


def _shortened() -> None:
    """Leave out what takes longest: figures, and the start of Python in the process that tries a file."""
    from springcheck.store import apart
    from springcheck.studies import study

    setattr(study.Study, "draw", lambda *_, **__: [])  # noqa: B010
    size = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")

    def read(module: str, function: str, path: Path, *words: str) -> bytes:
        limit = apart.LIMIT + path.stat().st_size / apart.SPEED
        pipe, write = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                apart._limit(int(limit) + 1, apart.MEMORY + size)
                os.dup2(os.open(os.devnull, os.O_RDWR), 2)
                found = apart.answer(module, function, path, *words)
                with open(write, "wb") as answer:
                    answer.write(found)
            finally:
                # what is raised is no answer
                os._exit(int(sys.exc_info()[0] is not None))
        os.close(write)
        signal.signal(signal.SIGALRM, lambda *_: os.kill(child, signal.SIGKILL))
        signal.setitimer(signal.ITIMER_REAL, 6 * limit)
        with open(pipe, "rb") as answer:
            said = answer.read()
        ended = os.waitpid(child, 0)[1]
        signal.setitimer(signal.ITIMER_REAL, 0)
        if ended:
            raise apart.EndedError("does not end as it should")
        return apart.heard(said)

    setattr(apart, "read", read)  # noqa: B010


def _import() -> None:
    """Import what the commands import, so that a forked one need not."""
    from scipy import special  # noqa: F401

    from springcheck import driver, formats, plot  # noqa: F401
    from springcheck.cli import commands, file, inspect, page  # noqa: F401
    from springcheck.figures import render  # noqa: F401
    from springcheck.identify import files, stepper  # noqa: F401
    from springcheck.studies.precision import measure  # noqa: F401
    from springcheck.studies.run import page as f2  # noqa: F401
    from springcheck.studies.stability import measure as m1  # noqa: F401


if __name__ == "__main__":
    _serve()
