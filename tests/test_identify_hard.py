"""What deceives an identification: forces that are wrong in the seventh digit, friction, clocks, files of
several motions.

Every trajectory is stepped here in plain Python, without the catalogue of schemes, so that a mistake of the
catalogue cannot hide itself.
"""

from __future__ import annotations

import re
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from springcheck.errors import IdentificationError, MethodError
from springcheck.identify import Identification, identify, identify_stepper
from springcheck.identify.clock import clock_of

M, K, H = 3.7, 2.9, 0.1
STATED = {"mass": M, "stiffness": K}
State = tuple[float, float]
Step = Callable[[int, float, float], State]


def march(step: Step, frames: int = 400, q: float = 0.3, p: float = 0.7) -> tuple[np.ndarray, ...]:
    """Times, positions and momenta of frames + 1 states."""
    states = [(q, p)]
    for i in range(frames):
        states.append(step(i, *states[-1]))
    q_all, p_all = np.array(states).T
    return H * np.arange(frames + 1), q_all, p_all


def verlet(force: Callable[[int, float, float], float], h: float = H) -> Step:
    """Velocity Verlet with a force of (step, q, p); `i + 1` is the step of the second half kick."""

    def step(i: int, q: float, p: float) -> State:
        p = p + h / 2 * force(i, q, p)
        q = q + h * (p / M)
        return q, p + h / 2 * force(i + 1, q, p)

    return step


def damped(kick: Callable[[float, float], float]) -> Step:
    """Velocity by `kick(q, v)`, then a drift with it."""

    def step(i: int, q: float, p: float) -> State:
        v = kick(q, p / M)
        return q + H * v, M * v

    return step


noise = np.random.default_rng(7).standard_normal(4096)

FALSE_FITS: dict[str, tuple[Step, str]] = {
    "k(t) wobbling by 3e-7": (verlet(lambda i, q, p: -K * q * (1 + 3e-7 * np.sin(0.3 * i * H))), "stiffness"),
    "k(t) wobbling by 1e-10": (
        verlet(lambda i, q, p: -K * q * (1 + 1e-10 * np.sin(0.3 * i * H))),
        "stiffness",
    ),
    "noise in the force": (verlet(lambda i, q, p: -K * q + 1e-8 * noise[i]), "noise|irregular"),
    "a cubic force of 3e-7": (verlet(lambda i, q, p: -K * q * (1 + 3e-7 * q * q)), "cubic|anharmonic"),
    "a force that is clipped": (verlet(lambda i, q, p: max(-K * q, -1.0)), "force|anharmonic"),
    "one kick": (
        lambda i, q, p: verlet(lambda j, x, y: -K * x)(i, q, p + (1e-8 if i == 137 else 0)),
        "frames? 13[789]",
    ),
}


@pytest.mark.parametrize("name", FALSE_FITS)
def test_a_force_with_a_systematic_error_is_no_arithmetic(name: str) -> None:
    step, words = FALSE_FITS[name]
    found = identify(*march(step), **STATED)
    assert not found.fits, found
    assert_said(found, words)


def assert_said(found: Identification, words: str) -> None:
    """The first sentence says it."""
    assert re.search(words, found.statement, re.IGNORECASE), (words, found.statement)


@pytest.mark.parametrize("drift", [1e-12, 1e-9, 1e-6, 1e-3])
def test_a_constant_drift_of_the_position_is_no_equilibrium(drift: float) -> None:
    def step(i: int, q: float, p: float) -> State:
        q, p = verlet(lambda j, x, y: -K * x)(i, q, p)
        return q + drift, p

    found = identify(*march(step), **STATED)
    assert not found.fits
    assert_said(found, "constant")
    assert_said(found, "position")


def test_one_wrong_velocity_at_the_end_is_found() -> None:
    t, q, p = march(verlet(lambda i, q, p: -K * q))
    p[-1] *= 1.03
    found = identify(t, q, p, **STATED)
    assert not found.fits
    assert_said(found, "frame 400")


def test_steps_that_alternate_are_no_scheme_of_one_step() -> None:
    def step(i: int, q: float, p: float) -> State:
        return verlet(lambda j, x, y: -K * x, h=H * (1 + 1e-8 * (-1) ** i))(i, q, p)

    found = identify(*march(step), **STATED)
    assert not found.fits
    assert_said(found, "alternat")


def test_friction_of_changing_sign_is_seen() -> None:
    def step(i: int, q: float, p: float) -> State:
        q, p = verlet(lambda j, x, y: -K * x)(i, q, p)
        return q, p * (1 - 1e-7 * (-1) ** i)

    found = identify(*march(step), **STATED)
    assert not found.fits
    assert_said(found, "alternat|changing sign")


