"""Parts of a computation in separate processes, which end with the program, however that ends.

The processes of a `ProcessPoolExecutor` survive a killed program, and their current work goes on after an
early exit; on Python 3.11.2 it hangs where they die before they have read a part of 10 MB.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from typing import Any, TypeVar

from springcheck import interrupts, processes
from springcheck.errors import SpringcheckError

T = TypeVar("T")


def carried_out(parts: Sequence[Callable[[], T]], workers: int) -> Generator[tuple[int, T], None, None]:
    """Index and result of each part, as it finishes; with one worker here, otherwise in so many processes.

    Parts must be functions that another process can import.  Close the iterator where it is left early. An
    exception of a part is raised here.  SpringcheckError: a process cannot be started, or has ended without
    an answer.
    """
    if workers <= 1:
        for i, part in enumerate(parts):
            yield i, part()
        return
    _is_a_file(sys.modules["__main__"])
    ahead = [*enumerate(parts)][::-1]
    team: dict[Any, Any] = {}
    try:
        for _ in range(min(workers, len(parts))):
            with processes.deferred(), _blocked_sigint():
                ours, theirs = get_context("spawn").Pipe()
                process = get_context("spawn").Process(target=_work, args=(theirs,), daemon=True)
                process.start()
                interrupts.takes(process.kill)
                theirs.close()
                team[ours] = process
            _send(ahead.pop(), ours, team)
        while team:
            ready: list[Any] = wait(list(team))
            for ours in ready:
                yield _answer(ours, team)
                if ahead:
                    _send(ahead.pop(), ours, team)
                else:
                    ours.close()
                    _ended(team.pop(ours))
    finally:
        for process in team.values():
            process.kill()
        for ours, process in team.items():
            _ended(process)
            ours.close()


def _is_a_file(main: Any) -> None:
    """Raise SpringcheckError where new processes could not find the main program as a file."""
    path = getattr(main, "__file__", None)
    if getattr(main, "__spec__", None) is None and path is not None and not os.path.exists(path):
        raise SpringcheckError(
            f"processes beside this one need the program as a file, which {path} is not: save it, or use one"
        )


def _send(numbered: Any, ours: Any, team: dict[Any, Any]) -> None:
    try:
        ours.send(numbered)
    except OSError:
        raise _died(team[ours]) from None


def _answer(ours: Any, team: dict[Any, Any]) -> Any:
    try:
        i, good, found = ours.recv()
    except (EOFError, OSError):
        raise _died(team[ours]) from None
    if not good:
        raise found
    return i, found


def _died(process: Any) -> SpringcheckError:
    process.join()
    return SpringcheckError(
        f"a worker process has ended by itself (exit status {process.exitcode}): is memory short?"
    )


def _ended(process: Any) -> None:
    process.join()
    interrupts.forget(process.kill)


@contextmanager
def _blocked_sigint() -> Iterator[None]:
    """Block SIGINT in processes started within this context: Ctrl-C reaches the parent, which stops them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(theirs: Connection) -> None:
    """The loop of a worker: receive parts and send results until there are no more or the parent has died."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            i, part = theirs.recv()
        except EOFError:
            return
        try:
            answer = i, True, part()
        except Exception as error:
            answer = i, False, error
        theirs.send(answer)


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
