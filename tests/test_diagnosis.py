"""What states of a known scene show: one diagnosis, whoever asks, and none of states that are right."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import checks, driver, schemes
from springcheck.cli import file, main
from springcheck.errors import StoreError
from springcheck.identify import scenes
from springcheck.physics import scenefile
from springcheck.physics.distance import RadialSpring
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory


def other(scene: Scene, number: int, field: str, row: int, value: float) -> Scene:
    """The scene with one number of a term's other than it is there."""
    terms = list(scene.terms)
    numbers = getattr(terms[number], field).copy()
    numbers[row] = value
    terms[number] = replace(terms[number], **{field: numbers})
    return scene.derived(terms=tuple(terms))


def said(scene: Scene, run: Trajectory) -> str:
    """What a failed judgement says that the states show; "" of one that did not fail."""
    return checks.cause_of(checks.explained(scene, run, checks.judge(scene, run), scenes.diagnosis))


OLD_FORCE = """
def step(q, p, h, force, mass):
    pull = force(q)
    p = p + h / 2 * pull
    q = q + h * p / mass
    return q, p + h / 2 * pull
"""


@pytest.mark.parametrize("name", ["spring-uneven", "pendulum", "chain"])
def test_every_command_gives_the_same_diagnosis(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A second half kick from the old force was named by `identify` alone."""
    (tmp_path / "mine.py").write_text(OLD_FORCE)
    store, table = tmp_path / "a.h5", tmp_path / "a.csv"
    given = ["--stepper", f"{tmp_path / 'mine.py'}:step", "--scheme", "velocity-verlet", "-o", str(store)]
    given += ["--method", "stepper:step"]
    assert main(["run", name, *given, "--steps", "60", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    told = {v["why"].partition(checks.DIAGNOSIS)[2] for v in document["verdicts"]} - {""}
    run = springcheck.read(store)["stepper:step"]
    run.save(table)
    scene = replace(scenefile.load_scene(name), steps=60)
    told.add(said(scene, run))
    told.add(checks.cause_of(file.judge(table, scene=scene, scheme="velocity-verlet").verdicts))
    assert main(["identify", str(table), "--scene", name, "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    first = found["explanations"][0]
    told.add(f"{first['cause']}. What to do: {first['remedy']}")
    assert len(told) == 1
    assert "compute the force anew after the drift" in told.pop()


@pytest.mark.parametrize("name", ["spring-uneven", "pendulum"])
def test_a_file_is_judged_by_the_scheme_that_it_shows(name: str, tmp_path: Path) -> None:
    scene = scenefile.load_scene(name)
    table = driver.run(scene, "own:ruth3").save(tmp_path / "a.csv")
    found = file.judge(table, scene=scene)
    assert (found.status, found.scheme) == (0, "ruth3")
    assert any("ruth3" in note for note in found.notes)
    run = driver.run(scene, "own:ruth3")
    noise = 1e-3 * np.random.default_rng(1).normal(size=run.p.shape)
    wrong = replace(run, p=run.p + noise * (np.arange(len(run.t)) > 0)[:, None]).save(tmp_path / "b.csv")
    with pytest.raises(StoreError, match="--scheme"):
        file.judge(wrong, scene=scene)


@pytest.mark.parametrize(
    ("name", "made", "claimed", "every"),
    [("driven-spring", "rk4", "position-verlet", 1), ("anharmonic", "rk2-heun", "rk2-midpoint", 1),
     ("overdamped", "velocity-verlet", "rk4", 10), ("van-der-pol", "implicit-euler", "implicit-midpoint", 1)],
)  # fmt: skip
def test_the_scheme_that_takes_each_step_is_named_whatever_acts(
    name: str, made: str, claimed: str, every: int
) -> None:
    scene = replace(scenefile.load_scene(name), steps=60 * every, every=every)
    shown = said(scene, replace(driver.run(scene, f"own:{made}"), scheme=claimed))
    assert schemes.title(made).casefold() in shown.casefold()


VERLET = "own:velocity-verlet"
SPRING = "the stiffness of the spring of particle"


@pytest.mark.parametrize(
    ("name", "number", "field", "row", "value", "method", "words"),
    [
        ("chain", 1, "k", 0, 1.1 + 1.1e-6, VERLET, f"{SPRING}s 0 and 1: 1.1000011, not 1.1"),
        (
            "chain",
            1,
            "rest",
            1,
            1.0 + 1e-10,
            VERLET,
            "rest of the spring of particles 1 and 2: 1.0000000001,",
        ),
        ("chain", 0, "k", 1, 0.0, "own:rk4", f"{SPRING} 2: 0, not 0.9"),
        ("spring-uneven", 0, "at", 0, 1e-6, VERLET, "place of the spring of particle 0: 1e-06, not 0"),
        (
            "pendulum",
            0,
            "depth",
            2,
            7.9 * (1 + 1e-9),
            VERLET,
            "depth of the cosine of particle 2: 7.9000000079,",
        ),
        ("morse-bond", 0, "rest", 0, 0.12747, VERLET, "rest of the morse of particles 0 and 1: 0.12747,"),
        ("driven-spring", 1, "c", 0, 0.11 * 3.7, "own:euler", "damping of particle 0: 0.407, not 0.11"),
        (
            "driven-spring",
            2,
            "amplitude",
            0,
            0.43 * (1 + 1e-8),
            "own:rk4",
            "of particle 0: 0.4300000043, not",
        ),
    ],
)
def test_one_number_that_is_another_is_named(
    name: str, number: int, field: str, row: int, value: float, method: str, words: str
) -> None:
    """Each step then is the scheme's own with another number: the sentence names it and both its values."""
    scene = scenefile.load_scene(name)
    run = driver.run(other(scene, number, field, row, value), method)
    assert words in said(scene, run)


def test_masses_and_steps_that_are_others_are_named() -> None:
    scene = scenefile.load_scene("chain")
    m = scene.m * np.array([1, 1 + 1e-6, 1])
    run = driver.run(scene.derived(m=m), "own:velocity-verlet")
    assert "the mass of particle 1: 0.7000007, not 0.7" in said(scene, run)
    # a program that keeps velocities, of which the judge makes momenta by the scene's masses
    kept = driver.run(scene.derived(m=m, p=scene.p * m / scene.m), "own:velocity-verlet")
    run = replace(kept, p=kept.p * scene.m / m)
    assert "the mass that divides the force on particle 1: 0.7000007, not 0.7" in said(scene, run)
    run = driver.run(scene.derived(m=scene.m * 1.0001), "own:velocity-verlet")
    assert "a factor to each mass: 1.0001, not 1" in said(scene, run)
    pendulum = scenefile.load_scene("pendulum")
    run = driver.run(pendulum.derived(step=float(np.float32(0.05))), "own:velocity-verlet")
    run = replace(run, step=0.05, t=pendulum.step * np.arange(len(run.t)))
    assert "the step: 0.050000000745, not 0.05, as in single precision" in said(pendulum, run)


@pytest.mark.parametrize("name", ["van-der-pol", "driven-spring"])
def test_noise_of_a_few_roundings_is_no_number(name: str) -> None:
    """A number that roundings of one sign would move as far explains nothing."""
    scene = replace(scenefile.load_scene(name), quantities=("q", "p"), steps=300, every=1)
    run = driver.run(scene, "own:rk4")
    for seed, size in product(range(4), (3e-15, 6e-15)):
        rng = np.random.default_rng(seed)
        q, p = (x * (1 + size * rng.normal(size=x.shape)) for x in (run.q, run.p))
        assert "another number" not in said(scene, replace(run, q=q, p=p))


def test_what_no_number_explains_is_not_said_to_be_the_scheme() -> None:
    """A verdict that failed ended in: velocity Verlet, double arithmetic explains every step."""
    for name in ("chain", "spring-uneven", "pendulum"):
        scene = scenefile.load_scene(name)
        run = driver.run(scene, "own:velocity-verlet")
        p = run.p.copy()
        p[77] *= 1 + 1e-13
        assert "every step" not in said(scene, replace(run, p=p)).lower()


@pytest.mark.parametrize(("name", "factor"), [("chain", -1.0), ("anharmonic", -1.0), ("anharmonic", 1.0001)])
def test_a_factor_to_the_forces_of_all_terms_is_named(name: str, factor: float) -> None:
    """A sign that is wrong in every force was no cause: each term by itself explains no step."""
    scene = scenefile.load_scene(name).derived(steps=100)
    shown = said(scene, driver.run(scene.system.scaled(factor), VERLET))
    assert f"a factor to every force: {factor:g}, not 1" in shown


def molecule(**changes: Any) -> Scene:
    """Four unlike masses in space on three bonds, their numbers those of a force field but for `changes`."""
    k, rest = np.array([2.8e5, 4.5e5, 3.3e5]), np.array([0.109, 0.1229, 0.1335])
    given = {"k": k, "rest": rest} | changes
    bonds = RadialSpring(
        a=np.tile(np.arange(3), 3), b=np.repeat(3 * np.arange(1, 4), 3) + np.tile(np.arange(3), 3),
        number=np.repeat(np.arange(3), 3), **{name: np.repeat(x, 3) for name, x in given.items()},
    )  # fmt: skip
    q = [0.0, 0.0, 0.0, 0.11, 0.02, 0.01, -0.05, 0.13, 0.02, 0.03, -0.1, 0.09]
    m = np.repeat([12.011, 1.008, 15.999, 14.007], 3)
    p = np.sqrt(2.5 * m) * np.cos(np.arange(12) * 1.7)
    return Scene(
        m=m, q=np.array(q), p=p, terms=(bonds,), places=np.arange(12), units="md", step=0.0005, steps=40
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"k": [2.8e5, 4.55e5, 3.3e5]}, "stiffness of the bond of particles 0 and 2: 455000, not 450000"),
        ({"rest": [0.109, 0.1229, 0.1336]}, "rest of the bond of particles 0 and 3: 0.1336, not 0.1335"),
    ],
)  # fmt: skip
def test_a_number_of_one_bond_in_space_is_named(changes: dict[str, Any], words: str) -> None:
    """A bond has one stiffness along all axes; each axis by itself explains nothing."""
    right = molecule()
    wrong = molecule(**{name: np.array(x) for name, x in changes.items()})
    assert words in said(right, driver.run(wrong, "own:velocity-verlet"))
