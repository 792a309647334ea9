"""Charts as pictures: what `charts` describes and the report page draws, drawn by matplotlib."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter

from springcheck.figures import looks, overlay
from springcheck.figures.charts import GUIDE, Bank, Chart, Curve, Rule, Scale

SHADES = {"good": "#9ecae1", "wild": "#fee391", "limit": "#d94801", "refused": "#bdbdbd", "wrong": "#000000"}
"""Of the kinds of tiles, as on the page's paper."""

RULES = {"limit": ("#b00020", (0, (4, 2))), "one": ("#888888", "-"), "here": ("#333333", (0, (1, 2))),
         "floor": ("#666666", (0, (1, 3)))}  # fmt: skip
"""Colour and line of each look of a rule."""

NOT_TRIED = ("not tried", "#ffffff")
"""Of a tile without a kind."""

EXACT = "exact"
"""The group of the exact solution: broad and grey, behind all others."""

MOST_MARKS, MANY = 14, 200
"""Marks on a curve; one of more points than are many, and no line, shows them all, small."""

ENTRY = 0.36
"""Height of an entry of the legend [in]."""

MOST_TICKS, MOST_TICKS_UP, EVEN = 8, 12, 40
"""Values of tiles that are written, and upwards; more than so many in even ratios: powers of ten."""

SMALL_MAPS = 6
"""Maps from which on they are small, three beside each other, and write what they have in common once."""