def test_a_weak_coupling_to_another_particle_is_seen() -> None:
    k = np.array([K, 1.7])

    def force(q: np.ndarray) -> np.ndarray:
        return -k * q + 1e-6 * (q[::-1] - q)

    q, p = [np.array([0.3, -0.2])], [np.array([0.7, 0.4])]
    for _ in range(400):
        half = p[-1] + H / 2 * force(q[-1])
        q.append(q[-1] + H * half / M)
        p.append(half + H / 2 * force(q[-1]))
    found = identify(H * np.arange(401), np.array(q), np.array(p), mass=M)
    assert found.scheme in (None, "velocity-verlet")
    assert found.fits == (found.scheme == "velocity-verlet")
    assert any("coupled" in note for note in (found.statement, *found.notes))


# damped motion ------------------------------------------------------------------------------------------

C = 0.5
DAMPED: dict[str, tuple[Step, str]] = {
    "friction implicit in v": (
        damped(lambda q, v: (v - H * K / M * q) / (1 + H * C / M)),
        "semi-implicit-euler",
    ),
    "exponential friction after the kick": (
        damped(lambda q, v: (v - H * K / M * q) * np.exp(-H * C / M)),
        "semi-implicit-euler",
    ),
    "explicit friction": (damped(lambda q, v: v - H * (K * q + C * v) / M), "semi-implicit-euler"),
    "weak friction": (damped(lambda q, v: (v - H * K / M * q) / (1 + 0.005)), "semi-implicit-euler"),
}


@pytest.mark.parametrize("name", DAMPED)
def test_on_damped_motion_the_scheme_is_right_or_listed_and_never_another(name: str) -> None:
    step, scheme = DAMPED[name]
    t, q, p = march(step)
    blind = identify(t, q, p, mass=M)
    assert blind.scheme in (None, scheme), blind
    assert scheme in {x.scheme for x in blind.candidates}
    # implicit Euler with a weaker friction is the same map on the same spring: the friction tells them apart
    stated = identify(t, q, p, **STATED)
    assert stated.scheme in (None, scheme)
    assert stated.fits
    assert stated.stiffness == pytest.approx((K,), rel=1e-10)
    c = 0.005 * M / H if name == "weak friction" else C
    both = identify(t, q, p, **STATED, friction=c)
    assert (both.scheme, both.fits) == (scheme, True), both
    assert both.friction == pytest.approx((c / M,), rel=1e-9)


def test_the_friction_law_that_the_numbers_assume_is_said() -> None:
    t, q, p = march(DAMPED["friction implicit in v"][0])
    found = identify(t, q, p, **STATED)
    rates = {round(x, 9) for x in found.friction}
    law = next(note for note in found.notes if "friction" in note)
    assert "implicit" in law
    assert "exponential" in law
    assert rates == {round(C / M, 9)} or f"{C / M:.6g}" in law


def test_velocity_verlet_with_implicit_friction_is_not_velocity_verlet_of_another_stiffness() -> None:
    def step(i: int, q: float, p: float) -> State:
        s = 1 + H * C / (2 * M)
        v = (p / M - H / 2 * K / M * q) / s
        q = q + H * v
        return q, M * (v - H / 2 * K / M * q) / s

    t, q, p = march(step)
    found = identify(t, q, p, mass=M)
    assert found.scheme in (None, "velocity-verlet")
    implicit = next(x for x in found.candidates if "implicit" in x.law)
    assert implicit.stiffness == pytest.approx((K,), rel=1e-9)
    assert found.stiffness is None or np.isnan(found.stiffness[0])
    assert identify(t, q, p, **STATED).scheme in (None, "velocity-verlet")


def test_two_half_steps_of_implicit_euler_are_not_a_damped_symplectic_scheme() -> None:
    def step(i: int, q: float, p: float) -> State:
        for _ in range(2):
            a = (H / 2) ** 2 * K / M
            q, p = (q + H / 2 * p / M) / (1 + a), (p - H / 2 * K * q) / (1 + a)
        return q, p

    t, q, p = march(step)
    found = identify(t, q, p, **STATED)
    assert (found.scheme, found.stride, found.fits) == ("implicit-euler", 2, True), found
    blind = identify(t, q, p, mass=M)
    assert "implicit-euler" in {x.scheme for x in blind.candidates}


def test_implicit_euler_is_listed_with_the_damped_spring_that_is_the_same() -> None:
    a = H * H * K / M
    t, q, p = march(lambda i, q, p: ((q + H * p / M) / (1 + a), (p - H * K * q) / (1 + a)))
    found = identify(t, q, p, mass=M)
    assert found.scheme == "implicit-euler"
    assert any("semi-implicit" in x for x in (*found.aliases, *found.notes))
    assert any("friction" in note and "stiffness" in note for note in found.notes)


# families ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [2, 5, 20])
def test_a_force_held_over_substeps_is_named(n: int) -> None:
    def step(i: int, q: float, p: float) -> State:
        force = -K * q
        for _ in range(n):
            p = p + H / n * force
            q = q + H / n * p / M
        return q, p

    found = identify(*march(step), **STATED)
    assert found.fits
    assert_said(found, f"held over {n} substeps")


