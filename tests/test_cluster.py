"""A study by a real scheduler and real workers on this machine: workers that are killed, that hang or have
other versions, and a scheduler that dies, lose nothing and change no number."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from springcheck import cli, store
from springcheck.errors import SpringcheckError
from springcheck.studies import cluster
from springcheck.studies.cluster import Cluster
from springcheck.studies.extremes import measure as extremes

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

    def _start(self, what: str, *more: str) -> subprocess.Popen[bytes]:
        arguments = ["--scheduler-file", str(self.file), *more]
        return subprocess.Popen(
            [sys.executable, "-m", "dask", what, *arguments],
            cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])},
        )  # fmt: skip

    def worker(self) -> subprocess.Popen[bytes]:
        more = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(self.folder))
        return self._start("worker", *more)

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


def slow(i: int, seconds: float) -> tuple[int, np.ndarray]:
    time.sleep(seconds)
    return os.getpid(), np.sqrt(np.arange(5.0) + i)


def test_killed_and_hanging_workers_lose_nothing(farm: Farm) -> None:
    parts = [partial(slow, i, 0.2) for i in range(30)]
    found = {}
    for i, answer in Cluster(str(farm.file), patience=3.0).carried_out(parts):
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


def test_a_study_by_a_cluster_is_the_study_by_one_process(farm: Farm, tmp_path: Path) -> None:
    arguments = ["extremes", "--quick", *(x for name in OWN for x in ("--method", name)), "--quiet"]
    assert cli.main([*arguments, "-o", str(tmp_path / "many.h5"), "--cluster", str(farm.file)]) == 0
    extremes.record(tmp_path / "one.h5", OWN, quick=True)
    one, many = (store.read_tables(tmp_path / f"{name}.h5") for name in ("one", "many"))
    assert one.keys() == many.keys()
    for name in one:
        for column, values in one[name].columns.items():
            assert repr(np.asarray(values).tolist()) == repr(np.asarray(many[name].columns[column]).tolist())


def test_a_scheduler_that_dies_is_said_and_what_was_finished_is_kept(farm: Farm) -> None:
    found = []

    def all_of_them() -> None:
        parts = [partial(slow, i, 0.3) for i in range(40)]
        for i, _ in Cluster(str(farm.file), patience=3.0).carried_out(parts):
            found.append(i)
            if len(found) == 4:
                farm.scheduler.kill()

    with pytest.raises(SpringcheckError, match="scheduler of the cluster is gone"):
        all_of_them()
    assert 4 <= len(found) < 40


def test_a_worker_of_another_version_is_refused_and_named(
    farm: Farm, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = cluster.version
    monkeypatch.setattr(cluster, "version", lambda name: "0.0.1" if name == "numpy" else right(name))
    with pytest.raises(SpringcheckError, match=r"worker tcp://.* has numpy .*here it is 0\.0\.1"):
        list(Cluster(str(farm.file)).carried_out([partial(slow, 0, 0.0)]))


def test_no_scheduler_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "WAITING", 1.0)
    for place, words in (("tcp://127.0.0.1:9", "no scheduler answers"), ("nothing.json", "no such file")):
        with pytest.raises(SpringcheckError, match=words):
            list(Cluster(place).carried_out([partial(slow, 0, 0.0)]))
