"""The checks of recorded trajectories: no alarm on a right engine, at any scene and in any piece of a run;
bounds that are tight; and an answer, never an exception, where a check does not apply."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clean
import springcheck
import textbook as steppers
from springcheck import checks, schemes
from springcheck.checks.case import strongest
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import WIDE, Arithmetic
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.physics.trajectory import Trajectory, Verdict

Need = Callable[[str], None]

PLAIN = [
    name for name, s in schemes.SCHEMES.items() if s.has("one-step") and not s.has("mixes")
]  # fmt: skip
ENGINES = [
    "own:euler", "own:semi-implicit-euler", "own:implicit-euler", "openmm:verlet", "openmm:leapfrog",
    "openmm:euler", "openmm:semi-implicit-euler", "ase:velocity-verlet",
]  # fmt: skip


def plain(scene: Scene, name: str) -> Trajectory:
    scheme = schemes.SCHEMES[name]
    return steppers.record(scene, scheme, steppers.textbook(scene, scheme))


def alarms(verdicts: list[Verdict]) -> list[str]:
    return [f"{v.check} {v.value:.3g} of {v.bound:.3g}" for v in verdicts if v.passed is False]


@pytest.mark.campaign
@pytest.mark.parametrize("name", PLAIN)
def test_no_check_rejects_the_textbook_step_on_random_scenes(name: str) -> None:
    for seed in range(12):
        scene = clean.random_scene(np.random.default_rng([1, seed]))
        assert alarms(checks.judge(scene, plain(scene, name))) == [], seed


@pytest.mark.parametrize("label", ENGINES)
def test_no_check_rejects_an_engine_on_random_scenes(label: str, need: Need) -> None:
    need(label)
    for seed in range(12):
        scene = clean.random_scene(np.random.default_rng([2, seed]), steps=60)
        assert alarms(checks.judge(scene, springcheck.simulate(scene, label))) == [], seed


def part_of(run: Trajectory, rows: slice) -> Trajectory:
    """Some frames of a run, which say themselves where they end."""
    assert run.energy is not None
    end = round(float(run.t[rows][-1]) / run.step)
    status = run.outcome.status if end == run.outcome.step else "continued"
    outcome = replace(run.outcome, step=end, status=status)
    return replace(run, t=run.t[rows], q=run.q[rows], p=run.p[rows], energy=run.energy[rows], outcome=outcome)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["explicit-euler", "velocity-verlet", "implicit-euler", "rk4"])
def test_every_piece_of_a_long_run_is_judged_like_the_whole(name: str) -> None:
    for seed in range(8):
        rng = np.random.default_rng([3, seed])
        scene = clean.random_scene(rng)
        run = plain(scene, name)
        size = int(rng.integers(2, 30))
        pieces = [
            checks.judge(scene, part_of(run, slice(first, first + size + 1)), piece=True)
            for first in range(0, len(run.t), size)
        ]
        assert alarms(checks.worst(pieces)) == [], seed


@pytest.mark.parametrize("name", ["explicit-euler", "velocity-verlet"])
def test_a_run_that_ends_early_and_says_complete_fails_its_times(name: str) -> None:
    scene = scenes.load_scene("spring-uneven")
    run = plain(scene, name)
    assert run.energy is not None
    short = replace(run, t=run.t[:-3], q=run.q[:-3], p=run.p[:-3], energy=run.energy[:-3])
    verdicts = checks.judge(scene, short)
    assert [v.check for v in verdicts if v.passed is False] == ["times", "grid"]
    (times,) = (v for v in verdicts if v.check == "times")
    assert times.value == pytest.approx(3 * scene.step)


def test_a_slip_between_two_pieces_shows_in_the_closed_form_of_those_after_it() -> None:
    scene = replace(scenes.load_scene("spring-uneven"), steps=100)
    run = plain(scene, "velocity-verlet")
    late = slice(50, None)
    q = run.q[late] + 1e-11
    piece = replace(run, t=run.t[late], q=q, p=run.p[late], energy=scene.system.energy(q, run.p[late]))
    assert any(alarm.startswith("closed-form") for alarm in alarms(checks.judge(scene, piece, piece=True)))


@pytest.mark.skipif(not WIDE, reason="where references round like doubles, they are the textbook's numbers")
def test_the_step_defect_s_bound_is_within_a_thousand_times_of_what_is_seen() -> None:
    ratios = []
    for seed in range(40):
        scene = replace(clean.random_scene(np.random.default_rng([4, seed])), every=1)
        for v in checks.judge(scene, plain(scene, "velocity-verlet"), [checks.step_defect]):
            assert v.check == "step-defect"
            ratios.append(v.bound / v.value)
    assert np.median(ratios) < 100
    assert max(ratios) < 1e4


@pytest.mark.parametrize(("precision", "steps"), [("double", 200), ("mixed", 200), ("single", 200)])
def test_the_arithmetic_of_opencl_is_the_one_it_is_said_to_have(
    precision: str, steps: int, need: Need, whole: bool
) -> None:
    label = f"openmm:verlet@OpenCL-{precision}"
    need(label)
    seen = []
    # kernels are compiled for every scene, two seconds each
    for seed in range(6 if whole else 2):
        scene = clean.random_scene(np.random.default_rng([6, seed]), decades=1.5, steps=steps)
        run = springcheck.simulate(scene, label) if scene.step > 0 else None
        if run is None or np.max(scene.system.magnitude()(run.q, run.p)) > run.arithmetic.overflow:
            continue
        verdicts = checks.judge(scene, run)
        assert alarms(verdicts) == [], seed
        seen += [v for v in verdicts if v.check == "arithmetic" and v.passed is not None]
    assert seen


def test_fixed_point_forces_lose_up_to_one_quantum_for_each_spring_and_no_more(need: Need) -> None:
    label = "openmm:verlet@OpenCL-double"
    need(label)
    scene = scenes.load_scene("chain")
    case = checks.Case(trajectory=springcheck.simulate(scene, label), scene=scene)
    lost = np.max(np.abs(case.next_states[1] - case.trajectory.p[1:])) / scene.step / 2.0**-32
    # two springs pull at each particle, and what is cut off is spread evenly below one quantum
    assert 1 < lost < 2


def test_an_arithmetic_that_cannot_show_is_not_judged() -> None:
    scene = clean.scene(
        np.array([1.7]), (clean.walls(np.zeros(1), np.zeros(1)),), np.ones(1), np.ones(1), step=0.1, steps=50
    )
    fixed = Arithmetic(name="fixed", quantum=2.0**-32)
    run = replace(plain(scene, "velocity-verlet"), arithmetic=fixed)
    verdict = next(v for v in checks.judge(scene, run) if v.check == "arithmetic")
    assert verdict.passed is None


def test_a_trajectory_of_one_frame_is_judged_without_an_exception() -> None:
    for name in ("spring", "chain"):
        scene = scenes.load_scene(name)
        run = plain(scene, "velocity-verlet")
        verdicts = checks.judge(scene, part_of(run, slice(1)), piece=True)
        assert alarms(verdicts) == []
        assert next(v for v in verdicts if v.check == "step-defect").passed is None


def test_what_is_not_a_number_passes_no_check() -> None:
    scene = scenes.load_scene("spring-uneven")
    run = plain(scene, "velocity-verlet")
    q = run.q.copy()
    q[7] = np.nan
    verdicts = {v.check: v.passed for v in checks.judge(scene, replace(run, q=q))}
    assert verdicts["step-defect"] is False
    assert verdicts["closed-form"] is False


def test_a_large_step_of_an_inverted_spring_can_turn_backwards() -> None:
    """Forest-Ruth goes back on part of its way; on an inverted spring M_qp < 0 and the map turns there."""
    found = 0
    for hw in np.linspace(1.6, 2.0, 20):
        scene = clean.scene(
            np.array([3.7]),
            (clean.walls(np.array([-2.9]), np.array([0.4])),),
            np.array([1.1]),
            np.array([0.7]),
            step=hw / np.sqrt(2.9 / 3.7),
            steps=60,
        )
        one = schemes.matrix(schemes.SCHEMES["forest-ruth"], h=scene.step, m=scene.m, k=-np.array([2.9]))
        found += bool(one[0, 0, 1] < 0)
        assert alarms(checks.judge(scene, plain(scene, "forest-ruth"))) == []
    assert found


def test_frames_far_apart_are_judged_by_a_power_of_the_map() -> None:
    scene = replace(scenes.load_scene("chain"), steps=6000, every=3000)
    run = springcheck.simulate(scene, "own:semi-implicit-euler")
    (defect,) = (v for v in checks.judge(scene, run) if v.check == "step-defect")
    assert defect.passed
    (wrong,) = (
        v for v in checks.judge(scene, replace(run, q=run.q * (1 + 1e-9))) if v.check == "step-defect"
    )
    assert wrong.passed is False


@pytest.mark.parametrize("label", ["own:euler", "own:semi-implicit-euler"])
@pytest.mark.parametrize("step", [0.2, 1.9])
def test_a_right_engine_passes_to_the_very_end_of_the_range_of_numbers(label: str, step: float) -> None:
    scene = replace(scenes.load_scene("spring-uneven"), step=step, steps=60_000, every=10)
    # from a start this small the end, in units of the start, is beyond double's range
    scene = replace(scene, q=scene.q * 1e-9, p=scene.p * 1e-9)
    run = springcheck.simulate(scene, label)
    if label == "own:euler":
        assert run.outcome.status == "diverged"
        assert np.max(np.abs(run.q)) > 1e300
    verdicts = checks.judge(scene, run)
    assert all(v.passed is not False for v in verdicts), [v for v in verdicts if v.passed is False]
    # where long double is a double, what rounding may do is beyond the range before the motion is
    assert not WIDE or any(v.check == "frequency" and v.passed for v in verdicts)


def test_a_force_left_out_is_seen_in_any_arithmetic_far_beyond_stability() -> None:
    """Explicit Euler's next position does not feel the kick, so no rounding of the kick excuses the next."""
    scene = replace(scenes.load_scene("anharmonic"), q=np.array([-5.7e9]), p=np.array([-1.5e9]), steps=1)
    run = springcheck.simulate(scene, "own:euler")
    for how in (Arithmetic(), Arithmetic(state=2.0**-24, force=2.0**-24), Arithmetic(force=2.0**-24)):
        declared = replace(run, arithmetic=how)
        assert alarms(checks.judge(scene, declared, [checks.step_defect])) == []
        unkicked = replace(declared, p=np.array([scene.p, scene.p]))
        assert len(alarms(checks.judge(scene, unkicked, [checks.step_defect]))) == 1


