"""One-step maps against their published matrices, with no value equal to one."""

from __future__ import annotations

import re
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import springcheck
from springcheck import schemes
from springcheck.errors import MethodError, SpringcheckError
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, WallSpring
from springcheck.schemes import SCHEMES, Scheme
from springcheck.schemes.lookup import TEXTBOOK

M, K, H = 3.7, 2.9, 0.31
A = H * H * K / M
ULP = 2.0**-52

MATRICES = {
    "explicit-euler": [[1, H / M], [-H * K, 1]],
    "semi-implicit-euler": [[1 - A, H / M], [-H * K, 1]],
    "semi-implicit-euler-drift-kick": [[1, H / M], [-H * K, 1 - A]],
    "velocity-verlet": [[1 - A / 2, H / M], [-H * K * (1 - A / 4), 1 - A / 2]],
    "position-verlet": [[1 - A / 2, H / M * (1 - A / 4)], [-H * K, 1 - A / 2]],
    "implicit-euler": [[1 / (1 + A), H / M / (1 + A)], [-H * K / (1 + A), 1 / (1 + A)]],
    "implicit-midpoint": [
        [(1 - A / 4) / (1 + A / 4), H / M / (1 + A / 4)],
        [-H * K / (1 + A / 4), (1 - A / 4) / (1 + A / 4)],
    ],
    "rk2-midpoint": [[1 - A / 2, H / M], [-H * K, 1 - A / 2]],
    "rk2-heun": [[1 - A / 2, H / M], [-H * K, 1 - A / 2]],
    "rk4": [
        [1 - A / 2 + A * A / 24, H / M * (1 - A / 6)],
        [-H * K * (1 - A / 6), 1 - A / 2 + A * A / 24],
    ],
}
MATRICES["trapezoidal"] = MATRICES["implicit-midpoint"]

ONE_STEP = [scheme for scheme in SCHEMES.values() if scheme.has("one-step")]


def one(scheme: Scheme, k: float = K, h: float = H) -> np.ndarray:
    return schemes.matrix(scheme, h=h, m=np.array([M]), k=np.array([k]))


@pytest.mark.parametrize("name", MATRICES)
def test_a_scheme_has_the_matrix_of_the_textbooks(name: str) -> None:
    expected = np.array(MATRICES[name])
    # the expectation itself is rounded a few times in double precision
    assert np.max(np.abs(one(SCHEMES[name])[0] - expected) / np.abs(expected)) <= 8 * ULP


def test_multiple_time_steps_have_friction_in_the_outer_kicks_as_their_steps_of_a_scene_do() -> None:
    """As `Law.step`, which takes the terms of the scene."""
    w, rate, part = 0.5, 0.3, 1 / 8
    kick = np.array([[1, 0], [-w * part / 2, 1]])
    drift = np.array([[1, w * part], [0, 1]])
    brake = np.diag([1, 1 - rate / 2])
    expected = brake @ np.linalg.matrix_power(kick @ drift @ kick, 8) @ brake
    found = schemes.matrix(SCHEMES["respa8"], h=1.0, m=np.ones(1), k=np.array([w * w]), c=rate)[0]
    np.testing.assert_allclose(found * [[1, w], [1 / w, 1]], expected, rtol=0, atol=8 * ULP)
    assert expected[0] == pytest.approx([0.87754353, 0.40777159], abs=1e-8)
    wall = WallSpring(i=[0], k=[w * w], at=[0.0], fast=True)
    scene = Scene(m=[1.0], q=[0.3], p=[0.7], terms=(wall, Damping(i=[0], c=[rate])), step=1.0, steps=1)
    states = np.eye(2, dtype=np.longdouble)[:, :, None]
    ends = schemes.Law(scheme=SCHEMES["respa8"], scene=scene, h=1.0).step(*states)
    np.testing.assert_allclose(found, np.array(ends)[:, :, 0], rtol=0, atol=8 * ULP)


@pytest.mark.parametrize("scheme", ONE_STEP, ids=lambda scheme: scheme.name)
def test_the_order_of_a_scheme_is_that_of_its_matrix_against_the_flow(scheme: Scheme) -> None:
    errors = []
    for h in (0.02, 0.01):
        w = mpmath.sqrt(mpmath.mpf(K) / mpmath.mpf(M))
        c, s = mpmath.cos(w * mpmath.mpf(h)), mpmath.sin(w * mpmath.mpf(h))
        flow = [[c, s / (M * w)], [-M * w * s, c]]
        found = one(scheme, h=h)[0]
        errors.append(max(abs(mpmath.mpf(str(found[i, j])) - flow[i][j]) for i in (0, 1) for j in (0, 1)))
    order = float(mpmath.log(errors[0] / errors[1], 2)) - 1
    # the next term of the local error shifts the slope by about h w / log 2
    assert abs(order - scheme.order) < 0.02


