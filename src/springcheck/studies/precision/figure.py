"""Error against run time and against force calls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from springcheck.figures.style import COLOURS, LINES, MARKERS, save, style
from springcheck.studies.precision.result import PrecisionStudy

Document = Mapping[str, Any]

ROOM = 30.0
"""Errors above this are left of the picture: nothing is read off them."""


def draw(study: PrecisionStudy, folder: Path) -> list[Path]:
    """Draw a study, fresh or stored, into a folder; returns the files."""
    document = study.document()
    if not any(point["max_error"] for point in document["points"]):
        return []
    with style():
        return save(picture(document), folder, "precision")


def picture(document: Document) -> Figure:
    """The two panels, with one legend beside them."""
    figure = Figure(figsize=(10.5, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    looks = _looks([method["method"] for method in document["methods"]])
    for axes, cost in ((left, "run_seconds"), (right, "force_calls")):
        for method in document["methods"]:
            _line(axes, document, method, cost, looks[method["method"]])
        axes.set_xscale("log")
        axes.set_yscale("log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(numticks=20))
            axis.set_minor_formatter(NullFormatter())
    _frame(left, document)
    for axes in (left, right):
        _slopes(axes, document)
    left.set_xlabel("run time of the engine alone (s)")
    right.set_xlabel("force calls")
    left.set_ylabel("largest error (distance in the energy norm, of the start)")
    figure.suptitle(f"{document['scene']}: error against cost, to the same final time", x=0.02, ha="left")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside right upper", frameon=False, handlelength=3.2, title="method (order)"
    )
    rounding = any(point["rounding_error"] for point in document["points"])
    about = [
        *(["faint dots: the part of\n  the error that is rounding"] if rounding else []),
        *(["ring: rounding floor"] if any(method["floor"] for method in document["methods"]) else []),
    ]
    figure.text(0.995, 0.02, "\n".join(about), ha="right", va="bottom", fontsize=8, color="#444444")
    return figure


def _looks(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """A colour for each engine, or for each method of a single one; a marker and a line style for each."""
    engines = list(dict.fromkeys(name.partition(":")[0] for name in names))
    families = engines if len(engines) > 1 else list(names)
    count = dict.fromkeys(families, 0)
    out: dict[str, dict[str, Any]] = {}
    for i, name in enumerate(names):
        family = name.partition(":")[0] if len(engines) > 1 else name
        place = families.index(family)
        # the first families are drawn hollow and larger, so that curves that coincide show both
        hollow = place < max(1, len(families) // 2)
        out[name] = {
            "color": COLOURS[place % len(COLOURS)],
            "linestyle": LINES[count[family] % len(LINES)],
            "marker": MARKERS[i % len(MARKERS)],
            "markerfacecolor": "none" if hollow else None,
            "markersize": 6.5 if hollow else 3.2,
        }
        count[family] += 1
    return out


def _of(document: Document, method: str, cost: str) -> list[Mapping[str, Any]]:
    return [
        point
        for point in document["points"]
        if point["method"] == method and point["max_error"] and point[cost]
    ]


def _line(
    axes: Axes, document: Document, method: Mapping[str, Any], cost: str, look: Mapping[str, Any]
) -> None:
    name = method["method"]
    points = _of(document, name, cost)
    if not points:
        return
    x = np.array([point[cost] for point in points], dtype=float)
    y = np.array([point["max_error"] for point in points], dtype=float)
    order = method["order"]
    label = name if order is None else f"{name}  ({order:.2f})"
    axes.plot(x, y, label=label, linewidth=1.0, markeredgewidth=0.9, **look)
    known = [point["rounding_error"] is not None and point["rounding_error"] > 0 for point in points]
    if any(known):
        rounding = np.array([point["rounding_error"] or np.nan for point in points], dtype=float)
        axes.plot(x, rounding, ".", markersize=2.2, color=look["color"], alpha=0.45)
    if method["floor"] is not None:
        best = int(np.argmin(np.abs(y - method["floor"])))
        axes.plot(x[best], y[best], "o", markersize=10, fillstyle="none", color=look["color"])
        axes.axhline(y[best], color=look["color"], linewidth=0.7, linestyle=(0, (1, 3)))
        if cost == "run_seconds":
            axes.annotate(
                f"{y[best]:.1e}",
                (x[best], y[best]),
                xytext=(8, -10),
                textcoords="offset points",
                fontsize=7.5,
                color=look["color"],
            )


def _frame(axes: Axes, document: Document) -> None:
    errors = [point["max_error"] for point in document["points"] if point["max_error"]]
    parts = [point["rounding_error"] for point in document["points"] if point["rounding_error"]]
    low = min([*errors, *(part for part in parts if part > 1e-16)])
    axes.set_ylim(10.0 ** np.floor(np.log10(low)), min(ROOM, 2 * max(errors)))


def _slopes(axes: Axes, document: Document) -> None:
    """Short lines of the orders that were found, from one point at the lower left, where no curve runs."""
    orders = sorted({round(m["order"]) for m in document["methods"] if m["order"] is not None})
    x = axes.get_xlim()[0] * np.array([1.8, 1.8 * 10**0.7])
    low, high = np.log10(axes.get_ylim())
    start = 10 ** (low + 0.6 * (high - low))
    grey: Any = {"fontsize": 8, "color": "#333333", "textcoords": "offset points"}
    if orders:
        axes.annotate("order", (float(x[0]), float(start)), xytext=(-4, 4), **grey)
    for order in orders:
        y = start * np.array([1.0, 10.0 ** (-0.7 * order)])
        axes.plot(x, y, color="#333333", linewidth=0.9)
        axes.annotate(f"{order}", (float(x[1]), float(y[1])), xytext=(3, -4), **grey)
