"""Files of the user: only what is recognisably ours is claimed, replaced or deleted; no link is followed."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from springcheck import store
from springcheck.cli import main
from springcheck.engines.own import compiled
from springcheck.physics.scenefile import folder
from springcheck.store import files, parts
from stores import LABELS, scene, trajectory, written

pytestmark = pytest.mark.usefixtures("own_folder", "tried_here", "sketched")

OWN = ["--method", "own:euler", "--quiet"]


def refused(capsys: pytest.CaptureFixture[str], arguments: list[str], *words: str) -> None:
    capsys.readouterr()
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    for word in words:
        assert word in said


@pytest.mark.parametrize("name", ["thesis.txt", "command", "lock", "run-thesis.h5", "undo"])
@pytest.mark.parametrize("force", [[], ["--force"]])
def test_a_folder_of_the_users_where_the_journal_goes_is_left_alone(
    name: str, force: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("x.h5.parts").mkdir()
    Path("x.h5.parts", name).write_text("years of work")
    refused(capsys, ["run", "spring", *OWN, *force, "-o", "x.h5"], "x.h5.parts", "move it away")
    assert Path("x.h5.parts", name).read_text() == "years of work"
    assert [entry.name for entry in Path("x.h5.parts").iterdir()] == [name]


def test_a_link_where_the_journal_goes_is_not_followed(capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine").mkdir()
    Path("x.h5.parts").symlink_to("mine", target_is_directory=True)
    refused(capsys, ["run", "spring", *OWN, "-o", "x.h5"], "x.h5.parts", "move it away")
    assert list(Path("mine").iterdir()) == []


@pytest.mark.parametrize("make", [os.symlink, os.link])
@pytest.mark.parametrize("name", ["lock", "command", "undo"])
@pytest.mark.parametrize("content", ["years of work", ""])
def test_no_link_within_a_journal_reaches_what_it_leads_to(
    make: Callable[[Any, Any], None], name: str, content: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with store.open_new("x.h5", "run") as journal:
        journal.save(trajectory(scene(), LABELS[0]), scene())
    Path("mine").write_text(content)
    Path("x.h5.parts", name).unlink(missing_ok=True)
    make(Path("mine").absolute(), Path("x.h5.parts", name))
    main(["run", "spring", *OWN, "--force", "-o", "x.h5"])
    assert "Traceback" not in capsys.readouterr().err
    assert Path("mine").read_text() == content


def test_what_a_user_puts_into_a_journal_outlives_it() -> None:
    with store.open_new("x.h5", "run") as journal:
        journal.save(trajectory(scene(), LABELS[0]), scene())
        Path("x.h5.parts", "notes.txt").write_text("mine")
        journal.commit(scene())
    assert [entry.name for entry in Path("x.h5.parts").iterdir()] == ["notes.txt"]
    assert store.check("x.h5") == []
    assert store.summary("x.h5").complete


def test_a_file_with_the_name_of_a_temporary_one_is_left_alone() -> None:
    written(Path("s.h5"), scene())
    Path("o.h5md.new").write_text("mine")
    store.export("s.h5", LABELS[0], "o.h5md")
    assert Path("o.h5md.new").read_text() == "mine"
    assert sorted(path.name for path in Path().iterdir()) == ["o.h5md", "o.h5md.new", "s.h5"]


@pytest.mark.parametrize("name", ["README.md", "my.conf", "data.h5"])
@pytest.mark.parametrize("command", [["run", "my.conf", *OWN], ["stability", "my.conf", *OWN]])
def test_force_replaces_stores_alone(
    name: str, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    text = (folder() / "spring.toml").read_text()
    for one in ("README.md", "my.conf", "data.h5"):
        Path(one).write_text(text)
    refused(capsys, [*command, "--force", "-o", name], name, "no store")
    assert Path(name).read_text() == text
    assert not Path(name + ".parts").exists()


def test_force_replaces_a_store_that_is_damaged(tmp_path: Path) -> None:
    written(Path("s.h5"), scene())
    content = Path("s.h5").read_bytes()
    Path("empty.h5").touch()
    Path("cut.h5").write_bytes(content[: len(content) // 2])
    Path("flipped.h5").write_bytes(content[:900] + b"\xff" + content[901:])
    for name in ("empty.h5", "cut.h5", "flipped.h5"):
        assert main(["run", "spring", *OWN, "--force", "-o", name]) == 0
        assert store.check(name) == []


def test_plot_replaces_no_figure_but_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "spring", *OWN, "-o", "a.h5"]) == 0
    assert main(["run", "spring", "--method", "own:implicit-euler", "--quiet", "-o", "b.h5"]) == 0
    assert main(["plot", "a.h5"]) == 0
    first = {path: path.read_bytes() for path in Path("figures").rglob("*.[ps]*g")}
    assert first
    assert {path.parent for path in first} == {Path("figures/a")}
    assert main(["plot", "b.h5"]) == 0
    assert {path: path.read_bytes() for path in first} == first
    assert main(["plot", "a.h5"]) == 0
    refused(capsys, ["plot", "b.h5", "-o", "figures/a"], "figures/a", "a.h5")
    assert {path: path.read_bytes() for path in first} == first
    mine = next(iter(first))
    mine.write_text("mine")
    refused(capsys, ["plot", "a.h5"], str(mine), "move it away")
    assert mine.read_text() == "mine"
    mine.unlink()
    Path("precious").write_text("mine")
    mine.symlink_to(Path("precious").absolute())
    main(["plot", "a.h5"])
    assert Path("precious").read_text() == "mine"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of a study, which is measured once."""
    path = tmp_path_factory.mktemp("study") / "s.h5"
    command = ["stability", "overdamped", "--method", "own:implicit-euler", "--quiet", "-o", str(path)]
    assert main(command) == 0
    return path


