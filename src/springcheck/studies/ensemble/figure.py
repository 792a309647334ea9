"""Any quantity of an ensemble over any one or two of the fields that were varied."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, SymLogNorm
from matplotlib.figure import Figure

from springcheck.figures.style import look, save, style
from springcheck.studies.ensemble.measure import columns
from springcheck.studies.ensemble.result import Columns, Ensemble

DRAWN = ("max_error", "energy_drift")


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
        for i, (method, x) in enumerate(shown.items()):
            order = np.argsort(x[over[0]])
            axes.plot(x[over[0]][order], x[quantity][order], label=method, **look(i))
        _scaled(axes, quantity, np.concatenate([x[quantity] for x in shown.values()]))
        axes.set_xlabel(over[0])
        axes.set_ylabel(quantity.replace("_", " "))
        figure.legend(loc="outside right upper", frameon=False)
        return figure
    count = min(3, len(shown))
    rows = -(-len(shown) // count)
    figure = Figure(figsize=(3.9 * count, 3.2 * rows + 0.5), layout="constrained")
    grid = np.atleast_1d(figure.subplots(rows, count, sharex=True, sharey=True)).ravel()
    every = np.concatenate([x[quantity] for x in shown.values()])
    every = every[np.isfinite(every)]
    norm: LogNorm | SymLogNorm
    if np.min(every) > 0:
        norm = LogNorm(float(np.min(every)), float(np.max(every)))
    else:
        norm = SymLogNorm(1e-16, vmin=float(np.min(every)), vmax=float(np.max(every)))
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
        figure.colorbar(mark, ax=list(grid), label=quantity.replace("_", " "))
    return figure


def _slice(x: Columns, found: Ensemble, over: tuple[str, ...]) -> Columns:
    keep = np.ones(len(x[over[0]]), dtype=bool)
    for name in found.fields:
        if found.grid and name not in over:
            values = np.unique(x[name])
            keep &= x[name] == values[len(values) // 2]
    return {name: column[keep] for name, column in x.items()}


def _scaled(axes: Axes, quantity: str, values: np.ndarray) -> None:
    good = values[np.isfinite(values)]
    if len(good) and np.min(good) > 0 and np.max(good) > 100 * np.min(good):
        axes.set_yscale("log")