@pytest.mark.parametrize("quantity", ["q", "p"])
@pytest.mark.parametrize(("frame", "check"), [(0, checks.start), (-1, checks.step_defect)])
def test_a_state_that_is_no_number_is_never_passed(frame: int, check: checks.Check, quantity: str) -> None:
    scene = replace(scenes.load_scene("spring-uneven"), steps=5)
    run = springcheck.simulate(scene, "own:euler")
    states = getattr(run, quantity).copy()
    states[frame] = np.nan
    (verdict,) = checks.judge(scene, replace(run, **{quantity: states}), [check])
    assert verdict.passed is False


def test_the_strongest_force_is_that_of_one_spring_or_of_all_on_a_particle() -> None:
    pulled = Spring(a=np.array([0, 1]), b=np.array([1, 2]), k=np.array([2.9, 2.9]), rest=np.array([0.5, 0.5]))
    walls = WallSpring(i=np.array([1, 1]), k=np.array([1.3, 1.7]), at=np.zeros(2))
    q = np.array([[-3.0, 0.0, 3.0], [0.5, 1.0, 1.5]])
    # the outer springs of the first state cancel at the middle one; in the second only the walls pull
    scene = replace(scenes.load_scene("chain"), terms=(pulled, walls))
    assert strongest(scene.terms, q) == pytest.approx([2.9 * 2.5, 1.3 + 1.7])


