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

NAME_AWAY, LETTER, NAME_PLACES = 0.03, 0.018, 60
"""Distance of a label from other curves and width of a letter, as fractions of the axes; and points at which
a label may find space."""


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
    """A chart with labels at the ends of its curves over time, next to the axes, or where they leave them.

    They are moved apart by the height of a line of text.
    """
    ends: list[tuple[float, str, str]] = []
    out: list[Naming] = []
    for text, group, u, v in _named(chart):
        inside = np.flatnonzero((u >= -0.01) & (u <= 1.01) & (v >= -0.01) & (v <= 1.01))
        if not len(inside):
            continue
        last = int(inside[-1])
        if u[last] > 0.9:
            ends.append((float(v[last]), text, group))
        elif not any(
            abs(v[last] - one.y) < height and abs(u[last] - one.x) < LETTER * len(text) for one in out
        ):
            out.append(Naming(text=text, group=group, x=float(u[last]) + 0.01, y=min(0.9, float(v[last]))))
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
    return replace(chart, labels=[*out[:MOST_NAMINGS], *beside])


def labelled(chart: Chart, *, by_name: bool = False) -> Chart:
    """A chart with labels on the curves that are well separated somewhere, each where it is farthest from all
    others."""
    points: dict[tuple[str, str], Floats] = {}
    for text, group, u, v in _named(chart, by_name=by_name):
        inside = (u > 0.02) & (u < 0.98) & (v > 0.03) & (v < 0.95)
        points[text, group] = np.stack([u[inside], v[inside]], axis=1)
    out: list[Naming] = []
    # faults come first, lines that are no scheme's last
    order = sorted(points.items(), key=lambda x: (x[0][1] != REJECTED, x[0][1] == SEPARATRIX))
    for (text, group), mine in order:
        others = np.concatenate([np.empty((0, 2)), *(x for key, x in points.items() if key != (text, group))])
        best, found = NAME_AWAY, None
        for x, y in mine[:: max(1, len(mine) // NAME_PLACES)].tolist():
            # where its words stand
            at = np.array(
                [[x + s * 0.2 * LETTER * len(text) * (1 if x < 0.6 else -1), y + 0.02] for s in range(6)]
            )
            room = [float(np.min(np.hypot(*(others - place).T), initial=1.0)) for place in at]
            taken = any(abs(y - one.y) < NAME_HIGH and abs(x - one.x) < LETTER * len(text) for one in out)
            if not taken and min(room) > best:
                best, found = min(room), (x, y)
        if by_name and found is None and len(mine):
            # where it ends
            found = tuple(mine[-1].tolist())
        if found is not None and len(out) < MOST_NAMINGS:
            out.append(Naming(text=text, group=group, x=found[0], y=found[1]))
    return replace(chart, labels=out)
