"""Every engine moves as its scheme does, and engines of one scheme move alike."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from platform import machine as processor

import numpy as np
import pytest

import springcheck
from springcheck import checks, driver, engines
from springcheck.errors import MethodError
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.builders import spring as one_spring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.physics.trajectory import Trajectory

Need = Callable[[str], None]

SCENES = ("spring", "spring-uneven", "chain")

PAIRS = [
    ("openmm:leapfrog", "own:semi-implicit-euler", 1e-13),
    ("openmm:semi-implicit-euler", "own:semi-implicit-euler", 1e-13),
    ("openmm:euler", "own:euler", 1e-12),
    ("openmm:verlet", "ase:velocity-verlet", 1e-13),
    ("openmm:verlet@CPU", "openmm:verlet", 1e-13),
    ("sundials:adams", "exact", 1e-9),
    ("sundials:bdf", "exact", 1e-8),
]


def states(scene: Scene, label: str) -> tuple[np.ndarray, np.ndarray]:
    if label == "exact":
        q, p = exact.true_motion(scene, np.arange(scene.frames) * scene.every, scene.step)
        return q, p
    run = springcheck.simulate(scene, label)
    assert run.outcome.status == "complete"
    return run.q, run.p


@pytest.mark.parametrize(("pair", "name"), list(itertools.product(PAIRS, SCENES)), ids=str)
def test_two_engines_of_one_scheme_move_alike(pair: tuple[str, str, float], name: str, need: Need) -> None:
    one, other, bound = pair
    need(one)
    if other != "exact":
        need(other)
    scene = scenes.load_scene(name)
    (q1, p1), (q2, p2) = states(scene, one), states(scene, other)
    norm = scene.system.norm
    # relative to the amplitude that a growing motion has reached, and for stiff solvers to n components
    grown = np.maximum.accumulate(np.maximum(norm(q2 - _rest(scene), p2), 1.0))
    assert np.max(norm(q1 - q2, p1 - p2) / grown) <= bound * scene.n


def _rest(scene: Scene) -> np.ndarray:
    modes = scene.system.modes
    q, _ = modes.out_of(modes.centre(), np.zeros_like(modes.w2))
    return np.asarray(q, np.float64)


FIXED = [
    "own:euler", "own:semi-implicit-euler", "own:implicit-euler", "openmm:verlet", "openmm:leapfrog",
    "openmm:euler", "openmm:semi-implicit-euler", "ase:velocity-verlet",
]  # fmt: skip


def judged(scene: Scene, run: Trajectory) -> list[str]:
    return [v.check for v in checks.judge(scene, run) if v.passed is False]


@pytest.mark.parametrize("label", [*FIXED, "openmm:verlet@OpenCL-single", "openmm:verlet@OpenCL-mixed"])
def test_an_uneven_spring_passes_every_check(label: str, need: Need) -> None:
    need(label)
    scene = scenes.load_scene("spring-uneven")
    assert judged(scene, springcheck.simulate(scene, label)) == []


@pytest.mark.parametrize("label", [*FIXED, "sundials:adams", "sundials:bdf"])
def test_backwards_in_time_is_a_motion_like_any_other(label: str, need: Need) -> None:
    need(label)
    scene = replace(scenes.load_scene("spring-uneven"), step=-0.07)
    run = springcheck.simulate(scene, label)
    assert run.t[-1] == -0.07 * 200
    assert judged(scene, run) == []


@pytest.mark.parametrize("label", FIXED)
def test_recording_every_twentieth_step_gives_every_twentieth_state(label: str, need: Need) -> None:
    need(label)
    scene = scenes.load_scene("spring-uneven")
    all_frames, some = (
        springcheck.simulate(scene, label),
        springcheck.simulate(replace(scene, every=20), label),
    )
    assert np.array_equal(all_frames.q[::20], some.q)
    assert np.array_equal(all_frames.p[::20], some.p)
    assert np.array_equal(all_frames.t[::20], some.t)


@pytest.mark.parametrize("label", [*FIXED, "sundials:adams", "sundials:bdf"])
def test_forces_are_counted(label: str, need: Need) -> None:
    need(label)
    run = springcheck.simulate(scenes.load_scene("spring"), label)
    # ASE asks once more at the start; an adaptive solver needs at least one a step of its own
    assert run.force_calls in (200, 201) or (run.tolerance is not None and run.force_calls > 200)


@pytest.mark.parametrize("label", ["own:semi-implicit-euler", "openmm:verlet", "openmm:verlet@CPU",
                                   "ase:velocity-verlet", "openmm:euler"])  # fmt: skip
def test_a_step_beyond_the_limit_ends_as_diverged_at_its_step(label: str, need: Need) -> None:
    need(label)
    scene = replace(scenes.load_scene("spring-uneven"), step=30.0, steps=2000)
    run = springcheck.simulate(scene, label)
    assert run.outcome.status == "diverged"
    assert np.isfinite(run.q).all()
    assert np.isfinite(run.p).all()
    assert run.outcome.step == len(run.t) - 1
    # each step multiplies the state by about a = (h w)**2 or its root, so overflow comes at a known step;
    # OpenMM squares the length of a bond and overflows at the root of the largest number
    growth = 30.0**2 * 2.9 / 3.7 if label != "openmm:euler" else 30.0 * np.sqrt(2.9 / 3.7)
    largest = np.log(np.finfo(float).max) / (2 if label.startswith("openmm") else 1)
    expected = largest / np.log(growth)
    assert 0.7 * expected < run.outcome.step < 1.3 * expected


def test_openmm_counts_from_rest_where_a_bond_could_turn_over(need: Need) -> None:
    need("openmm:euler")
    scene = scenes.load_scene("chain")
    run = springcheck.simulate(scene, "openmm:euler")
    crossed = np.any(np.diff(run.q, axis=1) < 0)
    assert crossed, "explicit Euler was to grow until particles pass one another"
    assert judged(scene, run) == []


def pair(*more: str, bath: str = "") -> Scene:
    """Two particles on a spring of a rest length, one of them held, beside other terms."""
    text = """
