"""One case for each row: whatever made the states, the answer is that row, and never another.

Trajectories are made by loops of this file, or by `schemes.step`, from numbers that are not 1.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from springcheck.errors import IdentificationError
from springcheck.identify import Identification, identify
from springcheck.identify.catalogue import (
    FAULTS,
    FRICTION,
    KNOWN_ELSEWHERE,
    PLACES,
    PLAIN,
    STEPS,
    TABLEAUX,
    WRONG_SIGN,
    aliases,
)  # fmt: skip
from springcheck.identify.rows import Row
from springcheck.identify.tables import unit
from springcheck.physics.arrays import Floats
from springcheck.schemes import SCHEMES, step

M, K, H, C = 3.7, 2.9, 0.31, 0.47
Q0, V0 = 1.3, 0.7
Step = Callable[[float, float], tuple[float, float]]


def force(q: Any) -> Any:
    return -K * q


def march(act: Step, frames: int = 120, every: int = 1) -> tuple[Floats, Floats, Floats]:
    """Times, positions and velocities of a step (q, v) -> (q, v)."""
    q, v = Q0, V0
    states = [(q, v)]
    for i in range(1, frames * every):
        q, v = act(q, v)
        if i % every == 0:
            states.append((q, v))
    x = np.array(states)
    return np.arange(len(x)) * H * every, x[:, 0], x[:, 1]


def of_row(row: Row, g: float = 0.0) -> Step:
    """The step of a row on the spring, by its matrix in double precision."""
    m = unit(row, np.array([H * H * K / M]), np.array([g]))[0].astype(float)

    def act(q: float, v: float) -> tuple[float, float]:
        return m[0, 0] * q + m[0, 1] * H * v, m[1, 0] * q / H + m[1, 1] * v

    return act


def said(act: Step, every: int = 1, **stated: Any) -> Identification:
    t, q, v = march(act, every=every)
    return identify(t, q, v=v, **{"mass": M, "stiffness": K, **stated})


@pytest.mark.parametrize("name", [row.scheme for row in PLAIN if SCHEMES[row.scheme].has("one-step")])
@pytest.mark.parametrize("every", [1, 3])
def test_every_scheme_is_named_from_its_steps(name: str, every: int) -> None:
    scheme, m = SCHEMES[name], np.array([M])

    def act(q: float, v: float) -> tuple[float, float]:
        out = step(
            scheme, np.array([q]), np.array([M * v]), h=H, m=m, force=lambda q, p: -K * q,
            stiffness=np.array([K]),
        )  # fmt: skip
        return float(out[0][0]), float(out[1][0]) / M

    found = said(act, every)
    assert name in (found.scheme, *found.aliases), str(found)
    assert found.fits
    assert found.stride == every
    assert found.stiffness == pytest.approx((K,), rel=1e-9)


@pytest.mark.parametrize("row", KNOWN_ELSEWHERE, ids=lambda row: row.scheme)
def test_schemes_that_others_run_are_named(row: Row) -> None:
    found = said(of_row(row))
    assert {row.scheme, *row.also} & {str(found.scheme), *found.aliases}, str(found)
    assert found.fits


@pytest.mark.parametrize("row", FRICTION, ids=lambda row: f"{row.scheme}, {row.law}")
def test_friction_is_named_wherever_it_acts(row: Row) -> None:
    found = said(of_row(row, H * C / M))
    names = {x.scheme for x in found.candidates} | {y for x in found.candidates for y in x.aliases}
    assert row.scheme in names, str(found)
    assert found.fits
    assert found.determinant[0] < 1 or row.scheme in ("explicit-euler", "rk2-midpoint")


def test_a_stated_friction_is_compared() -> None:
    damped = next(row for row in FRICTION if row.scheme == "velocity-verlet" and "explicit" in row.law)
    right = said(of_row(damped, H * C / M), friction=C)
    assert right.fits
    assert right.friction[0] * M == pytest.approx(C, rel=1e-9)
    twice = said(of_row(damped, 2 * H * C / M), friction=C)
    assert not twice.fits
    assert "friction" in twice.statement
    assert "2 times" in twice.statement


MISTAKES = [(text, of) for _, text, _, of in STEPS]


@pytest.mark.parametrize(("text", "of"), MISTAKES, ids=[text[:50] for text, _ in MISTAKES])
def test_every_mistake_in_a_step_has_its_sentence(text: str, of: Any) -> None:
    row = next(row for row in FAULTS if row.fault == text)
    found = said(of_row(row))
    assert found.verdict == "none"
    assert found.statement.startswith(text)
    assert found.explanations[0].remedy == row.remedy


def test_the_old_force_in_the_second_half_kick_is_no_constant_force() -> None:
    """By a loop of its own."""

    def act(q: float, v: float) -> tuple[float, float]:
        a = force(q) / M
        v = v + H / 2 * a
        return q + H * v, v + H / 2 * a

    assert said(act).statement.startswith("Velocity Verlet whose second half kick uses the old force")


def tableau(a: Any, b: Any) -> Step:
    """A Runge-Kutta method, by its stages."""

    def act(q: float, v: float) -> tuple[float, float]:
        slopes: list[tuple[float, float]] = []
        for row in a:
            x = q + H * sum(float(Fraction(c)) * s[0] for c, s in zip(row, slopes, strict=False))
            u = v + H * sum(float(Fraction(c)) * s[1] for c, s in zip(row, slopes, strict=False))
            slopes.append((u, force(x) / M))
        w = [float(Fraction(c)) for c in b]
        return (
            q + H * sum(c * s[0] for c, s in zip(w, slopes, strict=True)),
            v + H * sum(c * s[1] for c, s in zip(w, slopes, strict=True)),
        )

    return act


@pytest.mark.parametrize(("text", "a", "b"), TABLEAUX, ids=[text for text, _, _ in TABLEAUX])
def test_every_mistake_in_a_tableau_has_its_sentence(text: str, a: Any, b: Any) -> None:
    found = said(tableau(a, b))
    assert text.casefold() in found.statement.casefold(), str(found)


@pytest.mark.parametrize("row", WRONG_SIGN, ids=lambda row: row.scheme)
def test_a_friction_of_the_wrong_sign_shows_where_the_stiffness_is_stated(row: Row) -> None:
    assert "wrong sign" in said(of_row(row, H * C / M)).statement


def verlet(q: float, v: float) -> tuple[float, float]:
    v = v + H / 2 * force(q) / M
    q = q + H * v
    return q, v + H / 2 * force(q) / M


def kick_drift(q: float, v: float) -> tuple[float, float]:
    v = v + H * force(q) / M
    return q + H * v, v


def test_a_force_held_over_substeps_is_named_with_their_number() -> None:
    def act(q: float, v: float) -> tuple[float, float]:
        a = force(q) / M
        for _ in range(5):
            v = v + H / 5 * a
            q = q + H / 5 * v
        return q, v

    found = said(act)
    assert found.scheme == "held-force"
    assert "5 substeps" in found.statement


Spoil = Callable[[Floats, Floats, Floats], tuple[Floats, Floats, Floats]]


def exchanged(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    return t, v, q


def late(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    return t[1:], q[1:], v[:-1]


def ahead(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    return t[:-1], q[:-1], v[1:]


def repeated(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    return t, *(np.concatenate([x[:40], x[39:-1]]) for x in (q, v))


def missing(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    return t[:-1], *(np.delete(x, 40) for x in (q, v))


def kicked(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    a, b = q.copy(), v.copy()
    b[40] += 0.01
    for i in range(41, len(q)):
        a[i], b[i] = verlet(a[i - 1], b[i - 1])
    return t, a, b


def against(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    return t, q, -v


def as_momenta(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    return t, q, M * v


def wrong_frame(t: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
    q = q.copy()
    q[40] += 0.3
    return t, q, v


SPOILED: tuple[tuple[Spoil, str], ...] = (
    (exchanged, "exchanged"), (late, "one step behind"), (ahead, "one step ahead"),
    (repeated, "repeated at frame 40"), (missing, "frame 40 is missing"), (kicked, "one kick"),
    (against, "wrong sign"), (as_momenta, "multiplied by the mass"), (wrong_frame, "frame 40 is wrong"),
)  # fmt: skip


@pytest.mark.parametrize(("spoil", "word"), SPOILED, ids=lambda x: getattr(x, "__name__", ""))
def test_a_spoiled_record_is_told_by_what_happened(spoil: Spoil, word: str) -> None:
    t, q, v = spoil(*march(verlet))
    found = identify(t, q, v=v, mass=M, stiffness=K)
    assert found.verdict == "none"
    assert word in found.statement, found.statement


def test_positions_in_a_box_are_told_to_be_wrapped() -> None:
    t, q, v = march(verlet)
    found = identify(t, q - 1.5 * np.floor(q / 1.5 + 0.5), v=v, mass=M)
    assert "wrapped into a box of about 1.5" in found.statement


FACTORS = (
    (0.5, "k/2 q**2"), (4.184, "kJ"), (1 / 4.184, "kcal"), (M, "mass is left out"),
    (1 / M, "divided by the mass"), (K, "squared"), (1 / K, "stiffness is left out"), (-1.0, "wrong sign"),
    (100.0, "another unit"),
)  # fmt: skip


@pytest.mark.parametrize(("factor", "word"), FACTORS)
def test_a_stiffness_off_by_a_factor_is_told_with_its_meaning(factor: float, word: str) -> None:
    def act(q: float, v: float) -> tuple[float, float]:
        v = v + H / 20 / 2 * factor * force(q) / M
        q = q + H / 20 * v
        return q, v + H / 20 / 2 * factor * force(q) / M

    t, q, v = march(act, frames=60 if factor < 0 else 120)
    found = identify(t / 20, q, v=v, mass=M, stiffness=K)
    assert not found.fits
    assert word in found.statement, found.statement


def test_on_a_unit_spring_a_small_error_of_the_stiffness_is_only_that() -> None:
    """Where m = k = 1 a ratio of 1 + 4e-6 is near every power of them."""
    t = np.arange(150) * 0.1
    q, v = np.empty(150), np.empty(150)
    q[0], v[0] = 1.0, 0.3
    for i in range(1, 150):
        half = v[i - 1] - 0.05 * (1 + 4e-6) * q[i - 1]
        q[i] = q[i - 1] + 0.1 * half
        v[i] = half - 0.05 * (1 + 4e-6) * q[i]
    found = identify(t, q, v=v, mass=1.0, stiffness=1.0)
    assert not found.fits
    assert "4.0e-06" in found.statement or "1.000004" in found.statement
    assert "left out" not in found.statement


@pytest.mark.parametrize(
    ("law", "word"),
    [(lambda q, v, i: 0.05 * q**3, "anharmonic"), (lambda q, v, i: 0.1 * abs(v) * v, "drag"),
     (lambda q, v, i: 0.05 * np.sign(v), "ry"), (lambda q, v, i: -0.2 * np.cos(0.83 * i * H), "driv")],
)  # fmt: skip
def test_laws_that_are_not_linear_are_told(law: Any, word: str) -> None:
    q, v, states = Q0, V0, [(Q0, V0)]
    for i in range(400):
        v = v + H / 5 * (force(q) - law(q, v, i / 5)) / M
        q = q + H / 5 * v
        states.append((q, v))
    x = np.array(states)
    found = identify(np.arange(401) * H / 5, x[:, 0], v=x[:, 1], mass=M)
    assert not found.fits
    assert word in found.statement, found.statement


def test_noise_is_noise() -> None:
    rng = np.random.default_rng(3)
    q, v, states = Q0, V0, [(Q0, V0)]
    for _ in range(300):
        q, v = verlet(q, v)
        v += 1e-6 * rng.standard_normal()
        states.append((q, v))
    x = np.array(states)
    found = identify(np.arange(301) * H, x[:, 0], v=x[:, 1], mass=M)
    assert not found.fits
    assert found.scheme is None
    assert "oise" in found.statement


WRITTEN: tuple[tuple[str, Callable[[Floats], Floats]], ...] = (
    ("double", lambda x: x), ("single", lambda x: x.astype(np.float32).astype(float)),
    ("15 digits", lambda x: np.array([float(f"{y:.15g}") for y in x])),
    ("8 digits", lambda x: np.array([float(f"{y:.8g}") for y in x])),
    ("6 decimals", lambda x: np.array([float(f"{y:.6f}") for y in x])),
    ("half", lambda x: x.astype(np.float16).astype(float)),
)  # fmt: skip


@pytest.mark.parametrize(("name", "written"), WRITTEN, ids=[x for x, _ in WRITTEN])
def test_numbers_of_any_resolution_show_the_scheme(name: str, written: Callable[[Floats], Floats]) -> None:
    t, q, v = march(verlet)
    found = identify(t, written(q), v=written(v), mass=M, stiffness=K)
    names = {x.scheme for x in found.candidates} | {y for x in found.candidates for y in x.aliases}
    assert "velocity-verlet" in names, str(found)
    assert found.fits or found.undecided or "not known here" in found.statement


def test_steps_that_follow_differences_of_rounded_times_are_those_of_the_scheme() -> None:
    """R's deSolve takes h = t[i + 1] - t[i], and tables have 15 digits."""
    t = np.arange(200) * 0.05
    q, v, states = Q0, V0, [(Q0, V0)]
    for h in np.diff(t):
        q, v = q + h * v, v + h * force(q) / M
        states.append((q, v))
    x = np.array([[float(f"{y:.15g}") for y in row] for row in states])
    found = identify(t, x[:, 0], v=x[:, 1], mass=M, stiffness=K)
    assert found.scheme == "explicit-euler", str(found)


