"""Charts as pictures: what `charts` describes and the report page draws, drawn by matplotlib."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogFormatterSciNotation

from springcheck.figures import looks
from springcheck.figures.charts import (
    BEGIN,
    EXACTLY,
    GUIDE,
    LOWEST,
    REJECTED,
    SEPARATRIX,
    Bank,
    Chart,
    Curve,
    Naming,
    Rule,
    Scale,
)
from springcheck.physics.arrays import Floats

TILES_SHADED = {
    "good": "#9ecae1", "wild": "#fee391", "limit": "#8c6bb1", "refused": "#bdbdbd", "wrong": "#dd0033",
}  # fmt: skip
"""Colours of the kinds of tiles, as on the page's paper."""

RULES = {"limit": ("#b00020", (0, (4, 2))), "one": ("#888888", "-"), "here": ("#333333", (0, (1, 2))),
         "floor": ("#666666", (0, (1, 3)))}  # fmt: skip
"""Colour and line of each look of a rule."""

NO_KIND = ("not tried", "#ffffff")
"""Name and colour of a tile without a kind."""

MOST_MARKS, FEWEST_MARKS, ALL_MARKS, MANY = 14, 4, 66, 200
"""Most and fewest marks on a curve, and most on all curves of a chart; more points than the last of a curve
without a line are all shown, as small marks."""

GOLDEN_PART = 0.618
"""Curves begin their marks at its multiples, modulo 1, which are well spread however many there are."""

DRAWN_UP_TO = 1e6
"""Multiple of the axes' range up to which a line is drawn: farther, drawing it overflows."""

LEGEND_LINE = 0.17
"""Height of a line of the legend with the space between entries [in]."""

AROUND = [patheffects.withStroke(linewidth=2.5, foreground="white")]
"""White around words and guides, so that lines do not run through them."""

LETTERS, SMALL_LETTERS, WIDEST = 11.3, 18, 38
"""Letters of a title per inch, and of the small print; most letters of a line of the legend."""

MOST_TICKS, MOST_TICKS_UP, EVEN = 8, 12, 40
"""Most values of tiles that are written along x and along y; of more than `EVEN` geometrically spaced ones,
powers of ten."""

SMALL_MAPS = 6
"""Number of maps from which on they are small, three side by side, and write common labels once."""


def picture(bank: Bank) -> Figure:
    """One figure of all its charts, with one legend."""
    charts, tiled = bank.charts, any(chart.tiles for chart in bank.charts)
    named = max((len(chart.y.names) for chart in charts), default=0)
    wide = 4.6 if len(charts) > 1 else 6.0
    high = 0.19 * named + 2.2 if named else 3.3 if tiled else 4.3
    small = tiled and not named and len(charts) >= SMALL_MAPS
    if small:
        wide, high = 3.7, 2.2
    columns = bank.columns or min(3 if small or (len(charts) == 3 and not tiled) else 2, len(charts))
    wide, high = bank.size or (wide, high)
    handles: list[Any] = _entries([curve for chart in charts for curve in chart.curves])
    handles += _kinds(charts)
    # names at the curves take the place of a legend
    direct = bool(charts[0].labels) and all(_all_named(chart) for chart in charts)
    lines = 0 if direct else sum(1 + handle.get_label().count("\n") for handle in handles)
    rows = -(-len(charts) // columns)
    # space for the whole legend
    figure = Figure(
        figsize=(wide * columns + (0 if direct else 2.4), max(high * rows, LEGEND_LINE * lines) + 0.6),
        layout="constrained",
    )
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(charts) :]:
        axes.set_axis_off()
    for axes, chart in zip(grid, charts, strict=False):
        _chart(axes, chart, round(wide * LETTERS))
    _shared(list(grid[: len(charts)]), charts, columns)
    _heading(figure, bank.heading or charts[0].title, min(110, max(60, round(wide * columns * LETTERS))))
    if not direct:
        figure.legend(
            handles=handles, loc="outside right upper", frameon=False, labelspacing=0.7, handlelength=2.6
        )
    if bank.foot:
        print_ = textwrap.fill(bank.foot, min(118, round(figure.get_figwidth() * SMALL_LETTERS)))
        figure.supxlabel(print_, x=0.02, ha="left", fontsize=6.5, color="#666666")
    return figure


