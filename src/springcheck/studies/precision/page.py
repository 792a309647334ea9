"""Figures of error against run time and force calls, and of errors over long times."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from springcheck import schemes
from springcheck.figures.charts import GUIDE, LOWEST, Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import scheme_of
from springcheck.figures.naming import labelled
from springcheck.studies.precision.fits import ASYMPTOTIC_ERROR
from springcheck.studies.precision.longtime import LongTime
from springcheck.studies.precision.points import COSTS, Sweep
from springcheck.studies.precision.result import TARGETS, PrecisionStudy

UNNAMED = ("springcheck", "machine", "system", "host", "cores", "h5py", "hdf5")
"""What of the machine and the versions is not in the small print."""

MOST_SHOWN = 3.0
"""Largest error that is shown at first: larger ones are uninformative."""


def banks(study: PrecisionStudy | LongTime) -> list[Bank]:
    """The best method of each order against both costs, and the methods of each order."""
    if isinstance(study, LongTime):
        return _long(study)
    if not (sweeps := [x for x in study.measured if any(np.array(x.errors) > 0)]):
        return []
    families: dict[str, list[Sweep]] = {}
    for x in sorted(sweeps, key=lambda x: (x.adaptive, _order(x))):
        families.setdefault("adaptive" if x.adaptive else f"order {_order(x)}", []).append(x)
    best = [min(family, key=_rank) for family in families.values()]
    charts = [
        _chart(study, best, kind, f"best of each order, against {name}") for kind, name in COSTS.items()
    ]
    several = [_chart(study, family, "time", name) for name, family in families.items() if len(family) > 1]
    of = f"{study.scene.title}; best of {len(sweeps)} methods measured"
    how = "run times without starts and recording, the fastest of repeats"
    named = {name: text for name, text in study.machine.items() if name not in UNNAMED}
    versions = ", ".join(f"{name} {text}" for name, text in named.items())
    foot = f"{of}; {how}; {versions}"
    found = [Bank(name="precision", heading=_heading(study), title="Best methods", charts=charts, foot=foot)]
    if several:
        heading = f"{study.scene.name}: methods of one order against run time"
        found.append(Bank(
            name="precision-orders", heading=heading, title="Methods", charts=several, foot=foot, columns=2,
            size=(4.2, 3.0),
        ))  # fmt: skip
    return found


def _order(x: Sweep) -> int:
    """The order of a method's scheme."""
    scheme = schemes.known().get(scheme_of(x.method))
    return scheme.order if scheme else 0


def _rank(x: Sweep) -> float:
    """Sum of the logarithms of the run times to all errors; an error that is not reached counts as a day."""
    return sum(math.log(min(x.cost("time", target), 86400.0)) for target in TARGETS)


def _heading(study: PrecisionStudy) -> str:
    target = next((x for x in TARGETS[2:] if study.winner("time", x)), TARGETS[0])
    won = [study.winner(kind, target) for kind in COSTS]
    time, calls = (x[0].method if x else "none" for x in won)
    if time == calls:
        return f"{target:.0e}: {time} takes least time and force calls"
    return f"{target:.0e}: {time} is fastest, {calls} calls forces least"


def _chart(study: PrecisionStudy, sweeps: Sequence[Sweep], kind: str, short: str) -> Chart:
    curves, rules, everything = [], [], []
    triangles: dict[int, Curve] = {}
    cheapest = min(sweeps, key=_rank).method
    for x in sweeps:
        known = [(c, e) for c, e in zip(x.costs(kind), x.errors, strict=True) if c > 0 and e > 0]
        everything += known
        costs, errors = (list(y) for y in zip(*known, strict=True)) if known else ([], [])
        group = scheme_of(x.method)
        curves.append(Curve(name=x.method, group=group, x=costs, y=errors, marks=True))
        if x.floor is not None:
            rules.append(Rule(axis="y", at=x.floor, name=f"floor {x.floor:.0e}", look="floor", group=group))
        if x.fit and (round(x.fit.order) not in triangles or x.method == cheapest):
            triangles[round(x.fit.order)] = _triangle(round(x.fit.order), known, x.floor or 0.0)
    least, most = (f(e for _, e in everything) for f in (min, max))
    curves += [*triangles.values(), _envelope(everything)]
    shown = 10.0 ** math.floor(math.log10(least)), min(MOST_SHOWN, 2 * most)
    return labelled(Chart(
        title=f"Error {short}.", short=short, x=Scale(name=COSTS[kind], log=True),
        y=Scale(name=f"{study.metric} error", log=True, shown=shown), curves=curves, rules=rules,
    ), by_name=True)  # fmt: skip


def _triangle(order: int, points: Sequence[tuple[float, float]], floor: float) -> Curve:
    """A triangle of the slope of an order, below the asymptotic part of a curve."""
    known = [(c, e) for c, e in points if 1e3 * floor < e < ASYMPTOTIC_ERROR] or [*points]
    cost, error = known[len(known) // 2]
    wide = 0.3
    x = [cost * 10 ** (wide * z) for z in (0, 0, 1, 0)]
    y = [error / 8 * 10 ** (-wide * order * z) for z in (0, 1, 1, 0)]
    return Curve(name=f"{order}", group=GUIDE, x=x, y=y)


def _envelope(points: Sequence[tuple[float, float]]) -> Curve:
    """The lowest error for each cost."""
    best: list[tuple[float, float]] = []
    for cost, error in sorted(points):
        if not best or error < best[-1][1]:
            best.append((cost, error))
    x, y = zip(*best, strict=True)
    return Curve(name="least cost of an error", group=LOWEST, x=x, y=y)


def _long(study: LongTime) -> list[Bank]:
    """The law of each scheme as a line, measurements as marks."""
    if not any(len(x.error) for x in study.runs):
        return []
    curves, per = [], study.w * abs(study.scene.step) / (2 * math.pi)
    for x in study.runs:
        group = scheme_of(x.method)
        curves.append(Curve(name=x.method, group=group, x=x.law_steps * per, y=x.law))
        curves.append(Curve(name=x.method, group=group, x=x.periods, y=x.error, line=False, marks=True))
    values = np.concatenate([np.asarray(x.y) for x in curves])
    least = float(np.min(values[values > 0]))
    rules = []
    heading = f"{study.scene.name}: {study.metric} error over {study.periods:.0e} periods"
    # the highest order, and the first of at most half of it by which it is overtaken
    crossings = sorted(study.crossings, key=lambda x: (-x[0].order, 2 * x[1].order > x[0].order, x[2]))
    if crossings:
        a, b, steps = crossings[0]
        heading = f"{a.method} falls behind {b.method} after {steps:,.0f} steps"
        rules = [Rule(axis="x", at=steps * per, name=f"{steps * per:,.0f} periods")]
    shown = max(1e-16, 10.0 ** math.floor(math.log10(least))), min(MOST_SHOWN, 2 * float(np.nanmax(values)))
    chart = labelled(Chart(
        title="Errors over long times: lines in theory, marks as measured.",
        x=Scale(name="periods", log=True), y=Scale(name=f"{study.metric} error", log=True, shown=shown),
        curves=curves, rules=rules,
    ))  # fmt: skip
    return [Bank(name="precision-long", heading=heading, title="Methods", charts=[chart])]
