"""Which trajectories are one motion: those that rounding explains, and no others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import clean
import springcheck
import textbook as steppers
from springcheck import schemes
from springcheck.checks import compare
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic
from springcheck.physics.trajectory import Trajectory

LABELS = ("own:euler", "own:semi-implicit-euler", "own:implicit-euler", "openmm:leapfrog", "openmm:verlet")


def groups(scene: Scene) -> set[frozenset[str]]:
    runs = {label: springcheck.simulate(scene, label) for label in LABELS}
    found = compare.same_motions(scene, runs, compare.compare(scene, runs))
    return {frozenset(same.labels) for same in found}


def test_engines_of_one_scheme_are_one_motion_and_others_are_not(need: Callable[[str], None]) -> None:
    need("openmm:verlet")
    for name in ("spring-uneven", "chain", "carbon-monoxide"):
        assert groups(springcheck.load_scene(name)) == {
            frozenset({"own:semi-implicit-euler", "openmm:leapfrog"})
        }


def test_a_motion_of_which_rounding_leaves_nothing_is_not_taken_for_every_other(
    need: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    need("openmm:verlet")
    allowed = compare.allowed
    # what rounding can do to explicit Euler in a long stiff chain
    monkeypatch.setattr(
        compare, "allowed", lambda scene, run: 1e26 if run.label == "own:euler" else allowed(scene, run)
    )
    assert groups(springcheck.load_scene("chain")) == {
        frozenset({"own:semi-implicit-euler", "openmm:leapfrog"})
    }


def test_pieces_of_trajectories_are_compared_as_wholes() -> None:
    scene = springcheck.load_scene("spring-uneven")
    runs = {label: springcheck.simulate(scene, label) for label in ("own:euler", "own:implicit-euler")}
    whole = compare.compare(scene, runs)
    pieces = [
        {label: replace(run, t=run.t[a:b], q=run.q[a:b], p=run.p[a:b]) for label, run in runs.items()}
        for a, b in ((0, 90), (89, 201))
    ]
    merged = compare.merge([compare.compare(scene, piece) for piece in pieces], runs)
    assert merged.labels == whole.labels
    assert (merged.max_difference == whole.max_difference).all()


WELL = clean.scene(
    np.array([1.3]), (Quartic(i=np.array([0]), b=np.array([2.3]), at=np.zeros(1)),), np.array([0.9]),
    np.array([0.4]), step=0.005, steps=20_000, every=100,
)  # fmt: skip


def same(scene: Scene, runs: dict[str, Trajectory]) -> list[compare.Same]:
    return compare.same_motions(scene, runs, compare.compare(scene, runs))


def textbook(scene: Scene, name: str, moved: Scene | None = None) -> Trajectory:
    scheme = schemes.SCHEMES[name]
    step = steppers.textbook(moved or scene, scheme)
    return steppers.record(scene, scheme, step, label=f"own:{name}{'' if moved is None else '-wrong'}")


def test_schemes_of_several_orders_in_a_well_are_several_motions() -> None:
    names = ("rk4", "yoshida4", "forest-ruth", "velocity-verlet")
    runs = {run.label: run for run in (textbook(WELL, name) for name in names)}
    # yoshida4 and forest-ruth are one scheme
    assert {frozenset(one.labels) for one in same(WELL, runs)} <= {
        frozenset({"own:yoshida4", "own:forest-ruth"})
    }


def test_a_stiffness_off_by_1e_9_in_a_well_is_another_motion() -> None:
    wrong = replace(WELL, terms=(WELL.terms[0].scaled(1 + 1e-9),))
    made = textbook(WELL, "velocity-verlet"), textbook(WELL, "velocity-verlet", wrong)
    runs = {run.label: run for run in made}
    assert same(WELL, runs) == []


def test_a_loose_tolerance_makes_no_two_schemes_one_motion(need: Callable[[str], None]) -> None:
    need("sundials:adams")
    scene = replace(springcheck.load_scene("spring-uneven"), tolerance=1e-6)
    scene = replace(scene, step=scene.step / 4)
    labels = ("own:velocity-verlet", "own:rk4", "sundials:adams", "sundials:bdf")
    found = same(scene, {label: springcheck.simulate(scene, label) for label in labels})
    (one,) = found
    assert one.labels == ("exact", "sundials:adams", "sundials:bdf")
    assert one.within == "tolerance"
    # every two of them are near each other, not each to the next alone
    assert one.difference <= one.allowed


def test_a_run_of_one_frame_is_the_same_as_none() -> None:
    scene = springcheck.load_scene("spring-uneven")
    run = springcheck.simulate(scene, "own:euler")
    start = replace(
        run, t=run.t[:1], q=run.q[:1], p=run.p[:1], energy=None,
        outcome=replace(run.outcome, status="diverged", step=0),
    )  # fmt: skip
    assert same(scene, {"own:euler": start}) == []
