"""Ctrl-C and SIGTERM: one KeyboardInterrupt through everything, and an end within two seconds.

A program that foreign code ends (`os._exit`, a crash) names it, and has no result.  Only the program's entry
point installs this: a library leaves signals to the program that imports it.  Only modules that the
interpreter has loaded by itself are imported, so that no moment is left without it.
"""

from __future__ import annotations

import _thread
import atexit
import contextlib
import os
import signal
import sys
import time

TYPE_CHECKING = False
if TYPE_CHECKING:
    import subprocess
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path
    from typing import Any, ClassVar

STATUS = 130
"""Exit status of an interrupted program, as shells expect it."""

BROKEN_PIPE = 141
"""Exit status of a program whose output nobody reads any more: 128 + SIGPIPE, as in shells."""

GRACE = 1.5
"""Seconds from the signal to the end of the process, whatever it is doing: native code that does not return,
a library that has swallowed the exception, a terminal that takes no more output."""

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
SIGNALS = tuple(getattr(signal, name) for name in _NAMES if hasattr(signal, name))
"""Signals that end a program, as far as this system has them."""


class _State:
    """Signal state of this process; signals belong to the process, so there is one of it."""

    seen = False
    """A signal has come."""
    raised = False
    """Its KeyboardInterrupt is on its way; further signals are ignored."""
    held = 0
    answered = False
    """All that the command prints is printed."""
    message = "interrupted"
    ends: ClassVar[set[Callable[[], object]]] = set()
    """Called as the process ends, wherever it is: to remove temporary folders and end child processes."""
    board: Any = None
    """Memory shared with the parent process: whether the program has ended by itself, and what it calls."""
    ended: ClassVar[dict[str, str]] = {}
    """Foreign code that has ended the program before, and how."""
    mask: Any = None
    lifeline = -1
    """File descriptor that closes with the parent process."""
    errors = 2
    """Standard error as it was: a library's messages may be captured as the signal comes."""


def install() -> None:
    """Turn the first signal into a KeyboardInterrupt; ignore later ones; end the process in time."""
    _State.errors = os.dup(2)
    sys.excepthook, sys.unraisablehook = _uncaught, _unraisable
    for number in _heard():
        signal.signal(number, _raise)
    if os.name == "posix":
        read, write = os.pipe()
        os.set_blocking(write, False)
        signal.set_wakeup_fd(write, warn_on_full_buffer=False)
        _thread.start_new_thread(_watch, (read,))
    if _State.mask is not None:
        _thread.start_new_thread(_end_with_parent, (_State.lifeline,))
        signal.pthread_sigmask(signal.SIG_SETMASK, _State.mask)


def _heard() -> list[signal.Signals]:
    """Signals that are not ignored, as nohup and shells that start a command in the background have some."""
    return [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]


def _end_with_parent(lifeline: int) -> None:
    """Kill this process when its parent is gone, for which the signal was meant."""
    os.read(lifeline, 1)
    os.kill(os.getpid(), signal.SIGKILL)


def supervised() -> int | None:
    """Run the program in a child process -> its exit status; None in the child.

    What a plug-in or a library does to it (`os._exit`, SIGSEGV, SIGABRT ...) ends the child alone.  Where it
    is known which of them was called (see `calling`), the program is started again: it resumes what was
    finished, and refuses those that ended it (see `ended_by`).  Closed standard streams are redirected to the
    null device; what is printed to a closed standard output fails (EBADF).
    """
    for stream in (0, 1, 2):
        try:
            os.fstat(stream)
        except OSError:
            # a file or a pipe that is opened later would take its descriptor, and receive what is printed
            os.open(os.devnull, os.O_RDONLY if stream == 1 else os.O_RDWR)
    if not hasattr(os, "fork") or os.environ.get("SPRINGCHECK_TRACEBACK"):
        return None
    import mmap

    _State.board = board = mmap.mmap(-1, _PAGE)
    heard = _heard()
    while True:
        _State.lifeline, held = os.pipe()
        # a signal between here and `install` waits for it
        _State.mask = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        child = os.fork()
        if child == 0:
            for number in heard:
                signal.signal(number, signal.SIG_DFL)
            os.close(held)
            return None
        os.close(_State.lifeline)
        status = _waited_for(child, heard)
        os.close(held)
        if board[0]:
            return int(board[1])
        if -status in (signal.SIGKILL, *SIGNALS):
            # the child ended by a signal; end in the same way
            os.kill(os.getpid(), -status)
        name = bytes(board[2:]).partition(b"\0")[0].decode("utf-8", "replace")
        how = f"ended the program (exit status {status})"
        if status < 0:
            how = f"crashed ({signal.Signals(-status).name})"
        if _State.seen or not name or name in _State.ended:
            sys.stderr.write(f"springcheck: {name or 'code that it was given, or a library'} {how}\n")
            return 2
        _State.ended[name] = f"it {how}"


