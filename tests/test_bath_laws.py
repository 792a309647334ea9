"""Thermostats on a spring: each law from its stages, held against closed forms and matrices by hand.

a = (h w)**2, x = gamma h, c = exp(-x), s = sqrt(c); covariances in units of kT/k, m kT and sqrt(m/k) kT.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from springcheck.bath import THERMOSTATS, Law, Stepper
from springcheck.bath.decays import GJ

LINEAR = [name for name, one in THERMOSTATS.items() if not one.rescales]

NO_TABLE = ("vanden-eijnden-ciccotti",)
"""That without covariances in the literature: their recurrences are held against their papers'."""

SPRINGS = [(0.35, 3.7, 2.9, 0.8, 1.7), (0.11, 0.4, 31.0, 2.3, 0.02), (1.3, 5.0, 2.0, 0.05, 40.0)]
"""h, m, k, gamma, kT: none of them 1, which hides what is missing."""


def law(name: str, h: float, m: float, k: float, rate: float, thermal: float) -> Law:
    one, all_k = np.array([m]), np.array([k])
    return Law(
        scheme=THERMOSTATS[name], h=h, m=one, k=all_k, rate=rate, thermal=thermal
    )  # fmt: skip


def _table(name: str, a: float, x: float) -> tuple[float, float, float | None]:
    """<x**2>, <v**2> and <x v> as the literature has them, or as computer algebra gave them."""
    c, s = math.exp(-x), math.exp(-x / 2)
    e = 1 - math.exp(-x)
    root = math.sqrt(a)
    g = x / root
    if name.startswith("gj-"):
        number = name.split("-")[1]
        c2 = float(THERMOSTATS[f"gj-{number}"].acts[2].part(np.float64(x)))
        q2 = 2 * (1 - c2) / ((1 + c2) * x)
        return (1, 1, None) if name.endswith("half") else (1, 1 - q2 * a / 4, 0)
    return {
        "baoab": (1, 1 - a / 4, 0),
        "baoa": (1, 1, root / 2),
        "aboba": (1, 1 / (1 - a / 4), 0),
        "obabo": (1 / (1 - a / 4), 1, 0),
        "oabao": (1 - a / 4, 1, 0),
        "aoboa": ((1 + c) / (2 * s), 2 * (1 + c) / (2 * (1 + c) - a * s), 0),
        "boaob": ((1 + c) ** 2 / (s * (2 * (1 + c) - a * s)), None, None),
        "bbk": (1 / (1 - a / 4), 1 / (1 + x / 2), 0),
        "lammps-langevin": ((1 - x / 2) / (1 - x / 2 - a / 4), 1, 0),
        "euler-maruyama": (2 * g * (2 + a - x) / ((g - root) * (4 + a - 2 * x)), None, None),
        "brownian": (1 / (1 - a / x / 2), None, None),
        "andersen": (1 / (1 - a / 4), 1, 0),
        "andersen-after-kick": ((1 - e / 2) / ((1 - e) * (1 - a / 2)), None, None),
        "andersen-after": (1 / (1 - a / 4), 1, 0),
        "andersen-leapfrog": ((1 - e / 2) / (1 - a / 2), 1 / (1 - a / 2), None),
    }.get(name, (None, None, None))  # type: ignore[return-value]


@pytest.mark.parametrize("name", [name for name in LINEAR if name not in NO_TABLE])
def test_covariances_are_those_of_the_table(name: str) -> None:
    told = []
    for spring in SPRINGS:
        h, m, k, rate, thermal = spring
        found, x = law(name, *spring), h * rate
        expected = _table(name, h * h * k / m, x)
        cross = found.covariance[0, 0, 1] / thermal * math.sqrt(k / m)
        pairs = zip((found.configurational[0], found.kinetic[0], cross), expected, strict=True)
        # what is not above 0 is of a step that is not stable
        told += [x for x in pairs if x[1] is not None and (x[1] > 0 or x[1] is expected[2])]
    assert told
    for value, known in told:
        assert value == pytest.approx(known, rel=1e-11, abs=1e-11), name