def test_substeps_of_a_held_force_that_kick_first_in_one_oscillator_alone_are_no_scheme() -> None:
    states = []
    for kicks_first, k in ((True, K), (False, 0.7)):
        q, v, rows = 1.3, 0.25, []
        for _ in range(31):
            rows.append((q, v))
            force = -k * q / M
            for _ in range(4):
                v += kicks_first * H * force
                q += H * v
                v += (not kicks_first) * H * force
        states.append(rows)
    q, v = np.array(states).transpose(2, 1, 0)
    t = 4 * H * np.arange(31)
    each = [identify(t, q[:, j], v=v[:, j], mass=M).scheme for j in (0, 1)]
    assert (each, identify(t, q, v=v, mass=M).scheme) == (["held-force"] * 2, None)


def test_drag_that_is_linear_and_quadratic_is_told_with_its_coefficients() -> None:
    def step(i: int, q: float, p: float) -> State:
        p = p - H * (K * q + 0.05 * p / M + 0.02 * abs(p / M) * p / M)
        return q + H * p / M, p

    found = identify(*march(step), **STATED)
    assert not found.fits
    assert_said(found, "drag")
    assert any("0.05" in x and "0.02" in x for x in (found.statement, *found.notes))


# right integrators -------------------------------------------------------------------------------------


def kicked(force: Callable[[float], float], q: float, p: float, h: float = H) -> State:
    p = p + h * force(q)
    return q + h * p / M, p


def test_a_mass_let_go_from_rest_under_gravity_is_named() -> None:
    def force(q: float) -> float:
        return -K * q - M * 9.81

    for step in (lambda i, q, p: kicked(force, q, p), verlet(lambda i, q, p: force(q))):
        t, q, p = march(step, q=0.0, p=0.0)
        found = identify(t, q, p, **STATED)
        assert found.scheme in ("semi-implicit-euler", "velocity-verlet"), found.notes
        assert found.fits


CLOCKS = {
    "linspace": lambda n: np.linspace(0, n * H, n + 1),
    "arange": lambda n: np.arange(n + 1) * H,
    "accumulated": lambda n: np.concatenate([[0.0], np.cumsum(np.full(n, H))]),
}


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("frames", [200, 5000])
def test_steps_that_are_differences_of_rounded_times_are_no_misfit(clock: str, frames: int) -> None:
    t = CLOCKS[clock](frames)

    def step(i: int, q: float, p: float) -> State:
        h = t[i + 1] - t[i]
        p = p - h / 2 * K * q
        q = q + h * p / M
        return q, p - h / 2 * K * q

    _, q, p = march(step, frames)
    found = identify(t, q, p, **STATED)
    assert (found.scheme, found.stride, found.fits) == ("velocity-verlet", 1, True), found


@pytest.mark.parametrize("what", ["h", "k", "m"])
def test_a_parameter_rounded_to_single_precision_is_named_as_that(what: str) -> None:
    h, k, m = (float(np.float32(x)) if what == name else x for name, x in (("h", H), ("k", K), ("m", M)))

    def step(i: int, q: float, p: float) -> State:
        p = p - h / 2 * k * q
        q = q + h * p / m
        return q, p - h / 2 * k * q

    t, q, p = march(step)
    found = identify(t, q, p, **STATED)
    assert (found.scheme, found.fits) == ("velocity-verlet", True), found.notes
    assert any("single precision" in note for note in found.notes), found.notes


def test_times_written_in_single_precision_are_not_taken_for_text() -> None:
    h = 0.002
    states = [(0.3, 0.7)]
    for _ in range(500):
        states.append(kicked(lambda q: -400 * K * q, *states[-1], h=h))
    q, p = np.float32(np.array(states)).astype(float).T
    t = np.float32(h * np.arange(501)).astype(float)
    found = identify(t, q, v=np.float32(p / M).astype(float))
    assert found.scheme == "semi-implicit-euler"
    assert "text" not in found.precision
    assert found.step == pytest.approx(h, rel=1e-7)


def test_an_adaptive_solver_of_high_order_is_called_exact_to_within_its_error() -> None:
    from scipy.integrate import solve_ivp

    t = np.arange(201) * 0.31
    z = solve_ivp(
        lambda t, z: [z[1] / M, -K * z[0]],
        (0, t[-1]),
        [1.3, 0.9],
        method="DOP853",
        t_eval=t,
        rtol=1e-12,
        atol=1e-14,
    ).y
    found = identify(t, z[0], z[1], **STATED)
    assert not found.fits
    assert_said(found, "exact")
    assert_said(found, "adaptive")


# files with several motions ----------------------------------------------------------------------------


def run_many(acceleration: Callable[[np.ndarray], np.ndarray], q0: list[float], v0: list[float]) -> tuple:
    q, v = [np.array(q0)], [np.array(v0)]
    for _ in range(300):
        half = v[-1] + H / 2 * acceleration(q[-1])
        q.append(q[-1] + H * half)
        v.append(half + H / 2 * acceleration(q[-1]))
    return H * np.arange(301), np.array(q), np.array(v)


