"""A file that is damaged, foreign or no HDF5 is told in one line: no traceback, no hang, no crash.

Every damage must be found, too: a byte flipped anywhere in a store of ours is named by `check`.
validation/campaign.py tries thousands more.
"""

from __future__ import annotations

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

from springcheck import store
from springcheck.cli import file, main
from springcheck.errors import StoreError
from springcheck.formats import hdf5
from springcheck.physics.trajectory import Comparison
from springcheck.store import apart, checking, seal, trust
from stores import LABELS, scene, trajectory

READERS: list[Callable[[Path], object]] = [
    store.read,
    store.summary,
    store.scene_text,
    store.verdicts,
    store.comparison,
    lambda path: dict(store.tables_of(path)),
    hdf5.read_hdf5,
    lambda path: list(store.windows(path, LABELS[0], 7)),
    lambda path: store.strided(path, LABELS[0], 7),
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "s.h5"
    s = scene(steps=100)
    with store.open_new(path, "run") as journal:
        for seed, label in enumerate(LABELS[:2]):
            journal.save(trajectory(s, label, seed), s)
        journal.add(store.Table(name="precision/x", columns={"h": [1.0, 2.0]}))
        journal.commit(s, comparison=Comparison(labels=("a",), max_difference=np.eye(1)))
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


def test_no_byte_can_change_unseen(whole: Path, tmp_path: Path) -> None:
    known = seal.find(whole)
    assert known is not None
    rng = random.Random(5)
    for place in rng.sample(range(whole.stat().st_size), 1500):
        path = flipped(whole, tmp_path / "s.h5", place)
        found = seal.find(path)
        broken = [] if found is None else seal.broken(path, found.extents)
        inside = [e.name for e in known.extents if e.offset <= place < e.offset + e.size]
        if place < known.end:
            assert broken == inside
            assert found is not None
            assert bool(inside) == seal.is_whole(path, found)
        else:
            assert found is None or broken or not seal.is_whole(path, found)


@pytest.mark.parametrize("place", [0, 9, 40, 700, 2000, 4000])
def test_a_file_whose_structure_has_changed_is_not_read(whole: Path, tmp_path: Path, place: int) -> None:
    path = flipped(whole, tmp_path / "s.h5", place)
    for reader in READERS:
        with pytest.raises(StoreError, match=r"damaged|no HDF5") as caught:
            reader(path)
        assert one_line(caught.value)
    assert store.check(path)


def test_a_seal_says_of_every_byte_which_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes between what it ends and itself, arrays that overlap, and more besides them than is looked at."""
    path, body = tmp_path / "x", bytes(range(200))

    def extents(*places: tuple[int, int]) -> tuple[seal.Extent, ...]:
        return tuple(seal.Extent(name="x", offset=i, size=size, sha256="") for i, size in places)

    def found(of: tuple[seal.Extent, ...], more: bytes = b"", end: int = 200) -> seal.Seal | None:
        path.write_bytes(body + more + seal.encoded(seal.Seal(end=end, extents=of, rest="")))
        return seal.find(path)

    assert found(extents((0, 100), (100, 100))) is not None
    assert found(extents((0, 100)), more=b"?") is None
    assert found((), end=199) is None
    assert found(extents((0, 100), (150, 51))) is None
    assert found(extents((0, 100), (99, 20))) is None
    assert found(extents((0, 100), (120, -20))) is None
    path.write_bytes(seal.sealed(body))
    assert (known := seal.find(path)) is not None
    for most, right in ((200, True), (199, False)):
        monkeypatch.setattr(seal, "LARGEST_REST", most)
        assert seal.is_whole(path, known) is right


def test_a_changed_number_is_named_and_not_read(whole: Path, tmp_path: Path) -> None:
    known = seal.find(whole)
    assert known is not None
    for extent in known.extents:
        path = flipped(whole, tmp_path / "s.h5", extent.offset + extent.size // 2)
        assert extent.name in {finding.place for finding in store.check(path)}
        if extent.name.endswith(("q/value", "p/value", "energy/value", "/time")):
            with pytest.raises(StoreError, match="damaged"):
                store.read(path)


def test_a_store_is_named_once_in_a_finding(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = flipped(whole, tmp_path / "s.h5", 100)
    assert main(["check", str(path)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert any("it is damaged" in line for line in lines)
    assert all(line.count("s.h5") == 1 for line in lines)


def test_of_a_store_too_long_to_check_a_command_is_told_so(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = seal.find(whole)
    assert known is not None
    path = flipped(whole, tmp_path / "s.h5", known.extents[0].offset)
    monkeypatch.setattr(checking, "LONGEST_CHECK", known.end - 1)
    (found,) = store.doubts(path)
    assert found.place == "/observables"
    assert "not checked" in found.what
    monkeypatch.setattr(checking, "LONGEST_CHECK", known.end)
    (found,) = store.doubts(path)
    assert found.place == known.extents[0].name


@pytest.mark.parametrize("share", [0.0, 0.0005, 0.1, 0.5, 0.97, 0.9999])
def test_a_file_that_is_cut_off_is_told(whole: Path, tmp_path: Path, share: float) -> None:
    path = tmp_path / "s.h5"
    path.write_bytes(whole.read_bytes()[: int(share * whole.stat().st_size)])
    if share < 0.9:
        for reader in READERS:
            with pytest.raises(StoreError, match=r"cut off|no HDF5|damaged") as caught:
                reader(path)
            assert one_line(caught.value)
    assert any("cut off" in finding.what or "no HDF5" in finding.what for finding in store.check(path))


def _said(reader: Callable[[Path], object], path: Path) -> StoreError:
    """What a reader says that need not mind the damage; nothing where it does not."""
    try:
        reader(path)
    except StoreError as error:
        return error
    return StoreError("")


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


BASE = f"/observables/{LABELS[0]}"
CHANGES = [
    (_without(f"{BASE}/p/value"), f"{BASE}/p/value"),
    (_without(f"{BASE}/q/time"), f"{BASE}/q/time"),
    (_without(f"{BASE}/energy"), f"{BASE}/energy/value"),
    (_without(BASE), f"{BASE}/q/value"),
    (_without(f"/parameters/{LABELS[0]}"), f"/parameters/{LABELS[0]}"),
    (_without(f"/particles/{LABELS[0]}/position"), f"/particles/{LABELS[0]}/position/value"),
    (_without(f"/particles/{LABELS[0]}/box"), f"/particles/{LABELS[0]}/box"),
    (_without("/h5md"), "/h5md"),
    (_with(f"{BASE}/q/value", "words"), f"{BASE}/q/value"),
    (_with(f"{BASE}/q/value", np.zeros((3, 3))), f"{BASE}/q/value"),
    (_with(f"{BASE}/p/value", np.zeros((51, 3), dtype="S3")), f"{BASE}/p/value"),
    (_with("/precision/x/h", [1.0, 2.5]), "/precision/x"),
    (_attribute(f"/parameters/{LABELS[0]}", "frames", "many"), f"/parameters/{LABELS[0]}"),
    (_attribute(f"/parameters/{LABELS[0]}", "sha256", "0"), f"/parameters/{LABELS[0]}"),
]


@pytest.mark.usefixtures("tried_here")
@pytest.mark.parametrize(("change", "place"), CHANGES)
def test_what_is_missing_or_of_the_wrong_kind_is_named(
    whole: Path, tmp_path: Path, change: Callable[[Any], None], place: str
) -> None:
    path = tmp_path / "s.h5"
    shutil.copy(whole, path)
    with h5py.File(path, "r+") as file:
        change(file)
    found = store.check(path)
    assert "no seal" in found[0].what
    assert place in {finding.place for finding in found}
    for reader in READERS:
        assert one_line(_said(reader, path))


def test_what_is_no_store_is_told(tmp_path: Path) -> None:
    plain = tmp_path / "plain.h5"
    with h5py.File(plain, "w") as file:
        file["x"] = 1
    (tmp_path / "text.h5").write_text("no HDF5 at all" * 100)
    (tmp_path / "empty.h5").touch()
    for name, said in {
        "plain.h5": "no store of springcheck",
        "text.h5": "no HDF5 file",
        "empty.h5": "no HDF5 file",
        "none.h5": "no such file",
        ".": "it is a folder",
    }.items():
        for reader in (store.read, store.summary, store.scene_text, store.verdicts):
            with pytest.raises(StoreError, match=said):
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
        for reader in (store.read, store.summary, hdf5.read_hdf5):
            with pytest.raises(StoreError, match="another program is writing it"):
                reader(tmp_path / "s.h5")
        writer.communicate()


def test_a_reader_that_crashes_or_never_ends_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "s.h5"
    path.touch()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    # what never ends is waited for six times as long
    for body, limit, said in (
        ("import os; os.kill(os.getpid(), 11)", 8.0, "crashes"),
        ("import time; time.sleep(60)", 0.05, "does not end"),
    ):
        monkeypatch.setattr(apart, "LIMIT", limit)
        (tmp_path / "broken.py").write_text(body)
        path.write_text(body)
        how, whole = trust.tried(path, "broken")
        assert (said in how, whole) == (True, False)


def h5md(path: Path, **changed: Any) -> Path:
    """A file as a student, LAMMPS or GROMACS writes it."""
    given: dict[str, Any] = {
        "position": np.arange(60.0, dtype="f4").reshape(5, 4, 3),
        "velocity": np.arange(60.0, dtype="f4").reshape(5, 4, 3) / 7,
        "step": 2 * np.arange(5),
        "velocity_step": None,
        "time": 0.2 * np.arange(5),
        "mass": np.array([3.7, 0.4, 1.9, 2.2]),
        "unit": "nm",
        **changed,
    }
    with h5py.File(path, "w", libver="earliest") as file:
        group = file.create_group("particles/all")
        for name in ("position", "velocity"):
            if given[name] is None:
                continue
            element = group.create_group(name)
            element.create_dataset("value", data=given[name], chunks=True, compression="gzip")
            if given["unit"]:
                element["value"].attrs["unit"] = given["unit"]
            own = given["velocity_step"] if name == "velocity" else None
            steps = given["step"] if own is None else own
            element["step"] = steps
            if given["time"] is not None:
                element["time"] = 0.1 * np.asarray(steps) if own is not None else given["time"]
        if given["mass"] is not None:
            group["mass"] = given["mass"]
    return path


def test_a_foreign_trajectory_is_read_with_its_precision(tmp_path: Path) -> None:
    found = hdf5.read_hdf5(h5md(tmp_path / "a.h5"))["all"]
    assert np.array_equal(found.q, np.arange(60.0).reshape(5, 12))
    assert np.array_equal(found.t, 0.2 * np.arange(5))
    assert found.units == {"q": "nm", "v": "nm"}
    assert found.roundoff == 2.0**-24
    assert found.mass is not None
    assert found.mass.tolist() == [3.7, 0.4, 1.9, 2.2]


def test_a_fixed_interval_and_velocities_at_fewer_steps_are_understood(tmp_path: Path) -> None:
    found = hdf5.read_hdf5(h5md(tmp_path / "a.h5", time=np.float64(0.25), mass=None))["all"]
    assert found.t.tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert found.mass is None
    fewer = np.arange(36.0).reshape(3, 4, 3)
    path = h5md(tmp_path / "b.h5", velocity=fewer, velocity_step=np.array([0, 4, 8]))
    found = hdf5.read_hdf5(path)["all"]
    assert np.array_equal(found.q, np.arange(60.0).reshape(5, 12)[::2])
    assert np.array_equal(found.v, fewer.reshape(3, 12))


@pytest.mark.usefixtures("tried_here")
def test_positions_wrapped_into_a_box_are_refused(tmp_path: Path) -> None:
    """Images that are all 0 wrap nothing."""
    path = h5md(tmp_path / "a.h5", position=np.random.default_rng(4).random((5, 4, 3)))
    with h5py.File(path, "r+") as file:
        file["particles/all/image/value"] = np.zeros((5, 4, 3), int)
    assert np.all(hdf5.read_hdf5(path)["all"].q < 1)
    with h5py.File(path, "r+") as file:
        file["particles/all/image/value"][3, 2, 1] = -1
    with pytest.raises(StoreError, match="wrapped into a box"):
        hdf5.read_hdf5(path)


@pytest.mark.usefixtures("tried_here")
def test_particles_that_change_places_are_told_by_their_ids(tmp_path: Path) -> None:
    """Places alone were read: a frame written in another order was another motion."""
    rng = np.random.default_rng(5)
    q, v = rng.random((2, 5, 4, 3))
    places = np.stack([rng.permutation(4) for _ in range(5)])
    shuffled = [np.take_along_axis(x, places[:, :, None], axis=1) for x in (q, v)]
    path = h5md(tmp_path / "a.h5", position=shuffled[0], velocity=shuffled[1])
    with h5py.File(path, "r+") as file:
        file["particles/all/id/value"] = 7 + 3 * places
    found = hdf5.read_hdf5(path)["all"]
    assert np.array_equal(found.q, q[:, places[0]].reshape(5, 12))
    assert np.array_equal(found.v, v[:, places[0]].reshape(5, 12))
    with h5py.File(path, "r+") as file:
        file["particles/all/id/value"][2, 1] = 99
    with pytest.raises(StoreError, match="not the same in all frames"):
        hdf5.read_hdf5(path)
    with h5py.File(path, "r+") as file:
        del file["particles/all/id/value"]
        file["particles/all/id/value"] = places[:3]
    with pytest.raises(StoreError, match="has 5 positions, and id is"):
        hdf5.read_hdf5(path)


@pytest.mark.usefixtures("tried_here")
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"velocity": np.zeros((4, 4, 3)), "velocity_step": np.array([0, 2, 2, 4])}, "steps of all repeat"),
        ({"position": None}, "position"),
        ({"velocity": None}, "velocities"),
        ({"time": None}, "has no time"),
        ({"time": np.arange(4.0)}, "frames of .*: 5, and time has shape"),
        ({"mass": np.ones(3)}, "mass of"),
        ({"position": np.zeros((5, 4)), "velocity": np.zeros((5, 4))}, "are not .frames"),
        ({"velocity": np.zeros((5, 4, 3), "S4")}, "no array of numbers"),
        ({"velocity": np.zeros((2, 4, 3)), "velocity_step": np.array([1, 3])}, "same step"),
    ],
)
def test_a_foreign_file_that_lacks_something_is_told_what(
    tmp_path: Path, changed: dict[str, Any], said: str
) -> None:
    path = h5md(tmp_path / "a.h5", **changed)
    with pytest.raises(StoreError, match=said) as caught:
        file.states_in(path)
    assert one_line(caught.value)
