"""OpenMM's VariableVerletIntegrator takes the steps of its own rule, and gains the energy that these say."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springcheck
import variable_verlet
from springcheck import checks, schemes, store
from springcheck.checks import replayed
from springcheck.checks.check import Finding
from springcheck.engines.contract import Label, Stopped
from springcheck.engines.openmm import ENGINE, variable
from springcheck.engines.openmm.variable import Variable
from springcheck.errors import MethodError, SceneError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory, Verdict
from springcheck.schemes.variable import allowed, taken


@pytest.fixture(autouse=True)
def _openmm(need: Any) -> None:
    need("openmm:verlet")


@pytest.mark.parametrize("name", variable_verlet.SPRINGS)
def test_every_step_is_the_rules_own_and_changes_the_energy_by_its_law(name: str) -> None:
    worst, energy = variable_verlet.judged(*variable_verlet.SPRINGS[name], 300)
    assert worst <= 8
    assert energy <= 1e-13


@pytest.mark.parametrize("wrong", ["tolerance", "held", "doubled"])
def test_another_rule_is_not_that_of_its_steps(wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = variable_verlet.rule

    def other(push: Any, h: float, tolerance: float) -> float:
        if wrong == "tolerance":
            return right(push, h, tolerance * (1 + 1e-13))
        free = right(push, 0.0, tolerance)
        new = free if wrong == "doubled" or not h else min(free, 2 * h)
        return h if wrong == "doubled" and h < new < 1.2 * h else new

    monkeypatch.setattr(variable_verlet, "rule", other)
    worst, _ = variable_verlet.judged(*variable_verlet.SPRINGS["one spring along x"], 300)
    assert worst > 8


def test_the_gain_of_a_period_is_the_sum_over_its_steps_whatever_the_spring() -> None:
    measured, law = variable_verlet.gain(1e-3)
    assert measured == pytest.approx(law, abs=1e-12)
    # 0.12 % at a tolerance of a thousandth of the amplitude
    assert measured == pytest.approx(1.2188e-3, rel=1e-4)


LABEL = "openmm:variable-verlet"


def judged(scene: Scene) -> dict[str, Any]:
    return {v.check: v for v in checks.judge(scene, springcheck.simulate(scene, LABEL))}


@pytest.mark.campaign
@pytest.mark.parametrize("step", [0.1, -0.07])
@pytest.mark.parametrize("tolerance", [1e-2, 3e-4])
@pytest.mark.parametrize("name", ["spring-uneven", "chain", "orbit", "anharmonic"])
def test_between_frames_openmm_takes_the_steps_of_its_rule(name: str, tolerance: float, step: float) -> None:
    scene = replace(scenefile.load_scene(name), step=step, steps=40, tolerance=tolerance)
    found = judged(scene)
    assert found["replay"].passed is True
    assert not [v.check for v in found.values() if v.passed is False]
    assert found["step-defect"].passed is None


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_the_gain_of_energy_a_period_is_said_beside_the_sum_over_the_steps(tolerance: float) -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), step=0.37, steps=40, tolerance=tolerance)
    found = judged(scene)["energy-gain"]
    assert found.passed is True
    words = ("the fastest mode adds ", "by the sum over the steps ")
    measured, law = (float(found.why.partition(word)[2].split()[0].rstrip(",;")) for word in words)
    assert measured == pytest.approx(law, rel=1e-3)
    assert found.bound < 1e-8


def test_what_nothing_anchors_and_what_is_heavy_counts_in_the_mean_as_in_openmm() -> None:
    """Anchors are particles of OpenMM's own, over which its mean runs as well."""
    free = Scene(
        m=[3.7, 0.9], q=[0.0, 1.3], p=[0.4, -0.3], step=0.1, steps=40, tolerance=1e-3,
        terms=(Spring(a=[0], b=[1], k=[2.9], rest=[1.0]),),
    )  # fmt: skip
    held = replace(free, terms=(*free.terms, WallSpring(i=[0, 1], k=[0.7, 1.1], at=[0.1, 1.2])))
    for scene in (free, held):
        assert judged(scene)["replay"].passed is True


def test_a_tolerance_that_takes_too_many_steps_is_refused_and_one_that_takes_many_is_not_replayed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), steps=20, tolerance=1e-9)
    with pytest.raises(MethodError, match="at most 1e"):
        springcheck.simulate(replace(scene, steps=200, tolerance=1e-16), LABEL)
    # fewer than from one frame to the next
    monkeypatch.setattr(replayed, "MOST_REPLAYED", 100)
    found = judged(scene)
    assert found["replay"].passed is None
    assert "not replayed" in found["replay"].why
    assert found["tolerance"].passed is True