MANY = {
    "a free particle among bound ones": (
        lambda q: np.array([-2.1, 0.0, -1.3]) * q,
        [1.0, 0.2, 0.5],
        [0.1, 0.3, 0.2],
    ),
    "bound in x, free in y": (lambda q: np.array([-2.1, 0.0]) * q, [1.0, 0.2], [0.1, 0.3]),
    "a strongly coupled chain": (
        lambda q: -5.0 * (np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 2]]) @ q),
        [1.0, 0.2, -0.7],
        [0.1, 0.3, 0.4],
    ),
    "a drifting pair": (lambda q: -3.0 * (q - q[::-1]), [1.0, 0.0], [0.3, 0.5]),
    "a diagonal in space": (lambda q: -2.1 * q, [1.0, 1.0, 1.0], [0.2, 0.2, 0.2]),
    "a pair without a wall": (lambda q: -3.0 * (q - q[::-1]), [1.0, -1.0], [0.3, -0.3]),
}


@pytest.mark.parametrize("name", MANY)
def test_what_can_be_judged_is_judged_and_the_rest_is_said(name: str) -> None:
    acceleration, q0, v0 = MANY[name]
    t, q, v = run_many(acceleration, q0, v0)
    found = identify(t, q, v=v)
    assert (found.scheme, found.fits) == ("velocity-verlet", True), (found.statement, found.notes)


def test_a_file_of_free_particles_alone_cannot_be_judged() -> None:
    t, q, v = run_many(lambda q: 0 * q, [1.0, 0.2], [0.1, 0.3])
    with pytest.raises(IdentificationError, match=r"straight line|no force"):
        identify(t, q, v=v)


# causes ------------------------------------------------------------------------------------------------


def test_one_bad_first_frame_is_not_called_anharmonic() -> None:
    t, q, p = march(verlet(lambda i, q, p: -K * q))
    p[0] *= 1.001
    found = identify(t, q, p, **STATED)
    assert not found.fits
    assert "anharmonic" not in " ".join([found.statement, *found.notes])
    assert_said(found, "frame 0")


@pytest.mark.parametrize("spoil", ["noise", "dropped", "restart"])
def test_no_sentence_refutes_itself_or_comes_twice(spoil: str) -> None:
    t, q, p = march(verlet(lambda i, q, p: -K * q))
    if spoil == "noise":
        q = q * (1 + 1e-6 * noise[: len(q)])
    if spoil == "dropped":
        q, p, t = np.delete(q, 272), np.delete(p, 272), t[:-1]
    if spoil == "restart":
        _, q2, p2 = march(verlet(lambda i, q, p: -K * q), 200, float(f"{q[200]:.5g}"), float(f"{p[200]:.5g}"))
        q, p = np.r_[q[:201], q2[1:]], np.r_[p[:201], p2[1:]]
    found = identify(t, q, p, **STATED)
    assert not found.fits
    said = [found.statement, *found.notes]
    assert len(said) == len(set(said))
    assert not any("velocity-verlet: 1 " in x or "were 1 times" in x for x in said)
    if spoil == "dropped":
        assert_said(found, "frame 272")
    if spoil == "restart":
        assert_said(found, "frames? 20[01]")


def cut_off(i, q, p):
    return np.trunc(-K * q * 2**32) / 2**32


def in_single(i, q, p):
    return float(np.float32(-K * q))


@pytest.mark.parametrize("every", [2, 5, 10])
def test_noise_of_the_size_of_a_coarse_force_cannot_be_excluded_many_steps_apart(every: int) -> None:
    t, q, p = march(verlet(lambda i, q, p: -K * q + 2.0**-33 * noise[i]), 1000)
    found = identify(t[::every], q[::every], p[::every], **STATED)
    assert not found.fits
    assert found.undecided or found.verdict == "none"


@pytest.mark.parametrize("every", [1, 2, 5, 10])
@pytest.mark.parametrize(("force", "precision"), [(cut_off, "fixed-point force"), (in_single, "mixed")])
def test_a_coarse_force_is_certain_many_steps_apart_too(force, precision: str, every: int) -> None:
    # the steps are redone with such forces
    t, q, p = march(verlet(force), 1000)
    found = identify(t[::every], q[::every], p[::every], **STATED)
    assert (found.scheme, found.stride, found.precision, found.fits) == (
        "velocity-verlet", every, precision, True,
    )  # fmt: skip
    assert not found.undecided