def test_coupled_oscillators_are_judged_by_their_modes() -> None:
    k = np.array([[5.1, -1.3, 0.0], [-1.3, 4.2, -0.7], [0.0, -0.7, 3.9]])
    m, q, p = np.array([1.7, 0.9, 2.3]), np.array([0.4, -0.2, 0.3]), np.array([0.1, 0.5, -0.4])
    states = [(q, p)]
    for _ in range(200):
        p = p - 0.1 / 2 * k @ q
        q = q + 0.1 * p / m
        p = p - 0.1 / 2 * k @ q
        states.append((q, p))
    x = np.array(states)
    found = identify(np.arange(201) * 0.1, x[:, 0], x[:, 1], mass=m)
    assert "velocity-verlet" in (found.scheme, *found.aliases), str(found)
    assert any("normal modes" in note for note in found.notes)


REFUSED: tuple[tuple[str, Any, Any, Any, str], ...] = (
    ("rest", np.arange(9) * 0.1, np.full(9, 2.0), np.zeros(9), "rest"),
    ("one state", np.arange(9) * 0.1, np.full(9, 2.0), np.full(9, 0.3), "same state"),
    ("few", np.arange(3) * 0.1, np.arange(3.0), np.ones(3), "few"),
    ("straight", np.arange(9) * 0.1, np.arange(9) * 0.03, np.full(9, 0.3), "straight"),
    ("not finite", np.arange(9) * 0.1, np.append(np.arange(8.0), np.nan), np.ones(9), "not finite"),
    ("uneven", np.array([0, 0.1, 0.2, 0.35, 0.45, 0.55, 0.65]), np.arange(7.0), np.ones(7), "interval"),
)  # fmt: skip


