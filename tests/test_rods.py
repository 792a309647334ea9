"""Rods: SHAKE and RATTLE to rounding, what checks say of them, and what a scene file may ask of them.

The law: a rod that turns freely turns by asin(h w) in a drift of h, and keeps its speed; the multiplier of
one rod solves a quadratic.
"""

from __future__ import annotations

import contextlib
import csv
import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import constraints
import gromacs
import springcheck
from springcheck import checks, driver, engines, schemes, store
from springcheck.checks import Case, stretch
from springcheck.checks.record import MOST_DECLARED
from springcheck.cli import main
from springcheck.errors import MethodError, SceneError
from springcheck.identify import files
from springcheck.identify.files import rod_of
from springcheck.physics import exact, scenefile
from springcheck.physics.rods import Rods
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Cosine, Rod, Spring, WallRod, WallSpring, Weight
from springcheck.studies.faults import measure
from springcheck.studies.faults.rigid import Rattle
from springcheck.studies.faults.seeded import Fault
from springcheck.studies.precision import accuracy, sweeps

Need = Callable[[str], None]
OWN = ("own:velocity-verlet", "own:semi-implicit-euler", "own:position-verlet", "own:forest-ruth")
RIGHT = (*OWN, "ase:rattle", "openmm:verlet-rods", "openmm:verlet-rods-8", "openmm:verlet-rods-as-it-is")


def dumbbell() -> Scene:
    return scenefile.load_scene("dumbbell")


def rods(scene: Scene) -> Rods:
    assert scene.system.rods is not None
    return scene.system.rods


def triangle(**changes: object) -> Scene:
    """Three unlike masses on three rods in space, turning about no axis of the frame, and drifting."""
    q = np.array([0.0, 0.0, 0.0, 0.7, 0.1, 0.2, 0.3, 0.8, -0.1])
    m = np.repeat([1.3, 2.9, 0.7], 3)
    x = q.reshape(3, 3) - np.average(q.reshape(3, 3), axis=0, weights=[1.3, 2.9, 0.7])
    p = m * (np.cross([0.4, -0.7, 1.1], x) + np.array([0.1, 0.2, -0.3])).ravel()
    a, b = np.array([0, 1, 2, 0, 1, 2, 3, 4, 5]), np.array([3, 4, 5, 6, 7, 8, 6, 7, 8])
    length = np.repeat(np.linalg.norm((q[b] - q[a]).reshape(3, 3), axis=1), 3)
    joined = Rod(a=a, b=b, length=length)
    fields = {"m": m, "q": q, "p": p, "terms": (joined,), "places": np.arange(9), "step": 0.1, "steps": 100}
    return Scene(**{**fields, **changes})  # type: ignore[arg-type]


@pytest.mark.campaign
@pytest.mark.parametrize("label", RIGHT)
def test_right_engines_pass_every_check_of_a_dumbbell(label: str, need: Need) -> None:
    need(label)
    scene = dumbbell()
    run = driver.run(scene, label)
    verdicts = checks.judge(scene, run)
    assert [v for v in verdicts if v.passed is False] == []
    judged = {v.check for v in verdicts if v.passed}
    assert {"step-defect", "momentum", "angular-momentum", "rod-length", "rod-velocity", "turn"} <= judged
    names = {"reversibility", "mirror", "orientation", "repeatability"}
    experiments = [one for one in checks.THOROUGH if one.name in names]
    thorough = checks.judge_thoroughly(scene, label, driver.run, experiments)
    assert [v for v in thorough if v.passed is False] == []
    assert {v.check for v in thorough if v.passed} >= {"mirror", "repeatability"}


@pytest.mark.campaign
@pytest.mark.parametrize("label", RIGHT)
def test_right_engines_pass_every_check_of_a_rigid_pendulum(label: str, need: Need) -> None:
    need(label)
    scene = scenefile.load_scene("rigid-pendulum")
    run = driver.run(scene, label)
    verdicts = checks.judge(scene, run)
    assert [v for v in verdicts if v.passed is False] == []
    assert {"step-defect", "rod-length", "rod-velocity"} <= {v.check for v in verdicts if v.passed}
    assert next(v.passed for v in verdicts if v.check == "turn") is None
    energy = scene.system.energy(run.q, run.p)
    # h w = 0.1 is the error of a scheme of first order
    assert np.max(np.abs(energy - energy[0])) < 0.1 * np.ptp(scene.system.kinetic_energy(run.p))


@pytest.mark.parametrize(("low", "speed"), [(0.05, 0.1), (-0.6, 0.8), (0.3, 30.0), (-0.65, 5.0)])
def test_the_exact_motion_of_a_rigid_pendulum_is_that_of_the_angle(low: float, speed: float) -> None:
    """Small swings, wide ones, over the top, and from the very top."""
    side = float(np.sqrt(0.65**2 - low**2))
    p = 1.7 * speed * np.array([-low, side]) / 0.65
    pendulum = scenefile.load_scene("rigid-pendulum")
    rigid = pendulum.derived(q=np.array([0.2 + side, 0.1 + low]), p=p)
    angle = np.arctan2(side, -low)
    alone = Scene(
        m=[1.7 * 0.65**2], q=[angle], p=[1.7 * 0.65 * speed], step=0.03, steps=400, kind="rotor",
        terms=(Cosine(i=[0], depth=[12.6 * 0.65], wave=[1.0], at=[0.0]),),
    )  # type: ignore[arg-type]  # fmt: skip
    steps = np.arange(0, 100, 7)
    (q, _), (turned, _) = (exact.true_motion(x, steps, 0.03) for x in (rigid, alone))
    x, y = 0.2 + 0.65 * np.sin(turned[:, 0]), 0.1 - 0.65 * np.cos(turned[:, 0])
    # from the top a rounding of the start grows by exp(w t): those of the angle are 1e-16 of it
    assert np.max(np.abs(q - np.stack([x, y], axis=1))) < 1e-12


@pytest.mark.parametrize("label", OWN)
def test_a_free_rod_turns_by_the_arc_sine_of_h_w_in_every_drift_and_keeps_its_speed(label: str) -> None:
    scene = dumbbell()
    run = driver.run(scene, label)
    r = run.q[:, 2:] - run.q[:, :2]
    angle = np.unwrap(np.arctan2(r[:, 1], r[:, 0]))
    stages = schemes.scheme(run.scheme)
    parts = [c for kind, (_, c) in zip(stages.kinds, stages.stages, strict=True) if kind.drifts]
    turn = sum(np.arcsin(float(schemes.number(c, np.float64)) * 0.15) for c in parts)
    # 400 steps: each rounds way and momentum by a few roundings of a position up to 8 rods from the origin
    assert np.max(np.abs(angle - angle[0] - np.arange(401) * turn)) < 400 * 1e-14
    speed = scene.system.kinetic_energy(run.p)
    assert np.max(np.abs(speed / speed[0] - 1)) < 400 * 1e-14


