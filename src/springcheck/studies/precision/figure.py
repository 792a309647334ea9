"""Error against run time and against force calls: a colour for each scheme, a mark for each engine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from springcheck.figures import looks, overlay
from springcheck.studies.precision.result import PrecisionStudy

Document = Mapping[str, Any]

ROOM = 30.0
"""Errors above this are left of the picture: nothing is read off them."""


def pictures(study: PrecisionStudy) -> dict[str, Figure]:
    """The one figure of a study, fresh or stored, by name; none where it has no errors."""
    document = study.document()
    return {"precision": picture(document)} if any(x["max_error"] for x in document["points"]) else {}


def picture(document: Document) -> Figure:
    """The two panels, with one legend beside them."""
    figure = Figure(figsize=(11.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    drawn = [method for method in document["methods"] if _of(document, method["method"], "run_seconds")]
    groups = looks.by_scheme(method["method"] for method in drawn)
    for axes, cost in ((left, "run_seconds"), (right, "force_calls")):
        for scheme, labels in groups.items():
            # as many force calls are the same curve: one line, and the marks of every engine
            longest = max(labels, key=lambda label: len(_of(document, label, "force_calls")))
            for label in labels:
                _line(axes, document, label, cost, scheme, line=cost == "run_seconds" or label == longest)
        axes.set_xscale("log")
        axes.set_yscale("log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(numticks=20))
            axis.set_minor_formatter(NullFormatter())
    _frame(left, document)
    floors = _floors(document, groups)
    for scheme, y in floors.items():
        look = looks.look(scheme)
        for axes in (left, right):
            axes.axhline(y, color=look.color, linewidth=0.8, linestyle=(0, (1, 3)), zorder=1)
        right.annotate(
            f"{y:.0e}", (1.0, y), xycoords=("axes fraction", "data"), xytext=(-2, 2),
            textcoords="offset points", ha="right", fontsize=7, color=look.color,
        )  # fmt: skip
    _slopes(right, document)
    left.set_xlabel("run time of the engine alone (s)")
    right.set_xlabel("force calls")
    left.set_ylabel("largest error / initial energy norm")
    overlay.heading(figure, f"{document['scene']}: error against cost, to the same final time", 90)
    extra = [Line2D([], [], color="#666666", linewidth=0.8, linestyle=(0, (1, 3)), label="rounding floor")]
    overlay.scheme_legend(figure, groups, *(extra if floors else []))
    return figure


def _of(document: Document, method: str, cost: str) -> list[Mapping[str, Any]]:
    return [
        point
        for point in document["points"]
        if point["method"] == method and point["max_error"] and point[cost]
    ]


def _line(axes: Axes, document: Document, label: str, cost: str, scheme: str, *, line: bool) -> None:
    """One method's points, those of the largest errors left out."""
    points = _of(document, label, cost)
    x = np.array([point[cost] for point in points], dtype=float)
    y = np.array([point["max_error"] for point in points], dtype=float)
    look = looks.look(scheme)
    marks: dict[str, Any] = {
        "marker": looks.mark(looks.engine(label))[0],
        "markersize": 4,
        "markerfacecolor": "white",
        "markeredgecolor": look.color,
        "markeredgewidth": 0.8,
    }
    axes.plot(
        x, y, color=look.color, linestyle=look.linestyle if line else "none", linewidth=1.0, label=label,
        markevery=1 if len(x) <= MOST_MARKS else len(x) // MOST_MARKS + 1, **marks,
    )  # fmt: skip


MOST_MARKS = 14
"""Of each line."""


def _floors(document: Document, groups: Mapping[str, list[str]]) -> dict[str, float]:
    """The lowest rounding floor that was found of each scheme."""
    found = {}
    for scheme, labels in groups.items():
        floors = [
            method["floor"]
            for method in document["methods"]
            if method["method"] in labels and method["floor"] is not None
        ]
        if floors:
            found[scheme] = min(floors)
    return found


def _frame(axes: Axes, document: Document) -> None:
    errors = [point["max_error"] for point in document["points"] if point["max_error"]]
    axes.set_ylim(10.0 ** np.floor(np.log10(min(errors))), min(ROOM, 2 * max(errors)))


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
