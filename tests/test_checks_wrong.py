"""What is wrong is never passed: no number, a bound that excuses anything, a motion that came to nothing.

A check that cannot tell says that it does not apply, and why.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clean
import textbook as steppers
from springcheck import checks, schemes
from springcheck.checks import compare, experiments, laws
from springcheck.checks.check import Finding, verdict
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import WIDE, Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Morse, Quartic, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory, Verdict
from springcheck.studies.precision import accuracy, fits
from springcheck.studies.run.tally import Tally

SINGLE = Arithmetic(name="single", state=2.0**-24, force=2.0**-24)
NAN = float("nan")


def plain(scene: Scene, name: str = "velocity-verlet", how: Arithmetic | None = None) -> Trajectory:
    scheme = schemes.SCHEMES[name]
    return steppers.record(scene, scheme, steppers.textbook(scene, scheme), arithmetic=how)


def changed(scene: Scene, run: Trajectory, q: Floats, p: Floats) -> Trajectory:
    """The trajectory with other states, and the energies that belong to them."""
    return replace(run, q=q, p=p, energy=steppers.energies(scene, q, p))


def row(x: Floats, i: int, value: float) -> Floats:
    out = x.copy()
    out[i] = value
    return out


def one(scene: Scene, run: Trajectory, check: checks.Check) -> Verdict:
    (found,) = checks.judge(scene, run, [check])
    return found


def uneven(**changes: object) -> Scene:
    return replace(scenes.load_scene("spring-uneven"), **{"steps": 60, **changes})  # type: ignore[arg-type]


def well(**changes: object) -> Scene:
    scene = clean.scene(
        np.array([1.3]),
        (Quartic(i=np.array([0]), b=np.array([2.3]), at=np.zeros(1)),),
        np.array([0.9]),
        np.array([0.4]),
        step=0.05,
        steps=60,
    )
    return replace(scene, **changes)  # type: ignore[arg-type]


WRONG: dict[str, Callable[[Scene, Trajectory], Trajectory]] = {
    "it comes to nothing": lambda s, r: changed(s, r, row(r.q, -1, 0), row(r.p, -1, 0)),
    "it is nothing after the start": lambda s, r: changed(
        s, r, np.concatenate([r.q[:1], 0 * r.q[1:]]), np.concatenate([r.p[:1], 0 * r.p[1:]])
    ),
    "it stands still": lambda s, r: changed(s, r, 0 * r.q + r.q[0], 0 * r.p + r.p[0]),
    "momenta of another mass": lambda s, r: changed(s, r, r.q, r.p * 1.01),
    "momenta of the wrong sign": lambda s, r: changed(s, r, r.q, -r.p),
    "a frame twice": lambda s, r: changed(
        s, r, np.concatenate([r.q[:3], r.q[2:-1]]), np.concatenate([r.p[:3], r.p[2:-1]])
    ),
    "one frame late": lambda s, r: replace(changed(s, r, r.q[1:], r.p[1:]), t=r.t[:-1]),
    "a frame far out": lambda s, r: changed(s, r, row(r.q, len(r.q) // 2, 1e9), r.p),
    "a frame beyond all bounds": lambda s, r: changed(s, r, row(r.q, 1, 1e100), r.p),
    "it explodes half way": lambda s, r: changed(
        s, r, *(x * np.where(np.arange(len(x)) < len(x) // 2, 1, 1e12)[:, None] for x in (r.q, r.p))
    ),
    "no number at the end": lambda s, r: changed(s, r, row(r.q, -1, np.nan), r.p),
    "infinite at the end": lambda s, r: changed(s, r, r.q, row(r.p, -1, -np.inf)),
}
MOVING = {
    "spring": uneven(),
    "backwards": uneven(step=-0.05),
    "every fourth step": uneven(every=4),
    "chain": replace(scenes.load_scene("chain"), steps=60),
    "well": well(),
    "well, every second step": well(every=2),
    "circuit": replace(scenes.load_scene("lc-circuit"), steps=60),
    "inverted": replace(scenes.load_scene("inverted"), steps=20),
    "pendulum": replace(scenes.load_scene("pendulum"), steps=60),
    "bond": replace(scenes.load_scene("morse-bond"), steps=60),
}


@pytest.mark.parametrize("how", [Arithmetic(), SINGLE], ids=["double", "single"])
@pytest.mark.parametrize("what", WRONG)
@pytest.mark.parametrize("where", MOVING)
def test_a_wrong_trajectory_is_rejected_and_no_bound_is_infinite(
    where: str, what: str, how: Arithmetic
) -> None:
    scene = MOVING[where]
    with np.errstate(all="ignore"):
        found = checks.judge(scene, WRONG[what](scene, plain(scene, how=how)))
    assert any(v.passed is False for v in found)
    assert all(np.isfinite([v.value, v.bound]).all() for v in found if v.passed is not None)


@pytest.mark.parametrize("quantity", ["q", "p"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_states_that_are_no_numbers_have_no_energies(quantity: str, value: float) -> None:
    scene = scenes.load_scene("free")
    run = plain(scene)
    states = {"q": run.q, "p": run.p}
    states[quantity] = row(states[quantity], 3, value)
    assert one(scene, changed(scene, run, **states), checks.energies).passed is False


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_first_time_that_is_no_number_is_judged(value: float) -> None:
    scene = uneven()
    run = plain(scene)
    found = checks.judge(scene, replace(run, t=row(run.t, 0, value)))
    assert {v.check for v in found if v.passed is False} == {"times"}


def within(value: float, bound: float) -> Verdict:
    return verdict("m", "c", Finding(value, bound, "", ""))


def test_an_infinite_bound_passes_nothing_and_what_is_no_number_still_fails() -> None:
    assert within(1.0, np.inf).passed is None
    assert within(np.inf, np.inf).passed is None
    assert within(NAN, np.inf).passed is False
    assert within(1.0, NAN).passed is False
    for value in (0.0, 1.0, 1e-320, 1e300, np.inf, -np.inf, NAN):
        for bound in (0.0, 1e-320, 1.0, 1e300, NAN, -np.inf, -1.0):
            found = within(value, bound)
            assert np.isfinite([found.value, found.bound]).all()
            assert found.passed is (found.value <= found.bound)
            assert found.passed is bool(bound >= 0 and -np.inf < value <= bound)


BROKEN: dict[str, Callable[[Scene, Trajectory], Trajectory]] = {
    "no number": lambda s, r: replace(r, q=r.q * NAN),
    "infinite": lambda s, r: replace(r, p=r.p / 0.0),
    "no number late": lambda s, r: replace(r, q=row(r.q, -1, NAN), p=row(r.p, -1, NAN)),
    "only the start": lambda s, r: replace(r, t=r.t[:1], q=r.q[:1], p=r.p[:1]),
    "nothing": lambda s, r: replace(r, q=0 * r.q, p=0 * r.p),
    "immense": lambda s, r: replace(r, q=r.q * 1e300, p=r.p * 1e-300),
}


@pytest.mark.parametrize("what", BROKEN)
@pytest.mark.parametrize("where", ["spring", "well"])
def test_no_check_of_all_gives_a_verdict_that_is_no_number(where: str, what: str) -> None:
    def run(scene: Scene, label: str) -> Trajectory:
        return BROKEN[what](scene, plain(scene))

    scene = {"spring": uneven(steps=20), "well": well(steps=20)}[where]
    with np.errstate(all="ignore"):
        # ensembles over long times are in tests of their own
        quick = [e for e in checks.THOROUGH if "rounding" not in e.name]
        found = checks.judge(scene, run(scene, "")) + checks.judge_thoroughly(scene, "", run, quick)
    assert len(found) == len(checks.CHECKS) + len(quick)
    assert any(v.passed is False for v in found) or what == "only the start"
    for v in found:
        assert v.passed is None or np.isfinite([v.value, v.bound]).all(), v
        assert v.passed is None or not v.passed or v.value <= v.bound, v


def test_a_frequency_that_is_off_by_turns_says_that_whole_turns_are_not_counted() -> None:
    scene = uneven(steps=2000)
    stiff = replace(scene, terms=(WallSpring(i=np.array([0]), k=np.array([4.35]), at=np.array([0.0])),))
    right, wrong = plain(scene), replace(plain(stiff), scene=scene)
    found = one(scene, wrong, checks.frequency)
    # by 22 %
    assert found.passed is False
    assert found.value < 0.05
    assert "whole turns are not counted" in found.reason
    assert "whole turns" not in one(scene, right, checks.frequency).reason


@pytest.mark.parametrize("what", ["it comes to nothing", "it is nothing after the start", "it stands still"])
def test_a_phase_is_told_only_where_there_is_a_mode(what: str) -> None:
    scene = uneven(steps=57)
    run = WRONG[what](scene, plain(scene))
    assert one(scene, run, checks.frequency).passed is False


def test_a_check_that_an_engine_at_rest_would_pass_does_not_apply() -> None:
    # single precision, with the wall a million amplitudes away: a step moves less than one rounding
    wall = clean.walls(np.array([2.9]), np.array([1e6]))
    scene = clean.scene(np.array([3.7]), (wall,), np.array([1e6 + 1]), np.array([0.7]), step=0.05, steps=60)
    run = plain(scene, how=SINGLE)
    for this in (run, WRONG["it stands still"](scene, run)):
        for check in (checks.step_defect, checks.closed_form, checks.arithmetic):
            assert one(scene, this, check).passed is None
    assert "standing still would pass" in one(scene, run, checks.step_defect).why
    assert one(scene, plain(scene), checks.step_defect).passed is True


def test_a_scene_at_rest_is_passed_at_rest_and_nowhere_else() -> None:
    scene = uneven(q=np.array([0.0]), p=np.array([0.0]))
    (term,) = scene.terms
    assert isinstance(term, WallSpring)
    scene = replace(scene, terms=(replace(term, at=np.zeros(1)),))
    for how in (Arithmetic(), SINGLE):
        run = plain(scene, how=how)
        assert [v for v in checks.judge(scene, run) if v.passed is False] == []
        for check in (checks.step_defect, checks.closed_form, checks.shadow_energy):
            assert one(scene, run, check).passed is True
            moved = changed(scene, run, row(run.q, 5, 1e-3), run.p)
            assert one(scene, moved, check).passed is False


def test_no_arithmetic_is_judged_by_a_step_defect_that_does_not_apply() -> None:
    scene = well(every=400, steps=8000, step=0.3)
    run = plain(scene, how=Arithmetic(name="coarse", state=2.0**-12, force=2.0**-12))
    assert one(scene, run, checks.step_defect).passed is None
    assert one(scene, run, checks.arithmetic).passed is None


@pytest.mark.parametrize("size", [1e9, 1e100])
@pytest.mark.parametrize("frame", [1, 15, 30])
def test_a_frame_far_out_does_not_enlarge_what_it_is_judged_by(frame: int, size: float) -> None:
    scene = well(every=2)
    run = plain(scene)
    found = one(scene, changed(scene, run, row(run.q, frame, size), run.p), checks.step_defect)
    assert found.passed is False


def test_a_piece_of_a_bond_s_run_keeps_its_momentum_and_nothing_is_raised() -> None:
    scene = replace(scenes.load_scene("morse-bond"), steps=60)
    assert isinstance(scene.terms[0], Morse)
    run = plain(scene)
    late = slice(20, 41)
    q, p = run.q[late], run.p[late]
    piece = replace(changed(scene, run, q, p), t=run.t[late])
    assert one(scene, piece, checks.momentum).passed is True
    pushed = changed(scene, piece, q, p + 1e-9 * np.max(np.abs(p)) * (np.arange(21) >= 10)[:, None])
    assert one(scene, pushed, checks.momentum).passed is False


def test_momenta_that_rounding_could_make_up_are_not_judged() -> None:
    bond = Spring(a=np.array([0]), b=np.array([1]), k=np.array([2.9]), rest=np.array([1e9]))
    scene = clean.scene(
        np.array([3.7, 2.3]), (bond,), np.array([0.0, 1e9]), np.array([0.7, -0.3]), step=0.05, steps=60
    )
    assert one(scene, plain(scene, how=SINGLE), checks.momentum).passed is None
    assert one(scene, plain(scene), checks.momentum).passed is True


@pytest.mark.parametrize("name", ["semi-implicit-euler", "velocity-verlet", "position-verlet", "forest-ruth"])
def test_a_right_engine_is_passed_while_its_motion_explodes(name: str) -> None:
    """The last force of such a step dwarfs the first, and so do its roundings."""
    scene = well(step=1.9, steps=20)
    with np.errstate(all="ignore"):
        run = plain(scene, name)
        assert np.max(np.abs(run.q)) > 1e30
        found = checks.judge(scene, run)
        assert [v for v in found if v.passed is False] == []
        assert one(scene, run, checks.step_defect).passed is True
        wrong = changed(scene, run, run.q, row(run.p, -1, float(run.p[-1, 0]) * (1 + 1e-12)))
        assert one(scene, wrong, checks.step_defect).passed is False


def test_the_momentum_of_an_exploding_bond_raises_no_false_alarm() -> None:
    bond = Morse(
        a=np.array([0]), b=np.array([1]), depth=np.array([1.7]), steepness=np.array([1.0]), rest=np.zeros(1)
    )
    q, p = np.array([0.0, 1.3]), np.array([0.4, -0.3])
    judged = 0
    for h in np.linspace(0.7, 2.5, 30):
        scene = clean.scene(np.array([1.0, 1.9]), (bond,), q, p, step=h, steps=40)
        with np.errstate(all="ignore"):
            run = plain(scene, "forest-ruth")
            found = one(scene, run, checks.momentum)
            assert found.passed is not False
            judged += bool(found.passed)
            if found.passed:
                bad = replace(run, q=row(run.q, -1, NAN))
                assert one(scene, bad, checks.momentum).passed is False
    assert judged


def adaptive(scene: Scene, q: Floats, p: Floats, tolerance: float, calls: int = 200) -> Trajectory:
    return steppers.trajectory(scene, schemes.SCHEMES["adams"], q, p, tolerance=tolerance, calls=calls)


def test_a_solver_s_own_explosion_does_not_excuse_it() -> None:
    scene = well(steps=40)
    run = plain(replace(scene, step=scene.step))
    far = adaptive(scene, row(run.q, 20, 1e12), run.p, 1e-10)
    assert one(scene, far, checks.tolerance).passed is False


def test_a_tolerance_that_allows_the_whole_motion_is_not_judged() -> None:
    scene = uneven(steps=40)
    run = plain(scene)
    assert one(scene, adaptive(scene, run.q, run.p, 0.1), checks.tolerance).passed is None
    still = adaptive(scene, 0 * run.q + run.q[0], 0 * run.p + run.p[0], 0.1)
    assert one(scene, still, checks.tolerance).passed is None


@pytest.mark.skipif(not WIDE, reason="such energies leave the range of double: the scene is refused")
@pytest.mark.parametrize("size", [1e-200, 1.0, 1e200])
def test_the_bound_of_a_tolerance_goes_with_the_size_of_the_motion(size: float) -> None:
    scene = uneven(steps=40)
    (term,) = scene.terms
    assert isinstance(term, WallSpring)
    scene = replace(scene, q=scene.q * size, p=scene.p * size, terms=(replace(term, at=term.at * size),))
    run = plain(scene)
    bound = checks.tolerance_bound(checks.Case(trajectory=adaptive(scene, run.q, run.p, 1e-9), scene=scene))
    assert 1e-7 < bound < 1e-4


def test_the_bound_of_a_solver_on_a_barrier_stays_below_the_motion() -> None:
    wall = clean.walls(np.array([-1000.0]), np.zeros(1))
    scene = clean.scene(np.array([0.37]), (wall,), np.array([0.3]), np.array([0.7]), step=0.11, steps=20)
    run = adaptive(scene, np.zeros((21, 1)), np.zeros((21, 1)), 1e-9, calls=2234)
    q, p = (np.asarray(x, np.float64) for x in exact.true_motion(scene, np.arange(21), 0.11))
    found = one(scene, replace(run, q=q, p=p, t=np.arange(21) * 0.11), checks.tolerance)
    assert found.passed is True
    assert found.bound < 1e-2 * np.max(scene.system.norm(q, p))


def bench(broken: Callable[[Scene, Trajectory], Trajectory]) -> checks.Bench:
    def run(scene: Scene, label: str) -> Trajectory:
        return broken(scene, plain(scene))

    return checks.Bench(scene=uneven(), label="broken", run=run)


def late(only: float, how: Callable[[Floats], Floats]) -> Callable[[Scene, Trajectory], Trajectory]:
    """Momenta that something is done to from the second frame on, where the step is `only`."""

    def broken(scene: Scene, run: Trajectory) -> Trajectory:
        if scene.step != only:
            return run
        return replace(run, p=np.concatenate([run.p[:1], how(run.p[1:])]))

    return broken


@pytest.mark.parametrize("h", [laws.ODD, laws.EVEN])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_ensemble_that_is_no_number_at_either_step_is_rejected(h: float, value: float) -> None:
    broken = bench(late(h, lambda p: p * value))
    with np.errstate(all="ignore"):
        judged = [laws.rounding_bias(broken)]
        if h == laws.ODD:
            judged.append(laws.rounding_growth(broken))
        assert all(v.passed is False and np.isfinite([v.value, v.bound]).all() for v in judged)


def test_an_ensemble_that_ends_early_is_rejected() -> None:
    def cut(scene: Scene, run: Trajectory) -> Trajectory:
        return replace(run, t=run.t[:1], q=run.q[:1], p=run.p[:1]) if scene.step == laws.ODD else run

    assert laws.rounding_bias(bench(cut)).passed is False
    assert laws.rounding_growth(bench(cut)).passed is False


def test_a_walk_so_wide_that_it_hides_any_bias_is_not_judged() -> None:
    rng = np.random.default_rng(1)
    found = laws.rounding_bias(bench(late(laws.ODD, lambda p: p * (1 + 1e-3 * rng.normal(size=p.shape)))))
    assert found.passed is not True


def test_an_engine_that_makes_no_finite_step_is_rejected_by_name() -> None:
    def cut(scene: Scene, run: Trajectory) -> Trajectory:
        return replace(run, t=run.t[:1], q=run.q[:1], p=run.p[:1])

    whole = bench(lambda scene, run: run)
    first = checks.Bench(
        scene=whole.scene, label="broken", run=lambda s, _: plain(s) if s.steps > 1 else cut(s, plain(s))
    )
    for experiment in (experiments.propagator, experiments.determinant, experiments.symplecticity):
        assert experiment(whole).passed is True
        assert experiment(first).passed is False
    for experiment in (experiments.mirror, experiments.repeatability):
        assert experiment(bench(cut)).passed is None


def test_a_way_back_that_explodes_does_not_excuse_itself() -> None:
    scene = well()

    def run(made: Scene, label: str) -> Trajectory:
        found = plain(made)
        if np.array_equal(made.q, scene.q):
            return found
        return replace(found, q=np.concatenate([found.q[:1], found.q[1:] * 1e12]))

    assert experiments.reversibility(checks.Bench(scene=scene, label="broken", run=run)).passed is False


def test_what_is_no_number_stays_in_the_error_and_the_energy_of_a_report() -> None:
    scene = uneven()
    run = plain(scene)
    tally = Tally(scene)
    with np.errstate(all="ignore"):
        tally.add(run)
        tally.add(replace(run, p=row(run.p, 7, NAN)))
        tally.add(run)
    assert np.isnan(tally.error)
    assert np.isnan(tally.drift)


def test_what_is_no_number_stays_in_the_errors_of_a_study() -> None:
    scene = uneven()
    run = plain(scene)
    errors = accuracy.Errors(accuracy.truth(scene), scene.step, 1, scheme=schemes.SCHEMES["velocity-verlet"])
    with np.errstate(all="ignore"):
        errors(run.t, row(run.q, 7, NAN), run.p, None)
        found = errors.result
    assert np.isnan([found.max_error, found.energy_error, found.phase_error]).all()


def test_points_without_a_number_hide_no_others() -> None:
    rows = [(None, NAN, 1.0), (None, 1e-6, NAN), (None, 1e-3, 2.0), (None, 1e-5, 3.0)]
    assert fits.cost([row for row in rows if row[2] > 0], 1e-2) == 2.0
    assert fits.turned([NAN, 1e-3, 1e-5, 1e-4]) == 2
    assert fits.turned([NAN, NAN]) is None


def test_an_error_of_exactly_nothing_is_in_no_fit() -> None:
    steps = [*(0.1 / 2**j for j in range(6)), 1e-3]
    fit = fits.order(steps, [*(0.01 / 4**j for j in range(6)), 0.0], [None] * 7)
    assert fit is not None
    assert fit.points == 6
    assert fit.order == pytest.approx(2)


def test_bounds_beyond_all_numbers_make_no_two_motions_the_same() -> None:
    # from a start this small the end, in units of the start, is beyond double's range
    scene = uneven(step=1.9, steps=1350, every=10)
    scene = replace(scene, q=scene.q * 1e-120, p=scene.p * 1e-120)
    with np.errstate(all="ignore"):
        runs = {name: plain(scene, name) for name in ("explicit-euler", "rk2-midpoint")}
        runs = {name: replace(run, label=name) for name, run in runs.items()}
        found = compare.same_motions(scene, runs, compare.compare(scene, runs))
    assert found == []


def test_a_bond_without_stiffness_holds_nothing_and_hides_no_error() -> None:
    terms = (
        WallSpring(i=np.array([0]), k=np.array([2.9]), at=np.zeros(1)),
        Spring(a=np.array([0]), b=np.array([1]), k=np.array([0.0]), rest=np.zeros(1)),
    )
    scene = clean.scene(np.ones(2), terms, np.array([0.3, 0.1]), np.array([0.2, 0.4]), step=0.1, steps=50)
    assert scene.system.norm(np.array([0.0, 1.0]), np.zeros(2)) > 0.1


def test_the_sign_of_the_energy_drift_is_that_of_the_gain_whatever_the_start(tmp_path: Path) -> None:
    scene = replace(scenes.load_scene("inverted"), q=np.array([1.1]), p=np.array([0.1]), steps=5)
    assert scene.system.energy(scene.q, scene.p) < 0
    run = plain(scene)
    tally = Tally(scene)
    tally.add(replace(run, p=run.p * 2))
    assert tally.drift > 0
