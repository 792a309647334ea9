"""A charge in a magnetic field: Boris' rotation, the exact motion, and what is wrong with others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import lammps_field
import springcheck
from springcheck import checks, schemes
from springcheck.engines.own import vectors
from springcheck.errors import SceneError
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import Force, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Drive, Magnetic, Spring, WallSpring, Weight
from springcheck.studies.stability import longest

SCENES = ("magnetic", "foucault")


@pytest.mark.parametrize("step", [0.1, 1.7, -0.3])
def test_boris_turns_by_twice_the_arc_tangent_and_keeps_the_speed(step: float) -> None:
    scene = replace(scenes.load_scene("magnetic"), step=step, steps=50)
    run = springcheck.simulate(scene, "own:boris")
    v = run.p[:, 0] + 1j * run.p[:, 1]
    turn = np.angle(v[1:] / v[:-1])
    # z'' = -i W z': clockwise
    assert turn == pytest.approx(-2 * np.arctan(2.3 / 1.7 * step / 2), rel=1e-13)
    assert np.abs(v) == pytest.approx(np.abs(v[0]), rel=1e-14)


@pytest.mark.parametrize("label", ["own:boris", "own:euler", "own:semi-implicit-euler", "own:rk4",
                                   "own:velocity-verlet", "openmm:boris"])  # fmt: skip
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("step", [0.1, -0.07])
def test_every_method_in_a_field_is_its_scheme_to_rounding(
    name: str, label: str, step: float, need: Any
) -> None:
    need(label)
    scene = replace(scenes.load_scene(name), steps=60, step=step)
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, label))}
    assert found["step-defect"].passed is True
    assert not [v.check for v in found.values() if v.passed is False]
    coarse = replace(scene, every=6)
    found = {v.check: v for v in checks.judge(coarse, springcheck.simulate(coarse, label))}
    assert found["step-defect"].passed is True


@pytest.mark.parametrize("label", ["scipy:dop853", "scipy:radau", "sundials:adams", "sundials:bdf"])
@pytest.mark.parametrize("name", SCENES)
def test_solvers_keep_their_tolerance_in_a_field(name: str, label: str, need: Any) -> None:
    need(label)
    scene = replace(scenes.load_scene(name), steps=100, tolerance=1e-9)
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, label))}
    assert found["tolerance"].passed is True


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_field_along_each_axis_turns_about_it(axis: str) -> None:
    """The same circle, its plane turned; what moves along the field moves straight on."""
    text = scenes.load_scene("magnetic").to_toml()
    text = text.replace('axes = "xy"', 'axes = "xyz"').replace(
        "position = [0.3, -0.2]", "position = [0.3, -0.2, 0.1]"
    )
    text = text.replace("momentum = [0.7, 0.4]", "momentum = [0.7, 0.4, -0.5]").replace(
        'axis = "z"', f'axis = "{axis}"'
    )
    scene = scenes.parse(text, name="turned")
    assert scenes.parse(scene.to_toml(), name="again").digest == scene.digest
    run = springcheck.simulate(replace(scene, steps=50), "own:boris")
    along = "xyz".index(axis)
    assert np.ptp(run.p[:, along]) == 0
    plane = [(along + 1) % 3, (along + 2) % 3]
    v = run.p[:, plane[0]] + 1j * run.p[:, plane[1]]
    assert np.angle(v[1:] / v[:-1]) == pytest.approx(-2 * np.arctan(2.3 / 1.7 * 0.1 / 2), rel=1e-13)


def wrong(name: str, scene: Scene) -> Any:
    """Boris' states with a mistake: the turn of another angle, its sign, or E and B in the wrong order."""
    size = float(scene.terms[-1].parameters[0][0]) / float(scene.m[0]) * scene.step
    angle = {"small-angle": size, "exact-turn": size, "other-way": -2 * np.arctan(size / 2)}.get(
        name, 2 * np.arctan(size / 2)
    )
    q, p = scene.q.copy(), scene.p.copy()
    k = next((float(x.k[0]) for x in scene.terms if isinstance(x, WallSpring)), 0.0)
    states = [(q, p)]
    for _ in range(scene.steps):
        q = q + scene.step / 2 * p / scene.m
        kick = -scene.step / 2 * k * q
        p = p + kick * (2 if name == "kick-first" else 1)
        z = (p[0] + 1j * p[1]) * np.exp(-1j * angle)
        p = np.array([z.real, z.imag]) + kick * (0 if name == "kick-first" else 1)
        q = q + scene.step / 2 * p / scene.m
        states.append((q, p))
    return np.array(states)


