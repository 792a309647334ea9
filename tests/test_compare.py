"""Which trajectories are one motion: those that rounding explains, and no others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

import springcheck
from springcheck.checks import compare
from springcheck.physics.scene import Scene

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
    merged = compare.merge([compare.compare(scene, piece) for piece in pieces])
    assert merged.labels == whole.labels
    assert (merged.max_difference == whole.max_difference).all()
