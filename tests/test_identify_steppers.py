"""Steppers that a spring does not tell apart: schemes of one map there, parameters that are none, memory.

On a linear force every explicit two-stage method of second order is one map, as is every four-stage one of
fourth; a step on another force tells them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

import springcheck
from springcheck import doors
from springcheck.errors import MethodError
from springcheck.identify import identify_stepper
from springcheck.schemes import UNKNOWN

Force = Callable[..., Any]


def heun(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    q1, p1 = q + h * p / m, p + h * force(q)
    return q + h / 2 * (p + p1) / m, p + h / 2 * (force(q) + force(q1))


def midpoint(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    q1, p1 = q + h / 2 * p / m, p + h / 2 * force(q)
    return q + h * p1 / m, p + h * force(q1)


def ralston(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    q1, p1 = q + 2 * h / 3 * p / m, p + 2 * h / 3 * force(q)
    return q + h * (p + 3 * p1) / 4 / m, p + h * (force(q) + 3 * force(q1)) / 4


def trapezoidal(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    q1, begun = q, q + h * p / m + h * h / 4 * force(q) / m
    for _ in range(200):
        q1 = begun + h * h / 4 * force(q1) / m
    return q1, p + h / 2 * (force(q) + force(q1))


def rule_of_three_eighths(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    a, b = p / m, force(q)
    c, d = (p + h * b / 3) / m, force(q + h * a / 3)
    e, f = (p + h * (d - b / 3)) / m, force(q + h * (c - a / 3))
    g, i = (p + h * (b - d + f)) / m, force(q + h * (a - c + e))
    return q + h / 8 * (a + 3 * c + 3 * e + g), p + h / 8 * (b + 3 * d + 3 * f + i)


def wrong_nystroem(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    """Nystroem's method of fourth order with h**2/4 for h**2/8."""
    v, a = p / m, force(q) / m
    b = force(q + h / 2 * v + h * h / 4 * a) / m
    c = force(q + h * v + h * h / 2 * b) / m
    return q + h * v + h * h / 6 * (a + 2 * b), m * (v + h / 6 * (a + 4 * b + c))


