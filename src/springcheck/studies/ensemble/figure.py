"""Any quantity of an ensemble over any one or two of the fields that were varied."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from springcheck.figures import looks, overlay
from springcheck.figures.views import with_unit
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.studies.ensemble.measure import OUTCOMES
from springcheck.studies.ensemble.result import Ensemble
from springcheck.studies.ensemble.shown import (
    MOST,
    SIZES,
    TITLES,
    Choice,
    Line,
    Map,
    choices,
    edges,
    even_in_logarithm,
    parts,
)  # fmt: skip

CLIPPED = 1e6
"""Where a line that leaves it is drawn to."""

UNKNOWN = "#bbbbbb"
OUTCOME_COLORS = ("#9ecae1", "#d94801", "#444444")


def pictures(found: Ensemble, *, quantity: str | None = None, over: str | None = None) -> dict[str, Figure]:
    """Error and energy, or one `quantity`, over one or two fields, by name.

    SpringcheckError where there is no such quantity or field.
    """
    out = {}
    for choice in choices(found, quantity, over):
        shown = dict(parts(found, choice))
        if shown:
            fields = "" if over is None else "-over-" + "-".join(choice.over)
            out[f"ensemble-{choice.quantity}{fields}"] = drawn = picture(shown, choice)
            _say(drawn, found, shown, choice)
    return out


WORDS = {
    "stiffness": ("stiffness k", {"md": "kJ/mol/nm2", "si": "N/m"}),
    "mass": ("mass m", {"md": "u", "si": "kg"}),
    "step": ("step h", {"md": "ps", "si": "s"}),
    "steps": ("number of steps", {}),
}  # fmt: skip
"""The last part of a field's name in words, and its unit."""


def named(field: str, scene: Scene) -> str:
    """A field as an axis names it: "spring.0.stiffness" is the stiffness k of spring 0."""
    *table, last = field.split(".")
    words, of = WORDS.get(last, (last, {}))
    whose = f" of {' '.join(table)}" if table and table[-1].isdigit() else ""
    return with_unit(f"{words}{whose}", of.get(scene.units, ""))


def _say(figure: Figure, found: Ensemble, shown: Mapping[str, Line | Map], choice: Choice) -> None:
    """Words for the axes, the finding as the title, and the limit h omega = 2 of one spring."""
    scene, panels = (
        found.scene,
        figure.axes[: len(shown) if isinstance(next(iter(shown.values())), Map) else 1],
    )
    if isinstance(next(iter(shown.values())), Map):
        figure.supxlabel(named(choice.over[0], scene), fontsize=9)
        figure.supylabel(named(choice.over[1], scene), fontsize=9)
    else:
        panels[0].set_xlabel(named(choice.over[0], scene))
    typical = {x: float(np.nanmedian(y.y if isinstance(y, Line) else y.values)) for x, y in shown.items()}
    best = min(typical, key=lambda x: abs(typical[x]))
    said = f"; {best} has the smallest" if len(shown) > 1 and choice.quantity in SIZES else ""
    over = " and ".join(named(x, scene) for x in choice.over)
    parts = [f"{TITLES[choice.quantity].partition(',')[0]} over {over}{said}", figure.get_suptitle()]
    overlay.heading(figure, "; ".join(filter(None, parts)), 100)
    walls = [term for term in scene.terms if isinstance(term, WallSpring)]
    if scene.n > 1 or len(scene.terms) != 1 or not walls or len(walls[0]) != 1 or not walls[0].k[0] > 0:
        return
    m, k, h = float(scene.m[0]), float(walls[0].k[0]), abs(scene.step)
    limits = {"spring.0.stiffness": 4 * m / h**2, "time.step": 2 * np.sqrt(m / k)}
    how: Any = {"color": "#b00020", "linestyle": (0, (4, 2)), "linewidth": 1.0}
    for axes in panels:
        low, high = axes.get_xlim()
        if set(choice.over) == set(limits):
            # a linear axis begins below the first cell, perhaps below 0
            few, most = axes.get_xlim() if choice.over[0] != "time.step" else axes.get_ylim()
            ks = np.geomspace(max(few, 1e-3 * most), most, 200)
            across = (ks, 2 * np.sqrt(m / ks))
            with _kept(axes):
                axes.plot(*(across if choice.over[0] != "time.step" else across[::-1]), **how)
            axes.annotate("h ω = 2", (0.98, 0.9), xycoords="axes fraction",
                          ha="right", fontsize=7.5, color=how["color"])  # fmt: skip
        elif len(choice.over) == 1 and low < limits.get(choice.over[0], np.inf) < high:
            axes.axvline(limits[choice.over[0]], **how)
            axes.annotate("h ω = 2", (limits[choice.over[0]], 0.97), xytext=(3, -4),
                          xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=7.5,
                          color=how["color"])  # fmt: skip


@contextmanager
def _kept(axes: Axes) -> Iterator[None]:
    """Draw without another range of the axes."""
    x, y = axes.get_xlim(), axes.get_ylim()
    yield
    axes.set(xlim=x, ylim=y)


def picture(shown: Mapping[str, Line | Map], choice: Choice) -> Figure:
    """A quantity of each method over one field, or over two as a map."""
    lines = {method: one for method, one in shown.items() if isinstance(one, Line)}
    maps = {method: one for method, one in shown.items() if isinstance(one, Map)}
    return _lines(lines, choice) if lines else _maps(maps, choice)