def _all_named(chart: Chart) -> bool:
    """Whether every curve has its name on it."""
    names = {x.name for x in chart.curves if x.group not in (GUIDE, LOWEST)}
    return names <= {x.text for x in chart.labels}


def _shared(grid: Sequence[Axes], charts: Sequence[Chart], columns: int) -> None:
    """Charts with the same axis next to or above one another name it once."""
    for j, (axes, chart) in enumerate(zip(grid, charts, strict=True)):
        below = charts[j + columns] if j + columns < len(charts) else None
        # scales that are equal along both axes make boxes of unlike sizes
        if below and below.x == chart.x and not chart.equal:
            axes.set_xlabel("")
            axes.tick_params(labelbottom=False)
        if j % columns and charts[j - 1].y == chart.y and not chart.equal:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)


LONGEST_TITLE = 1000
"""Characters of a heading: matplotlib lays out a hundred thousand for minutes."""


def _heading(figure: Figure, text: str, width: int) -> None:
    # a number keeps its unit, and a name its hyphen
    joined = text[:LONGEST_TITLE].replace(" %", "\0%")
    kept = textwrap.fill(joined, width, break_on_hyphens=False).replace("\0", " ")
    figure.suptitle(kept, x=0.02, ha="left", fontsize=10)


def _entries(curves: Sequence[Curve]) -> list[Line2D]:
    """One entry for each group of curves, with the marks of the engines of its methods; faults come first."""
    groups: dict[tuple[str, str], list[Curve]] = {}
    for curve in curves:
        mine = groups.setdefault((curve.group, curve.name if curve.group == REJECTED else ""), [])
        if curve.name not in [one.name for one in mine]:
            mine.append(curve)
    found = []
    for (group, _), mine in groups.items():
        name = mine[0].name
        methods = [x for one in mine for x in (one.methods or [one.name]) if ":" in x]
        title = textwrap.fill((mine[0].title or looks.title(group)) if methods else name, WIDEST)
        label = f"{title}\n{looks.members(methods)}" if methods else title
        if group == REJECTED:
            sign = looks.mark(looks.engine(name))[1]
            label = f"FAILED: {name}\n{sign} {textwrap.fill(mine[0].title, 30)}"
        if group in OTHER_LINES and (mine[0].line or group == BEGIN):
            found.append(Line2D([], [], **OTHER_LINES[group], label=label))
        elif group != GUIDE:
            look = looks.look(group)
            line: Any = look.linestyle if any(one.line or one.dots for one in mine) else "none"
            mark = looks.mark(looks.engine(name))[0] if line == "none" and not methods else None
            found.append(
                Line2D([], [], color=look.color, linestyle=line, marker=mark, markerfacecolor="white",
                       label=label)
            )  # fmt: skip
    return sorted(found, key=lambda entry: not str(entry.get_label()).startswith("FAILED"))


OTHER_LINES: dict[str, dict[str, Any]] = {
    EXACTLY: {"color": "#b3b3b3", "linewidth": 4.0, "alpha": 0.7, "zorder": 1},
    SEPARATRIX: {"color": "#666666", "linewidth": 0.9, "linestyle": (0, (2, 2)), "zorder": 1.5},
    LOWEST: {"color": "#e3e3e3", "linewidth": 7.0, "zorder": 1, "solid_joinstyle": "round"},
    BEGIN: {"color": "k", "linestyle": "none", "marker": "+", "markersize": 9, "zorder": 4},
}
"""Line styles of what is no scheme's."""


def _kinds(charts: Sequence[Chart]) -> list[Patch]:
    maps = [chart.tiles for chart in charts if chart.tiles]
    seen = {one.kinds[i] if i >= 0 else NO_KIND for one in maps for row in one.rows for i in row}
    every = [kind for one in maps for kind in one.kinds]
    return [
        Patch(facecolor=TILES_SHADED.get(shade, shade), edgecolor="#bbbbbb", linewidth=0.4, label=name)
        for name, shade in dict.fromkeys([*every, NO_KIND])
        if (name, shade) in seen
    ]