def _waited_for(child: int, heard: Sequence[int]) -> int:
    """The exit status of a child, to which signals of this process are forwarded."""

    def forward(number: int, frame: object) -> None:
        _State.seen = True
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, number)

    for number in heard:
        signal.signal(number, forward)
    signal.pthread_sigmask(signal.SIG_SETMASK, _State.mask)
    _, raw = os.waitpid(child, 0)
    # a program that has ended by itself keeps its exit status, whatever comes while this interpreter shuts
    # down
    then = signal.SIG_IGN if _State.board[0] else signal.SIG_DFL
    for number in heard:
        signal.signal(number, then)
    return os.waitstatus_to_exitcode(raw)


_PAGE = 4096


def calling(name: str) -> None:
    """Foreign code of this name is called from here on; "" for none.

    Where it has replaced our handler in C, as UCX below MPI does for SIGHUP, ours is restored.
    """
    if _State.board is not None:
        _State.board[2:_PAGE] = name.encode("utf-8", "replace")[: _PAGE - 3].ljust(_PAGE - 2, b"\0")
    for number in () if name else SIGNALS:
        # Python does not notice a handler that is set in C; only the main thread may set one
        if signal.getsignal(number) is _raise:
            with contextlib.suppress(ValueError):
                signal.signal(number, _raise)


def ended_by(*names: str) -> str:
    """How code of one of these names has ended the program before; "" where none has."""
    return next((_State.ended[name] for name in names if name in _State.ended), "")


def ends(status: int) -> int:
    """The program ends by itself, with this exit status, whatever happens to it from here on."""
    if _State.board is not None:
        _State.board[0:2] = bytes((1, status & 0xFF))
    return status


def unread() -> int:
    """The reader of standard output is gone: discard the rest -> `BROKEN_PIPE`."""
    for stream in (1, 2):
        # at shutdown the interpreter would complain that buffered output cannot be written
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    return BROKEN_PIPE


def over(status: int) -> int:
    """End the program, after libraries' exit handlers; under a profiler, a debugger or coverage, which have
    work left to do, return its exit status.

    The interpreter would tear down every module first, a twentieth of the smallest run's time, and wait for
    threads that a plug-in or a library has left.
    """
    if sys.getprofile() is None and sys.gettrace() is None:
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            # as far as they are open
            with contextlib.suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(status)
    return status


def seen() -> bool:
    """Whether a signal has come: later findings of the program are no result."""
    return _State.seen


def announce(message: str) -> None:
    """Set the line that an interrupt prints from here on, unless it has been printed."""
    _State.message = message


def say() -> None:
    """Print once what an interrupt has left behind, to the original standard error."""
    message, _State.message = _State.message, ""
    if not message:
        return
    if _State.errors == 2:
        sys.stderr.write(f"springcheck: {message}\n")
        return
    # a progress bar may have hidden the cursor
    shown = "\x1b[?25h" if os.isatty(_State.errors) else ""
    with contextlib.suppress(OSError):
        os.write(_State.errors, f"{shown}springcheck: {message}\n".encode(errors="backslashreplace"))


