"""A study by further processes or by a dask scheduler is the study by one process."""

from __future__ import annotations

import os
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
from springcheck.studies import team
from springcheck.studies.extremes import measure as extremes

OWN = ("own:euler", "own:implicit-euler", "own:semi-implicit-euler")


def doubled(x: int) -> int:
    return 2 * x


def failing() -> int:
    raise SpringcheckError("this piece fails")


def test_parts_by_two_processes_are_those_of_one_and_errors_are_raised_here() -> None:
    parts = [partial(doubled, i) for i in range(5)]
    expected = [(i, 2 * i) for i in range(5)]
    assert list(team.Processes(1).carried_out(parts)) == expected
    assert sorted(team.Processes(2).carried_out(parts)) == expected
    with pytest.raises(SpringcheckError, match="this piece fails"):
        list(team.Processes(2).carried_out([failing, *parts]))
    with pytest.raises(SpringcheckError, match="ended by itself"):
        list(team.Processes(2).carried_out([partial(os._exit, 7)]))


def test_processes_end_with_an_iterator_that_is_left_early() -> None:
    from multiprocessing import active_children

    found = team.Processes(2).carried_out([partial(time.sleep, 600), partial(doubled, 1)])
    assert next(found) == (1, 2)
    begun = time.monotonic()
    found.close()
    for one in active_children():
        one.join(5)
    assert time.monotonic() - begun < 5


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[Path]:
    """The file of a dask scheduler with two workers."""
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    how = {"cwd": tmp_path, "stderr": subprocess.DEVNULL, "env": os.environ | {"PYTHONPATH": path}}
    words = ("--scheduler-file", str(file), "--no-dashboard")
    dask = [sys.executable, "-m", "dask"]
    begun = [subprocess.Popen([*dask, "scheduler", "--port", "0", "--host", "127.0.0.1", *words], **how)]  # type: ignore[call-overload]
    end = time.monotonic() + 60
    while not file.is_file() and time.monotonic() < end:
        time.sleep(0.05)
    more = ("--no-nanny", "--nthreads", "1", *words)
    begun += [subprocess.Popen([*dask, "worker", *more], **how) for _ in range(2)]  # type: ignore[call-overload]
    yield file
    for process in begun:
        process.kill()
        process.wait()


def test_a_study_by_a_cluster_is_the_study_by_one_process(
    scheduler: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["extremes", "--quick", *(x for name in OWN for x in ("--method", name)), "--quiet"]
    assert cli.main([*arguments, "-o", str(tmp_path / "many.h5"), "--cluster", str(scheduler)]) == 0
    extremes.record(tmp_path / "one.h5", OWN, quick=True)
    one, many = (dict(store.tables_of(tmp_path / f"{name}.h5")) for name in ("one", "many"))
    assert one.keys() == many.keys()
    for name in one:
        for column, values in one[name].columns.items():
            assert repr(np.asarray(values).tolist()) == repr(np.asarray(many[name].columns[column]).tolist())
    monkeypatch.setattr(team, "_versions", lambda: {"numpy": "0.0.1"})
    with pytest.raises(SpringcheckError, match=r"a worker of the cluster has .*0\.0\.1"):
        list(team.Cluster(str(scheduler)).carried_out([partial(doubled, 1)]))


@pytest.mark.parametrize("place", ["tcp://127.0.0.1:9", "nothing.json", __file__])
def test_no_scheduler_is_one_line(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(team, "WAITING_SECONDS", 1)
    with pytest.raises(SpringcheckError, match="no scheduler with workers"):
        list(team.Cluster(place).carried_out([partial(doubled, 1)]))
