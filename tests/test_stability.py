"""Limits, damped regions and resonances lie where theory puts them; what is put elsewhere is seen.

Limits: 1e-6 in double precision; in single, four roundings of one step (`limits.measure`).  Resonances:
1e-6 against edges found in mpmath at 120 digits.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiff
import stiffness_costs
from springcheck import driver, engines, schemes
from springcheck.physics import builders
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import Extended
from springcheck.physics.driven import ModulatedSpring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Quartic, Spring, WallSpring, Weight
from springcheck.schemes import lookup
from springcheck.studies.choose import LeftOut
from springcheck.studies.run import measure as session
from springcheck.studies.stability import STUDY, limits, propagators, regions, resonance
from springcheck.studies.stability import measure as stability
from springcheck.studies.stability.longest import fastest, longest
from springcheck.studies.stability.propagators import Springs
from springcheck.studies.text import left_out
from springcheck.text.lines import Text, as_text

LABELS = [
    str(label)
    for label in engines.match(("*",))
    if schemes.scheme(engines.method(label).scheme).has("one-step")
    and "wall-spring" in engines.method(label).terms
]
SINGLE = ["openmm:verlet@OpenCL-single", "openmm:verlet@OpenCL-mixed", "openmm:verlet@OpenCL-double"]
REFERENCE = Path(__file__).parents[1] / "data" / "reference" / "stiff" / "multiple-time-steps.json"
Need = Callable[[str], None]


@pytest.mark.parametrize("name", LABELS)
def test_the_limit_is_that_of_the_scheme_to_1e_6(name: str, need: Need) -> None:
    need(name)
    found = limits.measure(engines.parse(name))
    assert found.bound <= 1e-6 or found.theory == 0
    assert found.agrees, found
    assert found.limit == found.theory or abs(found.limit - found.theory) <= 1e-6
    if np.isfinite(found.theory):
        assert found.growth_above > 0
        assert abs(found.growth_above / found.growth_predicted - 1) < 1e-6
    if 0 < found.theory < np.inf:
        assert abs(found.growth_below) < 1e-9
        assert abs(stiff.edge(engines.parse(name), found.theory) - 1) < 0.02
    np.testing.assert_allclose(found.radius, found.radius_predicted, rtol=1e-12)


@pytest.mark.campaign
@pytest.mark.parametrize("name", SINGLE)
def test_the_limit_in_lower_precision_keeps_its_stated_bound(name: str, need: Need) -> None:
    need(name)
    found = limits.measure(engines.parse(name))
    assert found.bound < 1e-4
    assert found.agrees, found


def test_a_kick_that_is_a_hundred_thousandth_too_strong_moves_the_limit_out_of_its_bound() -> None:
    label = engines.parse("own:semi-implicit-euler")

    def strong(springs: Springs) -> Extended:
        off = schemes.Scheme(
            name="off", title="", order=1, limit=2.0, symplectic=True,
            stages=(("kick", "1.00001"), ("drift", "1")),
        )  # fmt: skip
        k, w = springs.k.astype(np.longdouble), springs.true_turn / propagators.STEP
        out = schemes.matrix(off, h=propagators.STEP, m=np.full(len(k), propagators.MASS), k=k)
        out[:, 0, 1] *= propagators.MASS * w
        out[:, 1, 0] /= propagators.MASS * w
        return out

    right = limits.measure(label)
    moved = replace(right, limit=limits.first_exit(label, strong))
    assert right.agrees
    assert not moved.agrees
    assert abs(moved.limit - 2 / np.sqrt(1.00001)) < 1e-9


@pytest.mark.parametrize(
    "name", [*(x for x in LABELS if "damping" in engines.method(engines.parse(x)).terms), "own:respa8"]
)
def test_the_damped_plane_is_divided_as_theory_says(name: str, need: Need) -> None:
    need(name)
    found = regions.measure(engines.parse(name), points=60)
    assert found.points == 3600
    assert found.wrong == 0
    assert found.off <= 1
    if found.method != "own:implicit-euler":
        assert 0.1 < np.mean(found.stable) < 0.9


def test_an_engine_that_moves_nothing_faster_than_some_speed_is_measured_below_it(need: Need) -> None:
    """Box2D stops at two lengths a step: its limit was 0, and all that it did against theory."""
    need("box2d:force")
    found = regions.measure(engines.parse("box2d:force"), points=6)
    assert np.isfinite(found.radius).all()
    assert found.wrong == 0
    springs = Springs(label=engines.parse("box2d:force"), turn=np.array([1e-9, 1.9, 2.1, 1e6]))
    inside = propagators.bounded(propagators.measured(springs), propagators.noise(springs.label))
    assert inside.tolist() == [True, True, False, False]


def test_resonances_of_multiple_time_steps_are_those_of_the_exact_matrix(need: Need) -> None:
    need("openmm:mts")
    wanted = np.array(json.loads(REFERENCE.read_text(encoding="utf-8"))["bands"], dtype=np.float64)
    found = resonance.measure(scenes.load_scene("multiple-time-steps"), engines.parse("openmm:mts"))
    np.testing.assert_allclose(np.array(found.bands), wanted, rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.array(found.bands_predicted), wanted, rtol=0, atol=1e-6)
    assert wanted[0, 1] == pytest.approx(16 * np.sin(np.pi / 16), abs=1e-14)


def test_a_scene_without_fast_springs_or_with_more_than_springs_has_no_resonances_and_yet_limits() -> None:
    label = engines.parse("own:respa8")
    assert not resonance.serves(scenes.load_scene("spring"), label)
    bent = scenes.load_scene("multiple-time-steps")
    assert resonance.serves(bent, label)
    bent = bent.derived(terms=(*bent.terms, Quartic(i=np.array([0]), b=np.array([0.3]), at=np.zeros(1))))
    found = stability.record(bent, None, [str(label)])
    assert found.resonances == ()
    assert found.limits[0].agrees


def test_a_scene_that_resonates_nowhere_is_stored_and_says_so(tmp_path: Path) -> None:
    """Its slow spring is too weak: a study without bands could not be stored."""
    text = scenes.text_of("multiple-time-steps").replace("stiffness = 1.7", "stiffness = 1.7e-12")
    soft = scenes.parse(text, name="soft", where="here")
    found = stability.record(soft, tmp_path / "s.h5", ["own:respa8"])
    (none,) = stability.stored(tmp_path / "s.h5").resonances
    assert none.bands == none.bands_predicted == ()
    assert none.radius.tobytes() == found.resonances[0].radius.tobytes()
    assert "own:respa8: grows at no h w_fast from 1 to 7; the exact map agrees to 0.0e+00" in found.sentences
    assert found.failures == []


def test_bdf_leaves_the_stiff_mode_behind_where_adams_cannot(need: Need) -> None:
    need("sundials:bdf")
    (bdf,) = stiffness_costs.measure(engines.parse("sundials:bdf"), "two-scales", [1e10])
    (adams,) = stiffness_costs.measure(engines.parse("sundials:adams"), "two-scales", [1e10])
    assert bdf.outcome == "complete"
    assert bdf.error < 1e-3
    assert adams.steps > 100 * bdf.steps


def test_the_document_has_the_promised_fields(need: Need) -> None:
    need("own:euler")
    study = stability.record(scenes.load_scene("overdamped"), None, ["own:*euler"])
    found = json.loads(json.dumps(study.document(), allow_nan=False))
    assert study.passed
    for method in found["methods"]:
        assert {"method", "limit", "theory", "growth_above", "growth_predicted", "points"} <= set(method)
        assert len(method["points"]) >= 40
    assert {region["wrong"] for region in found["regions"]} == {0}


def test_a_wrong_growth_fails_the_study(need: Need) -> None:
    need("own:euler")
    study = stability.record(scenes.load_scene("spring"), None, ["own:semi-implicit-euler"])
    assert study.passed
    (limit,) = study.limits
    wrong = replace(study, limits=(replace(limit, growth_above=limit.growth_above * (1 + 1e-4)),))
    assert not wrong.passed
    assert "growth" in wrong.failures[0]


@pytest.mark.parametrize("stated", [0.0, 1.5, 2.6, np.inf])
def test_a_scheme_that_states_a_wrong_limit_fails_and_the_largest_step_is_by_what_was_measured(
    stated: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # its title is another scheme's, which the tests after this one look up
    monkeypatch.setattr(lookup, "_brought", dict(lookup._brought))
    scheme = replace(schemes.scheme("velocity-verlet"), name=f"stated:{stated}", limit=stated)
    method = replace(engines.method(engines.parse("own:velocity-verlet")), scheme=scheme.name)
    own = engines.engine("own")
    wrong = replace(own, name="stated", methods={method.name: method}, thermostats={}, schemes=(scheme,))
    with engines.while_here(wrong, "here", "1"):
        study = stability.record(scenes.load_scene("spring"), None, ["stated:velocity-verlet"])
        assert study.status == 1
        assert "whose stated limit is wrong" in study.failures[0]
        assert study.largest(study.limits[0]) == pytest.approx(2.0, rel=1e-9)
        # so does the report of a run beyond it
        scene = scenes.load_scene("spring").derived(step=2.3, steps=20)
        report = session.run(scene, tmp_path / "r.h5", methods=["stated:velocity-verlet"])
        said = as_text(report.lines())
        assert "h = 2.3 is beyond the limit of velocity Verlet here, 2: stated:velocity-verlet" in said


def test_every_figure_of_stability_is_drawn(tmp_path: Path, need: Need) -> None:
    need("openmm:mts")
    study = stability.record(
        scenes.load_scene("multiple-time-steps"), None, ["own:semi-implicit-euler", "openmm:mts"]
    )
    damped = stability.record(scenes.load_scene("overdamped"), None, ["own:implicit-euler"])
    written = [path.name for one in (study, damped) for path in STUDY.draw(one, tmp_path)]
    costs = stiffness_costs.study("overdamped", ["own:implicit-euler"])
    written += [path.name for path in stiffness_costs.draw(costs, tmp_path)]
    for name in ("limits", "resonances", "regions", "costs-overdamped"):
        assert f"stability-{name}.png" in written
        assert (tmp_path / f"stability-{name}.png").stat().st_size > 10_000


LONGEST = [
    # with friction: from the roots of the one-step map, by hand; explicit Euler w2 h**2 - r h + 1 = 1
    ("overdamped", "own:euler", 0.00669602),
    ("overdamped", "own:semi-implicit-euler", 0.00669569),
    ("overdamped", "own:velocity-verlet", 0.0133917),
    ("rlc-circuit", "own:euler", 22.0 * 47e-9),
    ("rlc-circuit", "own:semi-implicit-euler", 2.38953e-5),
    # the first resonance: h w = 3.100202 of the fast spring, w**2 = 42.5 (1/1.3 + 1/0.9)
    ("multiple-time-steps", "own:respa8", 3.100202 / np.sqrt(42.5 * (1 / 1.3 + 1 / 0.9))),
    ("multiple-time-steps", "own:velocity-verlet", 2 / 8.969653440918822),
]


@pytest.mark.parametrize(("name", "method", "limit"), LONGEST)
def test_the_largest_step_is_where_the_scene_itself_begins_to_grow(
    name: str, method: str, limit: float, need: Need
) -> None:
    need(method)
    scene, label = scenes.load_scene(name), engines.parse(method)
    found = longest(schemes.scheme(engines.method(label).scheme), scene)
    assert found == pytest.approx(limit, rel=1e-5)

    def reach(h: float) -> float:
        run = driver.run(replace(scene, step=h, steps=40_000, every=100, quantities=("q", "p")), label)
        return float(np.max(np.abs(run.q)) / max(abs(scene.q)))

    below, above = reach(found * (1 - 2e-3)), reach(found * (1 + 2e-3))
    assert below < 10
    # the lightly damped circuit grows by 7e-6 a step there, the others by far more
    assert above > (1.2 if name == "rlc-circuit" and method == "own:euler" else 1e10) * below


@pytest.mark.parametrize("stiff", [3e3, 1e5])
def test_a_resonance_narrower_than_the_scan_is_found(stiff: float, need: Need) -> None:
    need("own:respa8")
    m, label = np.array([1.3, 0.9]), engines.parse("own:respa8")
    wall = WallSpring(i=[0], k=[1.7], at=[0.0])
    scene = Scene(
        m=m,
        terms=(wall, Spring(a=[0], b=[1], k=[stiff], rest=[0.0], fast=True)),
        q=[0.3, 0.3],
        p=[0.6, 0.4],
        step=1e-3,
        steps=1,
    )
    w = np.sqrt(stiff * (1 / m).sum())
    # a slow kick every half turn of the fast spring's own 8 steps: just below h w = 16 sin(pi/16)
    (low, high), second = resonance.measure(scene, label).bands
    assert high == pytest.approx(16 * np.sin(np.pi / 16), rel=1e-7)
    # to first order in the slow spring's share of w**2 of the fast mode
    share = 1.7 / m[0] * m[1] / m.sum() / w**2
    assert (high - low) / high == pytest.approx(share, rel=5e-3)
    assert second[0] > 6
    assert longest(schemes.scheme("respa8"), scene) * w == pytest.approx(low, rel=1e-8)


def test_the_largest_step_of_fast_springs_alone_is_that_of_their_own_steps() -> None:
    m, k = np.array([1.7, 0.9]), np.array([4.0, 11.0])
    terms = (
        WallSpring(i=[0], k=k[:1], at=[0.0], fast=True),
        Spring(a=[0], b=[1], k=k[1:], rest=[0.0], fast=True),
    )
    scene = Scene(m=m, terms=terms, q=[0.3, 0.3], p=[0.6, 0.4], step=0.1, steps=1)
    stiff = np.array([[k.sum(), -k[1]], [-k[1], k[1]]]) / np.sqrt(np.outer(m, m))
    assert longest(schemes.scheme("respa8"), scene) == pytest.approx(
        16 / np.sqrt(np.linalg.eigvalsh(stiff)[-1]), rel=1e-8
    )


@pytest.mark.parametrize(("given", "wrong", "unmeasured"), [(np.nan, 0, 12), (np.inf, 7, 0)])
def test_points_at_which_an_engine_stops_are_not_measured_and_those_it_loses_are_wrong(
    given: float, wrong: int, unmeasured: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = propagators.measured

    def lost(springs: Springs) -> np.ndarray:
        out = plain(springs)
        out[:12] = given
        return out

    monkeypatch.setattr(propagators, "measured", lost)
    # of these twelve, five are beyond the limit by theory too
    found = regions.measure(engines.parse("own:velocity-verlet"), points=12)
    assert (found.wrong, found.unmeasured, found.points) == (wrong, unmeasured, 144)
    assert (found.off < 1) == (wrong == 0)


def test_what_an_engine_does_not_take_of_a_scan_is_said_of_the_scan() -> None:
    engine = engines.parse("box2d:distance-joint")
    if engines.absence("box2d"):
        pytest.skip("needs Box2D")
    said = propagators.absence(engine, limits.FIRST_H_W, limits.LAST_H_W)
    assert said is not None
    assert said.startswith("springs of h w = 1e-09 to 1e+06")
    assert "units" not in said


def test_of_joined_masses_with_unlike_friction_the_weakest_decay_sets_explicit_euler_s_limit() -> None:
    m, k, c = np.array([2.3, 0.071]), np.array([1.7, 5.3, 0.0]), np.array([0.31, 0.0])
    scene = builders.chain(2, m, k)
    scene = replace(scene, terms=(*scene.terms, Damping(i=[0], c=c[:1])))
    stiff = np.array([[k[0] + k[1], -k[1]], [-k[1], k[1]]])
    motion = np.block([[np.zeros((2, 2)), np.diag(1 / m)], [-stiff, -np.diag(c / m)]])
    # |1 + h x| = 1; the growth there is 1e-7 a step at 1.6 times that only
    limit = min(-2 * x.real / abs(x) ** 2 for x in np.linalg.eigvals(motion))
    assert limit == pytest.approx(5.34128e-05, rel=1e-5)
    # a growth of 64 roundings is seen, 7e-8 above it where long double is no wider than double
    assert longest(schemes.scheme("explicit-euler"), scene) == pytest.approx(limit, rel=1e-6)
    # of three masses with friction on the middle one, the mode that leaves it at rest has none
    even = builders.chain(3, 1.3, 2.9)
    even = replace(even, terms=(*even.terms, Damping(i=[1], c=[0.2])))
    assert longest(schemes.scheme("explicit-euler"), even) == 0


@pytest.mark.parametrize(
    ("name", "method", "said"),
    [
        ("overdamped", "own:euler", "within the limit of every method"),
        ("morse-bond", "own:velocity-verlet", "where its motion is stiffest: w = 979.4"),
        ("multiple-time-steps", "own:respa8", "0.3468"),
    ],
)
def test_a_study_prints_the_limits_of_the_scene(name: str, method: str, said: str, need: Need) -> None:
    need(method)
    study = stability.record(scenes.load_scene(name), None, [method])
    text = "\n".join(str(line) for line in STUDY.lines(study) if isinstance(line, Text))
    text += f"{study.largest(study.limits[0]):.4g}"
    assert said in text
    assert "no step is too long" not in text
    (row,) = study.document()["methods"]
    assert row["largest_step"] == pytest.approx(study.largest(study.limits[0]))


def test_the_frequency_of_a_scene_in_a_field_is_said_to_be_that_without_it() -> None:
    """With it the faster of two circles turns by 1.419."""
    study = stability.record(scenes.load_scene("foucault"), None, ["own:euler"])
    said = next(str(line) for line in STUDY.lines(study) if "fastest angular frequency" in str(line))
    assert "of this scene, without its field: w = 1.30609" in said
    text = "\n".join(str(line) for line in STUDY.lines(study) if isinstance(line, Text))
    assert "no largest step is worked out with a magnetic field" in text
    assert "anharmonic" not in text


def test_a_charge_that_circles_is_not_said_to_be_at_rest() -> None:
    study = stability.record(scenes.load_scene("magnetic"), None, ["own:rk4"])
    said = "\n".join(str(line) for line in STUDY.lines(study) if isinstance(line, Text))
    assert "oscillates but by its magnetic field, with which no largest step is worked out" in said


def test_the_frequency_of_a_modulated_spring_with_friction_is_said_to_be_its_largest() -> None:
    """At its start the stiffness is 2.4335 (1 + 0.031 cos 1), by which w would be 1.11222."""
    term = ModulatedSpring(
        i=np.array([0]), k=np.array([2.4335]), depth=np.array([0.031]), frequency=np.array([1.1]),
        phase=np.array([1.0]), at=np.array([0.0]),
    )  # fmt: skip
    still = builders.spring(m=2.0, k=2.4335, q=0.3, p=0.7)
    scene = replace(still, terms=(term, Damping(i=[0], c=[0.2])))
    study = stability.record(scene, None, ["own:velocity-verlet"])
    said = next(str(line) for line in STUDY.lines(study) if "fastest angular frequency" in str(line))
    assert "its modulated springs at their stiffest, without its friction: w = 1.12003" in said


def test_a_method_that_cannot_serve_the_scene_has_no_largest_step_there(need: Need) -> None:
    need("own:respa8")
    study = stability.record(scenes.load_scene("spring"), None, ["own:respa8", "own:velocity-verlet"])
    assert [study.largest(x) for x in study.limits] == pytest.approx([np.nan, 2.0], nan_ok=True)
    # "-" in the table has its reason below it
    assert "No largest step here by own:respa8: it is for scenes with springs marked fast" in str(study)


def test_a_method_that_does_not_start_the_scene_is_left_out_with_its_reason(need: Need) -> None:
    need("openmm:verlet")
    tied = Spring(a=[0, 1], b=[2, 3], k=[7.1, 1.7], rest=[0.0, 0.0])
    scene = Scene(
        m=[3.7, 3.7, 1.3, 1.3], q=[0.3, -0.2, 0.5, 0.9], p=[0.7, 1.1, -0.4, 0.2], places=[0, 1, 3, 4],
        terms=(tied,), step=0.1, steps=60,
    )  # fmt: skip
    study = stability.record(scene, None, ["own:velocity-verlet", "openmm:verlet"])
    assert [x.method for x in study.limits] == ["own:velocity-verlet"]
    (left,) = study.left_out
    assert left.method == "openmm:verlet"
    assert "a program's spring pulls alike along every axis" in left.reason


def test_a_method_that_refuses_springs_of_the_scan_is_left_out_with_its_reason(need: Need) -> None:
    """One of them ended the study of `--method 'box2d:*'`."""
    need("box2d:distance-joint")
    scene = scenes.load_scene("spring")
    study = stability.record(scene, None, ["own:velocity-verlet", "box2d:distance-joint"])
    assert [x.method for x in study.limits] == ["own:velocity-verlet"]
    assert "a joint's length of" in study.left_out[0].reason


def test_what_is_left_out_is_named_once() -> None:
    reasons = {
        "own:alone": "own:alone: serves fields alone", "own:a": "no step", "own:b": "no step",
        **dict.fromkeys(("own:c", "own:d"), "it is for scenes with damping"), "own:e": "it has no bond term",
    }  # fmt: skip
    said = left_out([LeftOut(method=method, reason=reason) for method, reason in reasons.items()])
    assert [str(line) for line in said[1:]] == [
        "Left out own:alone: serves fields alone",
        "Left out own:a, own:b: no step",
        "Left out own:c, own:d: each is for scenes with damping",
        "Left out own:e: it has no bond term",
    ]


def test_the_stiffest_state_of_an_anharmonic_motion_is_that_of_its_amplitude() -> None:
    scene = scenes.load_scene("anharmonic")
    spring, quartic = scene.terms
    k, b, energy = spring.k[0], quartic.b[0], scene.system.energy(scene.q, scene.p)
    # k/2 A**2 + b/4 A**4 is the energy, and k + 3 b A**2 the curvature there
    square = (np.sqrt(k * k + 4 * b * energy) - k) / b
    assert fastest(scene) == pytest.approx(np.sqrt((k + 3 * b * square) / scene.m[0]), rel=1e-8)


def test_a_method_that_needs_a_field_is_told_why_it_has_no_limit() -> None:
    found = stability.record(scenes.load_scene("magnetic"), None, ["own:boris", "own:euler"])
    why = "limits are measured on springs alone, without the magnetic field that it needs"
    assert found.left_out == (LeftOut(method="own:boris", reason=why),)


@pytest.mark.parametrize("bent", [False, True])
def test_a_spring_with_a_constant_force_is_not_called_anharmonic(bent: bool) -> None:
    plain, one = scenes.load_scene("spring"), np.array([0])
    weight = Weight(i=one, force=np.array([-3.0]), at=np.zeros(1))
    more = Quartic(i=one, b=np.ones(1), at=np.zeros(1)) if bent else weight
    study = stability.record(plain.derived(terms=(*plain.terms, more)), None, ["own:euler"])
    said = "\n".join(str(line) for line in STUDY.lines(study) if isinstance(line, Text))
    assert ("anharmonic" in said) == bent


def test_an_error_that_is_not_known_is_told_why(tmp_path: Path) -> None:
    plain, one = scenes.load_scene("spring"), np.array([0])
    weight = Weight(i=one, force=np.array([-3.0]), at=np.zeros(1))
    bent = Quartic(i=one, b=np.array([0.4]), at=np.zeros(1))
    for terms, unknown in (((weight,), False), ((weight, bent), True)):
        scene = plain.derived(terms=(*plain.terms, *terms))
        report = session.run(scene, tmp_path / f"{unknown}.h5", methods=["own:euler"])
        said = as_text(report.lines())
        assert ("-: no exact solution of this scene is known here" in said) == unknown
