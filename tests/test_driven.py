"""Forces that depend on the time: their exact solution, where in a step each scheme takes them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

import fault_table as table
import springcheck
import textbook as steppers
from springcheck import checks, engines, schemes
from springcheck.cli import file
from springcheck.doors import function
from springcheck.engines.own.simulation import prepare
from springcheck.engines.own.vectors import Vectors
from springcheck.errors import MethodError, SceneError
from springcheck.identify.scenes import diagnosis
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.scene import Scene
from springcheck.physics.terms import (
    Cosine,
    Damping,
    Drive,
    Quartic,
    Spring,
    Term,
    WallSpring,
)
from textbook import Case

ONE = np.array([0])
OWN = [f"own:{'euler' if x.name == 'explicit-euler' else x.name}" for x in schemes.SCHEMES.values()
       if x.has("one-step") and not x.has("mixes") and not x.has("friction")]  # fmt: skip


def driven(m: float, k: float, c: float, drive: tuple[float, float, float], **more: Any) -> Scene:
    """A driven spring; without stiffness or friction where that is 0."""
    amplitude, frequency, phase = drive
    terms: list[Term] = [Drive(i=ONE, amplitude=amplitude, frequency=frequency, phase=phase)]
    terms += [WallSpring(i=ONE, k=k, at=0.0)] if k else []
    terms += [Damping(i=ONE, c=c)] if c else []
    given = {"q": [0.3], "p": [0.7], "step": 0.1, "steps": 50} | more
    return Scene(m=np.array([m]), terms=tuple(terms), **given)


def by_exponential(scene: Scene, steps: int) -> tuple[Any, Any]:
    """q and p by the exponential of the matrix of (q, p, cos, sin), in 50 digits."""

    def of(key: str, field: str) -> Any:
        return next((mpmath.mpf(float(getattr(x, field)[0])) for x in scene.terms if x.key == key), 0)

    m, k, c = mpmath.mpf(float(scene.m[0])), of("wall-spring", "k"), of("damping", "c")
    force, w, phase = (of("drive", name) for name in ("amplitude", "frequency", "phase"))
    matrix = mpmath.matrix([[0, 1 / m, 0, 0], [-k, -c / m, force, 0], [0, 0, 0, -w], [0, 0, w, 0]])
    start = [
        mpmath.mpf(float(scene.q[0])),
        mpmath.mpf(float(scene.p[0])),
        mpmath.cos(phase),
        mpmath.sin(phase),
    ]
    end = mpmath.expm(matrix * steps * mpmath.mpf(scene.step)) * mpmath.matrix(start)
    return end[0], end[1]


W = float(np.sqrt(2.9 / 3.7))


@pytest.mark.parametrize(
    ("k", "c", "frequency"),
    [
        (2.9, 0.11, 0.87), (2.9, 0.0, W), (2.9, 0.0, W * (1 + 1e-9)), (2.9, 0.0, 1.01 * W), (2.9, 0.0, 0.0),
        (2.9, 2 * np.sqrt(2.9 * 3.7), 0.87), (2.9, 40.0, 3.0), (2.9, 0.11, 31.0), (0.0, 0.0, 0.87),
        (0.0, 0.0, 0.0), (0.0, 0.6, 1e-7), (-2.9, 0.0, 0.87), (2.9, 0.11, -0.87),
    ],
)  # fmt: skip
@pytest.mark.parametrize("step", [0.1, -0.05])
def test_the_exact_solution_is_that_of_the_matrix_exponential_at_resonance_too(
    k: float, c: float, frequency: float, step: float
) -> None:
    scene = driven(3.7, k, c, (0.43, frequency, 0.6), step=step)
    for steps in (1, 7, 400):
        q, p = exact.true_motion(scene, np.array([steps]), scene.step)
        assert scene.system.solution is not None
        dq, dp = scene.system.solution.doubt(steps * step)
        with mpmath.workdps(50):
            for found, right, doubt in zip(
                (q[0, 0], p[0, 0]), by_exponential(scene, steps), (dq, dp), strict=True
            ):
                off = abs(mpmath.mpf(np.format_float_scientific(found, precision=25)) - right)
                assert off <= mpmath.mpf(float(doubt[0]))


def test_a_drive_on_a_chain_moves_its_modes() -> None:
    """Against RK4 in steps so short that it is exact to 1e-11."""
    scene = Scene(
        m=[3.7, 1.3], q=[0.3, -0.2], p=[0.7, 0.1], step=0.002, steps=1000,
        terms=(WallSpring(i=ONE, k=2.9, at=0.1), Spring(a=[0], b=[1], k=[1.7], rest=[0.4]),
               Drive(i=[1], amplitude=0.43, frequency=0.87, phase=0.6)),
    )  # fmt: skip
    run = springcheck.simulate(scene, "own:rk4")
    q, p = exact.true_motion(scene, np.array([1000]), scene.step)
    assert np.max(np.abs(run.q[-1] - q)) < 1e-11
    assert np.max(np.abs(run.p[-1] - p)) < 1e-11


TIMES = {
    "own:euler": {0.0}, "own:semi-implicit-euler": {0.0}, "own:semi-implicit-euler-drift-kick": {1.0},
    "own:implicit-euler": {1.0}, "own:velocity-verlet": {0.0, 1.0}, "own:position-verlet": {0.5},
    "own:implicit-midpoint": {0.5}, "own:trapezoidal": {0.0, 1.0}, "own:rk4": {0.0, 0.5, 1.0},
    "own:rk2-heun": {0.0, 1.0}, "own:rk2-midpoint": {0.5},
}  # fmt: skip
"""Of a step, where its scheme takes the time: written down here once more, from textbooks."""


@pytest.mark.parametrize("label", TIMES)
def test_a_free_particle_feels_the_drive_at_the_abscissae_of_the_scheme(label: str) -> None:
    """From rest p' - p is h times a mean of the force at the abscissae, and depends on no other time."""
    scene = driven(3.7, 0.0, 0.0, (0.43, 0.87, 0.6), p=[0.0], steps=1)
    kick = springcheck.simulate(scene, label).p[1, 0] / scene.step
    at = np.array(sorted(TIMES[label]))
    forces = 0.43 * np.cos(0.87 * 0.1 * at + 0.6)
    weights = {1: [1.0], 2: [0.5, 0.5], 3: [1 / 6, 4 / 6, 1 / 6]}[len(at)]
    assert kick == pytest.approx(weights @ forces, rel=1e-14)


