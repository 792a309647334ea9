"""The experiments: they pass right engines, name what does not apply, and find what they are made to find."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import clean
import textbook as steppers
from onestep import propagator
from springcheck import checks, driver, schemes
from springcheck.checks import experiments, laws
from springcheck.checks.stats import student
from springcheck.errors import MethodError
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import WIDE, Floats
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Morse, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory

Need = Callable[[str], None]

ENGINES = [
    "own:euler", "own:semi-implicit-euler", "own:implicit-euler", "openmm:verlet", "openmm:leapfrog",
    "openmm:euler", "openmm:semi-implicit-euler", "ase:velocity-verlet", "sundials:adams", "sundials:bdf",
]  # fmt: skip


@pytest.mark.campaign
@pytest.mark.parametrize("label", ENGINES)
def test_every_engine_passes_every_experiment_that_applies(label: str, need: Need) -> None:
    need(label)
    verdicts = checks.judge_thoroughly(scenes.load_scene("spring-uneven"), label, driver.run)
    assert [v for v in verdicts if v.passed is False] == []
    assert sum(v.passed is True for v in verdicts) >= 2
    assert all(v.why for v in verdicts)


def plain(name: str) -> checks.Run:
    scheme = schemes.SCHEMES[name]
    return lambda scene, label: steppers.record(scene, scheme, steppers.textbook(scene, scheme), label=label)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["ruth3", "forest-ruth", "yoshida4", "rk2-heun", "rk4", "implicit-midpoint"])
def test_schemes_of_every_order_pass_every_experiment(name: str) -> None:
    verdicts = checks.judge_thoroughly(scenes.load_scene("chain"), name, plain(name))
    assert [v for v in verdicts if v.passed is False] == []
    found = {v.check: v for v in verdicts}
    assert found["order"].passed is True
    assert found["order-anharmonic"].passed is True


def test_a_method_that_cannot_serve_an_experiment_s_scene_is_not_judged_by_it() -> None:
    def run(scene: Scene, label: str) -> Trajectory:
        raise MethodError("it has no such term")

    verdicts = checks.judge_thoroughly(scenes.load_scene("spring"), "none:at-all", run)
    assert {v.passed for v in verdicts} == {None}
    assert {v.why for v in verdicts} == {"it has no such term"}
    assert [v.check for v in verdicts] == [check.name for check in checks.THOROUGH]


def test_the_reference_of_the_well_agrees_with_its_elliptic_function() -> None:
    """q = A cn(W t - u0 | 1/2) with A**4 = 4 E/b and W = A sqrt(b/m): another route to the same number."""
    mpmath.mp.dps = 40
    m, b = (mpmath.mpf(float(x[0])) for x in (laws.WELL.m, laws.WELL.terms[0].b))
    q0, p0 = (mpmath.mpf(float(x[0])) for x in (laws.WELL.q, laws.WELL.p))
    half = mpmath.mpf(1) / 2
    amplitude = (4 * (p0**2 / (2 * m) + b * q0**4 / 4) / b) ** (half / 2)
    w = amplitude * mpmath.sqrt(b / m)
    u = w * mpmath.mpf(float(laws.DURATION)) - mpmath.ellipf(mpmath.acos(q0 / amplitude), half)
    true = amplitude * mpmath.ellipfun("cn", u, m=half)
    slope = -m * amplitude * w * mpmath.ellipfun("sn", u, m=half) * mpmath.ellipfun("dn", u, m=half)
    q, p = laws.extrapolated(laws.WELL, laws.DURATION)
    # seven levels of extrapolation enlarge the rounding of long double some tenfold
    bound = max(2e-17, 16 * exact.EPS)
    assert abs(mpmath.mpf(str(q[0])) - true) < bound
    assert abs(mpmath.mpf(str(p[0])) - slope) < bound


def test_symmetric_schemes_are_those_that_are_their_own_adjoint() -> None:
    found = {name for name, s in schemes.SCHEMES.items() if s.has("one-step", "reversible")}
    assert {"velocity-verlet", "position-verlet", "implicit-midpoint", "trapezoidal", "forest-ruth"} <= found
    assert not {"explicit-euler", "implicit-euler", "semi-implicit-euler", "ruth3", "rk4"} & found


def test_openmm_s_rebuilt_velocity_drifts_as_its_arithmetic_implies(need: Need) -> None:
    """h fl(1/h) - 1 = -8.9e-17 a step at h = 0.013, nothing at h = 2**-7; without the prediction it fails."""
    need("openmm:verlet")
    bench = checks.Bench(scene=scenes.load_scene("spring-uneven"), label="openmm:verlet", run=driver.run)
    assert laws.rounding_bias(bench).passed is True
    run = bench.once(laws.ensemble(laws.ODD))
    assert laws.predicted_drift(run) == pytest.approx(-8.88e-17, rel=1e-2)
    assert laws.predicted_drift(bench.once(laws.ensemble(laws.EVEN))) == 0.0

    def silent(scene: Scene, label: str) -> Trajectory:
        return replace(driver.run(scene, label), rebuilds_velocity=False)

    unexplained = checks.Bench(scene=bench.scene, label="openmm:verlet", run=silent)
    # a drift of 0.8 of what the reference itself rounds where it is no wider than the engine
    assert laws.rounding_bias(unexplained).passed is not WIDE


def test_a_power_law_with_its_second_term_is_fitted_to_its_order() -> None:
    h = [0.2 / 2**j for j in range(6)]
    error = [3.1 * x**3 * (1 + 0.8 * x) for x in h]
    slope, se, rounding = laws.fitted(h, error, [0.0] * 6, second=1)
    assert abs(slope - 3) < student(3, laws.CHANCE) * se
    assert se < 1e-3
    assert rounding == 0.0


def test_copies_of_a_scene_do_not_act_on_each_other() -> None:
    chain = scenes.load_scene("chain")
    many = chain.system.tiled(3)
    one = chain.system.force(chain.q, chain.p)
    q = np.concatenate([chain.q, chain.q + 0.1, chain.q])
    three = many.system.force(q, np.zeros(9))
    assert np.array_equal(three[:3], one)
    assert np.array_equal(three[6:], one)
    assert not np.array_equal(three[3:6], one)


def test_an_anharmonic_scene_has_no_matrix_but_turns_back() -> None:
    scene = replace(laws.WELL, step=0.05, steps=100, quantities=("q", "p", "energy"))
    verdicts = {v.check: v for v in checks.judge_thoroughly(scene, "plain", plain("velocity-verlet"))}
    assert verdicts["propagator"].passed is None
    assert verdicts["reversibility"].passed is True


def test_a_free_chain_and_an_inverted_spring_pass_the_experiments() -> None:
    for seed in range(30):
        scene = clean.random_scene(np.random.default_rng([5, seed]))
        quick = [e for e in checks.THOROUGH if e.family in ("map", "repeat")]
        verdicts = checks.judge_thoroughly(scene, "plain", plain("velocity-verlet"), quick)
        assert [v for v in verdicts if v.passed is False] == [], seed


def test_a_way_out_that_ends_where_it_began_says_nothing_of_the_way_back() -> None:
    """h w = 1: six steps of semi-implicit Euler are the identity, in binary numbers to the last bit."""
    scene = spring(m=1.0, k=1.0, q=1.0, p=0.5, step=1.0, steps=6, title="")
    bench = checks.Bench(scene=scene, label="", run=plain("semi-implicit-euler"))
    assert bench.trajectory.q[-1] == scene.q
    verdict = experiments.reversibility(bench)
    assert verdict.passed is None
    assert "standing still" in verdict.why


@pytest.mark.parametrize("label", ["openmm:verlet", "lammps:bond"])
def test_a_livelier_neighbour_does_not_change_from_where_positions_count(label: str, need: Need) -> None:
    """Engines that know the length of a bond, not its sign, count what may turn over from its rest."""
    need(label)
    bond = Spring(a=np.array([0]), b=np.array([1]), k=np.array([2.9]), rest=np.array([1.3]))
    scene = clean.scene(
        np.array([1.1, 0.7]), (bond,), np.array([0.3, 1.7]), np.array([1.2, -0.5]), step=0.1, steps=20
    )
    bench = checks.Bench(scene=scene, label=label, run=driver.run)
    assert experiments.company(bench).passed is True


def test_the_drift_of_a_rounded_one_step_matrix_is_named() -> None:
    """It is legal arithmetic, and its area is off by a rounding at every step: that is found, and said."""
    scheme = schemes.SCHEMES["semi-implicit-euler"]

    def run(scene: Scene, label: str) -> Trajectory:
        matrix = schemes.matrix(scheme, h=scene.step, m=scene.m[:1], k=np.array([2.9]))[0]
        (a, b), (c, d) = matrix.astype(np.float64)
        return steppers.record(scene, scheme, lambda i, q, p: (a * q + b * p, c * q + d * p))

    verdict = laws.rounding_bias(checks.Bench(scene=laws.SPRING, label="", run=run))
    assert verdict.passed is False
    assert "matrix whose elements are rounded" in verdict.why


def test_an_anharmonic_motion_that_grows_may_come_back_as_far_off_as_its_tangent_says() -> None:
    """A mass that a wall pushes away and a bond: a rounding grows by 1e13 in 70 steps."""
    end = np.array([0])
    terms = (
        WallSpring(i=end, k=np.array([-1.1]), at=np.zeros(1)),
        Morse(
            a=end, b=end + 1, depth=np.array([16700.0]), steepness=np.array([0.0148]), rest=np.array([25.7])
        ),
    )
    masses, start = np.array([4.3, 3.6]), (np.array([2.9, 60.1]), np.array([18.0, -3.4]))
    scene = clean.scene(masses, terms, *start, step=-0.52, steps=70)
    bench = checks.Bench(scene=scene, label="", run=plain("velocity-verlet"))
    assert experiments.reversibility(bench).passed is not False
    # while it has not grown it is judged, and an engine that loses some of its momenta is seen
    for loss, passes in ((0.0, True), (1e-12, False)):

        def run(made: Scene, label: str, loss: float = loss) -> Trajectory:
            step = steppers.textbook(made, schemes.SCHEMES["velocity-verlet"])

            def lossy(i: int, q: Floats, p: Floats) -> tuple[Floats, Floats]:
                q, p = step(i, q, p)
                return q, p * (1 - loss)

            return steppers.record(made, schemes.SCHEMES["velocity-verlet"], lossy)

        short = checks.Bench(scene=replace(scene, steps=12), label="", run=run)
        assert experiments.reversibility(short).passed is passes


def test_a_sum_of_another_length_in_company_is_no_influence() -> None:
    """A dense one-step matrix of twice the size adds up in another order: its last digits differ."""
    scheme = schemes.SCHEMES["velocity-verlet"]

    def run(made: Scene, label: str) -> Trajectory:
        n = made.n
        whole = propagator(scheme, made, h=made.step).astype(np.float64)

        def step(i: int, q: Floats, p: Floats) -> tuple[Floats, Floats]:
            z = np.concatenate([q, p])
            # the order of the sum depends on how many there are
            out = whole @ z if n == 3 else np.sum(whole[:, ::-1] * z[::-1], axis=1)
            return out[:n], out[n:]

        return steppers.record(made, scheme, step)

    a = np.arange(2)
    links = Spring(a=a, b=a + 1, k=np.array([1.1, 3.7]), rest=np.zeros(2))
    scene = clean.scene(
        np.array([1.3, 0.7, 2.1]), (links,), np.array([0.2, 1.0, 1.9]), np.array([0.4, -0.3, 0.5]),
        step=0.05, steps=50,
    )  # fmt: skip
    verdict = experiments.company(checks.Bench(scene=scene, label="", run=run))
    assert verdict.passed is None
    assert "rounding alone" in verdict.why


def test_friction_that_leaves_no_area_has_no_determinant_to_judge() -> None:
    """exp(-h c / m) is 0: the scheme's one-step matrix has no inverse."""
    scene = scenes.load_scene("detest-b1")
    (damping,) = (term for term in scene.terms if term.key == "damping")
    heavy = replace(damping, c=np.full_like(damping.c, 1e9))
    scene = replace(scene, terms=tuple(heavy if term is damping else term for term in scene.terms))
    verdicts = checks.judge_thoroughly(scene, "own:langevin-middle-early", driver.run)
    assert [v for v in verdicts if v.passed is False] == []
    assert {v.check: v.passed for v in verdicts}["determinant"] is None