[[particle]]
mass = 3.7
[[particle]]
mass = 1.3
position = 1.0
[[spring]]
ends = [0, 1]
stiffness = 2.9
rest = 0.9
[[spring]]
ends = ["wall", 0]
stiffness = 5.1
"""
    return scenes.parse("\n".join([text, *more, bath, "[time]\nstep = 0.05\nsteps = 400\n"]), name="pair")


DRIVE = "[[drive]]\nparticle = 1\namplitude = 7.0\nfrequency = 1.1"
HILL = "[[cosine]]\nparticle = 1\ndepth = -7.0\nwave = 1.4285714285714286\nat = 1.05"


@pytest.mark.parametrize(
    ("label", "more"), [("openmm:verlet", DRIVE), ("openmm:leapfrog", HILL), ("lammps:bond", DRIVE)]
)
def test_a_bond_that_a_drive_or_a_hill_turns_over_is_counted_from_rest(
    label: str, more: str, need: Need
) -> None:
    need(label)
    scene = pair(more)
    run = springcheck.simulate(scene, label)
    assert np.any(np.diff(run.q, axis=1) < 0)
    assert judged(scene, run) == []


@pytest.mark.parametrize("more", [DRIVE, HILL, "[[weight]]\nparticle = 1\nforce = -7.0\nat = 1.0"])
def test_a_morse_bond_that_may_gain_energy_is_refused(more: str, need: Need) -> None:
    need("openmm:verlet")
    morse = "[[morse]]\nends = [0, 1]\ndepth = 1.0\nsteepness = 1.1\nrest = 0.9"
    scene = pair(morse)
    assert judged(scene, springcheck.simulate(scene, "openmm:verlet")) == []
    alone = [replace(x, terms=[t for t in x.terms if t.key != "spring"]) for x in (scene, pair(morse, more))]
    assert judged(alone[0], springcheck.simulate(alone[0], "openmm:verlet")) == []
    with pytest.raises(MethodError, match="a Morse bond may turn over"):
        springcheck.simulate(alone[1], "openmm:verlet")


def test_velocities_rebuilt_from_positions_that_are_counted_from_rest_are_rounded_there(need: Need) -> None:
    """Where a particle passes 0 its position, counted from rest, is rounded as 0.9 is: 70 of 19 roundings."""
    need("openmm:verlet")
    scene = replace(pair(), p=np.array([0.0, 5.0]), step=0.002, steps=4000)
    assert judged(scene, springcheck.simulate(scene, "openmm:verlet")) == []


BOND = "[[bond]]\nends = [0, 1]\nstiffness = 1.7\nrest = 1.1"


@pytest.mark.parametrize("label", ["openmm:verlet", "lammps:bond"])
def test_a_bond_beside_a_spring_that_may_turn_over_is_refused(label: str, need: Need) -> None:
    need(label)
    scene = pair(BOND)
    assert judged(scene, springcheck.simulate(scene, label)) == []
    wild = replace(scene, p=np.array([0.0, 9.0]))
    with pytest.raises(MethodError, match="a spring and another bond have no common rest"):
        springcheck.simulate(wild, label)


def test_noise_across_the_line_turns_a_bond(need: Need) -> None:
    need("openmm:langevin-middle-bath")
    scene = pair(BOND, bath="[bath]\ntemperature = 0.3\nfriction = 0.7")
    with pytest.raises(MethodError, match="turns a bond"):
        springcheck.simulate(scene, "openmm:langevin-middle-bath", seed=3)
    # ASE's noise is across it too, and its forces are those of the line
    need("ase:langevin-baoab")
    assert judged(scene, springcheck.simulate(scene, "ase:langevin-baoab", seed=3)) == []


def test_springs_without_a_common_rest_are_refused_by_name(need: Need) -> None:
    need("openmm:verlet")
    scene = replace(
        scenes.load_scene("chain"),
        terms=(
            Spring(
                a=np.array([0, 1, 0]),
                b=np.array([1, 2, 2]),
                k=np.full(3, 1.7),
                rest=np.array([1.0, 1.0, 9.0]),
            ),
        ),
    )
    with pytest.raises(MethodError, match="no common rest"):
        springcheck.simulate(scene, "openmm:verlet")


def test_opencl_forces_are_kept_in_fixed_point(need: Need) -> None:
    label = "openmm:verlet@OpenCL-double"
    need(label)
    scene = scenes.load_scene("spring")
    run = springcheck.simulate(scene, label)
    case = checks.Case(trajectory=run, scene=scene)
    defect = np.max(np.abs(case.next_states[1] - run.p[1:]))
    assert defect > 2.0**-34 * scene.step
    assert judged(scene, run) == []


def test_opencl_keeps_force_constants_in_single_precision(need: Need) -> None:
    label = "openmm:verlet@OpenCL-double"
    need(label)
    scene = scenes.load_scene("spring-uneven")
    run = springcheck.simulate(scene, label)
    as_double = replace(run, arithmetic=replace(run.arithmetic, parameters="double"))
    assert "step-defect" in judged(scene, as_double)
    assert "step-defect" not in judged(scene, run)


@pytest.mark.parametrize("precision", ["single", "mixed", "double"])
@pytest.mark.parametrize(
    ("given", "what", "holds"),
    [
        ({"m": 1e50, "step": 1e24}, "mass", {"mixed", "double"}),
        ({"m": 1e-50, "step": 1e-26}, "mass", {"mixed", "double"}),
        ({"m": 1e50, "k": 1e50}, "stiffness of a wall-spring", set()),
        ({"m": 1e-46, "k": 1e-46}, "stiffness of a wall-spring", set()),
        ({"q": 1e25, "m": 1e-25, "k": 1e-25}, "bond's length", {"double"}),
        ({"m": 1e20, "k": 1e-30, "q": 1e12, "step": 1e40}, "step", {"mixed", "double"}),
        ({"m": 1e-30, "p": 1e10, "k": 1e30}, "speed", {"mixed", "double"}),
    ],
)  # fmt: skip
def test_a_scene_beyond_single_precision_is_refused_by_opencl_before_it_runs(
    precision: str, given: dict[str, float], what: str, holds: set[str], need: Need
) -> None:
    label = f"openmm:verlet@OpenCL-{precision}"
    need(label)
    scene = springcheck.spring(**{"q": 1.0, "p": 0.0, "steps": 20, **given})
    if precision in holds:
        assert "outside" not in springcheck.simulate(scene, label).outcome.message
        return
    with pytest.raises(MethodError, match=f"a {what} of .* is outside what it computes with.*other units"):
        springcheck.simulate(scene, label)


def test_a_custom_integrator_on_opencl_takes_two_to_the_32_for_one_less(need: Need) -> None:
    """OpenMM 8.6.1 divides the fixed-point force by 0xFFFFFFFF in CustomIntegrator's kernel, and by
    0x100000000 in VerletIntegrator's: every force is too large by one part in 2**32 - 1."""
    scene = replace(
        scenes.load_scene("spring-uneven"),
        q=np.array([1e6]),
        p=np.zeros(1),
        steps=3,
        terms=(WallSpring(i=np.array([0]), k=np.array([2.875]), at=np.zeros(1)),),
    )
    for method, factor in (("semi-implicit-euler", 1.0), ("leapfrog", 0.0)):
        label = f"openmm:{method}@OpenCL-double"
        need(label)
        run = springcheck.simulate(scene, label)
        kick = np.longdouble(scene.step) * np.longdouble(-2.875) * np.longdouble(1e6)
        too_large = float(run.p[1, 0] / kick - 1) * 2.0**32
        assert abs(too_large - factor) < 1e-5
        assert judged(scene, run) == []
        as_documented = replace(run, arithmetic=replace(run.arithmetic, excess=0.0))
        assert ("step-defect" in judged(scene, as_documented)) == bool(factor)


