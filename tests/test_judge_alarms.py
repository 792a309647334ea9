"""Legal arithmetic raises no alarm: round binary numbers, many springs on one particle, forces between the
recorded states, motion near an instability, and numbers at both ends of double's range."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import clean
import springcheck
import textbook as steppers
from springcheck import checks, driver, engines, schemes
from springcheck.physics import exact
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Cosine, Damping, Morse, Quartic, Spring, Term, WallSpring
from springcheck.physics.trajectory import Trajectory, Verdict

FIXED = [
    n for n, s in schemes.SCHEMES.items() if s.has("one-step") and not s.has("flow") and not s.has("mixes")
]


def plain(scene: Scene, name: str) -> Trajectory:
    scheme = schemes.SCHEMES[name]
    return steppers.record(scene, scheme, steppers.textbook(scene, scheme))


def alarms(verdicts: list[Verdict]) -> list[str]:
    return [f"{v.check} {v.value:.3g} of {v.bound:.3g}: {v.why}" for v in verdicts if v.passed is False]


def one(*terms: Term, m: float = 1.3, q: float = 0.9, p: float = 0.4, **grid: float) -> Scene:
    return clean.scene(np.array([m]), terms, np.array([q]), np.array([p]), **grid)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["ruth3", "forest-ruth", "yoshida4"])
def test_a_step_far_beyond_its_limit_is_judged_by_an_area_of_1(name: str) -> None:
    """Its matrix has elements of 1e8, of which the determinant was computed as 1.0005."""
    for turn in (21.0, 33.0, 35.5):
        scene = one(
            WallSpring(i=np.zeros(1, int), k=2.9, at=0.0), m=1.7, step=turn * (1.7 / 2.9) ** 0.5, steps=10
        )
        assert alarms(checks.judge(scene, plain(scene, name))) == []


def wall(k: float, at: float = 0.0) -> WallSpring:
    return WallSpring(i=np.array([0]), k=np.array([k]), at=np.array([at]))


@pytest.mark.parametrize("name", FIXED)
@pytest.mark.parametrize(("k", "p"), [(0.0, 1.0), (0.0, 0.0), (-1.0, 0.0)])
def test_binary_numbers_leave_no_rounding_and_no_alarm(name: str, k: float, p: float) -> None:
    scene = one(wall(k), m=1.0, q=0.0, p=p, step=0.125, steps=40)
    verdicts = checks.judge(scene, plain(scene, name))
    assert alarms(verdicts) == []
    assert not any(np.isnan(v.value) or np.isinf(v.value) for v in verdicts if v.passed is not None)


@pytest.mark.parametrize("name", ["explicit-euler", "velocity-verlet", "implicit-midpoint", "rk4", "ruth3"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_springs_that_nearly_cancel_put_a_centre_beyond_the_digits_of_a_reference(
    name: str, friction: float
) -> None:
    """Of k = 1 and 1e-16 less the sum is 1e-16, and with it the particle rests 2e15 away."""
    brake = Damping(i=np.array([0]), c=np.array([friction]))
    scene = one(wall(1.0, 0.3), wall(2.0**-53 - 1, 0.1), brake, m=2.0, q=1.0, p=0.5, step=0.1, steps=200)
    verdicts = checks.judge(scene, plain(scene, name))
    assert alarms(verdicts) == []
    assert any(v.check == "step-defect" and v.passed for v in verdicts)


@pytest.mark.parametrize("label", ["own:semi-implicit-euler", "openmm:euler", "ase:velocity-verlet"])
@pytest.mark.parametrize("springs", [100, 1000])
def test_many_springs_on_one_particle_round_once_more_each(label: str, springs: int) -> None:
    pull = WallSpring(i=np.zeros(springs, int), k=np.full(springs, 2.9 / springs), at=np.full(springs, 0.1))
    scene = one(pull, step=0.1, steps=60)
    assert alarms(checks.judge(scene, springcheck.simulate(scene, label))) == []


@pytest.mark.parametrize("name", ["explicit-euler", "velocity-verlet", "rk4", "implicit-euler"])
@pytest.mark.parametrize("every", [1, 7])
def test_an_engine_may_count_positions_from_its_walls(name: str, every: int) -> None:
    """They are rounded as numbers of the size of the wall's place, also where the position comes near 0."""
    scheme = schemes.SCHEMES[name]
    scene = one(wall(0.1, 1.7), q=0.0005, p=-0.02, step=0.02, steps=14, every=every)
    own = replace(scene, q=scene.q - 1.7, terms=(wall(0.1),))
    step, state = steppers.textbook(own, scheme), [own.q, own.p]

    def counted(i: int, q: Floats, p: Floats) -> tuple[Floats, Floats]:
        state[:] = step(i, *state)
        return state[0] + 1.7, state[1]

    scene = replace(scene, q=own.q + 1.7)
    assert alarms(checks.judge(scene, steppers.record(scene, scheme, counted))) == []


