"""Schemes that are named and not run: their order, by stability function and by map on a spring."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

import springcheck
from springcheck.identify.catalogue import KNOWN_ELSEWHERE, of_scheme
from springcheck.identify.elsewhere import ELSEWHERE
from springcheck.identify.tables import unit
from springcheck.schemes import SCHEMES


def stability(name: str, z: mpmath.mpf) -> mpmath.mpf:
    def polynomial(row: tuple) -> mpmath.mpf:
        numbers = [
            mpmath.mpf(x) if isinstance(x, str) else mpmath.mpf(x.numerator) / x.denominator for x in row
        ]
        return sum(x * z**i for i, x in enumerate(numbers))

    return polynomial(ELSEWHERE[name].over) / polynomial(ELSEWHERE[name].under)


RUNGE_KUTTA = [name for name, one in ELSEWHERE.items() if one.over]


@pytest.mark.parametrize("name", RUNGE_KUTTA)
def test_the_first_wrong_coefficient_is_that_of_the_order(name: str) -> None:
    with mpmath.workdps(40):
        # coefficients are of 37 digits and more
        off = mpmath.taylor(lambda z: stability(name, z) - mpmath.exp(z), 0, 8)
    order = ELSEWHERE[name].order
    assert all(abs(x) < 1e-20 for x in off[: order + 1])
    assert abs(off[order + 1]) > 9e-6


@pytest.mark.parametrize("name", ELSEWHERE)
def test_the_map_that_identify_compares_is_of_that_order(name: str) -> None:
    errors = []
    for x in (0.04, 0.02) if ELSEWHERE[name].order < 8 else (0.2, 0.1):
        wide = np.longdouble(x)
        found = unit(of_scheme(name), np.array([wide * wide], np.longdouble), np.zeros(1, np.longdouble))[0]
        flow = np.array([[np.cos(wide), np.sin(wide) / wide], [-wide * np.sin(wide), np.cos(wide)]])
        # (q, v h): the velocity's unit makes the lower left entry smaller by x**2
        errors.append(float(np.max(np.abs(found - flow) / [[1, 1], [x * x, 1]])))
    order = np.log2(errors[0] / errors[1])
    # M12 counts in v h, of the size of x: its error is of one order less
    assert ELSEWHERE[name].order - 0.2 < order < ELSEWHERE[name].order + 1.2


def test_names_are_one_scheme_s() -> None:
    names = [y for one in ELSEWHERE.values() for y in (one.name, *one.also)]
    assert len(set(names)) == len(names)
    assert not set(names) & set(SCHEMES)
    assert {family.scheme for family in KNOWN_ELSEWHERE} == set(ELSEWHERE)


Step = Callable[[Any, Any, float, Callable[[Any], Any], Any], tuple[Any, Any]]


def verlets(lengths: list[float], *, kick_first: bool) -> Step:
    """Velocity or position Verlet of these lengths one after the other, as compositions are programmed."""

    def step(q: Any, p: Any, h: float, force: Callable[[Any], Any], mass: Any) -> tuple[Any, Any]:
        for w in lengths:
            if kick_first:
                p = p + w * h / 2 * force(q)
                q = q + w * h * p / mass
                p = p + w * h / 2 * force(q)
            else:
                q = q + w * h / 2 * p / mass
                p = p + w * h * force(q)
                q = q + w * h / 2 * p / mass
        return q, p

    return step


def runge_kutta(rows: list[list[float]], weights: list[float], rounds: int = 1) -> Step:
    """A tableau, whose stages are worked out anew `rounds` times where they need each other."""

    def step(q: Any, p: Any, h: float, force: Callable[[Any], Any], mass: Any) -> tuple[Any, Any]:
        slopes = [(p / mass, force(q)) for _ in weights]
        for _ in range(rounds):
            for i, row in enumerate(rows):
                at = [
                    x + h * sum(a * slope[j] for a, slope in zip(row, slopes, strict=False))
                    for j, x in enumerate((q, p))
                ]
                slopes[i] = at[1] / mass, force(at[0])
        q, p = (
            x + h * sum(b * slope[j] for b, slope in zip(weights, slopes, strict=True))
            for j, x in enumerate((q, p))
        )
        return q, p

    return step


def alternating(half: list[float], other: list[float], *, kick_first: bool) -> Step:
    """Partitioned steps of symmetric coefficients, of which half is given, and the rest adds up to one."""
    ours = [*half, 1 - 2 * sum(half), *reversed(half)]
    theirs = [*other, 0.5 - sum(other), 0.5 - sum(other), *reversed(other)]
    kicks, drifts = (ours, [*theirs, 0.0]) if kick_first else ([0.0, *theirs], ours)

    def step(q: Any, p: Any, h: float, force: Callable[[Any], Any], mass: Any) -> tuple[Any, Any]:
        for b, a in zip(kicks, drifts, strict=True):
            p = p + b * h * force(q)
            q = q + a * h * p / mass
        return q, p

    return step


def mclachlan_atela(q: Any, p: Any, h: float, force: Callable[[Any], Any], mass: Any) -> tuple[Any, Any]:
    drifts = 0.5153528374311229364, -0.085782019412973646, 0.4415830236164665242, 0.1288461583653841854
    kicks = 0.1344961992774310892, -0.2248198030794208058, 0.7563200005156682911, 0.3340036032863214255
    for a, b in zip(drifts, kicks, strict=True):
        p = p + b * h * force(q)
        q = q + a * h * p / mass
    return q, p


S, W = 1 / (4 - 4 ** (1 / 3)), (0.784513610477560, 0.235573213359357, -1.17767998417887)
FIVE, SEVEN = [S, S, 1 - 4 * S, S, S], [*W, 1 - 2 * sum(W), *reversed(W)]
TSIT5 = [
    [], [0.161], [-0.008480655492356989, 0.335480655492357],
    [2.8971530571054935, -6.359448489975075, 4.3622954328695815],
    [5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525],
    [5.86145544294642, -12.92096931784711, 8.159367898576159, -0.071584973281401, -0.028269050394068383],
]  # fmt: skip
TSIT5_WEIGHTS = [
    0.09646076681806523, 0.01, 0.4798896504144996, 1.379008574103742, -3.290069515436081, 2.324710524099774,
]  # fmt: skip
R = 15**0.5
GAUSS6 = [
    [5 / 36, 2 / 9 - R / 15, 5 / 36 - R / 30], [5 / 36 + R / 24, 2 / 9, 5 / 36 - R / 24],
    [5 / 36 + R / 30, 2 / 9 + R / 15, 5 / 36],
]  # fmt: skip
BM4 = [0.0792036964311957, 0.353172906049774, -0.0420650803577195], [0.209515106613362, -0.143851773179818]
BM6 = (
    [0.0502627644003922, 0.413514300428344, 0.0450798897943977, -0.188054853819569, 0.541960678450780],
    [0.148816447901042, -0.132385865767784, 0.067307604692185, 0.432666402578175],
)

TEXTBOOK = {
    "suzuki4": verlets(FIVE, kick_first=True), "suzuki4-drift-first": verlets(FIVE, kick_first=False),
    "yoshida6": verlets(SEVEN, kick_first=True), "yoshida6-drift-first": verlets(SEVEN, kick_first=False),
    "mclachlan-atela4": mclachlan_atela, "tsitouras5": runge_kutta(TSIT5, TSIT5_WEIGHTS),
    **{
        f"{name}{'' if kick else '-drift-first'}": alternating(half, other, kick_first=kick)
        for name, half, other in (("blanes-moan4", *BM4), ("blanes-moan6", *BM6))
        for kick in (True, False)
    },
    "lobatto-iiic2": runge_kutta([[1 / 2, -1 / 2], [1 / 2, 1 / 2]], [1 / 2, 1 / 2], rounds=60),
    "lobatto-iiic4": runge_kutta(
        [[1 / 6, -1 / 3, 1 / 6], [1 / 6, 5 / 12, -1 / 12], [1 / 6, 2 / 3, 1 / 6]], [1 / 6, 2 / 3, 1 / 6],
        rounds=60,
    ),
    "gauss6": runge_kutta(GAUSS6, [5 / 18, 4 / 9, 5 / 18], rounds=40),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTBOOK)
def test_the_textbook_step_is_named_as_a_callable_and_from_its_states(name: str) -> None:
    step = TEXTBOOK[name]
    found = springcheck.identify(step)
    assert (found.scheme, found.fits) == (name, True), found
    # a length of the step that is lost is no scheme
    slipped = springcheck.identify(lambda q, p, h, force, mass: step(q, p, 0.999 * h, force, mass))
    assert not slipped.fits
    m, k, h = 3.7, 2.9, 0.31
    states = [(1.3, 0.7)]
    for _ in range(240):
        states.append(step(*states[-1], h, lambda q: -k * q, m))
    q, p = np.array(states[::3]).T
    found = springcheck.identify(3 * h * np.arange(81), q, p, mass=m)
    assert (found.scheme, found.stride) == (name, 3), found
    assert found.stiffness[0] == pytest.approx(k, rel=1e-9)
