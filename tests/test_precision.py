"""Errors obey the laws of the schemes, nothing is lost, and nothing but seconds depends on the clock."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springcheck import driver, engines, store
from springcheck.engines.contract import Label
from springcheck.errors import SceneError, StoreError
from springcheck.physics import builders
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import WIDE
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, WallSpring
from springcheck.schemes import SCHEMES, matrix
from springcheck.studies.precision import STUDY, accuracy, fits, result, sweeps
from springcheck.studies.precision import measure as precision
from springcheck.studies.precision.accuracy import Accuracy
from springcheck.studies.precision.fits import POINTS, Point
from springcheck.studies.stability import longest

pytestmark = pytest.mark.usefixtures("steady_clock")

FIXED = [str(label) for label in engines.match(("*",)) if not engines.method(label).adaptive]
SINGLE = [name for name in scenes.names() if name in ("spring", "spring-uneven", "anharmonic")]
# all of them have a true motion: `accuracy.truth` raises where there is none
KNOWN = [name for name in scenes.names() if scenes.load_scene(name).bath is None]


def serving(labels: list[str], names: list[str]) -> list[tuple[str, str]]:
    return [
        (label, name)
        for name in names
        for label in labels
        if engines.refusal(scenes.load_scene(name), engines.parse(label)) is None
    ]


def measure(scene: Scene, label: str, counts: list[int]) -> list[Point]:
    """Errors at these numbers of steps, without a clock."""
    known, parsed = accuracy.truth(scene), engines.parse(label)
    points = []
    for steps in counts:
        every = max(d for d in range(1, steps // 1024 + 2) if steps % d == 0)
        here = replace(scene, step=known.duration / steps, steps=steps, every=every, quantities=("q", "p"))
        errors = accuracy.Errors(known, here.step, every, scheme=SCHEMES[engines.method(parsed).scheme])
        record = driver.play(here, parsed, errors, planned=sweeps.PLANNED)
        assert record.outcome.status == "complete"
        points.append(
            Point(
                method=label,
                step=here.step,
                tolerance=None,
                steps=steps,
                outcome="complete",
                accuracy=errors.result,
                force_calls=record.force_calls,
            )
        )
    return points


def made_up(
    errors: list[float], seconds: list[float] | None = None, rounding: list[float] | None = None
) -> list[Point]:
    """Points at steps 1, 1/2, 1/4 ... with these errors."""
    return [
        Point(
            method="own:euler",
            step=0.5**i,
            tolerance=None,
            steps=2**i,
            outcome="complete",
            accuracy=Accuracy(max_error=error, rounding_error=rounding[i] if rounding else None),
            run_seconds_repeats=(seconds[i] if seconds else 2.0**i,),
        )
        for i, error in enumerate(errors)
    ]


@pytest.mark.campaign
@pytest.mark.parametrize(("label", "name"), serving(FIXED, SINGLE))
def test_every_method_has_the_order_of_its_scheme(label: str, name: str, need: Callable[[str], None]) -> None:
    need(label)
    scene = scenes.load_scene(name)
    # half of its motion: the steps that are needed grow with the square of it
    scene = replace(scene, steps=scene.steps // 2)
    scheme = SCHEMES[engines.method(engines.parse(label)).scheme]
    # explicit Euler is off by (w T)**2 / 2N, Verlet by (w T)**3 / 24 N**2: at most a hundredth from here on
    angle = accuracy.truth(scene).angle
    fewest = int(100 * angle**2 if scheme.order == 1 else 2 * angle**1.5)
    fit = fits.order(measure(scene, label, [fewest * 2**i for i in range(4)]))
    assert fit is not None
    assert abs(fit.order - scheme.order) < 0.02
    assert fit.standard_error < 0.01


def test_slopes_that_drift_evenly_claim_no_order_and_coarse_ones_do_not_hide_it() -> None:
    def halved(start: float, *slopes: float) -> list[Point]:
        return made_up([start * 0.5 ** sum(slopes[:j]) for j in range(len(slopes) + 1)])

    # RK4 on three pendulums that nearly reach the top: they fall towards 4, where nothing shows that they end
    assert fits.order(halved(1e-3, 4.73, 4.598, 4.437, 4.279)) is None
    # halved in each step they end at 4, and the standard error reaches there
    found = fits.order(halved(1e-4, 4.32, 4.16, 4.08))
    assert found is not None
    assert abs(found.order - 4) < found.standard_error
    # the blog's four: the coarsest four errors are those of a term of order 5
    found = fits.order(halved(1.5e-3, 5.137, 4.427, 3.814, 3.839, 3.913, 3.973))
    assert found is not None
    assert abs(found.order - 4) < found.standard_error < 0.33


def test_a_step_that_is_slightly_too_long_loses_the_order(need: Callable[[str], None]) -> None:
    # one part in 1e4 of the step is an error of phase that no smaller step removes
    scene = scenes.load_scene("spring-uneven")
    known = accuracy.truth(scene)
    points = []
    for steps in (256, 512, 1024, 2048, 4096):
        h = known.duration / steps
        errors = accuracy.Errors(known, h, 1, scheme=SCHEMES["semi-implicit-euler"])
        wrong = replace(scene, step=h * 1.0001, steps=steps, every=1, quantities=("q", "p"))
        driver.play(wrong, engines.parse("own:semi-implicit-euler"), errors)
        points.append(
            Point(method="", step=h, tolerance=None, steps=steps, outcome="complete", accuracy=errors.result)
        )
    # against its own closed form the fault is plain, and ten million times the rounding
    rounding = [point.rounding for point in points]
    assert all(part is not None and part > 1e-4 for part in rounding)
    fit = fits.order(
        [replace(p, accuracy=replace(p.accuracy, rounding_error=None)) for p in points if p.accuracy]
    )
    assert fit is None or abs(fit.order - 1) > 0.02 or fit.standard_error > 0.01


@pytest.mark.campaign
@pytest.mark.skipif(not WIDE, reason="rounding is told from a motion that rounds less")
@pytest.mark.parametrize(
    "label", [label for label, _ in serving(FIXED, ["spring-uneven"]) if not label.startswith("ase")]
)
def test_rounding_adds_up_as_its_condition_says(label: str, need: Callable[[str], None]) -> None:
    need(label)
    scene = scenes.load_scene("spring-uneven")
    known, parsed = accuracy.truth(scene), engines.parse(label)
    method, engine = engines.method(parsed), engines.load(parsed.engine)
    how = fits.condition(method, engine.arithmetic(parsed), known.angle)
    assert how is not None
    counts = [90_112, 180_224, 360_448] if "openmm" in label else [1_441_792, 2_883_584, 5_767_168]
    seen = [
        point.rounding / (how.eps * how.value(point.steps))
        for point in measure(scene, label, counts)
        if point.rounding and point.steps
    ]
    assert len(seen) == 3
    # a biased rounding may happen to fall near 0 at one step: the largest of three counts
    assert 0.1 / 3 < max(seen) < 10


def test_the_floor_of_openmm_verlet_is_reached_and_within_ten_of_its_condition(
    need: Callable[[str], None],
) -> None:
    need("openmm:verlet")
    scene = scenes.load_scene("spring-uneven")
    known = accuracy.truth(scene)
    points = measure(scene, "openmm:verlet", [2**i for i in range(13, 22)])
    best = fits.turned([point.error for point in points])
    assert best is not None
    label = engines.parse("openmm:verlet")
    how = fits.condition(engines.method(label), engines.load("openmm").arithmetic(label), known.angle)
    assert how is not None
    assert how.name == "N**1.5/(w T)"
    ratio = points[best].error / (how.eps * how.value(points[best].steps or 0))
    assert 0.1 < ratio < 10
    fit = fits.order(points)
    assert fit is not None
    assert abs(fit.order - 2) < 0.02
    steps, error = fits.expected_floor(points[: best - 1], fit, how, known.duration)
    assert 0.25 < steps / (points[best].steps or 0) < 4
    assert 0.25 < error / points[best].error < 4


def test_the_phase_error_of_semi_implicit_euler_is_that_of_its_frequency() -> None:
    scene = scenes.load_scene("spring-uneven")
    known = accuracy.truth(scene)
    (point,) = measure(scene, "own:semi-implicit-euler", [23])
    w = np.sqrt(np.longdouble(2.9) / np.longdouble(3.7))
    h = known.duration / 23
    turned = 23 * (2 * np.arcsin(h * w / 2) - h * w)
    assert point.accuracy is not None
    assert point.accuracy.phase_error is not None
    # the phase runs ahead steadily; the ellipse on which the scheme turns adds up to h w / 2 in between
    assert abs(point.accuracy.phase_error - float(turned)) <= float(h * w / 2) * 1.1


def test_a_phase_is_followed_past_half_a_turn() -> None:
    scene = scenes.load_scene("spring")
    known = accuracy.truth(replace(scene, steps=2000))
    w, h = 1.0, known.duration / 400
    errors = accuracy.Errors(known, h, 1, scheme=SCHEMES["velocity-verlet"])
    t = np.arange(401) * h
    # a motion that is faster by 5 %: after 200 time units it is 10 rad ahead
    q, p = np.sin(1.05 * w * t)[:, None], np.cos(1.05 * w * t)[:, None]
    for piece in (slice(0, 100), slice(100, 101), slice(101, 401)):
        errors(t[piece], q[piece], p[piece], None)
    assert errors.result.phase_error == pytest.approx(0.05 * t[-1], rel=1e-12)


def damped(c: float, steps: int) -> Scene:
    one = scenes.load_scene("spring-uneven")
    (wall,) = one.terms
    assert isinstance(wall, WallSpring)
    # at 0, where a mode that dies down loses no digits to its centre
    at = replace(wall, at=np.zeros(1))
    return replace(one, terms=(at, Damping(i=np.array([0]), c=np.array([c]))), steps=steps)


@pytest.mark.parametrize(("c", "steps", "count"), [(0.3, 200, 200), (0.3, 200, 800), (1.1, 3000, 3000)])
def test_the_phase_error_of_a_damped_spring_is_that_of_its_eigenvalues_while_it_moves(
    c: float, steps: int, count: int
) -> None:
    scene = damped(c, steps)
    (point,) = measure(scene, "own:rk4", [count])
    h, m, k = point.step or 0.0, scene.m, scene.system.hessian_diagonal(scene.q)
    one = matrix(SCHEMES["rk4"], h=h, m=m, k=k, c=c)[0].astype(np.float64)
    w = float(np.sqrt(k[0] / m[0] - (c / m[0] / 2) ** 2))
    ahead = np.max(np.angle(np.linalg.eigvals(one))) / h - w
    # until it moves by a thousandth of what it did, from which on its angle is that of rounding
    lasts = min(h * count, np.log(1 / accuracy.LEAST_AMPLITUDE) / (c / m[0] / 2))
    assert (lasts < h * count) == (c == 1.1)
    assert point.accuracy is not None
    assert point.accuracy.phase_error is not None
    # the ellipses of the scheme differ from circles by an error of one step
    assert point.accuracy.phase_error == pytest.approx(ahead * lasts, rel=0.05)


@pytest.mark.parametrize("name", ["a damped pair", "an overdamped spring"])
def test_there_is_no_phase_where_springs_alone_have_no_say(name: str) -> None:
    """Friction couples their modes; what is overdamped does not turn."""
    pair = builders.chain(2, np.array([2.3, 0.9]), 3.1, q=np.array([0.3, 0.1]), step=0.1, steps=40)
    two = replace(pair, terms=(*pair.terms, Damping(i=np.arange(2), c=np.array([0.35, 1.9]))))
    scene = {"a damped pair": two, "an overdamped spring": damped(20.0, 40)}[name]
    (point,) = measure(scene, "own:rk4", [80])
    assert point.accuracy is not None
    assert point.accuracy.phase_error is None
    assert point.document()["phase_error"] is None
    # with one rate the modes stay, and so does their phase
    even = replace(two, terms=(*pair.terms, Damping(i=np.arange(2), c=0.2 * two.m)))
    (point,) = measure(even, "own:rk4", [80])
    assert point.accuracy is not None
    assert point.accuracy.phase_error


def test_the_energy_error_of_explicit_euler_is_its_growth() -> None:
    scene = scenes.load_scene("spring-uneven")
    (point,) = measure(scene, "own:euler", [1000])
    h = accuracy.truth(scene).duration / 1000
    growth = (1 + h * h * 2.9 / 3.7) ** 1000 - 1
    assert point.accuracy is not None
    assert point.accuracy.energy_error == pytest.approx(growth, rel=1e-10)
    assert point.accuracy.end_error == point.accuracy.max_error


def test_the_error_of_a_mode_at_rest_has_no_phase() -> None:
    scene = scenes.load_scene("spring")
    free = replace(scene, terms=(replace(scene.terms[0], k=np.zeros(1)),))  # type: ignore[type-var]
    (point,) = measure(free, "own:semi-implicit-euler", [50])
    assert point.accuracy is not None
    assert point.accuracy.phase_error is None
    assert point.accuracy.max_error < 1e-14


@pytest.mark.parametrize("name", KNOWN)
def test_every_point_ends_at_the_same_time(name: str) -> None:
    scene = scenes.load_scene(name)
    known = accuracy.truth(scene)
    for i, here in enumerate(sweeps.by_step(scene, 2.0, known)):
        # one rounding of T/N, of the order of the spacing of doubles
        assert abs(here.steps * np.longdouble(here.step) - known.duration) <= 2.0**-53 * known.duration
        assert here.steps % here.every == 0
        assert here.frames <= max(accuracy.MOST_COMPARED_FRAMES + 1, sweeps.coarsest(known, 2.0) + 1)
        if i > 24:
            break
    assert i > 15


def test_a_sweep_begins_just_below_the_limit_of_stability() -> None:
    known = accuracy.truth(scenes.load_scene("spring-uneven"))
    steps = sweeps.coarsest(known, 2.0)
    assert known.angle / steps < 2 <= known.angle / (steps - 1)
    for limit in (0.0, np.inf):
        assert 0.9 < known.angle / sweeps.coarsest(known, limit) <= 1


@pytest.mark.parametrize("name", ["anharmonic", "pendulum"])
def test_the_frequency_is_the_largest_along_the_motion_as_in_the_study_of_stability(name: str) -> None:
    scene = scenes.load_scene(name)
    known = accuracy.truth(scene)
    assert known.w == longest.fastest(scene)


def test_of_many_separate_particles_the_stiffest_moment_of_any_is_searched() -> None:
    one = scenes.load_scene("anharmonic")
    n = longest.MOST_MODES + 1
    # all but the last rest
    moving = np.arange(n) == n - 1
    terms = tuple(
        type(term)(i=np.arange(n), **{x: np.repeat(getattr(term, x), n) for x in also})
        for term, also in zip(one.terms, (("k", "at"), ("b", "at")), strict=True)
    )
    scene = one.derived(m=np.repeat(one.m, n), q=moving * one.q, p=moving * one.p, terms=terms)
    assert accuracy.truth(scene).w == pytest.approx(accuracy.truth(one).w, rel=1e-12)


def test_the_same_study_twice_gives_the_same_errors_and_force_calls() -> None:
    scene = scenes.load_scene("spring-uneven")
    labels = list(engines.match(("own:*", "sundials:adams")))
    one, other = (precision.record(scene, labels, budget=0.5) for _ in range(2))
    assert len(one.points) > 20
    compared = 0
    known = {(p.method, p.step, p.tolerance): p for p in other.points if p.complete}
    for point in one.points:
        twin = known.get((point.method, point.step, point.tolerance))
        if point.complete and twin:
            compared += 1
            assert point.accuracy == twin.accuracy
            assert point.force_calls == twin.force_calls
    assert compared > 20


def test_what_fails_stays_in_with_its_reason(need: Callable[[str], None]) -> None:
    need("openmm:verlet")
    scene = replace(scenes.load_scene("spring-uneven"), steps=40_000, kind="particles")
    labels = [engines.parse("own:euler"), engines.parse("openmm:verlet@CUDA-double")]
    found = precision.record(scene, labels, budget=2.0)
    worst = found.of("own:euler")[0]
    # h w = 1 grows by sqrt(2) a step, past the largest double after 2048 steps
    assert worst.outcome == "diverged"
    assert "not finite" in worst.message
    assert worst.accuracy is None
    absent = found.of("openmm:verlet@CUDA-double")
    if len(absent) == 1:
        assert absent[0].outcome == "cannot run"
        assert "CUDA" in absent[0].message
    document = found.document()
    assert len(document["points"]) == len(found.points)
    assert document["points"][0]["outcome"].startswith("diverged: after")
    json.dumps(document, allow_nan=False)


def test_a_method_that_cannot_serve_the_scene_is_a_row() -> None:
    scene = replace(scenes.load_scene("spring"), kind="circuit", units="si")
    found = precision.record(scene, [engines.parse("ase:velocity-verlet")], budget=1.0)
    (point,) = found.points
    assert point.outcome == "cannot run"
    assert "circuit" in point.message
    said = str(found)
    assert "Left out ase:velocity-verlet: ASE moves particles, not circuits" in said
    assert said.count("ase:velocity-verlet") == 1


def test_a_method_whose_first_point_does_not_fit_into_the_budget_is_cut_off_before_it() -> None:
    scene, bare = scenes.load_scene("spring-uneven"), driver.bare
    slow, quick = engines.parse("ase:velocity-verlet"), engines.parse("own:velocity-verlet")

    def at_its_speed(scene: Scene, label: Label, **how: Any) -> driver.Bare:
        found = bare(scene, label, **how)
        runs = 100.0 if label == slow and scene.steps > 1 else found.timing.run
        return found._replace(timing=replace(found.timing, run=runs))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driver, "bare", at_its_speed)
        found = precision.record(scene, [slow, quick], budget=0.5)
    (point,) = found.of(str(slow))
    assert point.outcome == "cut off"
    # one for the errors and two to be timed
    assert point.message == "the budget of 0.5 s ends before it, which takes about 300 s"
    assert len(found.of(str(quick))) > 4


def test_a_budget_that_ends_is_said() -> None:
    scene = scenes.load_scene("spring-uneven")
    found = precision.record(scene, [engines.parse("own:semi-implicit-euler")], budget=0.5)
    last = found.points[-1]
    assert last.outcome == "cut off"
    assert "budget of 0.5 s" in last.message
    (method,) = found.methods
    assert method.floor is None


def test_an_interrupted_study_keeps_every_finished_point(tmp_path: Path) -> None:
    scene = scenes.load_scene("spring-uneven")
    told: list[str] = []

    def interrupt(seconds: float, budget: float, what: str) -> None:
        told.append(what)
        if len(told) == 12:
            raise KeyboardInterrupt

    path = tmp_path / "study.h5"
    labels = list(engines.match(("own:euler", "own:semi-implicit-euler", "own:implicit-euler")))
    with pytest.raises(KeyboardInterrupt):
        precision.record(scene, labels, path, budget=5.0, progress=interrupt)
    assert not path.exists()
    kept = [point for table in store.tables_of(path).values() for point in POINTS.found(table)]
    # three methods and one round of timings a level: 12 calls are three levels less one timing
    assert len(kept) == 6
    assert all(point.complete and point.run_seconds_repeats for point in kept)


def test_a_study_is_stored_and_read_back(tmp_path: Path) -> None:
    scene = scenes.load_scene("spring-uneven")
    labels = list(engines.match(("own:semi-implicit-euler", "sundials:bdf")))
    path = tmp_path / "study.h5"
    found = precision.record(scene, labels, path, budget=0.5)
    assert store.check(path) == []
    document = json.loads(store.document(path, "precision"))
    assert document == found.document()
    table = store.tables_of(path)["precision/own:semi-implicit-euler"]
    assert table.signal == "max_error"
    assert table.axes == ("run_seconds",)
    mine = found.of("own:semi-implicit-euler")
    assert table.columns["force_calls"][0] == mine[0].steps
    repeats = np.asarray(table.columns["run_seconds_repeats"])
    assert np.nanmin(repeats[0]) == mine[0].seconds
    with pytest.raises(StoreError, match="exists"):
        precision.record(scene, labels, path, budget=0.5)
    written = STUDY.draw(found, tmp_path)
    assert {file.suffix for file in written} == {".png", ".svg"}
    assert "own:semi-implicit-euler" in (tmp_path / "precision.svg").read_text()


def test_the_document_has_the_fields_that_it_promises() -> None:
    scene = scenes.load_scene("spring-uneven")
    found = precision.record(scene, [engines.parse("own:euler")], budget=0.5).document()
    point = found["points"][3]
    for name in ("step", "steps", "max_error", "end_error", "phase_error", "energy_error", "run_seconds",
                 "start_seconds", "read_seconds", "force_calls"):  # fmt: skip
        assert isinstance(point[name], int | float), name
    low, high = point["run_seconds_quartiles"]
    assert 0 < point["run_seconds"] <= low <= high
    assert point["tolerance"] is None
    assert point["outcome"] == "complete"
    assert {"order", "order_standard_error", "floor", "seconds_per_step"} <= set(found["methods"][0])
    assert [answer["error"] for answer in found["cheapest"]] == [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12]


def test_several_short_runs_in_one_timing_count_as_one() -> None:
    scene = scenes.load_scene("spring-uneven")
    label = engines.parse("own:semi-implicit-euler")
    for read in (False, True):
        found = driver.bare(replace(scene, steps=70), label, copies=5, read=read)
        assert found.force_calls == 70


def test_a_scene_in_a_bath_is_told_that_the_bath_is_in_the_way() -> None:
    with pytest.raises(SceneError, match=r"none of its errors is.*and no bath"):
        precision.record(scenes.load_scene("bath-spring"), [engines.parse("own:euler")])
    # and friction on a quartic potential, which without it is known, as are pendulums and Morse bonds
    scene = scenes.load_scene("anharmonic")
    braked = scene.derived(terms=(*scene.terms, Damping(i=np.array([0]), c=np.array([0.2]))))
    with pytest.raises(SceneError, match=r"or an anharmonic potential on each .* without friction"):
        precision.record(braked, [engines.parse("own:euler")])


def test_a_scene_at_rest_has_no_error_to_measure() -> None:
    scene = scenes.load_scene("spring")
    with pytest.raises(SceneError, match="rests in equilibrium"):
        precision.record(replace(scene, p=np.zeros(1)), [engines.parse("own:euler")])


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
def test_a_fit_finds_the_order_of_a_power_law(order: float) -> None:
    fit = fits.order(made_up([0.01 * 0.5 ** (order * i) for i in range(7)]))
    assert fit is not None
    assert fit.order == pytest.approx(order, rel=1e-12)
    assert fit.standard_error < 1e-12
    assert fit.constant == pytest.approx(0.01, rel=1e-12)


@pytest.mark.parametrize(("scene", "lowered"), [("driven-spring", 1), ("spring", 0)])
def test_an_order_that_friction_lowers_is_explained(scene: str, lowered: int) -> None:
    """Velocity Verlet has order 1 where forces depend on velocities, and RK4 order 4 anywhere."""
    methods = tuple(
        result.MethodSummary(
            method=label, points=tuple(made_up([0.01 * 0.5**i for i in range(7)])), duration=1.0,
            condition=None, first_start_seconds=None,
        ) for label in ("own:velocity-verlet", "own:rk4", "own:unheard-of")
    )  # fmt: skip
    study = result.PrecisionStudy(
        scene=scenes.load_scene(scene), budget=1.0, seconds=1.0, methods=methods, tick=1e-9,
        machine={"processor": "one"}, left_out=(), resumed=0,
    )  # fmt: skip
    said = [str(line) for line in study.lines() if "of order 1" in str(line)]
    assert len(said) == lowered
    assert all(line.startswith("  own:velocity-verlet: of order 1 where forces") for line in said)


@pytest.mark.parametrize(("order", "bend"), [(4, 3.0), (4, -0.6), (2, 0.5), (1, 1.0)])
def test_a_bend_that_is_left_stands_in_the_standard_error(order: int, bend: float) -> None:
    # the next term of an error: the slope falls from point to point, all on one side of the order
    steps = 0.5 ** np.arange(8 if order > 1 else 7)
    fit = fits.order(made_up([float(0.02 / (1 + bend) * h**order * (1 + bend * h)) for h in steps]))
    assert fit is not None
    assert abs(fit.order - order) < 2 * fit.standard_error < 0.3


def test_a_fit_leaves_out_what_is_coarse_and_what_is_rounding() -> None:
    errors = [3.0, 0.5, *(0.01 * 0.25**i for i in range(6))]
    plain = fits.order(made_up(errors))
    assert plain is not None
    assert plain.points == 6
    rounding = [1e-17] * 6 + [1e-6] * 2
    fit = fits.order(made_up([*errors[:6], 3e-6, 5e-6], rounding=rounding))
    assert fit is not None
    assert fit.points == 4
    assert fit.order == pytest.approx(2, rel=1e-12)


RATIOS = 24.0, 30.0, 31.0, 31.0, 29.0, 27.1, 24.9
"""Errors of RK4 on a pendulum near its top, each over the next: there the term of order 5 is the larger."""


def falling(first: float, *ratios: float) -> list[float]:
    return list(first / np.cumprod([1.0, *ratios]))


@pytest.mark.parametrize(("order", "slopes"), [(3, (2.957, 2.9635, 2.972)), (4, (3.862, 3.88, 3.91))])
def test_slopes_that_drift_slowly_and_do_not_slow_down_leave_the_order_open(
    order: int, slopes: tuple[float, ...]
) -> None:
    """As Ruth's third order and RK4 on pendulums: 2.964 +- 0.015 and 3.884 +- 0.048 by their range."""
    fit = fits.order(made_up(falling(1e-3, *2 ** np.array(slopes))))
    assert fit is not None
    assert abs(fit.order - order) <= 1.1 * fit.standard_error < 0.15