def test_a_first_step_where_no_force_acts_is_as_long_as_its_rule_has_it_and_no_fault() -> None:
    # the blog's spring starts at rest length, so that the first step is that of the frame
    scene = replace(scenefile.load_scene("spring"), tolerance=1e-10, steps=3)
    run = springcheck.simulate(scene, "openmm:variable-verlet")
    verdicts = {v.check: v for v in springcheck.judge(scene, run)}
    assert verdicts["replay"].passed, verdicts["replay"].why
    assert [name for name, v in verdicts.items() if v.passed is False] == []
    found = verdicts["tolerance"]
    # velocity Verlet's step of 0.1 from (0, 1)
    assert found.value == pytest.approx(np.hypot(0.1 - np.sin(0.1), 1 - 0.005 - np.cos(0.1)), rel=1e-3)
    assert found.bound < 1.1 * found.value
    late = replace(run, q=run.q + 2e-5)
    assert next(v for v in springcheck.judge(scene, late) if v.check == "tolerance").passed is False


def test_velocities_rebuilt_at_very_many_steps_round_further_than_the_tolerance_has_it() -> None:
    """A heavy particle's velocity hardly changes in a step, and is rounded to the same side by each."""
    text = """title = "heavy and light"
    [[particle]]
    mass = 45.67245110514776
    position = [-1.1303773996961162, 0.5255374733661]
    momentum = [13.103447623840557, 9.459179213833016]
    [[particle]]
    mass = 0.05382595543948841
    position = [-0.21981994167518804, 0.8958036768845374]
    momentum = [-0.3526089696035107, -0.193831047117073]
    [[spring]]
    ends = ["wall", 1]
    stiffness = 0.16475925197928978
    axis = "x"
    [[spring]]
    ends = ["wall", 1]
    stiffness = 1.8271435129666904
    axis = "y"
    [[spring]]
    ends = [0, 1]
    stiffness = 0.942448738513908
    [time]
    step = 0.0037520571195441086
    steps = 4
    tolerance = 1e-12"""
    scene = scenefile.parse(text, name="heavy", where="here")
    run = springcheck.simulate(scene, LABEL)
    found = checks.tolerance(checks.Case(trajectory=run, scene=scene))
    assert found.passed is True, found.why
    assert found.value > 2 * scene.tolerance * run.force_calls
    assert "rounding of velocities rebuilt from positions" in found.why
    assert found.bound < 1e-4
    late = replace(run, p=run.p * np.where(np.arange(len(run.t)) == 3, 1 + 1e-4, 1)[:, None])
    assert checks.tolerance(checks.Case(trajectory=late, scene=scene)).passed is False


def test_steps_by_a_rule_meet_the_times_of_frames_and_follow_the_rule_between() -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), tolerance=1e-4)
    scheme = schemes.SCHEMES["variable-verlet"]
    steps = list(
        taken(scheme, scene, (scene.q, scene.p), before=0.0, times=(0.0, 5.0), tolerance=allowed(scene))
    )
    lengths = np.array([step.h for step in steps])
    assert np.sum(lengths) == pytest.approx(5.0, rel=1e-14)
    # after the first ones, and but for the last
    assert np.max(lengths[1:] / lengths[:-1]) <= 2
    grown = lengths[1:-1] / lengths[:-2]
    assert not np.any((grown > 1) & (grown < 1.2))


def test_the_method_is_run_by_name_alone_and_known_as_adaptive() -> None:
    method = ENGINE.methods["variable-verlet"]
    assert method.adaptive
    assert not method.default
    assert schemes.scheme(method.scheme).has("adaptive")


def saddle(p: float, q: float = 0.5) -> Scene:
    """E = 0 for p = 0 and q = 1."""
    return Scene(
        m=[1.7, 1.7], q=[1.0, q], p=[p, 0.0], step=0.1, steps=20, tolerance=1e-3,
        terms=(WallSpring(i=[0, 1], k=[-1.0, 1.0], at=[0.0, 0.0]),),
    )  # fmt: skip