WELLS: dict[str, tuple[Term, ...]] = {
    "quartic": (Quartic(i=np.array([0]), b=np.array([2.3]), at=np.zeros(1)),),
    "off centre": (Quartic(i=np.array([0]), b=np.array([2.3]), at=np.array([0.7])), wall(1.1, 0.2)),
    "pendulum": (Cosine(i=np.array([0]), depth=np.array([2.3]), wave=np.array([1.7]), at=np.array([0.3])),),
}


@pytest.mark.parametrize("name", ["implicit-euler", "velocity-verlet"])
def test_an_engine_that_counts_displacements_from_the_start_says_so(name: str) -> None:
    """Total Lagrangian finite elements: F(q0) - K u.  What has decayed keeps the digits of the start."""
    k, h, steps = (1.7e4, 0.3, 12) if name == "implicit-euler" else (1.7, 0.1, 200)
    scene = one(wall(k), step=h, steps=steps)
    (q0,), (m,) = scene.q, scene.m

    def step(i: int, q: Floats, p: Floats, share: float = 1.0) -> tuple[Floats, Floats]:
        u, v = kept
        if name == "implicit-euler":
            v = (v + h * (-k * q0 - k * share * u) / m) / (1 + h * h * k * share / m)
            u = u + h * v
        else:
            half = v + h / 2 * (-k * q0 - k * share * u) / m
            u = u + h * half
            v = half + h / 2 * (-k * q0 - k * share * u) / m
        kept[:] = u, v
        return q0 + u, m * v

    def judged(**changes: Any) -> list[str]:
        kept[:] = 0 * scene.q, scene.p / m
        run = steppers.record(scene, schemes.scheme(name), partial(step, **changes))
        return alarms(checks.judge(scene, replace(run, arithmetic=how)))

    kept = [0 * scene.q, scene.p / m]
    how = Arithmetic()
    assert ("step-defect" in str(judged())) is (name == "implicit-euler")
    how = Arithmetic(from_start=True)
    assert judged() == []
    assert judged(share=1 + 1e-11) != []


@pytest.mark.campaign
@pytest.mark.parametrize("name", FIXED)
@pytest.mark.parametrize("well", WELLS)
def test_a_force_between_the_recorded_states_is_weighed_where_the_scheme_takes_it(
    name: str, well: str
) -> None:
    for seed in range(6):
        rng = np.random.default_rng([7, seed])
        q, p = rng.normal(size=2)
        scene = one(*WELLS[well], q=q, p=p, step=float(rng.uniform(0.02, 0.6)), steps=60)
        assert alarms(checks.judge(scene, plain(scene, name))) == [], seed


BOND = Morse(
    a=np.array([0]),
    b=np.array([1]),
    depth=np.array([2.3]),
    steepness=np.array([1.7]),
    rest=np.array([0.9]),
)


@pytest.mark.campaign
@pytest.mark.parametrize("name", FIXED)
def test_a_bond_between_the_recorded_states_likewise(name: str) -> None:
    for seed in range(6):
        rng = np.random.default_rng([8, seed])
        q = np.array([0.1, 1.0]) + 0.2 * rng.normal(size=2)
        scene = clean.scene(
            np.array([1.3, 2.1]), (BOND,), q, rng.normal(size=2), step=float(rng.uniform(0.02, 0.3)), steps=60
        )
        assert alarms(checks.judge(scene, plain(scene, name))) == [], seed