@pytest.mark.parametrize("ends", [1, 2, 3])
def test_points_at_an_unknown_floor_are_in_no_fit(ends: int) -> None:
    """As where a budget ends right after the floor: 3.0897 of order 4."""
    errors = falling(4.5e-3, 16.7, 16.2, 16.0, 16.1, 16.0, 16.0, 15.6, *(2.9, 1.1, 1.05)[:ends])
    fit = fits.order(made_up(errors))
    assert fit is not None
    assert abs(fit.order - 4) < fit.standard_error < 0.05
    # and points just above it by the growth of one rounding a step
    how = fits.Condition(name="sqrt(N)", why="", eps=4e-11, angle=1.0)
    found = fits.order(made_up(falling(4.5e-3, *[16.0] * 4, 13.0, 11.0)), how)
    assert found is not None
    assert (found.points, found.order) == (5, pytest.approx(4, abs=1e-9))


def test_no_order_is_claimed_where_the_slope_changes_ever_faster() -> None:
    assert fits.order(made_up(falling(5.4e-2, *RATIOS))) is None
    # as it slows down again the change so far is the error
    fit = fits.order(made_up(falling(5.4e-2, *RATIOS, 22.9, 21.0, 19.5, 18.3, 17.5)))
    assert fit is not None
    assert abs(fit.order - 4) < fit.standard_error * 2
    # one that tells no order from the next is none
    assert fits.order(made_up(falling(5.4e-2, *RATIOS, 20.0, 12.0))) is None
    # within what rounding does to an error that is a hundred times as large, it may
    fit = fits.order(made_up(falling(1e-3, 16.0, 16.0, 16.0, 16.3, 15.7)))
    assert fit is not None
    assert fit.order == pytest.approx(4, abs=0.02)


