"""Result of a study of precision: plain data, its text, and its figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck import schemes
from springcheck.errors import SpringcheckError
from springcheck.figures.charts import GUIDE, LOWEST, Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import scheme_of
from springcheck.figures.naming import at_their_ends
from springcheck.physics.scene import Scene
from springcheck.studies.choose import LeftOut, left_out
from springcheck.studies.keeper import document
from springcheck.studies.precision.fits import ASYMPTOTIC_ERROR, Fit
from springcheck.studies.precision.points import (
    CANNOT_RUN,
    COSTS,
    METRICS,
    POINTS,
    TARGETS,
    Point,
    Sweep,
    of_methods,
)
from springcheck.studies.study import Studied
from springcheck.text.lines import Lines, Row, Text, TextTable, plain, table
from springcheck.text.wording import count, seconds

UNNAMED = ("springcheck", "machine", "system", "host", "cores", "h5py", "hdf5")
"""What of the machine and the versions is not in the small print of a figure."""

MOST_SHOWN = 3.0
"""Largest error that is shown at first: larger ones are uninformative."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PrecisionStudy(Studied):
    """Everything that a study of precision has found on one scene; a row of its table is a point."""

    table_of: ClassVar[str] = "points"
    forms: ClassVar = {"points": POINTS}
    piece: ClassVar[str] = "point"

    scene: Scene
    metric: str
    budget: float
    seconds: float
    points: tuple[Point, ...]
    """The points of all methods."""
    machine: Mapping[str, str]
    python_call: float
    """Seconds of a force evaluated in Python."""

    def __repr__(self) -> str:
        best = min((x for sweep in self.sweeps for x in sweep.errors if x > 0), default=math.nan)
        done = f"{count(len(self.sweeps), 'method')}, {count(len(self.points), 'point')}"
        return f"PrecisionStudy({self.scene.name!r}, {done}, smallest error {best:.1e})"

    @property
    def sweeps(self) -> tuple[Sweep, ...]:
        """The points of each method."""
        return of_methods(self.points, self.metric)

    @property
    def status(self) -> Literal[0, 2]:
        """Exit status: 2 nothing was measured."""
        return 0 if any(point.complete for point in self.points) else 2

    @property
    def measured(self) -> list[Sweep]:
        """Sweeps with errors."""
        return [x for x in self.sweeps if x.complete]

    def winner(self, kind: str, target: float) -> tuple[Sweep, float] | None:
        """The method that reaches an error at the least cost, of those measured, and the cost."""
        found = [(x.cost(kind, target), j, x) for j, x in enumerate(self.measured)]
        best, _, sweep = min(found, default=(math.inf, 0, None))
        return None if sweep is None or best == math.inf else (sweep, best)

    @property
    def title(self) -> str:
        return f"{self.scene.title}: error against run time and force calls"

    def answer(self) -> Lines:
        return [plain(f"Error: {METRICS[self.metric]}.")]

    def tables(self) -> Lines:
        """Winners, costs of each error by method, orders and floors, what was not measured."""
        out: Lines = []
        if self.measured:
            out += [self._winners(), plain(), plain("Run time to an error of"), self._costs("time")]
            out += [plain(), plain("Force calls to an error of"), self._costs("calls"), plain()]
            out += [self._orders(), plain(), *self._calibration(), *self._notes()]
        unable = [LeftOut(method=x.method, reason=x.message) for x in self.points if x.outcome == CANNOT_RUN]
        return out + left_out(unable)

    def _winners(self) -> TextTable:
        rows: list[Row] = []
        for target in TARGETS:
            cells: list[str] = []
            for kind in ("time", "calls"):
                found = self.winner(kind, target)
                cells += [found[0].method, cost_in_words(kind, found[1])] if found else ["none", ""]
            rows.append((f"{target:.0e}", *cells))
        titles = ("error", "least time, of the methods measured", "time", "least force calls", "calls")
        return table(titles, rows, left=titles[1:4:2])

    def _costs(self, kind: str) -> TextTable:
        best = [self.winner(kind, target) for target in TARGETS]
        rows: list[Row] = []
        for x in self.measured:
            cells: list[Text] = []
            for target, won in zip(TARGETS, best, strict=True):
                cheapest = won is not None and won[0].method == x.method
                below = x.floor is not None and target < x.floor
                cost = x.cost(kind, target)
                text = cost_in_words(kind, cost) if cost < math.inf else "floor" if below else "-"
                cells.append(plain(f"{text}*" if cheapest else text, "bold green" if cheapest else ""))
            rows.append((x.method, *cells))
        return table(("method", *(f"{x:.0e}" for x in TARGETS)), rows)

    def _orders(self) -> TextTable:
        rows = [
            (
                x.method, "adaptive" if x.adaptive else _order(x.fit),
                "-" if x.floor is None else f"{x.floor:.0e}", seconds(x.seconds_per_call),
            )
            for x in self.measured
        ]  # fmt: skip
        return table(("method", "order", "floor", "time per force call"), rows)

    def _calibration(self) -> Lines:
        """What a force call costs in each engine, which explains winners that differ."""
        each: dict[str, float] = {}
        for x in self.measured:
            name = x.method.partition(":")[0]
            each[name] = min(x.seconds_per_call, each.get(name, math.inf))
        costs = [f"{name} {seconds(x)}" for name, x in each.items() if x < math.inf]
        said = f"A force call with its share of a step takes: {', '.join(costs)}."
        python = f"The force alone, called from Python: {seconds(self.python_call)}."
        pairs = [(self.winner("time", x), self.winner("calls", x)) for x in TARGETS]
        differ = any(a and b and a[0].method != b[0].method for a, b in pairs)
        why = "The winners differ where fewer force calls cost more time each." if differ else ""
        return [plain(x) for x in (said, python, why) if x]

    def _notes(self) -> Lines:
        out: Lines = [plain("*: least of the methods measured; floor: never below its rounding floor", "dim")]
        if lower := self._lowered:
            why = "has order 1 here: its kicks use forces that depend on velocities"
            out.append(plain(f"{', '.join(lower)}: {why}"))
        if any(not x.points[-1].complete for x in self.measured):
            out.append(
                plain(f"-: not measured, the budget of {self.budget:g} s or the run ended (--budget)", "dim")
            )
        return out

    @property
    def _lowered(self) -> list[str]:
        """Methods with an order that friction in their kicks lowers."""
        if not any(term.kind == "friction" for term in self.scene.terms):
            return []
        found = [(x.method, schemes.known().get(scheme_of(x.method))) for x in self.measured if x.fit]
        return [label for label, scheme in found if scheme and scheme.braked_order < scheme.order]

    def document(self) -> dict[str, Any]:
        """The study as plain data for JSON; unknown values are None."""
        winners = [(x, kind, self.winner(kind, x)) for x in TARGETS for kind in ("time", "calls")]
        return document(
            scene=self.scene.name, metric=self.metric, budget_seconds=self.budget, seconds=self.seconds,
            machine=self.machine, python_call_seconds=self.python_call,
            points=[point.document() for point in self.points],
            methods=[x.document() for x in self.sweeps],
            cheapest=[
                {"error": target, "by": kind, "method": won and won[0].method, "cost": won and won[1]}
                for target, kind, won in winners
            ],
            left_out=self.left_out,
        )  # fmt: skip

    def banks(self, **chosen: Any) -> list[Bank]:
        """The best method of each order against both costs, and the methods of each order.

        `x`, `y`: any cost or error along either axis instead.
        """
        for axis, name in chosen.items():
            if name not in QUANTITIES:
                raise SpringcheckError(f"--{axis} {name}: one of {', '.join(QUANTITIES)} is needed")
        if not (sweeps := [x for x in self.measured if any(np.array(x.errors) > 0)]):
            return []
        families: dict[str, list[Sweep]] = {}
        for x in sorted(sweeps, key=lambda x: (x.adaptive, _scheme_order(x))):
            families.setdefault("adaptive" if x.adaptive else f"order {_scheme_order(x)}", []).append(x)
        named = {name: text for name, text in self.machine.items() if name not in UNNAMED}
        versions = ", ".join(f"{name} {text}" for name, text in named.items())
        how = "run times without starts and recording, the fastest of repeats"
        foot = f"{self.scene.title}; best of {len(sweeps)} methods measured; {how}; {versions}"
        x, y = chosen.get("x", "time"), chosen.get("y", self.metric)
        if chosen:
            chart = _chart(sweeps, x, y, "")
            name = f"precision-{y}-over-{x}"
            return [Bank(name=name, heading=chart.title[:-1], title="Methods", charts=[chart], foot=foot)]
        best = [min(family, key=_rank) for family in families.values()]
        charts = [_chart(best, kind, y, f"best of each order, against {COSTS[kind]}") for kind in COSTS]
        several = [_chart(family, "time", y, name) for name, family in families.items() if len(family) > 1]
        found = [
            Bank(name="precision", heading=self._heading, title="Best methods", charts=charts, foot=foot)
        ]
        if several:
            heading = f"{self.scene.name}: methods of one order against run time"
            found.append(Bank(name="precision-orders", heading=heading, title="Methods", charts=several,
                              foot=foot, columns=2, size=(4.2, 3.0)))  # fmt: skip
        return found

    @property
    def _heading(self) -> str:
        target = next((x for x in TARGETS[2:] if self.winner("time", x)), TARGETS[0])
        won = [self.winner(kind, target) for kind in ("time", "calls")]
        time, calls = (x[0].method if x else "none" for x in won)
        if time == calls:
            return f"{target:.0e}: {time} takes least time and force calls"
        return f"{target:.0e}: {time} is fastest, {calls} calls forces least"