@pytest.mark.parametrize("label", OWN)
def test_every_own_method_takes_a_driven_scene_to_rounding(label: str) -> None:
    scene = replace(scenes.load_scene("driven-spring"), steps=60)
    verdicts = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, label))}
    assert verdicts["step-defect"].passed is True
    assert not [v.check for v in verdicts.values() if v.passed is False]


def beside(name: str) -> Scene:
    """A driven scene beside springs that join particles, a quartic potential, a pendulum and friction."""
    i = np.arange(4)
    brake = Damping(i=i, c=0.1 * i)
    drives = Drive(i=[0, 2, 2], amplitude=[0.3, 0.2, 0.4], frequency=[1.7, 0.6, 2.3], phase=0.3)  # type: ignore[arg-type]
    walls = WallSpring(i=i, k=1 + 0.3 * i, at=0.1 * i)
    terms: dict[str, tuple[Term, ...]] = {
        "chain": (walls, Spring(a=i[:-1], b=i[1:], k=0.7 + 0.1 * i[:-1], rest=0.2 * i[1:]), drives),
        "ring": (Spring(a=i, b=np.roll(i, 1), k=0.7 + 0.1 * i, rest=0.3 - 0.2 * i), drives, brake),
        "well": (
            Quartic(i=i, b=0.4 + 0.1 * i, at=0.1 * i), Cosine(i=i, depth=0.3 + 0.0 * i, wave=1.3, at=0.2),
            drives, brake,
        ),
    }  # fmt: skip
    q, p = np.cos(1.0 + i), np.sin(2.0 * i)
    return Scene(
        m=1 + 0.37 * i, q=q, p=p, terms=terms[name], step=-0.07 if name == "chain" else 0.07, steps=40
    )