@pytest.mark.parametrize("precision", ["single", "mixed", "double"])
@pytest.mark.parametrize(
    ("method", "size", "step"), [("euler", 1, 289), ("verlet", 1e3, 2), ("leapfrog", 1e3, 2)]
)
def test_a_force_beyond_fixed_point_fails_with_its_step_and_its_reason(
    method: str, size: float, step: int, precision: str, need: Need
) -> None:
    label = f"openmm:{method}@OpenCL-{precision}"
    need(label)
    plain = scenes.load_scene("anharmonic")
    scene = replace(plain, q=plain.q * size, p=plain.p * size, steps=step + 9)
    run = springcheck.simulate(scene, label)
    (verdict,) = (v for v in checks.judge(scene, run) if v.check == "step-defect")
    assert verdict.passed is False
    assert f"overflows beyond 2**31, and step {step}, the first that is wrong" in verdict.why
    before = replace(
        run,
        t=run.t[:step],
        q=run.q[:step],
        p=run.p[:step],
        energy=run.energy[:step],
        outcome=replace(run.outcome, step=step - 1, status="complete"),
    )
    assert judged(replace(scene, steps=step - 1), before) == []


def test_pocl_turns_every_force_beyond_fixed_point_into_the_lowest_number_and_sums_modulo_2_to_the_64(
    need: Need,
) -> None:
    """`(long)(x * 0x100000000)` of each term, which C leaves open out of range; x86 answers -2**63."""
    label = "openmm:leapfrog@OpenCL-double"
    need(label)
    if not pocl_on_x86():
        pytest.skip("what a conversion out of range gives is this device's own")
    plain = scenes.load_scene("anharmonic")
    k, b, unit = float(np.float32(2.9)), float(np.float32(1.7)), 2.0**32

    def fixed(force: float) -> int:
        return int(force * unit) if abs(force) < 2.0**31 else -(2**63)

    for q in (-46279.44742758134, -1082.0, -1081.0, 1081.0, 1082.0, -8e8, 8e8):
        scene = replace(plain, q=np.array([q]), p=np.zeros(1), steps=1, every=1)
        run = springcheck.simulate(scene, label)
        total = (fixed(-k * q) + fixed(-b * q * q * q) + 2**63) % 2**64 - 2**63
        assert run.p[1, 0] == pytest.approx(scene.step * (total / unit), rel=2.0**-50, abs=0)