def test_a_tolerance_is_not_the_error_of_lengths(need: Need) -> None:
    need("openmm:verlet-rods")
    off = {}
    for tolerance, name in ((1e-13, "verlet-rods"), (1e-8, "verlet-rods-8"), (1e-5, "verlet-rods-as-it-is")):
        run = driver.run(dumbbell(), f"openmm:{name}")
        assert run.arithmetic.lengths == tolerance
        off[tolerance] = float(np.max(np.abs(rods(dumbbell()).strain(run.q))))
        momenta = [v for v in checks.judge(dumbbell(), run) if v.check in ("momentum", "angular-momentum")]
        # pushes along the rod cancel and turn nothing, however large they are: to rounding at every tolerance
        assert all(v.passed and v.value < v.bound < 1e4 for v in momenta)
    assert off[1e-13] < 1e-14 < off[1e-8] < 1e-8 < off[1e-5] < 1e-6


def test_the_error_falls_with_the_tolerance_in_steps_of_whole_iterations() -> None:
    """What `validation/constraints.py` has measured: its claim, row by row, and what a tolerance does."""
    with constraints.TABLE.open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert [row for row in table if not constraints.holds(row)] == []
    for key in (("openmm", "one"), ("openmm", "triangle"), ("lammps", "triangle")):
        rows = [row for row in table if (row["engine"], row["rods"]) == key and row["h w"] == "0.15"]
        off = {float(row["tolerance"]): float(row["length"]) for row in rows}
        ordered = [off[tolerance] for tolerance in sorted(off, reverse=True)]
        assert len(ordered) == len(constraints.TOLERANCES)
        assert max(off) <= MOST_DECLARED["lengths"][0], "a coarser one fails `grid`"
        assert ordered == sorted(ordered, reverse=True)
        # it is not the error: several tolerances have one in common
        assert len(set(ordered)) < len(ordered)
        assert ordered[-1] < 1e-14
        assert ordered[0] > 1e-9


def test_shake_in_single_precision_keeps_lengths_to_that_and_lets_momentum_sway(need: Need) -> None:
    label = "openmm:verlet-rods@OpenCL-double"
    need(label)
    run = springcheck.simulate(dumbbell(), label)
    assert run.arithmetic.lengths == 2.0**-24
    failed = {v.check for v in springcheck.judge(dumbbell(), run) if v.passed is False}
    assert failed == {"momentum", "angular-momentum"}
    triangle = springcheck.load_scene("rigid-triangle")
    verdicts = springcheck.judge(triangle, springcheck.simulate(triangle, label))
    assert [v.check for v in verdicts if v.passed is False] == []
    assert sum(v.passed is True for v in verdicts) >= 8


def test_the_tolerance_of_lengths_is_stored_and_read(tmp_path: Path, need: Need) -> None:
    need("openmm:verlet-rods-as-it-is")
    scene = replace(dumbbell(), steps=5, include=("openmm:verlet-rods-as-it-is",))
    path = tmp_path / "a.h5"
    springcheck.run(scene, path=path)
    (run,) = store.read(path).values()
    assert run.arithmetic.lengths == 1e-5


def test_a_rattle_written_out_by_itself_is_judged_right() -> None:
    scene = measure.scene("dumbbell")
    run = Fault("right", "", step=Rattle().step).run(scene)
    verdicts = checks.judge(scene, run)
    assert [v.check for v in verdicts if v.passed is False] == []
    assert sum(v.passed is True for v in verdicts) >= 10


def test_from_h_w_1_on_there_is_no_step_and_that_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "dumbbell", "--step", "0.7", "--steps", "9", "-o", "/dev/null/a.h5"]) == 2
    assert "turns by h w = 1.05 in a drift, and from h w = 1 on" in capsys.readouterr().err
    # a drift of half a step reaches further
    assert "turns" in (
        engines.refusal(replace(dumbbell(), step=0.7), engines.parse("own:velocity-verlet")) or ""
    )
    assert engines.refusal(replace(dumbbell(), step=0.7), engines.parse("own:position-verlet")) is None
    near = replace(dumbbell(), step=0.66, steps=20)
    run = driver.run(near, "own:velocity-verlet")
    assert run.outcome.status == "complete"
    assert [v for v in checks.judge(near, run) if v.passed is False] == []


@pytest.mark.parametrize(("label", "order"), [("own:forest-ruth", 2), ("own:yoshida4", 4)])
def test_a_splitting_whose_substeps_meet_in_drifts_loses_its_order_to_rods(label: str, order: int) -> None:
    scene = dumbbell()
    q, _ = exact.true_motion(scene, np.array([5]), 0.1)
    off = []
    for parts in (1, 2):
        run = driver.run(replace(scene, step=0.1 / parts, steps=5 * parts, every=5 * parts), label)
        off.append(float(np.max(np.abs(run.q[-1] - q[0]))))
    assert np.log2(off[0] / off[1]) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("name", ["dumbbell", "rigid-triangle"])
def test_internal_coordinates_of_ase_leave_no_scene_with_rods_a_motion(name: str, need: Need) -> None:
    """Why they are no method: `adjust_momenta` takes off all that a rigid body does."""
    need("ase:rattle")
    ase, constraints = pytest.importorskip("ase"), pytest.importorskip("ase.constraints")
    verlet, calculator = pytest.importorskip("ase.md.verlet"), pytest.importorskip("ase.calculators.lj")
    scene = scenefile.load_scene(name)
    q, p = np.zeros((2, 3 * scene.particles))
    q[scene.where], p[scene.where] = scene.q, scene.p
    atoms = ase.Atoms(
        numbers=np.ones(scene.particles),
        positions=q.reshape(-1, 3),
        momenta=p.reshape(-1, 3),
        masses=scene.masses,
    )
    atoms.calc = calculator.LennardJones(epsilon=0.0)
    pairs = [list(ends) for ends in rods(scene).ends]
    atoms.set_constraint(
        constraints.FixInternals(bonds=[[atoms.get_distance(*x), x] for x in pairs], epsilon=1e-13)
    )
    before = atoms.get_kinetic_energy()
    if name == "dumbbell":
        with pytest.raises(IndexError):
            verlet.VelocityVerlet(atoms, 0.1).run(1)
        return
    verlet.VelocityVerlet(atoms, 0.1).run(1)
    assert atoms.get_kinetic_energy() < 1e-20 * before


def test_methods_without_rods_say_so() -> None:
    for label in ("own:euler", "ase:velocity-verlet", "openmm:verlet", "sundials:adams"):
        assert engines.refusal(dumbbell(), engines.parse(label)) == "it has no rod term"
    spring = scenefile.load_scene("spring")
    assert engines.refusal(spring, engines.parse("ase:rattle")) == "it is for scenes with rods"