@pytest.mark.parametrize("name", ["driven-spring", "chain", "ring", "well"])
@pytest.mark.parametrize("label", OWN)
def test_the_loops_move_a_driven_scene_to_the_bit_as_numpy_does(name: str, label: str) -> None:
    scene = replace(scenes.load_scene(name), steps=40) if name == "driven-spring" else beside(name)
    scheme = schemes.scheme(engines.method(engines.parse(label)).scheme)
    if scheme.has("implicit"):
        assert isinstance(prepare(scene, scheme, scene.step)._how, Vectors)
        return
    runs = [
        Vectors(scheme, scene, scene.step),
        *(prepare(scene, scheme, scene.step, compiled=x) for x in (False, True)),
    ]
    states = np.empty((3, 2, 20, scene.n))
    for run, (q, p) in zip(runs, states, strict=True):
        run.advance(2, q[:7], p[:7])
        run.advance(2, q[7:], p[7:])
    assert all(run.compiled is x for run, x in zip(runs[1:], (False, True), strict=True))  # type: ignore[union-attr]
    assert np.array_equal(states[0], states[1])
    assert np.array_equal(states[1], states[2])


def test_frames_several_steps_apart_are_judged_too() -> None:
    scene = replace(scenes.load_scene("driven-spring"), steps=70, every=7)
    for label in ("own:velocity-verlet", "own:rk4", "own:implicit-midpoint"):
        run = springcheck.simulate(scene, label)
        found = checks.judge(scene, run)
        assert [v.passed for v in found if v.check == "step-defect"] == [True]
        later = replace(run, t=run.t + 7 * scene.step)
        assert any(v.passed is False for v in checks.judge(scene, later) if v.check == "step-defect")


def test_a_scene_file_of_a_drive_reads_back_the_same() -> None:
    scene = scenes.load_scene("driven-spring")
    assert scenes.parse(scene.to_toml(), name=scene.name).digest == scene.digest


def test_a_drive_needs_finite_numbers() -> None:
    with pytest.raises(SceneError, match="frequency"):
        driven(3.7, 2.9, 0.0, (0.43, float("nan"), 0.0))


def sentence(scene: Scene, run: Any) -> str:
    """Why the states fail, with what they show."""
    verdicts = checks.explained(scene, run, checks.judge(scene, run), diagnosis)
    assert [v.check for v in verdicts if v.passed is False][:1] == ["step-defect"]
    return next(v.why for v in verdicts if v.passed is False)


MISPLACED = {
    "late-drive": "of a step later than velocity Verlet takes it",
    "held-drive": "used throughout, where velocity Verlet takes it at the start and the end",
    "drive-of-the-step-before": "the start of the step before and the start of the step where velocity",
    "drive-phase": "the phase of the drive has the wrong sign",
    "drive-over-mass": "the amplitude of the drive is divided by the mass",
    "drive-in-degrees": "the phase of the drive is taken for degrees",
    "drive-in-cycles": "the angular frequency of the drive is taken for cycles",
}


def test_a_time_that_is_summed_up_is_no_shift() -> None:
    """A program of t += h was said to take the drive 1e-14 of a step later."""
    scene = scenes.load_scene("driven-spring")
    t = 0.0

    def euler(q: Any, p: Any, h: Any, force: Any, mass: Any) -> Any:
        nonlocal t
        now, t = t, t + h
        return q + h * p / mass, p + h * force(q, p, now)

    run = springcheck.simulate(scene, euler, scheme="explicit-euler")
    assert "the time of the drive is a sum of steps, rounded at each" in sentence(scene, run)


