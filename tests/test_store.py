"""What goes into the store comes out bit for bit, with all that is needed to repeat the run."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import springcheck
from springcheck import store
from springcheck.errors import StoreError
from springcheck.physics.trajectory import Comparison, Timing, Verdict
from springcheck.store import access, draft, layout, reading
from stores import LABELS, assert_same, scene, trajectory, written


def test_trajectories_come_back_bit_for_bit_in_the_order_they_were_started(tmp_path: Path) -> None:
    made = written(tmp_path / "s.h5", scene())
    found = store.read(tmp_path / "s.h5")
    assert list(found) == LABELS
    for label, one in made.items():
        assert_same(one, found[label])
    assert store.check(tmp_path / "s.h5") == []


def test_an_unfinished_store_is_read_from_its_journal(tmp_path: Path) -> None:
    s = scene()
    with store.open_new(tmp_path / "s.h5", "run") as journal:
        journal.save(trajectory(s, "own:euler"), s)
    assert_same(trajectory(s, "own:euler"), store.read(tmp_path / "s.h5")["own:euler"])
    assert store.scene_text(tmp_path / "s.h5") == s.to_toml()
    assert not store.summary(tmp_path / "s.h5").complete


def test_a_run_that_stopped_early_is_stored_at_its_length(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(draft, "BUFFER", 128)
    s = scene(steps=4000)
    for frames in (1, 5, 6, 1999):
        one = trajectory(s, f"own:{frames}", frames, frames)
        with store.open_new(tmp_path / f"{frames}.h5", "run") as journal:
            journal.save(one, s)
            journal.commit(s)
        assert_same(one, store.read(tmp_path / f"{frames}.h5")[one.label])
        assert store.check(tmp_path / f"{frames}.h5") == []


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cuts=st.lists(st.integers(1, 400), max_size=6), buffer=st.sampled_from([24, 1000, 9600, 1 << 22]))
def test_the_digest_and_the_bytes_do_not_depend_on_how_the_frames_arrive(
    tmp_path_factory: pytest.TempPathFactory, cuts: list[int], buffer: int
) -> None:
    s = scene(steps=800)
    one = trajectory(s, "own:euler")
    edges = sorted({0, s.frames, *(cut for cut in cuts if cut < s.frames)})
    path = tmp_path_factory.mktemp("cut") / "s.h5"
    with pytest.MonkeyPatch.context() as patch, store.open_new(path, "run") as journal:
        patch.setattr(draft, "BUFFER", buffer)
        with journal.draft("own:euler", s) as made:
            for a, b in pairwise(edges):
                made.append(one.t[a:b], one.q[a:b], one.p[a:b], one.energy[a:b])
            digest = made.finish(store.attributes(one))
        journal.commit(s)
    assert_same(one, store.read(path)["own:euler"])
    lines = [
        f"{name} {values.shape} {hashlib.sha256(values.tobytes()).hexdigest()}"
        for name, values in (("time", one.t), ("q", one.q), ("p", one.p), ("energy", one.energy))
    ]
    assert digest == hashlib.sha256("\n".join(lines).encode()).hexdigest()


def test_two_runs_have_the_same_digest_exactly_when_their_numbers_agree(tmp_path: Path) -> None:
    s = scene()
    one = trajectory(s, "own:euler")
    q = one.q.copy()
    q[7, 1] = np.nextafter(q[7, 1], np.inf)
    other = replace(one, timing=Timing(start=9, run=9), origin={"host": "another"})
    with store.open_new(tmp_path / "s.h5", "run") as journal:
        first = journal.save(one, s)
        assert journal.save(replace(other, label="b"), s) == first
        assert journal.save(replace(other, label="c", q=q), s) != first


@pytest.mark.parametrize("kept", [("q", "p"), ("q", "p", "energy")])
def test_only_what_the_scene_asks_for_is_stored(tmp_path: Path, kept: tuple[str, ...]) -> None:
    s = scene(quantities=kept)
    written(tmp_path / "s.h5", s)
    with h5py.File(tmp_path / "s.h5") as file:
        names = set(file["observables/own:euler"]) - {"velocity"}
        assert names == set(kept)
        elements = set(file["particles/own:euler"]) if "particles" in file else set()
        assert elements & {"position", "velocity"} == {"position", "velocity"}
    found = store.read(tmp_path / "s.h5")["own:euler"]
    assert found.q.shape == (s.frames, 3)
    assert (found.energy is None) == ("energy" not in kept)
    assert store.check(tmp_path / "s.h5") == []


def test_charges_are_no_positions(tmp_path: Path) -> None:
    written(tmp_path / "s.h5", scene(kind="circuit", units="si"))
    with h5py.File(tmp_path / "s.h5") as file:
        assert "particles" not in file
        assert file["observables/own:euler/q/value"].attrs["unit"] == "C"


def test_positions_and_velocities_cost_no_bytes_and_have_the_right_units(tmp_path: Path) -> None:
    s = scene(steps=20_000)
    made = written(tmp_path / "s.h5", s, ["own:euler"])["own:euler"]
    with h5py.File(tmp_path / "s.h5") as file:
        group = file["particles/own:euler"]
        x = group["position/value"][()]
        v = group["velocity/value"][()]
        assert np.array_equal(x[..., 0], made.q)
        assert np.array_equal(v[..., 0], made.p / s.m)
        assert not x[..., 1:].any()
        assert not v[..., 1:].any()
        units = [group[name].attrs["unit"] for name in ("position/value", "velocity/value", "mass")]
        assert [*units, group["position/time"].attrs["unit"]] == ["nm", "nm ps-1", "u", "ps"]
        assert np.array_equal(group["position/step"], 2 * np.arange(s.frames))
        assert group["position/time"] == file["observables/own:euler/p/time"]
    arrays = s.frames * (8 * (1 + 3 * s.n + 1) + 4)
    assert (tmp_path / "s.h5").stat().st_size < arrays + 50_000


def test_a_reduced_scene_has_no_units_but_for_readers_of_h5md(tmp_path: Path) -> None:
    made = written(tmp_path / "s.h5", scene(units="reduced"))["own:euler"]
    with h5py.File(tmp_path / "s.h5") as file:
        base, group = file["observables/own:euler"], file["particles/own:euler"]
        assert base.attrs["units_are"].startswith("reduced")
        assert [base[name].attrs["unit"] for name in ("p/value", "q/time", "energy/value")] == ["1"] * 3
        # which ask for one
        assert [group[name].attrs["unit"] for name in ("position/value", "position/time")] == ["nm", "ps"]
        assert np.array_equal(group["position/time"][()], made.t)


def test_the_exact_solution_and_the_errors_are_in_the_file(tmp_path: Path) -> None:
    found = springcheck.run("spring-uneven", ["own:euler", "own:rk4"], path=tmp_path / "s.h5")
    with h5py.File(tmp_path / "s.h5") as file:
        base, exact = file["observables/own:euler"], file["observables/exact"]
        t, q, error = base["error/time"][()], base["q/value"][()], base["error/value"][()]
        known = springcheck.load_scene("spring-uneven")
        distance = np.asarray(known.system.norm(q - exact["q/value"], base["p/value"][()] - exact["p/value"]))
        assert np.array_equal(t, exact["q/time"][()])
        np.testing.assert_allclose(error, distance.astype(float), rtol=1e-9, atol=1e-15)
        largest = file["comparison/max_difference"][0, 1]
        assert file["comparison/labels"].asstr()[1] == "own:euler"
        assert np.max(error) == largest > 0
        assert exact["q/value"].attrs["unit"] == base["q/value"].attrs["unit"]
    assert list(store.read(tmp_path / "s.h5")) == ["own:euler", "own:rk4"]
    assert found is not None


def test_times_are_scales_and_species_are_there(tmp_path: Path) -> None:
    s = scene()
    written(tmp_path / "s.h5", s)
    with h5py.File(tmp_path / "s.h5") as file:
        for name in (
            "observables/own:euler/p",
            "particles/own:euler/position",
            "particles/own:euler/species",
        ):
            element = file[name]
            assert element["value"].dims[0]["time"] == element["time"]
        assert element["value"].shape == (s.frames, s.n)
        assert not element["value"][()].any()
        assert element["value"].id.get_storage_size() == 0


def test_digests_are_a_dataset_and_no_large_attribute(tmp_path: Path) -> None:
    written(tmp_path / "s.h5", scene())
    with h5py.File(tmp_path / "s.h5") as file:
        listed = dict(zip(file["digests/path"].asstr()[()], file["digests/sha256"].asstr()[()], strict=True))
        assert all(len(one) == 64 for one in listed.values())
        assert {"/", "/h5md", "/observables/own:euler/q/value", "/parameters/own:euler"} <= set(listed)
        assert all(len(str(value)) < 4000 for value in file.attrs.values())


def test_the_root_says_what_every_group_is(tmp_path: Path) -> None:
    written(tmp_path / "s.h5", scene(), ["own:euler"])
    with h5py.File(tmp_path / "s.h5") as file:
        about = file.attrs["about"]
        assert all(f"{name}:" in about for name in file if name != "h5md")


def test_a_file_alone_tells_what_was_run_by_what_on_which_machine(tmp_path: Path) -> None:
    s = scene()
    written(tmp_path / "s.h5", s)
    known = store.summary(tmp_path / "s.h5").runs[1].parameters
    assert known["scene"] == s.to_toml()
    assert known["method"] == "openmm:verlet@OpenCL-mixed"
    assert known["origin.openmm"] == "8.6.1"
    assert known["outcome"] == "diverged"
    assert known["step"] == -0.25
    for name in ("processor", "cores", "system", "python", "numpy", "springcheck", "sha256", "finished"):
        assert known[name], name


def test_an_existing_file_is_never_touched_unless_forced(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    path.write_bytes(b"precious")
    # nothing is said of --force, which replaces none either
    for force in (False, True):
        with pytest.raises(StoreError, match=r"no store of springcheck, and is not replaced; -o writes"):
            store.open_new(path, "run", force=force)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"precious"
    path.unlink()
    s = scene()
    written(path, s)
    before = path.read_bytes()
    with pytest.raises(StoreError, match="exists: --force writes it anew"):
        store.open_new(path, "run")
    with store.open_new(path, "run", force=True) as journal:
        journal.save(trajectory(s, "own:euler"), s)
        assert path.read_bytes() == before
        journal.commit(s)
    assert list(store.read(path)) == ["own:euler"]


@pytest.mark.parametrize("label", ["", "a/b", ".", "..", "a\0b"])
def test_a_label_that_cannot_name_a_group_is_refused(tmp_path: Path, label: str) -> None:
    with store.open_new(tmp_path / "s.h5", "run") as journal, pytest.raises(StoreError, match="cannot name"):
        journal.draft(label, scene())


def test_frames_of_the_wrong_shape_or_number_are_refused(tmp_path: Path) -> None:
    s = scene()
    one = trajectory(s, "own:euler")
    with store.open_new(tmp_path / "s.h5", "run") as journal, journal.draft("own:euler", s) as made:
        with pytest.raises(ValueError, match="shape"):
            made.append(one.t, one.q[:, :2], one.p, one.energy)
        with pytest.raises(ValueError, match="shape None"):
            made.append(one.t, one.q, one.p)
        with pytest.raises(ValueError, match="without frames"):
            made.finish({})
        made.append(one.t, one.q, one.p, one.energy)
        with pytest.raises(ValueError, match="more frames than"):
            made.append(one.t[:1], one.q[:1], one.p[:1], one.energy[:1])


def test_windows_overlap_by_one_frame_and_make_up_the_whole(tmp_path: Path) -> None:
    s = scene(steps=222)
    made = written(tmp_path / "s.h5", s)["sundials:adams"]
    for rows in (1, 7, 110, 111, 112, 5000):
        pieces = list(store.windows(tmp_path / "s.h5", "sundials:adams", rows))
        assert all(len(piece.t) <= rows + 1 for piece in pieces)
        assert all(np.array_equal(a.q[-1], b.q[0]) for a, b in pairwise(pieces))
        joined = np.concatenate([pieces[0].p, *(piece.p[1:] for piece in pieces[1:])])
        assert np.array_equal(joined, made.p)


def test_a_strided_reading_takes_every_nth_frame_from_the_start(tmp_path: Path) -> None:
    s = scene(steps=2000)
    made = written(tmp_path / "s.h5", s)["own:euler"]
    for most in (1, 10, 999, 1001, 5000):
        found, stride = store.strided(tmp_path / "s.h5", "own:euler", most)
        assert len(found.t) <= most
        assert np.array_equal(found.q, made.q[::stride])
        assert np.array_equal(found.energy, made.energy[::stride])
        assert found.every == made.every * stride


def test_long_arrays_are_mapped_and_equal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "MAPPED", 100)
    made = written(tmp_path / "s.h5", scene())
    found = store.read(tmp_path / "s.h5")
    assert isinstance(found["own:euler"].q, np.memmap)
    for label, one in made.items():
        assert_same(one, found[label])


def test_verdicts_comparison_tables_and_documents_come_back(tmp_path: Path) -> None:
    verdicts = tuple(
        Verdict(
            method="own:euler",
            check=f"c{passed}",
            value=1e-16,
            bound=np.inf,
            unit="nm",
            passed=passed,
            why="¼",
        )
        for passed in (True, False, None)
    )
    comparison = Comparison(labels=("a", "exact"), max_difference=2.5 - 2.5 * np.eye(2))
    table = store.Table(
        name="precision/own:euler",
        columns={"h": [0.1, 0.2], "error": np.eye(2), "n": np.array([1, 2]), "ok": np.array([True, False]),
                 "note": ["", "ä"]},
        units={"h": "ps"}, attributes={"order": 1.02, "by": "slope"}, signal="error", axes=("h", "."),
    )  # fmt: skip
    s = scene()
    with store.open_new(tmp_path / "s.h5", "run") as journal:
        journal.add(table)
        assert list(journal.tables()) == ["precision/own:euler"]
        journal.save(trajectory(s, "own:euler"), s)
        journal.commit(s, comparison=comparison, verdicts=verdicts, documents={"report": "all\nwell"})
    path = tmp_path / "s.h5"
    assert store.verdicts(path) == verdicts
    found = store.comparison(path)
    assert found is not None
    assert found.labels == comparison.labels
    assert np.array_equal(found.max_difference, comparison.max_difference)
    assert store.document(path, "report") == "all\nwell"
    back = store.tables_of(path)["precision/own:euler"]
    for name, column in table.columns.items():
        assert np.array_equal(back.columns[name], np.asarray(column)), name
    assert (back.units, back.attributes, back.signal, back.axes) == (
        table.units, table.attributes, table.signal, table.axes,
    )  # fmt: skip
    assert store.summary(path).tables == ("precision/own:euler",)
    assert store.check(path) == []


def test_a_store_of_studies_alone_needs_no_trajectory(tmp_path: Path) -> None:
    with store.open_new(tmp_path / "s.h5", "stability") as journal:
        journal.add(store.Table(name="stability/own:euler", columns={"a": [1.0]}, signal="a"))
        journal.commit()
    assert store.read(tmp_path / "s.h5") == {}
    assert store.verdicts(tmp_path / "s.h5") == ()
    assert store.comparison(tmp_path / "s.h5") is None
    assert store.check(tmp_path / "s.h5") == []


def test_tables_without_rows_are_stored(tmp_path: Path) -> None:
    """Pairs and vectors of a result that has none are columns of shape (0, 2)."""
    path = tmp_path / "s.h5"
    columns = {"number": np.empty(0), "pair": np.empty((0, 2))}
    with store.open_new(path, "nothing") as journal:
        journal.add(store.Table(name="of/none", columns=columns))
        journal.commit()
    assert store.check(path) == []
    for table in store.tables_of(path).values():
        assert {name: np.shape(x) for name, x in table.columns.items()} == {"number": (0,), "pair": (0, 2)}


def test_a_recording_that_would_not_fit_is_told_before_it_starts(tmp_path: Path) -> None:
    s = scene(steps=10**13, every=1)
    with pytest.raises(StoreError, match=r"960 TB are needed, and .* are free in"):
        store.need_space(tmp_path / "s.h5", store.size(s))
    free = shutil.disk_usage(tmp_path).free
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=free))
        store.need_space(tmp_path / "s.h5", free)
        with pytest.raises(StoreError, match="are free in"):
            store.need_space(tmp_path / "s.h5", free + 1)


def test_importing_the_store_imports_no_engine_and_no_plots() -> None:
    code = (
        "import sys, springcheck.store; "
        "print([m for m in ('matplotlib', 'openmm', 'ase', 'sksundae', 'numba', 'rich') if m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"


def test_attributes_are_written_with_the_types_that_h5py_gives_them() -> None:
    values = {
        "text": "ångström", "texts": ["a", "bé"], "none": "", "flag": True, "count": 3, "x": 0.1,
        "numbers": np.array([1, 1], np.int32),
    }  # fmt: skip
    with h5py.File("a", "w", driver="core", backing_store=False) as file:
        ours, theirs = file.create_group("ours"), file.create_group("theirs")
        layout.write_attributes(ours, dict.fromkeys(values, "before"))
        layout.write_attributes(ours, values)
        for name, value in values.items():
            text = h5py.string_dtype("utf-8") if isinstance(value, str | list) else None
            theirs.attrs.create(name, value, dtype=text)
            mine, other = ours.attrs.get_id(name), theirs.attrs.get_id(name)
            assert (mine.get_type().encode(), mine.shape) == (other.get_type().encode(), other.shape)
            assert mine.get_space().get_simple_extent_type() == other.get_space().get_simple_extent_type()
        assert access.attributes(ours) == access.attributes(theirs)
        assert list(ours.attrs["texts"]) == values["texts"]
