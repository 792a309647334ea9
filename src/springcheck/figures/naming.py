"""Labels of the curves of a chart, each where it is well separated or where it ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.figures import looks
from springcheck.figures.charts import (
    BEGIN,
    EXACTLY,
    GUIDE,
    LOWEST,
    REJECTED,
    SEPARATRIX,
    Chart,
    Curve,
    Naming,
)
from springcheck.figures.frames import Frame
from springcheck.physics.arrays import Floats

MOST_NAMINGS, NAME_HIGH = 9, 0.052
"""Most curves with a label on them, and the height of a label as a fraction of the axes'."""

LETTER = 0.018
"""Width of a letter as a fraction of the axes."""


Place = tuple[str, str, Floats, Floats]


def _named(chart: Chart, *, by_name: bool = False) -> list[Place]:
    """Title (with `by_name` the curve's name), group and points, as parts of the picture, of the first curve
    of each scheme or wrong run."""
    firsts: dict[tuple[str, str], Curve] = {}
    for curve in chart.curves:
        joined = (curve.line or curve.dots) and not curve.over and len(curve.x)
        if joined and curve.group not in (EXACTLY, GUIDE, LOWEST, BEGIN):
            plain = by_name or curve.group in (REJECTED, SEPARATRIX)
            title = curve.name if plain else looks.title(curve.group)
            firsts.setdefault((title, curve.group), curve)
    sides = []
    for scale, which in ((chart.x, "x"), (chart.y, "y")):
        ends = scale.shown
        if ends is None:
            every = np.concatenate([np.asarray(getattr(one, which), np.float64) for one in chart.curves])
            every = every[np.isfinite(every) & ((every > 0) | (not scale.log))]
            ends = float(np.min(every)), float(np.max(every))
        sides.append(Frame(*ends, log=scale.log))
    xs, ys = sides
    return [(*key, xs.parts(curve.x), ys.parts(curve.y)) for key, curve in firsts.items()]


def at_ends(chart: Chart, *, height: float = NAME_HIGH) -> Chart:
    """A chart with labels at the ends of its curves over time, next to the axes.

    They are moved apart by the height of a line of text.
    """
    ends: list[tuple[float, str, str]] = []
    for text, group, u, v in _named(chart):
        inside = np.flatnonzero((u >= -0.01) & (u <= 1.01) & (v >= -0.01) & (v <= 1.01))
        if len(inside) and u[inside[-1]] > 0.9:
            ends.append((float(v[inside[-1]]), text, group))
    ends.sort()
    most = min(MOST_NAMINGS, int(1 / height))
    if len(ends) > most:
        # what is wrong, and the outermost
        inner = [one for one in ends[most // 3 : -(most // 3)] if one[2] != REJECTED]
        ends = [one for one in ends if one not in inner][:most]
    places = [y for y, *_ in ends]
    for _ in range(200):
        for i in range(len(places) - 1):
            short = height - (places[i + 1] - places[i])
            if short > 0:
                places[i] -= short / 2
                places[i + 1] += short / 2
        places = [min(max(y, height * i), 1 - height * (len(places) - 1 - i)) for i, y in enumerate(places)]
    beside = [
        Naming(text=text, group=group, x=1.0, y=y) for y, (_, text, group) in zip(places, ends, strict=True)
    ]
    return replace(chart, labels=beside)


def at_their_ends(chart: Chart) -> Chart:
    """A chart with the names of its curves below their ends, inside the axes; moved apart by a line of text
    where they would overlap.  Of many curves none is named: the legend does that."""
    ends = []
    for text, group, u, v in _named(chart, by_name=True):
        inside = np.flatnonzero((u > 0) & (u < 1) & (v > 0) & (v < 1))
        if len(inside):
            ends.append((float(v[inside[-1]]), float(u[inside[-1]]), text, group))
    out: list[Naming] = []
    for y, x, text, group in sorted(ends) if len(ends) <= MOST_NAMINGS else []:
        near = [one.y for one in out if abs(one.x - x) < LETTER * max(len(text), len(one.text))]
        lowest = max([NAME_HIGH, *(taken + NAME_HIGH for taken in near)])
        out.append(Naming(text=text, group=group, x=x, y=max(y, lowest), below=True))
    return replace(chart, labels=out)
