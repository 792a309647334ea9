"""Nothing that was reported is ever lost, whatever ends the writer (validation/kill.py kills real ones)."""

from __future__ import annotations

import io
import json
import os
import resource
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import power
from springcheck import store
from springcheck.errors import StoreError, StoreWarning
from springcheck.store import Draft, adopt, files, merge, seal
from springcheck.store.parts import parts_folder
from stores import LABELS, assert_same, scene, trajectory, written


class Killed(BaseException):
    """A kill, as seen from the place where it happens."""


def parts(path: Path) -> list[str]:
    return sorted(entry.name for entry in parts_folder(path).iterdir())


def digests(path: Path) -> dict[str, object]:
    return {run.label: run.parameters["sha256"] for run in store.summary(path).runs}


def test_the_same_command_takes_up_what_is_finished(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as journal:
        journal.save(trajectory(s, LABELS[0]), s)
        journal.add(store.Table(name="precision/x", columns={"h": [1.0]}))
    with store.open_new(path, "run") as journal:
        assert journal.finished() == (LABELS[0],)
        assert list(journal.tables()) == ["precision/x"]
        journal.save(trajectory(s, LABELS[1], 1), s)
        journal.commit(s)
    found = store.read(path)
    assert_same(trajectory(s, LABELS[0]), found[LABELS[0]])
    assert_same(trajectory(s, LABELS[1], 1), found[LABELS[1]])
    assert os.listdir(tmp_path) == ["s.h5"]


def test_another_command_is_refused_unless_forced_to_start_over(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as journal:
        journal.save(trajectory(s, LABELS[0]), s)
    with pytest.raises(StoreError, match="another command"):
        store.open_new(path, "run with another step")
    assert list(store.read(path)) == [LABELS[0]]
    with store.open_new(path, "run with another step", force=True) as journal:
        assert journal.finished() == ()


def test_a_forced_run_that_was_killed_leaves_the_old_store_and_is_taken_up_without_force(
    tmp_path: Path,
) -> None:
    path, s = tmp_path / "s.h5", scene()
    made = written(path, s)
    with store.open_new(path, "new", force=True) as journal:
        journal.save(trajectory(s, "ase:velocity-verlet", 9), s)
    assert list(store.read(path)) == list(made)
    with store.open_new(path, "new") as journal:
        assert journal.finished() == ("ase:velocity-verlet",)
        journal.commit(s)
    assert list(store.read(path)) == ["ase:velocity-verlet"]


def test_a_store_whose_writer_was_killed_as_it_tidied_up_is_complete(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    written(path, s)
    (tmp_path / "s.h5.parts").mkdir()
    (tmp_path / "s.h5.parts" / "lock").touch()
    assert store.summary(path).complete
    with pytest.raises(StoreError, match="exists"):
        store.open_new(path, "run")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["s.h5"]


def test_a_store_whose_writer_was_killed_before_it_tidied_up_is_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "s.h5"
    journal = store.open_new(path, "study")
    for i in range(3):
        journal.add(store.Table(name=f"cells/{i}", columns={"x": [1.0 * i]}), by=[{"host": "h"}], rows=True)
    with monkeypatch.context() as patch:
        patch.setattr(adopt, "settled", _dies(adopt.settled, 1))
        with pytest.raises(Killed):
            journal.commit()
    journal._lock.release()
    assert len(list(parts_folder(path).glob("rows-*"))) == 3
    assert store.summary(path).complete
    with pytest.raises(StoreError, match="exists"):
        store.open_new(path, "study")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["s.h5"]
    assert store.tables_of(path)["cells"].columns["x"].tolist() == [0.0, 1.0, 2.0]
    assert store.check(path) == []


def test_a_journal_without_work_leaves_nothing(tmp_path: Path) -> None:
    with store.open_new(tmp_path / "s.h5", "run") as journal:
        journal.finished()
    with store.open_new(tmp_path / "s.h5", "run") as journal, journal.draft(LABELS[0], scene()) as draft:
        one = trajectory(scene(), LABELS[0])
        draft.append(one.t, one.q, one.p, one.energy)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("large", [0, 1 << 40])
def test_a_writer_that_dies_anywhere_in_a_commit_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, large: int, whole: bool
) -> None:
    s = scene()
    monkeypatch.setattr(adopt, "LARGE", large)
    # the one dies in every odd call, the other in every even one
    calls = range(1, 40) if whole else range(1 + (large > 0), 40, 2)
    places: list[tuple[object, str]] = [
        (Path, "replace"),
        (Path, "unlink"),
        (files, "sync_folder"),
        (files, "reserve"),
        (merge, "_take"),
        (merge, "_plots"),
        (seal, "attach"),
        (os, "fsync"),
    ]
    with store.open_new(tmp_path / "s.h5", "run") as journal:
        for seed, label in enumerate(LABELS):
            journal.save(trajectory(s, label, seed), s)
    expected = digests(tmp_path / "s.h5")
    deaths = 0
    for owner, name in places:
        for call in calls:
            path = tmp_path / f"{name}-{call}.h5"
            shutil.copytree(parts_folder(tmp_path / "s.h5"), parts_folder(path))
            with monkeypatch.context() as patch:
                # what a killed process never does: tidy up
                patch.setattr("springcheck.store.journal._give_up", lambda temporary, run: None)
                patch.setattr(store.Journal, "close", lambda self: self._lock.release())
                patch.setattr(owner, name, _dies(getattr(owner, name), call))
                try:
                    with store.open_new(path, "run") as journal:
                        journal.commit(s)
                    break
                except Killed:
                    deaths += 1
            if path.exists():
                assert store.summary(path).complete
                with pytest.raises(StoreError, match="exists"):
                    store.open_new(path, "run")
                # nothing stays beside it that a later command would find
                assert not parts_folder(path).exists()
            else:
                with store.open_new(path, "run") as journal:
                    assert tuple(journal.finished()) == tuple(LABELS)
                    journal.commit(s)
            assert digests(path) == expected, (name, call)
            assert store.check(path) == []
    assert deaths >= (14 if whole else 6)


def _dies(real: Callable[..., object], call: int) -> Callable[..., object]:
    made = 0

    def dying(*given: object, **named: object) -> object:
        nonlocal made
        made += 1
        if made == call:
            raise Killed
        return real(*given, **named)

    return dying


def test_a_commit_that_fails_puts_an_adopted_part_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, s = tmp_path / "s.h5", scene()
    monkeypatch.setattr(adopt, "LARGE", 0)
    with store.open_new(path, "run") as journal:
        journal.save(trajectory(s, LABELS[0]), s)
        (part,) = parts_folder(path).glob("run-*")
        before = part.read_bytes()
        with monkeypatch.context() as patch:
            patch.setattr(merge, "_plots", _dies(print, 1))
            with pytest.raises(Killed):
                journal.commit(s)
        assert part.read_bytes() == before
        assert parts(path) == ["command", "lock", part.name]
        journal.commit(s)
    assert store.check(path) == []


def test_an_adopted_part_is_changed_only_once_its_new_name_outlives_a_loss_of_power(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Under its old name a part that was changed would be taken for whole, and no undo file be asked for."""
    path, s = tmp_path / "s.h5", scene()
    monkeypatch.setattr(adopt, "LARGE", 0)
    synced: list[list[str]] = []
    real = files.sync_folder

    def noted(folder: Path) -> None:
        real(folder)
        synced.append(sorted(os.listdir(folder)))

    with store.open_new(path, "run") as journal:
        journal.save(trajectory(s, LABELS[0]), s)
        monkeypatch.setattr(files, "sync_folder", noted)
        monkeypatch.setattr(merge.layout, "reopened", _dies(print, 1))
        with pytest.raises(Killed):
            journal.commit(s)
    assert synced[1] == ["collection.new", "command", "lock", "undo"]


def test_large_parts_alone_are_adopted(tmp_path: Path) -> None:
    """A copy of a third of a gigabyte takes a second; of two large ones the larger stays where it is."""
    for name, size in (("small", 10**8), ("large", 3 * 10**8), ("larger", 4 * 10**8)):
        with (tmp_path / name).open("wb") as file:
            file.truncate(size)
    known = [tmp_path / name for name in ("small", "larger", "large")]
    assert adopt.choice(known) == tmp_path / "larger"
    assert adopt.choice(known[:1]) is None


def test_what_a_kill_left_half_written_goes_with_the_next_writer(tmp_path: Path) -> None:
    with store.open_new(tmp_path / "s.h5", "run") as journal:
        journal.save(trajectory(scene(), LABELS[0]), scene())
    left = files.temporary(parts_folder(tmp_path / "s.h5") / "run-x.h5")
    left.write_bytes(bytes(10))
    with store.open_new(tmp_path / "s.h5", "run"):
        assert not left.exists()


def test_a_number_of_a_part_that_changed_is_measured_again(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as journal:
        journal.save(trajectory(s, LABELS[0]), s)
    (part,) = parts_folder(path).glob("run-*")
    known = seal.find(part)
    assert known is not None
    content = bytearray(part.read_bytes())
    content[known.extents[0].offset] ^= 1
    part.write_bytes(content)
    with (
        pytest.warns(StoreWarning, match="was damaged and is removed"),
        store.open_new(path, "run") as journal,
    ):
        assert journal.finished() == ()


class Grudging(io.FileIO):
    """A file that takes some bytes at a time, as the system may."""

    def write(self, content: Any) -> int:
        return super().write(content[:7])


def test_a_system_that_takes_some_bytes_at_a_time_loses_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = Draft._create

    def made(draft: Draft, frames: int) -> None:
        real(draft, frames)
        for name, file in draft._files.items():
            draft._files[name] = Grudging(file.name, "rb+")
            draft._files[name].seek(file.tell())
            file.close()

    monkeypatch.setattr(Draft, "_create", made)
    found = written(tmp_path / "s.h5", scene())
    assert store.check(tmp_path / "s.h5") == []
    for label, one in store.read(tmp_path / "s.h5").items():
        assert_same(found[label], one)


def test_a_second_writer_is_told_who_has_the_store(tmp_path: Path) -> None:
    code = (
        "import sys; from springcheck import store; from springcheck.errors import StoreError\n"
        "try: store.open_new(sys.argv[1], 'run', force=True)\n"
        "except StoreError as error: print(error)"
    )
    with store.open_new(tmp_path / "s.h5", "run"):
        ran = subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / "s.h5")], capture_output=True, text=True, check=True
        )
    assert f"is being written by process {os.getpid()} on " in ran.stdout
    assert " since 20" in ran.stdout
    with store.open_new(tmp_path / "s.h5", "run") as journal:
        assert journal.finished() == ()


def test_a_reader_keeps_the_file_that_it_has_open(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    made = written(path, s)
    pieces = store.windows(path, LABELS[0], 3)
    first = next(pieces)
    with store.open_new(path, "new", force=True) as journal:
        journal.save(trajectory(s, "other", 5), s)
        journal.commit(s)
    rest = list(pieces)
    assert rest[-1].q[-1].tobytes() == made[LABELS[0]].q[-1].tobytes()
    assert first.q[0].tobytes() == made[LABELS[0]].q[0].tobytes()


FULL = """
import resource, sys
from springcheck import store
from springcheck.errors import StoreError
sys.path.insert(0, sys.argv[3])
from stores import LABELS, scene, trajectory
s = scene(steps=4000)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    with store.open_new(sys.argv[1], "run") as journal:
        for label in LABELS:
            if label not in journal.finished():
                print(label, journal.save(trajectory(s, label), s), flush=True)
        journal.commit(s)
except StoreError as error:
    print("told:", error)
"""


@pytest.mark.parametrize("size", [10, 3_000, 100_000, 250_000, 500_000])
def test_a_full_disk_is_told_in_one_line_and_loses_nothing(tmp_path: Path, size: int) -> None:
    path, s = tmp_path / "s.h5", scene(steps=4000)
    ran = subprocess.run(
        # -B: no half of a module's bytecode may be left under this limit
        [sys.executable, "-B", "-c", FULL, str(path), str(size), str(Path(__file__).parent)],
        capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    *stored, last = ran.stdout.splitlines()
    assert last.startswith("told: cannot write")
    assert "larger than this system allows" in last
    assert ran.stderr == ""
    with store.open_new(path, "run") as journal:
        assert [line.split()[0] for line in stored] == list(journal.finished())
        for label in LABELS:
            if label not in journal.finished():
                journal.save(trajectory(s, label), s)
        journal.commit(s)
    assert store.check(path) == []
    assert {line.split()[0]: line.split()[1] for line in stored}.items() <= digests(path).items()
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != size


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    for above in [tmp_path, *tmp_path.parents][:-1]:
        if above.stat().st_uid == os.geteuid() and above != tmp_path:
            above.chmod(above.stat().st_mode | 0o055)
    code = (
        "import os, sys\nfrom springcheck import store\nfrom springcheck.errors import StoreError\n"
        "if os.geteuid() == 0: os.setuid(65534)\n"  # root may write anywhere
        "try: store.open_new(sys.argv[1], 'run')\nexcept StoreError as error: print(error)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "s.h5")], capture_output=True, text=True, check=True
    )
    tmp_path.chmod(0o755)
    assert ran.stdout.strip() == f"cannot write into {tmp_path}: permission denied"


def test_a_folder_that_does_not_exist_is_told(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="no folder"):
        store.open_new(tmp_path / "none" / "s.h5", "run")
    with pytest.raises(StoreError, match="it is a folder"):
        store.open_new(tmp_path, "run")


def test_a_damaged_part_is_named_and_never_merged(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as journal:
        journal.save(trajectory(s, LABELS[0]), s)
        journal.save(trajectory(s, LABELS[1]), s)
        part = sorted(parts_folder(path).glob("run-*"))[0]
        content = bytearray(part.read_bytes())
        found = seal.find(part)
        assert found is not None
        content[found.extents[0].offset + 5] ^= 1
        part.write_bytes(content)
        with pytest.raises(StoreError, match="damaged"):
            journal.commit(s)
    assert not path.exists()
    assert [finding.place.split(": ")[0] for finding in store.check(path)] == [part.name]


def test_the_claim_of_a_journal_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as journal:
        journal.save(trajectory(s, LABELS[0]), s)
    claim = parts_folder(path) / "command"
    assert json.loads(claim.read_bytes())["command"] == "run"
    claim.write_bytes(b"{")
    with pytest.raises(StoreError, match="stands where its journal goes"):
        store.open_new(path, "run")


def test_a_link_stays_a_link_and_leads_to_the_store(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    link, s = tmp_path / "s.h5", scene()
    link.symlink_to(tmp_path / "disk" / "real.h5")
    made = written(link, s)
    assert link.is_symlink()
    assert list(store.read(tmp_path / "disk" / "real.h5")) == list(made) == list(store.read(link))
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["disk", "s.h5"]


def test_a_loss_of_power_at_any_moment_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adopt, "LARGE", adopt.LARGE)
    with warnings.catch_warnings():
        # parts that a loss has torn were never reported
        warnings.simplefilter("ignore", store.StoreWarning)
        assert power.losses(20, promises=True) == 0
        # the check sees losses: nine of ten such states lose something
        assert power.losses(5, promises=False) > 0