@pytest.mark.parametrize("scheme", ONE_STEP, ids=lambda scheme: scheme.name)
def test_the_limit_of_stability_is_where_powers_start_to_grow(scheme: Scheme) -> None:
    def radius(hw: float) -> float:
        found = one(scheme, k=(hw / H) ** 2 * M)[0].astype(float)
        return float(np.max(np.abs(np.linalg.eigvals(found))))

    if scheme.limit == 0:
        assert radius(0.05) > 1 + 1e-8
    elif np.isinf(scheme.limit):
        assert max(radius(x) for x in (0.1, 1.0, 10.0, 1000.0)) <= 1 + 1e-7
    else:
        # eigenvalues that meet on the circle are known to the root of eps only
        assert radius(scheme.limit * (1 - 1e-6)) <= 1 + 1e-7
        assert radius(scheme.limit * (1 + 1e-6)) > 1 + 1e-7


@pytest.mark.parametrize("scheme", ONE_STEP, ids=lambda scheme: scheme.name)
def test_the_shadow_energy_is_multiplied_by_the_determinant(scheme: Scheme) -> None:
    found = one(scheme)
    form = schemes.invariant(found, h=H)[0]
    z = np.array([0.3, 0.7], dtype=np.longdouble)

    def energy(z: np.ndarray) -> np.longdouble:
        return np.longdouble(form[0] * z[0] ** 2 + form[1] * z[0] * z[1] + form[2] * z[1] ** 2)

    expected = schemes.rotation(found).determinant[0] * energy(z)
    assert abs(energy(found[0] @ z) - expected) <= 16 * np.finfo(np.longdouble).eps * abs(expected)


@pytest.mark.parametrize("scheme", ONE_STEP, ids=lambda scheme: scheme.name)
@pytest.mark.parametrize("k", [K, -K, 0.0, 3.9 * M / H**2, 5.0 * M / H**2])
def test_the_closed_form_is_what_stepping_gives(scheme: Scheme, k: float) -> None:
    found = one(scheme, k=k)
    if np.any(schemes.rotation(found).determinant <= 0):
        pytest.skip("a step that turns area over has no closed form")
    z = np.array([0.3, 0.7], dtype=np.longdouble)
    walked = [z]
    for _ in range(50):
        walked.append(found[0] @ walked[-1])
    y, v = schemes.propagate(found, z[:1], z[1:], np.arange(51), area_preserving=scheme.has("symplectic"))
    states = np.stack([y[:, 0], v[:, 0]], axis=1)
    size = np.maximum.accumulate(np.max(np.abs(walked), axis=1))
    # 50 steps of extended arithmetic, enlarged by the condition of a map near its limit
    assert np.max(np.max(np.abs(states - walked), axis=1) / size) <= 1e5 * np.finfo(np.longdouble).eps


@pytest.mark.parametrize("below", [1e-6, 1e-13, 2e-16])
def test_the_closed_form_just_below_the_limit_of_stability(below: float) -> None:
    found = one(SCHEMES["velocity-verlet"], k=4 * M / H**2 * (1 - below))
    z = np.array([0.3, 0.7], dtype=np.longdouble)
    walked = [z]
    for _ in range(50):
        walked.append(found[0] @ walked[-1])
    steps = np.arange(1, 51)
    y, v = schemes.propagate(found, z[:1], z[1:], steps, area_preserving=True)
    off = np.max(np.abs(np.stack([y[:, 0], v[:, 0]], axis=1) - walked[1:]), axis=1)
    # what a product of so many such maps is off by; pi - angle had lost 1/(pi - angle) digits: 1e5 of these
    assert np.all(off <= 4 * np.finfo(np.longdouble).eps * steps**2 * np.max(np.abs(walked)))


def test_fractions_are_rounded_once() -> None:
    third = schemes.number(Fraction(1, 3), np.longdouble)
    assert third == np.longdouble(1) / np.longdouble(3)
    assert schemes.number(Fraction(7, 24), np.float64) == 7 / 24


@pytest.mark.parametrize("name", [name for names in TEXTBOOK for name in names])
def test_a_textbook_s_name_is_answered_with_the_schemes_that_it_means(name: str) -> None:
    called = next(found for names, found in TEXTBOOK.items() if name in names)
    assert set(called) <= set(SCHEMES)
    assert name not in schemes.known()
    with pytest.raises(MethodError, match=f", did you mean {' or '.join(called)}[?]$"):
        schemes.scheme(name)


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("Symplectic_Euler", "semi-implicit-euler or semi-implicit-euler-drift-kick"),
        ("St\xf6rmer-Verlet", "velocity-verlet or position-verlet"),
        ("newmark", "trapezoidal"),
        ("velocity-verlt", "velocity-verlet"),
        ("heun", "rk2-heun"),
    ],
)
def test_a_scheme_is_found_however_it_is_spelled(name: str, found: str) -> None:
    said = f", did you mean {found}?"
    assert schemes.meant(name) == said
    with pytest.raises(MethodError, match=re.escape(said)):
        schemes.scheme(name)
    if schemes.textbook(name):
        shown = str(springcheck.explain(name))
        assert all(f"{one}: " in shown for one in found.split(" or "))
        return
    with pytest.raises(SpringcheckError, match=re.escape(said)):
        springcheck.explain(name)


