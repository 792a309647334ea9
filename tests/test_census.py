"""The census names what an engine runs by its states, and says when that is not what it is declared as."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import census as by_hand
from springcheck import engines, simulate
from springcheck.cli import main
from springcheck.physics.scenefile import load_scene
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.census import measure as census
from springcheck.studies.census.result import Entry
from springcheck.studies.team import Processes

OWN = ("own:euler", "own:semi-implicit-euler", "own:implicit-euler")


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    yield
    engines.registry._brought.clear()


def test_each_method_is_named_by_its_states(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["census", *(x for label in OWN for x in ("--method", label)), "-o", "c.h5"]
    assert main([*arguments, "--json"]) == 0
    found = {x["method"]: x for x in json.loads(capsys.readouterr().out)["entries"]}
    assert [found[label]["found"] for label in OWN] == [
        "explicit-euler", "semi-implicit-euler", "implicit-euler"
    ]  # fmt: skip
    assert [round(found[label]["amplitude"], 3) for label in OWN] == [2.705, 1.02, 0.37]
    scene = load_scene("spring-uneven")
    a = scene.step**2 * scene.system.hessian_diagonal(scene.q)[0] / scene.m[0]
    assert found["own:euler"]["area"] == pytest.approx(float(a), rel=1e-9)
    assert found["own:semi-implicit-euler"]["velocity_offset"] == -0.5
    assert main(["inspect", "c.h5"]) == 0
    assert "own:implicit-euler" in capsys.readouterr().out
    assert main(["plot", "c.h5"]) == 0
    assert Path("figures/c/census.png").stat().st_size > 10_000
    restored = census.stored("c.h5")
    assert [x.method for x in restored.entries] == list(OWN)
    assert np.array_equal(restored.entries[0].q, simulate.run(load_scene("spring"), OWN[0]).q[:, 0])


def test_a_census_by_workers_is_that_of_one_but_for_the_times_which_they_do_not_measure() -> None:
    assert np.isnan(census.entry(engines.parse(OWN[0])).seconds)
    two, one = (census.record(f"{n}.h5", OWN, team=Processes(n)) for n in (2, 1))
    for many, alone in zip(two.entries, one.entries, strict=True):
        assert min(many.seconds, alone.seconds) > 0
        assert np.array_equal(many.q, alone.q)
        # an engine names the compiler once it has needed it
        same = [{**vars_of(x), "version": "", "seconds": 0, "q": None, "p": None} for x in (many, alone)]
        assert repr(same[0]) == repr(same[1])
    assert [x.seconds for x in census.stored("2.h5").entries] == [x.seconds for x in two.entries]


def vars_of(entry: Entry) -> dict[str, object]:
    return {field.name: getattr(entry, field.name) for field in fields(entry)}


def test_an_engine_that_is_not_what_it_is_declared_as_is_found_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (Path(__file__).parent / "plugin-example" / "springcheck_pefrl.py").read_text()
    (tmp_path / "wrong.py").write_text(text.replace('scheme="pefrl"', 'scheme="velocity-verlet"'))
    assert main(["census", "--method", "pefrl:*", "--engine", "wrong.py"]) == 1
    assert "pefrl:pefrl is declared as velocity Verlet" in " ".join(capsys.readouterr().out.split())


def test_what_was_measured_by_hand_is_compared() -> None:
    """A census that names another scheme, amplitude, partner or growth than a loop by hand is told."""
    one = census.entry(engines.parse("own:euler"))
    right = replace(one, method="pymunk:force")
    assert by_hand.differences(census.Census(entries=(one, right), left_out=())) == []
    grown = replace(one, method="mujoco:motor-frame-skip-5", found="force-held-5", area=3.1e-3)
    for wrong, said in (
        (replace(right, found="semi-implicit-euler"), "is semi-implicit-euler, and was explicit-euler"),
        (replace(right, amplitude=2.706), "has the amplitude 2.7060"),
        (replace(right, digest="0"), "is not own:euler bit for bit"),
        (grown, "grows the motion 1.857 times"),
    ):
        (found,) = by_hand.differences(census.Census(entries=(one, wrong), left_out=()))
        assert said in found


def held(n: float) -> Trajectory:
    """States of a force held over n substeps."""
    scene = load_scene("spring-uneven")
    made = simulate.run(scene, "own:euler")
    m, k, h = float(scene.m[0]), float(scene.system.hessian_diagonal(scene.q)[0]), scene.step
    g = (1 + 1 / n) / 2
    step = np.array([[1 - g * h * h * k / m, h / m], [-h * k, 1]])
    z = [np.array([scene.q[0], scene.p[0]])]
    for _ in range(200):
        z.append(step @ z[-1])
    q, p = np.array(z).T
    return replace(made, q=q[:, None], p=p[:, None], energy=None)


@pytest.mark.parametrize(
    ("n", "name"), [(2, "force-held-2"), (7, "force-held-7"), (np.inf, "force-held-rk4")]
)
def test_a_held_force_is_told_from_its_map(n: float, name: str) -> None:
    assert census._held(load_scene("spring-uneven"), held(n)) == name


@pytest.mark.parametrize("n", [1.5, 2.5])
def test_a_held_force_over_no_whole_number_of_substeps_is_none(n: float) -> None:
    assert census._held(load_scene("spring-uneven"), held(n)) == ""


def test_states_of_another_scheme_are_no_held_force() -> None:
    scene = load_scene("spring-uneven")
    for label in ("own:implicit-euler", "own:semi-implicit-euler"):
        found = census._held(scene, simulate.run(scene, label))
        assert found in ("", "force-held-1")
        assert not found
