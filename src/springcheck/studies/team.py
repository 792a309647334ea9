"""Executors of the pieces of a study: this process, further processes, or the workers of a cluster.

The parent alone writes.  A piece is a function that another process can import, and its result is returned,
so that the numbers do not depend on who measures them.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from springcheck import __version__
from springcheck.errors import SpringcheckError
from springcheck.studies.arguments import Argument, argument

if TYPE_CHECKING:
    from springcheck.doors import Brought

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Processes:
    """Processes of this machine; a single one is the program itself."""

    workers: int = 1
    """Number of pieces that are measured at the same time."""
    brought: Brought | None = None
    """Engines that the call has brought."""

    def carried_out(self, parts: Sequence[Callable[[], T]]) -> Generator[tuple[int, T], None, None]:
        """Index and result of each part, as it finishes.  An exception of a part is raised here.

        Close the iterator where it is left early: the processes are killed.
        """
        if self.workers <= 1:
            for i, part in enumerate(parts):
                yield i, part()
            return
        from concurrent.futures import ProcessPoolExecutor, as_completed
        from concurrent.futures.process import BrokenProcessPool
        from multiprocessing import active_children, get_context

        main: Any = sys.modules["__main__"]
        path = getattr(main, "__file__", None)
        if getattr(main, "__spec__", None) is None and path is not None and not os.path.exists(path):
            raise SpringcheckError(f"workers need the program as a file, and {path} is none: use one worker")
        before = {one.pid for one in active_children()}
        pool = ProcessPoolExecutor(
            min(self.workers, max(1, len(parts))), get_context("spawn"), _begin, (self.brought,)
        )
        try:
            numbers = {pool.submit(part): i for i, part in enumerate(parts)}
            for future in as_completed(numbers):
                yield numbers[future], future.result()
        except BrokenProcessPool as error:
            raise SpringcheckError("a worker process has ended by itself: is memory short?") from error
        finally:
            ours = [one for one in active_children() if one.pid not in before]
            pool.shutdown(wait=False, cancel_futures=True)
            for one in ours:
                one.kill()


def _begin(brought: Brought | None) -> None:
    """Set up a worker: Ctrl-C is the parent's, and the worker ends when the parent does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if brought is not None:
        from springcheck import doors

        doors.bring_once(brought)


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(1)


WAITING_SECONDS = 30
"""Seconds to wait for a scheduler and for its first worker."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """The workers of a dask scheduler, at ``tcp://host:port`` or named by the file that it writes."""

    place: str
    workers: int = 2
    """Assumed number of workers: more than one, so that the longest pieces are submitted first."""

    def carried_out(self, parts: Sequence[Callable[[], T]]) -> Generator[tuple[int, T], None, None]:
        """Index and result of each part, as it finishes; dask gives the part of a lost worker to another."""
        try:
            import distributed
        except ModuleNotFoundError as error:
            said = "--cluster needs dask; install it with: python -m pip install 'springcheck[cluster]'"
            raise SpringcheckError(said) from error
        try:
            at = self.place if "://" in self.place else json.loads(Path(self.place).read_text())["address"]
            client = distributed.Client(at, timeout=WAITING_SECONDS, set_as_default=False)
            client.wait_for_workers(1, timeout=WAITING_SECONDS)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SpringcheckError(f"--cluster {self.place}: no scheduler with workers: {error}") from error
        with client:
            keys = {
                client.submit(_checked, part, _versions(), pure=False, priority=-i): i
                for i, part in enumerate(parts)
            }
            for future in distributed.as_completed(list(keys), loop=client.loop):
                if future.status in ("cancelled", "lost"):
                    said = "the scheduler is gone; finished work is saved; the same command continues"
                    raise SpringcheckError(f"--cluster {self.place}: {said}")
                yield keys[future], future.result()


def _versions() -> dict[str, str]:
    """Versions that numbers depend on, of this process."""
    import numpy as np

    return {"springcheck": __version__, "numpy": np.__version__, "python": sys.version.split()[0]}


def _checked(part: Callable[[], T], wanted: dict[str, str]) -> T:
    """Measure a piece on a worker of the same versions."""
    if (here := _versions()) != wanted:
        raise SpringcheckError(f"a worker of the cluster has {here}, and this process {wanted}")
    return part()


Team: TypeAlias = Processes | Cluster
"""Carries out pieces of work."""

ALONE = Processes()

MOST_PROCESSES = 4096


def processes(text: str) -> int:
    """Parse a number of processes of the command line."""
    if not (text.isdecimal() and 0 < int(text) <= MOST_PROCESSES):
        raise ArgumentTypeError(f"{text!r}: a number of processes from 1 to {MOST_PROCESSES} is needed")
    return int(text)


def arguments(default: int = 1) -> tuple[Argument, ...]:
    """Arguments of a study whose pieces several workers can measure."""
    return (
        argument("--workers", type=processes, default=default, metavar="N",
                 help=f"processes that measure at the same time (default {default})"),
        argument("--cluster", metavar="tcp://HOST:PORT|FILE", help="the workers of a dask scheduler"),
    )  # fmt: skip


def of(options: Namespace) -> Team:
    """The team that the command line asks for."""
    if options.cluster:
        return Cluster(options.cluster, workers=max(2, options.workers))
    return Processes(options.workers, getattr(options, "brought", None))