@pytest.mark.parametrize("name", ["/../../PWNED", "../PWNED", "a/PWNED", "PWNED\n\x1b[2J"])
def test_the_scene_name_of_a_store_reaches_no_file_name(name: str, study: Path, tmp_path: Path) -> None:
    import h5py

    shutil.copy(study, "t.h5")
    with h5py.File("t.h5", "r+") as file:
        file.attrs["scene_name"] = name
    Path("in").mkdir()
    main(["plot", "t.h5", "-o", "in"])
    assert [path for path in tmp_path.rglob("*PWNED*") if path.parent != tmp_path / "in"] == []
    assert list(tmp_path.parent.glob("*PWNED*")) == list(Path("/").glob("*PWNED*")) == []
    assert all(path.name.isprintable() for path in Path("in").iterdir())


def test_a_command_whose_saved_compiled_code_is_damaged_compiles_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    numba = pytest.importorskip("numba")
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    text = (folder() / "spring.toml").read_text()
    Path("long.toml").write_text(
        text.replace("steps = 200", "steps = 1000000") + "\n[record]\nevery = 10000\n"
    )
    digests = []
    for name in ("first.h5", "again.h5"):
        compiled._COMPILED.clear()
        assert main(["run", "long.toml", *OWN, "-o", name]) == 0
        digests.append([store.read_one(Path(name), "own:euler").q.tobytes()])
        kept = [path for path in Path("cache").rglob("*") if path.is_file()]
        assert {path.suffix for path in kept} == {".nbi", ".nbc", ".seal"}
        for path in kept:
            path.write_bytes(bytes(len(path.read_bytes())))
    compiled._COMPILED.clear()
    assert digests[0] == digests[1]
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_without_locks_or_room_to_reserve_is_used_and_it_is_said(
    number: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def lacks(*_: object) -> None:
        raise OSError(number, "")

    monkeypatch.setattr("fcntl.flock", lacks)
    monkeypatch.setattr(os, "posix_fallocate", lacks)
    assert main(["run", "spring", *OWN, "-o", "s.h5"]) == 0
    assert "locks" in capsys.readouterr().err
    assert store.check("s.h5") == []


def damage(part: Path) -> None:
    content = bytearray(part.read_bytes())
    content[len(content) // 3] ^= 4
    part.write_bytes(content)


def test_only_the_damaged_part_of_a_journal_is_measured_again(capsys: pytest.CaptureFixture[str]) -> None:
    s = scene()
    with store.open_new("s.h5", "run") as journal:
        for label in LABELS:
            journal.save(trajectory(s, label), s)
        journal.add(store.Table(name="precision/x", columns={"h": [1.0]}))
    damage(next(Path("s.h5.parts").glob("run-own*")))
    damage(next(Path("s.h5.parts").glob("table-*")))
    with pytest.warns(UserWarning, match=r"damaged.*own:euler is measured again"):
        journal = store.open_new("s.h5", "run")
    with journal:
        assert list(journal.finished()) == LABELS[1:]
        assert journal.tables() == {}


def test_a_part_of_another_run_is_not_taken_up() -> None:
    s = scene()
    for name in ("s.h5", "t.h5"):
        with store.open_new(name, "run") as journal:
            journal.save(trajectory(s, LABELS[name == "t.h5"]), s)
    part = next(parts.folder_of(Path("t.h5")).glob("run-*"))
    shutil.copy(part, parts.folder_of(Path("s.h5")) / part.name)
    with pytest.warns(UserWarning, match="is measured again"), store.open_new("s.h5", "run") as journal:
        assert list(journal.finished()) == [LABELS[0]]


def test_a_journal_whose_lock_alone_is_left_is_tidied_up() -> None:
    Path("s.h5.parts").mkdir()
    lock = files.Lock(Path("s.h5.parts/lock"))
    lock.release()
    written(Path("s.h5"), scene())
    assert [path.name for path in Path().iterdir()] == ["s.h5"]


def test_a_lock_whose_file_goes_as_it_is_taken_is_taken_of_the_file_that_others_see(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The holder before has removed it: two would write, each with a lock of its own."""
    path, right = Path("lock"), files._locked
    again: list[Any] = []

    def locked(file: Any) -> bool:
        if not again:
            path.unlink()
        again.append(file)
        return right(file)

    monkeypatch.setattr(files, "_locked", locked)
    lock = files.Lock(path)
    assert len(again) == 2
    assert os.path.samestat(path.stat(), os.fstat(lock._file.fileno()))
    lock.release()