@pytest.mark.parametrize(
    ("name", "scene"),
    [("small-angle", "magnetic"), ("other-way", "magnetic"), ("kick-first", "foucault")],
)
def test_another_turn_is_rejected(name: str, scene: str) -> None:
    law = replace(scenes.load_scene(scene), steps=40)
    run = springcheck.simulate(law, "own:boris")
    right, states = wrong("right", law), wrong(name, law)
    assert right[:, 0] == pytest.approx(run.q, abs=1e-13)
    broken = replace(run, q=states[:, 0].copy(), p=states[:, 1].copy(), energy=None)
    found = {v.check: v for v in checks.judge(replace(law, quantities=("q", "p")), broken)}
    assert found["step-defect"].passed is False
    assert found["gyration"].passed is False


@pytest.mark.parametrize("label", ["own:boris", "openmm:boris"])
@pytest.mark.parametrize(("name", "step"), [("magnetic", 1.3), ("foucault", -0.07)])
def test_the_turn_of_a_step_sees_what_it_says_that_it_sees(
    label: str, name: str, step: float, need: Any
) -> None:
    need(label)
    scene = replace(scenes.load_scene(name), steps=60, step=step)

    def turned(by: float) -> Any:
        # the same turn as of a step that is too long, and no other drift or kick
        field = scene.terms[-1]
        assert isinstance(field, Magnetic)
        strong = replace(field, strength=field.strength * (1 + by))
        run = springcheck.simulate(replace(scene, terms=(*scene.terms[:-1], strong)), label)
        return next(v for v in checks.judge(scene, run) if v.check == "gyration")

    right = turned(0.0)
    assert right.passed is True
    assert right.value < right.bound / 4
    assert turned(3 * right.sees.step).passed is False
    assert "off by" in right.why


def test_a_speed_that_is_not_kept_is_told_beside_an_angle_that_is_right() -> None:
    scene = replace(scenes.load_scene("magnetic"), steps=40)
    run = springcheck.simulate(scene, "own:boris")
    grown = replace(run, p=run.p * (1 + 1e-12) ** np.arange(41)[:, None], energy=None)
    found = {v.check: v for v in checks.judge(replace(scene, quantities=("q", "p")), grown)}
    assert found["gyration"].passed is False
    assert "changes the speed by 1.0e-12" in found["gyration"].why


def test_a_field_of_strength_0_and_a_velocity_out_of_none_are_judged() -> None:
    scene = replace(scenes.load_scene("magnetic"), steps=10, quantities=("q", "p"))
    field = scene.terms[-1]
    assert isinstance(field, Magnetic)
    none = replace(scene, terms=(*scene.terms[:-1], replace(field, strength=0 * field.strength)))
    found = {v.check: v for v in checks.judge(none, springcheck.simulate(none, "own:boris"))}
    assert found["gyration"].passed is True
    assert found["gyration"].sees.step is None
    rest = replace(scene, q=0 * scene.q, p=0 * scene.p)
    run = springcheck.simulate(rest, "own:boris")
    run = replace(run, p=np.where(np.arange(11)[:, None] < 4, 0, [1e-3, 2e-3]), energy=None)
    found = {v.check: v for v in checks.judge(rest, run)}
    assert found["gyration"].passed is False
    assert "step 4 makes a velocity out of none" in found["gyration"].why


def test_where_no_stage_turns_by_the_field_the_turn_is_not_judged() -> None:
    scene = replace(scenes.load_scene("magnetic"), steps=20)
    for label, every in (("own:rk4", 1), ("own:boris", 2)):
        coarse = replace(scene, every=every)
        found = {v.check: v for v in checks.judge(coarse, springcheck.simulate(coarse, label))}
        assert found["gyration"].passed is None


@pytest.mark.parametrize("unlike", [0.0, 0.7])
def test_the_exact_motion_has_friction_and_a_resting_place_too(unlike: float) -> None:
    """Against RK4 in steps so short that it is exact to 1e-11, of springs alike along both axes or not."""
    scene = Scene(
        m=[1.7, 1.7], q=[0.3, -0.2], p=[0.7, 0.4], places=[0, 1], step=0.002, steps=1000,
        terms=(WallSpring(i=[0, 1], k=[2.9, 2.9 + unlike], at=[0.1, -0.3]), Damping(i=[0, 1], c=[0.2, 0.2]),
               Magnetic(a=[0], b=[1], strength=[2.3])),
    )  # fmt: skip
    run = springcheck.simulate(scene, "own:rk4")
    q, p = exact.true_motion(scene, np.array([1000]), scene.step)
    assert np.max(np.abs(run.q[-1] - q)) < 1e-11
    assert np.max(np.abs(run.p[-1] - p)) < 1e-11