def test_a_fixed_point_force_finer_than_the_forces_that_are_read_is_redone() -> None:
    # forces read off these states would show single precision, and do not show quanta of 2**-32
    m, k, h = 1.444, 4840.8626488727405, 0.0051632965040869575
    q, v, rows = -0.05, 6.0, []
    for _ in range(101):
        rows.append((q, v))
        v += h / 2 * (np.rint(-k * q * 2**32) / 2**32) / m
        q += h * v
        v += h / 2 * (np.rint(-k * q * 2**32) / 2**32) / m
    positions, velocities = np.array(rows).T
    found = identify(h * np.arange(101), positions, v=velocities, mass=m, stiffness=k)
    assert (found.scheme, found.precision, found.fits) == ("velocity-verlet", "fixed-point force", True)


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize(("force", "precision"), [(cut_off, "fixed-point force"), (in_single, "mixed")])
def test_a_coarse_force_of_position_verlet_is_no_noise(force, precision: str, every: int) -> None:
    # the implicit midpoint rule has the same map on a spring of another stiffness
    q, p, rows = 0.3, 0.2 * M, []
    for i in range(303):
        rows.append((q, p))
        q += H / 2 * p / M
        p += H * force(i, q, p)
        q += H / 2 * p / M
    t, (q_, p_) = H * np.arange(0, 303, every), np.array(rows[::every]).T
    found = identify(t, q_, p_, **STATED)
    assert (found.scheme, found.stride, found.precision, found.fits) == (
        "position-verlet", every, precision, True,
    )  # fmt: skip
    unstated = identify(t, q_, p_, mass=M)
    assert {x.scheme for x in unstated.candidates} == {"position-verlet", "implicit-midpoint"}


@pytest.mark.parametrize("m", [1e-50, 1e-20, 1e-12, 1e42])
def test_noise_of_a_force_far_below_a_quantum_is_no_arithmetic(m: float) -> None:
    rng = np.random.default_rng(1)
    q, v, states = 0.3, 0.2, [(0.3, 0.2)]
    pull = -K / M * q
    for _ in range(400):
        v += H / 2 * pull
        q += H * v
        pull = -K / M * q * (1 + 1e-7 * rng.standard_normal())
        v += H / 2 * pull
        states.append((q, v))
    positions, velocities = np.array(states).T
    found = identify(H * np.arange(401), positions, v=velocities, mass=m)
    assert not found.fits
    assert "arithmetic explains" not in found.statement


@pytest.mark.parametrize(("digits", "words"), [(4, "over 12 substeps"), (3, "over 11 to 13 substeps")])
def test_a_number_of_substeps_that_digits_do_not_tell_is_a_range(digits: int, words: str) -> None:
    q, v, rows = 1.0, 0.0, []
    for _ in range(101):
        rows.append((q, v))
        force = -q
        for _ in range(12):
            v += 0.05 / 12 * force
            q += 0.05 / 12 * v
    q_, v_ = (np.array([float(f"{x:.{digits}g}") for x in row]) for row in np.array(rows).T)
    found = identify(0.05 * np.arange(101), q_, v=v_, mass=1.0)
    assert found.fits
    assert_said(found, words)


def test_a_stiffness_that_wobbles_is_found_in_a_long_file_in_little_memory() -> None:
    step = verlet(lambda i, q, p: -K * q * (1 + 1e-6 * np.sin(0.037 * i)))
    t, q, p = march(step, 4000)
    tracemalloc.start()
    found = identify(t, q, p, **STATED)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert "stiffness changes in time" in found.statement
    assert most < 5000 * len(t), "bytes, of which a frame needs few"


def written(x: np.ndarray, digits: int) -> np.ndarray:
    return np.array([float(f"{y:.{digits}g}") for y in x])


@pytest.mark.parametrize(("substeps", "h", "frames", "digits"), [(3, 0.0678, 5, 3), (4, 0.05, 10, 3)])
def test_few_frames_of_few_digits_do_not_tell_substeps_from_steps(substeps, h, frames, digits) -> None:
    rng, judged = np.random.default_rng(1), 0
    for _ in range(10):
        q, v = rng.standard_normal(2)
        rows = []
        for _ in range(frames):
            rows.append((q, v))
            force = -q
            for _ in range(substeps):
                v += h / substeps * force
                q += h / substeps * v
        q_, v_ = np.array(rows).T
        try:
            found = identify(h * np.arange(frames), written(q_, 5), v=written(v_, digits), mass=1.0)
        except IdentificationError:
            continue
        assert "held-force" in {x.scheme for x in found.candidates}, found.statement
        judged += 1
    assert judged > 5


def test_few_frames_about_an_equilibrium_away_from_0_are_no_friction() -> None:
    rng = np.random.default_rng(2)
    step = np.linalg.inv([[1, -0.05], [0.05, 1]]) @ [[1, 0.05], [-0.05, 1]]
    for _ in range(20):
        z = [rng.standard_normal(2)]
        for _ in range(4):
            z.append(step @ z[-1])
        q, v = np.array(z).T
        found = identify(0.1 * np.arange(5), written(q - 3.9, 8), v=written(v, 7), mass=1.0, stiffness=1.0)
        assert "implicit-midpoint" in {x.scheme for x in found.candidates}, found.statement
        assert not any(any(x.friction) for x in found.candidates)


