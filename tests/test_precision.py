"""Errors obey the laws of the schemes, costs are those of a search, and nothing but seconds depends on the
clock."""

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
from springcheck.errors import SceneError, SpringcheckError, StoreError
from springcheck.physics import builders
from springcheck.physics import scenefile as scenes
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, WallSpring
from springcheck.schemes import SCHEMES, matrix
from springcheck.studies.precision import METRICS, STUDY, accuracy, bare, fits, longtime, result, sweeping
from springcheck.studies.precision import measure as precision
from springcheck.studies.precision.accuracy import Accuracy
from springcheck.studies.precision.points import POINTS, Point, Sweep
from springcheck.studies.stability import longest
from springcheck.text.lines import as_text

pytestmark = pytest.mark.usefixtures("steady_clock")

FIXED = [str(label) for label in engines.match(("*",)) if not engines.method(label).adaptive]
SINGLE = [name for name in scenes.names() if name in ("spring", "spring-uneven", "anharmonic")]


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
        run = driver.play(here, parsed, errors, planned=sweeping.PLANNED)
        assert run.outcome.status == "complete"
        points.append(Point(
            method=label, step=here.step, tolerance=None, steps=steps, outcome="complete",
            accuracy=errors.result, force_calls=run.force_calls, run_seconds_repeats=(1e-8 * steps,),
        ))  # fmt: skip
    return points


def order(errors: list[float], roundings: list[float] | None = None) -> fits.Fit | None:
    """The order of errors at steps 1, 1/2, 1/4 ..."""
    steps = [0.5**i for i in range(len(errors))]
    return fits.order(steps, errors, roundings or [None] * len(errors))


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
    points = measure(scene, label, [fewest * 2**i for i in range(4)])
    fit = Sweep(method=label, points=tuple(points), metric="largest").fit
    assert fit is not None
    assert abs(fit.order - scheme.order) < 0.02
    assert fit.standard_error < 0.01


def test_slopes_that_drift_evenly_claim_no_order_and_coarse_ones_do_not_hide_it() -> None:
    def halved(start: float, *slopes: float) -> list[float]:
        return [start * 0.5 ** sum(slopes[:j]) for j in range(len(slopes) + 1)]

    # RK4 on three pendulums that nearly reach the top: they fall towards 4, where nothing shows that they end
    assert order(halved(1e-3, 4.73, 4.598, 4.437, 4.279)) is None
    # halved in each step they end at 4, and the standard error reaches there
    found = order(halved(1e-4, 4.32, 4.16, 4.08))
    assert found is not None
    assert abs(found.order - 4) < found.standard_error
    # the blog's four: the coarsest four errors are those of a term of order 5
    found = order(halved(1.5e-3, 5.137, 4.427, 3.814, 3.839, 3.913, 3.973))
    assert found is not None
    assert abs(found.order - 4) < found.standard_error < 0.33


@pytest.mark.parametrize("power", [1.0, 2.0, 4.0])
def test_a_fit_finds_the_order_of_a_power_law(power: float) -> None:
    fit = order([0.01 * 0.5 ** (power * i) for i in range(7)])
    assert fit is not None
    assert fit.order == pytest.approx(power, rel=1e-12)
    assert fit.standard_error < 1e-12


@pytest.mark.parametrize(("power", "bend"), [(4, 3.0), (4, -0.6), (2, 0.5), (1, 1.0)])
def test_a_bend_that_is_left_stands_in_the_standard_error(power: int, bend: float) -> None:
    # the next term of an error: the slope falls from point to point, all on one side of the order
    steps = 0.5 ** np.arange(8 if power > 1 else 7)
    fit = order([float(0.02 / (1 + bend) * h**power * (1 + bend * h)) for h in steps])
    assert fit is not None
    assert abs(fit.order - power) < 2 * fit.standard_error < 0.3


