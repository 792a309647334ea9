"""Nothing that was reported is ever lost, whatever ends the writer (validation/kill.py kills real ones)."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

from springcheck import store
from springcheck.errors import StoreError, StoreWarning
from springcheck.store import collection, digests, files
from springcheck.store.parts import folder_of
from stores import LABELS, assert_same, scene, trajectory, written

pytestmark = pytest.mark.usefixtures("tried_here")


class Killed(BaseException):
    """A kill, as seen from the place where it happens."""


def parts(path: Path) -> list[str]:
    return sorted(entry.name for entry in folder_of(path).iterdir())


def summed(path: Path) -> dict[str, object]:
    return {run.label: run.parameters["sha256"] for run in store.summary(path).runs}


def test_the_same_command_takes_up_what_is_finished(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as writer:
        writer.save(trajectory(s, LABELS[0]), s)
        writer.add(store.Table(name="precision/x", columns={"h": [1.0]}))
    with store.open_new(path, "run") as writer:
        assert list(writer.finished()) == [LABELS[0]]
        assert list(writer.tables()) == ["precision/x"]
        writer.save(trajectory(s, LABELS[1], 1), s)
        writer.commit(s)
    found = store.read(path)
    assert_same(trajectory(s, LABELS[0]), found[LABELS[0]])
    assert_same(trajectory(s, LABELS[1], 1), found[LABELS[1]])
    assert os.listdir(tmp_path) == ["s.h5"]


def test_another_command_is_refused_unless_forced_to_start_over(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as writer:
        writer.save(trajectory(s, LABELS[0]), s)
    with pytest.raises(StoreError, match="another command"):
        store.open_new(path, "run with another step")
    assert list(store.read(path)) == [LABELS[0]]
    with store.open_new(path, "run with another step", force=True) as writer:
        assert not writer.finished()


def test_a_forced_run_that_was_killed_leaves_the_old_store_and_is_taken_up_without_force(
    tmp_path: Path,
) -> None:
    path, s = tmp_path / "s.h5", scene()
    made = written(path, s)
    with store.open_new(path, "new", force=True) as writer:
        writer.save(trajectory(s, "ase:velocity-verlet", 9), s)
    assert list(store.read(path)) == list(made)
    with store.open_new(path, "new") as writer:
        assert list(writer.finished()) == ["ase:velocity-verlet"]
        writer.commit(s)
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


@pytest.mark.parametrize("call", [2, 3, 4, 5])
def test_a_store_whose_writer_was_killed_before_it_tidied_up_is_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: int
) -> None:
    path = tmp_path / "s.h5"
    writer = store.open_new(path, "study")
    for i in range(3):
        writer.add(store.Table(name=f"cells/{i}", columns={"x": [1.0 * i]}))
    with monkeypatch.context() as patch:
        # the first makes place for the new file; then go the claim, the parts and the lock
        patch.setattr(Path, "unlink", _dies(Path.unlink, call))
        with pytest.raises(Killed):
            writer.commit()
    writer._lock.release()
    assert store.summary(path).complete
    with pytest.raises(StoreError, match="exists"):
        store.open_new(path, "study")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["s.h5"]
    assert [store.tables_of(path)[f"cells/{i}"].columns["x"].tolist() for i in range(3)] == [
        [0.0],
        [1.0],
        [2.0],
    ]
    assert store.check(path) == []


def test_a_journal_without_work_leaves_nothing(tmp_path: Path) -> None:
    with store.open_new(tmp_path / "s.h5", "run") as writer:
        writer.finished()
    with store.open_new(tmp_path / "s.h5", "run") as writer, writer.draft(LABELS[0], scene()) as draft:
        one = trajectory(scene(), LABELS[0])
        draft.append(one.t, one.q, one.p, one.energy)
    assert list(tmp_path.iterdir()) == []


def test_a_writer_that_dies_anywhere_in_a_commit_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: bool
) -> None:
    s = scene()
    places: list[tuple[object, str]] = [
        (Path, "replace"),
        (Path, "unlink"),
        (files, "sync_folder"),
        (files, "reserve"),
        (collection, "_take"),
        (collection, "_plots"),
        (digests, "write"),
        (os, "fsync"),
    ]
    with store.open_new(tmp_path / "s.h5", "run") as writer:
        for seed, label in enumerate(LABELS):
            writer.save(trajectory(s, label, seed), s)
    expected = summed(tmp_path / "s.h5")
    deaths = 0
    for owner, name in places:
        for call in range(1, 40, 1 if whole else 2):
            path = tmp_path / f"{name}-{call}.h5"
            shutil.copytree(folder_of(tmp_path / "s.h5"), folder_of(path))
            with monkeypatch.context() as patch:
                # what a killed process never does: tidy up
                patch.setattr(store.Journal, "close", lambda self: self._lock.release())
                patch.setattr(owner, name, _dies(getattr(owner, name), call))
                try:
                    with store.open_new(path, "run") as writer:
                        writer.commit(s)
                    break
                except Killed:
                    deaths += 1
            if path.exists():
                assert store.summary(path).complete
                with pytest.raises(StoreError, match="exists"):
                    store.open_new(path, "run")
                # nothing is left next to it that a later command would find
                assert not folder_of(path).exists()
            else:
                with store.open_new(path, "run") as writer:
                    assert list(writer.finished()) == LABELS
                    writer.commit(s)
            assert summed(path) == expected, (name, call)
            assert store.check(path) == []
    assert deaths >= 8


def _dies(real: Callable[..., object], call: int) -> Callable[..., object]:
    made = 0

    def dying(*given: object, **named: object) -> object:
        nonlocal made
        made += 1
        if made == call:
            raise Killed
        return real(*given, **named)

    return dying


def test_a_commit_that_fails_leaves_its_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as writer:
        writer.save(trajectory(s, LABELS[0]), s)
        (part,) = folder_of(path).glob("run-*")
        with monkeypatch.context() as patch:
            patch.setattr(collection, "_plots", _dies(print, 1))
            with pytest.raises(Killed):
                writer.commit(s)
        assert parts(path) == ["command", "lock", part.name]
        writer.commit(s)
    assert store.check(path) == []


def test_what_a_kill_left_half_written_goes_with_the_next_writer(tmp_path: Path) -> None:
    with store.open_new(tmp_path / "s.h5", "run") as writer:
        writer.save(trajectory(scene(), LABELS[0]), scene())
    left = files.temporary(folder_of(tmp_path / "s.h5") / "run-x.h5")
    left.write_bytes(bytes(10))
    with store.open_new(tmp_path / "s.h5", "run"):
        assert not left.exists()


def test_a_number_of_a_part_that_changed_is_measured_again(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as writer:
        writer.save(trajectory(s, LABELS[0]), s)
    (part,) = folder_of(path).glob("run-*")
    _flip(part)
    with (
        pytest.warns(StoreWarning, match="was damaged and is removed"),
        store.open_new(path, "run") as writer,
    ):
        assert not writer.finished()


def _flip(part: Path) -> None:
    """Change one bit of the positions in a part."""
    with h5py.File(part) as file:
        place = file[f"observables/{LABELS[0]}/q/value"].id.get_offset() + 5
    content = bytearray(part.read_bytes())
    content[place] ^= 1
    part.write_bytes(content)


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
    assert "is being written by another process" in ran.stdout
    with store.open_new(tmp_path / "s.h5", "run") as writer:
        assert not writer.finished()


def test_a_reader_keeps_the_file_that_it_has_open(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    made = written(path, s)
    pieces = store.windows(path, LABELS[0], 3)
    first = next(pieces)
    with store.open_new(path, "new", force=True) as writer:
        writer.save(trajectory(s, "other", 5), s)
        writer.commit(s)
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
    with store.open_new(sys.argv[1], "run") as writer:
        for label in LABELS:
            if label not in writer.finished():
                print(label, writer.save(trajectory(s, label), s), flush=True)
        writer.commit(s)
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
    with store.open_new(path, "run") as writer:
        assert [line.split()[0] for line in stored] == list(writer.finished())
        for label in LABELS:
            if label not in writer.finished():
                writer.save(trajectory(s, label), s)
        writer.commit(s)
    assert store.check(path) == []
    assert {line.split()[0]: line.split()[1] for line in stored}.items() <= summed(path).items()
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
    with store.open_new(path, "run") as writer:
        writer.save(trajectory(s, LABELS[0]), s)
        writer.save(trajectory(s, LABELS[1]), s)
        (part,) = folder_of(path).glob(f"run-{LABELS[0].partition(':')[0]}*")
        _flip(part)
        with pytest.raises(StoreError, match="damaged"):
            writer.commit(s)
    assert not path.exists()
    assert [finding.place.split(": ")[0] for finding in store.check(path)] == [part.name]


def test_the_claim_of_a_journal_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    path, s = tmp_path / "s.h5", scene()
    with store.open_new(path, "run") as writer:
        writer.save(trajectory(s, LABELS[0]), s)
    claim = folder_of(path) / "command"
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
