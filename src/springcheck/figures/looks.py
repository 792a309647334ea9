"""One colour for one scheme, in every figure and page, one mark for one engine; axes in readable units.

Relatives share a colour and differ by their line.  Colours are those of Okabe & Ito (2008) and two dark ones
of Tol (2021), told apart by people with any colour vision; the common schemes also differ by their lines, so
that a grey print can be read.  Nothing here needs a library.
"""

from __future__ import annotations

import math
import zlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

from springcheck import engines, schemes
from springcheck.errors import MethodError

Line: TypeAlias = str | tuple[int, tuple[float, ...]]

SOLID, DASHED, DOTTED, DASH_DOT = "-", "--", ":", "-."
LONG: Line = (0, (8, 1.5))
TWO_DOTS: Line = (0, (5, 1.5, 1, 1.5, 1, 1.5))
SPARSE: Line = (0, (1, 2.5))
LINES = (SOLID, DASHED, DOTTED, DASH_DOT, LONG, TWO_DOTS, SPARSE)


@dataclass(frozen=True, slots=True)
class Look:
    """Colour and line of a scheme."""

    color: str
    linestyle: Any
    """A `Line`, as drawing libraries take it."""


_BLUE, _RED, _GREEN, _PINK = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
_ORANGE, _SKY, _BLACK, _WINE, _OLIVE = "#E69F00", "#56B4E9", "#000000", "#882255", "#999933"
_GREY = "#666666"

ON_SCREEN = {
    _BLUE: (_BLUE, "#56B4E9"),
    _RED: (_RED, "#FF7A33"),
    _GREEN: ("#00805C", "#2FC79A"),
    _PINK: ("#B0508C", "#E79FC8"),
    _ORANGE: ("#B87D00", _ORANGE),
    _SKY: ("#3A97CC", "#A6D8F5"),
    _BLACK: (_BLACK, "#F0F0F0"),
    _WINE: (_WINE, "#D6608F"),
    _OLIVE: ("#85852B", "#C8C850"),
    _GREY: (_GREY, "#A0A0A0"),
}
"""Each colour on white and on black: unchanged where its contrast to both is 3 to 1."""

LOOKS = {
    "explicit-euler": Look(_RED, DASHED),
    "semi-implicit-euler": Look(_BLUE, SOLID),
    "semi-implicit-euler-drift-kick": Look(_BLUE, DOTTED),
    "semi-implicit-euler-implicit-friction": Look(_BLUE, DASH_DOT),
    "implicit-euler": Look(_PINK, DASH_DOT),
    "implicit-euler-4": Look(_PINK, DOTTED),
    "velocity-verlet": Look(_GREEN, LONG),
    "position-verlet": Look(_GREEN, DOTTED),
    "respa8": Look(_GREEN, DASH_DOT),
    "langevin-middle": Look(_SKY, DASHED),
    "langevin-middle-early": Look(_SKY, DOTTED),
    "implicit-midpoint": Look(_SKY, SOLID),
    "trapezoidal": Look(_SKY, LONG),
    "rk2-midpoint": Look(_ORANGE, DOTTED),
    "rk2-heun": Look(_ORANGE, DASHED),
    "rk4": Look(_ORANGE, TWO_DOTS),
    "ruth3": Look(_WINE, DOTTED),
    "forest-ruth": Look(_WINE, SOLID),
    "yoshida4": Look(_WINE, DASHED),
    "exact": Look(_BLACK, LONG),
    "adams": Look(_BLACK, DOTTED),
    "bdf": Look(_BLACK, DASH_DOT),
    "ida": Look(_BLACK, DASHED),
    "scipy-rk45": Look(_ORANGE, DASH_DOT),
    "scipy-dop853": Look(_ORANGE, SOLID),
    "scipy-radau": Look(_WINE, DASH_DOT),
    "scipy-bdf": Look(_BLACK, TWO_DOTS),
    "scipy-lsoda": Look(_BLACK, SPARSE),
    "adaptive": Look(_GREY, SOLID),
    "force-held-2": Look(_OLIVE, SOLID),
    "force-held-4": Look(_OLIVE, LONG),
    "force-held-5": Look(_OLIVE, DASHED),
    "force-held-10": Look(_OLIVE, DASH_DOT),
    "force-held-rk4": Look(_OLIVE, DOTTED),
    "baoab": Look(_RED, SOLID),
    "baoa": Look(_GREEN, SOLID),
    "obabo": Look(_PINK, SOLID),
    "oabao": Look(_BLACK, SOLID),
    "aboba": Look(_BLUE, LONG),
    "bbk": Look(_ORANGE, LONG),
    "andersen": Look(_WINE, LONG),
    "andersen-after-kick": Look(_SKY, DASH_DOT),
    "andersen-leapfrog": Look(_GREY, DASH_DOT),
    "vanden-eijnden-ciccotti": Look(_RED, LONG),
    "lammps-langevin": Look(_PINK, LONG),
    "gj-i": Look(_BLUE, DASHED),
}
FAILED = "#DD0033"
"""Colour of whatever is wrong, in figures and page."""

