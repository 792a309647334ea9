"""A study by a cluster whose workers and scheduler are killed, hang, or are of another version.

    python validation/cluster_kills.py [kills] [scheduler_kills] [seed]

A real dask scheduler and 4 worker processes on this machine's loopback carry out `springcheck run
spring-uneven --vary ... --cluster FILE`, 400 pieces of 50 cells, again and again:

* workers are killed (SIGKILL) at random moments, and others take their place;
* the scheduler is killed at a random moment: the command says so in one line and exits with 2, and the same
  command goes on with a new scheduler;
* a worker is stopped (SIGSTOP) with pieces in hand (patience 5 s instead of 60);
* a worker joins in the middle that has another version of OpenMM: it is refused and named, and the same
  command goes on without it;
* the disk of the parent is full (a tmpfs of 900 kB, or where none can be mounted a limit on the size of
  files): one line, exit status 2, and with room the same command goes on.

After each, every part that the journal held is still there, byte for byte, and is not measured again; and in
the end the store passes `check` and holds the table of the undisturbed study by one process, value for value.

Measured on two cores with a load of 15 to 23: 175 workers and 5 schedulers killed, 8 studies, 3,200 pieces,
lost 0, wrong 0.  Before that it had found that a result lost with its worker was taken for the end of the
scheduler (twice in 38 kills), or ended the study as KilledWorker (once in 260).

All processes are forked from one that has imported what they need, so that 100 workers cost minutes and not
hours; each then runs dask's own command, or springcheck's.

    python validation/cluster_kills.py --rate

measures what scheduler and parent take for pieces that take no time: 4.0 and 6.3 ms of processor time a piece
with a load of 11, 5.3 and 7.5 ms with a load of 17.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck import cli, store
from springcheck.store.parts import parts_folder
from springcheck.studies import cluster, keeper, provenance
from springcheck.studies.ensemble import vary
from springcheck.studies.ensemble.result import CELLS
from springcheck.studies.keeper import Piece

WORKERS = 4
CELLS_EACH, COUNT = 50, 20_000
PATIENCE = 5.0
METHOD = "own:semi-implicit-euler"
COMMAND = (
    "run",
    "spring-uneven",
    "--vary",
    f"spring.0.stiffness=0.5:8:{COUNT}",
    "--method",
    METHOD,
    "--quiet",
)


def forked(work: Callable[[], Any], output: Path) -> int:
    """A process of its own session that does the work and ends; its output goes into a file."""
    pid = os.fork()
    if pid:
        return pid
    status = 1
    try:
        os.setsid()
        into = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(into, 1)
        os.dup2(into, 2)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        status = int(work() or 0)
    except SystemExit as end:
        status = int(end.code or 0)
    except BaseException as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
    finally:
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


def kill(pid: int) -> None:
    """End a process for certain."""
    with contextlib.suppress(ProcessLookupError, ChildProcessError):
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)


class Farm:
    """A scheduler and its workers."""

    def __init__(self, folder: Path) -> None:
        from distributed.cli import dask_scheduler, dask_worker

        self.run_worker = dask_worker.main
        self.folder, self.file = folder, folder / f"scheduler-{time.monotonic_ns()}.json"
        command = ["--scheduler-file", str(self.file), "--port", "0", "--host", "127.0.0.1", "--no-dashboard"]
        self.scheduler = forked(
            partial(dask_scheduler.main, command, standalone_mode=False), folder / "scheduler.log"
        )
        while not self.file.is_file():
            time.sleep(0.02)
        self.workers = [self.worker() for _ in range(WORKERS)]

    def worker(self, before: Callable[[], None] = lambda: None) -> int:
        """One more."""
        command = ["--scheduler-file", str(self.file), "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        command += ["--local-directory", str(self.folder), "--death-timeout", "30"]

        def work() -> None:
            before()
            self.run_worker(command, standalone_mode=False)

        return forked(work, self.folder / "workers.log")

    def replace(self, j: int) -> None:
        """Kill a worker; another takes its place."""
        kill(self.workers[j])
        self.workers[j] = self.worker()

    def end(self) -> None:
        """Leave nothing behind."""
        for pid in (*self.workers, self.scheduler):
            kill(pid)


def command(path: Path, file: Path, limit: int = 0) -> int:
    """The command itself, in a process of its own -> its number."""

    def work() -> int:
        real = cluster.Cluster
        cluster.Cluster = partial(real, patience=PATIENCE)  # type: ignore[assignment, misc]
        if limit:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        return cli.main([*COMMAND, "-o", str(path), "--cluster", str(file)])

    return forked(work, path.with_suffix(".log"))


def status(pid: int, seconds: float = 0.0) -> int | None:
    """The exit status of the command, or None while it runs."""
    end = time.monotonic() + seconds
    while True:
        got, found = os.waitpid(pid, os.WNOHANG)
        if got:
            return os.waitstatus_to_exitcode(found)
        if time.monotonic() >= end:
            return None
        time.sleep(0.02)


def kept(path: Path) -> dict[str, tuple[str, int]]:
    """Each part of the journal: the digest of its bytes, and when it was written."""
    found = {}
    for part in parts_folder(path).glob("rows-*.h5"):
        with contextlib.suppress(FileNotFoundError):
            found[part.name] = hashlib.sha256(part.read_bytes()).hexdigest(), part.stat().st_mtime_ns
    return found


def lost(before: dict[str, tuple[str, int]], path: Path) -> int:
    """Parts that are gone or were measured again; none once they are in the collection."""
    now = kept(path)
    return 0 if path.is_file() else sum(now.get(name) != value for name, value in before.items())


def table(path: Path) -> dict[str, bytes]:
    """The cells, bit for bit."""
    columns = store.tables_of(path)[CELLS.beginning + METHOD].columns
    return {name: np.asarray(column).tobytes() for name, column in columns.items()}


class Campaign:
    """What was done and what was found."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.rng = folder, random.Random(seed)
        self.kills = self.schedulers = self.parts = self.losses = self.wrong = self.studies = 0
        path = folder / "undisturbed.h5"
        pid = forked(lambda: cli.main([*COMMAND, "-o", str(path)]), folder / "undisturbed.log")
        os.waitpid(pid, 0)
        self.right = table(path)

    def ended(self, path: Path, found: int | None, told: str = "", expected: int = 0) -> None:
        """Check the end of a command, and of a study where that is the end of it."""
        text = path.with_suffix(".log").read_text()
        if found != expected or told not in text or "Traceback" in text:
            self.wrong += 1
            print(f"  wrong: exit status {found}, not {expected}: {text[-400:]!r}")
        if found == 0 and not expected:
            self.studies += 1
            self.parts += COUNT // CELLS_EACH
            if (
                store.check(path)
                or table(path) != self.right
                or len(store.measured_by(path)) < COUNT // CELLS_EACH
            ):
                self.wrong += 1
                print(f"  wrong: {path.name} is not the undisturbed store")
        path.with_suffix(".log").unlink()

    def to_the_end(self, path: Path, farm: Farm, seconds: float = 120) -> None:
        """The same command once more, undisturbed."""
        before = kept(path)
        pid = command(path, farm.file)
        # the parts go with the commit
        while (found := status(pid, 0.05)) is None and seconds > 0:
            self.losses += lost(before, path)
            seconds -= 0.05
        if found is None:
            kill(pid)
        self.ended(path, found)


