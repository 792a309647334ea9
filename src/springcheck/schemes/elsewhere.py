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
J. Comput.  Appl.  Math. 142 (2002) 313, S6 and S10.
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


# 1/(4 - 4**(1/3)), of Suzuki's five steps of Verlet: halves, wholes, and those of the middle one
_S5 = ("0.2072453858971878685711770314303807478559", *3 * ("0.4144907717943757371423540628607614957118",),
       "-0.1217361576915636057135310942911422435677")  # fmt: skip
_Y6 = ("0.39225680523878", "0.78451361047756", "0.5100434119184585", "0.235573213359357",
       "-0.4710533854097565", "-1.17767998417887", "0.068753168252518")  # fmt: skip

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
              stages=_alternating("drift", "0.1786178958448091", "0.7123418310626054",
                                  "-0.06626458266981849", "-0.2123418310626054",
                                  middle="0.77529337365001878")),
    *(
        Elsewhere(name=f"{name}{first}", title=f"{whose}, {kind} first", order=order,
                  stages=_alternating(kind, *half, middle=middle))
        for name, whose, order, half, middle in (
            ("suzuki4", "Suzuki, fourth order", 4, _S5, "-0.6579630871775029485694162514430459828471"),
            ("yoshida6", "Yoshida, sixth order", 6, _Y6, "1.315186320683906"),
            ("blanes-moan4", "Blanes-Moan, fourth order in six stages", 4, _BM4, "0.2193769557534996"),
            ("blanes-moan6", "Blanes-Moan, sixth order in ten stages", 6, _BM6, "-0.7255255585086898"),
        )
        for kind, first in (("kick", ""), ("drift", "-drift-first"))
    ),
    Elsewhere(name="mclachlan-atela4", title="McLachlan-Atela, fourth order in four kicks", order=4,
              stages=tuple((kind, c) for pair in (
                  ("0.1344961992774310892", "0.5153528374311229364"),
                  ("-0.2248198030794208058", "-0.085782019412973646"),
                  ("0.7563200005156682911", "0.4415830236164665242"),
                  ("0.3340036032863214255", "0.1288461583653841854"),
              ) for kind, c in zip(("kick", "drift"), pair, strict=True))),
    Elsewhere(name="mclachlan2", title="McLachlan, second order in two kicks", order=2,
              stages=_alternating("drift", "0.1931833275037836", "0.5", middle="0.6136333449924328")),
)  # fmt: skip

ELSEWHERE: dict[str, Elsewhere] = {scheme.name: scheme for scheme in _ALL}
