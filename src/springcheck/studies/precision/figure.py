"""Error against run time and against force calls: a colour for each scheme, a mark for each engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from springcheck.figures import looks, overlay
from springcheck.studies.precision.points import Point
from springcheck.studies.precision.result import PrecisionStudy

ROOM = 30.0
"""Errors above this are left of the picture: nothing is read off them."""


def pictures(study: PrecisionStudy) -> dict[str, Figure]:
    """The one figure of a study, fresh or stored, by name; none where it has no errors."""
    return {"precision": picture(study)} if any(x.error > 0 for x in study.points) else {}


def picture(study: PrecisionStudy) -> Figure:
    """The two panels, with one legend beside them."""
    figure = Figure(figsize=(11.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    groups = looks.by_scheme(x.method for x in study.methods if _of(study, x.method, "seconds"))
    for axes, cost in ((left, "seconds"), (right, "force_calls")):
        for scheme, labels in groups.items():
            # as many force calls are the same curve: one line, and the marks of every engine
            longest = max(labels, key=lambda label: len(_of(study, label, "force_calls")))
            for label in labels:
                points = _of(study, label, cost)
                _line(axes, label, points, cost, scheme, line=cost == "seconds" or label == longest)
        axes.set_xscale("log")
        axes.set_yscale("log")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(numticks=20))
            axis.set_minor_formatter(NullFormatter())
    _frame(left, study)
    floors = _floors(study, groups)
    for scheme, y in floors.items():
        look = looks.look(scheme)
        for axes in (left, right):
            axes.axhline(y, color=look.color, linewidth=0.8, linestyle=(0, (1, 3)), zorder=1)
        right.annotate(
            f"{y:.0e}", (1.0, y), xycoords=("axes fraction", "data"), xytext=(-2, 2),
            textcoords="offset points", ha="right", fontsize=7, color=look.color,
        )  # fmt: skip
    _slopes(right, study)
    left.set_xlabel("run time of the engine alone (s)")
    right.set_xlabel("force calls")
    left.set_ylabel("largest error / initial energy norm")
    overlay.heading(figure, f"{study.scene.name}: error against cost, to the same final time", 90)
    extra = [Line2D([], [], color="#666666", linewidth=0.8, linestyle=(0, (1, 3)), label="rounding floor")]
    overlay.scheme_legend(figure, groups, *(extra if floors else []))
    return figure


def _of(study: PrecisionStudy, method: str, cost: str) -> list[Point]:
    """The points of a method that have an error and this cost."""
    return [x for x in study.of(method) if x.error > 0 and (getattr(x, cost) or 0) > 0]


def _line(axes: Axes, label: str, points: Sequence[Point], cost: str, scheme: str, *, line: bool) -> None:
    """One method's points, those of the largest errors left out."""
    x = [getattr(point, cost) for point in points]
    y = [point.error for point in points]
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


def _floors(study: PrecisionStudy, groups: Mapping[str, list[str]]) -> dict[str, float]:
    """The lowest rounding floor that was found of each scheme."""
    found = {x.method: x.floor for x in study.methods if x.floor is not None}
    of_schemes = {
        scheme: [found[label] for label in labels if label in found] for scheme, labels in groups.items()
    }
    return {scheme: min(floors) for scheme, floors in of_schemes.items() if floors}


def _frame(axes: Axes, study: PrecisionStudy) -> None:
    errors = [point.error for point in study.points if point.error > 0]
    axes.set_ylim(10.0 ** np.floor(np.log10(min(errors))), min(ROOM, 2 * max(errors)))


def _slopes(axes: Axes, study: PrecisionStudy) -> None:
    """Short lines of the orders that were found, from one point at the lower left, where no curve runs."""
    orders = sorted({round(x.order) for x in study.methods if x.order is not None})
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
