"""Motions right but at a few steps: which these are is said, and no cause that acts in every step."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import checks, driver
from springcheck.checks import Case, causes
from springcheck.identify import Identification, identify
from springcheck.identify.files import sentence, shown
from springcheck.physics import scenefile
from springcheck.physics.arrays import Floats
from springcheck.physics.exact import true_motion
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

M, H, FRAMES = np.array([3.7, 1.9, 12.3]), 0.07, 301
Act = Callable[[int, Floats, Floats], Any]
"""Velocities after step n at positions q, from those before."""


def pull(q: Floats) -> Floats:
    """Force of a chain of three masses between two walls."""
    a, b, c, d = 2.9 * (q[0] - 0.2), 5.3 * (q[1] - q[0] - 1.1), 1.7 * (q[2] - q[1] - 0.7), 0.9 * (q[2] - 2.5)
    return np.array([b - a, c - b, -c - d])


def chain(act: Act, drive: float = 0.0, frames: int = FRAMES) -> tuple[Floats, Floats, Floats]:
    """Times, positions and velocities of the chain by velocity Verlet; a force cos 1.1 t may drive a mass."""
    q, v = np.array([0.35, 1.3, 2.2]), np.array([0.7, -0.4, 1.1]) / M
    states, force = [(q, v)], pull(q)
    for n in range(1, frames):
        v = v + H / 2 * force / M
        q = q + H * v
        force = pull(q) + drive * np.cos(1.1 * H * n) * np.array([1.0, 0.0, 0.0])
        v = act(n, q, v + H / 2 * force / M)
        states.append((q, v))
    q, v = (np.array(x) for x in zip(*states, strict=True))
    return H * np.arange(frames), q, v


def seen(act: Act, mass: Floats | None = M, **changes: Any) -> Identification:
    t, q, v = chain(act, **changes)
    return identify(t, q, v=v, mass=mass)


def every(steps: int, act: Callable[[Floats, Floats], Floats]) -> Act:
    return lambda n, q, v: act(q, v) if n % steps == 0 else v


def at_rest(q: Floats, v: Floats) -> Floats:
    return np.asarray(v - M @ v / np.sum(M))


def half_lost(q: Floats, v: Floats) -> Floats:
    return np.asarray(v - H / 2 * pull(q) / M)


ONE_MAP = "The coupled motion is that of one map of all coordinates, but not from frame "


@pytest.mark.parametrize("steps", [10, 40, 100])
def test_a_drift_removed_at_some_steps_of_a_chain_is_no_drive(steps: int) -> None:
    """It was "a force from outside", of a frequency of the chain's own."""
    said = seen(every(steps, at_rest), None if steps == 40 else M).statement
    assert said.startswith(f"{ONE_MAP}{steps - 1} to {steps}, and so every {steps} frames: there all")
    assert said.endswith("as where the drift of the centre of mass is removed")


@pytest.mark.parametrize("steps", [25, 50])
def test_half_a_kick_lost_at_some_steps_of_a_chain_is_no_drive_and_no_noise(steps: int) -> None:
    assert (
        seen(every(steps, half_lost)).statement
        == f"{ONE_MAP}{steps - 1} to {steps}, and so every {steps} frames"
    )
    assert seen(every(steps, lambda q, v: 0.99 * v)).statement.endswith(
        ": there all velocities are multiplied by 0.99"
    )


def test_two_interruptions_and_those_of_a_longer_run_are_told_and_are_no_exchange() -> None:
    said = seen(every(140, at_rest)).statement
    assert said.startswith(f"{ONE_MAP}139 to 140, from frame 279 to 280: there all velocities change by the")
    # two velocities were said to have changed places in 35 frames
    assert "and so every 37 frames" in seen(every(37, at_rest), frames=901).statement


def test_what_acts_in_every_step_of_a_chain_or_at_many_irregular_ones_is_no_interruption() -> None:
    rng = np.random.default_rng(3)
    kicks: tuple[Act, ...] = (
        lambda n, q, v: v + 1e-3 * rng.standard_normal(3),
        lambda n, q, v: v * (0.9 if n * 7919 % 101 < 10 else 1.0),
    )
    assert not any(seen(act).statement.startswith(ONE_MAP) for act in kicks)
    assert not seen(lambda n, q, v: v, drive=0.3).statement.startswith(ONE_MAP)


@pytest.mark.parametrize(
    ("rate", "whose"),
    [(0.0, ""), (0.03, ""), (None, " of Velocity Verlet")],
    ids=["of no scheme", "of no scheme, damped", "of a scheme"],
)
def test_a_kick_in_a_motion_of_one_map_is_told_with_the_scheme_of_that_map_if_there_is_one(
    rate: float | None, whose: str
) -> None:
    a = 2.9 / 3.7 * 0.31**2
    b = np.array([[1 - a / 2, 1.0], [-a * (1 - a / 4), 1 - a / 2]])
    if rate is not None:
        b = np.array([[0.9, 0.3], [-0.35, 0.93]])
        b *= np.sqrt((1 - rate) / np.linalg.det(b))
    states = [np.array([1.3, 0.4])]
    for n in range(100):
        states.append(b @ states[-1] + np.array([0.0, 0.01 * (n == 50)]))
    q, v = np.array(states).T
    found = identify(0.31 * np.arange(101), q + 7.3, v=v / 0.31, mass=3.7)
    assert (
        found.statement
        == f"The motion is one{whose}, but for one kick of +0.0323 of the velocity at frame 51"
    )


