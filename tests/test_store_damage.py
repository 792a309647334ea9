"""A store that is damaged, changed or no HDF5 is reported in one line: no traceback, no hang, no crash.

No file is believed: each is first read in a child process of bounded memory and time, and whatever changed in
a store is named by `check` and by every command that shows its numbers.  validation/hostile.py tries more.
"""

from __future__ import annotations

import json
import random
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from springcheck import formats, store
from springcheck.cli import main
from springcheck.errors import StoreError
from springcheck.physics.trajectory import Comparison
from springcheck.store import apart, checking
from stores import LABELS, scene, trajectory

READERS: list[Callable[[Path], object]] = [
    store.read,
    store.summary,
    store.scene_text,
    store.verdicts,
    store.comparison,
    lambda path: dict(store.tables_of(path)),
    lambda path: formats._apart("", path, [], None),
    lambda path: list(store.windows(path, LABELS[0], 7)),
    lambda path: store.strided(path, LABELS[0], 7),
]
BASE = f"/observables/{LABELS[0]}"
MASS = f"/particles/{LABELS[0]}/mass"
here = pytest.mark.usefixtures("tried_here")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "s.h5"
    s = scene(steps=100)
    with store.open_new(path, "run") as journal:
        for seed, label in enumerate(LABELS[:2]):
            journal.save(trajectory(s, label, seed), s)
        journal.add(store.Table(name="precision/x", columns={"h": [1.0, 2.0]}))
        journal.commit(
            s,
            comparison=Comparison(labels=("a",), max_difference=np.eye(1)),
            documents={"precision": json.dumps({"a": 1})},
        )
    return path


def one_line(error: BaseException) -> bool:
    return "\n" not in str(error) and len(str(error)) < 400


def flipped(whole: Path, path: Path, place: int) -> Path:
    """A copy with one bit changed."""
    content = bytearray(whole.read_bytes())
    content[place] ^= 1 << place % 8
    path.unlink(missing_ok=True)
    path.write_bytes(content)
    return path


def said(reader: Callable[[Path], object], path: Path) -> StoreError:
    """What a reader says that need not mind the damage; nothing where it does not."""
    try:
        reader(path)
    except StoreError as error:
        return error
    return StoreError("")


@here
def test_a_flipped_bit_is_found_or_changes_nothing(whole: Path, tmp_path: Path) -> None:
    right = store.read(whole)
    with h5py.File(whole) as file:
        arrays = {
            node.id.get_offset(): node.id.get_storage_size()
            for node in map(file.get, [f"{BASE}/{name}" for name in ("q/value", "p/value", "q/time")])
        }
    rng = random.Random(5)
    unseen = 0
    for place in [*rng.sample(range(whole.stat().st_size), 120), *(at + 5 for at in arrays)]:
        path = flipped(whole, tmp_path / "s.h5", place)
        if store.check(path):
            continue
        # bytes between the objects, which HDF5 does not use
        unseen += 1
        assert not any(at <= place < at + size for at, size in arrays.items())
        found = store.read(path)
        assert all(np.array_equal(found[label].q, one.q) for label, one in right.items())
    assert unseen < 60


@pytest.mark.parametrize("place", [0, 9, 40])
def test_a_file_whose_structure_has_changed_is_not_read(whole: Path, tmp_path: Path, place: int) -> None:
    path = flipped(whole, tmp_path / "s.h5", place)
    for reader in READERS:
        with pytest.raises(StoreError, match=r"damaged|no HDF5") as caught:
            reader(path)
        assert one_line(caught.value)
    assert store.check(path)


@here
@pytest.mark.parametrize("share", [0.0, 0.0005, 0.1, 0.5, 0.97, 0.9999])
def test_a_file_that_is_cut_off_is_told(whole: Path, tmp_path: Path, share: float) -> None:
    path = tmp_path / "s.h5"
    path.write_bytes(whole.read_bytes()[: int(share * whole.stat().st_size)])
    for reader in READERS:
        with pytest.raises(StoreError, match=r"cut off|no HDF5|damaged") as caught:
            reader(path)
        assert one_line(caught.value)
    assert store.check(path)


def _without(name: str) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        del file[name]

    return change


def _with(name: str, values: object) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        del file[name]
        file[name] = values

    return change


def _attribute(name: str, key: str, value: object) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        file[name].attrs[key] = value

    return change


