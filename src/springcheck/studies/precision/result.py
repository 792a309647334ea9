"""Result of a study of precision: plain data, and its text."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from springcheck import schemes
from springcheck.figures.looks import scheme_of
from springcheck.physics.scene import Scene
from springcheck.studies.choose import LeftOut
from springcheck.studies.keeper import document
from springcheck.studies.precision.fits import Fit
from springcheck.studies.precision.points import CANNOT_RUN, Point, Sweep
from springcheck.studies.study import Studied
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, Row, Text, TextTable, plain, table
from springcheck.text.wording import count, few, seconds

TARGETS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Errors to which costs are reported."""

METRIC_WORDS = {
    "largest": "largest error, relative to the initial energy norm",
    "end": "error at the end, relative to the initial energy norm",
    "energy": "largest energy error, relative to the initial kinetic and potential energy",
    "phase": "largest phase error, in radians",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PrecisionStudy(Studied):
    """Everything that a study of precision has found on one scene; a row of its table is a point."""

    table_of: ClassVar[str] = "points"

    scene: Scene
    metric: str
    budget: float
    seconds: float
    sweeps: tuple[Sweep, ...]
    machine: dict[str, str]
    python_call: float
    """Seconds of a force evaluated in Python."""

    def __repr__(self) -> str:
        best = min((x for sweep in self.sweeps for x in sweep.errors if x > 0), default=math.nan)
        done = f"{count(len(self.sweeps), 'method')}, {count(len(self.points), 'point')}"
        return f"PrecisionStudy({self.scene.name!r}, {done}, smallest error {best:.1e})"

    @property
    def points(self) -> tuple[Point, ...]:
        """The points of all methods."""
        return tuple(point for sweep in self.sweeps for point in sweep.points)

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
        found = [(x.cost(kind, target), j) for j, x in enumerate(self.measured)]
        best, j = min(found, default=(math.inf, 0))
        return (self.measured[j], best) if best < math.inf else None

    def lines(self, options: Namespace | None = None) -> Lines:
        """The report: winners, costs of each error by method, orders and floors, what was not measured."""
        out: Lines = [
            plain(f"{self.scene.title}: error against run time and force calls", "bold"),
            plain(f"Error: {METRIC_WORDS[self.metric]}."),
            *resumed(self.resumed, "point"),
            plain(),
        ]
        if self.measured:
            out += [self._winners(), plain(), plain("Run time to an error of"), self._costs("time")]
            out += [plain(), plain("Force calls to an error of"), self._costs("calls"), plain()]
            out += [self._orders(), plain(), *self._calibration(), *self._notes()]
        unable = [LeftOut(method=x.method, reason=x.message) for x in self.points if x.outcome == CANNOT_RUN]
        return out + left_out([*self.left_out, *unable])

    def _winners(self) -> TextTable:
        rows: list[Row] = []
        for target in TARGETS:
            cells: list[str] = []
            for kind in ("time", "calls"):
                found = self.winner(kind, target)
                cells += [found[0].method, _cost(kind, found[1])] if found else ["none", ""]
            rows.append((f"{target:.0e}", *cells))
        titles = ("error", "least time, of the methods measured", "time", "least force calls", "calls")
        return table(titles, rows, left=titles[1:4:2])

    def _costs(self, kind: str) -> TextTable:
        best = [self.winner(kind, target) for target in TARGETS]
        rows: list[Row] = []
        for x in self.measured:
            cells: list[Text] = []
            for target, won in zip(TARGETS, best, strict=True):
                cheapest = won is not None and won[0] is x
                below = x.floor is not None and target < x.floor
                cost = x.cost(kind, target)
                text = _cost(kind, cost) if cost < math.inf else "floor" if below else "-"
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
        differ = any(a and b and a[0] is not b[0] for a, b in pairs)
        why = "The winners differ where fewer force calls cost more time each." if differ else ""
        return [plain(x) for x in (said, python, why) if x]

    def _notes(self) -> Lines:
        out: Lines = [plain("*: least of the methods measured; floor: never below its rounding floor", "dim")]
        if lower := self._lowered:
            why = "has order 1 here: its kicks use forces that depend on velocities"
            out.append(plain(f"{few(lower, 4)}: {why}"))
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
        known, fitted = schemes.known(), [x.method for x in self.measured if x.fit]
        found = [(label, known.get(scheme_of(label))) for label in fitted]
        return [label for label, scheme in found if scheme and scheme.braked_order < scheme.order]

    def document(self) -> dict[str, Any]:
        """The study as plain data for JSON; unknown values are None."""
        winners = [
            (target, kind, self.winner(kind, target)) for target in TARGETS for kind in ("time", "calls")
        ]
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


def _cost(kind: str, x: float) -> str:
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