def test_a_clock_that_adds_up_twelve_steps_to_a_frame_is_even() -> None:
    h, t, q, v, rows = 0.9, 0.0, 1.0, 0.0, []
    for i in range(1201):
        if i % 12 == 0:
            rows.append((t, q, v))
        later = t + h
        v -= (later - t) * 0.01 * q
        q += (later - t) * v
        t = later
    t_, q_, v_ = np.array(rows).T
    found = identify(t_, q_, v=v_, mass=1.0, stiffness=0.01)
    assert (found.scheme, found.stride, found.fits) == ("semi-implicit-euler", 12, True)


@pytest.mark.parametrize("digits", [10, 12, 14, 15, 16])
@pytest.mark.parametrize("frames", [401, 1001, 4001])
def test_a_clock_that_adds_up_and_is_written_as_text_keeps_its_step(digits: int, frames: int) -> None:
    m, k, h = 3.7, 2.9, 0.1
    t, q, v = 0.0, 0.3, 0.7 / m
    rows = []
    for _ in range(frames):
        rows.append([float(f"{x:.{digits}g}") for x in (t, q, v)])
        v = v + h / 2 * (-k * q / m)
        q = q + h * v
        v = v + h / 2 * (-k * q / m)
        t += h
    times, positions, velocities = np.array(rows).T
    found = identify(times, positions[:, None], v=velocities[:, None], mass=np.array([m]))
    assert found.scheme == "velocity-verlet"
    # of 16 digits times are doubles, whose sum is no longer known to the bit
    assert abs(found.step / h - 1) < (1e-12 if digits == 16 else 1e-16)


def test_times_of_six_digits_beyond_1000_are_even() -> None:
    """Up to 1000 they have three decimals and show the whole step, from there on two, as C++ prints them."""
    written = np.array([float(f"{0.405 * i:.6g}") for i in range(2700)])
    found = clock_of(written)
    assert abs(float(found.interval) / 0.405 - 1) <= found.jitter
    assert found.jitter < 1e-4
    with pytest.raises(IdentificationError, match=r"2601 and 2602 are 0\.82"):
        clock_of(np.delete(written, 2602))


@pytest.mark.parametrize("recorded", ["its own clock", "i h"])
@pytest.mark.parametrize("h", [0.1, 0.013])
def test_a_program_that_steps_to_i_h_is_named(recorded: str, h: float) -> None:
    """REBOUND's `integrate(i h)`: a last step that is shortened, or one of a rounding more, in halves."""
    t, q, v, frames = 0.0, 0.3, 0.19, [(0.0, 0.3, 0.19)]
    for i in range(1, 401):
        while i * h - t > 2.0**-52 * i * h:
            dt = min(h, i * h - t)
            q, t = q + dt / 2 * v, t + dt / 2
            v = v - dt * (K / M * q)
            q, t = q + dt / 2 * v, t + dt / 2
        frames.append((t, q, v))
    t_all, q_all, v_all = np.array(frames).T
    assert not np.array_equal(t_all, h * np.arange(401))
    t_all = t_all if recorded != "i h" else h * np.arange(401)
    found = identify(t_all, q_all, v=v_all, **STATED)
    assert (found.scheme, found.stride, found.fits, found.precision) == ("position-verlet", 1, True, "double")
    assert "position-verlet" in [x.scheme for x in identify(t_all, q_all, v=v_all).candidates]
    # a step that is longer by 1e-12, every other time, is none of a clock's roundings
    wrong = v_all * (1 + 1e-12 * (-1.0) ** np.arange(401))
    found = identify(t_all, q_all, v=wrong, **STATED)
    assert not found.fits
    assert_said(found, "Even and odd steps differ and alternate")


@pytest.mark.parametrize("stride", [1, 5])
def test_friction_of_the_half_steps_velocity_is_named_by_its_first_step_too(stride: int) -> None:
    """LAMMPS' `fix viscous`: the force has the friction of the velocity half a step ago, and of the first
    velocity in the first step."""
    g, q, v = 0.05, 0.3, 0.19
    a, frames = -K / M * q - g * v, [(q, v)]
    for i in range(100 * stride):
        v = v + H / 2 * a
        q = q + H * v
        a = -K / M * q - g * v
        v = v + H / 2 * a
        frames += [(q, v)] if (i + 1) % stride == 0 else []
    q_all, v_all = np.array(frames).T
    found = identify(H * stride * np.arange(101), q_all, v=v_all, **STATED, friction=g * M)
    assert (found.scheme, found.fits, found.stride) == ("velocity-verlet", True, stride), found
    assert "of the velocity half a step ago" in found.statement
    assert found.friction[0] == pytest.approx(g, rel=1e-9)
    blind = identify(H * stride * np.arange(101), q_all, v=v_all)
    assert {x.scheme for x in blind.candidates} == {"velocity-verlet"}
    v_all[0] *= 1 + 1e-9
    wrong = identify(H * stride * np.arange(101), q_all, v=v_all, **STATED)
    assert not wrong.fits
    assert "frame 0 does not belong to it" in wrong.statement
    assert "BBK" not in wrong.statement


