"""Limits of stability and largest steps against independent routes: traces in mpmath at 40 digits, roots by
hand, reference bands at 120 digits, and stepping on both sides."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

from springcheck import driver, engines, schemes
from springcheck.physics import builders
from springcheck.physics import scenefile as scenes
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Quartic, Spring, WallSpring, Weight
from springcheck.schemes import Scheme, lookup
from springcheck.studies.choose import LeftOut, left_out
from springcheck.studies.run import measure as session
from springcheck.studies.stability import STUDY, propagators
from springcheck.studies.stability import measure as stability
from springcheck.studies.stability.edges import first_growth
from springcheck.studies.stability.longest import fastest, longest
from springcheck.text.lines import as_text
from springcheck.text.wording import rounded_down

LABELS = [
    str(label)
    for label in dict.fromkeys([*engines.match(("*",)), *engines.match(("own:*",), every=True)])
    if schemes.scheme(engines.method(label).scheme).has("one-step")
    and not engines.refusal(builders.spring(1, 1, 1, 0, 0.1, 1), label)
]
SINGLE = ["openmm:verlet@OpenCL-single", "openmm:verlet@OpenCL-mixed", "openmm:verlet@OpenCL-double"]
BANDS = Path(__file__).parents[1] / "data" / "reference" / "stiff" / "multiple-time-steps.json"
Need = Callable[[str], None]

HALF = (
    ("kick", "0.0829844064174052"), ("drift", "0.245298957184271"), ("kick", "0.396309801498368"),
    ("drift", "0.604872665711080"), ("kick", "-0.0390563049223486"), ("drift", "-0.350171622895351"),
)  # fmt: skip
NARROW = Scheme(
    name="srkn6b", title="Blanes-Moan SRKN 6 b", order=4, limit=3.1634650665581866, symplectic=True,
    stages=(*HALF, ("kick", "0.1195241940131508"), *reversed(HALF)), source="Blanes & Moan 2002",
)  # fmt: skip
"""It grows for h w from 3.1635 to 3.1685, by 1.0024 a step, and again from 5.027 on only."""


def trace(stages: tuple[tuple[str, object], ...], x: mp.mpf) -> mp.mpf:
    """Half the trace of a splitting's step on a spring of h w = x."""
    m = mp.eye(2)
    for kind, part in stages:
        c = mp.mpf(part.numerator) / part.denominator if hasattr(part, "numerator") else mp.mpf(str(part))
        m = (mp.matrix([[1, 0], [-c * x, 1]]) if kind == "kick" else mp.matrix([[1, c * x], [0, 1]])) * m
    return (m[0, 0] + m[1, 1]) / 2


def by_trace(scheme: Scheme, to: float, points: int = 5000) -> float:
    """The first h w at which half the trace leaves -1 to 1, in 40 digits: on the grid or between at an
    extremum, then by bisection."""
    with mp.workdps(40):
        outside = lambda x: abs(trace(scheme.stages, x)) - 1  # noqa: E731
        grid = [mp.mpf(to) * i / points for i in range(1, points + 1)]
        low, high = next((a, b) for a, b in pairwise(grid) if outside(b) > 0)
        for _ in range(100):
            middle = (low + high) / 2
            low, high = (low, middle) if outside(middle) > 0 else (middle, high)
        return float(low)


@pytest.mark.parametrize("name", LABELS)
def test_the_limit_of_an_engine_is_that_of_its_scheme(name: str, need: Need) -> None:
    need(name)
    found = stability.measure(engines.parse(name))
    assert found.follows
    assert found.stated
    assert found.limit == found.theory or abs(found.limit - found.theory) <= max(1e-6, found.bound)
    np.testing.assert_allclose(found.radius, found.radius_predicted, rtol=1e-12)


@pytest.mark.campaign
@pytest.mark.parametrize("name", SINGLE)
def test_the_limit_in_lower_precision_keeps_its_stated_bound(name: str, need: Need) -> None:
    need(name)
    found = stability.measure(engines.parse(name))
    assert found.bound < 1e-4
    assert found.follows, found


