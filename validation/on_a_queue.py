"""A study by workers of a queue: jobs of SLURM and others, as a file of dask-jobqueue describes them.

Command: python validation/on_a_queue.py slurm.yaml 1024 extremes -o atlas.h5

carries out `springcheck extremes -o atlas.h5` by so many workers.  The file is the one that dask-jobqueue
itself reads, YAML with the words of its documentation::

    jobqueue:
      slurm:
        cores: 16
        memory: 32GB
        queue: normal
        walltime: "04:00:00"

The scheduler is then a part of this program; its jobs are cancelled when it ends, and those of a program that
was killed end by themselves (`death-timeout`).  A job that ends before is submitted again.
"""

from __future__ import annotations

import contextlib
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from arguments import arguments, script
from springcheck.errors import SpringcheckError, nearest, told

MISSING = "{} needs dask-jobqueue; install it with: python -m pip install 'springcheck[cluster]'"


def description(place: str) -> tuple[str, dict[str, Any]]:
    """The queue that a file describes and what it says of its jobs.  SpringcheckError where it does not."""
    import yaml

    try:
        found = yaml.safe_load(Path(place).read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise SpringcheckError(f"{place}: cannot be read: {told(error)}") from error
    queues = found.get("jobqueue") if isinstance(found, dict) else None
    if not isinstance(queues, dict) or len(queues) != 1 or not isinstance(next(iter(queues.values())), dict):
        raise SpringcheckError(
            f"{place}: no description of one queue, 'jobqueue: slurm: cores: ..., memory: ...'"
        )
    ((name, options),) = queues.items()
    return str(name), options


@contextlib.contextmanager
def started(place: str, queue: str, options: Mapping[str, Any], workers: int) -> Iterator[Any]:
    """A dask cluster with at least so many workers of this queue; its jobs end with it."""
    kind, given = _checked(place, queue, dict(options))
    submit = shlex.split(kind.job_cls.submit_command or "")
    if submit and shutil.which(submit[0]) is None:
        raise SpringcheckError(f"{place}: there is no {submit[0]} here, which submits jobs")
    # whole jobs
    workers = -(-workers // given["processes"]) * given["processes"]
    refused: list[str] = []
    from distributed import Status

    cluster: Any = object.__new__(kind)
    try:
        kind.__init__(cluster, job_cls=_patient(kind.job_cls, refused), **given)
    except (ValueError, TypeError, OSError) as error:
        # or what is half made warns as it goes that it was never closed, and cannot say its name
        cluster.status = Status.closed
        raise SpringcheckError(f"{place}: {told(error)}") from error
    try:
        # jobs end at their time limit; then they are submitted again
        cluster.adapt(minimum=workers, maximum=workers)
        # a queue starts jobs when it has room, be it tomorrow
        while not cluster.scheduler_info["workers"]:
            jobs = list(cluster.workers.values())
            if refused and jobs and all(job.job_id is None for job in jobs):
                raise SpringcheckError(f"{place}: the jobs were refused: {refused[-1]}")
            time.sleep(0.1)
        yield cluster
    finally:
        cancel(cluster)
        cluster.close(timeout=1)


def _patient(kind: Any, refused: list[str]) -> Any:
    """A class of jobs that keeps what the queue says where it refuses one, and submits it once."""
    from distributed.core import Status

    class Job(kind):  # type: ignore[misc]
        async def start(self) -> None:
            try:
                await super().start()
            except (RuntimeError, ValueError, OSError) as error:
                refused.append([line for line in str(error).splitlines() if line.strip()][-1])
                self.status = Status.running

        async def close(self) -> None:
            await super().close()
            self.status = Status.closed

    return Job


def _checked(place: str, queue: str, options: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """The class of the queue's clusters and what it is called with."""
    kept = signal.getsignal(signal.SIGINT)
    try:
        import dask
        import dask_jobqueue
    except ModuleNotFoundError:
        raise SpringcheckError(MISSING.format(place)) from None
    # its import makes of Ctrl-C an exit with status 0
    signal.signal(signal.SIGINT, kept)
    found: dict[str, Any] = vars(dask_jobqueue)
    kinds = {x.job_cls.config_name: x for x in found.values() if hasattr(x, "job_cls")}
    if queue not in kinds:
        raise SpringcheckError(
            f"{place}: no queue {queue!r}{nearest(queue, kinds)}; "
            f"dask-jobqueue has {', '.join(sorted(kinds))}"
        )
    known = {*dask.config.get(f"jobqueue.{queue}"), "processes", "cores", "memory"}
    for name in options:
        if name not in known:
            what = f"jobqueue.{queue} has no {name!r}{nearest(name, known)}"
            raise SpringcheckError(f"{place}: {what}")
    for name in ("cores", "memory"):
        if not options.get(name):
            raise SpringcheckError(f"{place}: jobqueue.{queue} must say the {name} of a job")
    # a piece takes one core, and a process measures one piece at a time
    given = {"processes": options["cores"], **options}
    given["scheduler-options"] = {
        "dashboard": False,
        "dashboard_address": ":0",
        **(options.get("scheduler-options") or {}),
    }
    renamed = {"name": "job_name"}
    return kinds[queue], {renamed.get(name, name.replace("-", "_")): value for name, value in given.items()}


def cancel(cluster: Any) -> None:
    """Cancel all jobs at once: one by one takes longer than an interrupted program has."""
    if (adaptive := getattr(cluster, "_adaptive", None)) is not None:
        # or it would submit them again
        adaptive.stop()
    jobs = [job.job_id for job in cluster.workers.values() if getattr(job, "job_id", None)]
    command = shlex.split(cluster.job_cls.cancel_command or "")
    if jobs and command:
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            subprocess.run([*command, *map(str, jobs)], capture_output=True, check=False, timeout=1)


def _carried_out(command: Sequence[str]) -> int:
    """The exit status of a study, which is told to end with this program and says what it has kept."""
    heard: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            # no exception, which would leave a study behind that has just begun
            signal.signal(number, lambda number, frame: heard.append(number))
    study = subprocess.Popen(command)
    while (status := study.poll()) is None:
        if heard:
            # of a Ctrl-C it has heard by itself: it ignores a second signal
            study.send_signal(signal.SIGINT)
            heard.clear()
        time.sleep(0.1)
    return status


def main() -> int:
    """Carry a study out by workers of a queue; its exit status."""
    if len(sys.argv) < 4 or not sys.argv[2].isdecimal():
        arguments(__doc__)
        raise SpringcheckError("say place, number of workers and command: see --help")
    place, workers, *words = sys.argv[1:]
    # the queue's jobs end before this process, however long that takes
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with started(place, *description(place), int(workers)) as cluster:
        more = ["--workers", workers, "--cluster", cluster.scheduler_address]
        command = [sys.executable, "-m", "springcheck", *words, *more]
        return _carried_out(command)


if __name__ == "__main__":
    script(main)