def test_boris_turns_about_a_field_that_lies_along_no_axis(need: Any) -> None:
    """v- = v + v x t, v+ = v + 2/(1 + t.t) v- x t: what of v is along the field stays.  The second particle
    has a field in one plane, a drive pulls at the first."""
    field, m, h = np.array([[0.7, -1.1, 0.4], [0.0, 0.8, 0.0]]), np.array([[1.7], [2.9]]), 0.1
    start = np.array([[0.3, -0.2, 0.5], [1.1, 0.4, -0.6]]), np.array([[0.7, 0.4, -0.3], [0.2, -0.5, 0.9]])
    k, axes = np.array([[2.9, 1.3, 0.8], [1.1, 2.2, 3.1]]), np.arange(3)
    scene = Scene(
        m=np.repeat(m, 3), q=start[0].ravel(), p=start[1].ravel(), places=range(6), step=h, steps=60,
        terms=(WallSpring(i=range(6), k=k.ravel(), at=np.zeros(6)),
               Magnetic(a=np.ravel([(axes + 1) % 3 + 3 * i for i in (0, 1)]), strength=field.ravel(),
                        b=np.ravel([(axes + 2) % 3 + 3 * i for i in (0, 1)]))),
    )  # fmt: skip
    (x, v), turn = (start[0], start[1] / m), field / m * h / 2
    for _ in range(scene.steps):
        x = x + h / 2 * v
        v = v - h / 2 * k * x / m
        v = v + np.cross(v + np.cross(v, turn), 2 * turn / (1 + np.sum(turn**2, axis=1, keepdims=True)))
        v = v - h / 2 * k * x / m
        x = x + h / 2 * v
    run = springcheck.simulate(scene, "own:boris")
    assert np.allclose(run.q[-1], x.ravel(), rtol=0, atol=1e-13)
    assert np.allclose(run.p[-1], (m * v).ravel(), rtol=0, atol=1e-13)
    assert springcheck.judge(scene, run).passed
    driven = replace(scene, terms=(*scene.terms, Drive(i=[1], amplitude=[0.3], frequency=[1.1], phase=[0.2])))
    assert springcheck.judge(driven, springcheck.simulate(driven, "own:boris")).passed
    need("openmm:boris")
    assert springcheck.judge(scene, springcheck.simulate(scene, "openmm:boris")).passed


def test_a_charge_in_crossed_fields_drifts_across_both() -> None:
    """E along x and B along z: v = u + R(W t) (v0 - u) with u = (0, -E/B), beside a fall along z."""
    m, force, field, fall = 1.7, 0.9, 2.3, -0.4
    scene = Scene(
        m=[m] * 3, q=[30.3, -0.2, 0.1], p=[0.7, 0.4, -0.3], places=[0, 1, 2], step=0.1, steps=400,
        terms=(Weight(i=[0, 2], force=[force, fall], at=[0.0, 0.0]),
               Magnetic(a=[0], b=[1], strength=[field])),
    )  # fmt: skip
    t, found = 40.0, springcheck.exact(scene)
    u, w = -1j * force / field, -1j * field / m
    v0 = (0.7 + 0.4j) / m - u
    z, v = 30.3 - 0.2j + u * t + v0 * (np.exp(w * t) - 1) / w, u + v0 * np.exp(w * t)
    q = [z.real, z.imag, 0.1 - 0.3 / m * t + fall / m * t * t / 2]
    p = [m * v.real, m * v.imag, -0.3 + fall * t]
    assert np.allclose(found.q[-1], q, rtol=1e-13, atol=0)
    assert np.allclose(found.p[-1], p, rtol=1e-13, atol=0)
    assert springcheck.judge(scene, springcheck.simulate(scene, "own:boris")).passed


def test_a_field_needs_a_plane() -> None:
    with pytest.raises(SceneError, match="two axes of one particle"):
        Scene(
            m=[1.0, 1.0],
            q=[0, 1],
            p=[1, 0],
            step=0.1,
            steps=1,
            terms=(Magnetic(a=[0], b=[1], strength=[2.0]),),
        )
    text = scenes.load_scene("magnetic").to_toml().replace('axis = "z"', 'axis = "x"')
    with pytest.raises(SceneError, match="a field along x needs a particle along y and z"):
        scenes.parse(text, name="flat")


def test_boris_is_reversible_in_its_stages_and_not_symplectic() -> None:
    boris = schemes.ATTACHED["boris"]
    assert boris.has("reversible")
    assert not boris.has("symplectic")
    assert schemes.KINDS["gyrate"].evaluates == "magnetic"