def test_a_fit_leaves_out_what_is_coarse_and_what_is_rounding() -> None:
    errors = [3.0, 0.5, *(0.01 * 0.25**i for i in range(6))]
    plain = order(errors)
    assert plain is not None
    assert plain.points == 6
    fit = order([*errors[:6], 3e-6, 5e-6], [1e-17] * 6 + [1e-6] * 2)
    assert fit is not None
    assert fit.points == 4
    assert fit.order == pytest.approx(2, rel=1e-12)
    assert order(errors[2:5]) is None


@pytest.mark.parametrize("ends", [1, 2, 3])
def test_points_at_an_unknown_floor_are_in_no_fit(ends: int) -> None:
    """As where a budget ends right after the floor: 3.0897 of order 4."""
    falls = np.cumprod([1.0, 16.7, 16.2, 16.0, 16.1, 16.0, 16.0, 15.6, *(2.9, 1.1, 1.05)[:ends]])
    fit = order(list(4.5e-3 / falls))
    assert fit is not None
    assert abs(fit.order - 4) < fit.standard_error < 0.05


def test_no_order_is_claimed_where_the_slope_changes_ever_faster() -> None:
    # errors of RK4 on a pendulum near its top, each over the next: there the term of order 5 is the larger
    ratios = 24.0, 30.0, 31.0, 31.0, 29.0, 27.1, 24.9
    assert order(list(5.4e-2 / np.cumprod([1.0, *ratios]))) is None
    # as it slows down again the change so far is the error
    fit = order(list(5.4e-2 / np.cumprod([1.0, *ratios, 22.9, 21.0, 19.5, 18.3, 17.5])))
    assert fit is not None
    assert abs(fit.order - 4) < fit.standard_error * 2
    # one that tells no order from the next is none
    assert order(list(5.4e-2 / np.cumprod([1.0, *ratios, 20.0, 12.0]))) is None


def test_an_error_has_turned_only_when_a_finer_step_is_worse() -> None:
    assert fits.turned([1e-2, 1e-4, 1e-6]) is None
    assert fits.turned([1e-2, 1e-4, 1e-6, 2e-6]) == 2
    assert fits.turned([1e-2, 1e-4, 1e-6, 2e-6], by=2) is None
    # far from the asymptote an error may go up and down as it likes
    assert fits.turned([2.0, 1.5, 3.0]) is None
    assert fits.turned([]) is None


@pytest.mark.parametrize(
    ("value", "error", "said"),
    [(3.0897, 2.24, "3(2e+00)"), (4.7598, 0.13, "4.8(1e-01)"), (2.00004, 5e-6, "2.0000(5e-06)"),
     (1.0, 0.0, "1.0000(0e+00)"), (4.0015, 0.0013, "4.002(1e-03)")],
)  # fmt: skip
def test_an_order_has_the_digits_that_its_error_allows(value: float, error: float, said: str) -> None:
    assert result._order(fits.Fit(order=value, standard_error=error, points=4)) == said


def test_a_step_that_is_slightly_too_long_loses_the_order() -> None:
    # one part in 1e4 of the step is an error of phase that no smaller step removes
    scene = scenes.load_scene("spring-uneven")
    known = accuracy.truth(scene)
    errors, counts = [], (256, 512, 1024, 2048, 4096)
    for steps in counts:
        h = known.duration / steps
        sink = accuracy.Errors(known, h, 1, scheme=SCHEMES["semi-implicit-euler"])
        wrong = replace(scene, step=h * 1.0001, steps=steps, every=1, quantities=("q", "p"))
        driver.play(wrong, engines.parse("own:semi-implicit-euler"), sink)
        # against its own closed form the fault is plain, and ten million times the rounding
        assert sink.result.rounding_error is not None
        assert sink.result.rounding_error > 1e-4
        errors.append(sink.result.max_error)
    fit = fits.order([known.duration / n for n in counts], errors, [None] * 5)
    assert fit is None or abs(fit.order - 1) > 0.02 or fit.standard_error > 0.01