def one(act: Callable[[int, float, float], float], frames: int = 180) -> str:
    """What is said of one mass on a spring, by velocity Verlet, whose velocity `act` changes."""
    q, v = 0.3, 0.7 / 3.7
    states = [(q, v)]
    for n in range(1, frames):
        v -= 0.05 * 2.9 * q / 3.7
        q += 0.1 * v
        v = act(n, q, v - 0.05 * 2.9 * q / 3.7)
        states.append((q, v))
    x = np.array(states)
    return identify(0.1 * np.arange(frames), x[:, 0], v=x[:, 1], mass=3.7).statement


@pytest.mark.parametrize("frames", [180, 201])
def test_velocities_rescaled_at_some_steps_are_no_one_kick_at_all_of_them(frames: int) -> None:
    """The last frame of 201 is rescaled, too."""
    said = one(lambda n, q, v: 0.9 * v if n % 50 == 0 else v, frames)
    assert said.endswith("but its velocity is multiplied by 0.9 at frame 50, and so every 50 frames")


def test_what_happens_at_the_last_frame_is_no_kick_of_which_nothing_follows() -> None:
    said = one(lambda n, q, v: 1.01 * v if n == 179 else v)
    of = "The motion is one of Velocity Verlet, but frame 179, the last, is wrong: its velocity is off by "
    assert re.fullmatch(rf"{of}0\.00\d+ of the state's size", said)


def test_kicks_are_said_to_be_one_where_they_are() -> None:
    said = one(lambda n, q, v: v + 0.01 * (n % 50 == 0))
    assert said.endswith("but for one kick of +0.01 of the velocity at frame 50, and so every 50 frames")
    # a hundredth of one of them
    said = one(lambda n, q, v: v + 0.01 * (n % 50 == 0) * (1 + 0.01 * (n == 100)))
    assert "but for kicks of +0.01 to +0.0101 of the velocity at frame 50" in said
    # half a step's kick lost, and at one frame more than that
    half = 0.05 * 2.9 / 3.7
    assert "half a step" in one(lambda n, q, v: v + half * q * (n % 50 == 0))
    said = one(lambda n, q, v: v + half * q * (n % 50 == 0) * (1 + 0.1 * (n == 100)))
    assert "and 2 more, not all like it, at frames 100, 150" in said


def verlet(q: float, v: float, frames: int) -> Floats:
    """States (frames, 2) on a spring of w**2 = 1.3."""
    out = [(q, v)]
    for _ in range(frames - 1):
        v -= 0.155 * 1.3 * q
        q += 0.31 * v
        v -= 0.155 * 1.3 * q
        out.append((q, v))
    return np.array(out)


def test_a_restart_from_few_digits_is_told_with_their_number() -> None:
    before = verlet(0.7, 0.3, 60)
    q, v = np.concatenate([before, verlet(*np.round(before[-1], 4), 61)[1:]]).T
    assert identify(0.31 * np.arange(120), q, v=v).statement == (
        "The motion of Velocity Verlet jumps by 6.8e-05 of its size between frames 59 and 60, as after a "
        "restart from numbers of 4 digits"
    )


@pytest.mark.parametrize(
    ("lost", "said"), [(1, "frame 40 is missing"), (3, "3 frames are missing from frame 40 on")]
)
def test_frames_that_are_missing_are_counted(lost: int, said: str) -> None:
    q, v = np.delete(verlet(0.7, 0.3, 120), range(40, 40 + lost), axis=0).T
    found = identify(0.31 * np.arange(len(q)), q, v=v)
    assert found.statement == f"The motion is one of Velocity Verlet, but {said}"


def test_interruptions_of_unlike_kinds_are_not_said_to_be_alike() -> None:
    def act(n: int, q: float, v: float) -> float:
        return v * (0.9 if n in (60, 90) else 1)

    assert one(act).endswith("multiplied by 0.9 at frame 60, and 1 more like it, at frame 90")
    t, q, v = (np.arange(180), *np.zeros((2, 180)))
    q[0], v[0] = 0.3, 0.2
    for n in range(1, 180):
        v[n] = v[n - 1] - 0.05 * 0.78 * q[n - 1]
        q[n] = q[n - 1] + 0.1 * v[n]
        v[n] -= 0.05 * 0.78 * q[n]
        q[n] *= 1.01 if n == 77 else 1
        v[n] += 0.02 * (n == 100)
    said = identify(0.1 * t, q, v=v, mass=1.0).statement
    assert said.endswith("and 1 more, not all like it, at frame 100")