@pytest.mark.parametrize(
    ("there", "stated", "said"),
    [
        (0.08, 0.02, "friction 4 to 4.0"),
        (0.08, 0.0, "with a friction, c = 0.08 to 0.08"),
        (0.0, 1.0, "without friction, where c = 1 is stated"),
        (0.08, 0.08, ""),
    ],
)
def test_a_stated_friction_that_does_not_fit_stands_in_the_first_sentence(
    there: float, stated: float, said: str
) -> None:
    q, v, frames = 0.3, 0.19, [(0.3, 0.19)]
    for _ in range(300):
        v = (v - H / 2 * K / M * q) * np.exp(-there / M * H)
        q = q + H * v
        v = v - H / 2 * K / M * q
        frames.append((q, v))
    q_all, v_all = np.array(frames).T
    found = identify(H * np.arange(301), q_all, v=v_all, **STATED, friction=stated)
    assert found.scheme == "velocity-verlet"
    assert found.fits == (not said)
    assert found.statement.startswith("Velocity Verlet, but " if said else "Velocity Verlet with exponential")
    assert said in found.statement
    assert str(found).startswith(f"the states: {found.statement[:40]}" if said else "the states: velocity")


def test_velocities_that_follow_from_positions_alone_are_called_that() -> None:
    t, q, _ = march(verlet(lambda i, q, p: -K * q))
    for v, said in ((0 * q, "do not change"), (0.5 * q, "0.5 times its positions")):
        with pytest.raises(IdentificationError, match=said):
            identify(t, q, v=v)
    with pytest.raises(IdentificationError, match="one exponential, as of an overdamped or unstable motion"):
        identify(t, np.exp(-0.3 * t), v=-0.3 * np.exp(-0.3 * t))


def test_a_stepper_that_fails_names_its_line_and_one_of_arrays_is_taken() -> None:
    def fails(q: float, p: float, h: float, force: Callable[..., float], mass: float) -> tuple[float, float]:
        return {"q": q}["x"], p

    def of_arrays(q: np.ndarray, p: np.ndarray, h: float, force: Callable[..., float], mass: float) -> object:
        if not isinstance(q, np.ndarray):
            raise ValueError("arrays alone")
        p = p + h * force(q)
        return q + h * p / mass, p

    where = re.escape(f"KeyError: 'x' (test_identify_hard.py, line {fails.__code__.co_firstlineno + 1})")
    with pytest.raises(MethodError, match=where):
        identify_stepper(fails)
    assert identify_stepper(of_arrays).scheme == "semi-implicit-euler"


def test_more_steps_to_a_frame_than_are_looked_at_are_no_unknown_scheme_and_the_step_names_it() -> None:
    h, every, w2 = 0.23, 150, 1.7
    q, v, frames = 1.0, 0.3, [(1.0, 0.3)]
    for i in range(30 * every):
        v -= h / 2 * w2 * q
        q += h * v
        v -= h / 2 * w2 * q
        if i % every == every - 1:
            frames.append((q, v))
    states = np.array(frames).T
    t = np.arange(31) * h * every
    found = identify(t, states[0], v=states[1], mass=1.0)
    assert "none of the known schemes' in up to 100 steps to a frame" in found.statement
    assert "state the step" in found.explanations[0].remedy
    assert identify(t, states[0], v=states[1], mass=1.0, step=h).scheme == "velocity-verlet"


def test_a_full_second_kick_in_the_textbook_form_is_no_friction_of_a_right_scheme() -> None:
    """Its loss of area is h k/(2 m), which friction of two laws explains entry for entry, at other rates."""
    h, w2, q, v = 0.1, 2.9 / 3.7, 1.0, 0.3
    frames = [(q, v)]
    for _ in range(200):
        q = q + v * h - 0.5 * w2 * q * h * h
        v = v - w2 * q * h
        frames.append((q, v))
    states = np.array(frames).T
    found = identify(np.arange(201) * h, states[0], v=states[1], mass=3.7, stiffness=2.9)
    assert found.verdict == "none"
    assert "h k/(2 m): the mark of a scheme that is written down wrongly" in found.statement


@pytest.mark.parametrize("force", [lambda q: 0.8 * q + 0.05 * q**3, lambda q: 0.8 * np.sin(q)])
def test_an_anharmonic_motion_is_no_drive_at_its_own_harmonics(force: Any) -> None:
    h, q, v = 0.1, 0.9, 0.3
    frames = [(q, v)]
    for _ in range(400):
        v -= h / 2 * force(q)
        q += h * v
        v -= h / 2 * force(q)
        frames.append((q, v))
    states = np.array(frames).T
    found = identify(np.arange(401) * h, states[0], v=states[1], mass=1.0)
    assert "anharmonic" in found.statement
    assert "time" not in found.statement


@pytest.mark.parametrize("raised", [SystemExit(0), GeneratorExit(), BaseException("odd")])
def test_a_stepper_that_leaves_by_whatever_exception_is_told_in_a_line(raised: BaseException) -> None:
    def step(*_: Any) -> Any:
        raise raised

    with pytest.raises(MethodError, match=f"failed at q=.*{type(raised).__name__}"):
        identify_stepper(step)