def overflowing(declared: float) -> tuple[Scene, Trajectory]:
    """A right run whose kick is left out wherever the force exceeds what its arithmetic is said to hold."""
    scene = replace(scenes.load_scene("spring-uneven"), steps=60)
    (spring,) = scene.terms
    assert isinstance(spring, WallSpring)
    q, p, h = [scene.q], [scene.p], scene.step
    for _ in range(scene.steps):
        force = -spring.k * (q[-1] - spring.at)
        kick = h * force * (np.abs(force) < declared)
        q, p = [*q, q[-1] + h * (p[-1] / scene.m)], [*p, p[-1] + kick]
    run = springcheck.simulate(scene, "own:euler")
    how = Arithmetic(overflow=declared)
    return scene, replace(run, q=np.array(q), p=np.array(p), arithmetic=how)


def test_a_step_off_is_the_engine_s_limit_only_where_that_explains_every_step_that_is_off() -> None:
    scene, right = overflowing(np.inf)
    force = np.abs(scene.system.force(right.q, right.p))[:, 0]
    limit = float(np.sort(force[:-1])[-9])
    scene, run = overflowing(limit)
    (verdict,) = checks.judge(scene, run, [checks.step_defect])
    first = int(np.argmax(force >= limit)) + 1
    assert verdict.passed is False
    assert f"step {first}, the first that is wrong, has a force of {force[first - 1]:.3g}" in verdict.why
    p = run.p.copy()
    p[int(np.argmin(force[1:-1])) + 2] *= 1 + 1e-12
    (verdict,) = checks.judge(scene, replace(run, p=p), [checks.step_defect])
    assert verdict.passed is False
    assert "limit" not in verdict.why


def test_no_list_beside_the_declarations_names_a_check() -> None:
    studies = (Path(checks.__file__).parents[1] / "studies").rglob("*.py")
    text = "".join(path.read_text() for path in studies)
    assert [one.name for one in checks.ALL if "-" in one.name and f'"{one.name}"' in text] == []
