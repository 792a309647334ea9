"""Mathieu's equation by Hill's series in 40 digits, which takes no step, beside the exact solution."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

import springcheck
from springcheck import driver, engines, schemes
from springcheck.physics import exact, scenefile
from springcheck.physics.arrays import WIDE
from springcheck.physics.exact.mathieu import floquet
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Drive, ModulatedSpring, WallSpring, Weight
from springcheck.physics.trajectory import Outcome
from springcheck.studies.stability import longest, measure, multipliers, page

ORDERS = 60
"""Of Hill's series to both sides: the terms fall like (r/4 n**2)**n."""

W = float(np.sqrt(2.9 / 3.7))

POINTS = {
    "between two tongues": (2.9, 0.3, 1.55 * W),
    "below all that are wide": (2.9, 0.2, 0.41 * W),
    "an inverted spring that is held by its modulation": (-0.029, -40.0, 2.1 * W),
    "the first tongue": (2.9, 0.3, 2 * W),
    "its edge": (2.9, 0.3, 2.13 * W),
    "the second tongue": (2.9, 0.7, 0.95 * W),
}
GROWING = ("the first tongue", "its edge", "the second tongue")


def scene(name: str) -> Scene:
    """A modulated spring about a place that is not 0, from a start that lies in no symmetry."""
    k, depth, frequency = POINTS[name]
    term = ModulatedSpring(i=np.array([0]), k=k, depth=depth, frequency=frequency, phase=0.4, at=0.2)
    return Scene(m=[3.7], q=[0.3], p=[0.7], terms=(term,), step=0.37, steps=120, name=name)


class Hill:
    """y = exp(i nu x) sum c_n exp(2 i n x) solves y'' + (a - 2 r cos 2x) y = 0, and so does y(-x)."""

    def __init__(self, a: Any, r: Any) -> None:
        self.a, self.r = a, r
        # Whittaker & Watson 19.42: sin(pi nu/2)**2 = D(0) sin(pi sqrt(a)/2)**2 starts Newton's iteration
        n = 2.0 * np.arange(-ORDERS, ORDERS + 1)
        rows = float(r) / (n**2 - float(a))
        hill = np.eye(len(n)) - np.diag(rows[:-1], 1) - np.diag(rows[1:], -1)
        square = np.linalg.det(hill) * complex(mpmath.sin(mpmath.pi * mpmath.sqrt(a) / 2) ** 2).real
        start = 2 / mpmath.pi * mpmath.asin(mpmath.sqrt(mpmath.mpc(square)))
        self.nu = mpmath.findroot(self.closes, (start, start * (1 + mpmath.mpf("1e-8"))), tol=1e-60)
        c = {0: mpmath.mpc(1)}
        for sign in (1, -1):
            for n, ratio in enumerate(reversed(self.ratios(self.nu, sign)), 1):
                c[sign * n] = c[sign * (n - 1)] * ratio
        self.c = c

    def ratios(self, nu: Any, sign: int) -> list[Any]:
        """c_n/c_(n-1) from the outermost order in, by the continued fraction that falls there."""
        out = [mpmath.mpc(0)]
        for n in range(ORDERS, 0, -1):
            out.append(self.r / (self.a - (nu + 2 * sign * n) ** 2 - self.r * out[-1]))
        return out[1:]

    def closes(self, nu: Any) -> Any:
        """The equation of order 0, which the exponent solves."""
        return self.a - nu**2 - self.r * (self.ratios(nu, 1)[-1] + self.ratios(nu, -1)[-1])

    def at(self, x: Any) -> tuple[Any, Any]:
        """y and y' at x."""
        terms = [(c * mpmath.expj((self.nu + 2 * n) * x), 1j * (self.nu + 2 * n)) for n, c in self.c.items()]
        return mpmath.fsum(y for y, _ in terms), mpmath.fsum(y * slope for y, slope in terms)