def by_hand(
    name: str, h: float, m: float, k: float, rate: float, thermal: float
) -> tuple[mp.matrix, mp.matrix]:
    """A and G of one step on (x, v, last draw), from the recurrences as their papers print them."""
    H, g = mp.mpf(h), mp.mpf(rate)
    M, K, T = mp.mpf(m), mp.mpf(k), mp.mpf(thermal)
    unit = [mp.matrix([[int(i == j) for j in range(7)]]) for i in range(7)]
    x, v, old, *draws = unit
    one, two = draws[:2]
    sigma = mp.sqrt(2 * T * g / M)
    F = -K / M
    if name == "bbk":
        R = mp.sqrt(2 * g * T / (M * H))
        half = v + H / 2 * (F * x - g * v + R * old)
        x1 = x + H * half
        v1 = (half + H / 2 * (F * x1 + R * one)) / (1 + g * H / 2)
        rows = [x1, v1, one]
    elif name == "lammps-langevin":
        # v half a step back, from the force with friction that led to v
        R = mp.sqrt(2 * g * T / (M * H))
        before = (v - H / 2 * (F * x + R * old)) / (1 - g * H / 2)
        half = v + H / 2 * (F * x - g * before + R * old)
        x1 = x + H * half
        v1 = half + H / 2 * (F * x1 - g * half + R * one)
        rows = [x1, v1, one]
    elif name == "vanden-eijnden-ciccotti":
        C = H**2 / 2 * (F * x - g * v) + sigma * H ** mp.mpf("1.5") * (one / 2 + two / (2 * mp.sqrt(3)))
        c1, c2 = H / 2 - H * H * g / 8, H * g / 2 - H * H * g * g / 8
        c5 = H ** mp.mpf("1.5") * sigma / (2 * mp.sqrt(3))
        noise = (mp.sqrt(H) * sigma / 2 - H ** mp.mpf("1.5") * g * sigma / 8) * one - g / 2 * c5 * two
        half = v + c1 * F * x - c2 * v + noise
        x1 = x + H * half + c5 * two
        # the x of eq. 23 to the order of its own truncation
        assert mp.norm((x1 - x - H * v - C)[:2], 2) < 10 * H**3 * (1 + abs(F)) * (1 + g) ** 2
        v1 = half + c1 * F * x1 - c2 * half + noise
        rows = [x1, v1, 0 * x]
    elif name == "euler-maruyama":
        rows = [x + H * v, v + H * (F * x - g * v) + sigma * mp.sqrt(H) * one, 0 * x]
    else:
        s = mp.exp(-g * H / 2)
        u = v + H / 2 * F * x
        u = s * u + mp.sqrt((1 - s * s) * T / M) * one
        x1 = x + H * u
        u = s * u + mp.sqrt((1 - s * s) * T / M) * two
        rows = [x1, u + H / 2 * F * x1, 0 * x]
    A, G = mp.zeros(3), mp.zeros(3, 4)
    for i, row in enumerate(rows):
        for j in range(3):
            A[i, j] = row[j]
        for j in range(4):
            G[i, j] = row[3 + j]
    return A, G


@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize(
    "name",
    ["bbk", "lammps-langevin", "vanden-eijnden-ciccotti", "euler-maruyama", "boaob"],
)
def test_laws_agree_with_the_recurrences_of_the_papers(name: str, spring: tuple[float, ...]) -> None:
    mp.mp.dps = 40
    m, thermal = spring[1], spring[4]
    A, G = by_hand(name, *spring)
    found = law(name, *spring)
    scale = np.array([1, m])
    of_A = np.array([[float(A[i, j]) for j in range(2)] for i in range(2)]) * scale[:, None] / scale[None, :]
    assert found.A[0].astype(float) == pytest.approx(of_A, rel=1e-14, abs=1e-16)
    d = 3
    lhs, rhs = mp.zeros(d * d), mp.zeros(d * d, 1)
    GG = G * G.T
    for i in range(d):
        for j in range(d):
            rhs[i * d + j] = GG[i, j]
            for a in range(d):
                for b in range(d):
                    lhs[i * d + j, a * d + b] = int((i, j) == (a, b)) - A[i, a] * A[j, b]
    S = mp.lu_solve(lhs, rhs)
    if float(S[0]) < 0:
        assert np.all(np.isinf(found.covariance))
        return
    assert found.covariance[0, 0, 0] == pytest.approx(float(S[0]), rel=1e-11)
    assert found.covariance[0, 1, 1] == pytest.approx(float(S[4]) * m * m, rel=1e-11)
    assert found.covariance[0, 0, 1] == pytest.approx(float(S[1]) * m, rel=1e-11, abs=1e-12 * thermal)


@pytest.mark.parametrize("name", LINEAR)
def test_diffusion_is_that_of_the_table(name: str) -> None:
    h, m, _, rate, thermal = SPRINGS[0]
    x = rate * h
    c, s = math.exp(-x), math.exp(-x / 2)
    found = law(name, h, m, 1.0, rate, thermal).diffusion[0]
    if name in {"baoab", "baoa", "aboba", "obabo", "oabao"} or name.startswith("andersen"):
        assert found == pytest.approx(x / 2 / math.tanh(x / 2), rel=1e-12)
    elif name in {"aoboa", "boaob"}:
        # one kick of the bath between two flights, or flights with the half decayed velocity
        assert found == pytest.approx(
            x * s / (1 - c) if name == "boaob" else x * (1 + c) / (1 - c) / 2, rel=1e-1
        )
        assert found == pytest.approx(1 + x * x / 12, abs=x**3)
    elif name == "vanden-eijnden-ciccotti":
        assert found == pytest.approx(1, abs=x**4)
    else:
        assert found == pytest.approx(1, rel=1e-12)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["baoab", "aboba", "gj-i", "lammps-langevin", "bbk", "andersen-after-kick"])