def test_the_exact_motion_of_a_dumbbell_is_that_of_ever_shorter_steps() -> None:
    scene = dumbbell()
    end = []
    for parts in (1, 2, 4):
        fine = replace(scene, step=0.1 / 32 / parts, steps=320 * parts, every=320 * parts)
        run = driver.run(fine, "own:velocity-verlet")
        end.append(np.concatenate([run.q[-1], run.p[-1]]))
    once = [(4 * b - a) / 3 for a, b in itertools.pairwise(end)]
    q, p = exact.true_motion(scene, np.array([10]), 0.1)
    assert np.max(np.abs((16 * once[1] - once[0]) / 15 - np.concatenate([q[0], p[0]]))) < 1e-12
    # 64 roundings for each of 66 radians and of 25 lengths on the way
    assert 0 < exact.uncertainty(scene, 40.0) < 1e-15 or np.finfo(np.longdouble).eps > 1e-16


@pytest.mark.parametrize("make", [dumbbell, triangle])
def test_the_tangent_map_of_a_step_is_its_derivative(make: Callable[[], Scene]) -> None:
    scene = make()
    run = driver.run(scene, "own:velocity-verlet")
    case = Case(trajectory=run, scene=scene)
    q, p = (x[7:8].astype(np.longdouble) for x in (run.q, run.p))
    found = stretch.tangent(case, q, p)[0]
    n, e = scene.n, 1e-5
    for j in range(2 * n):
        push = np.zeros(2 * n)
        push[j] = e
        ends = [np.concatenate(case.step(q + s * push[:n], p + s * push[n:]), axis=-1)[0] for s in (1, -1)]
        assert np.max(np.abs((ends[0] - ends[1]) / (2 * e) - found[:, j])) < 1e-8


def test_rods_that_share_particles_are_solved_to_rounding() -> None:
    scene = triangle()
    assert rods(scene).share
    run = driver.run(scene, "own:velocity-verlet")
    assert run.outcome.status == "complete"
    assert np.max(np.abs(rods(scene).strain(run.q))) < 1e-13
    verdicts = checks.judge(scene, run)
    assert [v.check for v in verdicts if v.passed is False] == []
    judged = {v.check for v in verdicts if v.passed}
    assert {"step-defect", "momentum", "angular-momentum", "rod-length", "rod-velocity"} <= judged
    wide = [x[:-1].astype(np.longdouble) for x in (run.q, run.p)]
    q, _ = Case(trajectory=run, scene=scene).step(*wide)
    assert np.max(np.abs(rods(scene).strain(q))) < 1e-17 or np.finfo(np.longdouble).eps > 1e-16


def test_momenta_are_projected_to_the_rounding_of_their_own_width() -> None:
    scene = triangle()
    p = np.random.default_rng(3).normal(size=(5, 9)).astype(np.longdouble)
    q = np.tile(scene.q.astype(np.longdouble), (5, 1))
    held, r = rods(scene).projected(q, p), rods(scene).ways(q)
    along = rods(scene).dot(r, rods(scene).apart(held / scene.m))
    most = rods(scene).sum_of_sizes(r, np.abs(held) / scene.m)
    # a sum of 12 products, and pushes of as many roundings, solved for once more than they need
    assert np.all(np.abs(along) <= 64 * np.finfo(np.longdouble).eps * most)


def test_what_a_rounding_of_a_length_does_to_a_step_is_what_its_bound_says() -> None:
    """By a rod that is longer by a small part: exactly, and no less of what its push leaves across it."""
    scene, x, part = dumbbell(), np.longdouble(0.15), 1e-7
    q, p = scene.q.astype(np.longdouble), scene.p.astype(np.longdouble)
    (rod,) = (term for term in scene.terms if isinstance(term, Rod))
    ends = []
    for length in (rod.length, rod.length * (1 + part)):
        known = Rods(scene.m, scene.places, [replace(rod, length=length)])
        held = known.drifted(q, q + x * p / scene.m, p, x)
        ends.append((*held, known.projected(*held)))
    off_q, _, off_p = (np.abs(more - less) / part for less, more in zip(*ends, strict=True))
    of_q, of_p = rods(scene).sizes(q, *ends[0][:2], x, (0 * q, 0 * p), (0.0, 0.0))
    assert np.asarray(of_q / off_q, float) == pytest.approx(1, abs=10 * part)
    # and what is taken back along the rod, whose sizes of two axes are added up
    assert 1 <= np.linalg.norm(of_p.astype(float)) / np.linalg.norm(off_p.astype(float)) <= 1 + 2**0.5


@pytest.mark.parametrize(("share", "right"), [(0.5, True), (1.5, False)])
@pytest.mark.parametrize("what", ["its length is", "its ends come apart"])
def test_a_start_is_true_to_64_roundings(what: str, share: float, right: bool) -> None:
    scene = dumbbell()
    known, q, p = rods(scene), scene.q, scene.p
    r = known.ways(q)
    if what == "its length is":
        more = share * 2.0**-46 * (1 + known.magnitude(q)) * r
        q = q + np.concatenate([0 * more, more])
    else:
        along = share * 2.0**-46 * known.sum_of_sizes(r, np.abs(p) / scene.m)
        p = p + known.spread(known.each(along / known.dot(r, r) / known.inverse_mass) * r).astype(float)
    with contextlib.nullcontext() if right else pytest.raises(SceneError, match=what):
        known.check(q, p)


@pytest.mark.parametrize("what", ["momenta without a step", "a frame of zeros"])
def test_frames_from_which_no_step_leads_hide_no_others(what: str) -> None:
    """Rods that share particles are solved for together, of all frames at once, but each frame by itself."""
    scene = triangle(steps=20)
    right = driver.run(scene, "own:velocity-verlet")
    q, p = right.q.copy(), right.p.copy()
    if what == "a frame of zeros":
        q[15:] = p[15:] = 0
    else:
        p[15:] *= 1e6
    broken = replace(right, q=q, p=p)
    verdicts = {v.check: v for v in checks.judge(replace(scene, quantities=("q", "p")), broken)}
    assert verdicts["step-defect"].passed is False
    assert "at step 15" in verdicts["step-defect"].why
    p[3:] = right.p[3:] * (1 + 1e-9)
    verdicts = {v.check: v for v in checks.judge(replace(scene, quantities=("q", "p")), broken)}
    assert "at step 3" in verdicts["step-defect"].why


@pytest.mark.parametrize("label", ["own:velocity-verlet", "ase:rattle", "openmm:verlet-rods"])
def test_a_rod_to_a_fixed_point_turns_about_it(label: str, need: Need) -> None:
    need(label)
    rod = WallRod(i=[0, 1], at=[0.2, -0.3], length=[0.5, 0.5])  # type: ignore[arg-type]
    scene = Scene(
        m=[3.7, 3.7], q=[0.5, 0.1], p=[-0.8, 0.6], places=[0, 1], terms=(rod,), step=0.1, steps=200,
        title="t",
    )  # type: ignore[arg-type]  # fmt: skip
    run = driver.run(scene, label)
    verdicts = checks.judge(scene, run)
    assert [v.check for v in verdicts if v.passed is False] == []
    assert {"step-defect", "rod-length", "rod-velocity", "turn"} <= {v.check for v in verdicts if v.passed}
    assert scenefile.parse(scene.to_toml(), name="a").digest == scene.digest