def by_hill(found: Scene, steps: np.ndarray) -> tuple[list[Any], list[Any], Any]:
    """q and p after so many steps, and the exponent of the series."""
    term = found.terms[0]
    assert isinstance(term, ModulatedSpring)
    k, depth, drive, phase, at = (
        mpmath.mpf(float(x[0])) for x in (term.k, term.depth, term.frequency, term.phase, term.at)
    )
    m, h = mpmath.mpf(float(found.m[0])), mpmath.mpf(found.step)
    series = Hill(4 * k / m / drive**2, -2 * k / m * depth / drive**2)

    def both(t: Any) -> Any:
        x = (drive * t + phase) / 2
        (y, v), (z, w) = series.at(x), series.at(-x)
        return mpmath.matrix([[y, z], [v * drive / 2, -w * drive / 2]])

    start = mpmath.matrix([mpmath.mpf(float(found.q[0])) - at, mpmath.mpf(float(found.p[0])) / m])
    share = mpmath.lu_solve(both(mpmath.mpf(0)), start)
    ends = [both(int(n) * h) * share for n in steps]
    return [mpmath.re(x[0]) + at for x in ends], [mpmath.re(x[1]) * m for x in ends], series.nu


@pytest.mark.parametrize("name", POINTS)
def test_the_exact_solution_is_that_of_hills_series_within_what_it_states_at_every_frame(name: str) -> None:
    found = scene(name)
    steps = np.array([1, 2, 9, 31, 77, 120])
    q, p = exact.true_motion(found, steps, found.step)
    assert found.system.solution is not None
    size = float(np.max(np.abs([q, p])))
    with mpmath.workdps(40):
        right_q, right_p, _ = by_hill(found, steps)
        for i, n in enumerate(steps):
            doubts = found.system.solution.doubt(n * found.step)
            for one, right, doubt in zip((q[i, 0], p[i, 0]), (right_q[i], right_p[i]), doubts, strict=True):
                off = abs(mpmath.mpf(np.format_float_scientific(one, precision=25)) - right)
                assert off <= mpmath.mpf(float(doubt[0]))
                # beside the largest number of the motion
                assert float(off) <= (1e-16 if WIDE else 1e-13) * size
                assert float(doubt[0]) <= (1e-13 if WIDE else 1e-9) * size


@pytest.mark.parametrize("name", POINTS)
def test_the_floquet_multiplier_is_that_of_hills_exponent(name: str) -> None:
    found = scene(name)
    with mpmath.workdps(40):
        *_, nu = by_hill(found, np.array([1]))
        grown = float(abs(mpmath.exp(mpmath.pi * abs(mpmath.im(nu)))))
    multiplier = floquet(found.system)
    assert multiplier is not None
    assert multiplier[0] == pytest.approx(grown, rel=1e-13)
    assert np.cos(multiplier[2]) == pytest.approx(np.cos(float(mpmath.re(nu)) * np.pi), abs=1e-13)
    assert (grown > 1.01) == (name in GROWING)


@pytest.mark.parametrize("friction", [0.05, 2.2])
def test_a_damped_modulated_spring_decays_as_its_wronskian_and_a_step_that_grows_is_warned_of(
    friction: float,
) -> None:
    """By the series of the undamped one: with u = exp(-r t/2) y the stiffness of y is lower by m r**2/4."""
    m, (k, depth, turn), rate = 3.7, POINTS["between two tongues"], friction / 3.7
    level = k - m * rate**2 / 4
    found = scene("between two tongues")
    (term,) = found.terms
    alike = replace(term, k=np.array([level]), depth=np.array([k * depth / level]))
    damped = replace(found, terms=(*found.terms, Damping(i=[0], c=[friction])))
    with_friction, without = (floquet(x.system) for x in (damped, replace(found, terms=(alike,))))
    assert with_friction is not None
    assert without is not None
    assert with_friction[0] == pytest.approx(without[0] * np.exp(-np.pi * rate / turn), rel=1e-12)
    assert with_friction[2] == pytest.approx(without[2], abs=1e-12)
    # far beyond the limit of Verlet, and within it
    assert longest.resonating("velocity-verlet", replace(damped, step=2.9))
    assert longest.resonating("velocity-verlet", replace(damped, step=0.1)) is None
    study = springcheck.stability(damped, ["own:velocity-verlet", "own:rk4"])
    assert study.passed
    assert [x.method for x in study.multipliers] == ["own:rk4"] or len(study.multipliers) == 2
    assert "decays by a factor of" in str(study)