def picture(bank: Bank) -> Figure:
    """One figure of all its charts, with one legend."""
    charts, tiled = bank.charts, any(chart.tiles for chart in bank.charts)
    named = max((len(chart.y.names) for chart in charts), default=0)
    wide = 4.6 if len(charts) > 1 else 6.0
    high = 0.19 * named + 2.2 if named else 3.3 if tiled else 4.3
    small = tiled and not named and len(charts) >= SMALL_MAPS
    if small:
        wide, high = 3.7, 2.2
    columns = min(3 if small or (len(charts) == 3 and not tiled) else 2, len(charts))
    handles: list[Any] = _entries([curve for chart in charts for curve in chart.curves])
    handles += _kinds(charts)
    # room for the whole legend
    high = max(high, ENTRY * len(handles) / -(-len(charts) // columns))
    figure, grid, _ = overlay.panels(len(charts), columns, (wide, 2.4), (high, 0.6))
    for axes, chart in zip(grid, charts, strict=True):
        _chart(axes, chart)
    for j, axes in enumerate(grid if small else ()):
        axes.set_ylabel(axes.get_ylabel() if j % columns == 0 else "")
        axes.set_xlabel(axes.get_xlabel() if j >= len(grid) - columns else "")
    overlay.heading(figure, bank.heading or charts[0].title, 62 * columns)
    figure.legend(
        handles=handles, loc="outside right upper", frameon=False, labelspacing=0.7, handlelength=2.6
    )
    return figure


def _entries(curves: Sequence[Curve]) -> list[Line2D]:
    """One entry for each group of curves, with the marks of the engines of its methods."""
    groups: dict[str, list[str]] = {}
    for curve in curves:
        names = groups.setdefault(curve.group, [])
        if curve.name not in names:
            names.append(curve.name)
    found = []
    for group, names in groups.items():
        if group == GUIDE:
            continue
        if group == EXACT:
            found.append(Line2D([], [], color="#b3b3b3", linewidth=4, label=names[0]))
            continue
        methods = [name for name in names if ":" in name]
        look = looks.look(group)
        title = looks.title(group) if methods else names[0]
        label = f"{title}\n{looks.members(methods)}" if methods else title
        found.append(Line2D([], [], color=look.color, linestyle=look.linestyle, label=label))
    return found


def _kinds(charts: Sequence[Chart]) -> list[Patch]:
    found = {kind for chart in charts if chart.tiles for kind in chart.tiles.kinds}
    kinds = [chart.tiles.kinds[i] if i >= 0 else NOT_TRIED for chart in charts if chart.tiles
             for row in chart.tiles.rows for i in row]  # fmt: skip
    seen = dict.fromkeys(kinds) if found else {}
    return [
        Patch(facecolor=SHADES.get(shade, shade), edgecolor="#bbbbbb", linewidth=0.4, label=name)
        for name, shade in seen
    ]


def _chart(axes: Axes, chart: Chart) -> None:
    if chart.tiles:
        _tiles(axes, chart)
    for number, curve in enumerate(chart.curves):
        _curve(axes, curve, number)
    for number, rule in enumerate(chart.rules):
        _rule(axes, rule, 0.98 - 0.1 * (number % 4))
    for scale, axis in ((chart.x, "x"), (chart.y, "y")):
        _scale(axes, scale, axis, tiled=chart.tiles is not None)
    if chart.equal:
        axes.set_aspect("equal")
    if chart.short:
        axes.set_title(textwrap.fill(chart.short, 56), fontsize=8.5, loc="left")


def _curve(axes: Axes, curve: Curve, number: int) -> None:
    look = looks.look(curve.group)
    x, y = np.asarray(curve.x, np.float64), np.asarray(curve.y, np.float64)
    if curve.group == EXACT:
        axes.plot(x, y, color="#b3b3b3", linewidth=4, alpha=0.7, zorder=1)
        return
    if curve.group == GUIDE:
        axes.plot(x, y, color="#333333", linewidth=0.9)
        how: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8, "color": "#333333"}
        axes.annotate(curve.name, (x[-1], y[-1]), xytext=(3, -4), **how)
        return
    if curve.line:
        axes.plot(x, y, color=look.color, linestyle=look.linestyle, linewidth=1.1, zorder=2)
    mark = looks.mark(looks.engine(curve.name))[0]
    if curve.marks:
        many = len(x) > MANY and not curve.line
        apart = 1 if many else max(1, len(x) // MOST_MARKS)
        first = round(number * overlay.GOLDEN % 1 * apart) % apart
        estimated = np.asarray(curve.open, bool) if len(curve.open) else np.zeros(len(x), bool)
        for some, face in ((~estimated, look.color if len(curve.open) else "white"), (estimated, "white")):
            here = np.flatnonzero(some)[first::apart]
            axes.plot(
                x[here], y[here], linestyle="none", marker=mark, markersize=1.8 if many else 4,
                markerfacecolor=face, markeredgecolor=look.color, markeredgewidth=0.9, zorder=3,
            )  # fmt: skip
    elif curve.line and ":" in curve.name and len(x):
        # where it ends
        axes.plot(x[-1:], y[-1:], marker=mark, color=look.color, markersize=4, zorder=3)


def _rule(axes: Axes, rule: Rule, height: float) -> None:
    """A line, and its name: of an upright one at this height of the picture."""
    color, line = RULES[rule.look]
    color = looks.look(rule.group).color if rule.group else color
    draw = axes.axvline if rule.axis == "x" else axes.axhline
    draw(rule.at, color=color, linestyle=line, linewidth=0.9, zorder=1.5)
    how: dict[str, Any] = {"fontsize": 7.5, "color": color, "textcoords": "offset points"}
    if rule.axis == "x":
        axes.annotate(rule.name, (rule.at, height), xycoords=("data", "axes fraction"), xytext=(3, -6), **how)
    else:
        place = (0.99, rule.at)
        axes.annotate(rule.name, place, xycoords=("axes fraction", "data"), xytext=(0, 3), ha="right", **how)


def _tiles(axes: Axes, chart: Chart) -> None:
    tiles = chart.tiles
    assert tiles is not None
    shades = [SHADES.get(shade, shade) for _, shade in tiles.kinds]
    plane = np.ma.masked_less(np.asarray(tiles.rows), 0)
    axes.grid(False)
    axes.imshow(
        plane, origin="lower", aspect="auto", cmap=ListedColormap(shades), vmin=-0.5,
        vmax=len(shades) - 0.5, interpolation="nearest",
    )  # fmt: skip


def _scale(axes: Axes, scale: Scale, which: str, *, tiled: bool) -> None:
    names, values = list(scale.names), np.asarray(scale.values, np.float64)
    put = axes.set_xticks if which == "x" else axes.set_yticks
    if names:
        put(range(len(names)), names, fontsize=7, rotation=90 if which == "x" else 0)
    elif tiled and len(values) > EVEN and np.all(values > 0):
        decades = np.arange(np.ceil(np.log10(values[0])), np.log10(values[-1]) + 1e-9)
        at = np.interp(decades, np.log10(values), np.arange(len(values)))
        put(at, [f"$10^{{{int(e)}}}$" for e in decades])
    elif tiled:
        shown = range(0, len(values), -(-len(values) // (MOST_TICKS if which == "x" else MOST_TICKS_UP)))
        put(list(shown), [f"{values[i]:.3g}" for i in shown])
    else:
        if scale.log:
            (axes.set_xscale if which == "x" else axes.set_yscale)("log")
            (axes.xaxis if which == "x" else axes.yaxis).set_minor_formatter(NullFormatter())
        if scale.shown:
            (axes.set_xlim if which == "x" else axes.set_ylim)(*scale.shown)
    (axes.set_xlabel if which == "x" else axes.set_ylabel)(scale.name)
