"""Error against run time and force calls, in figures and in the report page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from springcheck.figures.charts import GUIDE, Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import scheme_of
from springcheck.figures.naming import labelled
from springcheck.studies.precision.fits import Point
from springcheck.studies.precision.result import PrecisionStudy
from springcheck.text.wording import seconds

FORCE_CALLS = "force calls"

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
        shown=(10.0 ** math.floor(math.log10(least)), min(MOST_SHOWN, 2 * max(x.error for x in points))),
    )
    time = "the run time of the engine alone, its smallest of several"
    calls = "force calls, which any machine counts alike"
    ways: tuple[tuple[str, str, Callable[[Point], float]], ...] = (
        (time, "run time [s]", lambda x: x.seconds),
        (calls, FORCE_CALLS, lambda x: float(x.force_calls or 0)),
    )
    charts = [
        Chart(
            title=f"Error against {title}.",
            short=f"against {name}",
            x=Scale(name=name, log=True),
            y=error,
            curves=[
                *_curves(study, known, cost),
                *(_slopes(study, known, cost) if name == FORCE_CALLS else ()),
            ],
            rules=_floors(study),
        )
        for title, name, cost in ways
        if (known := [x for x in points if cost(x) > 0])
    ]
    return (
        [
            Bank(
                name="precision",
                heading=_heading(study),
                title="Methods drawn",
                charts=[*map(labelled, charts)],
            )
        ]
        if charts
        else []
    )


def _heading(study: PrecisionStudy) -> str:
    """The cheapest way to the smallest error that somebody reached."""
    reached = [(x.target, x.point) for x in study.cheapest if x.point is not None]
    if not reached:
        return f"{study.scene.name}: error against cost, to the same final time"
    target, point = min(reached, key=lambda x: x[0])
    cheapest = f"is cheapest by {point.method}, in {seconds(point.seconds)}"
    return f"{study.scene.name}: an error of {target:.0e} {cheapest}"


def _floors(study: PrecisionStudy) -> list[Rule]:
    """The lowest rounding floor that was found of each scheme."""
    found: dict[str, float] = {}
    for one in study.methods:
        if one.floor is not None:
            scheme = scheme_of(one.method)
            found[scheme] = min(one.floor, found.get(scheme, math.inf))
    return [
        Rule(axis="y", at=y, name=f"rounding floor {y:.0e}", look="floor", group=scheme)
        for scheme, y in found.items()
    ]


def _slopes(study: PrecisionStudy, points: Sequence[Point], cost: Callable[[Point], float]) -> list[Curve]:
    """Guides with the slopes of the orders found, from one point at the left, clear of all curves."""
    orders = sorted({round(x.order) for x in study.methods if x.order is not None})
    left, errors = min(map(cost, points)), [math.log10(x.error) for x in points]
    start = 10 ** (min(errors) + 0.35 * (min(1.5, max(errors)) - min(errors)))
    return [
        Curve(name=f"order {n}", group=GUIDE, x=[left, left * 10**0.5], y=[start, start * 10 ** (-0.5 * n)])
        for n in orders
    ]


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