@pytest.mark.parametrize(
    ("order", "error", "said"),
    [(3.0897, 2.24, "3(2e+00)"), (4.7598, 0.13, "4.8(1e-01)"), (2.00004, 5e-6, "2.0000(5e-06)"),
     (1.0, 0.0, "1.0000(0e+00)"), (4.0015, 0.0013, "4.002(1e-03)")],
)  # fmt: skip
def test_an_order_has_the_digits_that_its_error_allows(order: float, error: float, said: str) -> None:
    assert result._order(fits.Fit(order=order, standard_error=error, constant=1.0, points=4)) == said


def test_no_order_is_claimed_from_three_points() -> None:
    assert fits.order(made_up([0.01, 0.005, 0.0025])) is None


def test_an_error_has_turned_only_when_a_finer_step_is_worse() -> None:
    assert fits.turned([1e-2, 1e-4, 1e-6]) is None
    assert fits.turned([1e-2, 1e-4, 1e-6, 2e-6]) == 2
    assert fits.turned([1e-2, 1e-4, 1e-6, 2e-6], by=2) is None
    # far from the asymptote an error may go up and down as it likes
    assert fits.turned([2.0, 1.5, 3.0]) is None
    assert fits.turned([]) is None


def test_no_point_of_the_front_is_beaten_and_every_other_is() -> None:
    generator = np.random.default_rng(7)
    points = made_up(
        list(generator.lognormal(size=60)), seconds=[float(x) for x in generator.lognormal(size=60)]
    )
    best = fits.front(points)

    def beaten(point: Point) -> bool:
        return any(
            other.error <= point.error
            and other.seconds <= point.seconds
            and (other.error, other.seconds) != (point.error, point.seconds)
            for other in points
        )

    assert [point for point in sorted(points, key=lambda p: p.seconds) if not beaten(point)] == best


