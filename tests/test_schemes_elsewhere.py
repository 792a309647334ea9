"""Schemes that are named and not run: their order, by stability function and by map on a spring."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from springcheck.identify.families import FAMILIES, KNOWN_ELSEWHERE
from springcheck.identify.maps import unit
from springcheck.schemes import SCHEMES
from springcheck.schemes.elsewhere import ELSEWHERE


def stability(name: str, z: mpmath.mpf) -> mpmath.mpf:
    def polynomial(row: tuple) -> mpmath.mpf:
        numbers = [
            mpmath.mpf(x) if isinstance(x, str) else mpmath.mpf(x.numerator) / x.denominator for x in row
        ]
        return mpmath.polyval(numbers[::-1], z)

    return polynomial(ELSEWHERE[name].over) / polynomial(ELSEWHERE[name].under)


RUNGE_KUTTA = [name for name, one in ELSEWHERE.items() if one.over]


@pytest.mark.parametrize("name", RUNGE_KUTTA)
def test_the_first_wrong_coefficient_is_that_of_the_order(name: str) -> None:
    with mpmath.workdps(40):
        # coefficients are of 37 digits and more
        off = mpmath.taylor(lambda z: stability(name, z) - mpmath.exp(z), 0, 8)
    order = ELSEWHERE[name].order
    assert all(abs(x) < 1e-20 for x in off[: order + 1])
    assert abs(off[order + 1]) > 1e-5


@pytest.mark.parametrize("name", ELSEWHERE)
def test_the_map_that_identify_compares_is_of_that_order(name: str) -> None:
    errors = []
    for x in (0.04, 0.02):
        found = unit(FAMILIES[name], np.array([x * x], np.longdouble), np.zeros(1, np.longdouble))[0]
        flow = [[np.cos(x), np.sin(x) / x], [-x * np.sin(x), np.cos(x)]]
        # (q, v h): the velocity's unit makes the lower left entry smaller by x**2
        errors.append(float(np.max(np.abs(found.astype(float) - flow) / [[1, 1], [x * x, 1]])))
    order = np.log2(errors[0] / errors[1])
    # M12 counts in v h, of the size of x: its error is of one order less
    assert ELSEWHERE[name].order - 0.2 < order < ELSEWHERE[name].order + 1.2


def test_names_are_one_scheme_s() -> None:
    names = [y for one in ELSEWHERE.values() for y in (one.name, *one.also)]
    assert len(set(names)) == len(names)
    assert not set(names) & set(SCHEMES)
    assert {family.scheme for family in KNOWN_ELSEWHERE} == set(ELSEWHERE)