def with_kills(campaign: Campaign, path: Path, *, scheduler: bool) -> None:
    """One study, workers killed on the way, and the scheduler once."""
    farm = Farm(campaign.folder)
    pid = command(path, farm.file)
    when = campaign.rng.uniform(1.5, 6.0) if scheduler else float("inf")
    began, before = time.monotonic(), kept(path)
    try:
        while (found := status(pid, campaign.rng.expovariate(0.6))) is None:
            if parts_folder(path).is_dir():
                campaign.losses += lost(before, path)
                before = kept(path)
            if time.monotonic() - began > when and before:
                kill(farm.scheduler)
                found = status(pid, 60)
                campaign.schedulers += 1
                campaign.losses += lost(before, path)
                campaign.ended(path, found, "the scheduler of the cluster is gone", 2)
                farm.end()
                farm = Farm(campaign.folder)
                pid, when = command(path, farm.file), float("inf")
                continue
            farm.replace(campaign.rng.randrange(WORKERS))
            campaign.kills += 1
        campaign.ended(path, found)
    finally:
        farm.end()


def started(path: Path, pid: int, least: int = 20) -> dict[str, tuple[str, int]]:
    """Wait until so many parts are kept."""
    while len(found := kept(path)) < least and status(pid) is None:
        time.sleep(0.02)
    return found