@cache
def right(name: str, steps: int, every: int = 1) -> tuple[Scene, Trajectory]:
    scene = replace(scenefile.load_scene(name), quantities=("q", "p")).derived(steps=steps, every=every)
    return scene, driver.run(scene, "own:velocity-verlet")


def interrupted(name: str, steps: int, act: Callable[[int, Floats], Any]) -> tuple[Scene, Trajectory]:
    """A scene, and a run whose momenta `act` changes after each step of velocity Verlet."""
    scene, run = right(name, steps)
    case, q, p = Case(trajectory=run, scene=scene), run.q.copy(), run.p.copy()
    for n in range(1, steps + 1):
        x, y = case.step(q[n - 1 : n].astype(np.longdouble), p[n - 1 : n].astype(np.longdouble))
        q[n], p[n] = x[0], act(n, y[0].astype(np.float64))
    return scene, replace(run, q=q, p=p)


def judged(scene: Scene, run: Trajectory, show: Any = shown) -> str:
    """The first failed verdict that tells schemes apart, with its cause."""
    verdicts = checks.explained(scene, run, checks.judge(scene, run), show)
    return next(v.why for v in verdicts if v.passed is False and v.check in checks.TELLING)


@pytest.mark.parametrize("name", ["chain", "pendulum", "spring-uneven"])
def test_few_steps_that_are_off_are_told_with_their_distance_before_any_other_cause(name: str) -> None:
    scene, run = interrupted(name, 120, lambda n, p: p * (1.01 if n % 30 == 0 else 1))
    why = judged(scene, run)
    assert "; the first of 4 frames off is at step 30, and so every 30 steps" in why
    assert "noise" not in why
    assert ("and so every 30" in checks.causes.found(Case(trajectory=run, scene=scene))) is True
    # what acts in every step does not explain them
    asked = []

    def show(scene: Scene, run: Trajectory, about: int, few: bool) -> str:
        asked.append((about, few))
        return ""

    assert "4 of 120 frames do not follow from the one before, the first at step 30" in judged(
        scene, run, show
    )
    assert asked == [(30, True)]


def test_what_acts_in_every_step_is_not_said_to_act_at_few() -> None:
    rng = np.random.default_rng(5)
    acts: tuple[Callable[[int, Floats], Any], ...] = (
        lambda n, p: p * (1 + 1e-9 * rng.standard_normal(len(p))),
        # of a size that most steps keep the bound
        lambda n, p: p * (1 + 2e-15 * rng.standard_normal(len(p)) ** 3),
        lambda n, p: p * (1.01 if n % 3 == 0 else 1),
    )
    for act in acts:
        scene, run = interrupted("chain", 120, act)
        assert causes.found(Case(trajectory=run, scene=scene)) == ""


def test_frames_of_a_cause_are_those_of_the_run() -> None:
    """Of a long run a part about the first step off is looked at, in which frames have other numbers."""
    scene, run = interrupted("spring-uneven", 1400, lambda n, p: p * (1.01 if n == 1000 else 1))
    assert "at frame 599; frames are counted from frame 401 of the run" in judged(scene, run)


@pytest.mark.parametrize("every", [1, 4])
def test_steps_of_the_scheme_in_another_number_are_a_cause(every: int) -> None:
    """Four substeps of h/4 were no cause at all, as the name of the scheme agrees."""
    scene, run = right("spring-uneven", 80, every)
    assert sentence(run, scene.m, np.array([2.9])) == ""
    finer = driver.run(scene.derived(step=scene.step / 4, steps=320, every=4 * every), run.label)
    said = sentence(replace(finer, every=every, step=scene.step), scene.m, np.array([2.9]))
    assert said.startswith(f"Velocity Verlet, {4 * every} steps to a frame")
    assert said.endswith(", of 0.025 and not of 0.1")


def test_the_exact_flow_has_no_step_that_is_another() -> None:
    scene, run = right("spring-uneven", 80, 4)
    q, p = true_motion(scene, 4 * np.arange(len(run.t)), scene.step)
    flow = replace(run, q=q.astype(np.float64), p=p.astype(np.float64), scheme="exact")
    assert identify(flow.t, flow.q, flow.p, mass=3.7, stiffness=2.9).scheme == "exact"
    assert sentence(flow, scene.m, np.array([2.9])) == ""


def test_a_stepper_of_four_substeps_is_said_to_be_one() -> None:
    def substeps(q: Any, p: Any, h: float, force: Any, mass: Any) -> Any:
        for _ in range(4):
            p = p + h / 8 * force(q)
            q = q + h / 4 * p / mass
            p = p + h / 8 * force(q)
        return q, p

    scene = right("spring-uneven", 80)[0]
    run = replace(springcheck.simulate(scene, substeps), scheme="velocity-verlet")
    assert "Velocity Verlet, 4 steps to a frame" in judged(scene, run)
