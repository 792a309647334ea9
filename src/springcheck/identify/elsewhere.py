"""Schemes that people run, which springcheck names but does not run: each is its stability function.

A one-step method takes a linear system y' = L y to R(h L) y; a spring shows nothing but R, so that methods of
one R are one here.  None is carried out: `own` runs those of `catalogue` alone.  Sources: Butcher, Numerical
Methods for Ordinary Differential Equations (2016), chapter 3; Hairer & Wanner, Solving Ordinary Differential
Equations II (1996), IV.3 and IV.5; Fehlberg, NASA TR R-315 (1969); Dormand and Prince, J. Comput.  Appl.
Math. 6 (1980) 19; Cash & Karp, ACM TOMS 16 (1990) 201; Bank et al., IEEE Trans.  CAD 4 (1985) 436; Alexander,
SIAM J. Numer.  Anal. 14 (1977) 1006; Verwer et al., SIAM J. Sci.  Comput. 20 (1999) 1456; Omelyan, Mryglod &
Folk, Comput.  Phys.  Commun. 146 (2002) 188; McLachlan, SIAM J. Sci.  Comput. 16 (1995) 151; Suzuki, Phys.
Lett. A 146 (1990) 319; Yoshida, Phys.  Lett. A 150 (1990) 262, solution A, in the digits that he prints;
McLachlan & Atela, Nonlinearity 5 (1992) 541; Tsitouras, Comput.  Math.  Appl. 62 (2011) 770; Blanes & Moan,
J. Comput.  Appl.  Math. 142 (2002) 313, S6 and S10; Kahan & Li, Math. Comput. 66 (1997) 1089; Calvo &
Sanz-Serna, SIAM J. Sci.  Comput. 14 (1993) 936; Kennedy & Carpenter, NASA
TM-2016-219173.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

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


def _alternating(first: str, half: Sequence[str], middle: str) -> tuple[tuple[str, Coefficient], ...]:
    kinds = (first, "drift" if first == "kick" else "kick")
    every = _row(*half, middle, *reversed(half))
    return tuple((kinds[i % 2], c) for i, c in enumerate(every))


def _verlets(first: str, weights: Sequence[str]) -> tuple[tuple[str, Coefficient], ...]:
    """Verlet's method of these lengths, outermost first, about one that makes their sum 1."""
    half = [Fraction(x) for x in weights]
    every = [*half, 1 - 2 * sum(half, Fraction(0)), *reversed(half)]
    between = [(a + b) / 2 for a, b in zip([Fraction(0), *every], [*every, Fraction(0)], strict=True)]
    both = (x for pair in zip(between, [*every, Fraction(0)], strict=True) for x in pair)
    kinds = (first, "drift" if first == "kick" else "kick")
    return tuple((kinds[i % 2], c) for i, c in enumerate(both) if c)


_VERLETS = (
    ("suzuki4", "Suzuki, fourth order", 4, 2 * ("0.4144907717943757371423540628607614957118",)),
    ("yoshida6", "Yoshida, sixth order", 6,
     ("0.784513610477560", "0.235573213359357", "-1.17767998417887")),
    ("kahan-li6", "Kahan-Li, sixth order", 6,
     ("0.39216144400731413927925056", "0.33259913678935943859974864", "-0.70624617255763935980996482",
      "0.08221359629355080023149045")),
    ("yoshida8", "Yoshida, eighth order (his solution D)", 8,
     ("0.914844246229740", "0.253693336566229", "-1.44485223686048", "-0.158240635368243",
      "1.93813913762276", "-1.96061023297549", "0.102799849391985")),
    ("yoshida8-c", "Yoshida, eighth order (his solution C)", 8,
     ("0.629030650210433", "1.36934946416871", "-1.06458714789183", "1.66335809963315",
      "-1.67896928259640", "-1.55946803821447", "0.311790812418427")),
    ("kahan-li8", "Kahan-Li, eighth order", 8,
     ("0.13020248308889008087881763", "0.56116298177510838456196441", "-0.38947496264484728640807860",
      "0.15884190655515560089621075", "-0.39590389413323757733623154", "0.18453964097831570709183254",
      "0.25837438768632204729397911", "0.29501172360931029887096624")),
)  # fmt: skip
_BM4 = ("0.0792036964311957", "0.209515106613362", "0.353172906049774", "-0.143851773179818",
        "-0.0420650803577195", "0.434336666566456")  # fmt: skip