def test_the_floor_of_openmm_verlet_is_that_of_a_velocity_rebuilt_from_positions(
    need: Callable[[str], None],
) -> None:
    need("openmm:verlet")
    scene = scenes.load_scene("spring-uneven")
    points = measure(scene, "openmm:verlet", [2**i for i in range(13, 22)])
    found = Sweep(method="openmm:verlet", points=tuple(points), metric="largest")
    assert found.floor is not None
    assert found.fit is not None
    assert abs(found.fit.order - 2) < 0.02
    # eps x / h in each step, a random walk
    steps = points[found.errors.index(found.floor)].steps or 0
    angle = accuracy.truth(scene).angle
    assert 0.1 < found.floor / (2.0**-52 * steps**1.5 / angle) < 10


def test_the_phase_error_of_semi_implicit_euler_is_that_of_its_frequency() -> None:
    scene = scenes.load_scene("spring-uneven")
    known = accuracy.truth(scene)
    (point,) = measure(scene, "own:semi-implicit-euler", [23])
    w = np.sqrt(np.longdouble(2.9) / np.longdouble(3.7))
    h = known.duration / 23
    turned = 23 * (2 * np.arcsin(h * w / 2) - h * w)
    # the phase runs ahead steadily; the ellipse on which the scheme turns adds up to h w / 2 in between
    assert abs(point.error("phase") - float(turned)) <= float(h * w / 2) * 1.1


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


@pytest.mark.parametrize(("c", "steps", "count"), [(0.3, 200, 800), (1.1, 3000, 3000)])
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
    # the ellipses of the scheme differ from circles by an error of one step
    assert point.accuracy.phase_error == pytest.approx(ahead * lasts, rel=0.05)


@pytest.mark.parametrize("name", ["a damped pair", "an overdamped spring"])
def test_there_is_no_phase_where_springs_alone_have_no_say(name: str) -> None:
    """Friction couples their modes; what is overdamped does not turn."""
    pair = builders.chain(2, np.array([2.3, 0.9]), 3.1, q=np.array([0.3, 0.1]), step=0.1, steps=40)
    two = replace(pair, terms=(*pair.terms, Damping(i=np.arange(2), c=np.array([0.35, 1.9]))))
    scene = {"a damped pair": two, "an overdamped spring": damped(20.0, 40)}[name]
    (point,) = measure(scene, "own:rk4", [80])
    assert np.isnan(point.error("phase"))
    assert point.document()["phase_error"] is None
    # with one rate the modes stay, and so does their phase
    even = replace(two, terms=(*pair.terms, Damping(i=np.arange(2), c=0.2 * two.m)))
    (point,) = measure(even, "own:rk4", [80])
    assert point.error("phase") > 0


def test_the_energy_error_of_explicit_euler_is_its_growth() -> None:
    scene = scenes.load_scene("spring-uneven")
    (point,) = measure(scene, "own:euler", [1000])
    h = accuracy.truth(scene).duration / 1000
    assert point.error("energy") == pytest.approx((1 + h * h * 2.9 / 3.7) ** 1000 - 1, rel=1e-10)
    assert point.error("end") == point.error("largest")


@pytest.mark.parametrize("name", ["spring", "spring-uneven", "anharmonic", "chain"])
def test_every_point_ends_at_the_same_time(name: str) -> None:
    scene = scenes.load_scene(name)
    known = accuracy.truth(scene)
    assert known.w == longest.fastest(scene)
    for here, _ in zip(sweeping.by_step(scene, 2.0, known), range(25), strict=False):
        # one rounding of T/N, of the order of the spacing of doubles
        assert abs(here.steps * np.longdouble(here.step) - known.duration) <= 2.0**-53 * known.duration
        assert here.steps % here.every == 0
        assert here.frames <= max(accuracy.MOST_COMPARED_FRAMES + 1, sweeping.coarsest(known, 2.0) + 1)


def test_a_sweep_begins_just_below_the_limit_of_stability() -> None:
    known = accuracy.truth(scenes.load_scene("spring-uneven"))
    steps = sweeping.coarsest(known, 2.0)
    assert known.angle / steps < 2 <= known.angle / (steps - 1)
    for limit in (0.0, np.inf):
        assert 0.9 < known.angle / sweeping.coarsest(known, limit) <= 1