def pocl_on_x86() -> bool:
    import openmm

    system = openmm.System()
    system.addParticle(1.0)
    platform = openmm.Platform.getPlatformByName("OpenCL")
    context = openmm.Context(system, openmm.VerletIntegrator(1.0), platform)
    name = platform.getPropertyValue(context, "OpenCLPlatformName")
    return name == "Portable Computing Language" and processor() in ("x86_64", "AMD64")


def test_a_glob_without_regard_to_a_bath_names_what_it_names_with_and_without_one() -> None:
    random = [name for name in engines.names() if engines.engine(name).thermostats]
    assert random
    for name in random:
        apart = {*engines.match((f"{name}:*",)), *engines.match((f"{name}:*",), bath=True)}
        assert set(engines.match((f"{name}:*",), bath=None)) == apart


def test_every_engine_has_methods_of_known_schemes() -> None:
    from springcheck import schemes

    for name in engines.names():
        assert engines.engine(name).methods
        for method in engines.engine(name).methods.values():
            assert method.adaptive != schemes.scheme(method.scheme).has("one-step")


@pytest.mark.parametrize("label", ["own:semi-implicit-euler", "openmm:verlet", "sundials:bdf"])
def test_frames_far_apart_are_reached_in_pieces_to_the_same_numbers(
    label: str, need: Need, monkeypatch: pytest.MonkeyPatch
) -> None:
    need(label)
    scene = replace(scenes.load_scene("spring-uneven"), steps=300, every=100)
    whole = springcheck.simulate(scene, label)
    monkeypatch.setattr(driver, "PIECE", 7)
    told: list[int] = []
    pieces = springcheck.simulate(scene, label, progress=told.append)
    assert np.array_equal(whole.q, pieces.q)
    assert np.array_equal(whole.p, pieces.p)
    assert sum(told) == 300
    assert whole.force_calls == pieces.force_calls