def _lines(shown: Mapping[str, Line], choice: Choice) -> Figure:
    figure = Figure(figsize=(7.8, 4.6), layout="constrained")
    axes = figure.add_subplot()
    for scheme, methods in looks.by_scheme(shown).items():
        look = looks.look(scheme)
        for j, method in enumerate(methods):
            one, sign = shown[method], looks.mark(looks.engine(method))[0]
            low, y, high = (np.clip(values, -CLIPPED, CLIPPED) for values in (one.low, one.y, one.high))
            if j == 0 and not np.array_equal(low, high, equal_nan=True):
                axes.fill_between(one.x, low, high, color=look.color, alpha=0.2, linewidth=0)
            axes.plot(
                one.x, y, label=method, color=look.color,
                linestyle=look.linestyle if j == 0 and one.joined else "none", marker=sign,
                markevery=max(1, len(y) // 12) if one.joined else None, markerfacecolor="white",
                markersize=4, markeredgewidth=0.9,
            )  # fmt: skip
    if all(even_in_logarithm(one.x) for one in shown.values()):
        axes.set_xscale("log")
    if choice.quantity == "outcome":
        axes.set_yticks(range(len(OUTCOMES)), OUTCOMES)
    else:
        if choice.quantity == "steps":
            axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        _scaled(axes, np.concatenate([x for one in shown.values() for x in (one.low, one.y, one.high)]))
        axes.set_ylabel(TITLES[choice.quantity])
    axes.set_xlabel(choice.over[0])
    said = _fixed(shown)
    if any(np.any(one.low < one.high) for one in shown.values()):
        said.append("bands: all cells; lines: their median")
    axes.set_title("; ".join(said), loc="right", fontsize=8, color="#555555")
    overlay.scheme_legend(figure, looks.by_scheme(shown))
    return figure


def _maps(shown: Mapping[str, Map], choice: Choice) -> Figure:
    figure, grid, count = overlay.panels(len(shown), 3, (3.4, 1.2), (2.9, 0.5), shared="xy")
    colors, bar = _colors(choice.quantity, [x.values for x in shown.values()])
    for axes, (method, one) in zip(grid, shown.items(), strict=True):
        # what is exact has the first colour of a logarithmic scale
        values = np.maximum(one.values, colors["norm"].vmin or 0) if choice.quantity in SIZES else one.values
        drawn = axes.pcolormesh(edges(one.x), edges(one.y), values, rasterized=True, **colors)
        for centres, scale in ((one.x, axes.set_xscale), (one.y, axes.set_yscale)):
            if even_in_logarithm(centres):
                scale("log")
        axes.set_facecolor(UNKNOWN)
        axes.grid(visible=False)
        axes.set_title(method)
    for axes in grid[max(0, len(shown) - count) :]:
        axes.tick_params(labelbottom=True)
    said = _fixed(shown)
    if not all(np.isfinite(one.values).all() for one in shown.values()):
        said.append("grey: no cell or not known")
    if said:
        figure.suptitle("; ".join(said), x=0.02, ha="left", fontsize=8, color="#555555")
    figure.supxlabel(choice.over[0], fontsize=9)
    figure.supylabel(choice.over[1], fontsize=9)
    made = figure.colorbar(drawn, ax=figure.axes, **bar)
    if choice.quantity == "outcome":
        made.set_ticks(range(len(OUTCOMES)), labels=OUTCOMES)
    return figure


def _colors(quantity: str, values: Sequence[Floats]) -> tuple[dict[str, Any], dict[str, Any]]:
    """How the numbers of methods are coloured, for `pcolormesh`, and their scale, for `colorbar`."""
    every = np.concatenate([x[np.isfinite(x)] for x in values])
    low, high = float(np.min(every)), float(np.max(every))
    bar = {"label": TITLES[quantity]}
    if quantity == "outcome":
        norm = BoundaryNorm(np.arange(len(OUTCOMES) + 1) - 0.5, len(OUTCOMES))
        return {"cmap": ListedColormap(OUTCOME_COLORS), "norm": norm}, {}
    if quantity in SIZES and high > 0:
        # what explodes has the last colour
        top, least = min(high, MOST), float(np.min(every[every > 0]))
        scale = LogNorm if top > 30 * least else Normalize
        bar["extend"] = "max" if high > top else "neither"
        return {"cmap": "viridis", "norm": scale(min(least, top / 2), top)}, bar
    if low < 0:
        # of methods that explode as much as twice what the middle one shows
        sizes = sorted(float(np.max(np.abs(x[np.isfinite(x)]))) for x in values)
        most = min(max(-low, high), 2 * sizes[(len(sizes) - 1) // 2]) or max(-low, high)
        bar["extend"] = "both" if max(-low, high) > most else "neither"
        return {"cmap": "RdBu_r", "norm": Normalize(-most, most)}, bar
    return {"cmap": "viridis", "norm": Normalize(low, high if high > low else low + 1)}, bar


def _fixed(shown: Mapping[str, Line | Map]) -> list[str]:
    """What a picture says of the fields that it does not show."""
    fixed = next(iter(shown.values())).fixed
    return ["at " + ", ".join(f"{name} = {value:.4g}" for name, value in fixed.items())] if fixed else []


def _scaled(axes: Axes, values: Floats) -> None:
    good = values[np.isfinite(values)]
    least = good[good > 0]
    low, high = float(np.min(good)), float(np.max(good))
    if low >= 0 and len(least) and high > 100 * (first := float(np.min(least))):
        axes.set_yscale("log")
        axes.set_ylim(first / 2, min(2 * high, max(MOST, 4 * first)))
    elif max(-low, high) > MOST:
        axes.set_ylim(max(low, -MOST), min(high, MOST))