def of_summed_time(scene: Scene) -> Any:
    """A run of velocity Verlet whose time is `t += h`, with the products of steps as its times."""
    run = springcheck.simulate(scene, "own:velocity-verlet")
    force, h, t, states = scene.system.clocked.system.force, scene.step, 0.0, [(scene.q, scene.p)]
    q, p = states[0]

    def pull(q: Any, p: Any) -> Any:
        return force(np.append(q, t), np.append(p, 0.0))[: scene.n]

    for _ in range(scene.steps):
        p = p + h / 2 * pull(q, p)
        q = q + h * (p / scene.m)
        t += h
        p = p + h / 2 * pull(q, p)
        states.append((q, p))
    q, p = (np.array(x)[:: scene.every] for x in zip(*states, strict=True))
    return replace(run, q=q, p=p, energy=None), t


@pytest.mark.parametrize("every", [1, 10])
def test_a_clock_that_adds_up_its_steps_is_said_or_judged_by_its_own_times(every: int) -> None:
    """At every tenth frame it failed without a cause, and no declaration allowed it."""
    scene = replace(scenes.load_scene("driven-spring"), steps=400, every=every, quantities=("q", "p"))
    run, end = of_summed_time(scene)
    assert end != scene.steps * scene.step
    assert "the time of the drive is a sum of steps, rounded at each" in sentence(scene, run)
    times = np.append(0.0, np.cumsum(np.full(scene.steps, scene.step)))[:: scene.every]
    verdicts = {v.check: v for v in checks.judge(scene, replace(run, t=times))}
    assert verdicts["step-defect"].passed is True
    assert verdicts["closed-form"].passed is None
    assert [name for name, v in verdicts.items() if v.passed is False] == ["times"]
    # products are no sums, and another motion is none of either
    off = replace(run, t=times, p=run.p * (1 + 1e-13 * (np.arange(len(run.p)) == 30))[:, None])
    assert {v.check: v for v in checks.judge(scene, off)}["step-defect"].passed is False
    right = replace(springcheck.simulate(scene, "own:velocity-verlet"), t=times)
    assert {v.check: v for v in checks.judge(scene, right)}["step-defect"].passed is False


def test_a_file_of_a_clock_that_adds_up_its_steps_is_judged_at_its_times(tmp_path: Path) -> None:
    scene = replace(scenes.load_scene("driven-spring"), steps=400, quantities=("q", "p"))
    run, _ = of_summed_time(scene)
    times = np.append(0.0, np.cumsum(np.full(scene.steps, scene.step)))
    for name, t, failed in (("sums", times, set[str]()), ("products", run.t, {"step-defect"})):
        rows = np.column_stack([t, run.q, run.p])
        path = tmp_path / f"{name}.csv"
        np.savetxt(path, rows, fmt="%.17g", delimiter=",", header="t,q,p", comments="")
        found = file.judge(path, scene=scene, scheme="velocity-verlet")
        wrong = {v.check for v in found.verdicts if v.passed is False}
        assert bool(wrong) == (name == "products")
        assert wrong >= failed
        assert any("sums of steps" in note for note in found.notes) == (name == "sums")


@pytest.mark.parametrize("fault", table.DRIVES, ids=lambda fault: fault.name)
def test_a_drive_that_is_wrong_is_rejected_and_named(fault: Any) -> None:
    scene = table.scene(fault.scene)
    assert MISPLACED[fault.name] in sentence(scene, fault.run(scene))


@pytest.mark.parametrize(
    ("scheme", "other", "said"),
    [
        ("semi-implicit-euler", "semi-implicit-euler-drift-kick", ""),
        ("explicit-euler", "implicit-euler", ""),
        ("semi-implicit-euler", "late", "the end of the step where semi-implicit Euler, kick-drift takes it"),
    ],
)
def test_another_scheme_is_not_taken_for_another_time(scheme: str, other: str, said: str) -> None:
    scene = replace(scenes.load_scene("driven-spring"), steps=60)
    law = schemes.SCHEMES[scheme]
    if other == "late":
        run = steppers.record(scene, law, table.clocked(Case(scene=scene, scheme=law, x=0.0), 1.0))
    else:
        run = steppers.record(scene, law, steppers.textbook(scene, schemes.SCHEMES[other]))
    why = sentence(scene, run)
    assert (said in why) if said else ("Diagnosis: the drive" not in why)