def test_without_names_one_own_method_of_every_order_and_kind_stands_beside_the_engines() -> None:
    scene = scenes.load_scene("spring")
    labels, _ = precision.methods(scene, ())
    names = list(map(str, labels))
    own = [SCHEMES[engines.method(x).scheme] for x in labels if x.engine == "own"]
    kinds = [(x.order, x.has("implicit"), x.symplectic) for x in own]
    assert len(set(kinds)) == len(kinds)
    assert {1, 2, 4} <= {x.order for x in own}
    for label in (
        "own:euler",
        "own:implicit-euler",
        "own:velocity-verlet",
        "own:implicit-midpoint",
        "own:rk4",
    ):
        assert label in names
    assert set(map(str, engines.match(scene.include))) - set(names) <= {
        str(x) for x in engines.match(scene.include) if engines.obstacle(scene, x)
    }
    assert list(map(str, precision.methods(scene, ["own:rk4"])[0])) == ["own:rk4"]


def test_a_run_that_diverges_and_a_method_that_cannot_run_are_points() -> None:
    scene = scenes.load_scene("spring-uneven").derived(steps=40_000)
    labels = [engines.parse(x) for x in ("own:euler", "openmm:verlet@CUDA-double")]
    found = precision.record(scene, labels, budget=2.0)
    worst = next(x for x in found.points if x.method == "own:euler")
    # h w = 1 grows by sqrt(2) a step, past the largest double after 2048 steps
    assert worst.outcome == "diverged"
    assert worst.accuracy is None
    assert "Left out openmm:verlet@CUDA-double" in str(found) or len(found.sweeps[1].complete)
    json.dumps(found.document(), allow_nan=False)


def test_a_dear_method_is_cut_off_and_leaves_its_seconds_to_others() -> None:
    scene, measured = scenes.load_scene("spring-uneven"), bare.measure
    slow, quick = engines.parse("ase:velocity-verlet"), engines.parse("own:velocity-verlet")

    def at_its_speed(scene: Scene, label: Label, **how: Any) -> bare.Bare:
        found = measured(scene, label, **how)
        runs = 100.0 if label == slow and scene.steps > 1 else found.timing.run
        return found._replace(timing=replace(found.timing, run=runs))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bare, "measure", at_its_speed)
        found = precision.record(scene, [slow, quick], budget=0.5)
    first, second = found.sweeps
    assert [x.outcome for x in first.points] == ["cut off"]
    assert len(second.complete) > 4
    assert second.points[-1].outcome == "cut off"
    assert second.floor is None
    assert "-: not measured, the budget of 0.5 s" in str(found)


def test_an_interrupted_study_keeps_every_finished_point(tmp_path: Path) -> None:
    scene = scenes.load_scene("spring-uneven")
    told: list[str] = []

    def interrupt(seconds: float, budget: float, what: str = "") -> None:
        told.append(what)
        if len(told) == 15:
            raise KeyboardInterrupt

    path = tmp_path / "study.h5"
    labels = list(engines.match(("own:euler", "own:semi-implicit-euler", "own:implicit-euler")))
    with pytest.raises(KeyboardInterrupt):
        precision.record(scene, labels, path, budget=5.0, progress=interrupt)
    found = precision.record(scene, labels, path, budget=0.5)
    # three methods are started, then of each level three errors and one round of timings are told
    assert found.resumed == 6
    assert all(point.run_seconds_repeats for point in found.points if point.complete)


