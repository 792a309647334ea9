"""What an engine declares of itself is believed up to what is known of any, and said in the verdict."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clean
import springcheck
from springcheck import checks, store
from springcheck.checks import compare
from springcheck.cli import file
from springcheck.errors import SpringcheckError
from springcheck.identify import scenes
from springcheck.physics import scenefile
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Outcome, Trajectory
from springcheck.store.records import KEPT


def uneven(**changes: Any) -> Scene:
    return replace(scenefile.load_scene("spring-uneven"), steps=200, **changes)


def run_of(scene: Scene, label: str = "own:semi-implicit-euler") -> Trajectory:
    return springcheck.simulate(scene, label)


def failed(scene: Scene, run: Trajectory) -> set[str]:
    return {v.check for v in springcheck.judge(scene, run) if v.passed is False}


@pytest.mark.parametrize(
    "declared", [{"excess": 0.5}, {"force": 0.5}, {"quantum": 0.5}, {"state": 0.5}, {"force": -1.0}]
)
def test_no_arithmetic_excuses_a_force_half_as_large_again(declared: dict[str, float]) -> None:
    scene = uneven()
    wrong = run_of(scene.system.scaled(1.5))
    wrong = replace(
        wrong, energy=scene.system.energy(wrong.q, wrong.p), arithmetic=replace(Arithmetic(), **declared)
    )
    assert "grid" in failed(scene, wrong)
    (name,) = declared
    (grid,) = (v for v in springcheck.judge(scene, wrong) if v.check == "grid")
    assert f"the engine declares {name} = " in grid.why


@pytest.mark.parametrize("bits", [8, 12, 16, 20])
@pytest.mark.parametrize("scheme", ["semi-implicit-euler", "velocity-verlet"])
def test_no_coarse_state_with_rebuilt_velocities_excuses_a_force_half_as_large_again(
    scheme: str, bits: int
) -> None:
    scene = uneven()
    wrong = run_of(scene.system.scaled(1.5), f"own:{scheme}")
    energy = scene.system.energy(wrong.q, wrong.p)
    coarse = replace(wrong, energy=energy, arithmetic=Arithmetic(state=2.0**-bits), rebuilds_velocity=True)
    (grid,) = (v for v in springcheck.judge(scene, coarse) if v.check == "grid")
    assert not grid.passed
    assert f"the engine declares state = {2.0**-bits:.3g} of its arithmetic, and at most 5.96e-08" in grid.why
    single = replace(coarse, arithmetic=Arithmetic(state=2.0**-24))
    assert {"step-defect", "closed-form"} <= failed(scene, single)
    kept = replace(coarse, arithmetic=Arithmetic(state=2.0**-bits, keeps_displacement=True))
    assert failed(scene, kept) >= ({"step-defect"} if bits >= 20 else {"grid"})
    assert bits < 20 or "grid" not in failed(scene, kept)


@pytest.mark.parametrize("declared", [{"state": 1e-3}, {"force": 1e-3}])
def test_no_declared_rounding_hides_a_stiffness_off_by_a_thousandth(declared: dict[str, float]) -> None:
    scene = uneven()
    wrong = run_of(scene.system.scaled(1.001))
    wrong = replace(wrong, energy=scene.system.energy(wrong.q, wrong.p), arithmetic=Arithmetic(**declared))
    (grid,) = (v for v in springcheck.judge(scene, wrong) if v.check == "grid")
    assert not grid.passed
    assert f"declares {next(iter(declared))} = 0.001" in grid.why


@pytest.mark.parametrize("label", ["openmm:verlet", "openmm:euler", "lammps:bond"])
def test_bonds_whose_squared_length_underflows_fail_with_that_reason(label: str, need: Any) -> None:
    need(label)
    scene = uneven()
    small = replace(scene, q=1e-170 * scene.q, p=1e-170 * scene.p)
    (step,) = (v for v in springcheck.judge(small, run_of(small, label)) if v.check == "step-defect")
    assert not step.passed
    assert "squares that underflow: an engine that takes forces from the lengths" in step.why
    wrong = run_of(scene.system.scaled(1.5))
    (step,) = checks.judge(scene, wrong, [checks.step_defect])
    assert "underflow" not in step.why


def test_no_arithmetic_of_baths_excuses_a_step_a_fifth_too_long() -> None:
    scene = replace(scenefile.load_scene("bath-spring"), steps=100)
    right = springcheck.simulate(scene, "own:baoab", seed=3)
    wrong = springcheck.simulate(replace(scene, step=1.2 * scene.step), "own:baoab", seed=3)
    wrong = replace(
        wrong, t=right.t, step=right.step, energy=scene.system.energy(wrong.q, wrong.p),
        arithmetic=Arithmetic(cancels=9),
    )  # fmt: skip
    assert "grid" in failed(scene, wrong)


@pytest.mark.parametrize("off", [1e-300, -1e-300, float("nan")])
def test_a_size_beside_the_line_is_none_below_0(off: float) -> None:
    scene = uneven()
    assert failed(scene, replace(run_of(scene), off_axis=off)) == {"line"}


def test_a_declared_arithmetic_is_said_in_the_verdict() -> None:
    scene = uneven()
    run = run_of(scene)
    (plain,) = checks.judge(scene, run, [checks.step_defect])
    assert "declares" not in plain.why
    coarse = replace(run, arithmetic=Arithmetic(name="single", state=2.0**-24, parameters="single"))
    (said,) = checks.judge(scene, coarse, [checks.step_defect])
    assert "as the engine declares: states to 6e-08, parameters in single precision" in said.why


def test_calls_that_a_solver_says_it_made_are_believed_up_to_64_a_frame() -> None:
    scene = uneven(tolerance=1e-10)
    run = run_of(scene, "sundials:adams")
    assert failed(scene, run) == set()

    def bound(calls: int) -> float:
        judged = checks.judge(scene, replace(run, force_calls=calls), [checks.tolerance])
        assert "internal steps" in judged[0].why
        said = "of the 1e+09 force calls that it declares 12800 are believed, the most of 64 a frame"
        assert (said in judged[0].why) is (calls > 12800)
        return judged[0].bound

    assert bound(10**9) <= 64 * 200 / run.force_calls * bound(run.force_calls) * 1.001
    assert bound(10**9) < 5e-6


def test_a_solver_that_stops_at_its_first_row_is_not_judged() -> None:
    scene = uneven(tolerance=1e-10)
    run = run_of(scene, "sundials:adams")
    assert run.energy is not None
    tired = replace(
        run, t=run.t[:1], q=run.q[:1], p=run.p[:1], energy=run.energy[:1],
        outcome=Outcome(status="stopped", step=0, message="tired"),
    )  # fmt: skip
    verdicts = checks.judge(scene, tired)
    assert checks.not_judged(verdicts) == (run.label,)
    assert checks.status(verdicts) == 2
    runs = {run.label: tired}
    assert compare.same_motions(scene, runs, compare.compare(scene, runs)) == []


DECLARED: dict[str, dict[str, Any]] = {
    "nothing": {},
    "state": {"arithmetic": Arithmetic(name="single", state=2.0**-24)},
    "force": {"arithmetic": Arithmetic(name="mixed", force=2.0**-24)},
    "quantum": {"arithmetic": Arithmetic(name="fixed", quantum=2.0**-32)},
    "overflow": {"arithmetic": Arithmetic(name="fixed", quantum=2.0**-32, overflow=1e-3)},
    "parameters": {"arithmetic": Arithmetic(name="mixed", parameters="single")},
    "excess": {"arithmetic": Arithmetic(excess=1e-7)},
    "stale": {"arithmetic": Arithmetic(stale=1e-3)},
    "cancels": {"arithmetic": Arithmetic(cancels=2)},
    "keeps_displacement": {"arithmetic": Arithmetic(keeps_displacement=True), "rebuilds_velocity": True},
    "from_start": {"arithmetic": Arithmetic(from_start=True)},
    "joints": {"arithmetic": Arithmetic(joints=True)},
    "rebuilds_velocity": {"rebuilds_velocity": True},
    "off_axis": {"off_axis": 1e-9},
}


def test_every_fact_of_an_arithmetic_is_stored() -> None:
    # decimals are those of a text that is judged: no run has them
    every = {one.name for one in fields(Arithmetic)} - {"written"}
    assert {f"arithmetic.{name}" for name in every} <= set(KEPT.values())
    assert every <= {*DECLARED, "name"}


@pytest.mark.parametrize("fact", DECLARED)
def test_a_store_is_judged_as_its_run_was_whatever_it_declares(tmp_path: Path, fact: str) -> None:
    scene = uneven(quantities=("q", "p", "energy"))
    # a kick that is off by what some of these facts excuse, so that it matters whether they are read
    run = run_of(scene)
    kicked = run.p.copy()
    kicked[7] *= 1 + 1e-7
    run = replace(run, p=kicked, **DECLARED[fact])
    with store.open_new(tmp_path / "a.h5", "run") as journal:
        journal.save(run, scene)
        journal.commit(scene)
    again = file.judge(tmp_path / "a.h5", scene=scene, scheme=run.scheme)
    known = {v.check: v for v in again.verdicts}
    wanted = checks.explained(scene, run, checks.judge(scene, run), scenes.diagnosis)
    assert any(one.passed is not None for one in wanted)
    for one in wanted:
        other = known[one.check]
        assert (one.passed, one.why, repr(one.value), repr(one.bound), one.sees) == (
            other.passed, other.why, repr(other.value), repr(other.bound), other.sees
        ), one.check  # fmt: skip


def many() -> Scene:
    rng, each = np.random.default_rng(4), np.ones(37)
    start = rng.normal(size=37), rng.normal(size=37)
    return clean.scene(each, (clean.walls(rng.uniform(1, 2, 37), 0 * each),), *start, step=0.1, steps=50)


@pytest.mark.parametrize("kind", ["Fortran order", "transposed views", "long doubles"])
def test_energies_do_not_depend_on_the_order_or_width_of_an_array(kind: str) -> None:
    scene = many()
    run = run_of(scene)

    def of(x: Floats) -> Any:
        if kind == "Fortran order":
            return np.asfortranarray(x)
        return np.ascontiguousarray(x.T).T if kind == "transposed views" else x.astype(np.longdouble)

    q, p = of(run.q), of(run.p)
    assert failed(scene, replace(run, q=q, p=p, energy=scene.system.energy(q, p))) == set()
    assert failed(scene, replace(run, q=q, p=p)) == set() or kind == "long doubles"


@pytest.mark.parametrize("name", ["t", "q", "p", "energy"])
def test_lists_and_objects_are_refused_in_one_line(name: str) -> None:
    scene = many()
    run = run_of(scene)
    for given in (getattr(run, name).tolist(), getattr(run, name).astype(object)):
        with pytest.raises(SpringcheckError, match=rf"^own:semi-implicit-euler: {name} is [^\n]* needed$"):
            springcheck.judge(scene, replace(run, **{name: given}))


def stoermer(scene: Scene, words: str) -> tuple[Floats, Floats, Floats]:
    """The positions of Stoermer's recurrence, and momenta from their differences; 200 steps."""
    h, m, force = scene.step, scene.m, scene.system.force
    q = [scene.q, scene.q + h * scene.p / m + h * h / 2 * force(scene.q, scene.p) / m]
    for _ in range(200):
        q.append(2 * q[-1] - q[-2] + h * h * force(q[-1], scene.p) / m)
    if words == " over two steps":
        p = [scene.p, *(m * (after - before) / (2 * h) for before, after in zip(q, q[2:], strict=False))]
    else:
        # as OpenMM's VerletIntegrator, once its velocity is taken to the time of the position
        p = [
            scene.p,
            *(m * (x - y) / h + h / 2 * force(x, scene.p) for x, y in zip(q[1:201], q, strict=False)),
        ]
    return np.arange(201) * h, np.array(q[:201]), np.array(p)


