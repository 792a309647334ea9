"""Pieces of a study, carried out by the workers of a dask scheduler.

Workers come and go: a piece without an answer is given to another.  A worker of other versions is refused,
because its numbers might differ; dask's `Client.get_executor` does neither.  When the scheduler is lost,
finished pieces are saved, and the same command resumes with another scheduler.
"""

from __future__ import annotations

import json
import logging
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from springcheck import engines
from springcheck.errors import SpringcheckError, StoreWarning

T = TypeVar("T")

PACKAGES = ("springcheck", "numpy", "numba", "scipy")
"""Packages that numbers depend on, in addition to those of the engines."""

PATIENCE_SECONDS = 60.0
"""Seconds without any answer after which every open piece is given to another worker as well."""

MOST_ATTEMPTS = 20
"""Attempts after which a piece is blamed for the workers that died over it."""

WAITING_SECONDS = 30.0
"""Seconds to wait for a scheduler and for its first worker."""

SILENT_SECONDS = 30.0
"""Seconds of silence after which a worker gets no piece: it hangs, or was stopped.  The scheduler itself
waits for 300 s and longer."""

SCHEDULER_GONE = "the scheduler of the cluster is gone; what was finished is kept, the same command goes on"

LOGGERS = "distributed", "distributed.client", "distributed.core", "tornado", "tornado.application", "asyncio"
"""Loggers of dask, some of which have levels of their own; other loggers are left as they are."""

FEWEST_SUBMITTED = 256
"""Fewest pieces that are submitted at a time."""


@dataclass(frozen=True, slots=True)
class Cluster:
    """The workers of a scheduler, at ``tcp://host:port`` or named by the file that it writes."""

    place: str
    workers: int = 2
    """Assumed number of workers: more than one, so that the longest pieces are submitted first."""
    patience: float = PATIENCE_SECONDS

    def carried_out(self, parts: Sequence[Callable[[], T]]) -> Generator[tuple[int, T], None, None]:
        """Index and result of each part, as it finishes."""
        if not parts:
            return
        with self._client() as client:
            yield from _answers(client, parts, self.patience)

    @property
    def _address(self) -> str:
        if "://" in self.place:
            return self.place
        try:
            return str(json.loads(Path(self.place).read_text(encoding="utf-8"))["address"])
        except (OSError, ValueError, KeyError, TypeError):
            raise SpringcheckError(
                f"--cluster {self.place}: no such file, or none that a dask scheduler writes; "
                "tcp://HOST:PORT is the other form"
            ) from None

    @contextmanager
    def _client(self) -> Iterator[Any]:
        try:
            import distributed
        except ModuleNotFoundError:
            raise SpringcheckError(
                "--cluster needs dask; install it with: python -m pip install 'springcheck[cluster]'"
            ) from None
        with ExitStack() as stack:
            # dask's log of lost connections is not for users: errors that concern them are raised
            for logger in map(logging.getLogger, LOGGERS):
                stack.callback(logger.setLevel, logger.level)
                logger.setLevel(logging.CRITICAL)
            try:
                said = "no scheduler answers: {}"
                client = distributed.Client(self._address, timeout=WAITING_SECONDS, set_as_default=False)
                stack.callback(client.close, timeout=1)
                said = "the scheduler has no worker"
                client.wait_for_workers(1, timeout=WAITING_SECONDS)
                # the scheduler unpacks what passes through it
                said = "springcheck is not installed where the scheduler runs: {}"
                _on_scheduler(client, versions)
            except SpringcheckError:
                raise
            except Exception as error:
                raise SpringcheckError(f"--cluster {self.place}: {said.format(error)}") from error
            yield client


def versions() -> dict[str, str]:
    """Versions of all that numbers depend on, engines and plug-ins included, as far as installed."""
    from importlib import metadata

    # engine files of a call have versions, too; they are part of the command
    engine_names = [name for name in engines.names() if not engines.is_brought(name)]
    found = {}
    for name in {
        *PACKAGES,
        *(engines.engine(one).distribution for one in engine_names),
        *(engines.origin(one).package for one in engine_names),
    }:
        with suppress(metadata.PackageNotFoundError, ValueError):
            found[name] = metadata.version(name)
    return found


def _on_scheduler(client: Any, function: Callable[..., T]) -> T:
    """Result of a function called on the scheduler.  TimeoutError where the scheduler does not answer."""
    found: T = client.sync(client._run_on_scheduler, function, callback_timeout=WAITING_SECONDS)
    return found


def _silence(dask_scheduler: Any) -> dict[str, float]:
    """Seconds since each worker was heard of, by its address; runs on the scheduler."""
    now = time.time()
    return {address: now - worker.last_seen for address, worker in dask_scheduler.workers.items()}