def test_a_study_is_stored_read_back_and_drawn(tmp_path: Path) -> None:
    scene = scenes.load_scene("spring-uneven")
    labels = list(engines.match(("own:semi-implicit-euler", "own:rk4", "sundials:bdf")))
    path = tmp_path / "study.h5"
    found = precision.record(scene, labels, path, budget=0.5, metric="end")
    assert store.check(path) == []
    again = STUDY.stored(path)
    assert found.document() == again.document()
    assert as_text(again.lines(), 80) == as_text(found.lines(), 80)
    assert max(map(len, as_text(found.lines(), 80).splitlines())) <= 80
    table = store.tables_of(path)["precision/own:semi-implicit-euler"]
    assert (table.signal, table.axes) == ("max_error", ("run_seconds",))
    mine = POINTS.found(table)
    assert np.nanmin(np.asarray(table.columns["run_seconds_repeats"])[0]) == mine[0].seconds
    with pytest.raises(StoreError, match="exists"):
        precision.record(scene, labels, path, budget=0.5)
    STUDY.draw(found, tmp_path)
    assert (tmp_path / "precision.png").stat().st_size > 10_000
    assert all(len(bank.heading) <= 60 for bank in found.banks())


def test_every_metric_has_its_own_errors_orders_and_winners() -> None:
    points = measure(
        scenes.load_scene("spring-uneven"), "own:velocity-verlet", [200 * 2**i for i in range(5)]
    )
    sweeps = {x: Sweep(method="own:velocity-verlet", points=tuple(points), metric=x) for x in METRICS}
    for one in sweeps.values():
        assert one.fit is not None
        assert one.fit.order == pytest.approx(2, abs=0.02)
    # the energy error of Verlet is bounded, its phase error grows: Rein, Brown & Tamayo 2019
    assert sweeps["energy"].errors[0] < sweeps["end"].errors[0] <= sweeps["largest"].errors[0]


def test_scenes_without_a_known_solution_or_motion_are_refused() -> None:
    with pytest.raises(SceneError, match="error"):
        precision.record(scenes.load_scene("bath-spring"), [engines.parse("own:euler")])
    scene = scenes.load_scene("spring")
    with pytest.raises(SceneError, match="rests in equilibrium"):
        precision.record(replace(scene, p=np.zeros(1)), [engines.parse("own:euler")])


def test_costs_are_those_of_the_cheapest_point_that_is_good_enough_and_never_of_a_busy_machine() -> None:
    def points(errors: list[float], seconds: list[float]) -> Sweep:
        made = [
            Point(method="own:euler", step=0.5**i, tolerance=None, steps=2**i, outcome="complete",
                  accuracy=Accuracy(max_error=error), run_seconds_repeats=(seconds[i],), force_calls=2**i)
            for i, error in enumerate(errors)
        ]  # fmt: skip
        return Sweep(method="own:euler", points=tuple(made), metric="largest")

    found = points([1e-1, 1e-3, 1e-5, 1e-6], [1.0, 5.0, 3.0, 4.0])
    # the second was slow because the machine was busy: its finer neighbour takes 3
    assert found.costs("time") == [1.0, 3.0, 3.0, 4.0]
    assert found.cost("time", 1e-1) == 1.0
    assert found.cost("calls", 1e-5) == 4
    assert found.cost("time", 1e-9) == np.inf
    # between 2 and 4 steps, by the power law of both errors: 2 * 2**(2/2 of the way in the logarithm)
    assert found.cost("calls", 1e-4) == pytest.approx(np.ceil(2 * 2**0.5))


@pytest.mark.parametrize(
    ("name", "target", "least"), [("own:semi-implicit-euler", 1e-2, 998), ("openmm:verlet", 1e-4, 1886)]
)
def test_the_least_number_of_calls_between_two_points_is_the_one_that_a_search_finds(
    name: str, target: float, least: int, need: Callable[[str], None]
) -> None:
    need(name)
    scene = scenes.load_scene("spring")
    coarse = 704 if target == 1e-2 else 1408
    known, scheme = accuracy.truth(scene), SCHEMES[engines.method(engines.parse(name)).scheme]

    def measured(steps: int) -> Point:
        one = replace(scene, step=known.duration / steps, steps=steps, every=1, quantities=("q", "p"))
        errors = accuracy.Errors(known, one.step, 1, scheme=scheme)
        run = driver.play(one, engines.parse(name), errors)
        return Point(method=name, step=one.step, tolerance=None, steps=steps, outcome="complete",
                     accuracy=errors.result, force_calls=run.force_calls)  # fmt: skip

    both = Sweep(method=name, points=(measured(coarse), measured(2 * coarse)), metric="largest")
    assert both.cost("calls", target) == least
    assert measured(least).error("largest") <= target < measured(least - 1).error("largest")


