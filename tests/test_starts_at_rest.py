"""A start without energy: errors are relative to what it may gain, and nothing right is rejected."""

from pathlib import Path

import numpy as np
import pytest

import springcheck
from springcheck import checks
from springcheck.cli import main

PARTICLE = '[[particle]]\nmass = 2.7\nposition = {at}\n\n[[spring]]\nends = ["wall", 0]\nstiffness = 0.3\n'
TIME = "\n[time]\nstep = 0.17\nsteps = 150\n"
DRIVE = "\n[[drive]]\nparticle = 0\namplitude = 0.23\nfrequency = 0.9\n"
SCENES = {
    # the rest 0.15 + 0.25 is that of the doubles, and not that of the quotient k at / k
    "resting": PARTICLE.format(at=0.4) + "rest = 0.25\nwall = 0.15\n",
    "driven": PARTICLE.format(at=0.0) + DRIVE,
    "falling": "[[particle]]\nmass = 2.7\n\n[[weight]]\nparticle = 0\nforce = -3.1\n",
}


@pytest.fixture(params=sorted(SCENES))
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> springcheck.Scene:
    path = tmp_path / f"{request.param}.toml"
    path.write_text('title = "From rest"\n' + SCENES[request.param] + TIME)
    return springcheck.load_scene(path)


def test_a_run_from_rest_is_judged_and_drawn_with_finite_errors(
    scene: springcheck.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    methods = ["own:euler", "own:velocity-verlet", "sundials:bdf"]
    found = springcheck.run(scene, methods, path="run.h5")
    assert not [verdict for verdict in found.verdicts if verdict.passed is False]
    known = [run.max_error for run in found.runs if scene.system.solution]
    assert np.isfinite(known).all()
    assert np.isfinite(found.comparison.max_difference).all()
    assert main(["report", "run.h5"]) == 0
    assert main(["plot", "run.h5"]) == 0


def test_the_error_of_a_driven_spring_from_rest_is_in_units_of_its_static_deflection(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("driven.toml").write_text('title = "From rest"\n' + SCENES["driven"] + TIME)
    scene = springcheck.load_scene("driven.toml")
    # amplitude / stiffness is where the drive would hold it
    assert float(scene.system.norm([0.23 / 0.3], [0.0])) == pytest.approx(1, rel=1e-12)
    run = springcheck.simulate(scene, "sundials:bdf")
    verdicts = {verdict.check: verdict for verdict in checks.judge(scene, run)}
    assert verdicts["tolerance"].passed
    assert main(["run", "driven.toml", "--method", "own:velocity-verlet"]) == 0
    said = capsys.readouterr().out
    assert "over the root of the possible gain" in said
    assert "energy: (H - H exact)/(possible gain) where it is largest" in said
    # a drive moves it: its precision can be studied
    assert springcheck.precision(scene, "own:rk4", budget=1.0)


def test_a_wrong_engine_that_leaves_its_rest_fails() -> None:
    scene = springcheck.spring(k=0.3, m=2.7, q=0.0, p=0.0, step=0.17, steps=50)

    def step(q, p, h, force, mass):  # type: ignore[no-untyped-def]
        return q + 1e-3, p

    run = springcheck.simulate(scene, step, scheme="velocity-verlet")
    assert springcheck.judge(scene, run).failed
    assert np.isfinite(run.error()).all()


def test_differences_of_runs_in_a_bath_from_rest_are_relative_to_the_thermal_energy() -> None:
    found = springcheck.run("bath-uneven", ["own:baoab", "own:obabo"])
    assert 0.1 < found.comparison.max_difference[0, 1] < 100


def test_what_goes_with_files_of_others_is_refused_for_a_store(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.h5"
    springcheck.run("spring", "own:euler", path=path)
    assert main(["plot", str(path), "-o", str(tmp_path), "--step", "0.1"]) == 2
    assert "--step is for files of other programs" in capsys.readouterr().err


CANCELLING = (
    'title = "Over a barrier"\n[[particle]]\nmass = 1.3\nposition = 0.7\nmomentum = 0.91\n\n'
    '[[spring]]\nends = ["wall", 0]\nstiffness = -1.3\nrest = 0.0\n\n[time]\nstep = 0.1\nsteps = 30\n'
)
"""T + V = 0 but for a rounding of 6e-17; T + |V| = 0.637."""


def test_energies_are_relative_to_what_does_not_cancel_at_the_start(
    tmp_path: Path,
) -> None:
    (tmp_path / "barrier.toml").write_text(CANCELLING)
    methods = ["own:velocity-verlet", "own:semi-implicit-euler"]
    scene = springcheck.load_scene(tmp_path / "barrier.toml")
    found = springcheck.run(scene, methods)
    for run, energies in ((run, found[run.method].energy) for run in found.runs):
        off = energies - energies[0]
        assert run.energy_drift == pytest.approx(off[np.argmax(np.abs(off))] / 0.637, rel=1e-9)
    assert "energy: (H - H0)/(initial T + |V|) where it is largest" in str(found)
    axes = springcheck.plot.energy(found[methods[0]])
    assert np.max(np.abs(axes.lines[0].get_ydata())) == pytest.approx(abs(found.runs[0].energy_drift))
    assert axes.get_ylabel() == "(H - H0) / (initial T + |V|)"