def ours(q: Any, p: Any, h: float, force: Any, mass: Any) -> tuple[Any, Any]:
    p = p + h / 2 * force(q, p)
    q = q + h * p / mass
    return q, p + h / 2 * force(q, p, force.t + h)


def forgetful(q: Any, p: Any, h: float, force: Any, mass: Any) -> tuple[Any, Any]:
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return q, p + h / 2 * force(q)


def test_a_function_is_told_the_time_and_judged_by_where_it_takes_it() -> None:
    scene = replace(scenes.load_scene("driven-spring"), steps=60)
    scene = scene.system.without("damping").scene
    engines.bring(function.engine([f"{__name__}:ours", f"{__name__}:forgetful"]), "here")
    right, wrong = (springcheck.simulate(scene, f"stepper:{name}") for name in ("ours", "forgetful"))
    assert right.scheme == wrong.scheme == "velocity-verlet"
    assert not [v for v in checks.judge(scene, right) if v.passed is False]
    assert "the start of the step, used throughout" in sentence(scene, wrong)


@pytest.mark.parametrize("label", ["scipy:radau", "scipy:dop853", "sundials:adams", "sundials:bdf"])
def test_solvers_with_a_time_of_their_own_keep_their_tolerance(label: str, need: Any) -> None:
    need(label)
    scene = replace(scenes.load_scene("driven-spring"), steps=100, tolerance=1e-9)
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, label))}
    assert found["tolerance"].passed is True


def uneven() -> Scene:
    """Two masses on springs, driven at two frequencies, the second at another distance from the wall."""
    return Scene(
        m=[3.7, 1.7], q=[0.3, 1.3], p=[0.7, -0.7], step=0.1, steps=120, every=3,
        terms=(WallSpring(i=ONE, k=2.9, at=0.2), Spring(a=[0], b=[1], k=[1.9], rest=[0.9]),
               Drive(i=[1, 0], amplitude=[0.43, 0.23], frequency=[0.87, 1.87], phase=[0.6, -0.3])),
    )  # fmt: skip


@pytest.mark.parametrize(
    "label",
    ["openmm:verlet", "openmm:leapfrog", "openmm:euler", "openmm:semi-implicit-euler", "openmm:nose-hoover",
     "lammps:external", "lammps:bond"],
)  # fmt: skip
@pytest.mark.parametrize("step", [0.1, -0.07])
def test_engines_take_drives_where_their_schemes_do(label: str, step: float, need: Any) -> None:
    need(label)
    scene = replace(uneven(), step=step)
    verdicts = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, label))}
    assert verdicts["step-defect"].passed is True
    assert not [v.check for v in verdicts.values() if v.passed is False]


def test_a_driven_particle_with_friction_is_moved_by_langevin_dynamics_at_no_temperature(need: Any) -> None:
    need("openmm:langevin-middle")
    scene = replace(scenes.load_scene("driven-spring"), steps=60)
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, "openmm:langevin-middle"))}
    assert found["step-defect"].passed is True