QUANTITIES = {**COSTS, **{name: f"{name} error" for name in METRICS}}
"""What an axis of the figure may show, and its name there."""


def cost_in_words(kind: str, x: float) -> str:
    """Two digits and a unit, or a whole number up to five digits."""
    if kind == "calls":
        return f"{math.ceil(x)}" if x < 1e6 else f"{x:.1e}".replace("e+0", "e")
    unit, size = next((one for one in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)) if x >= one[1]), ("ns", 1e-9))
    return f"{x / size:.0f}{unit}" if x / size >= 9.5 else f"{x / size:.1f}{unit}"


def _order(fit: Fit | None) -> str:
    """With the digits that its error allows, four at most."""
    if fit is None:
        return "-"
    digits = min(4, max(0, -math.floor(math.log10(fit.standard_error)))) if fit.standard_error else 4
    return f"{fit.order:.{digits}f}({fit.standard_error:.0e})"


def _scheme_order(x: Sweep) -> int:
    """The order of a method's scheme."""
    scheme = schemes.known().get(scheme_of(x.method))
    return scheme.order if scheme else 0


def _rank(x: Sweep) -> float:
    """Product of the run times of all errors: a day where one is not reached."""
    return math.prod(min(x.cost("time", target), 86400.0) for target in TARGETS)