@pytest.mark.parametrize("name", ["velocity-verlet", "ruth3", "forest-ruth", "yoshida4"])
def test_the_stated_limit_is_where_the_trace_crosses_two(name: str) -> None:
    scheme = schemes.SCHEMES[name]
    assert scheme.limit == pytest.approx(by_trace(scheme, 3.0), rel=1e-12)


def test_a_window_narrower_than_the_scan_is_found_from_where_eigenvalues_meet() -> None:
    assert by_trace(NARROW, 4.0) == pytest.approx(NARROW.limit, rel=1e-12)
    unit = builders.spring(1, 1, 1, 0, 0.1, 10)
    assert longest(NARROW, unit) == pytest.approx(NARROW.limit, rel=1e-9)
    # a spring that is not 1: w = 1.2
    assert longest(NARROW, builders.spring(2.5, 3.6, 1, 0, 0.1, 10)) * 1.2 == pytest.approx(NARROW.limit)
    # a window a hundred times narrower than the spacing of the grid
    x = np.geomspace(2.2, 3.8, 50)

    def maps(h: np.ndarray) -> np.ndarray:
        half = -1 + (h - 3.0) ** 2 - 1e-9
        out = np.zeros((len(h), 1, 2, 2))
        out[:, 0, 0, 0] = out[:, 0, 1, 1] = half
        out[:, 0, 0, 1], out[:, 0, 1, 0] = 1, half**2 - 1
        return out

    assert first_growth(maps, x, 2.0**-52) == pytest.approx(3 - np.sqrt(1e-9), abs=1e-9)


def test_a_kick_that_is_a_hundred_thousandth_too_strong_moves_the_limit_out_of_its_bound() -> None:
    label = engines.parse("own:semi-implicit-euler")
    right = stability.measure(label)
    strong = lambda turn: propagators.theory(label, turn * np.sqrt(1.00001))  # noqa: E731
    moved = replace(right, limit=first_growth(strong, stability.GRID, propagators.noise(label)))
    assert right.follows
    assert not moved.follows
    assert abs(moved.limit - 2 / np.sqrt(1.00001)) < 1e-9