def test_laws_are_what_long_runs_of_the_scheme_itself_show(name: str) -> None:
    """Ten thousand springs side by side, 200 steps after 400: each number within five standard errors."""
    h, m, k, rate, thermal = SPRINGS[0]
    found, scheme = law(name, h, m, k, rate, thermal), THERMOSTATS[name]
    stepper = Stepper(scheme, h=h, m=np.full(10_000, m), rate=rate, thermal=thermal, width=np.float64)
    n, rng = 10_000, np.random.default_rng(20)
    q, p = rng.standard_normal((2, n))
    carried = [rng.standard_normal(n) for _ in range(scheme.carried)]
    frames = []
    for i in range(600):
        draws = [*carried, *rng.standard_normal((scheme.fresh, n))]
        hit = rng.random(n) < found.collision
        q, p = stepper(q, p, lambda q, p: -k * q, draws, hit)
        carried = draws[len(draws) - scheme.carried :]
        if i >= 400:
            frames.append((q, p))
    q, p = np.array(frames).transpose(1, 0, 2)
    error = found.error_of_variances(len(frames))[0] / math.sqrt(n)
    assert np.mean(q * q) / found.covariance[0, 0, 0] == pytest.approx(1, abs=5 * error[0])
    assert np.mean(p * p) / found.covariance[0, 1, 1] == pytest.approx(1, abs=5 * error[1])
    later = found.apart([7])[0][0] @ found.covariance[0]
    lagged = (np.mean(q[7:] * q[:-7]) - later[0, 0]) / found.covariance[0, 0, 0]
    assert lagged == pytest.approx(0, abs=5 * error[0])


def test_the_error_of_a_variance_is_that_of_the_squares_of_all_pairs_of_frames() -> None:
    """Of a Gaussian motion <x_i**2 x_j**2> is C(0)**2 + 2 C(i - j)**2."""
    found, frames = law("baoab", *SPRINGS[0]), 30
    A, S = (x[0].astype(np.float64) for x in (found.A, found.covariance))
    C = np.array([np.diagonal(np.linalg.matrix_power(A, 5 * j) @ S) for j in range(frames)])
    apart = np.abs(np.subtract.outer(range(frames), range(frames)))
    expected = np.sqrt(2 * np.mean((C / C[0])[apart] ** 2, axis=(0, 1)))
    assert found.error_of_variances(frames, 5)[0] == pytest.approx(expected, rel=1e-12)


def test_the_error_of_a_variance_over_ten_million_frames_takes_no_sum_of_them() -> None:
    x, frames = 1e-6, 10**7
    found = law("obabo", 0.2, 1.0, 1.0, x / 0.2, 1.0)
    started = time.process_time()
    errors = found.error_of_variances(frames)[0]
    assert time.process_time() - started < 1
    # C(j) / C(0) is exp(-x j/2) cos(w j) but for x/w: squares of the cosine are 1/2 in the mean
    expected = math.sqrt(2 / frames * (1 / x - (1 - math.exp(-x * frames)) / (x * x * frames)))
    assert errors == pytest.approx([expected] * 2, rel=1e-3)
    # next to the limit nothing is known, and that is said at once
    assert np.all(np.isnan(law("baoab", 1.0, 1.0, 4 - 1e-15, 1e-15, 1.0).error_of_variances(frames)))


