"""What changed on disk is never shown as if nothing were: every command that shows numbers says so first."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from springcheck import store
from springcheck.cli import main
from springcheck.physics import scenefile
from springcheck.store import checking, seal

pytestmark = pytest.mark.usefixtures("own_folder", "tried_here", "sketched")

LABEL, OTHER = "own:euler", "own:semi-implicit-euler"
Q = f"/observables/{LABEL}/q/value"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "s.h5"
    assert main(["run", "spring", "--method", LABEL, "--method", OTHER, "--quiet", "-o", str(path)]) == 0
    return path


def flipped(whole: Path, name: str) -> None:
    """A copy s.h5 with one bit of an array changed: 2**-30 of the number."""
    known = seal.find(whole)
    assert known is not None
    (extent,) = [extent for extent in known.extents if extent.name == name]
    content = bytearray(whole.read_bytes())
    content[extent.offset + 8 * 100 + 2] ^= 4
    Path("s.h5").write_bytes(content)


def edited(whole: Path, change: Callable[[Any], None]) -> None:
    """A copy s.h5 that another program has written to."""
    shutil.copy(whole, "s.h5")
    with h5py.File("s.h5", "r+") as file:
        change(file)


COMMANDS = [
    ["inspect", "s.h5"],
    ["inspect", "s.h5", "--json"],
    ["inspect", "s.h5", "--trajectory", LABEL],
    ["plot", "s.h5", "-o", "pictures"],
    ["identify", "s.h5"],
    ["identify", "s.h5", "--json"],
    ["judge", "s.h5", "--scene", "spring", "--scheme", "explicit-euler", "--trajectory", LABEL],
    ["judge", "s.h5", "--scene", "spring", "--scheme", "explicit-euler", "--trajectory", LABEL, "--json"],
    ["run", "--from", "s.h5"],
    ["run", "--from", "s.h5", "--json"],
]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_of_a_whole_store_nothing_is_said(
    whole: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(whole, "s.h5")
    assert main(command) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_changed_number_is_said_first_and_in_the_exit_status(
    whole: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    flipped(whole, Q)
    assert main(command) == 1
    said = capsys.readouterr()
    assert "s.h5 is not what was written" in said.err
    assert Q in said.err
    if "--json" in command:
        (found,) = json.loads(said.out)["not_trusted"]
        assert found["place"] == Q


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_store_that_another_program_wrote_to_is_named(
    whole: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    edited(whole, lambda file: file.attrs.create("note", "of mine"))
    assert main(command) == 1
    assert "s.h5 is not what was written" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["plot", "report"])
def test_a_changed_store_is_named_before_what_becomes_of_it(
    whole: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """As one into which the runs of another scene were merged, of which no figure can be drawn."""
    edited(whole, lambda file: file.attrs.modify("scene", scenefile.text_of("chain")))
    assert main([command, "s.h5"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    changed, _, failed = line.partition("is not what was written")
    assert "s.h5" in changed
    assert "s.h5" in failed


def test_a_changed_trajectory_is_not_exported(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flipped(whole, Q)
    assert main(["export", "s.h5", LABEL, "out.h5md"]) == 2
    assert Q in capsys.readouterr().err
    assert not Path("out.h5md").exists()
    assert main(["export", "s.h5", OTHER, "out.h5md"]) == 1
    assert "s.h5 is not what was written" in capsys.readouterr().err
    assert Path("out.h5md").exists()


def test_a_repetition_is_compared_with_the_numbers(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flipped(whole, Q)
    assert main(["run", "--from", "s.h5", "--json"]) == 1
    first, second = json.loads(capsys.readouterr().out)["repeats"]
    assert (first["method"], first["equal"], first["as_written"]) == (LABEL, False, True)
    assert first["difference"] > 0
    assert (second["equal"], second["as_written"], second["difference"]) == (True, True, 0)


def _attribute(place: str, key: str, value: object) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        file[place].attrs[key] = value

    return change


def _verdict(file: Any) -> None:
    file["verdicts/passed"][0] = 1 - file["verdicts/passed"][0]


def _mass(file: Any) -> None:
    file[f"particles/{LABEL}/mass"][0] = 9.0


def _without_a_run(file: Any) -> None:
    for tree in ("parameters", "observables", "particles"):
        del file[f"{tree}/{OTHER}"]


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (_attribute(f"/parameters/{LABEL}", "run_seconds", 1e-9), f"/parameters/{LABEL}"),
        (_attribute(f"/parameters/{LABEL}", "origin.numpy", "9.9"), f"/parameters/{LABEL}"),
        (_attribute(f"/parameters/{LABEL}", "note", "mine"), f"/parameters/{LABEL}"),
        (_mass, f"/parameters/{LABEL}"),
        (_attribute("/verdicts", "about", "passed: 1 no, 0 yes"), "/verdicts"),
        (_verdict, "/verdicts"),
        (_attribute("/comparison/max_difference", "units", "m"), "/comparison"),
        (_attribute("/", "scene", "title = 'another'"), "/"),
        (_attribute("/", "complete", False), "/"),
        (_without_a_run, f"/parameters/{OTHER}"),
        (_attribute(Q, "units", "parsec"), Q),
    ],
)
def test_no_attribute_changes_unseen_when_the_seal_is_gone(
    whole: Path, change: Callable[[Any], None], place: str
) -> None:
    edited(whole, change)
    first, *found = store.check("s.h5")
    assert "no seal" in first.what
    assert place in {finding.place for finding in found}
    edited(whole, lambda file: file.attrs.modify("complete", True))
    assert ["no seal" in finding.what for finding in store.check("s.h5")] == [True]


def _as_before(file: Any) -> None:
    """The list of digests as stores had it before arrays and groups were in it."""
    listed = json.loads(file.attrs["digests"])
    kept = {x: y for x, y in listed.items() if x.split("/")[1] not in ("h5md", "observables", "particles")}
    assert len(kept) < len(listed)
    file.attrs["digests"] = json.dumps(kept)


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda file: None, None),
        (_attribute(f"/parameters/{LABEL}", "run_seconds", 1e-9), f"/parameters/{LABEL}"),
        (_verdict, "/verdicts"),
        (lambda file: file[Q].write_direct(np.zeros(file[Q].shape)), Q),
        (_attribute(f"/observables/{LABEL}/p/value", "sha256", "0"), f"/observables/{LABEL}/p/value"),
        (lambda file: file.pop(Q), f"/observables/{LABEL}"),
        (_without_a_run, f"/parameters/{OTHER}"),
    ],
)
def test_of_a_store_of_before_it_is_told_what_has_changed(
    whole: Path, change: Callable[[Any], None], place: str | None
) -> None:
    edited(whole, _as_before)
    with h5py.File("s.h5", "r+") as file:
        change(file)
    first, *found, last = store.check("s.h5")
    assert "no seal" in first.what
    assert last.what.endswith("groups, units and views are not told")
    assert [finding.place for finding in found] == ([] if place is None else [place])


@pytest.mark.parametrize("earlier", [False, True])
def test_an_array_that_claims_more_than_was_laid_out_is_not_read(
    whole: Path, earlier: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    edited(whole, _as_before if earlier else lambda file: None)
    with h5py.File("s.h5", "r+") as file:
        said = file[Q].attrs["sha256"]
        del file[Q]
        # 64 MiB that lie in the file as a hole
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        how.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        space, group, name = h5py.h5s.create_simple((1 << 23, 1)), file[Q.rpartition("/")[0]].id, b"value"
        made = h5py.Dataset(h5py.h5d.create(group, name, h5py.h5t.IEEE_F64LE, space, how))
        made.attrs["sha256"] = said
    assert Path("s.h5").stat().st_size > 1 << 26
    read: list[str] = []
    monkeypatch.setattr(seal, "broken", lambda path, extents: read.extend(x.name for x in extents) or [])
    assert any(
        Q.startswith(finding.place) and finding.place != "/" for finding in checking.structure(Path("s.h5"))
    )
    assert read
    assert Q not in read


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda file: file.pop(f"/particles/{LABEL}/position/value"), f"/particles/{LABEL}/position/value"),
        (lambda file: file.pop(f"/observables/{LABEL}/q/step"), f"/observables/{LABEL}/q/step"),
        (lambda file: file["h5md"].create_group("more"), "/h5md/more"),
        (_attribute(f"/observables/{LABEL}/q", "signal", "time"), f"/observables/{LABEL}/q"),
    ],
)
def test_of_what_is_laid_out_for_others_the_place_is_told(
    whole: Path, change: Callable[[Any], None], place: str
) -> None:
    edited(whole, change)
    found = [finding.place for finding in store.check("s.h5")]
    assert found[1:] == [place]


def test_every_flipped_bit_of_an_array_is_found(whole: Path) -> None:
    known = seal.find(whole)
    assert known is not None
    assert len(known.extents) >= 10
    for extent in known.extents:
        flipped(whole, extent.name)
        assert extent.name in {finding.place for finding in store.check("s.h5")}
    assert np.all([extent.size > 800 for extent in known.extents])


def test_what_makes_a_store_unreadable_is_said_once(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("s.h5").write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    assert main(["report", "s.h5"]) == 2
    assert capsys.readouterr().err.count("its end is missing") == 1