def test_openmm_with_its_time_held_over_a_step_of_four_stages_is_told(need: Any) -> None:
    """RK4 of a CustomIntegrator whose global parameter is set from outside, before each step."""
    need("openmm:verlet")
    mm = pytest.importorskip("openmm")
    scene = driven(3.7, 2.9, 0.0, (0.43, 0.87, 0.6), steps=40)
    system, h = mm.System(), scene.step
    system.addParticle(3.7)
    force = mm.CustomExternalForce("0.5*2.9*x^2-0.43*cos(0.87*time+0.6)*x")
    force.addGlobalParameter("time", 0.0)
    force.addParticle(0, [])
    system.addForce(force)
    rk4 = mm.CustomIntegrator(h)
    for name in ("x0", "v0", "k1", "k2", "k3", "l1", "l2", "l3"):
        rk4.addPerDofVariable(name, 0)
    for name, what in (
        ("x0", "x"), ("v0", "v"), ("k1", "v"), ("l1", "f/m"), ("x", "x0+dt/2*k1"), ("k2", "v0+dt/2*l1"),
        ("l2", "f/m"), ("x", "x0+dt/2*k2"), ("k3", "v0+dt/2*l2"), ("l3", "f/m"), ("x", "x0+dt*k3"),
        ("v", "v0+dt*(l1+2*l2+2*l3+f/m)/6"), ("x", "x0+dt*(k1+2*k2+2*k3+v0+dt*l3)/6"),
    ):  # fmt: skip
        rk4.addComputePerDof(name, what)
    context = mm.Context(system, rk4, mm.Platform.getPlatformByName("Reference"))
    context.setPositions([[0.3, 0, 0]])
    context.setVelocities([[0.7 / 3.7, 0, 0]])
    states = [(0.3, 0.7)]
    for i in range(scene.steps):
        context.setParameter("time", i * h)
        rk4.step(1)
        state = context.getState(positions=True, velocities=True)
        states.append((state.getPositions()[0][0]._value, 3.7 * state.getVelocities()[0][0]._value))
    q, p = np.array(states).T[:, :, None]
    run = steppers.trajectory(scene, schemes.SCHEMES["rk4"], q, p)
    assert "the start of the step, used throughout, where classical Runge-Kutta (RK4)" in sentence(scene, run)


HALF_A_TURN = (3.7 * ((2 - 1e-12) / 0.1) ** 2, 0.0, 31.41592, 0.1)
"""A step of velocity Verlet and of semi-implicit Euler is half a turn less 2e-6, and the drive is near it."""

TURNING = [
    (2.9, 0.11, 0.87, 0.1), (2.9, 0.0, W, 0.1), (2.9, 0.11, -0.87, -0.07), (2.9, 40.0, 3.0, 0.1),
    (-2.9, 0.0, 0.87, 0.1), (2.9, 0.0, 31.0, 0.3), (2.9, 0.11, 0.0, 0.1), HALF_A_TURN,
]  # fmt: skip


@pytest.mark.campaign
@pytest.mark.parametrize(("k", "c", "frequency", "step"), TURNING)
@pytest.mark.parametrize("name", ["explicit-euler", "semi-implicit-euler", "velocity-verlet", "rk4",
                                  "implicit-midpoint", "implicit-euler", "yoshida4"])  # fmt: skip
def test_the_closed_form_of_a_driven_scheme_is_where_its_steps_lead(
    name: str, k: float, c: float, frequency: float, step: float
) -> None:
    """Answer and free motion of the map, against its steps in extended precision, at its resonance too."""
    law = schemes.SCHEMES[name]
    scene = driven(3.7, k, c, (0.43, frequency, 0.6), step=step, steps=200)
    if name == "semi-implicit-euler" and frequency == W:
        alone = checks.Case(trajectory=rest(scene, law), scene=scene).undriven
        turn = float(schemes.rotation(alone.law.propagator).angle[0])
        scene = driven(3.7, k, c, (0.43, turn / step, 0.6), step=step, steps=200)
    case = checks.Case(trajectory=rest(scene, law), scene=scene)
    if checks.closed_form(case).passed is None:
        pytest.skip("a step that reverses orientation")
    q, p = (x.astype(np.longdouble) for x in (scene.q, scene.p))
    clocked = case.clocked
    state = [np.append(x, y)[None] for x, y in ((q, 0), (p, drives_clock(clocked)))]
    most = 0.0
    u, v = case.undriven.system.modes.from_centres(*case.closed_states)
    for i in range(1, scene.steps + 1):
        state = list(clocked.step(*state))
        size = max(1, float(np.max(np.abs(state[0][0, :1]))), float(np.max(np.abs(state[1][0, :1]))))
        most = max(
            most, *(float(np.abs(a[i, 0] - b[0, 0])) / size for a, b in ((u, state[0]), (v, state[1])))
        )
    # some roundings of extended precision for each step, beside the largest state so far
    assert most < 2000 * 200 * np.finfo(np.longdouble).eps