@pytest.mark.parametrize("name", ["andersen", "andersen-after-kick", "andersen-after", "andersen-leapfrog"])
@pytest.mark.parametrize("rate", [0.2, 1.5])
def test_the_error_of_a_variance_is_that_of_many_runs_with_collisions(name: str, rate: float) -> None:
    """A collision makes squares forget by 1 - p, not by its square, and the motion no Gaussian one.

    The spread of 20,000 means is known to sqrt((kurtosis - 1)/4 n) of itself, at most 1.5 % here.
    """
    h, m, k, thermal = SPRINGS[0][0] * 2, 3.7, 2.9, 1.7
    found, n, rng = law(name, h, m, k, rate, thermal), 20_000, np.random.default_rng(21)
    stepper = Stepper(
        THERMOSTATS[name], h=h, m=np.full(n, m), rate=rate, thermal=thermal, width=np.float64
    )  # fmt: skip
    z = np.linalg.cholesky(found.covariance[0]) @ rng.standard_normal((2, n))
    before, frames, sums = 200, 60, np.zeros((2, n))
    for i in range(before + 2 * frames):
        hit = rng.random(n) < found.collision
        z = np.stack(stepper(*z, lambda q, p: -k * q, [rng.standard_normal(n)], hit))
        if i >= before and i % 2:
            sums += z**2
    off = sums / frames / np.diagonal(found.covariance[0])[:, None] - 1
    kurtosis = np.mean(off**4, axis=1) / np.mean(off**2, axis=1) ** 2
    assert np.max(np.sqrt((kurtosis - 1) / (4 * n))) < 0.015
    assert found.error_of_variances(frames, 2)[0] == pytest.approx(np.std(off, axis=1), rel=5 * 0.015)


def test_squares_of_sums_of_uniform_draws_vary_less_than_those_of_normal_ones() -> None:
    """Of z = sum c_j xi_j with uniform xi of variance 1, var z**2 is 2 (sum c_j**2)**2 - 6/5 sum c_j**4."""
    h, m, k, rate, thermal = SPRINGS[0]
    stepper = Stepper(
        THERMOSTATS["lammps-langevin"], h=h, m=np.array([m]), rate=rate, thermal=thermal, width=np.float64
    )  # fmt: skip
    z, made = np.zeros((2, 1)), []
    for j in range(400):
        draws = [np.ones(1) * (j == 1), np.ones(1) * (j == 0)]
        made.append(z := np.stack(stepper(*z, lambda q, p: -k * q, draws)))
    two, four = (np.sum(np.array(made)[..., 0] ** i, axis=0) for i in (2, 4))
    error = law("lammps-langevin", *SPRINGS[0]).error_of_variances(1)[0]
    assert error == pytest.approx(np.sqrt(2 - 1.2 * four / two**2), rel=1e-9)


def test_squares_of_a_motion_with_heavy_tails_have_no_variance() -> None:
    """ASE's Andersen at large steps has a temperature, and its fourth moments grow without a bound."""
    found = law("andersen-after-kick", 1.3, 1.0, 1.0, 0.1, 1.0)
    assert np.all(np.isfinite(found.covariance))
    assert np.all(np.isnan(found.error_of_variances(100)))


def test_a_step_beyond_its_limit_has_no_stationary_state() -> None:
    found = replace(law("baoab", *SPRINGS[0]), h=2.4)
    assert np.all(np.isinf(found.covariance))


@pytest.mark.parametrize("width", [np.float64, np.longdouble])
def test_a_decay_that_newton_solves_is_found_in_few_steps(
    width: type[np.floating], monkeypatch: pytest.MonkeyPatch
) -> None:
    # of hundreds of numbers some go round by a rounding for ever
    steps = []
    monkeypatch.setattr(np, "sinh", lambda y, sinh=np.sinh: steps.append(y) or sinh(y))
    x = np.linspace(0.005, 4.0, 252, dtype=width)
    left = GJ["vii"](x)
    assert len(steps) <= 24
    c = np.log(left)
    assert np.all(np.abs((1 + left) / (1 - left) * c * c / 2 - x) <= 16 * np.finfo(width).eps * (x + 1))


EXTREMES = [
    (name, a, x)
    for name in (
        "baoab",
        "baoa",
        "aboba",
        "obabo",
        "oabao",
        "bbk",
        "andersen",
        "andersen-leapfrog",
        "gj-ii-half",
    )
    for a in (1e-8, 0.5, 1.9999, 3.9, 3.9999, 4 - 1e-8)
    for x in (1e-12, 1e-9, 1e-6, 1e-3, 0.3, 30.0)
]


@pytest.mark.parametrize("thermal", [1e-300, 1.0, 1e300])
@pytest.mark.parametrize("m", [1e-12, 1e12])
def test_exact_temperatures_are_right_at_extremes_or_not_given(m: float, thermal: float) -> None:
    h, given = 0.37, 0
    for name, a, x in EXTREMES:
        k = m * a / h**2
        square = h * h * k / m
        known = _table(name, square, x)
        if name.endswith("leapfrog") and square >= 2:
            continue
        found = law(name, h, m, k, x / h, thermal)
        for value, exact in zip((found.configurational[0], found.kinetic[0]), known, strict=False):
            # at 4 - 1e-8 the reference itself has few digits; a stable step is never said to be none
            assert not np.isinf(value), (name, a, x)
            assert np.isnan(value) or value == pytest.approx(exact, rel=2e-6), (name, a, x)
            given += bool(np.isfinite(value))
    assert given > 1.5 * len(EXTREMES)