@pytest.mark.parametrize("name", ["mathieu-stable", "mathieu-tongue"])
def test_a_study_of_stability_has_the_multiplier_of_each_method_beside_that_of_its_scheme(name: str) -> None:
    found = springcheck.stability(
        scenefile.load_scene(name), ["own:euler", "own:velocity-verlet", "own:yoshida4"]
    )
    assert found.passed
    euler, verlet, fourth = found.multipliers
    exactly = floquet(found.scene.system)
    assert exactly is not None
    # explicit Euler grows where nothing else does, and a scheme of order 4 is as good as exact
    assert euler.grown > verlet.grown
    assert fourth.grown == pytest.approx(exactly[0], abs=2e-5)
    assert fourth.turned == pytest.approx(exactly[2], abs=2e-5)
    assert verlet.off <= verlet.bound <= 1e-11
    assert f"{euler.grown:.9f}" in str(found)
    wrong = replace(found, multipliers=(replace(verlet, off=2 * verlet.bound),))
    assert wrong.status == 1
    assert "Floquet multiplier off" in wrong.failures[0]


@pytest.mark.parametrize("size", [1e-9, -1e-9])
def test_a_modulation_that_is_a_little_too_deep_has_another_multiplier(size: float) -> None:
    """That of the engine: the law's own stays."""
    scene = scenefile.load_scene("mathieu-tongue")
    term = scene.terms[0]
    assert isinstance(term, ModulatedSpring)
    label = engines.parse("own:velocity-verlet")
    right = multipliers.measure(scene, label)
    deeper = multipliers.measure(replace(scene, terms=(replace(term, depth=term.depth * (1 + size)),)), label)
    assert abs(deeper.grown - right.grown_predicted) > right.bound


def test_scenes_without_a_modulation_have_no_multipliers() -> None:
    assert not multipliers.serves(scenefile.load_scene("driven-spring"), engines.parse("own:euler"))


@pytest.mark.campaign
@pytest.mark.parametrize("label", ["own:euler", "own:implicit-euler"])
def test_a_multiplier_beyond_doubles_is_left_out_with_its_reason(label: str, tmp_path: Path) -> None:
    """4096 steps of h w = 0.77 grow, or shrink, by more than doubles can hold."""
    term = ModulatedSpring(i=np.array([0]), k=1.0, depth=0.3, frequency=0.002, phase=0.4, at=0.0)
    slow = Scene(m=[1.0], q=[0.3], p=[0.7], terms=(term,), step=0.1, steps=10, name="slow")
    found = springcheck.stability(slow, [label], path=tmp_path / "slow.h5")
    assert found.status == 0
    assert found.multipliers == ()
    (left,) = found.left_out
    assert left.method == label
    assert "beyond what doubles can invert" in left.reason
    assert left.reason in " ".join(str(found).split())
    again = measure.stored(tmp_path / "slow.h5")
    assert (again.left_out, again.multipliers) == (found.left_out, ())