CHANGES = [
    (_without(f"{BASE}/p/value"), f"{BASE}/p/value"),
    (_without(f"{BASE}/q/time"), f"{BASE}/q/time"),
    (_without(f"{BASE}/q/step"), f"{BASE}/q/step"),
    (_without(f"{BASE}/energy"), f"{BASE}/energy/value"),
    (_without(BASE), f"{BASE}/q"),
    (_without(f"/parameters/{LABELS[0]}"), f"/parameters/{LABELS[0]}"),
    (_without(f"/particles/{LABELS[0]}/position"), f"/particles/{LABELS[0]}/position/value"),
    (_without(f"/particles/{LABELS[0]}/box"), f"/particles/{LABELS[0]}/box"),
    (_without("/h5md"), "/h5md"),
    (_without("/digests"), "/"),
    (_with(f"{BASE}/q/value", "words"), f"{BASE}/q/value"),
    (_with(f"{BASE}/q/value", np.zeros((3, 3))), f"{BASE}/q/value"),
    (_with(f"{BASE}/p/value", np.zeros((51, 3), dtype="S3")), f"{BASE}/p/value"),
    (_with("/precision/x/h", [1.0, 2.5]), "/precision/x/h"),
    (_with("/documents/precision", "{}"), "/documents/precision"),
    (lambda file: file[f"{BASE}/q/value"].write_direct(np.zeros((51, 3))), f"{BASE}/q/value"),
    (
        lambda file: file[f"particles/{LABELS[0]}/mass"].write_direct(np.ones(3)),
        f"/particles/{LABELS[0]}/mass",
    ),
    (lambda file: file["h5md"].create_group("more"), "/h5md/more"),
    (_attribute(f"/parameters/{LABELS[0]}", "frames", "many"), f"/parameters/{LABELS[0]}"),
    (_attribute(f"/parameters/{LABELS[0]}", "sha256", "0"), f"/parameters/{LABELS[0]}"),
    (_attribute(f"/parameters/{LABELS[0]}", "run_seconds", 1e-9), f"/parameters/{LABELS[0]}"),
    (_attribute(f"{BASE}/q/value", "units", "parsec"), f"{BASE}/q/value"),
    (_attribute("/comparison/max_difference", "units", "m"), "/comparison/max_difference"),
    (_attribute("/", "complete", False), "/"),
]


@here
@pytest.mark.parametrize(("change", "place"), CHANGES)
def test_what_is_missing_changed_or_of_the_wrong_kind_is_named(
    whole: Path, tmp_path: Path, change: Callable[[Any], None], place: str
) -> None:
    path = tmp_path / "s.h5"
    shutil.copy(whole, path)
    assert store.check(path) == []
    with h5py.File(path, "r+") as file:
        change(file)
    assert place in {finding.place for finding in store.check(path)}
    for reader in READERS:
        assert one_line(said(reader, path))


def test_what_is_no_store_is_told(tmp_path: Path) -> None:
    plain = tmp_path / "plain.h5"
    with h5py.File(plain, "w") as file:
        file["x"] = 1
    (tmp_path / "text.h5").write_text("no HDF5 at all" * 100)
    (tmp_path / "empty.h5").touch()
    for name, why in {
        "plain.h5": "no store of springcheck",
        "text.h5": "no HDF5 file",
        "empty.h5": "no HDF5 file",
        "none.h5": "no such file",
        ".": "it is a folder",
    }.items():
        for reader in (store.read, store.summary, store.scene_text, store.verdicts):
            with pytest.raises(StoreError, match=why):
                reader(tmp_path / name)


WRITER = """
import h5py, sys
with h5py.File(sys.argv[1], "w") as file:
    file["x"] = 1
    file.flush()
    print("open", flush=True)
    sys.stdin.read()
"""