@pytest.mark.parametrize("label", ["sundials:adams", "sundials:bdf"])
def test_an_adaptive_solver_may_lose_what_an_instability_takes(label: str) -> None:
    top = Cosine(i=np.array([0]), depth=np.array([1.0]), wave=np.ones(1), at=np.zeros(1))
    pendulum = one(top, m=1.0, q=np.pi - 0.01, p=0.0, step=0.1, steps=600)
    well = one(
        wall(-1.0),
        Quartic(i=np.array([0]), b=np.ones(1), at=np.zeros(1)),
        m=1.0,
        q=0.01,
        p=0.0,
        step=0.1,
        steps=600,
    )
    for scene in (pendulum, well):
        asked = replace(scene, tolerance=1e-10)
        verdicts = checks.judge(asked, springcheck.simulate(asked, label))
        assert alarms(verdicts) == []
        assert any(v.check == "tolerance" and v.passed for v in verdicts)


@pytest.mark.parametrize("name", ["explicit-euler", "velocity-verlet", "rk4"])
def test_an_anharmonic_motion_that_explodes_between_frames_is_never_no_number(name: str) -> None:
    well = Quartic(i=np.array([0]), b=np.array([2.3]), at=np.zeros(1))
    scene = one(well, q=3.0, p=0.4, step=1.1, steps=60, every=3)
    run = plain(scene, name)
    verdicts = checks.judge(scene, run)
    assert alarms(verdicts) == []


def test_implicit_euler_loses_what_underflows_in_its_matrix() -> None:
    chain = springcheck.load_scene("chain")
    for size in (1e-312, 1e-316, 1e-320):
        scene = replace(
            chain, q=np.array([1.0, -2.0, 1.5]) * size, p=np.array([0.3, 0.2, 0.1]) * size, steps=40
        )
        verdicts = checks.judge(scene, springcheck.simulate(scene, "own:implicit-euler"))
        assert alarms(verdicts) == []


@pytest.mark.parametrize("size", [1e-8, 1e-6, 1e-10])
def test_a_double_well_near_its_top_has_a_number_for_its_exact_solution(size: float) -> None:
    """Near the top it is u0 exp(t); later its energy, as small as it is, stays that of the start."""
    well = Quartic(i=np.array([0]), b=np.ones(1), at=np.zeros(1))
    scene = one(wall(-1.0), well, m=1.0, q=size, p=size, step=0.1, steps=100)
    q, p = exact.true_motion(scene, np.arange(51), scene.step)
    assert np.all(np.isfinite([q, p]))
    assert np.allclose(q[:51, 0], size * np.exp(scene.step * np.arange(51)), rtol=1e-6)


def test_a_motion_that_escapes_in_finite_time_ends_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    from springcheck.engines.sundials import simulation

    monkeypatch.setattr(simulation, "MOST_STEPS", 3000)
    escaping = Quartic(i=np.array([0]), b=-np.ones(1), at=np.zeros(1))
    scene = one(escaping, m=1.0, q=1.0, p=0.5, step=0.1, steps=100)
    with np.errstate(all="ignore"):
        run = springcheck.simulate(scene, "sundials:adams")
    assert run.outcome.status in ("stopped", "diverged")
    assert run.outcome.message
    assert simulation.most_steps(replace(scene, every=100), 1e6) > 10**7


def test_an_implicit_step_without_a_solution_is_no_crash() -> None:
    """1 + h**2 K/m is 0 for the difference of two masses that push each other apart, h**2 2 k/m = -1."""
    apart = Spring(a=np.array([0]), b=np.array([1]), k=np.array([-0.5]), rest=np.zeros(1))
    scene = clean.scene(np.ones(2), (apart,), np.array([0.3, 1.1]), np.zeros(2), step=1.0, steps=5)
    with np.errstate(all="ignore"):
        run = plain(scene, "implicit-euler")
        found = checks.judge(scene, plain(scene, "implicit-midpoint"))
        checks.judge(
            scene, replace(run, q=np.zeros((3, 2)), p=np.zeros((3, 2)), t=np.arange(3.0), energy=None)
        )
    assert len(run.t) == 1
    assert run.outcome.status == "diverged"
    assert alarms(found) == []


def test_joined_masses_that_decay_below_every_double_are_followed() -> None:
    """Two stiff masses of 1e28 end at one unit of a subnormal; the reference's solver lost digits there."""
    walls = WallSpring(i=np.arange(2), k=np.array([1.4277e27, 4.2022e27]), at=np.zeros(2))
    join = Spring(a=np.array([0]), b=np.array([1]), k=np.array([1.6962e29]), rest=np.zeros(1))
    scene = clean.scene(
        np.array([3.3896e27, 2.8768e27]), (walls, join), np.array([-0.357, -0.799]),
        np.array([2.734e25, -5.3823e26]), step=3.2934, steps=3 * 406, every=406,
    )  # fmt: skip
    run = springcheck.simulate(scene, "own:implicit-euler")
    assert np.max(np.abs(run.q[-1])) < 1e-320
    assert alarms(checks.judge(scene, run)) == []