def drives_clock(case: checks.Case) -> float:
    return float(case.trajectory.p[0, -1])


def rest(scene: Scene, law: schemes.Scheme) -> Any:
    return steppers.record(scene, law, steppers.textbook(scene, law))


def off(scene: Scene, name: str, x: float, row: int) -> Scene:
    """The scene with one number of one row of its drive off by x as `Limits` counts."""
    (term,) = (one for one in scene.terms if one.kind == "drive")
    field = "phase" if name == "late" else name
    values = getattr(term, field).copy()
    how = {"phase": 1.0, "late": float(term.frequency[row]) * scene.step}  # type: ignore[attr-defined]
    values[row] += x * how.get(name, values[row])
    changed: Any = replace(term, **{field: values})  # type: ignore[type-var]
    return replace(scene, terms=tuple(changed if one is term else one for one in scene.terms))


@pytest.mark.campaign
@pytest.mark.parametrize("which", ["driven-spring", "uneven"])
@pytest.mark.parametrize("law", ["semi-implicit-euler", "velocity-verlet", "rk4"])
def test_what_would_be_seen_of_a_drive_is_seen_at_twice_its_size(which: str, law: str) -> None:
    scene = replace(uneven() if which == "uneven" else scenes.load_scene(which), every=1, steps=100)
    (term,) = (one for one in scene.terms if one.kind == "drive")
    scheme = schemes.SCHEMES[law]
    right = {v.check: v for v in checks.judge(scene, rest(scene, scheme))}
    told = 0
    for check in ("step-defect", "closed-form"):
        assert right[check].passed is True
        for name in ("amplitude", "frequency", "phase", "late"):
            limit = getattr(right[check].sees, name)
            if limit is None:
                continue
            told += 1
            each = range(len(term))
            found = [by(check, scene, off(scene, name, 2 * limit, row), scheme) for row in each]
            assert not any(found), (check, name, limit)
            # of several drives the limit is that of the one that shows least
            assert any(by(check, scene, off(scene, name, limit / 10, row), scheme) for row in each)
    assert told == 8


def by(check: str, scene: Scene, other: Scene, scheme: schemes.Scheme) -> bool | None:
    """Whether the states of another scene pass a check as those of this one."""
    one = next(x for x in checks.CHECKS if x.name == check)
    run = replace(rest(other, scheme), energy=None)
    return checks.judge(replace(scene, quantities=("q", "p")), run, [one])[0].passed


@pytest.mark.parametrize(("k", "c"), [(4.0, 4.0), (4.0, 4.0 * (1 + 1e-13)), (0.0, 1e-8)])
@pytest.mark.parametrize("label", ["own:euler", "own:implicit-midpoint", "own:rk4"])
def test_eigenvalues_that_nearly_meet_have_no_closed_form_here_and_blame_nobody(
    label: str, k: float, c: float
) -> None:
    scene = driven(1.0, k, c, (1.0, 2.0 if k else 1e-9, 0.0), q=[1.0], p=[0.0], steps=100)
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, label))}
    assert [v for v in found.values() if v.passed is False] == []
    assert found["step-defect"].passed is True
    assert "neither oscillates nor grows" in found["closed-form"].why


def test_a_driven_mode_that_neither_turns_nor_grows_has_no_closed_form_here() -> None:
    scene = driven(3.7, 0.0, 0.0, (0.43, 0.87, 0.6))
    found = checks.closed_form(
        checks.Case(trajectory=rest(scene, schemes.SCHEMES["velocity-verlet"]), scene=scene)
    )
    assert found.passed is None
    assert "neither oscillates nor grows" in found.why