def newmark(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    """beta = 1/6, gamma = 1/2: linear acceleration."""
    a = b = force(q) / m
    q1 = q
    for _ in range(200):
        q1 = q + h * p / m + h * h * (a / 3 + b / 6)
        b = force(q1) / m
    return q1, p + h / 2 * m * (a + b)


class Cached:
    """Velocity Verlet that keeps the last force, of whichever run."""

    last: Any = None

    def __call__(self, q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
        p = p + h / 2 * (force(q) if self.last is None else self.last)
        q = q + h * p / m
        self.last = force(q)
        return q, p + h / 2 * self.last


@pytest.mark.parametrize(
    ("stepper", "scheme", "same"),
    [(heun, "rk2-heun", "rk2-midpoint"), (midpoint, "rk2-midpoint", "rk2-heun"),
     (trapezoidal, "trapezoidal", "implicit-midpoint")],
)  # fmt: skip
def test_a_step_on_a_quartic_well_tells_schemes_of_one_map(stepper: Force, scheme: str, same: str) -> None:
    found = identify_stepper(stepper)
    assert (found.scheme, found.fits, found.explanations) == (scheme, True, ())
    assert same in found.aliases
    assert [x.scheme for x in found.candidates] == [scheme]
    assert springcheck.schemes.title(scheme).casefold() in found.statement.casefold()


@pytest.mark.parametrize("stepper", [ralston, rule_of_three_eighths])
def test_another_member_of_a_class_gets_no_name_of_ours(stepper: Force) -> None:
    found = identify_stepper(stepper)
    assert (found.verdict, found.scheme, found.fits) == ("not told apart", None, True)
    assert "another scheme on forces that are not linear" in found.statement
    assert doors.function.engine([stepper]).methods[stepper.__name__].scheme == UNKNOWN.name


@pytest.mark.parametrize("stepper", [heun, trapezoidal, ralston, rule_of_three_eighths])
def test_none_of_them_fails_on_an_anharmonic_scene(stepper: Force) -> None:
    scene = springcheck.load_scene("anharmonic")
    verdicts = springcheck.judge(scene, springcheck.simulate(scene, stepper))
    assert [f"{v.check}: {v.why}" for v in verdicts if v.passed is False] == []
    step = {v.check: v.passed for v in verdicts}["step-defect"]
    assert step is (True if stepper in (heun, trapezoidal) else None)


def test_a_force_kept_from_the_run_before_is_no_number_written_into_the_stepper() -> None:
    found = identify_stepper(Cached())
    assert found.statement == (
        "Velocity Verlet in a first run, and not in a later one from the same start: the stepper keeps a "
        "force or a state of the run before"
    )
    assert len(found.explanations) == 1


@pytest.mark.parametrize(("box", "begins"), [(2.0, -1.0), (3.0, -1.5), (10.0, 0.0)])
def test_positions_that_a_step_wraps_into_a_box_are_named(box: float, begins: float) -> None:
    """They were noise, a wrong start, a restart from one digit."""

    def step(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
        p = p + h / 2 * force(q)
        q = q + h * p / m
        return q - box * ((q - begins) // box), p + h / 2 * force(q)

    found = identify_stepper(step)
    assert (found.scheme, found.fits) == (None, False)
    assert found.statement.startswith(f"The positions are wrapped into a box of {box:g},")


def test_positions_that_a_step_rounds_are_wrapped_into_no_box() -> None:
    """An array of integers cuts off positions: all jump at once, and they were a box of 0.924678."""

    def step(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
        q = int(q)
        p = p + h * force(q)
        return q + h * p / m, p

    found = identify_stepper(step)
    assert (found.scheme, found.fits) == (None, False)
    assert found.statement.startswith("Positions are rounded in the step, to about 1:")


def test_a_step_that_remembers_an_earlier_position_wraps_none_into_a_box() -> None:
    """One leap, at the first place that is visited, was a box of 5.33125."""
    old: dict[str, Any] = {}

    def stoermer(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
        before = old.get("q", q - h * p / m)
        after = 2 * q - before + h * h * force(q) / m
        old["q"] = q
        return after, m * (after - before) / (2 * h)

    found = identify_stepper(stoermer)
    assert (found.scheme, found.fits) == (None, False)
    assert found.statement.startswith("A step depends on an earlier call")


def test_leaps_of_unlike_length_are_of_no_box_and_show_no_order() -> None:
    def step(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
        p = p + h / 2 * force(q)
        q = q + h * p / m
        return q - 1.7 * (q > 1) + 2.3 * (q < -1), p + h / 2 * force(q)

    found = identify_stepper(step)
    assert (found.scheme, found.fits) == (None, False)
    assert not found.statement.startswith("The positions are wrapped")
    assert any("no order is measured" in note for note in found.notes)


def first_mass(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    p = p + h / 2 * force(q)
    q = q + h * p / (m if isinstance(m, float) else m[0])
    return q, p + h / 2 * force(q)


def one_by_one(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    q, p = q.copy(), p.copy()
    for i in range(len(q)):
        p[i] += h * force(q)[i]
        q[i] += h * p[i] / m[i]
    return q, p


@pytest.mark.parametrize(
    ("stepper", "said"),
    [(first_mass, "Velocity Verlet of one particle, but of two both move with the mass of the first"),
     (one_by_one, "but of two that a spring joins a force is worked out when only one of them has moved")],
)  # fmt: skip
def test_what_a_stepper_does_wrong_with_two_particles_is_said(stepper: Force, said: str) -> None:
    """Both were the scheme, with exit status 0: one particle was tried."""
    found = identify_stepper(stepper)
    assert not found.fits
    assert said in str(found).replace("\n  ", " ")
    # in a scene of several the scheme that it is of one is what it fails
    assert doors.function.engine([stepper]).methods[stepper.__name__].scheme == found.scheme


def test_a_stepper_that_takes_numbers_alone_was_tried_with_one_particle() -> None:
    def numbers(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
        p = p + h * force(q)
        return float(q + h * p / m), float(p)

    found = identify_stepper(numbers)
    assert (found.scheme, found.fits) == ("semi-implicit-euler", True)
    assert any(note.startswith("tried with one particle alone: arrays of two end in") for note in found.notes)
    assert not any("tried with one" in note for note in identify_stepper(heun).notes)


@pytest.mark.parametrize(
    ("out", "what"),
    [(1.0, "float"), (None, "NoneType"), ((1, 2, 3), "tuple of 3"), (("a", 1.0), "no numbers"),
     (([1.0, [2.0]], 1.0), "no numbers"), (([], []), "no numbers"),
     ((1j, 1.0), "complex numbers, and no real numbers")],
)  # fmt: skip
def test_what_is_no_pair_of_numbers_is_put_down_to_the_function(out: Any, what: str) -> None:
    """It was: TypeError: cannot unpack non-iterable float object (stepper.py, line 67)."""

    def step(q: Any, p: Any, h: float, force: Force, m: Any) -> Any:
        return out

    line = step.__code__.co_firstlineno
    said = f"step: returned {what}; a step returns (q, p) (test_identify_steppers.py, line {line})"
    with pytest.raises(MethodError, match=re.escape(said)):
        identify_stepper(step)


def kick_drift(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    p = p + h * force(q)
    return q + h * p / m, p


def drift_kick(q: Any, p: Any, h: float, force: Force, m: Any) -> tuple[Any, Any]:
    q = q + h * p / m
    return q, p + h * force(q)


def test_a_step_that_is_another_scheme_at_another_mass_is_told_with_both() -> None:
    found = identify_stepper(
        lambda q, p, h, force, m: (kick_drift if m > 1 else drift_kick)(q, p, h, force, m)
    )
    assert found.statement.startswith("The stepper looks like different schemes on different springs: ")
    assert "semi-implicit-euler at m=3.7" in found.statement
    assert "semi-implicit-euler-drift-kick at m=0.6" in found.statement


def test_a_step_that_is_another_scheme_backwards_is_told_with_both() -> None:
    found = identify_stepper(
        lambda q, p, h, force, m: (kick_drift if h > 0 else drift_kick)(q, p, h, force, m)
    )
    assert (
        found.statement
        == "A negative step is not semi-implicit-euler backwards but semi-implicit-euler-drift-kick"
    )


def test_a_step_that_reverses_the_momentum_says_so() -> None:
    """It said that the momentum changes by 1.374e+06 h F over a short step."""

    def step(q: float, p: float, h: float, force: Force, mass: float) -> tuple[float, float]:
        p += h / 2 * force(q)
        q += h * p / mass
        return q, -(p + h / 2 * force(q))

    (first, *_) = identify_stepper(step).explanations
    assert "momentum by -1" in first.cause