def test_an_engine_that_is_lost_fails_only_where_its_scheme_does_not_grow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As one in single precision is, 1e38 from where it began."""
    play = driver.run

    def lost(*given: Any) -> Any:
        return replace(play(*given), outcome=Outcome(status="diverged", step=0, message="not finite"))

    monkeypatch.setattr(driver, "run", lost)
    term = ModulatedSpring(i=np.array([0]), k=2.9, depth=0.3, frequency=0.004, phase=0.4, at=0.0)
    grows = replace(scenefile.load_scene("mathieu-stable"), terms=(term,))
    found = multipliers.measure(grows, engines.parse("own:euler"))
    assert "its run diverged as its scheme grows: not finite" in found.why
    stays = multipliers.measure(scenefile.load_scene("mathieu-stable"), engines.parse("own:velocity-verlet"))
    assert not stays.why
    assert not stays.off <= stays.bound


def test_a_place_of_rest_far_from_0_rounds_what_is_displaced_from_it() -> None:
    scene = scenefile.load_scene("mathieu-stable")
    term = scene.terms[0]
    assert isinstance(term, ModulatedSpring)
    label = engines.parse("own:velocity-verlet")
    near = multipliers.measure(scene, label)
    far = multipliers.measure(replace(scene, terms=(replace(term, at=np.array([1e6])),)), label)
    # where long double is no wider the scheme's own steps round alike
    assert far.off <= far.bound
    assert far.off > near.bound or not WIDE
    assert far.bound == pytest.approx(near.bound * (1 + 1e6), rel=1e-6)


def test_the_frequency_of_a_modulated_spring_is_that_of_its_stiffest_moment() -> None:
    scene = scenefile.load_scene("mathieu-tongue")
    # at the start cos(phase) = 0.92 of the modulation is there
    assert longest.fastest(scene) == pytest.approx(np.sqrt(2.9 * (1 + 0.3) / 3.7), rel=1e-12)


def by_hand(scene: Scene, steps: int) -> float:
    """Logarithm of the growth of velocity Verlet a step, from one start in doubles."""
    (spring,), h, m = scene.terms, scene.step, scene.m[0]
    assert isinstance(spring, ModulatedSpring)
    wave = np.cos(spring.frequency * h * np.arange(steps + 1) + spring.phase)
    k, total = (spring.k * (1 + spring.depth * wave)).tolist(), 0.0
    q, p = 0.3, 0.7
    for now, then in pairwise(k):
        p -= h / 2 * now * q
        q += h * p / m
        p -= h / 2 * then * q
        size = abs(q) + abs(p)
        q, p, total = q / size, p / size, total + np.log(size)
    return float(total / steps)


@pytest.mark.parametrize(
    ("step", "grows"),
    [(0.37, False), (1.74, False), (1.8, True), (-1.8, True), (1.95, True), (2.01, False), (2.04, True)],
)
def test_a_step_is_beyond_a_limit_where_the_product_of_its_maps_grows(step: float, grows: bool) -> None:
    """At its stiffest moment the scene has 2/w = 1.981, which is neither necessary nor sufficient."""
    scene = replace(scenefile.load_scene("mathieu-stable"), step=step)
    found, right = longest.resonating("velocity-verlet", scene), by_hand(scene, 20_000)
    assert (found is not None) == grows == (right > 1e-3)
    if found is not None:
        assert np.log(found) == pytest.approx(right, rel=0.02)


def test_of_several_modulated_springs_the_one_that_grows_tells() -> None:
    one = replace(scenefile.load_scene("mathieu-stable"), step=1.8)
    (spring,) = one.terms
    assert isinstance(spring, ModulatedSpring)
    names = ("k", "depth", "frequency", "phase", "at")
    pair = {x: np.repeat(getattr(spring, x), 2) for x in names} | {"k": np.append(0.3 * spring.k, spring.k)}
    two = one.derived(m=np.repeat(one.m, 2), q=np.repeat(one.q, 2), p=np.repeat(one.p, 2),
                      terms=(ModulatedSpring(i=np.arange(2), **pair),))  # fmt: skip
    for name in ("velocity-verlet", "semi-implicit-euler"):
        assert longest.resonating(name, two) == pytest.approx(longest.resonating(name, one), rel=1e-12)
    # explicit Euler has no stable step, and in a tongue the exact solution grows
    assert longest.resonating("explicit-euler", one) is None
    assert longest.resonating("velocity-verlet", scenefile.load_scene("mathieu-tongue")) is None


def test_implicit_midpoint_resonates_though_it_is_bounded_on_every_spring() -> None:
    """Two steps to a period, on springs of w = 1.66 and 2.04: angles of 2 atan(h w/2) that add up to pi."""
    term = ModulatedSpring(i=np.array([0]), k=7.9, depth=0.3, frequency=2.9, phase=0.4, at=0.15)
    scene = Scene(m=[2.3], q=[0.7], p=[1.4], terms=(term,), step=np.pi / 2.9, steps=10)
    h, maps = scene.step, []
    for t in (h / 2, 3 * h / 2):
        half = h / 2 * np.array([[0, 1 / 2.3], [-7.9 * (1 + 0.3 * np.cos(2.9 * t + 0.4)), 0]])
        maps.append(np.linalg.solve(np.eye(2) - half, np.eye(2) + half))
    largest = np.max(np.abs(np.linalg.eigvals(maps[1] @ maps[0])))
    assert largest > 1.05
    assert longest.resonating("implicit-midpoint", scene) == pytest.approx(np.sqrt(largest), rel=1e-3)
    assert np.isnan(longest.longest(schemes.scheme("implicit-midpoint"), scene))


@pytest.mark.parametrize(("step", "said"), [(1.8, True), (2.01, False)])
def test_a_run_is_warned_of_a_step_that_resonates_with_the_modulation(step: float, said: bool) -> None:
    scene = replace(scenefile.load_scene("mathieu-stable"), step=step, steps=30)
    text = str(springcheck.run(scene, methods=["own:velocity-verlet"]))
    warned = "makes velocity Verlet grow by a factor of 1.1927 a step, and the exact solution stays bounded"
    assert (warned in " ".join(text.split())) == said
    assert "beyond the limit" not in text


@pytest.mark.parametrize("name", ["mathieu-stable", "mathieu-tongue"])
def test_of_a_modulated_spring_no_largest_step_is_known_and_why_is_said(name: str) -> None:
    found = springcheck.stability(
        scenefile.load_scene(name), ["own:velocity-verlet", "own:implicit-midpoint"]
    )
    assert np.isnan([found.largest(x) for x in found.limits]).all()
    assert [x["largest_step"] for x in found.document()["methods"]] == [None, None]
    text = " ".join(str(found).split())
    assert "one may resonate with the modulation below its limit on a spring" in text
    assert "limit of every method" not in text
    # nor does a chart mark the scene beside limits
    (chart,) = page.banks(found)[0].charts
    assert "limit 2" in {rule.name for rule in chart.rules}
    assert not [rule for rule in chart.rules if rule.look == "here"]


@pytest.mark.parametrize("beside", ["nothing", "spring", "weight", "drive", "friction"])
def test_a_modulated_spring_beside_others_is_warned_of_as_well(beside: str) -> None:
    """Whatever moves a linear scene besides, differences of two motions obey its springs alone."""
    where, k, m = np.array([0]), 90.0 * (beside == "spring"), 3.7
    term = ModulatedSpring(i=where, k=400.0, depth=0.3, frequency=2.0, phase=0.0, at=0.7)
    more = {
        "spring": WallSpring(i=where, k=[k], at=[0.4]),
        "weight": Weight(i=where, force=[1.3], at=[0.0]),
        "drive": Drive(i=where, amplitude=[0.3], frequency=[1.1], phase=[0.2]),
        "friction": Damping(i=where, c=[1e-9]),
    }
    terms = (term, *([more[beside]] if beside in more else []))
    scene = Scene(m=[m], q=[0.1], p=[0.2], terms=terms, step=0.22, steps=10)
    product, grown = np.eye(2), 0.0
    for i in range(4096):
        first, last = (k + 400 * (1 + 0.3 * np.cos(2 * 0.22 * j)) for j in (i, i + 1))
        kicks = [np.array([[1, 0], [-0.11 * stiffness, 1]]) for stiffness in (first, last)]
        product = kicks[1] @ np.array([[1, 0.22 / m], [0, 1]]) @ kicks[0] @ product
        grown, product = grown + np.log(np.max(np.abs(product))), product / np.max(np.abs(product))
    assert longest.resonating("velocity-verlet", scene) == pytest.approx(np.exp(grown / 4096), rel=5e-3)
    short = replace(scene, step=0.01)
    assert longest.resonating("velocity-verlet", short) is None


def test_of_two_modulations_of_one_particle_nothing_is_said() -> None:
    term = ModulatedSpring(
        i=np.array([0, 0]), k=[400.0, 1.0], depth=[0.3, 0.2], frequency=[2.0, 3.0], phase=[0.0, 0.0],
        at=[0.0, 0.0],
    )  # fmt: skip
    scene = Scene(m=[3.7], q=[0.1], p=[0.2], terms=(term,), step=0.22, steps=10)
    assert longest.resonating("velocity-verlet", scene) is None