@pytest.mark.parametrize("stated", [0.0, 1.5, 2.6, np.inf])
def test_a_scheme_that_states_a_wrong_limit_fails_and_the_largest_step_is_by_its_map(
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
        assert study.failures[0].startswith("stated:velocity-verlet: its scheme states")
        assert study.largest(study.limits[0]) == pytest.approx(2.0, rel=1e-9)
        # so does the report of a run beyond it
        scene = scenes.load_scene("spring").derived(step=2.3, steps=20)
        report = session.run(scene, tmp_path / "r.h5", methods=["stated:velocity-verlet"])
        assert "h = 2.3 is beyond the limit of velocity Verlet here, 1.999999" in as_text(report.lines())


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


def test_the_first_resonance_is_that_of_the_exact_matrix() -> None:
    scene = scenes.load_scene("multiple-time-steps")
    ((low, _), *_) = json.loads(BANDS.read_text(encoding="utf-8"))["bands"]
    w = np.sqrt(42.5 * (1 / 1.3 + 1 / 0.9))
    assert longest(schemes.scheme("respa8"), scene) * w == pytest.approx(float(low), rel=1e-9)
    # printed rounded down: at the nearest number of four digits, 0.3468, motions grow
    text = as_text(stability.record(scene, None, ["own:respa8", "own:velocity-verlet"]).lines())
    assert "0.34679839" in text
    assert "0.22297405" in text


@pytest.mark.parametrize("stiff", [3e3, 1e5])
def test_a_resonance_narrower_than_the_scan_is_found(stiff: float) -> None:
    m = np.array([1.3, 0.9])
    wall = WallSpring(i=[0], k=[1.7], at=[0.0])
    fast = Spring(a=[0], b=[1], k=[stiff], rest=[0.0], fast=True)
    scene = Scene(m=m, terms=(wall, fast), q=[0.3, 0.3], p=[0.6, 0.4], step=1e-3, steps=1)
    # just below h w = 16 sin(pi/16), where a slow kick comes every half turn of the fast spring's own 8
    # steps; its width to first order in the slow spring's share of w**2 of the fast mode
    high, w = 16 * np.sin(np.pi / 16), np.sqrt(stiff * (1 / m).sum())
    share = 1.7 / m[0] * m[1] / m.sum() / w**2
    found = longest(schemes.scheme("respa8"), scene) * w
    assert (high - found) / high == pytest.approx(share, rel=5e-3)


def test_the_largest_step_of_fast_springs_alone_is_that_of_their_own_steps() -> None:
    m, k = np.array([1.7, 0.9]), np.array([4.0, 11.0])
    terms = (
        WallSpring(i=[0], k=k[:1], at=[0.0], fast=True),
        Spring(a=[0], b=[1], k=k[1:], rest=[0.0], fast=True),
    )
    scene = Scene(m=m, terms=terms, q=[0.3, 0.3], p=[0.6, 0.4], step=0.1, steps=1)
    stiff = np.array([[k.sum(), -k[1]], [-k[1], k[1]]]) / np.sqrt(np.outer(m, m))
    found = longest(schemes.scheme("respa8"), scene)
    assert found == pytest.approx(16 / np.sqrt(np.linalg.eigvalsh(stiff)[-1]), rel=1e-8)


def test_of_joined_masses_with_unlike_friction_the_weakest_decay_sets_explicit_euler_s_limit() -> None:
    m, k, c = np.array([2.3, 0.071]), np.array([1.7, 5.3, 0.0]), np.array([3.1, 0.0])
    scene = builders.chain(2, m, k)
    scene = replace(scene, terms=(*scene.terms, Damping(i=[0], c=c[:1])))
    stiff = np.array([[k[0] + k[1], -k[1]], [-k[1], k[1]]])
    motion = np.block([[np.zeros((2, 2)), np.diag(1 / m)], [-stiff, -np.diag(c / m)]])
    # |1 + h x| = 1; modes that friction couples count as growing from 1e-7 a step on
    limit = min(-2 * x.real / abs(x) ** 2 for x in np.linalg.eigvals(motion))
    assert limit <= longest(schemes.scheme("explicit-euler"), scene) <= 1.01 * limit


def test_the_stiffest_state_of_an_anharmonic_motion_is_that_of_its_amplitude() -> None:
    scene = scenes.load_scene("anharmonic")
    spring, quartic = scene.terms
    k, b, energy = spring.k[0], quartic.b[0], scene.system.energy(scene.q, scene.p)
    # k/2 A**2 + b/4 A**4 is the energy, and k + 3 b A**2 the curvature there
    square = (np.sqrt(k * k + 4 * b * energy) - k) / b
    assert fastest(scene) == pytest.approx(np.sqrt((k + 3 * b * square) / scene.m[0]), rel=1e-8)


@pytest.mark.parametrize("bent", [False, True])
def test_a_spring_with_a_constant_force_is_not_called_anharmonic(bent: bool) -> None:
    plain, one = scenes.load_scene("spring"), np.array([0])
    weight = Weight(i=one, force=np.array([-3.0]), at=np.zeros(1))
    more = Quartic(i=one, b=np.ones(1), at=np.zeros(1)) if bent else weight
    study = stability.record(plain.derived(terms=(*plain.terms, more)), None, ["own:euler"])
    assert ("small oscillations" in as_text(STUDY.lines(study))) == bent


def test_the_table_fits_80_columns_and_says_never_where_rounding_hides_the_growth(need: Need) -> None:
    need("openmm:mts")
    found = stability.record(scenes.load_scene("multiple-time-steps"), None)
    text = as_text(found.lines(), 80)
    assert max(map(len, text.splitlines())) <= 80
    row = next(line for line in text.splitlines() if line.startswith("own:euler"))
    assert row.split()[1:] == ["never", "stable", "never", "stable", "none"]
    assert found.status == 0
    document = json.loads(json.dumps(found.document(), allow_nan=False))
    assert {x["method"] for x in document["methods"]} >= {"own:euler", "openmm:mts"}


def test_a_study_is_stored_and_drawn(tmp_path: Path) -> None:
    study = stability.record(scenes.load_scene("spring-uneven"), tmp_path / "s.h5", ["own:*verlet"])
    again = STUDY.stored(tmp_path / "s.h5")
    assert as_text(again.lines()) == as_text(study.lines())
    assert [x.radius.tobytes() for x in again.limits] == [x.radius.tobytes() for x in study.limits]
    (picture, *_) = STUDY.draw(study, tmp_path)
    assert picture.name == "stability.png"
    assert picture.stat().st_size > 10_000


def test_a_method_that_cannot_serve_the_scene_has_no_largest_step_there() -> None:
    study = stability.record(scenes.load_scene("spring"), None, ["own:respa8", "own:velocity-verlet"])
    assert [study.largest(x) for x in study.limits] == pytest.approx([np.nan, 2.0], nan_ok=True)


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
    assert "one stiffness along every axis" in left.reason


def test_what_is_left_out_is_named_once() -> None:
    reasons = {
        "own:alone": "own:alone: serves baths alone", "own:a": "no step", "own:b": "no step",
        **dict.fromkeys(("own:c", "own:d"), "it is for scenes with damping"), "own:e": "it has no bond term",
    }  # fmt: skip
    said = left_out([LeftOut(method=method, reason=reason) for method, reason in reasons.items()])
    assert [str(line) for line in said[1:]] == [
        "Left out own:alone: serves baths alone",
        "Left out own:a, own:b: no step",
        "Left out own:c, own:d: each is for scenes with damping",
        "Left out own:e: it has no bond term",
    ]


@pytest.mark.parametrize("x", [0.22297405503719, 0.34679839925, 3.1634650665581866, 2.0, 1e-9 / 3, 16.0, 4e9])
def test_a_printed_limit_is_never_above_the_limit(x: float) -> None:
    for digits in (4, 8):
        assert x * (1 - 10.0 ** (1 - digits)) < float(rounded_down(x, digits)) <= x
    assert rounded_down(0.34679839925) == "0.34679839"
    assert rounded_down(2.0) == "2"


def test_an_error_that_is_not_known_is_told_why(tmp_path: Path) -> None:
    plain, one = scenes.load_scene("spring"), np.array([0])
    weight = Weight(i=one, force=np.array([-3.0]), at=np.zeros(1))
    bent = Quartic(i=one, b=np.array([-4.0]), at=np.zeros(1))
    for terms, unknown in (((weight,), False), ((weight, bent), True)):
        scene = plain.derived(terms=(*plain.terms, *terms))
        report = session.run(scene, tmp_path / f"{unknown}.h5", methods=["own:euler"])
        said = as_text(report.lines())
        assert ("-: no reference solution, because" in said) == unknown


def test_an_engine_that_stops_over_one_spring_is_measured_on_others(monkeypatch: pytest.MonkeyPatch) -> None:
    label = engines.parse("own:velocity-verlet")
    plain, turn = driver.run, np.array([0.3, 1.9, 2.1, 50.0])

    def stops(scene: Scene, label: engines.Label) -> object:
        found = plain(scene, label)
        lost = replace(found.outcome, status="stopped", step=0)
        return found if np.max(scene.terms[0].k) < 1e5 else replace(found.at(slice(1)), outcome=lost)

    monkeypatch.setattr(driver, "run", stops)
    found = propagators.measured(label, turn)
    assert np.isfinite(found[:3]).all()
    assert np.isnan(found[3]).all()
    monkeypatch.undo()
    right = partial(propagators.theory, label)(turn)
    np.testing.assert_allclose(found[:3], right[:3].astype(np.float64), rtol=1e-13, atol=1e-13)