def test_a_gain_is_a_part_of_a_size_of_the_energy_where_the_energy_is_negative() -> None:
    scene = replace(scenefile.load_scene("inverted"), steps=60, tolerance=1e-3)
    for right in (scene, saddle(0.0), saddle(float(np.sqrt(0.75 * 1.7)))):
        found = judged(right)["energy-gain"]
        assert found.passed is True
        assert 0 < found.bound < 1e-6
    run = springcheck.simulate(saddle(0.0), LABEL)
    p = run.p.copy()
    p[6:] *= 1 + 1e-3
    assert [v.passed for v in checks.judge(saddle(0.0), replace(run, p=p)) if v.check == "energy-gain"] == [
        False
    ]


def test_nothing_that_moves_has_no_gain_and_openmm_takes_no_part_of_no_amplitude() -> None:
    still = replace(saddle(0.0), q=np.zeros(2))
    # a scene is refused as such where long double is no wider than double
    with pytest.raises((MethodError, SceneError), match=r"energy of (the|its) start is 0"):
        springcheck.simulate(still, LABEL)
    # where energies cancel, what the forces may give is an amplitude
    found = judged(saddle(0.0, 1.0))
    assert [found[name].passed for name in ("tolerance", "replay", "energy-gain")] == [True] * 3


def test_where_the_step_before_the_first_frame_is_not_known_none_is_replayed() -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), steps=40, tolerance=3e-3, step=0.5)
    run = springcheck.simulate(scene, LABEL)
    late = replace(run, t=run.t[7:], q=run.q[7:], p=run.p[7:], energy=None)
    found = {v.check: v for v in checks.judge(scene, late, piece=True)}
    for name in ("replay", "energy-gain"):
        assert found[name].passed is None
        assert "before its first frame" in found[name].why


def test_a_motion_that_escapes_in_finite_time_is_refused_and_one_that_stays_is_run() -> None:
    falls = Scene(
        m=[1.0],
        q=[1.0],
        p=[2.0],
        step=0.1,
        steps=100,
        tolerance=1e-3,
        terms=(Quartic(i=[0], b=[-1.0], at=[0.0]),),
    )
    with pytest.raises(MethodError, match="escapes to infinity"):
        springcheck.simulate(falls, LABEL)
    with np.errstate(all="ignore"):
        steps = list(taken(
            schemes.SCHEMES["variable-verlet"], falls, (np.array([1e200]), np.array([2.0])),
            before=0.0, times=(1.0, 2.0), tolerance=1e-3,
        ))  # fmt: skip
    assert not steps
    held = replace(
        falls,
        q=[0.3],
        p=[0.2],
        terms=(WallSpring(i=[0], k=[1.3], at=[0.0]), Quartic(i=[0], b=[-1.0], at=[0.0])),
    )
    assert judged(held)["replay"].passed is True


def test_a_soft_well_is_run_however_many_steps_it_takes_while_its_energy_is_below_the_barrier() -> None:
    well = Scene(
        m=[1.7], q=[0.3], p=[0.2], step=0.1, steps=200, tolerance=1e-6,
        terms=(WallSpring(i=[0], k=[1.3], at=[0.1]), Quartic(i=[0], b=[-1.0], at=[0.1])),
    )  # fmt: skip
    run = springcheck.simulate(well, LABEL)
    assert run.force_calls > 10_000
    assert run.outcome.status == "complete"
    # V = 1.69/4 at the top
    assert variable._barrier(well) == pytest.approx(1.3**2 / 4)
    for other in (
        replace(well, terms=well.terms[1:]),
        replace(well, q=[1.3]),
        replace(well, terms=(WallSpring(i=[0], k=[1.3], at=[0.2]), well.terms[1])),
        replace(well, terms=(*well.terms, well.terms[1])),
    ):
        assert variable._barrier(other) == 0
    with pytest.raises(MethodError, match="escapes to infinity"):
        springcheck.simulate(replace(well, p=[2.0]), LABEL)
    moving = Variable(
        well, ENGINE.methods["variable-verlet"], Label(engine="openmm", method="variable-verlet"), well.step
    )
    moving._most = 0.5 * float(well.system.energy(well.q, well.p))
    with pytest.raises(Stopped, match="nears that of a barrier") as stop:
        moving.advance(1, *np.zeros((2, 3, 1)))
    assert stop.value.rows == 1