def test_the_cheapest_way_is_the_fastest_that_is_good_enough() -> None:
    points = made_up([1e-1, 1e-3, 1e-5, 1e-5], seconds=[1.0, 5.0, 3.0, 2.0])
    assert fits.cheapest(points, 1e-1) is points[0]
    assert fits.cheapest(points, 1e-4) is points[3]
    assert fits.cheapest(points, 1e-6) is None


@pytest.mark.parametrize(
    ("name", "target", "least"), [("own:semi-implicit-euler", 1e-2, 998), ("openmm:verlet", 1e-4, 1886)]
)
def test_the_least_number_of_steps_between_two_points_is_the_one_that_a_search_finds(
    name: str, target: float, least: int, need: Callable[[str], None]
) -> None:
    label = engines.parse(name)
    need(name)
    scene = scenes.load_scene("spring")
    known = accuracy.truth(scene)

    def measured(steps: int) -> Point:
        one = replace(scene, step=known.duration / steps, steps=steps, every=1, quantities=("q", "p"))
        errors = accuracy.Errors(known, one.step, 1, scheme=SCHEMES[engines.method(label).scheme])
        run = driver.play(one, label, errors)
        return Point(
            method=name, step=one.step, tolerance=None, steps=steps, outcome="complete",
            accuracy=errors.result, force_calls=run.force_calls, run_seconds_repeats=(1e-8 * steps,),
        )  # fmt: skip

    coarse = 704 if target == 1e-2 else 1408
    found = fits.cheapest([measured(coarse), measured(2 * coarse)], target)
    assert found is not None
    assert (found.steps, found.force_calls) == (least, least)
    assert found.message == f"between {coarse} and {2 * coarse} steps"
    assert measured(least).error <= target < measured(least - 1).error


def test_a_scene_whose_coarsest_run_would_never_end_is_told(tmp_path: Path) -> None:
    scene = replace(scenes.load_scene("spring-uneven"), step=1e300)
    labels = [engines.parse("own:euler"), engines.parse("own:implicit-euler")]
    found = precision.record(scene, labels, tmp_path / "study.h5", budget=0.5)
    assert [point.outcome for point in found.points] == ["cannot run"] * 2
    assert all("its coarsest run takes" in point.message for point in found.points)
    assert "Left out own:euler, own:implicit-euler: its coarsest run takes" in " ".join(str(found).split())