def finish() -> None:
    """Ignore signals from here on: nothing is left to interrupt."""
    for number in SIGNALS:
        # a library's caller keeps its own
        if signal.getsignal(number) is _raise:
            signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def last() -> Iterator[None]:
    """Print the answer of a command in here: it is the command's end, an interrupt that comes now too late.

    One whose reader takes no more ends all the same, interrupted.
    """
    if _State.seen:
        raise KeyboardInterrupt
    with held():
        yield
        sys.stdout.flush()
        finish()
        _State.answered, _State.seen = True, False


def leave() -> None:
    """End an interrupted process now, with one line and none from the interpreter's shutdown."""
    for end in list(_State.ends):
        with contextlib.suppress(Exception):
            end()
    say()
    # what standard output holds is no result, and its reader may take no more
    os._exit(ends(STATUS))


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Defer an interrupt while files are made or removed that must not be left half done; be brief."""
    _State.held += 1
    try:
        yield
    finally:
        _State.held -= 1
    if _State.seen and not (_State.held or _State.raised):
        _State.raised = True
        raise KeyboardInterrupt


def takes(end: Callable[[], object]) -> None:
    """Call `end` when an interrupt ends the process; `forget` cancels it."""
    _State.ends.add(end)


def forget(end: Callable[[], object]) -> None:
    """See `takes`."""
    _State.ends.discard(end)


@contextlib.contextmanager
def folder(*, prefix: str | None = None, dir: Path | None = None) -> Iterator[Path]:
    """A temporary folder, as `tempfile.mkdtemp` makes it, that no interrupt leaves behind."""
    import shutil
    from pathlib import Path
    from tempfile import mkdtemp

    made: list[str] = []

    def remove() -> None:
        for name in made:
            shutil.rmtree(name, ignore_errors=True)

    takes(remove)
    try:
        with held():
            made.append(mkdtemp(prefix=prefix, dir=dir))
        yield Path(made[0])
    finally:
        with held():
            remove()
            forget(remove)


def called(words: Sequence[str], seconds: float, **how: Any) -> subprocess.CompletedProcess[bytes]:
    """Run a program and capture its output; on leaving, it ends with all that it has started.

    Raises OSError where there is no such program, subprocess.TimeoutExpired after so many seconds.
    """
    import subprocess

    pipe = subprocess.PIPE
    with held():
        program = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, process_group=0, **how
        )

        def kill() -> None:
            try:
                os.killpg(program.pid, signal.SIGKILL)
            except AttributeError:
                program.kill()  # on Windows
            except OSError:
                return

        takes(kill)
    try:
        with program:
            try:
                out, err = program.communicate(timeout=seconds)
            except BaseException:
                kill()
                raise
    finally:
        forget(kill)
    return subprocess.CompletedProcess(words, program.returncode, out, err)


def _raise(number: int, frame: object) -> None:
    _State.seen = True
    if not (_State.held or _State.raised):
        _State.raised = True
        raise KeyboardInterrupt


def _watch(wakeup: int) -> None:
    """Wait for a signal in a thread, which works while native code has released the interpreter lock."""
    while os.read(wakeup, 1)[0] not in SIGNALS:
        pass
    time.sleep(GRACE)
    if not _State.answered:
        leave()


def _uncaught(kind: type[BaseException], error: BaseException, trace: object) -> None:
    """Cython reports here an exception that it had to swallow in a callback."""
    if issubclass(kind, KeyboardInterrupt):
        _again()
    elif not _State.seen:
        sys.__excepthook__(kind, error, trace)  # type: ignore[arg-type]


def _unraisable(found: sys.UnraisableHookArgs) -> None:
    """An exception that cannot be raised (callbacks from C, destructors), where the interrupt would be lost.

    Once it has come, destructors find objects half made: their errors are ignored.
    """
    if issubclass(found.exc_type, KeyboardInterrupt):
        _again()
    elif not _State.seen:
        sys.__unraisablehook__(found)


def _again() -> None:
    """Raise the interrupt again, outside of the place that swallowed it."""

    def once_more() -> None:
        time.sleep(0.01)
        ours = [number for number in SIGNALS if signal.getsignal(number) is _raise]
        if ours:
            _thread.interrupt_main(ours[0])

    _State.raised = False
    _thread.start_new_thread(once_more, ())