def test_what_openmm_gives_up_is_a_run_that_stopped_with_the_frames_before() -> None:
    import openmm

    scene = replace(scenefile.load_scene("spring-uneven"), tolerance=1e-3)
    moving = Variable(
        scene, ENGINE.methods["variable-verlet"], Label(engine="openmm", method="variable-verlet"), scene.step
    )
    right, calls = moving._integrator.stepTo, []

    def once(time: float) -> None:
        calls.append(time)
        if len(calls) > 2:
            raise openmm.OpenMMException("Particle coordinate is NaN")
        right(time)

    moving._integrator.stepTo = once
    q, p = (np.zeros((4, scene.n)) for _ in "qp")
    with pytest.raises(Stopped, match="NaN") as stop:
        moving.advance(1, q, p)
    assert stop.value.rows == 2
    whole = springcheck.simulate(replace(scene, steps=2), LABEL)
    assert np.array_equal(p[:2], whole.p[1:3])


def test_a_file_that_claims_few_force_calls_is_replayed_no_longer_than_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), steps=3, step=2.0, tolerance=1e-4)
    run = replace(springcheck.simulate(scene, LABEL), force_calls=0)
    met: list[Any] = []

    def counted(*state: Any, **given: Any) -> Any:
        for step in taken(*state, **given):
            met.append(step)
            yield step

    monkeypatch.setattr(replayed, "taken", counted)
    monkeypatch.setattr(replayed, "MOST_REPLAYED", 200)
    found = {v.check: v for v in checks.judge(scene, run)}["replay"]
    assert "of 3 frames: more than 200 steps are not replayed" in found.why
    assert len(met) <= 3 * 201


def test_of_a_long_run_the_beginning_is_replayed_and_the_verdict_says_how_much(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), steps=40, tolerance=1e-3)
    run = springcheck.simulate(scene, LABEL)
    monkeypatch.setattr(replayed, "MOST_REPLAYED", run.force_calls // 2)
    for wrong_from, passed in ((None, True), (30, True), (10, False)):
        p = run.p.copy()
        if wrong_from:
            p[wrong_from:] *= 1 + 1e-6
        found = {v.check: v for v in checks.judge(scene, replace(run, p=p))}
        assert found["replay"].passed is passed
        if passed:
            for name in ("replay", "energy-gain"):
                assert found[name].passed is True
                assert "of 40 frames: more than" in found[name].why


@pytest.mark.parametrize(("tolerance", "steps"), [(1e-6, 20), (1e-7, 12)])
def test_a_right_engine_is_judged_to_its_end_by_steps_that_it_tells_else_to_one_that_hangs_on_roundings(
    tolerance: float, steps: int
) -> None:
    """26000 roundings of 19 in 60 frames: two sides of a step that is not known did not bracket it."""
    scene = replace(scenefile.load_scene("spring-uneven"), steps=steps, tolerance=tolerance)
    run = springcheck.simulate(scene, LABEL)
    told, silent = ({v.check: v for v in checks.judge(scene, x)} for x in (run, replace(run, last_step=None)))
    for name in ("replay", "energy-gain"):
        assert told[name].passed is silent[name].passed is True
        assert "replayed are the first" not in told[name].why
        words = f"of {steps} frames: the last step before the next hangs on roundings alone"
        assert words in silent[name].why


def replay(scene: Scene, run: Trajectory) -> Verdict:
    return next(one for one in checks.CHECKS if one.name == "replay")(
        checks.Case(trajectory=run, scene=scene)
    )


def test_a_last_step_that_is_not_what_the_times_and_the_rule_say_is_a_fault() -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), steps=20, tolerance=1e-3)
    run = springcheck.simulate(scene, LABEL)
    assert run.last_step is not None
    for row, wrong in itertools.product((5, 20), (1 + 1e-11, 1 - 1e-11, 2.0, 0.0, -1.0, np.nan, np.inf)):
        last = run.last_step.copy()
        last[row] *= wrong
        found = replay(scene, replace(run, last_step=last))
        assert found.passed is False
        assert f"recorded as the last before t = {scene.step * row:g} " in found.why
    # no step ends at the start
    assert replay(scene, replace(run, last_step=run.last_step + 1e-9 * (run.t == 0))).passed is False
    assert replay(scene, run).passed is True


def test_a_step_left_over_by_roundings_alone_is_followed_where_it_is_told() -> None:
    """Steps come to a frame's time but for 9e-16, which is a step too."""
    scene = replace(scenefile.load_scene("spring-uneven"), steps=200, tolerance=1e-3)
    run = springcheck.simulate(scene, LABEL)
    assert run.last_step is not None
    row = int(np.argmin(run.last_step[1:])) + 1
    assert run.last_step[row] < 1e-14
    near = run.at(slice(row - 3, row + 4))
    case = checks.Case(trajectory=near, scene=scene, piece=True)
    found = replayed.replay.judge(case)
    assert isinstance(found, Finding)
    assert found.value <= found.bound


