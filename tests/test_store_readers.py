"""The field's own readers open our files and find the right numbers, units and default plot."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import h5py
import MDAnalysis
import numpy as np
import pyh5md
import pytest
from silx.io import nxdata
from silx.io import open as silx_open

import springcheck
from springcheck import store
from springcheck.cli.file import judge
from springcheck.errors import StoreError
from springcheck.formats import hdf5
from springcheck.physics.trajectory import Comparison
from stores import LABELS, assert_same, scene, trajectory, written


@pytest.mark.parametrize("label", LABELS)
def test_mdanalysis_opens_an_exported_trajectory_with_its_units_and_times(tmp_path: Path, label: str) -> None:
    s = scene(step=0.25)
    made = written(tmp_path / "s.h5", s)[label]
    store.export(tmp_path / "s.h5", label, tmp_path / "out.h5md")
    universe = MDAnalysis.Universe.empty(s.n, trajectory=False)
    universe.load_new(str(tmp_path / "out.h5md"))
    assert universe.trajectory.n_frames == s.frames
    assert universe.trajectory.units["length"] == "nm"
    assert universe.trajectory.units["time"] == "ps"
    assert universe.trajectory.units["velocity"] == "nm/ps"
    for i, frame in enumerate(universe.trajectory):
        assert frame.time == made.t[i]
        # nm -> Angstrom, in single precision: half a unit in the last place each
        assert np.allclose(frame.positions[:, 0], 10 * made.q[i], rtol=2.0**-23, atol=0)
        assert np.allclose(frame.velocities[:, 0], 10 * made.p[i] / s.m, rtol=2.0**-22, atol=0)
        assert not frame.positions[:, 1:].any()
        assert frame.dimensions is None


def test_an_exported_trajectory_is_a_store_of_its_own_and_is_never_overwritten(tmp_path: Path) -> None:
    """Its energies, its momenta and what its engine declares were left out."""
    s = scene()
    made = written(tmp_path / "s.h5", s)
    out = tmp_path / "out.h5md"
    assert store.export(tmp_path / "s.h5", LABELS[1], out) == []
    with h5py.File(out) as file:
        assert list(file["particles"]) == ["trajectory"]
        assert not file["particles/trajectory/position/value"].is_virtual
    assert store.check(out) == []
    assert_same(store.read(out)[LABELS[1]], made[LABELS[1]])
    assert store.digest(out, LABELS[1]) == store.digest(tmp_path / "s.h5", LABELS[1])
    kept, whole = store.summary(out), store.summary(tmp_path / "s.h5")
    assert kept.complete
    assert [run.parameters for run in kept.runs] == [whole.runs[1].parameters]
    assert store.scene_text(out) == s.to_toml()
    with pytest.raises(StoreError, match="an exported trajectory already"):
        store.export(out, LABELS[1], tmp_path / "again.h5md")
    for label, target, said in (
        (LABELS[1], out, "exists"),
        ("own:none", tmp_path / "a.h5md", "no trajectory 'own:none'"),
        (LABELS[0], tmp_path / "a.h5", "must end in .h5md"),
    ):
        with pytest.raises(StoreError, match=said):
            store.export(tmp_path / "s.h5", label, target)
    written(tmp_path / "circuit.h5", scene(kind="circuit", units="si"))
    with pytest.raises(StoreError, match="no particles"):
        store.export(tmp_path / "circuit.h5", LABELS[0], tmp_path / "a.h5md")


@pytest.mark.parametrize(
    ("name", "label", "scheme"),
    [
        ("chain", "openmm:verlet", "velocity-verlet"),
        ("spring-uneven", "sundials:adams", "adams"),
        ("spring-uneven", "own:rk4", "rk4"),
    ],
)
def test_an_exported_trajectory_is_judged_as_in_its_store(
    tmp_path: Path, name: str, label: str, scheme: str, need: Callable[[str], None]
) -> None:
    """A right engine that rebuilds its velocities, or has a tolerance, failed on it."""
    need(label)
    springcheck.run(name, label, path=tmp_path / "s.h5")
    store.export(tmp_path / "s.h5", label, tmp_path / "out.h5md")
    there, here = (
        judge(path, scene=name, scheme=scheme) for path in (tmp_path / "s.h5", tmp_path / "out.h5md")
    )
    # NaN, the value of a check that does not apply, is not equal to itself
    assert str(here.document()["verdicts"]) == str(there.document()["verdicts"])
    assert here.status == there.status == 0


def test_our_own_reader_takes_an_exported_file_as_anyones(tmp_path: Path) -> None:
    s = scene()
    made = written(tmp_path / "s.h5", s)[LABELS[0]]
    store.export(tmp_path / "s.h5", LABELS[0], tmp_path / "out.h5md")
    found = hdf5.read_hdf5(tmp_path / "out.h5md")["trajectory"]
    assert np.array_equal(found.q[:, ::3], made.q)
    assert np.array_equal(found.v[:, ::3], made.p / s.m)
    assert np.array_equal(found.t, made.t)
    assert found.mass is not None
    assert np.array_equal(found.mass, s.m)
    assert found.units == {"q": "nm", "v": "nm ps-1", "t": "ps", "mass": "u"}
    assert found.roundoff == 2.0**-53


def test_pyh5md_opens_the_whole_store(tmp_path: Path) -> None:
    s = scene()
    made = written(tmp_path / "s.h5", s)
    assert made
    with pyh5md.File(str(tmp_path / "s.h5"), "r") as file:
        for label, one in made.items():
            group = file.particles_group(label)
            position = pyh5md.element(group, "position")
            assert np.array_equal(position.value[()][..., 0], one.q)
            assert np.array_equal(position.time[()], one.t)
            assert np.array_equal(position.step[()], s.every * np.arange(s.frames))
            assert np.array_equal(pyh5md.element(group, "mass").value[()], s.m)
            for name, values in (("q", one.q), ("p", one.p), ("energy", one.energy)):
                element = pyh5md.element(file["observables"][label], name)
                assert np.array_equal(element.value[()], values)


def test_silx_finds_the_default_plot_and_every_observable(tmp_path: Path) -> None:
    s = scene()
    path = tmp_path / "s.h5"
    with store.open_new(path, "run") as journal:
        made = {label: trajectory(s, label, i, s.frames - (i == 2)) for i, label in enumerate(LABELS)}
        for one in made.values():
            journal.save(one, s)
        comparison = Comparison(labels=("a", "b"), max_difference=np.eye(2))
        journal.add(
            store.Table(
                name="precision/x",
                columns={"h": [1.0, 2.0], "e": [3.0, 4.0]},
                signal="e",
                axes=("h",),
                log=("h",),
            )
        )
        journal.commit(s, comparison=comparison)
    with silx_open(str(path)) as file:
        plot = nxdata.get_default(file)
        assert plot.is_valid
        assert plot.is_curve
        assert plot.title == "q of the first particle"
        assert np.array_equal(plot.signal[()], made[LABELS[0]].q[:, 0])
        assert np.array_equal(plot.auxiliary_signals[0][()], made[LABELS[1]].q[:, 0])
        assert len(plot.auxiliary_signals) == 1  # the third run is shorter
        assert np.array_equal(plot.axes[0][()], made[LABELS[0]].t)
        for label, one in made.items():
            for name, values in (("q", one.q), ("p", one.p), ("energy", one.energy)):
                found = nxdata.get_default(file[f"observables/{label}/{name}"])
                assert found.is_valid
                assert np.array_equal(found.signal[()], values)
                assert np.array_equal(found.axes[0][()], one.t)
        assert nxdata.get_default(file["comparison"]).is_image
        table = nxdata.get_default(file["precision/x"])
        assert table.is_curve
        assert table.plot_style.axes_scale_types == ("log",)
        assert table.plot_style.signal_scale_type == "linear"


def test_h5dump_of_hdf5_1_10_reads_all_of_it(tmp_path: Path) -> None:
    if shutil.which("h5dump") is None and not os.environ.get("SPRINGCHECK_REQUIRE_TOOLS"):
        pytest.skip("h5dump is not installed (Debian: hdf5-tools)")
    made = written(tmp_path / "s.h5", scene())
    ran = subprocess.run(["h5dump", str(tmp_path / "s.h5")], capture_output=True, text=True, check=True)
    assert ran.stderr == ""
    for label in LABELS:
        for name, values in (("q", made[label].q), ("energy", made[label].energy)):
            where = f"/observables/{label}/{name}/value"
            command = ["h5dump", "-y", "-m", "%.17g", "-d", where, str(tmp_path / "s.h5")]
            one = subprocess.run(command, capture_output=True, text=True, check=True)
            inside = one.stdout.split("DATA {")[1].split("}")[0]
            found = [float(x) for x in re.findall(r"[-+.\deE]+", inside)]
            assert values is not None
            assert found == values.ravel().tolist()


def test_h5py_alone_gets_t_q_and_p_in_three_lines(tmp_path: Path) -> None:
    one = written(tmp_path / "s.h5", scene())[LABELS[0]]
    with h5py.File(tmp_path / "s.h5") as file:
        run = file["observables/own:euler"]
        t, q, p = run["q/time"][()], run["q/value"][()], run["p/value"][()]
    assert np.array_equal(t, one.t)
    assert np.array_equal(q, one.q)
    assert np.array_equal(p, one.p)
