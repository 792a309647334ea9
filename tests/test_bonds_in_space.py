"""Files that GROMACS, LAMMPS and MuJoCo have written of a bond along no axis: named, and judged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bonds_in_space
import springcheck
from springcheck.cli import main
from springcheck.physics import scenefile


@pytest.mark.campaign
@pytest.mark.parametrize("name", bonds_in_space.CASES)
def test_a_file_of_a_bond_along_no_axis_is_named_and_judged(name: str) -> None:
    scheme = bonds_in_space.CASES[name]
    found = bonds_in_space.named(name)
    # of forces in single precision nothing may be named
    assert found["scheme"] == scheme or ("single" in name and found["scheme"] is None)
    if "single" not in name:
        assert np.ravel(found["omega"]) == pytest.approx(np.sqrt(2.9 * (1 / 3.7 + 1 / 1.3)), rel=1e-9)
    assert bonds_in_space.judged(name, scheme)["status"] == 0
    other = "velocity-verlet" if scheme == "semi-implicit-euler" else "semi-implicit-euler"
    failed = {v["check"] for v in bonds_in_space.judged(name, other)["verdicts"] if v["passed"] is False}
    assert "step-defect" in failed


def test_a_pair_that_rests_as_a_whole_is_named(tmp_path: Path) -> None:
    scene = replace(scenefile.load_scene(bonds_in_space.scene_of("rest")), steps=60)
    run = springcheck.simulate(scene, "own:velocity-verlet")
    q, v = (x.reshape(-1, 2, 3) for x in (run.q, run.p / scene.m))
    np.savez(tmp_path / "a.npz", t=run.t, q=q, v=v, m=scene.masses)
    assert bonds_in_space.told("identify", str(tmp_path / "a.npz"))["scheme"] == "velocity-verlet"


def test_one_particle_that_swings_along_a_diagonal_is_no_pair(tmp_path: Path) -> None:
    t = 0.1 * np.arange(60)
    q = np.outer(np.cos(t), [0.3, -0.3, 0.0])
    v = np.outer(-np.sin(t), [0.3, -0.3, 0.0])
    np.savez(tmp_path / "a.npz", t=t, q=q, v=v, m=np.array([3.7]))
    found = bonds_in_space.told("identify", str(tmp_path / "a.npz"))
    # a pair of that mass would have half of it in its bond
    assert found["stiffness"] == pytest.approx([3.7, 3.7])
    assert not any("their bond" in note for note in found["notes"])


def test_a_single_precision_force_of_another_size_is_rejected_of_a_file_by_gromacs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (bonds_in_space.FOLDER / "rest.toml").read_text().replace("stiffness = 2.9", "stiffness = 2.91")
    (tmp_path / "stiff.toml").write_text(text)
    for name in ("gromacs-single-md-rest.trr", "gromacs-md-rest.trr"):
        given = ["judge", str(bonds_in_space.FOLDER / name), "--scene", str(tmp_path / "stiff.toml")]
        assert main([*given, "--scheme", "semi-implicit-euler"]) == 1
        assert "step-defect" in capsys.readouterr().out


@pytest.mark.parametrize("cut", ["ITEM: TIME\n0.1\n", "ITEM: UNITS\nlj\n", "ITEM: TIME\n0\n"])
def test_times_in_a_dump_of_lammps_are_read_where_every_frame_has_one(
    cut: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (bonds_in_space.FOLDER / "lammps-drift.dump").read_text()
    assert cut in text
    (tmp_path / "a.dump").write_text(text.replace(cut, "", 1))
    # a frame without its time: the step is asked for, and the units are no matter
    units = "UNITS" in cut
    assert main(["identify", str(tmp_path / "a.dump")]) == (0 if units else 2)
    said = capsys.readouterr()
    assert ("velocity-verlet" in said.out) if units else ("give its time step, as --step H" in said.err)
    assert main(["identify", str(tmp_path / "a.dump"), "--step", "0.1"]) == 0
