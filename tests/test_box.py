"""A periodic box: springs act on nearest images, positions are counted on, and no motion changes."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import springcheck
from springcheck import checks, driver
from springcheck.cli import main
from springcheck.errors import MethodError, SceneError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic

Need = Callable[[str], None]
ENGINES = ("openmm:verlet", "openmm:leapfrog", "openmm:verlet@CPU", "lammps:bond", "lammps:external")


def boxed() -> Scene:
    return scenefile.load_scene("periodic-box")


def test_what_is_in_the_box_crosses_its_borders_and_begins_on_both_sides() -> None:
    scene = boxed()
    run = driver.run(scene, "own:velocity-verlet")
    cells = np.floor(run.q / scene.periods)
    assert np.max(np.ptp(cells, axis=0)) >= 3
    # the bond of the pair begins across a border along x and one along y
    assert np.all(cells[0, 0:2] != cells[0, 2:4])
    # and the third mass comes back across both of its own
    assert np.all(np.count_nonzero(np.diff(cells[:, 4:], axis=0), axis=0) >= 2)


@pytest.mark.parametrize("label", ENGINES)
def test_engines_with_images_pass_every_check(label: str, need: Need) -> None:
    need(label)
    scene = boxed()
    verdicts = checks.judge(scene, driver.run(scene, label))
    assert [v.check for v in verdicts if v.passed is False] == []
    assert {"step-defect", "closed-form", "line"} <= {v.check for v in verdicts if v.passed}


def test_an_engine_without_images_is_found_out(monkeypatch: pytest.MonkeyPatch, need: Need) -> None:
    need("openmm:verlet")
    import openmm

    def deaf(self: object, periodic: bool) -> None:
        """As where it was forgotten."""

    monkeypatch.setattr(openmm.HarmonicBondForce, "setUsesPeriodicBoundaryConditions", deaf)
    scene = boxed()
    failed = {v.check for v in checks.judge(scene, driver.run(scene, "openmm:verlet")) if v.passed is False}
    assert {"step-defect", "closed-form"} <= failed


def test_uncounted_borders_are_found_out(monkeypatch: pytest.MonkeyPatch, need: Need) -> None:
    need("lammps:bond")
    from springcheck.engines import lammps

    monkeypatch.setattr(lammps._Run, "_crossed", lambda self: 0.0)
    scene = boxed()
    run = driver.run(scene, "lammps:bond")
    failed = {v.check for v in checks.judge(scene, run) if v.passed is False}
    assert {"step-defect", "closed-form"} <= failed


def test_a_box_changes_no_motion_and_no_verdict_of_one_without() -> None:
    scene = boxed()
    free = replace(scene, box=None)
    with_, without = (driver.run(x, "own:velocity-verlet") for x in (scene, free))
    assert np.array_equal(with_.q, without.q)
    assert scene.digest != free.digest
    wider = {v.check: v.bound for v in checks.judge(scene, with_)}
    assert all(v.bound <= wider[v.check] or v.passed is None for v in checks.judge(free, without))


def test_a_box_is_written_read_and_stored(tmp_path: Path) -> None:
    scene = boxed()
    (tmp_path / "again.toml").write_text(scene.to_toml(), encoding="utf-8")
    assert scenefile.load_scene(tmp_path / "again.toml").digest == scene.digest
    cube = replace(scene, box=6.0)  # type: ignore[arg-type]
    assert cube.box == (6.0, 6.0, 6.0)
    path = tmp_path / "a.h5"
    assert main(["run", "periodic-box", "--method", "own:euler", "-o", str(path), "--quiet"]) == 0
    with h5py.File(path) as file:
        box = file["particles/own:euler/box"]
        assert box["edges"][:].tolist() == [4.1, 3.3, 5.7]
        assert box.attrs["boundary"].tolist() == ["periodic"] * 3
    assert main(["check", str(path)]) == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"box": (1.0, 2.0)}, "a length > 0, or three"),
        ({"box": (1.0, -2.0, 3.0)}, "a length > 0, or three"),
        ({"box": "wide"}, "a length > 0, or three"),
        ({"terms": (Quartic(i=[0], b=[1.3], at=[0.0]),)}, "a quartic has no nearest image"),
    ],
)
def test_boxes_that_make_no_sense_are_refused(change: dict[str, object], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        replace(boxed(), **change)  # type: ignore[arg-type]


def test_a_spring_that_may_reach_half_of_the_box_is_refused_by_engines(need: Need) -> None:
    need("openmm:verlet")
    along_x = 0.8
    for who in ("from the wall to particle 2", "of particles 0 and 1"):
        said = (
            f"the spring {who} may .* half of the box, {along_x / 2:.3g} along x, .* a box of (.*) along x is"
        )
        with pytest.raises(MethodError, match=said) as caught:
            springcheck.simulate(replace(boxed(), box=(along_x, 3.3, 5.7)), "openmm:verlet")
        found = re.search(said, str(caught.value))
        assert found
        along_x = float(found[1])
    enough = replace(boxed(), box=(along_x, 3.3, 5.7))
    assert springcheck.simulate(enough, "openmm:verlet").outcome.status == "complete"
    with pytest.raises(MethodError, match="nothing bounds it with this method and step; own:"):
        springcheck.simulate(boxed(), "openmm:euler")


def test_engines_without_a_box_say_so(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = str(tmp_path / "a.h5")
    assert main(["run", "periodic-box", "--method", "ase:*", "-o", path]) == 2
    assert "ASE is given no periodic box here" in capsys.readouterr().err
    assert main(["run", "periodic-box", "--method", "own:euler", "-o", path]) == 0
    assert "periodic boxes" not in capsys.readouterr().out


def test_the_border_is_named_where_only_steps_across_it_are_off() -> None:
    """A spring that is wrong is wrong within the box too: that has another cause."""
    scene = boxed()
    run = springcheck.simulate(scene, "own:velocity-verlet")
    right = {v.check: v for v in checks.judge(scene, run)}["border"]
    assert right.passed is True
    assert "46 of 200 pairs of frames" in right.why
    stiffer = scene.derived(terms=tuple(term.scaled(1 + 1e-9) for term in scene.terms))
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(stiffer, "own:velocity-verlet"))}
    assert found["step-defect"].passed is False
    assert found["border"].passed is None
    assert "another cause" in found["border"].why
    period = scene.periods[0]
    late = int(np.flatnonzero(np.diff(np.floor(run.q[:, 0] / period)))[0]) + 1
    q = run.q.copy()
    q[late, 0] -= period * np.sign(q[late, 0] - q[late - 1, 0])
    found = {v.check: v for v in checks.judge(scene, replace(run, q=q))}
    assert found["border"].passed is False
    assert f"at step {late}" in found["border"].why


def test_a_spring_as_long_as_half_of_the_box_is_refused_and_told() -> None:
    """It passed for the motion without the box, where programs pull towards the nearer image."""
    scene = boxed()
    with pytest.raises(SceneError, match=r"at the start a spring is 1\.33 times as long as half of"):
        replace(scene, box=(4.1, 0.45, 5.7))
    short = replace(scene, box=(4.1, 0.9, 5.7))
    found = {v.check: v for v in checks.judge(short, driver.run(short, "own:velocity-verlet"))}
    assert found["border"].passed is False
    assert "a spring is as long as half of the box, and another image" in found["border"].why