def _chart(axes: Axes, chart: Chart, letters: int) -> None:
    if chart.tiles:
        _tiles(axes, chart)
    most = min(MOST_MARKS, max(FEWEST_MARKS, ALL_MARKS // max(1, len(chart.curves))))
    for number, curve in enumerate(chart.curves):
        _curve(axes, curve, number, most, chart)
    for number, rule in enumerate(chart.rules):
        _rule(axes, rule, 0.98 - 0.1 * (number % 4))
    _scale(axes, chart.x, "x", tiled=chart.tiles is not None)
    _scale(axes, chart.y, "y", tiled=chart.tiles is not None)
    if chart.equal:
        axes.set_aspect("equal", adjustable="box", anchor="N")
    if chart.short:
        axes.set_title(textwrap.fill(chart.short, letters), fontsize=8.5, loc="left")
    if chart.note:
        under = "\n" if chart.short else ""
        axes.set_title(textwrap.fill(chart.note, letters) + under, loc="right", fontsize=7.5, color="#555555")
    for label in chart.labels:
        _label(axes, label)


def _label(axes: Axes, label: Naming) -> None:
    color = OTHER_LINES[label.group]["color"] if label.group in OTHER_LINES else looks.look(label.group).color
    left = label.below and label.x > 0.55
    axes.annotate(
        textwrap.shorten(label.text, 34, placeholder="..."), (label.x, label.y), xycoords="axes fraction",
        xytext=(-5 if left else 6, -4 if left else 0), textcoords="offset points",
        ha="right" if left else "left", va="top" if left else "center", fontsize=7.5, color=color, zorder=5,
        annotation_clip=False, path_effects=AROUND,
    )  # fmt: skip


def _drawable(values: Any, scale: Scale) -> Floats:
    """Numbers in the unit of their axis; those far beyond it are clipped."""
    x = np.asarray(values, np.float64)
    if scale.shown is not None:
        low, high = scale.shown
        far = DRAWN_UP_TO * max(abs(low), abs(high))
        x = np.clip(x, -far, far)
    return x * scale.factor


def _curve(axes: Axes, curve: Curve, number: int, most: int, chart: Chart) -> None:
    scales, tiled = (chart.x, chart.y), chart.tiles is not None
    look, high = looks.look(curve.group), int(curve.group == REJECTED)
    x, y = (_drawable(one, scale) for one, scale in zip((curve.x, curve.y), scales, strict=True))
    if curve.group in OTHER_LINES and (curve.line or curve.group == BEGIN):
        axes.plot(x, y, label=curve.name, **OTHER_LINES[curve.group])
        return
    if curve.group == GUIDE:
        axes.plot(x, y, color="#333333", linewidth=0.9, path_effects=AROUND, zorder=4)
        # in a map there is nothing beside it
        at = len(x) // 3 if tiled else -1
        side = "right" if tiled and x[at] > len(chart.x.values) / 2 else "left"
        axes.annotate(
            curve.name, (x[at], y[at]), xytext=(3 if side == "left" else -3, -4), ha=side, zorder=5,
            textcoords="offset points", fontsize=8, color="#333333", path_effects=AROUND,
        )  # fmt: skip
        return
    drawn: dict[str, Any] = {"color": look.color, "label": curve.name, "zorder": 2 + 1.2 * high}
    if curve.band is not None:
        low, top = (_drawable(one, scales[1]) for one in curve.band)
        if curve.line:
            axes.fill_between(x, low, top, color=look.color, alpha=0.2, linewidth=0)
        else:
            axes.vlines(x, low, top, color=look.color, linewidth=1)
    if curve.dots and not curve.over:
        axes.plot(x, y, ".", markersize=3 + 2 * high, **drawn)
        if curve.line:
            axes.plot(x, y, color=look.color, linewidth=0.7, alpha=0.4, zorder=1.5)
    elif curve.line and not curve.over:
        axes.plot(x, y, linestyle=look.linestyle, linewidth=1.2 + 0.7 * high, **drawn)
    mark = looks.mark(looks.engine(curve.name))[0]
    # a mark on the edge of the picture is drawn whole, and none beyond it
    inside = np.ones(len(x), bool)
    for values, scale in zip((x, y), scales, strict=True):
        if scale.shown is not None:
            least, largest = sorted(scale.factor * end for end in scale.shown)
            inside &= (least <= values) & (values <= largest)
    if curve.marks:
        many = len(x) > MANY and not (curve.line or curve.over or curve.dots)
        apart = 1 if many or chart.y.names else max(1, len(x) // most)
        first = round(number * GOLDEN_PART % 1 * apart) % apart
        estimated = np.asarray(curve.open, bool) if len(curve.open) else np.zeros(len(x), bool)
        for some, face in ((~estimated, look.color if len(curve.open) else "white"), (estimated, "white")):
            here = np.flatnonzero(some)[first::apart]
            here = here[inside[here]]
            if len(here):
                axes.plot(
                    x[here], y[here], linestyle="none", marker=mark, markersize=1.8 if many else 4.1,
                    markerfacecolor=face, markeredgecolor=look.color, markeredgewidth=0.9, zorder=3 + high,
                    label=curve.name, clip_on=False,
                )  # fmt: skip
    elif curve.line and ":" in curve.name and inside[-1:].any():
        # where it ends
        axes.plot(x[-1:], y[-1:], marker=mark, color=look.color, markersize=4, zorder=3, clip_on=False)


def _rule(axes: Axes, rule: Rule, height: float) -> None:
    """A line, and its name: of an upright one at this height of the picture."""
    color, line = RULES[rule.look]
    color = looks.look(rule.group).color if rule.group else color
    draw = axes.axvline if rule.axis == "x" else axes.axhline
    draw(rule.at, color=color, linestyle=line, linewidth=0.9, zorder=1.5)
    how: dict[str, Any] = {
        "fontsize": 7.5, "color": color, "textcoords": "offset points", "path_effects": AROUND, "zorder": 4.5
    }  # fmt: skip
    if rule.axis == "x":
        axes.annotate(rule.name, (rule.at, height), xycoords=("data", "axes fraction"), xytext=(3, -6), **how)
    else:
        # errors begin small, and end small where they cost most: the left of both lines is free
        axes.annotate(rule.name, (0.01, rule.at), xycoords=("axes fraction", "data"), xytext=(0, 3), **how)


def _tiles(axes: Axes, chart: Chart) -> None:
    tiles = chart.tiles
    assert tiles is not None
    shades = [TILES_SHADED.get(shade, shade) for _, shade in tiles.kinds]
    plane = np.ma.masked_less(np.asarray(tiles.rows), 0)
    axes.grid(False)
    axes.imshow(
        plane, origin="lower", aspect="auto", cmap=ListedColormap(shades), vmin=-0.5,
        vmax=len(shades) - 0.5, interpolation="nearest",
    )  # fmt: skip


def _scale(axes: Axes, scale: Scale, which: Literal["x", "y"], *, tiled: bool) -> None:
    names, values = list(scale.names), np.asarray(scale.values, np.float64)
    axis = axes.xaxis if which == "x" else axes.yaxis
    if names:
        axis.set_ticks(range(len(names)), names, fontsize=7, rotation=90 if which == "x" else 0)
    elif tiled and len(values) > EVEN and np.all(values > 0):
        decades = np.arange(np.ceil(np.log10(values[0])), np.log10(values[-1]) + 1e-9)
        at = np.interp(decades, np.log10(values), np.arange(len(values)))
        axis.set_ticks(at, [f"$10^{{{int(e)}}}$" for e in decades])
    elif tiled:
        shown = range(0, len(values), -(-len(values) // (MOST_TICKS if which == "x" else MOST_TICKS_UP)))
        axis.set_ticks(list(shown), [f"{values[i]:.3g}" for i in shown])
    elif scale.log:
        axes.set(**{f"{which}scale": "log"})
        axis.set_minor_formatter(LogFormatterSciNotation(labelOnlyBase=False, minor_thresholds=(1.5, 0.4)))
    else:
        axes.ticklabel_format(axis=which, useOffset=False)
    if scale.shown:
        axes.set(**{f"{which}lim": tuple(scale.factor * x for x in scale.shown)})
    axes.set(**{f"{which}label": scale.name})