@pytest.mark.parametrize(
    ("label", "first"), [("own:euler", 0), ("own:velocity-verlet", 1), ("ase:velocity-verlet", 1)]
)
@pytest.mark.parametrize("every", [1, 5])
def test_force_calls_of_a_diverged_run_are_those_up_to_its_last_frame(
    label: str, every: int, first: int
) -> None:
    """Its last piece is filled to the end with what is not finite."""
    scene = replace(scenes.load_scene("spring"), step=1e3, steps=1500, every=every)
    run = springcheck.simulate(scene, label)
    assert run.outcome.status == "diverged"
    assert run.force_calls == run.outcome.step + first > 20


@pytest.mark.parametrize("rows", [0, 300])
def test_an_engine_that_fills_nothing_from_some_row_on_is_told_so(rows: int) -> None:
    class Idle:
        force_calls = 0

        def advance(self, every: int, q: np.ndarray, p: np.ndarray) -> None:
            self.force_calls += len(q)
            if self.force_calls < rows:
                q[:], p[:] = 1, 0

    method = engines.Method(name="m", scheme="velocity-verlet", about="nothing")
    idle = engines.Engine(
        name="idle", title="Idle", methods=engines.named(method), start=lambda *given: Idle(),
        version=dict,
    )  # fmt: skip
    scene = replace(scenes.load_scene("spring-uneven"), steps=2000)
    with engines.while_here(idle, "a test", ""), pytest.raises(MethodError, match="of q and p as it was"):
        springcheck.simulate(scene, "idle:m")


def test_chunks_of_any_length_give_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(scenes.load_scene("chain"), steps=1000)
    whole = springcheck.simulate(scene, "own:euler")
    monkeypatch.setattr(driver, "FIRST", 3)
    monkeypatch.setattr(driver, "CHUNK", 40)
    pieces = springcheck.simulate(scene, "own:euler")
    assert np.array_equal(whole.q, pieces.q)
    assert np.array_equal(whole.energy, pieces.energy)


@pytest.mark.parametrize("label", ["openmm:mts", "lammps:respa"])
def test_r_respa_calls_its_fast_and_its_slow_force_as_often_by_every_engine(label: str, need: Need) -> None:
    need(label)
    scene = replace(scenes.load_scene("multiple-time-steps"), steps=100, every=1)
    own = springcheck.simulate(scene, "own:respa8").force_calls
    # a step of ours ends with the forces that the next one starts with, which the first one lacks
    assert (own, springcheck.simulate(scene, label).force_calls) == (902, 900)


def test_forces_beyond_fixed_point_are_the_reason_of_what_moves_across_the_line(need: Need) -> None:
    need("openmm:verlet@OpenCL-double")
    scene = one_spring(m=1e-150, k=2.9, q=1e200, p=0.7, step=0.1, steps=20)
    run = springcheck.simulate(scene, "openmm:verlet@OpenCL-double")
    (verdict,) = (v for v in checks.judge(scene, run) if v.check == "line")
    assert verdict.passed is False
    assert "the engine's limit: fixed-point sum of forces overflows beyond 2**31" in verdict.why