def test_the_check_of_the_drive_holds_its_tongue_where_the_spring_is_wrong() -> None:
    scene = table.scene("driven")
    wall = next(term for term in scene.terms if isinstance(term, WallSpring))
    stiffer = scene.derived(
        terms=tuple(replace(x, k=x.k * (1 + 1e-9)) if x is wall else x for x in scene.terms)
    )
    found = {v.check: v for v in checks.judge(scene, springcheck.simulate(stiffer, "own:velocity-verlet"))}
    assert found["step-defect"].passed is False
    assert found["drive"].passed is None
    assert "time of the drive" in found["drive"].why


def test_a_drive_of_two_steps_before_is_said_to_be_earlier() -> None:
    """It was said to be "taken -2 of a step later"."""
    scene = driven(3.7, 2.9, 0.0, (0.43, 0.87, 0.6))
    run = springcheck.simulate(scene, "own:semi-implicit-euler")
    before = replace(
        scene,
        terms=tuple(
            replace(x, phase=x.phase - 2.25 * scene.step * x.frequency) if isinstance(x, Drive) else x
            for x in scene.terms
        ),
    )
    early = replace(springcheck.simulate(before, "own:semi-implicit-euler"), label=run.label)
    found = {v.check: v for v in checks.judge(scene, early)}
    assert "the drive is taken 2.25 steps earlier than semi-implicit Euler" in found["drive"].why


@pytest.mark.parametrize("label", ["scipy:rk45", "sundials:adams"])
def test_a_solver_is_not_asked_to_follow_a_drive_for_ever(label: str, need: Any) -> None:
    need(label)
    scene = driven(3.7, 2.9, 0.0, (0.43, 0.87, 0.6))
    fast = tuple(replace(x, frequency=[1e300]) if isinstance(x, Drive) else x for x in scene.terms)
    with pytest.raises(MethodError, match="the drive turns through"):
        springcheck.simulate(replace(scene, terms=fast), label)


def test_an_axis_along_which_all_rests_is_not_exercised() -> None:
    scene = scenes.load_scene("orbit")
    still = replace(scene, q=[0.3, 0.0, 0.8], p=[0.7, 0.0, -0.4])
    assert "axis y" in checks.not_exercised(still)
    assert "ax" not in checks.not_exercised(scene)
    # a bath moves what rests
    assert "axes y and z" in checks.not_exercised(scenes.load_scene("bath-uneven"))


@pytest.mark.parametrize(
    "table", ["[[spring]]\nends = ['wall', 0]\nstiffness = 2.9", "[[drive]]\nparticle = 0"]
)
def test_an_axis_that_is_none_is_answered_with_those_that_are(table: str) -> None:
    given = f"{table}\naxis = 'w'\n[[particle]]\nmass = 1.3\nposition = [0.3, 0.1]\nmomentum = [0.1, 0.2]\n"
    with pytest.raises(SceneError, match=r"\.axis = 'w': one of x, y, z is needed"):
        scenes.parse(f"title = 'a'\n{given}[time]\nstep = 0.1\nsteps = 20\n", name="a")


@pytest.mark.parametrize(
    ("late", "said"),
    [
        (-37.0, "from step 37 on the time of the drive is 0 again"),
        (0.3, "from step 37 on the drive is taken 0.3 steps later"),
    ],
)
def test_a_drive_that_another_time_moves_from_some_step_on_is_told(late: float, said: str) -> None:
    """As a program that is restarted from a frame, and counts its steps from there."""
    scene = replace(scenes.load_scene("driven-spring"), steps=80)
    right = springcheck.simulate(scene, "own:velocity-verlet")
    drive = next(x for x in scene.terms if x.kind == "drive")
    phase = drive.phase + drive.frequency * scene.step * (37 + late)  # type: ignore[attr-defined]
    terms = tuple(replace(x, phase=phase) if x is drive else x for x in scene.terms)  # type: ignore[call-arg]
    again = scene.derived(q=right.q[37], p=right.p[37], steps=43, terms=terms)
    rest = springcheck.simulate(again, "own:velocity-verlet")
    q, p = (np.concatenate([getattr(right, x)[:37], getattr(rest, x)]) for x in "qp")
    assert said in sentence(scene, replace(right, q=q, p=p))