def test_a_rule_off_by_1e_12_shows_in_the_steps_that_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(scenefile.load_scene("anharmonic"), steps=40, tolerance=1e-3)
    other = springcheck.simulate(replace(scene, tolerance=1e-3 * (1 + 1e-12)), LABEL)
    for told, passed in ((other.last_step, False), (None, True)):
        run = replace(other, tolerance=1e-3, last_step=told)
        assert replay(scene, run).passed is passed


def test_a_file_keeps_the_last_steps_and_its_pieces_are_replayed_from_where_they_begin(
    tmp_path: Path,
) -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), steps=40, tolerance=1e-3)
    run = springcheck.simulate(scene, LABEL)
    assert run.last_step is not None
    assert run.last_step[0] == 0
    assert np.all(run.last_step[1:] <= scene.step * (1 + 1e-14))
    with store.open_new(tmp_path / "s.h5", "test") as journal:
        journal.save(run, scene)
        journal.save(replace(run, label="silent", last_step=None), scene)
    assert store.check(tmp_path / "s.h5") == []
    kept = store.read(tmp_path / "s.h5")
    assert np.array_equal(kept[LABEL].last_step, run.last_step)
    assert kept["silent"].last_step is None
    first, *later = store.windows(tmp_path / "s.h5", LABEL, 15)
    assert len(later) == 2
    for piece in (first, *later):
        assert replay(scene, piece).passed is True


def test_what_a_step_before_may_be_off_is_tried_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(scenefile.load_scene("spring-uneven"), steps=4, tolerance=1e-3)
    run = springcheck.simulate(scene, LABEL)
    before: list[float] = []

    def seen(*state: Any, **given: Any) -> Any:
        before.append(given["before"])
        return taken(*state, **given)

    monkeypatch.setattr(replayed, "taken", seen)
    checks.judge(scene, replace(run, last_step=None))
    first, *others = before
    assert first == 0
    assert len(others) == 3 * 3
    for right, more, less in zip(*(others[i::3] for i in range(3)), strict=True):
        assert less < right < more


@pytest.mark.parametrize(("tolerance", "steps"), [(1e-3, 12), (1e-6, 3)])
def test_a_replay_says_how_far_a_momentum_may_be_off_and_sees_it_from_there_on(
    tolerance: float, steps: int
) -> None:
    """Its roundings grow with the number of steps, and with the inverse of their length."""
    scene = replace(scenefile.load_scene("spring-uneven"), steps=steps, tolerance=tolerance)
    run = springcheck.simulate(scene, LABEL)

    def off(by: float, frame: int) -> Any:
        p = run.p.copy()
        p[frame] += by * np.max(np.abs(p))
        return checks.replay(checks.Case(trajectory=replace(run, p=p), scene=scene))

    why = off(0, 1).why
    assert "rebuilt from positions at every step" in why
    least = float(why.split("a momentum off by ")[1].split()[0])
    assert {off(sign * 1.1 * least, i).passed for i in range(1, steps + 1) for sign in (1, -1)} == {False}
    assert off(least / 100, steps // 2).passed is True


def test_a_step_is_not_blamed_where_roundings_have_grown_beyond_all_forces() -> None:
    # two particles that nothing joins: no stiffness times an unknown time is no number
    springs = WallSpring(i=[0, 1], k=[1.3, 2.9], at=[0.0, 0.1])
    scene = Scene(
        name="two", m=[1.0, 3.0], q=[0.3, 0.7], p=[0.2, -0.4], terms=(springs,), step=0.1, steps=40, every=20,
        tolerance=1e-3,
    )  # fmt: skip
    run = springcheck.simulate(scene, "openmm:variable-verlet")
    assert run.last_step is not None
    case = checks.Case(trajectory=run, scene=scene)
    times, last = (0.0, float(case.steps[1] * run.step)), float(run.last_step[1])
    start = np.asarray(scene.q, np.longdouble), np.asarray(scene.p, np.longdouble)
    by = {"before": 0.0, "times": times, "tolerance": allowed(scene), "last": last}
    steps = list(taken(case.scheme, scene, start, **by))
    for size, known in ((1e-16, True), (1e200, False)):
        bound = np.full(2, size, np.longdouble)
        with np.errstate(all="ignore"):
            untrue, _ = replayed._untrue(case, steps, [(bound, bound)] * (len(steps) + 1), 0.0, times)
        assert np.isfinite(untrue)
        assert (untrue > 0) is known