def _chart(sweeps: Sequence[Sweep], kind: str, metric: str, short: str) -> Chart:
    """One quantity of these methods over another, the least of it as an envelope."""
    curves, rules, everything = [], [], []
    slopes: dict[int, tuple[list[tuple[float, float]], float]] = {}
    cheapest = min(sweeps, key=_rank).method
    for x in sweeps:
        pairs = zip(x.values(kind), x.values(metric), strict=True)
        everything += (known := [(c, e) for c, e in pairs if c > 0 and e > 0])
        costs, errors = (list(y) for y in zip(*known, strict=True)) if known else ([], [])
        group = scheme_of(x.method)
        curves.append(Curve(name=x.method, group=group, x=costs, y=errors, marks=True))
        if metric == x.metric and kind in COSTS:
            floor, order = x.floor, round(x.fit.order) if x.fit else 0
            if floor is not None:
                name = f"floor {floor:.0e}"
                rules.append(Rule(axis="y", at=floor, name=name, look="floor", group=group))
            if order and (order not in slopes or x.method == cheapest):
                slopes[order] = known, floor or 0.0
    least, most = (f(e for _, e in everything) for f in (min, max))
    parts = enumerate(sorted(slopes.items()), 1)
    curves += [_triangle(order, *one, i / (len(slopes) + 1)) for i, (order, one) in parts]
    curves += [_envelope(everything)] * (kind in COSTS)
    shown = 10.0 ** math.floor(math.log10(least)), min(MOST_SHOWN if metric in METRICS else most, 2 * most)
    return at_their_ends(Chart(
        title=f"{QUANTITIES[metric]} over {QUANTITIES[kind]}.".capitalize(), short=short,
        x=Scale(name=QUANTITIES[kind], log=True), y=Scale(name=QUANTITIES[metric], log=True, shown=shown),
        curves=curves, rules=rules,
    ))  # fmt: skip


def _triangle(order: int, points: Sequence[tuple[float, float]], floor: float, part: float) -> Curve:
    """A triangle of the slope of an order, below this part of the asymptotic points of a curve."""
    known = [(c, e) for c, e in points if 1e3 * floor < e < ASYMPTOTIC_ERROR] or [*points]
    cost, error = known[int(len(known) * part)]
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