def _hanging(client: Any, named: set[str]) -> tuple[list[str], list[str]]:
    """Addresses of the workers that answer and of those that are silent; each of these is warned of once."""
    try:
        silence = _on_scheduler(client, _silence)
    except (TimeoutError, OSError) as error:
        raise SpringcheckError(SCHEDULER_GONE) from error
    hang = sorted(address for address, seconds in silence.items() if seconds > SILENT_SECONDS)
    live = sorted(silence.keys() - hang)
    for address in hang if live else ():
        if address not in named:
            said = f"worker {address} has not been heard of for {silence[address]:.0f} s and gets no piece"
            warnings.warn(said, StoreWarning, stacklevel=2)
    named.update(hang if live else ())
    return live, hang


def _checked(part: Callable[[], Any], wanted: dict[str, str]) -> Any:
    """Measure a piece on a worker, after a check of the worker's threads and versions."""
    from distributed import get_worker

    worker = get_worker()
    if worker.state.nthreads > 1:
        raise SpringcheckError(
            f"worker {worker.address} has {worker.state.nthreads} threads, and measures one piece at a time: "
            "start it with --nthreads 1, and with --nworkers as many as it has cores"
        )
    its = _here()
    for name in sorted(wanted.keys() | its.keys()):
        if wanted.get(name) != its.get(name):
            raise SpringcheckError(
                f"worker {worker.address} has {name} {its.get(name, 'not at all')}, "
                f"here it is {wanted.get(name, 'not at all')}; its numbers might differ"
            )
    return part()


_here = cache(versions)


def _answers(
    client: Any, parts: Sequence[Callable[[], T]], patience: float
) -> Generator[tuple[int, T], None, None]:
    import distributed
    from distributed.comm import CommClosedError

    wanted = versions()
    number: dict[Any, int] = {}
    given = [0] * len(parts)
    ended: SimpleQueue[Any] = SimpleQueue()
    named: set[str] = set()

    def give(i: int) -> None:
        given[i] += 1
        if given[i] > MOST_ATTEMPTS:
            raise SpringcheckError(
                f"piece {i} was given out {MOST_ATTEMPTS} times, and no worker survived it"
            )
        key = f"springcheck-{id(number)}-{i}-{given[i]}"
        # any worker may take it; where some hang, only the live ones
        where = {"workers": live} if live and hang else {}
        # the first has the highest priority: longest pieces are in front
        how = {"key": key, "pure": False, "priority": -i, "retries": 0, **where}
        future = client.submit(_checked, parts[i], wanted, **how)
        number[future] = i
        future.add_done_callback(ended.put)

    following = iter(range(len(parts)))
    done: set[int] = set()
    try:
        while len(done) < len(parts):
            if len(done) % FEWEST_SUBMITTED == 0:
                # no worker runs out of pieces
                live, hang = _hanging(client, named)
                most = max(FEWEST_SUBMITTED, 2 * len(live))
            for i in islice(following, max(0, most - len(number))):
                give(i)
            try:
                future = ended.get(timeout=patience)
            except Empty:
                _alive(client)
                live, hang = _hanging(client, named)
                if hang and not live:
                    raise SpringcheckError(
                        f"no worker of the cluster answers: {', '.join(hang)}; stop them and start others; "
                        "what was finished is kept, the same command goes on"
                    ) from None
                for i in {i for i in number.values() if i not in done}:
                    give(i)
                continue
            i = number.pop(future)
            if i in done:
                continue
            if future.status == "finished":
                try:
                    answer = future.result(timeout=patience)
                except (KeyboardInterrupt, GeneratorExit):
                    raise
                except BaseException:
                    # the worker that held it is gone: CommClosedError, CancelledError, KilledWorker ...
                    pass
                else:
                    done.add(i)
                    yield i, answer
                    continue
            _alive(client)
            # lost: the worker has died after it had finished
            if future.status not in ("finished", "cancelled", "lost"):
                cause = future.exception(timeout=patience)
                if not isinstance(cause, distributed.KilledWorker | CommClosedError):
                    raise cause
            give(i)
    except (KeyboardInterrupt, GeneratorExit, SpringcheckError):
        raise
    except BaseException as error:
        # dask raises various exceptions for a lost connection, asyncio's CancelledError among them
        if client.status == "running" and isinstance(error, Exception):
            raise
        raise SpringcheckError(SCHEDULER_GONE) from error
    client.cancel(list(number), force=True)


def _alive(client: Any) -> None:
    if client.status != "running":
        raise SpringcheckError(SCHEDULER_GONE)