FAILED_ON_SCREEN = (FAILED, "#FF5C7A")
"""It on white and on black."""

_REST = tuple(Look(c, line) for line in (TWO_DOTS, SPARSE) for c in (_OLIVE, _WINE, _SKY, _PINK, _RED, _BLUE))

MARKS = {
    "own": ("o", "\u25cb"),
    "openmm": ("s", "\u25a1"),
    "ase": ("^", "\u25b3"),
    "sundials": ("D", "\u25c7"),
    "scipy": ("v", "\u25bd"),
    "mujoco": ("<", "\u25c1"),
    "lammps": ("d", "\u25ca"),
    "fault": ("H", "\u2b22"),
}
"""Mark of each engine on a line, and the character that stands for it in a legend."""
_OTHER_MARKS = (("8", "\u2b23"), ("d", "\u29eb"))


def look(scheme: str) -> Look:
    """Colour and line of a scheme, of any name, the same in every figure; red of what is wrong."""
    if scheme == "failed":
        return Look(FAILED, SOLID)
    return LOOKS.get(scheme) or _REST[zlib.crc32(scheme.encode()) % len(_REST)]


def mark(engine: str) -> tuple[str, str]:
    """Mark and character of an engine, of any name."""
    return MARKS.get(engine) or _OTHER_MARKS[zlib.crc32(engine.encode()) % len(_OTHER_MARKS)]


def engine(label: str) -> str:
    """The engine of a method's label."""
    return label.partition(":")[0]


def scheme_of(label: str) -> str:
    """The scheme of a method; its label where its engine is not known here."""
    try:
        return engines.method(engines.parse(label)).scheme
    except MethodError:
        return label


def title(scheme: str) -> str:
    """The title of a scheme as short as a legend needs it: without its mechanism and its orders."""
    found = schemes.UNKNOWN.title if scheme in ("", schemes.UNKNOWN.name) else schemes.title(scheme)
    # a method's own label stays whole, and so does what tells the members of a family apart
    whole = found == scheme or ": fast springs" in found
    return found if whole else found.partition(":")[0].partition(", orders ")[0]


MOST_MEMBERS = 6


def members(labels: Iterable[str]) -> str:
    """Legend of a scheme's line: the one label, or the engines with their marks."""
    given = list(labels)
    if len(given) == 1:
        return f"{mark(engine(given[0]))[1]} {given[0]}"
    count = Counter(map(engine, given))
    names = [f"{mark(name)[1]} {name}" + (f" ({n})" if n > 1 else "") for name, n in count.items()]
    more = [f"and {len(names) - MOST_MEMBERS} more"] if len(names) > MOST_MEMBERS else []
    lines = [names[i : i + 3] for i in range(0, min(len(names), MOST_MEMBERS), 3)]
    return "\n".join("  ".join(line) for line in [*lines, *([more] if more else [])])


PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "\u00b5", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
SCALED = {"nm": ("m", -9), "ps": ("s", -12)}
"""Units that carry a prefix already: the bare unit and its power of ten."""


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """The factor and the unit in which numbers up to `largest` are read easily: from 1 to 999.

    Only units of one name take a prefix; without a unit, or beyond the prefixes, numbers stay as they are.
    """
    name, power = SCALED.get(unit, (unit, 0))
    if not name.isalpha() or not (math.isfinite(largest) and largest > 0) or name in ("rad", "\u03c0"):
        return 1.0, unit
    exponent = 3 * math.floor((math.log10(largest) + power) / 3 + 1e-9)
    if exponent not in PREFIXES or exponent == power:
        return 1.0, unit
    return 10.0 ** (power - exponent), PREFIXES[exponent] + name