def test_irrational_coefficients_are_those_of_the_cube_root_of_two() -> None:
    with mpmath.workdps(40):
        x1 = 1 / (2 - mpmath.cbrt(2))
        expected = [x1 / 2, x1, (1 - x1) / 2, 1 - 2 * x1]
        for name in ("forest-ruth", "yoshida4"):
            for (_, c), value in zip(SCHEMES[name].stages, expected, strict=False):
                assert abs(mpmath.mpf(str(c)) - value) < mpmath.mpf(10) ** -36


@pytest.mark.parametrize("scheme", ONE_STEP, ids=lambda s: s.name)
def test_a_force_gets_as_far_within_a_step_as_the_matrix_says(scheme: Scheme) -> None:
    none, one, two = (schemes.matrix(scheme, h=H, m=np.array([M]), k=x * K)[0] for x in range(3))
    moves = np.any(np.abs(one[0] - none[0]) > ULP)
    # what a later force makes of an earlier one goes with the square of the stiffness
    felt = np.any(np.abs(two[1] - 2 * one[1] + none[1]) > 8 * ULP)
    assert scheme.reach == (2 if felt else int(moves))


def test_the_closed_form_of_an_overdamped_motion_goes_on_for_ever() -> None:
    """Friction's decay and the growth of the roots apart are 0 times infinity: together the slow root."""
    k, c, h, far = 2.9, 40.0, 0.05, 10**7
    matrices = schemes.matrix(schemes.scheme("implicit-euler"), h=h, m=np.ones(1), k=np.array([k]), c=c)
    steps = np.array([1, 1000, far])
    y, v = schemes.propagate(matrices, np.ones(1), np.zeros(1), steps, area_preserving=False)
    # 1/(1 + h s) of the two roots s**2 - c s + k = 0
    slow, fast = (c - np.sqrt(c * c - 4 * k)) / 2, (c + np.sqrt(c * c - 4 * k)) / 2
    slow = k / fast
    expected = (
        fast * (1 + h * slow) ** -steps.astype(float) - slow * (1 + h * fast) ** -steps.astype(float)
    ) / (fast - slow)
    assert y[:, 0].astype(float) == pytest.approx(expected, rel=1e-10, abs=0)
    assert np.all(np.isfinite(v))


@pytest.mark.parametrize(
    ("k", "c", "h"),
    [(1.3, 3e4, 1.0), (2.9, 2e3, 0.31), (3.0, 500.0, 10.0), (-3.0, 0.7, 2.0), (2.9, 0.7, -0.3)],
)
def test_the_exact_flow_is_right_to_its_last_digits_however_strong_the_friction(
    k: float, c: float, h: float
) -> None:
    m = 1.7
    with mpmath.workdps(60):
        b = mpmath.mpf(c) / m / 2
        s = mpmath.sqrt(mpmath.mpc(b * b - mpmath.mpf(k) / m))
        up, down = mpmath.exp((s - b) * mpmath.mpf(h)), mpmath.exp((-s - b) * mpmath.mpf(h))
        even, odd = ((up + down) / 2).real, ((up - down) / (2 * s)).real
        expected = even + b * odd, odd / m, -k * odd, even - b * odd
        found = schemes.matrix(SCHEMES["exact"], h=h, m=np.array([m]), k=np.array([k]), c=c)[0]
        off = [
            float(abs((mpmath.mpf(np.format_float_scientific(x, 30)) - y) / y))
            for x, y in zip(found.flat, expected, strict=True)
        ]
    assert max(off) < 32 * np.finfo(np.longdouble).eps


@pytest.mark.parametrize("name", [x for x, one in schemes.SCHEMES.items() if one.has("one-step")])
@pytest.mark.parametrize("c", [0.0, 0.4])
def test_with_friction_kicks_of_its_force_are_of_first_order(name: str, c: float) -> None:
    """The error of the map of a unit of time, at two steps."""
    scheme, one = schemes.SCHEMES[name], np.ones(1)
    exact = mpmath.expm(mpmath.matrix([[0, 1], [-1, -c]]))
    off = []
    for steps in (32, 64):
        step = schemes.matrix(scheme, h=1 / steps, m=one, k=one, c=c * one)[0]
        whole = mpmath.matrix(np.linalg.matrix_power(step, steps).tolist())
        off.append(float(mpmath.mnorm(whole - exact)))
    assert np.log2(off[0] / off[1]) == pytest.approx(scheme.braked_order if c else scheme.order, abs=0.2)
