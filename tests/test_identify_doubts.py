"""What coarse numbers and clocks leave open is said, and what was stated accuses no scheme that has it.

The trajectories are of schemes that springcheck does not run, which many of the catalogue come near to.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import identify_corpus as corpus
from springcheck.identify import Identification, identify
from springcheck.identify.candidates import stated_stiffness
from springcheck.identify.families import EXPLICIT, substeps
from springcheck.identify.hypothesis import distinct
from springcheck.identify.judged import judged
from springcheck.identify.record import read
from springcheck.identify.storage import storage
from springcheck.physics.arrays import Floats

M, K = 3.7, 2.9
DOUBT = "or a scheme that is not known here"

State = tuple[float, float]
Step = Callable[[float, float, float, float], State]


def runge_kutta(rows: tuple[tuple[float, ...], ...], weights: tuple[float, ...]) -> Step:
    def step(q: float, v: float, h: float, c: float) -> State:
        slopes: list[State] = []
        for row in rows:
            x = q + h * sum(a * s[0] for a, s in zip(row, slopes, strict=False))
            u = v + h * sum(a * s[1] for a, s in zip(row, slopes, strict=False))
            slopes.append((u, -(K * x + c * u) / M))
        dq, dv = (sum(b * s[i] for b, s in zip(weights, slopes, strict=True)) for i in (0, 1))
        return q + h * dq, v + h * dv

    return step


def alternating(*shares: float) -> Step:
    """Drifts and kicks in turn, and back again: drift first."""
    every = (*shares, *shares[-2::-1])

    def step(q: float, v: float, h: float, c: float) -> State:
        for i, share in enumerate(every):
            q, v = (q + share * h * v, v) if i % 2 == 0 else (q, v - share * h * (K * q + c * v) / M)
        return q, v

    return step


PEFRL = alternating(0.1786178958448091, 0.7123418310626054, -0.06626458266981849, -0.2123418310626054,
                    0.77529337365001878)  # fmt: skip
MCLACHLAN = alternating(0.1931833275037836, 0.5, 0.6136333449924328)
KUTTA3 = runge_kutta(((), (0.5,), (-1, 2)), (1 / 6, 2 / 3, 1 / 6))
HEUN = runge_kutta(((), (1,)), (0.5, 0.5))
FEHLBERG4 = runge_kutta(
    ((), (1 / 4,), (3 / 32, 9 / 32), (1932 / 2197, -7200 / 2197, 7296 / 2197),
     (439 / 216, -8, 3680 / 513, -845 / 4104)),
    (25 / 216, 0, 1408 / 2565, 2197 / 4104, -1 / 5),
)  # fmt: skip


def frames(step: Step, h: float, *, every: int = 1, count: int = 400, c: float = 0.0) -> np.ndarray:
    q, v, out = 0.83, -0.61, [(0.83, -0.61)]
    for i in range(count * every):
        q, v = step(q, v, h, c)
        if (i + 1) % every == 0:
            out.append((q, v))
    return np.array(out).T


def digits(x: np.ndarray, number: int) -> np.ndarray:
    return np.array([float(f"{y:.{number}g}") for y in x])


def names(found: Identification) -> set[str]:
    return {x.scheme for x in found.candidates}


@pytest.mark.parametrize(
    ("step", "name", "h", "every"),
    [(PEFRL, "pefrl", 0.3, 1), (PEFRL, "pefrl", 0.47, 1), (MCLACHLAN, "mclachlan2", 0.039, 10)],
    ids=["pefrl", "pefrl, coarse", "mclachlan, 10 steps"],
)
def test_a_scheme_of_the_stated_stiffness_comes_before_another_of_another(
    step: Step, name: str, h: float, every: int
) -> None:
    """Velocity Verlet of many steps comes as near, on a spring that is not the stated one."""
    q, v = (digits(x, 9) for x in frames(step, h, every=every))
    found = identify(h * every * np.arange(401), q, v=v, mass=M, stiffness=K)
    assert found.fits, found.statement
    assert name in names(found)
    assert {x.stride for x in found.candidates if x.scheme == name} == {every}


@pytest.mark.parametrize(("step", "name", "h"), [(FEHLBERG4, "fehlberg4", 0.3), (PEFRL, "pefrl", 0.55)])
def test_a_scheme_of_the_stated_step_comes_before_others_of_other_steps(
    step: Step, name: str, h: float
) -> None:
    q, v = (digits(x, 9) for x in frames(step, h))
    found = identify(h * np.arange(401), q, v=v, mass=M, step=h)
    assert found.fits, found.statement
    assert name in names(found)
    assert {x.stride for x in found.candidates if x.scheme != "exact"} == {1}


def linear_acceleration(q: float, v: float, h: float, c: float) -> State:
    """Newmark's method with beta = 1/6."""
    new = (q + h * v - h * h / 3 * K / M * q) / (1 + h * h / 6 * K / M)
    return new, v - h / 2 * K / M * (q + new)