def test_a_file_that_another_program_is_writing_is_told(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WRITER, str(tmp_path / "s.h5")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"open\n"
        for reader in (store.read, store.summary, formats.read):
            with pytest.raises(StoreError, match="another program is writing it"):
                reader(tmp_path / "s.h5")
        writer.communicate()


def test_a_reader_that_crashes_or_never_ends_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "s.h5"
    path.touch()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    # what never ends is waited for six times as long
    for body, limit, why in (
        ("import os; os.kill(os.getpid(), 11)", 8.0, "crashes"),
        ("import time; time.sleep(60)", 0.05, "does not end"),
    ):
        monkeypatch.setattr(apart, "LIMIT", limit)
        (tmp_path / "broken.py").write_text(body)
        path.write_text(body)
        with pytest.raises(StoreError, match=why):
            apart.trust(path, "broken")


def test_no_file_is_believed_whatever_stands_in_it(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A seal, which needs no key, opened a file without any trial."""
    tried: list[str] = []
    right = apart.read
    monkeypatch.setattr(apart, "read", lambda *given: (tried.append(given[2].name), right(*given))[1])
    shutil.copy(whole, tmp_path / "a.h5")
    assert store.check(tmp_path / "a.h5") == []
    assert len(store.read(tmp_path / "a.h5")) == 2
    # once for each state of a file
    assert tried == ["a.h5"]
    bomb = tmp_path / "bomb.h5"
    shutil.copy(whole, bomb)
    with h5py.File(bomb, "r+") as file:
        del file["precision/x/h"]
        # 4 GiB of zeros in 4 MB
        file.create_dataset("precision/x/h", (1 << 29,), "<f8", chunks=(1 << 25,), compression="gzip")
        file["precision/x/h"][: 1 << 25] = 0
    with bomb.open("ab") as raw:
        raw.write(b"springcheck seal 1 0000000000000001 " + b"0" * 64 + b"\n")
    assert "/precision/x/h" in {finding.place for finding in store.check(bomb)}
    with pytest.raises(StoreError) as caught:
        store.tables_of(bomb)["precision/x"]
    assert one_line(caught.value)


COMMANDS = [
    ["inspect", "s.h5"],
    ["inspect", "s.h5", "--json"],
    ["plot", "s.h5", "-o", "pictures"],
    ["identify", "s.h5"],
    [
        "judge",
        "s.h5",
        "--scene",
        "spring",
        "--scheme",
        "explicit-euler",
        "--trajectory",
        "own:euler",
        "--json",
    ],
    ["run", "--from", "s.h5", "--json"],
]
Q = "/observables/own:euler/q/value"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "s.h5"
    methods = ["--method", "own:euler", "--method", "own:semi-implicit-euler"]
    assert main(["run", "spring", *methods, "--quiet", "-o", str(path)]) == 0
    return path


@pytest.mark.usefixtures("own_folder", "tried_here", "sketched")
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_that_shows_numbers_says_that_they_changed(
    run: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(run, "s.h5")
    assert main(command) == 0
    assert capsys.readouterr().err == ""
    with h5py.File("s.h5", "r+") as file:
        file[Q][100] *= 1 + 2.0**-30
    assert main(command) == 1
    printed = capsys.readouterr()
    assert "s.h5 is not what was written" in printed.err
    assert Q in printed.err
    if "--json" in command:
        (found,) = json.loads(printed.out)["not_trusted"]
        assert found["place"] == Q


@pytest.mark.usefixtures("own_folder", "tried_here")
def test_a_changed_trajectory_is_not_exported_and_repeated_as_what_it_is(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(run, "s.h5")
    with h5py.File("s.h5", "r+") as file:
        file[Q][100] *= 1 + 2.0**-30
    assert main(["export", "s.h5", "own:euler", "out.h5md"]) == 2
    assert Q in capsys.readouterr().err
    assert not Path("out.h5md").exists()
    assert main(["export", "s.h5", "own:semi-implicit-euler", "out.h5md"]) == 1
    assert Path("out.h5md").exists()
    capsys.readouterr()
    assert main(["run", "--from", "s.h5", "--json"]) == 1
    first, second = json.loads(capsys.readouterr().out)["repeats"]
    assert (first["equal"], first["as_written"]) == (False, True)
    assert first["difference"] > 0
    assert (second["equal"], second["as_written"], second["difference"]) == (True, True, 0)


def test_of_a_store_too_long_to_check_a_command_is_told_so(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checking, "LONGEST_CHECK", 1000)
    (found,) = store.doubts(whole)
    assert found.place == "/observables"
    assert "not checked" in found.what


@pytest.mark.usefixtures("own_folder", "tried_here")
def test_a_store_of_the_format_before_is_read_and_its_arrays_are_checked(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(run, "s.h5")
    with h5py.File("s.h5", "r+") as file:
        file.attrs["format"] = "springcheck store 2"
        del file["digests"], file["observables/exact"]
    assert main(["inspect", "s.h5"]) == 0
    assert "own:euler" in capsys.readouterr().out
    assert main(["check", "s.h5"]) == 0
    assert "older" in capsys.readouterr().out
    with h5py.File("s.h5", "r+") as file:
        file[Q][100] *= 2
    assert main(["check", "s.h5"]) == 1
    assert Q in capsys.readouterr().out