def test_a_joined_pair_in_a_field_is_judged_to_rounding() -> None:
    scene = Scene(
        m=[1.7, 1.7, 2.9, 2.9], q=[0.3, -0.2, 1.1, 0.4], p=[0.7, 0.4, -0.3, 0.2], places=[0, 1, 3, 4],
        step=0.1, steps=40, every=2,
        terms=(Spring(a=[0, 1], b=[2, 3], k=[2.9, 2.9], rest=[0.0, 0.0]),
               Magnetic(a=[0, 2], b=[1, 3], strength=[2.3, -0.7])),
    )  # fmt: skip
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, "own:boris"))}
    assert found["step-defect"].passed is True
    assert found["momentum"].passed is None


def test_no_longest_step_is_said_in_a_field_whose_part_in_it_is_not_known() -> None:
    assert longest.linear(scenes.load_scene("foucault"), schemes.SCHEMES["semi-implicit-euler"]) is None


def test_lammps_with_a_field_as_a_force_of_the_velocity_is_explicit_euler_of_half_steps(need: Any) -> None:
    need("lammps:external")
    assert lammps_field.off() < lammps_field.LAST


def test_noise_that_an_unstable_step_makes_large_turns_nothing() -> None:
    """Brownian steps too long for a joint: all frames lie along one growing direction but the first ones."""
    rng, q = np.random.default_rng(4), [np.array([0.3, -0.2])]
    step = np.array([[0.999, -0.02], [-0.02, -1.028]])
    for _ in range(1001):
        q.append(step @ q[-1] + rng.normal(size=2))
    x = np.array(q)
    assert np.max(np.abs(x)) > 1e11
    found = springcheck.identify(0.1 * np.arange(1001), x[1:], np.diff(x, axis=0) / 0.1, mass=1.0)
    assert "magnetic" not in str(found)


@pytest.mark.parametrize("axis", [0, 2])
def test_a_field_is_named_in_files_of_three_axes_beside_what_swings_along_it(axis: int) -> None:
    """The spring along the field was named alone, and the plane beside it "too little to be judged"."""
    scene = replace(scenes.load_scene("orbit"), step=0.083)
    one, other = sorted({0, 1, 2} - {axis})
    terms = (*scene.terms, Magnetic(a=[one], b=[other], strength=[2.3]))
    run = springcheck.simulate(replace(scene, terms=terms), "own:boris")
    found = springcheck.identify(run, mass=scene.m)
    assert found.verdict == "none"
    assert f"The velocity of coordinates {one} and {other} turns by" in found.statement
    assert "strength over mass 0.621621622, stiffness over mass 0.783783784" in found.statement


@pytest.mark.parametrize(("method", "calls"), [("boris", 40), ("velocity-verlet", 80)])
def test_forces_in_a_field_are_counted_as_they_are_evaluated(
    method: str, calls: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Boris' turn is no force, and its half kicks are at one position; another scheme's force has the field
    in it, and changes with the momentum."""
    made: list[int] = []
    kept = vectors.kept

    def counted(force: Force, damped: bool) -> Force:
        which = len(made)
        made.append(0)

        def count(q: Reals, p: Reals) -> Reals:
            made[which] += 1
            return force(q, p)

        return kept(count, damped)

    monkeypatch.setattr(vectors, "kept", counted)
    scene = replace(scenes.load_scene("foucault"), steps=40)
    run = springcheck.simulate(scene, f"own:{method}")
    force, slow, fast, _ = made
    assert run.force_calls == force + slow + fast == calls


@pytest.mark.parametrize(("step", "grows"), [(1.53, False), (1.55, True), (-2.0, True), (6.1, True)])
def test_a_run_in_a_field_is_warned_of_a_step_with_which_boris_grows(step: float, grows: bool) -> None:
    """The trace of its step is 1 + R times 1 - (h w)**2/2, R the rotation in the field."""
    scene = replace(scenes.load_scene("foucault"), step=step, steps=30)
    turn, w2 = np.arctan(0.37 / 1.7 * step / 2), 2.9 / 1.7
    trace = abs(np.cos(turn) * (1 - w2 * step**2 / 2))
    factor = trace + np.sqrt(max(trace**2 - 1, 0))
    assert (factor > 1) == grows
    found = longest.resonating("boris", scene)
    assert found == (pytest.approx(factor, rel=1e-9) if grows else None)
    said = " ".join(str(springcheck.run(scene, methods=["own:boris"])).split())
    assert (f"grow by a factor of {factor:.4f} a step, and the exact" in said) == grows
    # of kicks by the field's force no step is bounded, and no shorter one helps
    assert longest.resonating("velocity-verlet", scene) is None
