"""Executors of the pieces of a study: this process, further processes, or the workers of a cluster.

The parent alone writes.  A piece is a function that another process can import, and its result is returned,
so that the numbers do not depend on who measures them.
"""

from __future__ import annotations

from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from springcheck.studies.arguments import Argument, argument

if TYPE_CHECKING:
    from springcheck.doors import Brought
    from springcheck.studies.cluster import Cluster

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Processes:
    """Processes of this machine; a single one is the program itself."""

    workers: int = 1
    """Number of pieces that are measured at the same time."""
    brought: Brought | None = None
    """Engines that the call has brought."""

    def carried_out(self, parts: Sequence[Callable[[], T]]) -> Generator[tuple[int, T], None, None]:
        """Index and result of each part, as it finishes.  Close the iterator where it is left early."""
        from springcheck.studies.workers import carried_out

        if self.workers > 1 and self.brought is not None:
            parts = [partial(_after, self.brought, part) for part in parts]
        return carried_out(parts, self.workers)


def _after(brought: Brought, part: Callable[[], T]) -> T:
    """Run a part in a process that may not know the engines of the call yet."""
    from springcheck import doors

    doors.bring_once(brought)
    return part()


Team: TypeAlias = "Processes | Cluster"
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
        argument(
            "--workers", type=processes, default=default, metavar="N",
            help=f"processes that measure at the same time (default {default})",
        ),
        argument(
            "--cluster", metavar="tcp://HOST:PORT|FILE",
            help="the workers of a dask scheduler, by its address or by the file that it writes",
        ),
    )  # fmt: skip


def of(options: Namespace) -> Team:
    """The team that the command line asks for."""
    if not options.cluster:
        return Processes(options.workers, getattr(options, "brought", None))
    from springcheck.studies import cluster

    return cluster.Cluster(options.cluster, workers=max(2, options.workers))
