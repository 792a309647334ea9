"""Particles that move along x, y and z: each axis is a spring of its own, and nothing tells axes apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import springcheck
from springcheck import checks, driver, engines
from springcheck.errors import MethodError, SceneError
from springcheck.physics import scenefile
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Spring, WallSpring
from springcheck.store import layout

IN_SPACE = ("ase:velocity-verlet", "openmm:verlet", "openmm:leapfrog", "openmm:euler")


def orbit() -> Scene:
    return scenefile.load_scene("orbit")


def planar(**changes: object) -> Scene:
    """Two unlike particles in the plane of x and y, joined, the one held more firmly along y."""
    fields: dict[str, object] = {
        "m": [3.7, 3.7, 1.3, 1.3], "q": [0.3, -0.2, 0.5, 0.9], "p": [0.7, 1.1, -0.4, 0.2],
        "places": [0, 1, 3, 4],
        "terms": (
            WallSpring(i=[0, 1], k=[2.9, 4.1], at=[0.0, 0.3]),
            Spring(a=[0, 1], b=[2, 3], k=[1.7, 1.7], rest=[0.0, 0.0]),
        ),
        "step": 0.1, "steps": 60,
    }  # fmt: skip
    return Scene(**{**fields, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "label", ["own:euler", "own:semi-implicit-euler", "own:implicit-midpoint", *IN_SPACE]
)
def test_every_axis_moves_as_a_spring_of_its_own(label: str) -> None:
    scene = orbit()
    whole = driver.run(scene, label)
    for j in range(3):
        alone = driver.run(spring(m=scene.m[j], k=2.9, q=scene.q[j], p=scene.p[j]), label)
        # in space OpenMM takes the root of a sum of squares for a length: a rounding more
        assert np.max(np.abs(whole.q[:, j] - alone.q[:, 0])) < 200 * 50 * 2.0**-53 * np.max(np.abs(alone.q))


@pytest.mark.parametrize("label", IN_SPACE)
@pytest.mark.parametrize("make", [orbit, planar])
def test_engines_in_space_pass_every_check(label: str, make: object) -> None:
    scene = make()  # type: ignore[operator]
    if engines.refusal(scene, engines.parse(label)):
        pytest.skip("does not serve this scene")
    run = driver.run(scene, label)
    verdicts = checks.judge(scene, run) + checks.judge_thoroughly(
        scene, label, driver.run, [one for one in checks.THOROUGH if one.family != "law"]
    )
    assert [v for v in verdicts if v.passed is False] == []
    assert {"step-defect", "line", "propagator"} <= {v.check for v in verdicts if v.passed}


def test_a_bond_of_a_program_that_is_not_alike_along_its_axes_is_refused() -> None:
    unlike = planar(terms=(Spring(a=[0, 1], b=[2, 3], k=[1.7, 1.9], rest=[0.0, 0.0]),))
    with pytest.raises(MethodError, match="along every axis"):
        driver.run(unlike, "openmm:verlet")
    # counted from their rest a bond of a rest length along y is one of none
    long = planar(terms=(Spring(a=[0, 1], b=[2, 3], k=[1.7, 1.7], rest=[0.0, 0.5]),))
    assert not [v for v in checks.judge(long, driver.run(long, "openmm:verlet")) if v.passed is False]


def test_angular_momentum_is_kept_where_area_is_and_grows_by_the_determinant_elsewhere() -> None:
    scene = orbit()
    for scheme, growth in (("semi-implicit-euler", 1.0), ("euler", 1 + 0.01 * 2.9 / 3.7)):
        run = driver.run(scene, f"own:{scheme}")
        q, p = run.q.astype(np.longdouble), run.p.astype(np.longdouble)
        found = q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0]
        assert np.allclose(np.asarray(found / found[0], float), growth ** np.arange(201.0), rtol=1e-12)
        verdict = next(v for v in checks.judge(scene, run) if v.check == "angular-momentum")
        assert verdict.passed
        assert verdict.sees.area is not None
        assert verdict.sees.area < 1e-14


def test_angular_momentum_is_of_axes_that_nothing_tells_apart() -> None:
    assert len(orbit().system.alike) == 3
    assert planar().system.alike == ()
    alike = planar(terms=(Spring(a=[0, 1], b=[2, 3], k=1.7, rest=0.0),))
    assert [x.tolist() for x in alike.system.alike[0]] == [[0, 2], [1, 3]]
    assert replace(alike, terms=(*alike.terms, Damping(i=[1], c=[0.1]))).system.alike == ()
    away = replace(orbit(), terms=(WallSpring(i=[0, 1, 2], k=2.9, at=[0.0, 0.1, 0.0]),))
    assert len(away.system.alike) == 1 - 1


def test_a_scene_along_another_axis_is_the_same_motion_to_the_bit() -> None:
    scene = spring(m=3.7, k=2.9, q=0.3, p=0.7)
    for label in IN_SPACE:
        along_x = driver.run(scene, label)
        for axis in (1, 2):
            turned = driver.run(replace(scene, places=[axis]), label)
            assert np.array_equal(turned.q, along_x.q)
            assert np.array_equal(turned.p, along_x.p)
            assert turned.off_axis == 0


def test_an_engine_that_is_given_x_alone_refuses_other_axes_in_words() -> None:
    scene = orbit()
    assert "along x" in str(engines.refusal(scene, engines.parse("mujoco:joint-spring")))


def test_scene_files_say_axes_and_are_read_back_to_the_bit(tmp_path: Path) -> None:
    for scene in (orbit(), planar(), planar(m=[3.7, 3.7, 1.3, 2.3], places=[0, 1, 3, 7])):
        again = scenefile.parse(scene.to_toml(), name=scene.name)
        assert again.digest == scene.digest
        assert np.array_equal(again.places, scene.places)
    flat = replace(orbit(), places=[0, 3, 6])
    assert flat.places is None
    assert flat.digest != orbit().digest


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "position = [1.0, 2.0]\nmomentum = [1.0]",
            "particle[0].momentum: one for each of xy is needed, not 1",
        ),
        ("position = [1.0, 2.0, 3.0, 4.0]", "position"),
        ('position = [1.0, 2.0]\naxes = "xx"', "each axis once"),
        ("position = 1.0\nmomentum = [1.0, 2.0]", "a number for each of xy is needed"),
        ('position = [1.0]\naxes = "w"', "axes"),
    ],
)
def test_mistakes_of_axes_get_one_line(text: str, said: str) -> None:
    whole = f'title = "t"\n[[particle]]\nmass = 1.0\n{text}\n[time]\nstep = 0.1\nsteps = 3\n'
    with pytest.raises(SceneError) as error:
        scenefile.parse(whole, name="t")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ('[[spring]]\nends = ["wall", 0]\nstiffness = 1.0\nwall = 0.5', "one row for each axis"),
        ('[[spring]]\nends = ["wall", 0]\nstiffness = 1.0\naxis = "z"', "along which it cannot move"),
        ("[[spring]]\nends = [0, 1]\nstiffness = 1.0", "say along which axis"),
        ("[[morse]]\nends = [0, 2]\ndepth = 1.0\nsteepness = 1.0\nrest = 1.0", "along a line"),
    ],
)
def test_mistakes_of_springs_in_the_plane_get_one_line(row: str, said: str) -> None:
    particles = "".join(
        f"[[particle]]\nmass = 1.0\nposition = {position}\n" for position in ([0.1, 0.2], [0.3], [0.4, 0.5])
    )
    with pytest.raises(SceneError) as error:
        scenefile.parse(f'title = "t"\n{particles}{row}\n[time]\nstep = 0.1\nsteps = 3\n', name="t")
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"places": [0, 0, 1, 2]}, "one of its own"),
        ({"places": [0, 1, 3]}, "4"),
        ({"places": [0, 1, 6, 7]}, "need a coordinate each"),
        ({"m": [1.0, 2.0, 3.0, 3.0]}, "one mass"),
        ({"kind": "circuit", "units": "si"}, "axes"),
        ({"m": [3.7, 3.7, 1.3, 2.3], "places": [0, 1, 3, 8]}, "different axes"),
    ],
)
def test_places_that_make_no_sense_are_refused(changes: dict[str, object], said: str) -> None:
    with pytest.raises(SceneError) as error:
        planar(**changes)
    assert said in str(error.value)


@pytest.mark.parametrize("make", [orbit, planar])
def test_the_file_shows_three_real_coordinates(make: object, tmp_path: Path) -> None:
    scene = make()  # type: ignore[operator]
    run = springcheck.run(scene, "own:semi-implicit-euler", path=tmp_path / "a.h5")
    assert run is not None
    kept = springcheck.read(tmp_path / "a.h5")["own:semi-implicit-euler"]
    with h5py.File(tmp_path / "a.h5") as file:
        group = file["particles/own:semi-implicit-euler"]
        position, mass = group["position/value"][()], group["mass"][()]
    assert position.shape == (scene.frames, scene.particles, 3)
    flat = position.reshape(scene.frames, -1)
    assert np.array_equal(flat[:, scene.places], kept.q)
    assert np.all(flat[:, scene.elsewhere] == 0)
    assert mass.tolist() == ([3.7] if make is orbit else [3.7, 1.3])
    from springcheck.store import checking, exporting

    assert checking.check(tmp_path / "a.h5") == []
    exporting.export(tmp_path / "a.h5", "own:semi-implicit-euler", tmp_path / "a.h5md")
    with h5py.File(tmp_path / "a.h5md") as file:
        assert np.array_equal(file["particles/trajectory/position/value"][()], position)


def test_columns_of_a_store_find_their_axes() -> None:
    # the last but one: columns at even distances of particles at uneven ones; the last: the other way round
    for places in (
        [0, 1, 2], [0, 1, 3, 4], [1], [0, 1, 2, 3, 7, 8], list(range(30)), [0, 1, 3, 7, 9], [0, 1, 3, 6, 7],
    ):  # fmt: skip
        of = np.array(places)
        out = np.zeros((2, int(of.max()) // 3 + 1, 3))
        q = np.arange(2.0 * len(places)).reshape(2, -1) + 1
        for columns, particles, axis in layout.lines(of):
            out[:, particles, axis] = q[:, columns]
        assert np.array_equal(out.reshape(2, -1)[:, of], q)
        assert np.count_nonzero(out) == q.size


def test_momentum_is_judged_along_each_axis_by_itself() -> None:
    """What leaks into one axis and out of another was no change of the sum over all."""
    between = Spring(a=[0, 1], b=[2, 3], k=[2.9, 2.9], rest=[0.0, 0.0])
    scene = Scene(
        m=[1.3, 1.3, 3.7, 3.7], q=[0.3, -0.2, 0.5, 0.1], p=[0.4, 0.1, -0.2, 0.3], places=[0, 1, 3, 4],
        terms=(between,), step=0.1, steps=100,
    )  # fmt: skip
    run = springcheck.simulate(scene, "own:velocity-verlet")
    found = {v.check: v for v in checks.judge(scene, run)}["momentum"]
    assert found.passed is True
    leaks = np.outer(np.arange(101), [1e-12, -1e-12, 0, 0])
    wrong = {v.check: v for v in checks.judge(scene, replace(run, p=run.p + leaks))}["momentum"]
    assert wrong.passed is False
    assert "along x" in wrong.why or "along y" in wrong.why
