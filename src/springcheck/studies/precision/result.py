"""Result of a study of precision: plain data, its text, and its stored forms."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck import schemes
from springcheck.figures.looks import scheme_of
from springcheck.physics.scene import Scene
from springcheck.studies.choose import LeftOut
from springcheck.studies.keeper import Table, document
from springcheck.studies.precision import fits
from springcheck.studies.precision.fits import CANNOT_RUN, Condition, Fit, Point
from springcheck.studies.study import Studied
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, Row, TextTable, plain, table
from springcheck.text.wording import count, duration, few, number, seconds


@dataclass(frozen=True, kw_only=True)
class MethodSummary:
    """Points of one method, coarse to fine, and the numbers that follow from them; None where unknown."""

    method: str
    points: tuple[Point, ...]
    duration: float
    """Time from the first frame to the last [T]."""
    condition: Condition | None
    """Growth of rounding in this method."""
    first_start_seconds: float | None
    """Seconds of the first start in this process and its first short run, with import and compilation."""

    @cached_property
    def complete(self) -> list[Point]:
        """Points with errors."""
        return [point for point in self.points if point.complete]

    @property
    def is_adaptive(self) -> bool:
        """Whether the method follows a tolerance, so that there is no step to fit an order to."""
        return any(point.tolerance is not None for point in self.complete)

    @cached_property
    def fit(self) -> Fit | None:
        """Error = constant * step**order; None also with too few points."""
        return None if self.is_adaptive else fits.order(self.complete, self.condition)

    @cached_property
    def lowest(self) -> Point | None:
        """The point of the smallest error, where a finer step has a larger one."""
        # an adaptive solver's error falls irregularly: its floor is one that a decade has not improved
        best = fits.turned([point.error for point in self.complete], by=2 if self.is_adaptive else 1)
        return None if best is None else self.complete[best]

    @property
    def floor(self) -> float | None:
        """The error of the `lowest` point."""
        return self.lowest.error if self.lowest else None

    @property
    def floor_ratio(self) -> float | None:
        """The floor divided by eps times the condition there."""
        if self.lowest is None or self.condition is None or self.lowest.steps is None:
            return None
        return self.lowest.error / (self.condition.eps * self.condition.value(self.lowest.steps))

    @cached_property
    def expected_floor(self) -> tuple[float, float] | None:
        """Predicted floor, (steps, error), from the fit and the rounding so far; None if it is reached."""
        if self.lowest or not (self.fit and self.condition):
            return None
        return fits.expected_floor(self.complete, self.fit, self.condition, self.duration)

    def least(self, seconds: str, over: str = "") -> float | None:
        """The smallest of these repeated timings over all points, each divided by the count `over` of its
        run.

        The overhead of a call only lengthens short runs, so that the minimum is the step's own time.
        """
        costs = ((getattr(x, f"{seconds}_seconds_repeats"), getattr(x, over) if over else 1)
                 for x in self.complete if x.run_seconds_repeats)  # fmt: skip
        return min((min(repeats) / count for repeats, count in costs if repeats and count), default=None)

    def document(self) -> dict[str, Any]:
        """For JSON."""
        fit, expected = self.fit, self.expected_floor
        return {
            "method": self.method,
            "order": fit and fit.order,
            "order_standard_error": fit and fit.standard_error,
            "order_points": fit.points if fit else 0,
            "constant": fit and fit.constant,
            "floor": self.floor,
            "floor_steps": self.lowest and self.lowest.steps,
            "seconds_per_step": self.least("run", "steps"),
            "seconds_per_force_call": self.least("run", "force_calls"),
            "read_seconds_per_step": self.least("read", "steps"),
            "start_seconds": self.least("start"),
            "first_start_seconds": self.first_start_seconds,
            "floor_condition": self.condition,
            "floor_expected": {"steps": expected[0], "error": expected[1]} if expected else None,
        }


MOST_LOWERED = 4
"""Methods of a lowered order that the report names."""

TARGETS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Target errors for which the cheapest point is reported."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PrecisionStudy(Studied):
    """Everything that a study of precision has found on one scene; a row of its table is a point."""

    table_of: ClassVar[str] = "points"

    scene: Scene
    budget: float
    seconds: float
    methods: tuple[MethodSummary, ...]
    machine: dict[str, str]
    tick: float
    """Resolution of the clock [s]."""

    def __repr__(self) -> str:
        best = min((p.error for p in self.points if p.error > 0), default=np.nan)
        done = f"{count(len(self.methods), 'method')}, {count(len(self.points), 'point')}"
        return f"PrecisionStudy({self.scene.name!r}, {done}, smallest error {best:.1e})"

    @property
    def points(self) -> tuple[Point, ...]:
        """The points of all methods."""
        return tuple(point for method in self.methods for point in method.points)

    @property
    def front(self) -> list[Point]:
        """The Pareto front of error and run time, the fastest first."""
        return fits.front(self.points)

    @property
    def cheapest(self) -> list[tuple[float, Point | None]]:
        """The cheapest point for each of the `TARGETS`, None where no method reaches it.

        Its message gives the numbers of steps between which it is interpolated; it is empty where it was
        measured.
        """
        return [(target, fits.cheapest(self.points, target)) for target in TARGETS]

    @property
    def status(self) -> Literal[0, 2]:
        """Exit status: 2 nothing was measured."""
        return 0 if any(point.complete for point in self.points) else 2

    def of(self, method: str) -> tuple[Point, ...]:
        """The points of one method, coarse to fine."""
        return tuple(point for point in self.points if point.method == method)

    def lines(self, options: Namespace | None = None) -> Lines:
        """The whole report; `--points` adds every point."""
        scene = self.scene
        done = sum(point.complete for point in self.points)
        out: Lines = [
            plain(f"{scene.title}: error against run time over {scene.steps * scene.step:g} of time", "bold"),
            plain(f"  {count(done, 'point')} in {self.seconds:.0f} s on {self.machine['processor']}"),
            *resumed(self.resumed, "point"),
            plain(),
            _methods([x for x in self.methods if {one.outcome for one in x.points} != {CANNOT_RUN}]),
        ]
        for method in self.methods:
            if expected := method.expected_floor:
                steps, error = expected
                each = method.least("run", "steps")
                longer = "" if each is None else f", {duration(steps * each)}"
                there = f"near {error:.0e}, {steps:.0e} steps{longer} a run"
                out.append(plain(f"  {method.method}: floor expected {there}"))
        if lower := self._lowered:
            why = "of order 1 where forces depend on velocities, which their kicks take as they begin"
            out.append(plain(f"  {few(lower, MOST_LOWERED)}: {why}"))
        untimed = sum(point.complete and not point.run_seconds_repeats for point in self.points)
        if untimed:
            out.append(plain(f"  {count(untimed, 'point')} of errors alone: workers measure no times"))
        rest = [point for point in self.points if not point.complete and point.outcome != CANNOT_RUN]
        if rest:
            out += [plain(), plain("Not measured:")]
            out += [plain(f"  {point.method} at {_where(point)}: {point.said}") for point in rest]
        out += [
            plain(),
            plain("The cheapest way to an error (largest, relative to the initial energy norm):"),
            _cheapest(self.cheapest),
        ]
        if getattr(options, "points", False):
            out += [plain(), _points(self.points)]
        unable = [LeftOut(method=x.method, reason=x.message) for x in self.points if x.outcome == CANNOT_RUN]
        out += left_out([*self.left_out, *unable])
        return out

    @property
    def _lowered(self) -> list[str]:
        """Methods with an order that friction in their kicks lowers."""
        if not any(term.kind == "friction" for term in self.scene.terms):
            return []
        known, fitted = schemes.known(), [m.method for m in self.methods if m.fit]
        found = [(label, known.get(scheme_of(label))) for label in fitted]
        return [label for label, scheme in found if scheme and scheme.braked_order < scheme.order]

    def document(self) -> dict[str, Any]:
        """The study as plain data for JSON; unknown values are None."""
        return document(
            scene=self.scene.name,
            budget_seconds=self.budget,
            seconds=self.seconds,
            machine=self.machine,
            clock_seconds=self.tick,
            points=[point.document() for point in self.points],
            methods=[method.document() for method in self.methods],
            front=[{"method": p.method, "step": p.step, "tolerance": p.tolerance} for p in self.front],
            cheapest=[_answer(*one) for one in self.cheapest],
        )

    def summary(self) -> Table:
        """Table of the methods, for readers of the file."""
        rows = [method.document() for method in self.methods]
        numbers = ("order", "order_standard_error", "constant", "floor")
        names = [name for name in rows[0] if name in numbers or "seconds" in name]
        return Table(
            name="precision/methods",
            columns={
                "method": [m.method for m in self.methods],
                "condition": [m.condition.name if m.condition else "" for m in self.methods],
                **{name: np.array([row[name] for row in rows], np.float64) for name in names},
            },
            units={name: "s" for name in names if "seconds" in name},
            attributes={
                **{f"machine_{name}": text for name, text in self.machine.items()},
                "budget_seconds": self.budget,
                "clock_seconds": self.tick,
            },
        )


def _answer(target: float, point: Point | None) -> dict[str, Any]:
    names = ("method", "step", "tolerance", "steps", "max_error", "run_seconds", "force_calls")
    known = point.document() if point else {}
    found = {"error": target, **{name: known.get(name) for name in names}}
    return found | {"interpolated": (point.message or None) if point else None}


def _methods(methods: Sequence[MethodSummary]) -> TextTable:
    rows = [
        (
            m.method,
            "-" if m.fit is None else _order(m.fit),
            number(m.floor, ".1e"),
            number(m.floor_ratio, ".2g"),
            *map(seconds, (m.least("run", "steps"), m.least("read", "steps"), m.least("start"))),
        )
        for m in methods
    ]
    return table(("method", "order", "floor", "/eps*cond", "step", "step, read", "start"), rows)


def _order(fit: Fit) -> str:
    """With the digits that its error allows, four at most."""
    digits = min(4, max(0, -math.floor(math.log10(fit.standard_error)))) if fit.standard_error else 4
    return f"{fit.order:.{digits}f}({fit.standard_error:.0e})"


def _cheapest(answers: Sequence[tuple[float, Point | None]]) -> TextTable:
    rows = []
    for target, x in answers:
        cells = (x.method, _where(x), seconds(x.seconds), str(x.force_calls), x.message) if x else ()
        rows.append((f"{target:.0e}", *(cells or ("none reaches it",))))
    return table(("error", "method", "at", "run", "force calls", "interpolated"), rows)


def _where(point: Point) -> str:
    if point.tolerance is not None:
        return f"tolerance {point.tolerance:.0e}"
    return "-" if point.step is None else f"step {point.step:.3g}"


def _points(points: Sequence[Point]) -> TextTable:
    rows: list[Row] = []
    for point in points:
        where, found = _where(point).replace("tolerance ", "tol "), point.accuracy
        if found is None:
            rows.append((point.method, where, plain(point.outcome, "red")))
            continue
        errors = f"{found.max_error:.1e}", f"{found.end_error:.1e}", number(found.phase_error, "+.0e")
        costs = seconds(point.seconds), str(point.force_calls)
        rows.append((point.method, where, *errors, f"{found.energy_error:.0e}", *costs))
    return table(("method", "at", "error", "end", "phase", "energy", "run", "calls"), rows)