def with_hanging(campaign: Campaign, path: Path) -> None:
    """A worker hangs with pieces in hand."""
    farm = Farm(campaign.folder)
    pid = command(path, farm.file)
    try:
        started(path, pid)
        os.kill(farm.workers[0], signal.SIGSTOP)
        campaign.ended(path, status(pid, 180))
    finally:
        farm.end()


def with_another_version(campaign: Campaign, path: Path) -> None:
    """A worker joins that has another OpenMM."""

    def change() -> None:
        right = provenance.versions
        provenance.versions = lambda: right() | {"openmm": "0.0.1"}

    farm = Farm(campaign.folder)
    pid = command(path, farm.file)
    try:
        before = started(path, pid)
        wrong = farm.worker(change)
        found = status(pid, 60)
        campaign.losses += lost(before, path)
        campaign.ended(path, found, "has openmm 0.0.1, here it is", 2)
        kill(wrong)
        campaign.to_the_end(path, farm)
    finally:
        farm.end()


def with_a_full_disk(campaign: Campaign, path: Path) -> None:
    """The parent's disk is full in the middle, and then it is not."""
    farm = Farm(campaign.folder)
    disk = campaign.folder / "disk"
    disk.mkdir()
    mounted = not subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=900k", "tmpfs", str(disk)], capture_output=True, check=False
    ).returncode
    path = disk / path.name if mounted else path
    print("  full disk:", "a tmpfs of 900 kB" if mounted else "files may have 6 kB")
    try:
        found = status(command(path, farm.file, 0 if mounted else 6000), 120)
        before = kept(path)
        campaign.ended(path, found, "the disk is full" if mounted else "cannot write", 2)
        if mounted:
            subprocess.run(["mount", "-o", "remount,size=64m", str(disk)], check=True)
        print(f"  {len(before)} parts were kept")
        campaign.to_the_end(path, farm)
    finally:
        farm.end()
        if mounted:
            subprocess.run(["umount", str(disk)], check=False)


def nothing(i: int) -> dict[str, np.ndarray]:
    """A piece without work."""
    return {"value": np.arange(128.0) + i}


def rate(folder: Path, count: int = 2000) -> None:
    """Pieces without work: what scheduler and parent take for each."""
    farm = Farm(folder)
    path = folder / "rate.h5"
    pieces = [
        Piece(key=f"own:none/{i:06d}", what="", measure=partial(nothing, i), form=CELLS) for i in range(count)
    ]

    def seconds(pid: int) -> float:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    try:
        with keeper.kept(path, "rate", team=cluster.Cluster(str(farm.file))) as kept_:
            before, began, own = seconds(farm.scheduler), time.perf_counter(), time.process_time()
            for _ in kept_.stream(pieces):
                pass
            wall, own, its = (
                time.perf_counter() - began,
                time.process_time() - own,
                seconds(farm.scheduler) - before,
            )
            kept_.commit("rate", {})
    finally:
        farm.end()
    print(f"{count} pieces in {wall:.1f} s; of processor time the scheduler takes {1e3 * its / count:.2f} ms")
    print(f"a piece, the parent {1e3 * own / count:.2f} ms beside its commit; 1024 bytes of result a piece")


def main() -> int:
    """Run the campaign; 1 where anything was lost or wrong."""
    given = arguments(__doc__, kills=100, scheduler_kills=5, seed=17, rate=False)
    vary.CHUNK = CELLS_EACH
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if given.rate:
            rate(folder)
            return 0
        campaign = Campaign(folder, given.seed)
        with_hanging(campaign, folder / "hanging.h5")
        with_another_version(campaign, folder / "version.h5")
        with_a_full_disk(campaign, folder / "full.h5")
        number = 0
        while campaign.kills < given.kills or campaign.schedulers < given.scheduler_kills:
            path = folder / f"kills-{number}.h5"
            with_kills(campaign, path, scheduler=campaign.schedulers < given.scheduler_kills)
            number += 1
            print(
                f"  {campaign.kills} workers, {campaign.schedulers} schedulers, lost {campaign.losses}",
                flush=True,
            )
    c = campaign
    print(
        f"{c.kills} workers, {c.schedulers} schedulers killed, a worker hung, a version refused, a disk full:"
    )
    print(f"{c.studies} studies, {c.parts} pieces in all: lost {c.losses}, wrong {c.wrong}")
    return int(bool(c.losses or c.wrong))


if __name__ == "__main__":
    script(main)
