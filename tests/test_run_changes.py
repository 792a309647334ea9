"""`springcheck run` with numbers set anew and engines broken on purpose; what its report says of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from springcheck import driver, store
from springcheck.cli import main
from springcheck.physics import exact, scenefile
from springcheck.physics.arrays import WIDE
from springcheck.studies import keeper
from springcheck.studies.stability.result import fastest
from springcheck.text.wording import count, ordinal

pytestmark = pytest.mark.usefixtures("own_folder")

Captured = pytest.CaptureFixture[str]
EULER = ["--method", "own:euler"]


def test_numbers_are_set_as_if_the_file_had_them() -> None:
    changes = [
        "--set",
        "spring.0.stiffness=2",
        "--set",
        "particle.0.mass=1.7",
        "--step",
        "0.2",
        "--steps",
        "50",
    ]
    assert main(["run", "spring", *EULER, *changes, "--quiet"]) == 0
    text = scenefile.text_of("spring")
    for old, new in (("stiffness = 1.0", "stiffness = 2"), ("mass = 1.0", "mass = 1.7")):
        text = text.replace(old, new)
    text = text.replace("step = 0.1", "step = 0.2").replace("steps = 200", "steps = 50")
    scene = scenefile.parse(text, name="spring")
    kept = keeper.stored_scene(Path("spring.h5"))
    assert kept.digest == scene.digest != scenefile.load_scene("spring").digest
    assert "spring.0.stiffness = 2" in kept.title
    np.testing.assert_array_equal(
        store.read_one("spring.h5", "own:euler").q, driver.run(scene, "own:euler").q
    )
    # under the default name a store is written anew, under a name that was given it is not
    assert main(["run", "spring", *EULER, "--quiet"]) == 0
    assert keeper.stored_scene(Path("spring.h5")).digest == scenefile.load_scene("spring").digest
    assert main(["run", "spring", *EULER, "--quiet", "-o", "spring.h5", "--dt", "0.2"]) == 2
    Path("spring.h5").write_text("my own")
    assert main(["run", "spring", *EULER, "--quiet"]) == 2
    assert Path("spring.h5").read_text() == "my own"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["--set", "spring.7.stiffness=2"], "spring.7.stiffness: scene spring has no such number"),
        (["--set", "spring.0.stifness=2"], "unknown field"),
        (["--set", "spring.0.stiffness"], "FIELD=NUMBER is needed"),
        (["--set", "spring.0.stiffness=two"], "FIELD=NUMBER is needed"),
        (["--set", "=2"], "FIELD=NUMBER is needed"),
        (["--set", "time.step=0.2", "--step", "0.3"], "set twice"),
        (["--steps", "-3"], "springcheck: --steps -3: time.steps = -3: a whole number >= 1 is needed"),
        (["--step", "nan"], "springcheck: --step nan: time.step = nan"),
        (["--set", "spring.0.stiffness=2", "--steps", "0"], "--set spring.0.stiffness=2, --steps 0: "),
        (["--set", "particle.-1.mass=2"], "has no such number"),
        (["--set", "...=2"], "has no such number"),
    ],
)
def test_what_cannot_be_set_is_refused_in_one_line(given: list[str], words: str, capsys: Captured) -> None:
    assert main(["run", "spring", *EULER, *given]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert len(said.splitlines()) == 1
    assert not list(Path().glob("*.h5"))


@pytest.mark.skipif(not WIDE, reason="long double is no wider than double here")
@pytest.mark.parametrize("momentum", ["1e160", "1e-170"])
def test_energies_beyond_double_precision_are_those_of_the_same_motion_in_other_units(
    momentum: str, capsys: Captured
) -> None:
    found = []
    for one in ("1", momentum):
        what = ["run", "spring", *EULER, "--set", f"particle.0.momentum={one}", "--json", "--force"]
        assert main(what) == 0
        found += [json.loads(capsys.readouterr().out)["runs"][0]["energy_drift"]]
    assert found[1] == pytest.approx(found[0], rel=1e-12)
    assert found[0] > 6


def test_with_friction_energies_are_measured_against_the_exact_loss(capsys: Captured) -> None:
    assert main(["run", "rlc-circuit", "--method", "own:*euler", "--json"]) == 0
    drift = {run["method"]: run["energy_drift"] for run in json.loads(capsys.readouterr().out)["runs"]}
    scene = scenefile.load_scene("rlc-circuit")
    q, p = exact.true_motion(scene, np.arange(401), scene.step)
    right = np.asarray(scene.system.energy(q, p), float)
    for method, found in drift.items():
        run = driver.run(scene, method)
        assert run.energy is not None
        off = run.energy - right
        assert found == pytest.approx(off[np.argmax(np.abs(off))] / run.energy[0], rel=1e-9), method
    # 93 % of the energy is gone, and the scheme has lost what it should
    assert abs(drift["own:semi-implicit-euler"]) < 0.05
    assert main(["run", "rlc-circuit", "--method", "own:euler", "--force"]) == 0
    said = capsys.readouterr().out
    assert "the exact loss by friction" in said
    assert "below 1 pass" in said


def _turned(*, k: float, b: float, m: float, q: float, p: float) -> float:
    """The square of the largest position of a quartic well."""
    energy = k * q**2 / 2 + b * q**4 / 4 + p**2 / (2 * m)
    return float((-k + np.sqrt(k**2 + 4 * b * energy)) / b)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("spring-uneven", np.sqrt(2.9 / 3.7)),
        ("carbon-monoxide", np.sqrt(1145328.357 * (1 / 12 + 1 / 15.99491461957))),
        ("overdamped", np.sqrt(2.9 / 1.3)),
        # where it is stiffest, at its turning point: b x**4/4 + k x**2/2 = E
        ("anharmonic", np.sqrt((2.9 + 3 * 1.7 * _turned(k=2.9, b=1.7, m=1.3, q=0.9, p=0.7)) / 1.3)),
        ("free", 0.0),
        ("inverted", 0.0),
    ],
)
def test_the_fastest_frequency_of_a_scene(name: str, expected: float) -> None:
    # an anharmonic motion is looked at in so many places, 1e-5 beside its turning point at most
    rel = 2e-5 if name == "anharmonic" else 1e-12
    assert fastest(scenefile.load_scene(name)) == pytest.approx(expected, rel=rel)


def test_stability_speaks_of_the_scene(capsys: Captured) -> None:
    assert (
        main(["stability", "stiff-spring", "--method", "own:semi-implicit-euler", "--method", "own:euler"])
        == 0
    )
    said = capsys.readouterr().out
    # w = sqrt(14800/0.37) = 200, h = 0.0095
    assert "w = 200 " in said
    assert "h w = 1.9" in said
    assert "too long for own:euler" in said
    (row,) = (line for line in said.splitlines() if line.startswith("own:semi-implicit-euler"))
    assert row.split()[-1] == "0.01"
    # measured, it is what a rounding hides
    (row,) = (line for line in said.splitlines() if line.startswith("own:euler "))
    assert row.split()[-1] == "none"


def test_ordinals_and_plurals() -> None:
    given = (1, 2, 3, 4, 11, 12, 13, 21, 41, 101, 111, 1002)
    assert [ordinal(n) for n in given] == [
        "1st", "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "41st", "101st", "111th", "1002nd",
    ]  # fmt: skip
    assert (count(1, "cell"), count(2, "cell"), count(0, "cell")) == ("1 cell", "2 cells", "0 cells")