@pytest.mark.parametrize("words", [" over two steps", " and half a kick"])
@pytest.mark.parametrize("name", ["spring-uneven", "chain", "orbit", "anharmonic"])
def test_velocities_that_are_differences_pass_where_that_is_declared(
    name: str, words: str, tmp_path: Path
) -> None:
    """They keep eps q/h of a velocity: 125 roundings where 19 are allowed of momenta that are states."""
    scene = replace(scenefile.load_scene(name), steps=200)
    t, q, p = stoermer(scene, words)
    run = springcheck.Trajectory.from_arrays(t, q, p, scene=scene, scheme="velocity-verlet")
    path = run.save(tmp_path / "run.csv")
    given: dict[str, Any] = {"scene": scene, "scheme": "velocity-verlet"}
    plain, declared = (file.judge(path, differences=x, **given) for x in (False, True))
    assert {v.check for v in plain.verdicts if v.passed is False} == {"step-defect"}
    assert any("--differences" in note for note in plain.notes)
    assert declared.status == 0
    assert any("differences of positions" in note for note in declared.notes)
    # a wrong force fails all the same, and is not called a matter of differences
    heavy = scene.derived(m=scene.m * (1 + 1e-9))
    _, q, p = stoermer(heavy, words)
    path = replace(run, q=q, p=p / (1 + 1e-9)).save(tmp_path / "wrong.csv")
    for declares in (False, True):
        found = file.judge(path, differences=declares, **given)
        assert found.status == 1
        assert not any("--differences" in note for note in found.notes)