_BM6 = ("0.0502627644003922", "0.148816447901042", "0.413514300428344", "-0.132385865767784",
        "0.0450798897943977", "0.067307604692185", "-0.188054853819569", "0.432666402578175",
        "0.541960678450780", "-0.016404589403618")  # fmt: skip

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
    Elsewhere(name="tsitouras5", title="Tsitouras, fifth order (Tsit5)", order=5,
              over=_taylor(5, "0.001432211324807348")),
    Elsewhere(name="rk5-butcher", title="Butcher's fifth order", order=5, over=_taylor(5, "1/640")),
    Elsewhere(name="sdirk2", title="SDIRK of second order in two stages (Alexander)", order=2,
              also=("tr-bdf2",), over=_row("1", "0.41421356237309504880168872420969807857"), under=_SDIRK),
    Elsewhere(name="sdirk3", title="SDIRK of third order in three stages (Alexander)", order=3,
              over=_row("1", "-0.3075995645253769982480583535806705275879",
                        "-0.2376606908097251435928581121588620103443"),
              under=_row("1", "-1.307599564525376998248058353580670527588",
                         "0.5699388737156518546552002414218085172436",
                         "-0.0828057581196300221978377312981399201163")),
    Elsewhere(name="ros2", title="Rosenbrock of second order (ROS2)", order=2,
              over=_row("1", "-2.4142135623730950488016887242096980785697"), under=_ROS),
    Elsewhere(name="gauss4", title="Gauss collocation, fourth order", order=4, also=("hermite4",),
              over=_row("1", "1/2", "1/12"), under=_row("1", "-1/2", "1/12")),
    Elsewhere(name="gauss6", title="Gauss collocation, sixth order", order=6,
              over=_row("1", "1/2", "1/10", "1/120"), under=_row("1", "-1/2", "1/10", "-1/120")),
    Elsewhere(name="radau3", title="Radau IIA, third order", order=3, over=_row("1", "1/3"),
              under=_row("1", "-2/3", "1/6")),
    Elsewhere(name="radau5", title="Radau IIA, fifth order", order=5, over=_row("1", "2/5", "1/20"),
              under=_row("1", "-3/5", "3/20", "-1/60")),
    Elsewhere(name="lobatto-iiic2", title="Lobatto IIIC, second order", order=2, over=_row("1"),
              under=_row("1", "-1", "1/2")),
    Elsewhere(name="lobatto-iiic4", title="Lobatto IIIC, fourth order", order=4, over=_row("1", "1/4"),
              under=_row("1", "-3/4", "1/4", "-1/24")),
    Elsewhere(name="pefrl", title="PEFRL, the position-extended Forest-Ruth-like scheme", order=4,
              stages=_alternating("drift", middle="0.77529337365001878", half=(
                  "0.1786178958448091", "0.7123418310626054", "-0.06626458266981849",
                  "-0.2123418310626054"))),
    *(
        Elsewhere(name=f"{name}{first}", title=f"{whose}, {kind} first", order=order, stages=stages)
        for name, whose, order, of in (
            *((*x[:3], partial(_verlets, weights=x[3])) for x in _VERLETS),
            ("blanes-moan4", "Blanes-Moan, fourth order in six stages", 4,
             partial(_alternating, half=_BM4, middle="0.2193769557534996")),
            ("blanes-moan6", "Blanes-Moan, sixth order in ten stages", 6,
             partial(_alternating, half=_BM6, middle="-0.7255255585086898")),
        )
        for kind, first in (("kick", ""), ("drift", "-drift-first"))
        for stages in (of(kind),)
    ),
    Elsewhere(name="mclachlan-sb3a", title="McLachlan's SB3A, fourth order in five kicks", order=4,
              stages=_alternating("drift", half=(
                  "0.40518861839525227722", "-3/73", "-0.28714404081652408900", "17/59",
                  "0.38195542242127181178"), middle="2179/4307")),
    Elsewhere(name="calvo-sanz4", title="Calvo and Sanz-Serna, fourth order in four stages", order=4,
              stages=tuple(zip(("kick", "drift") * 4 + ("kick",), (
                  "0.061758858135626", "0.205177661542290", "0.33897802655364", "0.403021281604210",
                  "0.61479130717558", "-0.12092087633891", "-0.14054801465937", "0.512721933192410",
                  "0.12501982279453"), strict=True))),
    Elsewhere(name="esdirk32", title="ESDIRK of third order in four stages (Kennedy and Carpenter)", order=3,
              over=_row("1", "-1/2", "-1/4", "1/24"), under=_row("1", "-3/2", "3/4", "-1/8")),
    Elsewhere(name="mclachlan-atela4", title="McLachlan-Atela, fourth order in four kicks", order=4,
              stages=tuple(zip(("kick", "drift") * 4, (
                  "0.1344961992774310892", "0.5153528374311229364", "-0.2248198030794208058",
                  "-0.085782019412973646", "0.7563200005156682911", "0.4415830236164665242",
                  "0.3340036032863214255", "0.1288461583653841854"), strict=True))),
    Elsewhere(name="mclachlan2", title="McLachlan, second order in two kicks", order=2,
              stages=_alternating("drift", ("0.1931833275037836", "0.5"), "0.6136333449924328")),
)  # fmt: skip

ELSEWHERE: dict[str, Elsewhere] = {scheme.name: scheme for scheme in _ALL}