@pytest.mark.parametrize("make", [dumbbell, triangle])
def test_a_scene_with_rods_is_written_and_read_with_the_same_numbers(make: Callable[[], Scene]) -> None:
    assert scenefile.parse(make().to_toml(), name="a").digest == make().digest


FILE = """title = "t"
particle = [{mass = 1.3, position = [0, 0], momentum = [0, 0]},
  {mass = 2.1, position = [0.3, 0.4], momentum = %s}]
time = {step = 0.1, steps = 10}
rod = [%s]
"""


def test_a_length_that_is_left_out_is_that_of_the_start() -> None:
    scene = scenefile.parse(FILE % ("[0.8, -0.6]", "{ends = [0, 1]}"), name="a")
    assert rods(scene).length.tolist() == [0.5]


@pytest.mark.parametrize(
    ("momentum", "rod", "said"),
    [
        ("[0.8, -0.6]", "{ends = [0, 1], length = 0.6}", "its length is 0.6, and its ends are 0.5 apart"),
        ("[0.8, 0.6]", "{ends = [0, 1]}", "its ends come apart by 0.457 a unit of time at the start"),
        ("[-0.8, -0.6]", "{ends = [0, 1]}", "its ends approach each other by 0.457 a unit of time"),
        ("[0.8, -0.6]", "{ends = [0, 1]}, {ends = [0, 1]}", "the rods before it keep its length too"),
        ("[0.8, -0.6]", "{ends = [0, 0]}", "the two ends are the same particle"),
        ("[0.8, -0.6]", "{ends = [0, 2]}", "rod[0].ends = 2: particles here are numbered from 0 to 1"),
        ("[0.8, -0.6]", "{ends = ['wall', 'wall']}", "a rod between two walls holds nothing"),
        ("[0.8, -0.6]", "{ends = [0, 1], wall = 0.1}", "no end of it is a wall"),
        ("[0.8, -0.6]", "{ends = ['wall', 1], wall = [0.1]}", "2 for its axes are needed, not 1"),
        ("[0.8, -0.6]", "{ends = ['wall', 0]}", "its ends are at one place"),
        ("[0.8, -0.6]", "{ends = [0, 1], length = -1}", "rod[0].length = -1"),
        ("[0.8, -0.6]", "{ends = [0, 1], lenght = 1}", "lenght"),
    ],
)
def test_mistakes_in_rods_are_said_in_a_line(momentum: str, rod: str, said: str) -> None:
    with pytest.raises(SceneError) as caught:
        scenefile.parse(FILE % (momentum, rod), name="a")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_rod_along_others_that_keep_its_length_is_named_and_a_body_with_all_that_it_needs_is_not() -> None:
    """Three on a line; and four particles on six rods, whose rods are as many as their lengths."""
    line = FILE.replace("]\ntime", ",\n {mass = 0.7, position = [0.6, 0.8], momentum = [0, 0]}]\ntime")
    three = "{ends = [0, 1]}, {ends = [1, 2]}, {ends = [0, 2]}"
    with pytest.raises(
        SceneError, match="the rod of particles 0 and 2: at the start the rods before it keep"
    ):
        scenefile.parse(line % ("[0, 0]", three), name="a")
    bent = line.replace("[0.6, 0.8]", "[0.6, 0.8001]")
    assert len(rods(scenefile.parse(bent % ("[0, 0]", three), name="a"))) == 3
    corners = np.vstack([np.zeros(3), np.diag([1.0, 0.7, 1.3])]).ravel()
    pairs = [(a, b) for a in range(4) for b in range(a)]
    ends = np.array([[3 * i + axis for i in pair] for pair in pairs for axis in range(3)])
    far = [np.linalg.norm(corners.reshape(4, 3)[a] - corners.reshape(4, 3)[b]) for a, b in pairs]
    rod = Rod(a=ends[:, 0], b=ends[:, 1], length=np.repeat(far, 3))
    body = Scene(
        m=np.repeat([1.3, 2.1, 0.7, 0.9], 3), q=corners, p=np.zeros(12), terms=(rod,), step=0.1, steps=3,
        places=np.arange(12),
    )  # fmt: skip
    assert rods(body).freedoms == 6


def test_a_particle_too_light_for_rods_on_one_line_is_named() -> None:
    q, ends = np.array([0.0, 1.0, 2.0]), {"a": [0, 1], "b": [1, 2]}
    line = {"q": q, "p": np.zeros(3), "terms": (Rod(**ends, length=[1.0, 1.0]),), "step": 0.1, "steps": 3}
    with pytest.raises(
        SceneError, match="particles 1 and 2: particle 1, of mass 1e-14 beside 3, is too light"
    ):
        Scene(m=[1.0, 1e-14, 3.0], **line)
    # at an end of the line it is held by one rod, which no other resembles
    assert len(rods(Scene(m=[1e-14, 1.0, 3.0], **line))) == 2


def test_rounding_that_hides_a_momentum_in_space_is_said_of_a_particle_and_its_axis() -> None:
    scene = replace(scenefile.load_scene("dumbbell"), steps=30)
    run = driver.run(scene, "own:velocity-verlet")
    (found,) = checks.judge(scene, replace(run, p=run.p + 1e-6), [checks.step_defect])
    assert re.search(r"p_x of particle 0 \(\S+\), p_y of particle 0 \(\S+\), p_x of particle 1 ", found.why)


