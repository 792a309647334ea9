"""Schemes that people run, which springcheck names but does not run: each is its stability function.

A one-step method takes a linear system y' = L y to R(h L) y; a spring shows nothing but R, so that methods of
one R are one here.  None is carried out: `own` runs those of `catalogue` alone.  Sources: Butcher, Numerical
Methods for Ordinary Differential Equations (2016), chapter 3; Hairer & Wanner, Solving Ordinary Differential
Equations II (1996), IV.3 and IV.5; Fehlberg, NASA TR R-315 (1969); Dormand and Prince, J. Comput.  Appl.
Math. 6 (1980) 19; Cash & Karp, ACM TOMS 16 (1990) 201; Bank et al., IEEE Trans.  CAD 4 (1985) 436; Alexander,
SIAM J. Numer.  Anal. 14 (1977) 1006; Verwer et al., SIAM J. Sci.  Comput. 20 (1999) 1456; Omelyan, Mryglod &
Folk, Comput.  Phys.  Commun. 146 (2002) 188; McLachlan, SIAM J. Sci.  Comput. 16 (1995) 151.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from springcheck.schemes.catalogue import Coefficient


@dataclass(frozen=True, slots=True, kw_only=True)
class Elsewhere:
    """A scheme that is named and not run: its stability function, or its kicks and drifts."""

    name: str
    title: str
    order: int
    also: tuple[str, ...] = ()
    """Other schemes of the same map on a spring."""
    over: tuple[Coefficient, ...] = ()
    """Numerator of R, from the constant up."""
    under: tuple[Coefficient, ...] = (Fraction(1),)
    """Denominator of R, from the constant up."""
    stages: tuple[tuple[str, Coefficient], ...] = ()


def _taylor(order: int, *more: str) -> tuple[Coefficient, ...]:
    """1 + z + ... + z**order/order!, and further coefficients."""
    out, last = [Fraction(1)], Fraction(1)
    for n in range(1, order + 1):
        last /= n
        out.append(last)
    return (*out, *map(Fraction, more))


def _row(*numbers: str) -> tuple[Coefficient, ...]:
    return tuple(Fraction(x) if "/" in x or "." not in x else x for x in numbers)


def _alternating(first: str, *half: str, middle: str) -> tuple[tuple[str, Coefficient], ...]:
    kinds = (first, "drift" if first == "kick" else "kick")
    every = (*half, middle, *reversed(half))
    return tuple((kinds[i % 2], c) for i, c in enumerate(every))


# 1 - 1/sqrt 2 and 1 + 1/sqrt 2, twice and squared
_SDIRK = _row("1", "-0.58578643762690495119831127579030192143", "0.085786437626904951198311275790301921430")
_ROS = _row("1", "-3.4142135623730950488016887242096980785697", "2.9142135623730950488016887242096980785697")

_ALL = (
    Elsewhere(name="rk3-kutta", title="Runge-Kutta of third order in three stages", order=3,
              also=("rk3-ssp", "bogacki-shampine", "rk3-heun", "rk3-ralston"), over=_taylor(3)),
    Elsewhere(name="fehlberg4", title="Runge-Kutta-Fehlberg, the result of fourth order", order=4,
              over=_taylor(4, "1/104")),
    Elsewhere(name="fehlberg5", title="Runge-Kutta-Fehlberg, the result of fifth order", order=5,
              over=_taylor(5, "1/2080")),
    Elsewhere(name="dormand-prince5", title="Dormand-Prince, fifth order (RK45, dopri5, ode45)", order=5,
              over=_taylor(5, "1/600")),
    Elsewhere(name="cash-karp5", title="Cash-Karp, fifth order", order=5, over=_taylor(5, "1/800")),
    Elsewhere(name="rk5-butcher", title="Butcher's fifth order", order=5, over=_taylor(5, "1/640")),
    Elsewhere(name="sdirk2", title="SDIRK of second order in two stages (Alexander)", order=2,
              also=("tr-bdf2",), over=_row("1", "0.41421356237309504880168872420969807857"), under=_SDIRK),
    Elsewhere(name="ros2", title="Rosenbrock of second order (ROS2)", order=2,
              over=_row("1", "-2.4142135623730950488016887242096980785697"), under=_ROS),
    Elsewhere(name="gauss4", title="Gauss collocation, fourth order", order=4, also=("hermite4",),
              over=_row("1", "1/2", "1/12"), under=_row("1", "-1/2", "1/12")),
    Elsewhere(name="radau3", title="Radau IIA, third order", order=3, over=_row("1", "1/3"),
              under=_row("1", "-2/3", "1/6")),
    Elsewhere(name="radau5", title="Radau IIA, fifth order", order=5, over=_row("1", "2/5", "1/20"),
              under=_row("1", "-3/5", "3/20", "-1/60")),
    Elsewhere(name="pefrl", title="PEFRL, the position-extended Forest-Ruth-like scheme", order=4,
              stages=_alternating("drift", "0.1786178958448091", "0.7123418310626054",
                                  "-0.06626458266981849", "-0.2123418310626054",
                                  middle="0.77529337365001878")),
    Elsewhere(name="mclachlan2", title="McLachlan, second order in two kicks", order=2,
              stages=_alternating("drift", "0.1931833275037836", "0.5", middle="0.6136333449924328")),
)  # fmt: skip

ELSEWHERE: dict[str, Elsewhere] = {scheme.name: scheme for scheme in _ALL}
