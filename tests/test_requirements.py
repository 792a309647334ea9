"""What checks require is data: one table of requirements, one sentence for each that is missing."""

from __future__ import annotations

import inspect
from dataclasses import replace

import numpy as np
import pytest

from springcheck import checks, driver, schemes
from springcheck.checks import check, requires
from springcheck.checks.check import DECADES, FALSE_ALARMS, Chance, Finding, shared
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene
from springcheck.physics.terms import Damping, WallSpring
from springcheck.schemes import SCHEMES, Law

EVERY = tuple(dict.fromkeys((*checks.ALL, *checks.RANDOM)))


@pytest.mark.parametrize("one", EVERY, ids=lambda one: one.name)
def test_a_check_requires_what_the_table_has_and_says_so(one: checks.Check) -> None:
    assert all(requires.REQUIREMENTS[name].word in one.needs for name in one.requires)


def test_a_requirement_that_is_not_in_the_table_is_refused_where_the_check_is_made() -> None:
    with pytest.raises(ValueError, match="no requirement is called unheld-by-walls; known are start, "):
        check.check("still", family="motion", requires={"unheld-by-walls", "named"})


def test_checks_of_conserved_quantities_and_of_the_record_tell_no_scheme_from_another() -> None:
    silent = {one.name for one in checks.ALL if not one.telling}
    assert silent >= {"momentum", "angular-momentum", "start", "times", "repeatability"}
    assert silent.isdisjoint(checks.TELLING)
    assert {"step-defect", "closed-form", "propagator", "order", "draws-variance"} <= checks.TELLING


def test_every_requirement_is_one_of_some_check() -> None:
    assert set().union(*(one.requires for one in EVERY)) == set(requires.REQUIREMENTS)


def test_bodies_ask_for_no_trait_that_they_could_require() -> None:
    """A body begins with its measurement: that a scheme has a fixed step, say, is looked at before."""
    for one in EVERY:
        first = inspect.getsource(one.judge).split('"""')[2].strip().splitlines()[:4]
        assert not any("has(" in line and line.lstrip().startswith("if ") for line in first), one.name


def test_what_is_missing_is_said_in_one_sentence_for_all_checks() -> None:
    scene = load_scene("spring-uneven")
    damped = scene.derived(terms=(*scene.terms, Damping(i=[0], c=[0.1])))  # type: ignore[arg-type]
    for made, label, name, word in (
        (scene, "sundials:adams", "one-step", "adaptive"),
        (damped, "own:velocity-verlet", "undamped", "friction"),
    ):
        run = driver.run(made, label)
        case = checks.Case(trajectory=run, scene=made)
        found = [one(case) for one in checks.CHECKS if name in one.requires]
        whys = {verdict.why for verdict in found if verdict.passed is None and word in verdict.why}
        assert len(whys) == 1
        assert all(verdict.passed is None for verdict in found)


def test_a_law_answers_for_its_scheme_on_its_scene() -> None:
    m, k, c, h = 3.7, 2.9, 0.3, 0.41
    scene = Scene(
        name="damped", m=np.array([m]), q=np.array([0.3]), p=np.array([-0.7]), step=h, steps=3,
        terms=(WallSpring(i=np.array([0]), k=np.array([k]), at=np.array([0.0])),
               Damping(i=np.array([0]), c=np.array([c]))),
    )  # fmt: skip
    law = Law(scheme=SCHEMES["langevin-middle"], scene=scene, h=h)
    assert law.has("one-step", "splitting", "explicit", "reversible", "friction", "linear", "modes")
    assert not law.traits & {"undamped", "plain", "random"}
    # modes are of mass 1: y = sqrt(m) q, v = p / sqrt(m)
    root = np.array([np.sqrt(m), 1 / np.sqrt(m)])
    z = np.array([0.3, -0.7])
    moved = np.array([x[0] for x in law.step(z[:1], z[1:])])
    expected = law.propagator[0] @ (root * z)
    np.testing.assert_allclose(root * moved, expected.astype(float), rtol=16 * 2.0**-52)


def test_slow_and_fast_springs_mix_only_where_there_are_both() -> None:
    both = load_scene("multiple-time-steps")
    alone = both.derived(terms=tuple(replace(term, fast=True) for term in both.terms))
    respa = SCHEMES["respa8"]
    assert Law(scheme=respa, scene=both, h=0.1).has("mixes")
    assert not Law(scheme=respa, scene=alone, h=0.1).has("mixes")
    assert Law(scheme=respa, scene=alone, h=0.1).has("modes")


def test_traits_are_those_of_the_textbooks() -> None:
    def named(trait: schemes.Trait) -> set[str]:
        return {name for name, scheme in SCHEMES.items() if scheme.has(trait)}

    assert named("implicit") == {"implicit-euler", "implicit-midpoint", "trapezoidal"}
    assert named("adaptive") == {"adams", "bdf", "ida"}
    assert named("flow") == {"exact"}
    assert named("mixes") == {"respa8"}
    assert named("friction") == {"langevin-middle", "langevin-middle-early"}
    assert named("random") == set()
    assert named("reversible") == {
        "velocity-verlet", "position-verlet", "implicit-midpoint", "trapezoidal", "forest-ruth", "yoshida4",
        "langevin-middle", "respa8",
    }  # fmt: skip


def findings(chances: list[float]) -> list[check.Verdict]:
    return [check.verdict("m", f"c{i}", Chance(x, "drawn")) for i, x in enumerate(chances)]


def test_a_chance_is_judged_in_decades() -> None:
    fine, bad = findings([0.3, FALSE_ALARMS / 2])
    assert (fine.unit, fine.passed, bad.passed) == (DECADES, True, False)
    np.testing.assert_allclose(fine.value, -np.log10(0.3))
    (never,), (lost,) = findings([0.0]), findings([np.nan])
    assert never.passed is lost.passed is False
    # a chance that is too small for a number is a finite one all the same
    assert 300 < never.value < 310
    assert "finite" not in never.why


def test_the_false_alarms_of_a_command_are_shared_by_its_random_checks_alone() -> None:
    """Two draws of a chance of 7e-7 are not yet too much of a command; one alone is."""
    exact = check.verdict("m", "c", Finding(1.0, 2.0, "roundings", ""))
    alone, two = shared(findings([7e-7])), shared([exact, *findings([7e-7, 0.5])])
    assert [one.passed for one in alone] == [False]
    assert two[0] == exact
    assert [one.passed for one in two[1:]] == [True, True]
    assert shared(findings([7e-7, 0.5]), 1e-7)[0].passed
    # 1000 commands of 40 random checks each, at a rate at which a false alarm is likely in ten of them
    rng = np.random.default_rng(5)
    alarms = sum(
        any(one.passed is False for one in shared(findings(list(rng.uniform(size=40))), 1e-2))
        for _ in range(1000)
    )
    assert 1 <= alarms <= 30


def test_the_worst_piece_of_a_run_is_as_unlikely_as_all_of_them_make_it() -> None:
    (verdict,) = checks.worst([findings([1e-3]), findings([0.2]), findings([0.7]), findings([0.9])])
    np.testing.assert_allclose(verdict.value, -np.log10(4e-3))