@pytest.mark.parametrize(("name", "t", "q", "v", "word"), REFUSED, ids=[x[0] for x in REFUSED])
def test_what_shows_nothing_is_refused_with_the_reason(name: str, t: Any, q: Any, v: Any, word: str) -> None:
    with pytest.raises(IdentificationError, match=word):
        identify(t, q, v=v)


def test_the_report_begins_with_the_name_and_the_steps() -> None:
    t, q, v = march(kick_drift, every=2)
    text = str(identify(t, q, v=v, mass=M, stiffness=K))
    assert text.splitlines()[0] == "the states: semi-implicit-euler, 2 steps per frame"


def test_a_document_is_plain() -> None:
    t, q, v = march(verlet)
    found = identify(t, q, v=v, mass=M, stiffness=K).document()
    assert found["scheme"] == "velocity-verlet"
    assert found["stiffness"] == pytest.approx(K)
    assert found["candidates"][0]["stride"] == 1


def test_positions_alone_say_what_they_leave_open() -> None:
    t, q, _ = march(verlet)
    found = identify(t, q)
    assert found.scheme is None
    names = {x.scheme for x in found.candidates} | {y for x in found.candidates for y in x.aliases}
    assert "velocity-verlet" in names
    assert any("positions alone" in note for note in found.notes)


def test_places_of_friction_are_of_known_schemes() -> None:
    assert {name for name, _, _ in PLACES} <= set(SCHEMES)
    assert all(isinstance(aliases(row), tuple) for row in PLAIN)
