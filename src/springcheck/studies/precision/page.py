"""Error against run time and force calls in the report page."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from springcheck.figures.charts import Bank, Chart, Curve, Scale
from springcheck.figures.looks import scheme_of
from springcheck.studies.precision.points import Point
from springcheck.studies.precision.result import PrecisionStudy
from springcheck.text.wording import seconds

MOST_SHOWN = 30.0
"""Errors above this are out of the picture at first: nothing is read off them."""


def banks(study: PrecisionStudy) -> list[Bank]:
    """Two charts of all points."""
    points = [x for x in study.points if x.complete and x.error > 0]
    if not points:
        return []
    least = min(x.error for x in points)
    error = Scale(
        name="largest error / initial energy norm",
        log=True,
        shown=(least / 2, min(MOST_SHOWN, 2 * max(x.error for x in points))),
    )
    time = "the run time of the engine alone, its smallest of several"
    calls = "force calls, which any machine counts alike"
    ways: tuple[tuple[str, str, Callable[[Point], float]], ...] = (
        (time, "run time [s]", lambda x: x.seconds),
        (calls, "force calls", lambda x: float(x.force_calls or 0)),
    )
    charts = [
        Chart(
            title=f"Error against {title}.",
            x=Scale(name=name, log=True),
            y=error,
            curves=_curves(study, known, cost),
        )
        for title, name, cost in ways
        if (known := [x for x in points if cost(x) > 0])
    ]
    return [Bank(title="Methods drawn", charts=charts)] if charts else []


def _curves(study: PrecisionStudy, points: Sequence[Point], cost: Callable[[Point], float]) -> list[Curve]:
    found = []
    for method in dict.fromkeys(x.method for x in points):
        mine = [x for x in points if x.method == method]
        known = next((x for x in study.methods if x.method == method), None)
        floor = known.floor if known else None
        found.append(
            Curve(
                name=method,
                group=scheme_of(method),
                x=[cost(x) for x in mine],
                y=[x.error for x in mine],
                marks=True,
                notes=[_said(x, floor) for x in mine],
            )
        )
    return found


def _said(x: Point, floor: float | None) -> str:
    where = f"tolerance {x.tolerance:g}" if x.tolerance is not None else f"step {x.step:.6g}"
    counts = ((x.steps, "steps"), (x.force_calls, "force calls"))
    parts = [where, *(f"{count} {what}" for count, what in counts if count is not None), seconds(x.seconds)]
    if x.rounding:
        parts.append(f"rounding alone {x.rounding:.2g}")
    if floor is not None and x.error == floor:
        parts.append("the rounding floor")
    return ", ".join(parts)
