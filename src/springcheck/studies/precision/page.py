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
"""Largest error that is shown at first: larger ones are uninformative."""


WAYS: tuple[tuple[str, str, Callable[[Point], float]], ...] = (
    ("run time [s]", "the run time of the engine alone, its smallest of several", lambda x: x.seconds),
    (FORCE_CALLS, "force calls, which any machine counts alike", lambda x: float(x.force_calls or 0)),
)
"""Costs: the name of the axis, the title, and the cost of a point."""


def banks(study: PrecisionStudy) -> list[Bank]:
    """Charts of all points, against run time and against force calls."""
    points = [x for x in study.points if x.complete and x.error > 0]
    if not points:
        return []
    least = min(x.error for x in points)
    error = Scale(
        name="largest error / initial energy norm",
        log=True,
        shown=(10.0 ** math.floor(math.log10(least)), min(MOST_SHOWN, 2 * max(x.error for x in points))),
    )
    charts = []
    for name, title, cost in WAYS:
        known = [x for x in points if cost(x) > 0]
        if not known:
            continue
        curves = _curves(study, known, cost)
        if name == FORCE_CALLS:
            curves += _slopes(study, known, cost)
        charts.append(labelled(Chart(
            title=f"Error against {title}.", short=f"against {name}", x=Scale(name=name, log=True),
            y=error, curves=curves, rules=_floors(study),
        )))  # fmt: skip
    if not charts:
        return []
    return [Bank(name="precision", heading=_heading(study), title="Methods drawn", charts=charts)]


def _heading(study: PrecisionStudy) -> str:
    """The cheapest way to the smallest target that any method reached."""
    reached = [(target, point) for target, point in study.cheapest if point is not None]
    if not reached:
        return f"{study.scene.name}: error against cost, to the same final time"
    target, point = min(reached, key=lambda x: x[0])
    cheapest = f"is cheapest by {point.method}, in {seconds(point.seconds)}"
    return f"{study.scene.name}: an error of {target:.0e} {cheapest}"


def _floors(study: PrecisionStudy) -> list[Rule]:
    """The lowest rounding floor of each scheme."""
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
    """Guides with the slopes of the fitted orders, from one point at the left, away from all curves."""
    orders = sorted({round(x.fit.order) for x in study.methods if x.fit})
    left, errors = min(map(cost, points)), [math.log10(x.error) for x in points]
    start = 10 ** (min(errors) + 0.35 * (min(1.5, max(errors)) - min(errors)))
    return [
        Curve(name=f"order {n}", group=GUIDE, x=[left, left * 10**0.5], y=[start, start * 10 ** (-0.5 * n)])
        for n in orders
    ]


def _curves(study: PrecisionStudy, points: Sequence[Point], cost: Callable[[Point], float]) -> list[Curve]:
    floors = {x.method: x.floor for x in study.methods}
    found = []
    for method in dict.fromkeys(x.method for x in points):
        mine = [x for x in points if x.method == method]
        notes = [_said(x, floors[method]) for x in mine]
        x, y = [cost(x) for x in mine], [x.error for x in mine]
        found.append(Curve(name=method, group=scheme_of(method), x=x, y=y, marks=True, notes=notes))
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
