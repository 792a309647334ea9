"""Charts as plain data: what a study shows in figures (`render`) and in the report page next to its text.

The results of studies have them (`banks`).  Numbers are the stored doubles; `plain` makes of a bank
what JSON can hold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any, Literal

import numpy as np

from springcheck.physics.arrays import Floats

GUIDE, EXACTLY, SEPARATRIX, BEGIN, REJECTED = "guide", "exact", "separatrix", "beginning", "failed"
LOWEST = "lowest"
"""Groups that are no scheme's: guides to a slope or a limit, the exact solution, separatrices, the common
start, what some verdict rejects, and the lower envelope of all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """One axis: its name with the unit."""

    name: str
    log: bool = False
    values: Sequence[float] = ()
    """Values at the positions 0, 1, 2 ... of an axis of tiles."""
    names: Sequence[str] = ()
    """Names at the positions 0, 1, 2 ...; every one is written at the axis."""
    shown: tuple[float, float] | None = None
    """Range shown at first; by default that of the curves."""
    factor: float = 1.0
    """Factor from the numbers to the unit in the name."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """Points of one name; curves of one name are switched on and off together.  One of the group `GUIDE` is
    no method's: a thin line with its name at its end."""

    name: str
    group: str
    """The scheme: it has one colour in the whole page."""
    x: Sequence[float] | Floats
    y: Sequence[float] | Floats
    line: bool = True
    marks: bool = False
    notes: Sequence[str] = ()
    """Annotation of each point next to its numbers."""
    open: Sequence[bool] = ()
    """Which points are estimates: these have hollow marks, all others filled ones."""
    title: str = ""
    """The scheme in words, or the fault."""
    over: bool = False
    """Whether it coincides with an earlier curve of its group, on which a figure shows its marks alone."""
    dots: bool = False
    """Whether points are too far apart to be joined: each is a dot, and its line is faint if it has one."""
    methods: Sequence[str] = ()
    """Labels of the methods that it stands for, where there are several."""
    band: tuple[Sequence[float] | Floats, Sequence[float] | Floats] | None = None
    """Smallest and largest of the numbers whose median is y; without a line the ends of error bars."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tiles:
    """A map over two axes of values: `rows` holds, for each y, an index into `kinds` for each x, or -1."""

    kinds: Sequence[tuple[str, str]]
    """Name and shade of each: good, wild, limit, refused, wrong."""
    rows: Sequence[Sequence[int]]
    notes: Sequence[Sequence[str]] = ()
    """Annotation of each tile next to its kind; none by default."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A line across a chart."""

    axis: Literal["x", "y"]
    at: float
    name: str = ""
    look: Literal["limit", "one", "here", "floor"] = "limit"
    group: str = ""
    """The scheme whose floor it is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Naming:
    """The name of a curve where it is well separated, in its colour; at x = 1 next to the axes."""

    text: str
    group: str
    x: float
    y: float
    """Fractions of the width and height of the axes."""
    below: bool = False
    """Whether it hangs below its point, inside the axes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """Curves or tiles over two axes."""

    title: str
    x: Scale
    y: Scale
    curves: Sequence[Curve] = ()
    tiles: Tiles | None = None
    rules: Sequence[Rule] = ()
    short: str = ""
    """Label that distinguishes it from the other charts of its bank."""
    equal: bool = False
    """Whether both axes have the same scale."""
    labels: Sequence[Naming] = ()
    note: str = ""
    """What the chart leaves out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bank:
    """Charts with one legend: of their curves, or of the charts where they are tiles."""

    title: str
    charts: Sequence[Chart]
    name: str = ""
    """Name of its figure's file; without one it is shown by the page alone."""
    heading: str = ""
    """Heading of its figure; by default the title of its first chart."""
    on: Sequence[str] | None = None
    """Series drawn at first; all by default."""
    columns: int = 0
    """Charts side by side in a figure; by default as many as suit it."""
    foot: str = ""
    """Small print below its figure."""
    size: tuple[float, float] | None = None
    """Size of a chart in a figure [in]; by default what suits it."""


def plain(bank: Bank) -> dict[str, Any]:
    """For JSON: numbers that are not finite are words, rows of tiles are run-length encoded, [count,
    kind]."""
    names = [x.name for chart in bank.charts for x in chart.curves]
    titles = [chart.title for chart in bank.charts if chart.tiles]
    found = asdict(bank) | {"on": list(dict.fromkeys([*names, *titles] if bank.on is None else bank.on))}
    for chart in found["charts"]:
        for axis in (chart["x"], chart["y"]):
            said = list(axis.pop("names"))
            axis |= {"named": bool(said), "values": said or numbers(axis["values"]), "powers": _powers(axis)}
        for curve in chart["curves"]:
            curve |= {"x": numbers(curve["x"]), "y": numbers(curve["y"]), "notes": list(curve["notes"])}
            for name in ("open", "over", "methods", "band"):
                del curve[name]
        if tiles := chart["tiles"]:
            texts = list(dict.fromkeys(note for row in tiles["notes"] for note in row if note))
            at = {"": -1} | {text: i for i, text in enumerate(texts)}
            tiles |= {
                "rows": [[[len(list(run)), kind] for kind, run in groupby(row)] for row in tiles["rows"]],
                "texts": texts,
                "notes": [[at[note] for note in row] for row in tiles["notes"]],
            }
    return found


def _powers(axis: dict[str, Any]) -> list[tuple[float, int]]:
    """Places of powers of ten among many geometrically spaced values: [place, exponent], a few of them."""
    values = np.asarray(axis["values"], np.float64)
    if len(values) < 3 or not np.all(values > 0):
        return []
    logs = np.log10(values)
    ratios = np.diff(logs)
    if not np.allclose(ratios, ratios[0], rtol=1e-6):
        return []
    every = math.ceil((logs[-1] - logs[0]) / 7)
    exponents = range(every * math.ceil(logs[0] / every), math.floor(logs[-1]) + 1, every)
    return [(float((e - logs[0]) / ratios[0]), e) for e in exponents]


def numbers(values: Sequence[float] | Floats) -> list[float | str]:
    """Doubles as JSON reads them back bit for bit, and words for those that JSON has not."""
    words = {math.inf: "Infinity", -math.inf: "-Infinity"}
    return [x if math.isfinite(x) else words.get(x, "NaN") for x in np.asarray(values, np.float64).tolist()]
