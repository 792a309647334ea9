"""Any quantity of an ensemble over any one or two of the fields that were varied."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, SymLogNorm
from matplotlib.figure import Figure

from springcheck.figures import looks, overlay
from springcheck.figures.style import save, style
from springcheck.studies.ensemble.measure import columns
from springcheck.studies.ensemble.result import Columns, Ensemble

DRAWN = ("max_error", "energy_drift")

MOST = 1e3
"""Errors and energies, relative to those of the start, beyond which nothing is read off a picture."""

FAR = 1e6
"""Where a line that leaves it is drawn to."""


def draw(found: Ensemble, folder: Path) -> list[Path]:
    """Draw error and energy over the first one or two fields into a folder; returns the files."""
    if found.path is None:
        return []
    cells = {x.method: columns(found.path, x.method) for x in found.tallies if x.complete}
    written = []
    with style():
        for quantity in DRAWN:
            if any(np.isfinite(x[quantity]).any() for x in cells.values()):
                written += save(picture(found, cells, quantity), folder, f"ensemble-{quantity}")
    return written


def picture(
    found: Ensemble, cells: dict[str, Columns], quantity: str, fields: tuple[str, ...] | None = None
) -> Figure:
    """A quantity of each method over one field, or over two as a map; the other fields of a grid in their
    middle."""
    over = (fields or found.fields)[:2]
    shown = {method: _slice(x, found, over) for method, x in cells.items()}
    if len(over) == 1:
        figure = Figure(figsize=(7.2, 4.6), layout="constrained")
        axes = figure.add_subplot()
        for scheme, methods in looks.by_scheme(shown).items():
            look = looks.look(scheme)
            for j, method in enumerate(methods):
                x, sign = shown[method], looks.mark(looks.engine(method))[0]
                order = np.argsort(x[over[0]])
                axes.plot(
                    x[over[0]][order], np.clip(x[quantity][order], -FAR, FAR), label=method, color=look.color,
                    linestyle=look.linestyle if j == 0 else "none", marker=sign,
                    markevery=max(1, len(order) // 12), markerfacecolor="white", markersize=4,
                )  # fmt: skip
        _scaled(axes, np.concatenate([x[quantity] for x in shown.values()]))
        axes.set_xlabel(over[0])
        axes.set_ylabel(quantity.replace("_", " "))
        overlay.scheme_legend(figure, looks.by_scheme(shown))
        return figure
    count = min(3, len(shown))
    rows = -(-len(shown) // count)
    figure = Figure(figsize=(3.9 * count, 3.2 * rows + 0.5), layout="constrained")
    grid = np.atleast_1d(figure.subplots(rows, count, sharex=True, sharey=True)).ravel()
    every = np.concatenate([x[quantity] for x in shown.values()])
    every = every[np.isfinite(every)]
    # what explodes has the last colour
    low, high = (float(np.clip(x, -MOST, MOST)) for x in (np.min(every), np.max(every)))
    norm = LogNorm(low, max(high, 2 * low)) if low > 0 else SymLogNorm(1e-16, vmin=low, vmax=max(high, 1e-15))
    mark = None
    for axes, (method, x) in zip(grid, shown.items(), strict=False):
        mark = axes.scatter(x[over[0]], x[over[1]], c=x[quantity], norm=norm, s=9, marker="s", linewidths=0)
        for name, scale in zip(over, (axes.set_xscale, axes.set_yscale), strict=True):
            if np.min(x[name]) > 0 and np.max(x[name]) > 100 * np.min(x[name]):
                scale("log")
        axes.set_title(method)
    for axes in grid[len(shown) :]:
        axes.set_axis_off()
    figure.supxlabel(over[0], fontsize=9)
    figure.supylabel(over[1], fontsize=9)
    if mark is not None:
        beyond = "max" if np.max(every) > MOST else "neither"
        figure.colorbar(mark, ax=list(grid), label=quantity.replace("_", " "), extend=beyond)
    return figure


def _slice(x: Columns, found: Ensemble, over: tuple[str, ...]) -> Columns:
    keep = np.ones(len(x[over[0]]), dtype=bool)
    for name in found.fields:
        if found.grid and name not in over:
            values = np.unique(x[name])
            keep &= x[name] == values[len(values) // 2]
    return {name: column[keep] for name, column in x.items()}


def _scaled(axes: Axes, values: np.ndarray) -> None:
    good = values[np.isfinite(values)]
    if not len(good):
        return
    low, high = float(np.min(good)), float(np.max(good))
    if low > 0 and high > 100 * low:
        axes.set_yscale("log")
        axes.set_ylim(low / 2, min(2 * high, max(MOST, 4 * low)))
    elif max(-low, high) > MOST:
        axes.set_ylim(max(low, -MOST), min(high, MOST))