def test_a_run_and_its_page_say_what_a_pass_does_not_cover(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["--method", "own:velocity-verlet", "--steps", "9"]
    assert main(["run", "dumbbell", *given, "-o", str(tmp_path / "a.h5")]) == 0
    left = "Not exercised here: axis z, periodic boxes, friction, drives, magnetic fields"
    assert left in capsys.readouterr().out
    assert main(["report", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.html")]) == 0
    assert left in (tmp_path / "a.html").read_text()
    assert main(["run", "orbit", *given, "-o", str(tmp_path / "b.h5")]) == 0
    assert "constraints" in capsys.readouterr().out


def test_a_damped_rod_is_refused_by_what_has_none(need: Need) -> None:
    with pytest.raises(MethodError, match="no rod term"):
        driver.run(dumbbell(), "own:rk4")


def test_studies_of_springs_refuse_rods_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "a.h5")
    assert main(["run", "dumbbell", "--method", "own:velocity-verlet", "--steps", "50", "-o", path]) == 0
    capsys.readouterr()
    assert main(["stability", "dumbbell", "-o", str(tmp_path / "b.h5")]) == 2
    assert (
        "a step below h w = 1, here h < 0.666667 at the rate of the start, and none beyond"
        in capsys.readouterr().err
    )
    assert main(["identify", path]) == 2
    said = capsys.readouterr().err
    assert "its scene has rods, and schemes are told by springs; judge it instead" in said
    assert said.count("\n") == 1


def test_a_study_of_precision_begins_where_a_rod_still_has_a_step() -> None:
    label = engines.parse("own:velocity-verlet")
    sweep = sweeps.begin(dumbbell(), label, accuracy.truth(dumbbell()))
    assert sweep.scene is not None
    assert sweep.scene.step == pytest.approx(0.9 / 1.5, rel=0.02)


@pytest.mark.parametrize(
    "label", ["own:velocity-verlet", "own:forest-ruth", "ase:rattle", "openmm:verlet-rods"]
)
def test_on_a_line_two_masses_on_a_rod_are_one(label: str, need: Need) -> None:
    need(label)
    two = scenefile.load_scene("rod-on-a-line")
    held = WallSpring(i=[0], k=[2.9], at=[0.3])  # type: ignore[arg-type]
    one = Scene(m=[4.0], q=[0.25], p=[1.2], terms=(held,), step=two.step, steps=two.steps)  # type: ignore[arg-type]
    run = driver.run(two, label)
    assert [v.check for v in checks.judge(two, run) if v.passed is False] == []
    engine, _, method = label.partition(":")
    alone = driver.run(one, f"own:{method}" if engine == "own" else "own:velocity-verlet")
    # a length may be off by its tolerance at every step, and the force with it
    limit = 400 * (run.arithmetic.lengths + 2.0**-50)
    assert np.max(np.abs(run.q - alone.q - [0.0, 1.5])) < limit
    assert np.max(np.abs(np.sum(run.p, axis=1) - alone.p[:, 0])) < 4 * limit


def turning(sides: list[list[float]], m: tuple[float, ...], w: float = 4.7) -> Scene:
    """A rigid triangle of these corners in the plane z = 0.3, turning about its axis and drifting."""
    x, axes = np.column_stack([sides, np.full(3, 0.3)]), np.tile(np.arange(3), 3)
    v = np.cross([0.0, 0.0, w], x - np.average(x, axis=0, weights=m)) + np.array([0.3, -0.2, 0.1])
    a, b = np.repeat([0, 0, 1], 3), np.repeat([1, 2, 2], 3)
    length = np.linalg.norm(x[b] - x[a], axis=1)
    joined = Rod(a=3 * a + axes, b=3 * b + axes, length=length)
    mass = np.repeat(m, 3)
    return Scene(
        m=mass, q=x.ravel(), p=mass * v.ravel(), places=np.arange(9), terms=(joined,), step=0.05, steps=100
    )


def water(half: float, low: float) -> Scene:
    return turning([[0.1, 0.2], [0.1 - half, 0.2 - low], [0.1 + half, 0.2 - low]], (16.0, 1.1, 1.1))


def scalene() -> Scene:
    return turning([[0.1, 0.2], [0.05, 0.14], [0.18, 0.13]], (16.0, 1.1, 2.3))


@pytest.mark.campaign
@pytest.mark.parametrize("make", [scalene, lambda: scenefile.load_scene("rigid-triangle")])
@pytest.mark.parametrize("label", ["own:velocity-verlet", "ase:rattle", "openmm:verlet-rods"])
def test_a_rigid_triangle_turns_about_its_axis_by_the_same_arc_sine(
    label: str, make: Callable[[], Scene], need: Need
) -> None:
    """OpenMM has SETTLE for two equal sides and CCMA for three, ASE iterates, the own method is Newton's."""
    need(label)
    scene = replace(make(), steps=60)
    verdicts = checks.judge(scene, driver.run(scene, label))
    assert [v.check for v in verdicts if v.passed is False] == []
    assert {"turn", "rod-length", "angular-momentum", "momentum"} <= {v.check for v in verdicts if v.passed}


def test_the_exact_motion_of_a_triangle_is_that_of_ever_shorter_steps() -> None:
    scene = scenefile.load_scene("rigid-triangle")
    end = []
    for parts in (4, 8, 16):
        fine = replace(scene, step=0.1 / parts, steps=5 * parts, every=5 * parts)
        run = driver.run(fine, "own:velocity-verlet")
        end.append(np.concatenate([run.q[-1], run.p[-1]]))
    once = [(4 * b - a) / 3 for a, b in itertools.pairwise(end)]
    q, p = exact.true_motion(scene, np.array([5]), 0.1)
    assert np.max(np.abs((16 * once[1] - once[0]) / 15 - np.concatenate([q[0], p[0]]))) < 1e-12


def test_rods_that_bend_or_turn_about_another_axis_have_no_exact_motion() -> None:
    scene = scenefile.load_scene("rigid-triangle")
    assert exact.has_true_motion(scene)
    assert not exact.has_true_motion(triangle())
    (rod,) = scene.terms
    two = replace(rod, a=rod.a[:6], b=rod.b[:6], length=rod.length[:6])  # type: ignore[attr-defined,type-var]
    assert not exact.has_true_motion(scene.derived(terms=(two,)))


def test_on_a_line_a_spring_beside_a_rod_has_no_closed_form_and_one_beyond_it_has() -> None:
    rod = Rod(a=[0], b=[1], length=[1.5])  # type: ignore[arg-type]
    grid = {"m": [1.3, 2.7, 0.8], "q": [0.2, 1.7, 2.9], "p": [0.26, 0.54, -0.4], "step": 0.05, "steps": 40}
    beyond = Spring(a=[2], b=[1], k=[2.9], rest=[-1.1])  # type: ignore[arg-type]
    scene = Scene(terms=(rod, beyond), **grid)  # type: ignore[arg-type]
    fine = replace(scene, step=0.05 / 32, steps=40 * 32, every=32)
    q, p = exact.true_motion(scene, np.arange(41), 0.05)
    run = driver.run(fine, "own:yoshida4")
    assert np.max(np.abs(run.q - q)) < 1e-10
    assert np.max(np.abs(run.p - p)) < 1e-10
    beside = Spring(a=[0], b=[1], k=[2.9], rest=[1.0])  # type: ignore[arg-type]
    tied = WallRod(i=[2], at=[2.0], length=[0.9])  # type: ignore[arg-type]
    for terms in ((rod, beside), (rod, beyond, tied)):
        still = {**grid, "p": [0.26, 0.54, 0.0]}
        assert not exact.has_true_motion(Scene(terms=terms, **still))  # type: ignore[arg-type]


def test_iterations_that_find_no_length_stop_a_run(need: Need) -> None:
    need("ase:rattle")
    scene = replace(scenefile.load_scene("rod-on-a-line"), step=10.0, steps=8)
    run = driver.run(scene, "ase:rattle")
    assert (run.outcome.status, run.outcome.message) == ("stopped", "Did not converge")


@pytest.mark.parametrize("units", ["reduced", "md"])
def test_frames_before_a_stop_are_in_the_units_of_the_scene(units: str, need: Need) -> None:
    """A dumbbell that forces turn faster and faster, until no push along its rod keeps the length."""
    need("ase:rattle")
    turned = Weight(i=[1, 3], force=[-30.0, 30.0], at=[0.0, 0.0])  # type: ignore[arg-type]
    scene = replace(dumbbell(), units=units, terms=(*dumbbell().terms, turned), steps=20)
    run = driver.run(scene, "ase:rattle")
    assert run.outcome.status == "stopped"
    assert len(run.t) > 2
    assert not [v for v in checks.judge(scene, run) if v.passed is False]


def test_passes_that_come_near_lengths_too_slowly_are_a_stop_with_its_words_and_no_failure(
    need: Need,
) -> None:
    """A light particle between heavy ones: each of ASE's passes leaves (M/(M + m))^2 of what is off, and it
    takes 500 of them."""
    need("ase:rattle")
    mass, q = np.repeat([97.0, 0.6, 97.0], 2), np.array([0.0, 0.0, 1.1, 0.0, 2.3, 0.0])
    joined = Rod(a=np.arange(4), b=np.arange(2, 6), length=np.repeat([1.1, 1.2], 2))
    pulled = WallSpring(i=[0, 1], k=[2.9, 2.9], at=[-0.3, 0.2])  # type: ignore[arg-type]
    fields = {"m": mass, "q": q, "p": 0 * q, "places": np.array([0, 1, 3, 4, 6, 7]), "step": 0.1, "steps": 8}
    scene = Scene(terms=(joined, pulled), **fields)  # type: ignore[arg-type]
    run = driver.run(scene, "ase:rattle")
    assert (run.outcome.status, run.outcome.message) == ("stopped", "Did not converge")
    assert not [v for v in checks.judge(scene, run) if v.passed is False]
    for wrong in (replace(run.outcome, message=""), replace(run.outcome, status="diverged")):
        verdicts = checks.judge(scene, replace(run, outcome=wrong))
        assert [v.check for v in verdicts if v.passed is False] == ["grid"]


def test_settle_in_openmm_keeps_lengths_in_single_precision_and_is_told(need: Need) -> None:
    need("openmm:verlet-rods")
    scene = water(0.0757, 0.0586)
    run = driver.run(scene, "openmm:verlet-rods")
    failed = {v.check for v in checks.judge(scene, run) if v.passed is False}
    assert failed == {"step-defect", "rod-length", "turn"}
    length = rods(scene).length
    kept = length.astype(np.float32).astype(np.float64) / length - 1
    assert np.max(np.abs(rods(scene).strain(run.q[1:]) - kept)) < 1e-13


def test_settle_in_openmm_takes_unlike_masses_for_alike_and_is_told(need: Need) -> None:
    need("openmm:verlet-rods")
    scene = turning([[0.125, 0.25], [0.125 - 3 / 64, 0.1875], [0.125 + 3 / 64, 0.1875]], (16.0, 1.1, 2.3))
    for label, right in (("own:velocity-verlet", True), ("openmm:verlet-rods", False)):
        run = driver.run(replace(scene, steps=2), label)
        failed = {v.check for v in checks.judge(replace(scene, steps=2), run) if v.passed is False}
        assert failed == set() if right else failed >= {"step-defect", "momentum", "angular-momentum"}


@pytest.mark.parametrize("label", ["own:velocity-verlet", "openmm:verlet-rods"])
def test_where_a_rod_comes_to_turn_too_fast_that_is_said_whatever_the_engine_does(
    label: str, need: Need
) -> None:
    need(label)
    scene = replace(scenefile.load_scene("rigid-pendulum"), step=0.5, steps=100)
    run = driver.run(scene, label)
    if label.startswith("own"):
        assert run.outcome.status == "diverged"
        return
    found = next(v for v in checks.judge(scene, run) if v.check == "rod-length")
    assert found.passed is False
    assert "a rod turns by h w of 1 or more, and no push along it keeps its length" in found.why


def test_what_rounding_leaves_of_momenta_on_a_line_is_no_turn() -> None:
    rod = Rod(a=[0], b=[1], length=[1.7])  # type: ignore[arg-type]
    scene = Scene(m=[0.7, 3.1], q=[0.3, 2.0], p=[0.49, 2.17], terms=(rod,), step=0.1, steps=30)  # type: ignore[arg-type]
    for label in ("own:velocity-verlet", "own:semi-implicit-euler"):
        verdicts = checks.judge(scene, driver.run(scene, label))
        assert [v.check for v in verdicts if v.passed is False] == []
        assert next(v for v in verdicts if v.check == "turn").why == "no rod turns"


def test_random_rods_by_right_methods_raise_no_alarm() -> None:
    """Masses over six decades, lengths and times over four, far from the origin, h w up to 0.999."""
    rng = np.random.default_rng(27)
    for number in range(24):
        d = int(rng.integers(2, 4))
        size, time, far = 10 ** rng.uniform(-2, 2, 3)
        way = rng.normal(size=d)
        way *= size / np.linalg.norm(way)
        x = rng.normal(size=d) * far * size
        m, axes = np.repeat(10 ** rng.uniform(-3, 3, 2), d), np.arange(d)
        rod = Rod(a=axes, b=axes + d, length=np.full(d, np.linalg.norm(way)))
        q, p = np.concatenate([x, x + way]), m * rng.normal(size=2 * d) * size / time
        rod = replace(rod, length=np.full(d, np.linalg.norm(q[d:] - q[:d])))
        scene = dumbbell().derived(
            m=m, q=q, p=p, terms=(rod,), places=np.concatenate([axes, 3 + axes]), step=time, steps=30,
            every=1 + number % 2,
        )  # fmt: skip
        p = np.asarray(rods(scene).projected(q.astype(np.longdouble), p.astype(np.longdouble)), np.float64)
        turn = float(rng.choice([rng.uniform(0.01, 0.9), 1 - 10 ** rng.uniform(-3, -1)]))
        step = turn / float(rods(scene).rates(q, p)[0])
        right = replace(scene, p=p, step=step * (1 if number % 3 else -1))
        for label in ("own:velocity-verlet", "own:semi-implicit-euler"):
            verdicts = checks.judge(right, driver.run(right, label))
            assert [v for v in verdicts if v.passed is False] == [], number


LAMMPS = ("lammps:shake", "lammps:rattle", "lammps:rattle-as-in-its-manual")


@pytest.mark.parametrize("label", LAMMPS)
@pytest.mark.parametrize("name", ["dumbbell", "rigid-pendulum", "rod-on-a-line", "rigid-triangle", "scalene"])
def test_lammps_keeps_rods_as_rattle_does(label: str, name: str, need: Need) -> None:
    need(label)
    scene = scalene() if name == "scalene" else replace(scenefile.load_scene(name), steps=100)
    run = driver.run(scene, label)
    verdicts = checks.judge(scene, run)
    assert [v.check for v in verdicts if v.passed is False] == []
    assert {"step-defect", "rod-length", "rod-velocity"} <= {v.check for v in verdicts if v.passed}
    off = float(np.max(np.abs(rods(scene).strain(run.q))))
    # one rod is a quadratic, which it solves whatever the tolerance; a triangle it iterates
    iterated = "manual" in label and rods(scene).share
    assert 1e-8 < off < 1e-4 if iterated else off < 1e-13


def test_lammps_without_rattles_projection_is_told(need: Need, monkeypatch: pytest.MonkeyPatch) -> None:
    need("lammps:shake")
    monkeypatch.setattr(Rods, "projected", lambda self, q, p: p)
    scene = replace(scenefile.load_scene("rigid-pendulum"), steps=50)
    run = driver.run(scene, "lammps:shake")
    monkeypatch.undo()
    assert {v.check for v in checks.judge(scene, run) if v.passed is False} >= {"step-defect", "rod-velocity"}


def test_a_push_for_a_step_that_there_is_not_costs_a_run_its_last_frame_and_raises_no_alarm(
    need: Need,
) -> None:
    """SHAKE's momenta hold half of the push of the next step, which cannot be found where there is none."""
    need("lammps:shake")
    q = np.array([0.0, 0.0, 1.1, 0.1, -0.9, 0.7])
    length = np.repeat(np.hypot([1.1, -0.9], [0.1, 0.7]), 2)
    joined = Rod(a=np.array([0, 1, 0, 1]), b=np.arange(2, 6), length=length)
    pulled = WallSpring(i=[2, 5], k=[2.0, 4.0], at=[-3.0, 3.0])  # type: ignore[arg-type]
    fields = {"m": np.repeat([0.3, 7.1, 7.1], 2), "q": q, "p": 0 * q, "places": np.array([0, 1, 3, 4, 6, 7])}
    scene = Scene(terms=(joined, pulled), **fields, step=0.11, steps=80)  # type: ignore[arg-type]
    last = driver.run(scene, "own:velocity-verlet").outcome.step
    for steps in (80, last):
        asked = replace(scene, steps=steps)
        run = driver.run(asked, "lammps:shake")
        assert (run.outcome.status, run.outcome.step) == ("stopped", last - 1)
        assert "no push along its rods leads to the next step" in run.outcome.message
        assert [v.check for v in checks.judge(asked, run) if v.passed is False] == []
    assert driver.run(replace(scene, steps=last - 1), "lammps:shake").outcome.status == "complete"


def test_rods_that_lammps_cannot_hold_are_refused_in_its_words(need: Need) -> None:
    need("lammps:shake")
    rod = Rod(a=[0, 1, 2, 3], b=[1, 2, 3, 4], length=[0.5] * 4)  # type: ignore[arg-type]
    q = 0.5 * np.arange(5)
    scene = Scene(m=np.full(5, 1.3), q=q, p=np.full(5, 0.26), terms=(rod,), step=0.1, steps=3)
    with pytest.raises(MethodError, match=r"lammps:shake: .*cluster"):
        driver.run(scene, "lammps:shake")


@pytest.mark.parametrize("name", gromacs.CASES)
def test_what_gromacs_has_written_is_judged_from_its_file(name: str) -> None:
    found = gromacs.judged(name)
    assert {check for check, one in found.items() if one["passed"] is False} == gromacs.CASES[name]
    assert {check for check, one in found.items() if one["passed"]} >= {"momentum", "angular-momentum"}
    if not gromacs.CASES[name]:
        assert found["rod-length"]["value"] < 1e-13
        assert found["turn"]["passed"]


def test_a_trr_file_that_is_cut_off_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = (gromacs.FOLDER / "dumbbell-shake.trr").read_bytes()
    for kept, said in ((700, "cut off or damaged in frame 2"), (-20, "cut off or damaged in frame 40")):
        (tmp_path / "x.trr").write_bytes(whole[:kept])
        assert main(["identify", str(tmp_path / "x.trr")]) == 2
        assert said in capsys.readouterr().err
    (tmp_path / "x.trr").write_bytes(whole[:260] + bytes(8) + whole[268:])
    assert main(["identify", str(tmp_path / "x.trr")]) == 2
    assert "is no .trr file from byte 260 on" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["dumbbell-shake", "dumbbell-shake-as-it-is", "triangle-lincs-as-it-is"])
def test_a_file_with_rods_is_said_to_have_them_where_schemes_are_asked_for(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", str(gromacs.FOLDER / f"{name}.trr")]) == 2
    said = capsys.readouterr().err
    assert "particles 0 and 1 turn and keep their distance, 0." in said
    assert "judge it, with a --scene that has the [[rod]]" in said


def test_neither_springs_nor_what_goes_straight_on_are_taken_for_rods() -> None:
    t = np.arange(60) * 0.1
    straight = np.outer(t, np.tile([1.0, 2.0], 2)) + np.array([0, 0, 3, 4])
    swinging = np.stack([np.cos(t), np.sin(t), 1.01 * np.cos(t + 3), np.sin(t + 3)], axis=1)
    assert {rod_of(straight), rod_of(swinging), rod_of(np.ones((9, 5))), rod_of(None)} == {None}
    swinging[:, 2] /= 1.01
    assert rod_of(swinging).statement.startswith("particles 0 and 1 turn")


def test_orbits_that_go_round_are_no_rods_however_near_to_a_circle_they_are() -> None:
    t = np.linspace(0, 6, 200)

    def orbit(e: float) -> np.ndarray:
        angle = t.copy()
        for _ in range(50):
            angle = t + e * np.sin(angle)
        return np.stack([np.cos(angle) - e, np.sqrt(1 - e * e) * np.sin(angle), 0 * t], axis=1)

    missing = np.delete(t, 50)
    circle = np.stack([np.cos(missing), np.sin(missing)], axis=1)
    assert {rod_of(orbit(e)) for e in (0.005, 0.02, 0.036)} == {rod_of(circle)} == {None}
    swing = 0.8 * np.sin(3 * t)
    pendulum = np.stack([0.3 + 0.9 * np.sin(swing), 0.1 - 0.9 * np.cos(swing), 0 * t + 0.5], axis=1)
    assert rod_of(pendulum).statement.startswith(
        "particle 0 swings and keeps its distance from a fixed point, 0.9 to "
    )
    pendulum[3] = np.nan
    assert rod_of(pendulum) is None


@pytest.mark.parametrize("axes", [2, 3])
def test_a_particle_that_swings_on_a_rod_is_seen_and_neither_an_orbit_nor_another_curve(axes: int) -> None:
    t = np.arange(60) * 0.1
    for most in (0.3, 0.9, 2.5):
        angle = most * np.cos(t)
        across = [np.sin(angle)] if axes == 2 else [0.8 * np.sin(angle), 0.6 * np.sin(angle)]
        arc = 0.7 * np.stack([*across, -np.cos(angle)], axis=1) + 5
        assert rod_of(arc).statement.startswith(
            "particle 0 swings and keeps its distance from a fixed point, 0.7 to "
        )
    z = [0.4 + 0 * t] * (axes - 2)
    curves = (
        [np.cos(t), np.sin(t)],
        [np.cos(t), 0.99 * np.sin(t)],
        [t, 0.02 * t * t],
        [np.cos(t), 2 * np.cos(t)],
    )
    assert [rod_of(np.stack([*one, *z], axis=1)) for one in curves] == [None] * 4


def test_lammps_is_given_no_triangle_with_another_rod(need: Need) -> None:
    """It holds the two rods of the middle atom and the other one, and not the third of the triangle."""
    need("lammps:rattle")
    alone = triangle()
    r, v = (alone.q[:3], alone.p[:3] / alone.m[:3])
    tied = WallRod(i=[0, 1, 2], at=r + np.cross(v, [0.1, 0.7, 0.3]), length=3 * [1.0])
    length = float(np.linalg.norm(np.cross(v, [0.1, 0.7, 0.3])))
    scene = replace(alone, terms=(*alone.terms, replace(tied, length=3 * [length])))
    with pytest.raises(MethodError, match="leaves out the third rod of a triangle"):
        driver.run(scene, "lammps:rattle")


def test_a_file_of_single_precision_with_a_rod_is_judged_to_its_digits(tmp_path: Path) -> None:
    """Its rounded start, whose length is not the rod's to double precision, was refused."""
    scene = dumbbell()
    run = driver.run(scene, "own:velocity-verlet")
    path = tmp_path / "single.npz"
    wrong = np.where(np.arange(len(run.t))[:, None] == 7, 1 + 1e-4, 1) * run.p
    for p, status in ((run.p, 0), (wrong, 1)):
        np.savez(path, t=run.t, q=run.q.astype(np.float32), p=p.astype(np.float32))
        assert main(["judge", str(path), "--scene", "dumbbell", "--scheme", "velocity-verlet"]) == status
    np.savez(path, t=run.t, q=run.q * (1 + 1e-5), p=run.p)
    assert main(["judge", str(path), "--scene", "dumbbell", "--scheme", "velocity-verlet"]) == 2


def test_schemes_of_springs_that_fit_a_rod_in_single_precision_are_not_all_that_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Short steps, and what a solver of constraints leaves of itself: no error of a spring's scheme shows.

    About a resting middle either end goes round, as it may on springs; about one that moves neither does.
    """
    t, rng, path = 0.004 * np.arange(40)[:, None], np.random.default_rng(1), str(tmp_path / "single.npz")
    across, along = np.array([0.8, 0.0, -0.6]), np.array([0.0, 1.0, 0.0])
    way = 0.2 * (np.cos(6 * t) * across + np.sin(6 * t) * along)
    pace = 1.2 * (np.cos(6 * t) * along - np.sin(6 * t) * across)
    v = np.hstack([-0.7 * pace, 0.3 * pace]) + 1e-3 * rng.normal(size=(40, 6))

    def said(drift: float, status: int, *stated: str) -> str:
        middle = 2.5 + drift * t * [0.5, 0.25, -1]
        q = np.hstack([middle - 0.7 * way, middle + 0.3 * way])
        np.savez(path, t=t[:, 0], q=q.astype(np.float32), v=v.astype(np.float32))
        assert main(["identify", path, *stated]) == status
        return " ".join("".join(capsys.readouterr()).split())

    kept = "particles 0 and 1 turn and keep their distance, 0.2 to "
    resting = said(0, 0)
    assert "velocity-verlet" in resting
    assert kept in resting
    assert "or circular orbits on springs" in resting
    told = files.identify_states(files.read(Path(path))[0])
    monkeypatch.setattr(files, "identify_states", lambda *_, **given: told)
    moving = said(1, 2)
    assert kept in moving
    assert "judge it, with a --scene" in moving
    assert "velocity-verlet" not in moving
    assert kept not in said(1, 0, "--stiffness", "36")


def test_springs_that_swing_little_across_their_way_are_no_rod() -> None:
    t = np.arange(60) * 0.1
    across = np.stack([0 * t, 0.03 * np.cos(t), 1 + 0 * t, -0.01 * np.cos(t)], axis=1)
    assert rod_of(across).statement.startswith("particles 0 and 1 turn")
    assert rod_of(across, fits=True) is None


@pytest.mark.parametrize("fits", [True, False])
@pytest.mark.parametrize("size", [1e200, np.inf])
def test_what_has_grown_beyond_the_squares_that_numbers_hold_is_no_rod(size: float, fits: bool) -> None:
    t = np.linspace(0, 6, 40)
    grown = np.stack([0 * t, 0 * t, np.exp(t) * np.cos(t), np.exp(t) * np.sin(t)], axis=1)
    grown[-1, 2:] = size
    with np.errstate(all="ignore"):
        assert rod_of(grown, fits=fits) is None


@pytest.mark.parametrize("scheme", ["exact", "adams"])
def test_rods_are_judged_by_what_has_no_step_without_their_velocities(scheme: str) -> None:
    """It was a ValueError: the allowance of a step was asked for."""
    scene = springcheck.load_scene("dumbbell")
    q, p = (np.tile(x, (5, 1)) for x in (scene.q, scene.p))
    found = springcheck.judge(
        scene, springcheck.Trajectory.from_arrays(scene.step * np.arange(5), q, p, scheme=scheme)
    )
    (along,) = (verdict for verdict in found if verdict.check == "rod-velocity")
    assert along.passed is None
    (length,) = (verdict for verdict in found if verdict.check == "rod-length")
    assert length.passed


def test_states_that_overflow_are_judged_without_a_warning() -> None:
    scene = springcheck.load_scene("morse-bond")
    q = np.tile(scene.q, (5, 1))
    q[2] = -1e150
    found = springcheck.judge(
        scene,
        springcheck.Trajectory.from_arrays(scene.step * np.arange(5), q, 0 * q, scheme="velocity-verlet"),
    )
    assert any(verdict.passed is False for verdict in found)


@pytest.mark.parametrize(("units", "length", "clock"), [("md", 0.1, 1.0), ("reduced", 1.0, 100.0)])
def test_ase_projects_momenta_to_a_rate_in_its_own_units_of_time(
    units: str, length: float, clock: float, need: Need
) -> None:
    need("ase:rattle")
    m, ways = np.array([12.0, 1.0, 16.0, 35.0]), np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    x = np.concatenate([[np.zeros(3)], length * ways])
    x = x - np.average(x, axis=0, weights=m)
    v = np.cross([0.5, -0.3, 0.4], x) / clock
    star = Rod(a=np.tile([0, 1, 2], 3), b=np.arange(3, 12), length=np.full(9, length))
    scene = Scene(
        m=np.repeat(m, 3), q=x.ravel(), p=np.repeat(m, 3) * v.ravel(), terms=(star,), places=np.arange(12),
        step=clock / 2, steps=60, units=units,
    )  # fmt: skip
    run = driver.run(scene, "ase:rattle")
    rate = run.arithmetic.rates

    def failed(declared: float) -> set[str]:
        one = replace(run, arithmetic=replace(run.arithmetic, rates=declared))
        return {v.check for v in checks.judge(scene, one) if v.passed is False}

    assert failed(rate) == set()
    assert failed(rate / 10) == failed(0.0) == {"step-defect", "rod-velocity"}
    assert "grid" in failed(1.0)
    assert engines.arithmetic(engines.parse("ase:rattle"), units).rates == rate