def test_a_scene_whose_coarsest_run_would_never_end_is_told() -> None:
    scene = replace(scenes.load_scene("spring-uneven"), step=1e300)
    found = precision.record(
        scene, [engines.parse("own:euler"), engines.parse("own:implicit-euler")], budget=0.5
    )
    assert [point.outcome for point in found.points] == ["cannot run"] * 2
    assert "its coarsest run takes" in " ".join(str(found).split())


def test_an_order_that_friction_lowers_is_explained() -> None:
    """Velocity Verlet has order 1 where forces depend on velocities, and RK4 order 4 anywhere."""
    labels = [engines.parse("own:velocity-verlet"), engines.parse("own:rk4")]
    found = precision.record(damped(0.3, 50), labels, budget=0.2)
    assert "own:velocity-verlet: has order 1 here" in as_text(found.lines())


def test_over_long_times_rk4_loses_energy_by_its_law_and_falls_behind_verlet_where_theory_says() -> None:
    scene = scenes.load_scene("spring").derived(step=0.3)
    labels = [engines.parse(x) for x in ("own:velocity-verlet", "own:rk4", "own:forest-ruth")]
    found = longtime.record(scene, labels, periods=1e4, metric="energy")
    verlet, rk4, ruth = found.runs
    # |R|**2 = 1 - x**6/72 + x**8/576, over 100,000 steps a loss of 63 %
    factor = 1 - 0.3**6 / 72 + 0.3**8 / 576
    steps = np.round(rk4.periods * 2 * np.pi / 0.3 / longtime.FRAMES) * longtime.FRAMES
    np.testing.assert_allclose(rk4.error, 1 - factor**steps, rtol=1e-9)
    assert 1 - factor**100_000 == pytest.approx(0.6325, abs=1e-3)
    # Verlet's energy error is bounded: at a start at rest length (h w)**2/4 over 1 - (h w)**2/4
    assert verlet.error[-1] == pytest.approx(0.0225 / 0.9775, rel=1e-3)
    ((a, b, crossing),) = found.crossings
    assert (a.method, b.method) == ("own:rk4", "own:velocity-verlet")
    assert crossing == pytest.approx(np.log(1 - 0.0225 / 0.9775) / np.log(factor), rel=5e-3)
    assert crossing == pytest.approx(18 / 0.3**4, rel=0.06)
    # the law is a line, the measurement its marks
    for run in (verlet, rk4, ruth):
        law = np.interp(np.log(run.periods), np.log(run.law_steps * 0.3 / 2 / np.pi), np.log(run.law))
        np.testing.assert_allclose(np.log(run.error), law, atol=0.1)


def test_long_times_are_stored_drawn_and_refused_with_friction(tmp_path: Path) -> None:
    scene = scenes.load_scene("spring-uneven")
    labels = [engines.parse("own:rk4"), engines.parse("own:velocity-verlet")]
    found = longtime.record(scene, labels, tmp_path / "l.h5", periods=1e3, metric="end")
    again = STUDY.stored(tmp_path / "l.h5")
    assert as_text(again.lines()) == as_text(found.lines())
    assert STUDY.draw(again, tmp_path)[0].name == "precision-long.png"
    with pytest.raises(SceneError, match="oscillates for long"):
        longtime.record(damped(0.3, 50), labels)


def test_options_that_make_no_sense_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    from springcheck.cli import main

    for more in (["--budget", "-1"], ["--step", "0.1"], ["--long", "nan"]):
        assert main(["precision", "spring", *more]) == 2
        said = capsys.readouterr().err
        assert said.startswith("springcheck: --")
        assert said.count("\n") == 1
    assert issubclass(SceneError, SpringcheckError)