@pytest.mark.parametrize("h", [0.08, 0.1])
def test_coarse_numbers_of_a_stated_step_leave_open_a_scheme_as_near_to_the_exact_one(h: float) -> None:
    """On a spring of another stiffness it is of fourth order, as PEFRL is, whose error hardly shows."""
    q, v = (digits(x, 7) for x in frames(linear_acceleration, h, every=4))
    found = identify(4 * h * np.arange(401), q, v=v, mass=M, step=h)
    assert "pefrl" in names(found)
    assert DOUBT in found.statement


def theta(share: float) -> Step:
    def step(q: float, v: float, h: float, c: float) -> State:
        old, new = (1 - share) * h, share * h
        x, u = q + old * v, v - old * K / M * q
        u = (u - new * K / M * x) / (1 + new * new * K / M)
        return x + new * u, u

    return step


def newmark(beta: float, gamma: float) -> Step:
    def step(q: float, v: float, h: float, c: float) -> State:
        a = h * h * K / M
        new = (q + h * v - (0.5 - beta) * a * q) / (1 + beta * a)
        return new, v - a / h * ((1 - gamma) * q + gamma * new)

    return step


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (theta(0.6), "theta = 0.6"), (theta(2 / 3), "theta = 0.666667"),
        (newmark(1 / 6, 0.5), "beta = 0.166667, gamma = 0.5"),
        (newmark(0.3025, 0.6), "beta = 0.3025, gamma = 0.6"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("stated", [{}, {"stiffness": K}])
def test_methods_with_a_parameter_are_told_with_it(step: Step, said: str, stated: dict[str, float]) -> None:
    q, v = frames(step, 0.13, count=100)
    found = identify(0.13 * np.arange(101), q, v=v, mass=M, **stated)
    assert not found.fits
    assert said in found.statement


def test_every_other_step_of_a_method_with_a_parameter_shows_none() -> None:
    """A parameter of a step is not that of two; nor has any map that keeps areas one of Newmark's."""
    for step in (theta(0.6), newmark(1 / 6, 0.5), newmark(0.3025, 0.6)):
        q, v = frames(step, 0.13, every=2, count=100)
        found = identify(0.26 * np.arange(101), q, v=v, mass=M)
        assert "theta" not in found.statement
        assert "beta" not in found.statement


def remembered(m: float, f: float, h: float, c: float = 0.0, count: int = 100) -> tuple[Floats, Floats]:
    """The generalised alpha method of alpha_m and alpha_f, and least damping; c is a friction."""
    gamma, beta = 0.5 - m + f, (1 - m + f) ** 2 / 4
    q, v, a = 0.31, 0.44, -(K * 0.31 + c * 0.44) / M
    rows = [(q, v)]
    for _ in range(count):
        x, u = q + h * v + h * h * (0.5 - beta) * a, v + h * (1 - gamma) * a
        old = f * (K * q + c * v) + (1 - f) * (K * x + c * u)
        new = -(m * M * a + old) / ((1 - m) * M + (1 - f) * (K * h * h * beta + c * h * gamma))
        q, v, a = x + h * h * beta * new, u + h * gamma * new, new
        rows.append((q, v))
    each = np.array(rows)
    return each[:, 0], each[:, 1]


@pytest.mark.campaign
@pytest.mark.parametrize("h", [0.07, 1.3])
@pytest.mark.parametrize(
    ("shares", "said"),
    [
        ((0.0, 0.1), "HHT with alpha = -0.1"), ((0.0, 0.27), "HHT with alpha = -0.27"),
        ((1 / 3, 4 / 9), "generalised alpha with rho_infinity = 0.8"),
        ((-1.0, 0.0), "generalised alpha with rho_infinity = 0"), ((-0.2, 0.0), "WBZ with alpha_m = -0.2"),
    ],
)  # fmt: skip
def test_methods_with_an_acceleration_of_their_own_are_told_with_their_parameter(
    shares: tuple[float, float], said: str, h: float
) -> None:
    q, v = remembered(*shares, h)
    for stated in ({}, {"stiffness": K}):
        found = identify(h * np.arange(101), q, v=v, mass=M, **stated)
        assert not found.fits
        assert f"a scheme with memory, of second order, {said}" in found.statement


@pytest.mark.parametrize(
    ("old", "slopes", "said"),
    [
        ([0, 1], [2, 0], "the leapfrog of two steps"),
        ([4 / 3, -1 / 3], [2 / 3], "the two before it, and not from one: a scheme with memory, of second"),
        ([18 / 11, -9 / 11, 2 / 11], [6 / 11], "the three before it, and not from one: a scheme with memory, "
         "of third order, BDF3"),
        ([1], [23 / 12, -16 / 12, 5 / 12], "the three before it, and not from one: a scheme with memory, "
         "of third order, Adams-Bashforth (AB3)"),
        ([1], [55 / 24, -59 / 24, 37 / 24, -9 / 24], "the four before it, and not from one: a scheme with "
         "memory, of fourth order, Adams-Bashforth (AB4)"),
    ],
)  # fmt: skip
def test_methods_of_several_steps_are_told_with_their_number(
    old: list[float], slopes: list[float], said: str
) -> None:
    """z[n+1] is old z[n], z[n-1]... and h times the slopes there, or there is one slope, at the end."""
    h = 0.2
    rate = h * np.array([[0, 1], [-K / M, 0]])
    ahead = np.linalg.inv(np.eye(2) - slopes[0] * rate) if len(slopes) == 1 else np.eye(2)
    z = [np.array([1.3, 0.4])]
    while len(z) < max(len(old), len(slopes)):
        z.append(z[-1] + rate @ (z[-1] + rate @ z[-1] / 2))
    while len(z) < 101:
        new = sum(c * z[-1 - i] for i, c in enumerate(old))
        if len(slopes) > 1:
            new = new + rate @ sum(c * z[-1 - i] for i, c in enumerate(slopes))
        z.append(ahead @ new)
    q, v = np.array(z).T
    assert said in identify(h * np.arange(101), q, v=v, mass=M).statement


PREDICT = {
    "second order": ([3 / 2, -1 / 2], [1 / 2, 1 / 2]),
    "third order": ([23 / 12, -16 / 12, 5 / 12], [5 / 12, 8 / 12, -1 / 12]),
    "fourth order": ([55 / 24, -59 / 24, 37 / 24, -9 / 24], [9 / 24, 19 / 24, -5 / 24, 1 / 24]),
}


@pytest.mark.parametrize("stated", [{}, {"stiffness": K}], ids=["", "stiffness"])
@pytest.mark.parametrize("order", PREDICT)
def test_predictors_with_a_corrector_are_told_with_their_order(order: str, stated: dict[str, float]) -> None:
    h, (explicit, implicit) = 0.17, PREDICT[order]
    rate = h * np.array([[0, 1], [-K / M, 0]])
    z = [np.array([1.3, 0.4])]
    for _ in range(150):
        if len(z) < len(explicit):
            z.append(z[-1] + rate @ (z[-1] + rate @ z[-1] / 2))
            continue
        ahead = z[-1] + rate @ sum(c * z[-1 - i] for i, c in enumerate(explicit))
        z.append(
            z[-1] + rate @ sum((c * x for c, x in zip(implicit, [ahead, *z[::-1]], strict=False)), 0 * ahead)
        )
    q, v = np.array(z).T
    found = identify(h * np.arange(151), q, v=v, mass=M, **stated)
    assert f"a scheme with memory, of {order}, Adams-Bashforth-Moulton (PECE)," in found.statement


@pytest.mark.parametrize("c", [0.0, 0.4])
@pytest.mark.parametrize(("h", "frames"), [(0.05, 100), (0.25, 100), (0.25, 400)])
def test_a_scheme_of_several_steps_whose_memory_lasts_is_no_motion_that_a_force_drives(
    h: float, frames: int, c: float
) -> None:
    """Milne's predictor and corrector: what it remembers alternates, and hardly fades or grows."""
    rate = h * np.array([[0, 1], [-K / M, -c / M]])
    z = [np.array([1.3, 0.4])]
    while len(z) <= frames:
        if len(z) < 4:
            z.append(z[-1] + rate @ (z[-1] + rate @ z[-1] / 2))
            continue
        ahead = z[-4] + rate @ (8 * z[-1] - 4 * z[-2] + 8 * z[-3]) / 3
        z.append(z[-2] + rate @ (z[-2] + 4 * z[-1] + ahead) / 3)
    q, v = np.array(z).T
    found = identify(h * np.arange(frames + 1), q, v=v, mass=M)
    assert found.statement.startswith("Each state follows from the four before it, and not from one, and ")
    assert "does not fade: a scheme of several steps" in found.statement


def test_a_force_that_drives_a_motion_is_no_memory_that_lasts() -> None:
    """A drive by one cosine follows from two states too."""
    q, v, h, rows = 1.3, 0.4, 0.2, []
    for i in range(200):
        rows.append((q, v))
        v -= h * (K * q - 0.8 * np.cos(2.1 * i * h)) / M
        q += h * v
    q, v = np.array(rows).T
    assert "memory" not in (said := identify(h * np.arange(200), q, v=v, mass=M).statement)
    assert "remembered" not in said


def test_steps_that_alternate_are_told_with_what_they_alternate_by_and_are_no_drive() -> None:
    q, v, h, states = 1.3, 0.4, 0.13, []
    for i in range(101):
        states.append((q, v))
        step = h * (1 + 0.01 * (-1) ** i)
        v -= step / 2 * K * q / M
        q += step * v
        v -= step / 2 * K * q / M
    qs, vs = np.array(states).T
    found = identify(h * np.arange(101), qs, v=vs, mass=M)
    assert "alternate: steps alternate by 0.02 of their length" in found.statement


def test_an_odd_number_of_steps_that_alternate_is_no_adaptive_solver() -> None:
    """RK2 with friction, nine steps to a frame: the exact flow comes near, and what it misses alternates."""
    q, v, h, states = 1.3, 0.4, 0.1, []
    for i in range(9 * 100 + 1):
        states += [(q, v)] if i % 9 == 0 else []
        s = h * (1 + 9e-4 * (-1) ** i)
        x, u = q + s / 2 * v, v + s / 2 * (-K / M * q - 0.15 * v)
        q, v = q + s * u, v + s * (-K / M * x - 0.15 * u)
    qs, vs = np.array(states).T
    found = identify(0.9 * np.arange(101), qs, v=vs, mass=M)
    assert found.statement.startswith("Even and odd steps differ and alternate: ")


def test_damped_frames_in_reverse_order_are_no_steps_back_in_time_with_friction_that_feeds_energy_in() -> (
    None
):
    q, v, h, states = 1.3, 0.4, 0.21, []
    for _ in range(80):
        states.append((q, v))
        v -= h * (K * q + 0.2 * v) / M
        q += h * v
    qs, vs = np.array(states[::-1]).T
    assert identify(h * np.arange(80)[::-1], qs, v=vs, mass=M).scheme == "semi-implicit-euler"


@pytest.mark.parametrize("roundings", [0, 10])
def test_a_velocity_that_is_off_by_more_than_a_difference_of_positions_rounds_is_no_arithmetic(
    roundings: int,
) -> None:
    q, v, h, states = 1.3, 0.4, 1e-3, []
    for _ in range(201):
        new = q + h * (v - h * 3.1 * q / 2.3)
        q, v = new, (new - q) / h
        states.append((q, v))
    qs, vs = np.array(states).T
    vs[60] += roundings * 2.0**-52 * abs(qs[60]) / h
    assert identify(h * np.arange(201), qs, v=vs, mass=2.3).fits == (roundings == 0)


@pytest.mark.parametrize("central", [False, True], ids=["difference", "central difference"])
@pytest.mark.parametrize("number", [13, 14, 15])
@pytest.mark.parametrize("h", [3e-3, 1e-2, 3e-2])
def test_velocities_that_are_differences_of_positions_are_so_in_text_of_many_digits(
    h: float, number: int, central: bool
) -> None:
    """Digits and the rounding of positions over the step are of one size: no arithmetic explained it."""
    before, q, states = 1.0, 1 - 1.1 * h * h, []
    for _ in range(600):
        after = 2 * q - before - h * h * 2.2 * q
        states.append((q, (after - before) / (2 * h) if central else (q - before) / h))
        before, q = q, after
    qs, vs = (digits(x, number) for x in np.array(states).T)
    found = identify(h * np.arange(600), qs, v=vs)
    assert found.scheme == ("velocity-verlet" if central else "semi-implicit-euler")
    vs[60] += 10 * (2.0**-52 * abs(qs[60]) / h + 10.0 ** (1 - number))
    assert not identify(h * np.arange(600), qs, v=vs).fits


def test_two_frames_that_have_changed_places_are_told() -> None:
    q, v = remembered(0.0, 0.0, 0.2)
    order = np.arange(len(q))
    order[[40, 41]] = 41, 40
    found = identify(0.2 * np.arange(len(q)), q[order], v=v[order], mass=M)
    assert "but frames 40 and 41 have changed places" in found.statement


def test_a_method_with_memory_that_is_none_of_the_known_is_none_of_them() -> None:
    """Every other step of one, another one with friction, and another of the stages' weights."""
    h = 0.2
    for (q, v), n in (
        (remembered(0.0, 0.1, h, count=200), 2), (remembered(1 / 3, 4 / 9, h, c=0.4), 1),
        (remembered(0.1, 0.15, h), 1),
    ):  # fmt: skip
        found = identify(n * h * np.arange(101), q[::n], v=v[::n], mass=M)
        assert "memory" in found.statement
        assert "alpha =" not in found.statement
        assert "infinity =" not in found.statement


def test_of_steps_that_coarse_numbers_do_not_tell_apart_the_fewest_are_not_the_answer() -> None:
    h = 0.11
    q, v = (x.astype(np.float32) for x in frames(PEFRL, h, every=10, count=100))
    found = identify(10 * h * np.arange(101), q, v=v, mass=M)
    assert found.stride is None
    assert {9, 10} <= {x.stride for x in found.candidates if x.scheme == "pefrl"}


def test_many_steps_of_a_plain_scheme_are_no_plainer_than_few_of_one_that_is_not_run() -> None:
    """68 steps of velocity Verlet come as near to these frames."""
    q, v = (digits(x, 8) for x in frames(PEFRL, 0.17, count=100))
    found = identify(0.17 * np.arange(101), q, v=v, mass=M, stiffness=K)
    assert (found.candidates[0].scheme, found.candidates[0].stride) == ("pefrl", 1)


@pytest.mark.parametrize("number", [7, 8])
def test_the_exact_flow_in_coarse_text_may_be_any_scheme_whose_error_does_not_show(number: int) -> None:
    h = 0.042
    q, v = (digits(x, number) for x in frames(FEHLBERG4, h, count=80))
    found = identify(h * np.arange(81), q, v=v, mass=M, step=h, stiffness=K)
    assert found.fits
    assert "exact" in names(found)
    assert DOUBT in found.statement


@pytest.mark.parametrize("clock", ["three decimals", "float32"])
def test_a_coarse_clock_leaves_other_steps_open_whatever_the_digits_of_the_states(clock: str) -> None:
    h = 0.0117
    q, v = frames(MCLACHLAN, h, count=120)
    i = np.arange(121)
    t = np.round(h * i, 3) if clock == "three decimals" else (i * np.float32(h)).astype(np.float32)
    found = identify(t, q, v=v, mass=M)
    assert found.scheme == "mclachlan2" or DOUBT in found.statement, found.statement


@pytest.mark.parametrize(
    ("step", "name", "every"), [(KUTTA3, "rk3-kutta", 1), (FEHLBERG4, "fehlberg4", 2), (PEFRL, "pefrl", 5)]
)
def test_schemes_that_are_not_run_are_named_with_friction_too(step: Step, name: str, every: int) -> None:
    h, c = 0.23, 0.31
    q, v = frames(step, h, every=every, count=60, c=c)
    found = identify(h * every * np.arange(61), q, v=v, mass=M, stiffness=K)
    assert (found.scheme, found.stride, found.fits) == (name, every, True)
    assert found.friction[0] * M == pytest.approx(c, rel=1e-9)
    assert found.candidates[0].law == EXPLICIT
    assert identify(h * every * np.arange(61), q, v=v, mass=M, stiffness=K, friction=c).fits


def test_a_stated_friction_is_known_no_finer_than_the_clock() -> None:
    """It was "a friction 1 times the stated": that of times which single precision adds up."""
    h, c = 0.083, 0.061
    q, v = frames(HEUN, h, c=c)
    t = np.cumsum(np.concatenate([[0], np.full(400, h, np.float32)]), dtype=np.float32)
    found = identify(t, q, v=v, mass=M, stiffness=K, friction=c)
    assert found.fits, found.statement
    off = identify(t, q, v=v, mass=M, stiffness=K, friction=1.01 * c)
    assert "friction 0.990" in off.statement


def euler(h: float, k: float = K, q: float = 0.83, v: float = -0.61, count: int = 300) -> np.ndarray:
    out = [(q, v)]
    for _ in range(count):
        v -= h * k * q / M
        q += h * v
        out.append((q, v))
    return np.array(out).T


def test_a_single_position_of_the_other_sign_is_in_no_box() -> None:
    """Positions that are wrapped into a box of L lie within L of each other."""
    q, v = euler(0.1)
    q[77] = -q[77]
    found = identify(0.1 * np.arange(301), q, v=v, mass=M)
    assert "frame 77 is wrong" in found.statement
    q, v = euler(0.1)
    found = identify(0.1 * np.arange(301), (q + 0.5) % 1 - 0.5, v=v, mass=M)
    assert "wrapped into a box of 1," in found.statement
    # of one frame that is off by a length a box is one cause of several
    q, v = euler(0.1, count=60)
    for length, said in ((3.7, True), (0.2, False)):
        found = identify(0.1 * np.arange(61), q + length * (np.arange(61) < 1), v=v, mass=M)
        assert "frame 0 does not belong to it: a wrong start" in found.statement
        assert ("wrapped into a box of 3.7," in found.statement) == ("box" in found.statement) == said


def test_velocities_of_another_particle_are_no_magnetic_field() -> None:
    one, other = euler(0.1), euler(0.1, q=0.3, v=0.7)
    states = np.stack([one, other], axis=-1)
    found = identify(0.1 * np.arange(301), states[0], v=states[1, :, ::-1], mass=[M, M])
    assert not found.fits
    assert "turns" not in found.statement


@pytest.mark.parametrize(("digits", "off"), [(10, 1e-6), (7, 3e-5), (5, 2e-3)])
def test_springs_that_are_not_quite_alike_along_two_axes_are_no_magnetic_field(
    digits: int, off: float
) -> None:
    """To few digits one complex map holds of both, whose velocity seemed to turn by 4e-8 in a frame."""
    one, other = euler(0.1, count=120), euler(0.1, K * (1 + off), q=0.3, v=0.7, count=120)
    states = np.stack([one, other], axis=-1) * np.array([1, 1.0371])[:, None, None]
    q, v = np.vectorize(lambda x: float(f"{x:.{digits}g}"))(states)
    found = identify(0.1 * np.arange(121), q, v=v, mass=M)
    assert not found.fits
    assert "One linear map" in found.statement
    assert "magnetic" not in found.statement


def test_a_force_constant_of_half_the_size_is_said_beside_the_fault_that_does_the_same() -> None:
    q, v = euler(0.1, K / 2)
    found = identify(0.1 * np.arange(301), q, v=v, mass=M, stiffness=K)
    assert "without its second half kick; or Semi-implicit Euler" in found.statement
    assert "k/2 q**2 taken for k q**2" in found.statement


@pytest.mark.parametrize(
    ("stiffness", "order"),
    [((2.9, 2.9), (1, 0)), ((2.9, 4.1), (1, 0)), ((2.9, 4.1, 1.7), (1, 2, 0)), ((2.9, 4.1, 1.7), (0, 2, 1))],
)
def test_velocities_in_other_columns_in_every_frame_are_told_with_their_columns(
    stiffness: tuple[float, ...], order: tuple[int, ...]
) -> None:
    """They were "of the wrong sign", or a one-step method that is not known here."""
    starts = ((0.83, -0.61), (-0.31, 0.4), (0.5, 0.2))
    each = [euler(0.1, k, *start) for k, start in zip(stiffness, starts, strict=False)]
    q, v = (np.stack(x, axis=1) for x in zip(*each, strict=True))
    found = identify(0.1 * np.arange(301), q, v=v[:, order], mass=M)
    assert not found.fits
    assert "in every frame" in found.statement
    for j in range(len(order)):
        said = f"of coordinate {j} in column {order.index(j)}"
        assert (said in found.statement) == (order.index(j) != j)
    assert identify(0.1 * np.arange(301), q, v=v, mass=M).fits
    assert "in every frame" not in identify(0.1 * np.arange(301), q, v=-v, mass=M).statement


def test_slips_of_a_clock_over_few_frames_are_no_other_method() -> None:
    """Semi-implicit Euler, ten steps of an accumulated clock to a frame, half a turn: less than their phases
    show; too few frames to fit what the slips do."""
    t = [0.0, 0.015074484428289722, 0.03014896885657945, 0.045223453284869146, 0.06029793771315884]
    q = [
        0.21626591105245838,
        -0.2757081389464383,
        0.21696866111245916,
        -0.27641066740542797,
        0.2176709676544483,
    ]
    v = [-99.43450325446838, 99.38928620411033, -99.34402444946224, 99.29871801088177, -99.25336690874781]
    assert identify(t, q, v=v, mass=0.15781853472461824).scheme == "semi-implicit-euler"


def kutta(q: float, v: float, h: float, c: float) -> State:
    return runge_kutta(((), (0.5,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6))(q, v, h, c)


@pytest.mark.parametrize(("h", "every"), [(0.11, 1), (0.06, 7)])
def test_a_list_of_what_coarse_numbers_leave_open_has_schemes_that_are_not_run(h: float, every: int) -> None:
    q, v = (digits(x, 6) for x in frames(kutta, h, every=every, count=100))
    found = identify(every * h * np.arange(101), q, v=v, mass=M)
    assert "rk4" in names(found)
    assert ("rk3-kutta", every) in {(x.scheme, x.stride) for x in found.candidates}


def test_a_stiffness_that_goes_up_and_down_in_nearly_two_frames_is_not_one_that_alternates() -> None:
    h, (q, v) = 0.9, (0.31, 0.44)
    rows = [(q, v)]
    for n in range(8 * 50):
        k = K * (1 + 1e-9 * np.sin(0.392 * n))
        v -= h / 2 * k / M * q
        q += h * v
        v -= h / 2 * k / M * q
        rows.append((q, v))
    x, u = np.array(rows[::8]).T
    found = identify(8 * h * np.arange(51), x, v=u, mass=M)
    assert "changes in time" in found.statement
    assert "alternat" not in found.statement


def test_whole_numbers_of_three_digits_are_text_and_not_half_precision() -> None:
    """Half precision holds every whole number up to 2048; a scheme was refused for its finer rounding."""
    v = np.array([943, -485, -925, 116, 798, 148, -612, -309, 409, 380, -221, -381, 65.5, 334])
    assert storage(v).name == "text, 3 digits"
    half = np.array([0.3337, 1.2345, 5.678, -2.221, 0.07777]).astype(np.float16)
    assert storage(half.astype(np.float64)).name == "half"


def test_implicit_euler_whose_motion_dies_within_a_frame_is_named_with_its_steps() -> None:
    h, n, at, m, k = 0.007081539786574927, 12, -0.15481943848703078, 0.4792474570145283, 10427.38906692295
    q, v = 0.0, 0.0
    rows = [(q, v)]
    for _ in range(100 * n):
        v = (v - h * k / m * (q - at)) / (1 + h * h * k / m)
        q += h * v
        rows.append((q, v))
    x, u = np.array(rows[::n]).T
    found = identify(n * h * np.arange(101), x, v=u, mass=m, stiffness=k)
    assert (found.scheme, found.stride) == ("implicit-euler", n)
    assert "12 steps to a frame" in found.statement


def test_of_a_motion_that_dies_in_single_precision_the_frames_that_move_are_counted() -> None:
    """The rest know nothing of the map: its own error was taken for that of a hundred frames."""
    h, n, at, m, k = 0.0032122717692289497, 11, -2.2450934674416985, 0.018485555892412693, 2792.489639874041
    q, v = -0.9169573124511694, 1485.0215521944763
    rows = [(q, v)]
    for _ in range(100 * n):
        v -= h / 2 * (k * (q - at) / m)
        q += h / 2 * v
        v *= np.exp(-0.2653462404143413)
        q += h / 2 * v
        v -= h / 2 * (k * (q - at) / m)
        rows.append((q, v))
    x, u = np.array(rows[::n]).T.astype(np.float32)
    found = identify(n * h * np.arange(101), x, v=u, mass=m)
    assert (found.scheme, found.stride) == ("langevin-middle", n)


def test_a_friction_in_five_frames_is_plainer_than_another_spring_than_the_stated_one() -> None:
    """It was Forest-Ruth on a spring 1.026 times as stiff."""
    t = 0.022935556738542733 * np.arange(5)
    q = [1.7841124534606934, 1.8429468870162964, 1.895219087600708, 1.940860390663147, 1.9798222780227661]
    v = [2.707139015197754, 2.4227919578552246, 2.13501238822937, 1.8446813821792603, 1.5526764392852783]
    found = identify(t, q, v=v, mass=12.785327484536777, stiffness=70.97025435286015)
    assert "times as stiff" not in found.statement
    assert "position-verlet" in names(found)


def test_a_velocity_that_is_a_multiple_of_the_position_is_told() -> None:
    """A buffer that both share; it was said that areas turn over."""
    h, q, v = 0.1, 0.31, 0.44
    rows = [(q, v)]
    for _ in range(80):
        q += h * (v - h * K / M * q)
        v = 0.8 * q
        rows.append((q, v))
    x, u = np.array(rows).T
    found = identify(h * np.arange(81), x, v=u, mass=M)
    assert "The velocity follows the position: from frame 1 on it is 0.8 times" in found.statement


def test_a_velocity_that_is_a_rounding_is_said_to_be_zero() -> None:
    """It was said to be 1.9e-18 times the distance from rest."""
    t = 0.1 * np.arange(100)
    found = identify(t, np.exp(-0.3 * t), p=np.r_[1.0, np.full(99, 1e-18)], mass=M)
    assert found.statement == "The velocity is 0 from frame 1 on"


def test_noise_that_leaves_no_fit_is_no_number_of_substeps() -> None:
    assert list(substeps(0.75, 1e-9)[0]) == [2]
    assert list(substeps(np.nan, 1e-9)[0]) == list(substeps(0.75, np.nan)[0]) == []


WEAK = [case for case in corpus.load() if case.name.startswith("a weak ")]


@pytest.mark.parametrize("case", WEAK, ids=lambda case: case.name)
def test_a_friction_that_few_digits_hardly_show_may_be_another_force(case: corpus.Case) -> None:
    """A drag like |v| v, or a bond that is no spring, was named with friction, and without a doubt."""
    found = corpus.said(case)
    assert isinstance(found, Identification)
    assert found.scheme in case.schemes
    assert found.statement.endswith(DOUBT)
    if any(not x.law for x in found.candidates):
        assert " with or without friction" in found.statement
        assert any(note.startswith("the motion may be damped") for note in found.notes)


def test_a_friction_that_digits_show_is_linear_in_the_velocity_for_certain() -> None:
    q, v = 1.0, 0.0
    rows = [(q, v)]
    for _ in range(300):
        v = v + 0.2 * (-q - 0.1 * v)
        q = q + 0.2 * v
        rows.append((q, v))
    q_, v_ = (np.array([float(f"{y:.7g}") for y in x]) for x in np.array(rows).T)
    found = identify(0.2 * np.arange(301), q_, v=v_)
    assert found.statement.startswith("Semi-implicit Euler, kick-drift")
    assert " with friction: " in found.statement
    assert DOUBT not in found.statement


def test_a_remark_on_one_reading_of_the_states_is_not_one_on_another() -> None:
    t, x = 0.1 * np.arange(40), 0.3 * np.arange(40)
    plain = judged(read(t, np.cos(x), None, -3 * np.sin(x), 1.0), None, None, None)
    other = replace(plain, stride=2).noting("one more")
    assert other.notes == (*plain.notes, "one more")
    # what is tried of a stated stiffness leaves no remark behind
    stated = replace(plain, stiffness=np.array([7.0]))
    joint = plain.compare(distinct(damped=False), range(1, 2))[0]
    wrong, remarks = stated_stiffness(stated, [joint], "double", np.array([7.0]))
    assert wrong[0].cause.startswith("Exact flow, but of a spring")
    assert "does not fit" in remarks[0]
    assert stated.notes == plain.notes


@pytest.mark.parametrize(("hw", "away", "frames"), [(0.0201, 7.2, 8), (0.022, 2.1, 10), (0.0127, 0.0, 8)])
def test_numbers_of_double_precision_leave_room_for_an_unknown_scheme_too(
    hw: float, away: float, frames: int
) -> None:
    """The Taylor series of fifth order, of which frames show but one number, or none: Yoshida's fourth order
    in 5 steps was named, Ruth's third in an unknown number, and schemes without it were said to be all."""
    m, k = 0.83, 2.73
    h = hw / np.sqrt(k / m)
    step = sum(
        np.linalg.matrix_power(h * np.array([[0, 1], [-k / m, 0]]), n) / math.factorial(n) for n in range(6)
    )
    states = [np.array([-1.44, 0.24])]
    for _ in range(frames - 1):
        states.append(step @ states[-1])
    q, v = np.array(states).T
    found = identify(h * np.arange(frames), q + away, v=v)
    assert found.fits
    assert found.statement.endswith("or a scheme that is not known here")


@pytest.mark.parametrize(("share", "count"), [(1.4e-3, 400), (1.2e-3, 4000), (1e-3, 4000)])
def test_what_a_sum_of_slopes_rounds_is_no_room_for_other_schemes(share: float, count: int) -> None:
    """At about a thousandth of its limit RK4 was beside others that are 40 to 200 standard errors off."""
    rows = runge_kutta(((), (1 / 2,), (0, 1 / 2), (0, 0, 1)), (1 / 6, 1 / 3, 1 / 3, 1 / 6))
    h = share * 2 * math.sqrt(2 / K * M)
    q, v = frames(rows, h, count=count)
    found = identify(h * np.arange(count + 1), q, v=v, mass=M)
    assert found.scheme == "rk4"


@pytest.mark.parametrize(("every", "decimals"), [(1, 3), (4, 6)])
def test_fixed_decimals_of_a_motion_that_grows_beyond_the_digits_of_double_precision(
    every: int, decimals: int
) -> None:
    """Numbers from 1 to 1e13: the small ones are rounded to their decimals, the large ones to 53 bits."""
    q, v, rows = 1.0, 0.5, []
    for _ in range(700):
        rows.append((q, v))
        q, v = q + 0.3 * v, v - 0.3 * q
    written = np.array([[float(f"{x:.{decimals}f}") for x in row] for row in rows[::every]])
    assert np.max(np.abs(written)) * 2.0**-52 > 10.0**-decimals
    found = identify(0.3 * every * np.arange(len(written)), written[:, 0], v=written[:, 1], mass=1.0)
    assert (found.scheme, found.stride, found.fits) == ("explicit-euler", every, True)
    assert found.precision == f"text, {decimals} decimals"
    exact = np.array(rows[::every])
    assert storage(exact[:, 0]).name == "double"


@pytest.mark.parametrize(
    ("kept", "words"),
    [
        ((0.9, 0.8), "one multiplies areas by a share of 1.00e-01 more than the other"),
        ((0.9, 1.1), "a friction of changing sign multiplies areas by 1 -1.00e-01 and 1 +1.00e-01"),
    ],
)
def test_frictions_that_alternate_are_of_changing_sign_only_where_one_of_them_drives(
    kept: tuple[float, float], words: str
) -> None:
    q, v, h, states = 1.3, 0.4, 0.3, []
    for i in range(101):
        states.append((q, v))
        v -= h / 2 * K * q / M
        q += h * v
        v = (v - h / 2 * K * q / M) * kept[i % 2]
    qs, vs = np.array(states).T
    found = identify(h * np.arange(101), qs, v=vs, mass=M)
    assert found.statement == f"Even and odd steps differ and alternate: {words}"


@pytest.mark.parametrize(
    ("stated", "of_class"),
    [
        ({"mass": M}, True), ({"mass": M, "stiffness": K}, True),
        ({"mass": M, "stiffness": 2 * K}, False), ({}, False),
    ],
)  # fmt: skip
def test_a_method_has_a_stability_function_only_on_the_spring_that_is_stated(
    stated: dict[str, float], of_class: bool
) -> None:
    """Two stages whose weights do not add up to 1, and whose momenta without a mass are of any spring."""
    step = runge_kutta(((), (0.9,)), (0.5, 0.49))
    states = [(1.3, 0.4)]
    for _ in range(100):
        states.append(step(*states[-1], 0.3, 0.0))
    q, v = np.array(states).T
    found = identify(0.3 * np.arange(101), q, M * v, **stated)
    assert found.scheme is None
    growth = "amplitudes change by" in found.statement
    assert ("whose stability function has" in found.statement, growth) == (of_class, not of_class), found
