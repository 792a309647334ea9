"""Other programs, started with bounds on their time and output, and ended with all that they have started."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from springcheck import interrupts

MOST_OUTPUT = 1 << 26
"""Bytes of a program's output, and of its messages."""


@contextlib.contextmanager
def deferred() -> Iterator[None]:
    """Signals that come in here are heard at its end: a program that is just being started would be lost."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handlers = {number: signal.getsignal(number) for number in interrupts.SIGNALS}
    for number, handler in handlers.items():
        if callable(handler):
            signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            if callable(handler):
                signal.signal(number, handler)
        for number in came[:1]:
            signal.raise_signal(number)


@contextlib.contextmanager
def folder(*, prefix: str | None = None, dir: Path | None = None) -> Iterator[Path]:
    """A temporary folder, which no interrupt leaves behind."""
    from tempfile import TemporaryDirectory

    made = TemporaryDirectory(prefix=prefix, dir=dir, ignore_cleanup_errors=True)
    interrupts.takes(made.cleanup)
    try:
        with made as name:
            yield Path(name)
    finally:
        interrupts.forget(made.cleanup)


def called(
    words: Sequence[str], seconds: float, *, most: int = MOST_OUTPUT, **how: Any
) -> subprocess.CompletedProcess[bytes]:
    """Run a program and capture its output; on leaving, it ends with all that it has started.

    A program that prints more than `most` bytes is ended, and the last line of its messages says so.  Raises
    OSError where there is no such program, subprocess.TimeoutExpired after so many seconds.
    """
    out, err = bytearray(), bytearray()

    def kill() -> None:
        try:
            os.killpg(program.pid, signal.SIGKILL)
        except AttributeError:
            program.kill()  # on Windows
        except OSError:
            return

    def drain(stream: Any, into: bytearray) -> None:
        # after an interrupt the stream may be closed while it is read
        with contextlib.suppress(ValueError, OSError):
            while block := stream.read1(1 << 16):
                into += block
                if len(into) > most:
                    kill()
                    err.extend(f"\nmore than {most >> 20} MiB of output\n".encode())
                    return

    pipe = subprocess.PIPE
    with deferred():
        program = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, process_group=0, **how
        )
        interrupts.takes(kill)
    try:
        with program:
            streams = ((program.stdout, out), (program.stderr, err))
            threads = [threading.Thread(target=drain, args=both, daemon=True) for both in streams]
            try:
                for thread in threads:
                    thread.start()
                program.wait(timeout=seconds)
            finally:
                kill()
            for thread in threads:
                thread.join()
    finally:
        interrupts.forget(kill)
    return subprocess.CompletedProcess(words, program.returncode, bytes(out), bytes(err))