def of_explicit_euler(m: list[float], k: list[float], rest: list[float], q: list[float], p: list[float],
                      h: float, frames: int, cubic: float = 0.0) -> Identification:  # fmt: skip
    """Identify explicit Euler of particles each joined to the next, and by a cubic force to 0."""
    states = [(np.array(q), np.array(p))]
    mass = np.array(m)
    for _ in range(frames):
        at, moving = states[-1]
        pulls = np.array(k) * (np.diff(at) - rest)
        force = np.append(pulls, 0) - np.append(0, pulls) - cubic * at**3
        states.append((at + h * moving / mass, moving + h * force))
    return identify(h * np.arange(frames + 1), *np.swapaxes(states, 0, 1), mass=mass)


PAIR = {"m": [2.3, 1.1], "k": [3.9], "rest": [1.3], "q": [0.1, 1.6], "p": [0.7, -0.2], "h": 0.11}
CARBON_MONOXIDE = {
    "m": [12.011, 15.999], "k": [1.143e6], "rest": [0.1128], "q": [0.0, 0.1188], "p": [1.7, -0.4],
    "h": 0.0007,
}  # fmt: skip
THREE = {
    "m": [2.3, 0.7, 5.7], "k": [32.1, 11.1], "rest": [0.9, 1.2], "q": [0.3, 1.3, 2.3],
    "p": [-0.5, 0.25, 0.25], "h": 0.08,
}  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "frames", "omega"),
    [(PAIR, 600, 2.28934635199), (PAIR, 1500, 2.28934635199), (CARBON_MONOXIDE, 900, 408.172429968),
     (THREE, 100, 8.54343629), (THREE, 300, 8.54343629), (THREE, 900, 8.54343629)],
)  # fmt: skip
def test_of_a_motion_that_grows_small_modes_have_the_roundings_of_the_large(
    scene: dict[str, Any], frames: int, omega: float
) -> None:
    """One mode grows by up to 1e75, and the coordinates' roundings with it."""
    found = of_explicit_euler(**scene, frames=frames)
    assert found.scheme == "explicit-euler"
    assert found.precision == "double"
    assert max(found.omega) == pytest.approx(omega, rel=2e-9 if scene is THREE else 2e-12)
    assert found.explanations == ()


@pytest.mark.parametrize(
    ("name", "h", "frames"), [("explicit-euler", 0.6, 270), ("velocity-verlet", 1.3, 90)]
)
def test_a_motion_about_a_rest_away_from_0_is_named_however_large_it_grows(
    name: str, h: float, frames: int
) -> None:
    """To 1e40: what the first frames show of the rest is far below the roundings of the last."""
    m, k, rest = 2.3, 7.1, -1.6
    states = [(-1.1, 2.3)]
    for _ in range(frames):
        q, v = states[-1]
        before = -k * (q - rest) / m
        if name == "explicit-euler":
            states.append((q + h * v, v + h * before))
        else:
            q = q + h * v + h * h / 2 * before
            states.append((q, v + h / 2 * (before - k * (q - rest) / m)))
    q_all, v_all = np.array(states).T
    found = identify(h * np.arange(frames + 1), q_all, v=v_all, mass=m)
    assert 1e38 < np.max(np.abs(q_all)) < 1e44
    assert (found.scheme, found.fits, found.precision) == (name, True, "double"), found
    assert found.stiffness == pytest.approx([k], rel=1e-12)
    with pytest.raises(IdentificationError, match="of an unstable motion the part before"):
        identify(h * np.arange(frames + 1), 1e40 * q_all, v=1e40 * v_all, mass=m)


def test_one_bad_frame_of_a_motion_that_grows_is_no_dry_friction() -> None:
    """The velocity reverses in it, and friction has no direction there: rounding is left."""
    m, k, rest, h = 2.3, 7.1, 0.83, 0.6
    states = [(1.3, 0.2)]
    for _ in range(100):
        q, v = states[-1]
        states.append((q + h * v, v - h * k * (q - rest) / m))
    q_all, v_all = np.array(states).T
    q_all[20] *= 1 + 1e-6
    found = identify(h * np.arange(101), q_all, v=v_all, mass=m)
    assert "frame 20 is wrong" in found.statement


@pytest.mark.parametrize("cubic", [1e-6, 1e-13])
def test_a_small_cubic_force_is_seen_in_a_motion_that_grows(cubic: float) -> None:
    """Its part grows to 1e-9 of the linear force's, at the least."""
    found = of_explicit_euler(**PAIR, frames=300, cubic=cubic)
    assert found.scheme is None
    assert found.explanations


def test_what_is_off_in_a_few_frames_is_measured_by_the_size_of_a_growing_motion_there() -> None:
    """It grows by 1e75, so that its last frames alone show: no restart among them is told of."""
    found = of_explicit_euler(**THREE, frames=900)
    assert "not from frame" not in found.statement
