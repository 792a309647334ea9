"""A study by a real scheduler and real workers on this machine: workers that are killed, that hang or have
other versions, and a scheduler that dies, lose nothing and change no number."""

from __future__ import annotations

import importlib.metadata
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springcheck import cli, store
from springcheck.errors import SpringcheckError, StoreWarning
from springcheck.studies import cluster, keeper
from springcheck.studies.cluster import Cluster
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.tables import Rows

if not os.environ.get("SPRINGCHECK_REQUIRE_TOOLS"):
    pytest.importorskip("distributed")

OWN = ("own:euler", "own:implicit-euler", "own:semi-implicit-euler")


class Farm:
    """A scheduler and its workers, each a process."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.folder = folder
        self.scheduler = self._start("scheduler", "--port", "0", "--host", "127.0.0.1", "--no-dashboard")
        end = time.monotonic() + 60
        while not self.file.is_file() and time.monotonic() < end:
            time.sleep(0.05)
        self.workers = [self.worker() for _ in range(2)]

    def _start(self, what: str, *more: str, **env: str) -> subprocess.Popen[bytes]:
        arguments = ["--scheduler-file", str(self.file), *more]
        return subprocess.Popen(
            [sys.executable, "-m", "dask", what, *arguments],
            cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=os.environ | env | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])},
        )  # fmt: skip

    def worker(self, threads: int = 1, **env: str) -> subprocess.Popen[bytes]:
        more = ("--no-nanny", "--no-dashboard", "--local-directory", str(self.folder))
        return self._start("worker", "--nthreads", str(threads), *more, **env)

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[Farm]:
    made = Farm(tmp_path)
    try:
        yield made
    finally:
        made.end()


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    """One in which nobody is killed."""
    made = Farm(tmp_path_factory.mktemp("farm"))
    try:
        yield made
    finally:
        made.end()


def slow(i: int, seconds: float) -> tuple[int, np.ndarray]:
    time.sleep(seconds)
    return os.getpid(), np.sqrt(np.arange(5.0) + i)


@dataclass(frozen=True, kw_only=True)
class Pid:
    pid: int


PIDS: Rows[Pid] = Rows(kind=Pid, beginning="pids/", named="", joined=True)


def test_killed_and_hanging_workers_lose_nothing_and_a_scheduler_that_dies_is_said(farm: Farm) -> None:
    parts = [partial(slow, i, 0.1) for i in range(30)]
    found = {}
    for i, answer in Cluster(str(farm.file), patience=1.0).carried_out(parts):
        found[i] = answer
        if len(found) in (3, 9):
            farm.workers.append(farm.worker())
            farm.workers[0 if len(found) == 3 else 1].kill()
        if len(found) == 15:
            farm.workers.append(farm.worker())
            farm.workers[2].send_signal(signal.SIGSTOP)
    assert sorted(found) == list(range(30))
    assert all(np.array_equal(found[i][1], np.sqrt(np.arange(5.0) + i)) for i in found)
    assert len({pid for pid, _ in found.values()}) >= 3
    kept = []

    def all_of_them() -> None:
        parts = [partial(slow, i, 0.2) for i in range(40)]
        for i, _ in Cluster(str(farm.file), patience=1.0).carried_out(parts):
            kept.append(i)
            if len(kept) == 4:
                farm.scheduler.kill()

    with pytest.raises(SpringcheckError, match="scheduler of the cluster is gone"):
        all_of_them()
    assert 4 <= len(kept) < 40


def test_a_study_by_a_cluster_is_the_study_by_one_process(calm: Farm, tmp_path: Path) -> None:
    farm = calm
    arguments = ["extremes", "--quick", *(x for name in OWN for x in ("--method", name)), "--quiet"]
    assert cli.main([*arguments, "-o", str(tmp_path / "many.h5"), "--cluster", str(farm.file)]) == 0
    extremes.record(tmp_path / "one.h5", OWN, quick=True)
    one, many = (dict(store.tables_of(tmp_path / f"{name}.h5")) for name in ("one", "many"))
    assert one.keys() == many.keys()
    for name in one:
        for column, values in one[name].columns.items():
            assert repr(np.asarray(values).tolist()) == repr(np.asarray(many[name].columns[column]).tolist())


@pytest.mark.parametrize("package", ["openmm", "numpy"])
def test_a_worker_of_another_version_is_refused_and_named(
    calm: Farm, monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    right = importlib.metadata.version
    monkeypatch.setattr(
        importlib.metadata, "version", lambda name: "0.0.1" if name == package else right(name)
    )
    with pytest.raises(SpringcheckError, match=rf"worker tcp://.* has {package} .*here it is 0\.0\.1"):
        list(Cluster(str(calm.file)).carried_out([partial(slow, 0, 0.0)]))


def test_processors_that_round_otherwise_are_named(calm: Farm, tmp_path: Path) -> None:
    other = calm.worker(OPENBLAS_CORETYPE="Prescott", NPY_DISABLE_CPU_FEATURES="X86_V4 AVX512_SKX")
    path = tmp_path / "s.h5"
    parts = [partial(slow, i, 0.05) for i in range(400)]
    bits = set()
    try:
        with keeper.kept(path, "pids", team=Cluster(str(calm.file))) as kept:
            with closing(kept.carried_out(parts)) as found:
                for i, (pid, _), by in found:
                    kept.keep(PIDS, f"all/{i:03d}", [Pid(pid=pid)], by)
                    bits.add(by["bits of linear algebra"])
                    # the third worker is there
                    if len(bits) > 1:
                        break
            kept.commit("pids", {})
    finally:
        other.kill()
        other.wait()
    said = keeper.who(path)
    assert "2 kinds of processors" in said[0]
    assert "differ in a bit" in said[1]
    assert "linear algebra" in said[1]


def test_a_worker_of_many_threads_is_told_how_to_start(calm: Farm) -> None:
    for worker in calm.workers:
        worker.send_signal(signal.SIGSTOP)
    other = calm.worker(threads=3)
    try:
        with pytest.raises(SpringcheckError, match=r"worker tcp://.* has 3 threads.*--nthreads 1"):
            list(Cluster(str(calm.file), patience=2.0).carried_out([partial(slow, i, 0.0) for i in range(9)]))
    finally:
        other.kill()
        other.wait()
        for worker in calm.workers:
            worker.send_signal(signal.SIGCONT)


def first_is_silent(dask_scheduler: Any) -> dict[str, float]:
    """As if the scheduler had not heard of its first worker for long; called on the scheduler."""
    return {address: 1e3 * (not i) for i, address in enumerate(sorted(dask_scheduler.workers))}


def test_a_worker_that_has_hung_before_is_named_and_gets_no_piece(
    calm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Cluster(str(calm.file))._client() as client:
        client.wait_for_workers(2, timeout=60)
        pids = client.run(os.getpid)
    hung, *others = sorted(pids)
    os.kill(pids[hung], signal.SIGSTOP)
    monkeypatch.setattr(cluster, "_silence", first_is_silent)
    try:
        parts = [partial(slow, i, 0.0) for i in range(20)]
        with pytest.warns(StoreWarning, match=f"^worker {hung} has not been heard of for 1000 s"):
            found = dict(Cluster(str(calm.file)).carried_out(parts))
    finally:
        os.kill(pids[hung], signal.SIGCONT)
    assert sorted(found) == list(range(20))
    assert {pid for pid, _ in found.values()} <= {pids[address] for address in others}


def test_workers_of_which_none_answers_are_named(calm: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "SILENT_SECONDS", -1.0)
    for worker in calm.workers:
        worker.send_signal(signal.SIGSTOP)
    try:
        with pytest.raises(SpringcheckError, match=r"no worker of the cluster answers: tcp://.*; stop them"):
            list(Cluster(str(calm.file), patience=0.5).carried_out([partial(slow, 0, 0.0)]))
    finally:
        for worker in calm.workers:
            worker.send_signal(signal.SIGCONT)


def test_no_scheduler_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "WAITING_SECONDS", 1.0)
    other = tmp_path / "slurm.yaml"
    other.write_text("jobqueue: {slurm: {cores: 1, memory: 1GB}}")
    for place, words in (
        ("tcp://127.0.0.1:9", "no scheduler answers"),
        ("nothing.json", "no such file"),
        (str(other), "none that a dask scheduler writes"),
    ):
        with pytest.raises(SpringcheckError, match=words):
            list(Cluster(place).carried_out([partial(slow, 0, 0.0)]))