@pytest.mark.parametrize(("q", "h"), [(5.3553606e-316, 11576.740478577825), (4.6e-320, 11600.0)])
def test_a_subnormal_motion_by_long_steps_passes(q: float, h: float) -> None:
    """A drift by h p/m multiplies the last unit of a subnormal momentum by 11,600."""
    scene = replace(
        springcheck.load_scene("spring"), q=np.array([q]), p=np.zeros(1), step=h, steps=40, every=1,
        quantities=("q", "p"),
    )  # fmt: skip
    assert alarms(checks.judge(scene, springcheck.simulate(scene, "own:velocity-verlet"))) == []


@pytest.mark.parametrize("label", ["own:trapezoidal", "own:implicit-euler", "own:implicit-midpoint"])
@pytest.mark.parametrize("h", [1e17, 9.2e18, 1e50, 1e150])
def test_implicit_steps_beyond_the_digits_of_a_double_are_not_judged(label: str, h: float) -> None:
    scene = replace(springcheck.load_scene("detest-b1"), step=h)
    verdicts = checks.judge(scene, springcheck.simulate(scene, label))
    assert [v for v in verdicts if v.passed is False] == []
    assert {v.check: v.passed for v in verdicts}["step-defect"] is None


def test_an_explosion_with_friction_has_no_closed_form_beyond_the_digits_of_its_area() -> None:
    """An RLC circuit at h w = 80: elements of 1e9, and an area that a step multiplies by 5."""
    scene = replace(springcheck.load_scene("rlc-circuit"), step=1e-3)
    verdicts = checks.judge(scene, springcheck.simulate(scene, "own:ruth3"))
    assert [v for v in verdicts if v.passed is False] == []
    passed = {v.check: v.passed for v in verdicts}
    assert passed["step-defect"]
    assert passed["closed-form"] is None


@pytest.mark.parametrize("stretched", [2.0, 4.0, 8.0, 12.0])
@pytest.mark.parametrize("label", ["own:velocity-verlet", "own:rk4", "ase:velocity-verlet", "openmm:verlet"])
def test_bonds_that_are_torn_apart_pull_to_a_rounding_of_what_is_subtracted(
    label: str, stretched: float
) -> None:
    """exp(-a u) by way of 1 - exp(-a u), as good engines have it for small u, is known to a rounding of 1."""
    pytest.importorskip(label.partition(":")[0].replace("own", "numpy"))
    q = np.array([0.1, 1.0 + stretched])
    scene = clean.scene(np.array([1.3, 2.1]), (BOND,), q, np.zeros(2), step=0.1, steps=20)
    assert alarms(checks.judge(scene, springcheck.simulate(scene, label))) == []


@pytest.mark.campaign
@pytest.mark.parametrize("label", [x for x in engines.engine("own").methods if x != "respa8"])
def test_a_motion_near_the_smallest_numbers_is_its_scheme(label: str) -> None:
    """What a stage loses to underflow the stages after it carry on: 1 in 17 right runs failed."""
    one = springcheck.load_scene("spring-uneven")
    rng = np.random.default_rng(sum(map(ord, label)))
    cases = [(5.3553606e-316, 0.0, 11576.740478577825, 1.0, 1.0)]
    for _ in range(12):
        q, p = 10 ** rng.uniform(-323, -290, 2)
        cases.append((q, p * rng.integers(2), *(10 ** rng.uniform((-6, -3, -3), (2, 3, 3)))))
    for q, p, h, m, k in cases:
        wall = WallSpring(i=[0], k=[k], at=[0.0])
        scene = replace(one, m=[m], q=[q], p=[p], terms=(wall,), step=h, steps=20, quantities=("q", "p"))
        if engines.refusal(scene, engines.parse(f"own:{label}")):
            return
        run = driver.run(scene, f"own:{label}")
        (found,) = checks.judge(scene, run, [checks.step_defect])
        assert found.passed is not False, (q, p, h, m, k, found.value, found.bound)
