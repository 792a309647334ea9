"""Result of a study of precision: plain data, and its stored forms."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck.physics.scene import Scene
from springcheck.studies.keeper import Table, document
from springcheck.studies.precision.fits import Condition, Point
from springcheck.studies.study import Studied
from springcheck.text.wording import count


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodSummary:
    """Summary of the points of one method."""

    method: str
    order: float | None
    """Signed slope of log error over log step; None for adaptive solvers and with too few points."""
    order_standard_error: float | None
    order_points: int
    constant: float | None
    """Error = constant * step**order."""
    floor: float | None
    """The smallest error, where a finer step has made it larger again; None where none has."""
    floor_steps: int | None
    condition: Condition | None
    """How rounding adds up in this method."""
    expected_floor: tuple[float, float] | None
    """Where the floor would be, (steps, error), from the fit and the rounding so far; None if reached."""
    seconds_per_step: float | None
    seconds_per_force_call: float | None
    read_seconds_per_step: float | None
    """Seconds per step when every step is read."""
    start_seconds: float | None
    first_start_seconds: float | None
    """The first start in this process and its first short run, with import and compilation [s]."""

    @property
    def floor_ratio(self) -> float | None:
        """The floor over eps times the condition there."""
        if self.floor is None or self.condition is None or self.floor_steps is None:
            return None
        return self.floor / (self.condition.eps * self.condition.value(self.floor_steps))


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The cheapest way to an error, or None where no method reaches it.

    Its message says between which numbers of steps it is interpolated; it has none where it was measured.
    """

    target: float
    point: Point | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PrecisionStudy(Studied):
    """Everything that a study of precision has found on one scene; a row of its table is a point."""

    table_of: ClassVar[str] = "points"

    scene: Scene
    budget: float
    seconds: float
    points: tuple[Point, ...]
    methods: tuple[MethodSummary, ...]
    front: tuple[Point, ...]
    """Points that no other beats in both error and run time, the fastest first."""
    cheapest: tuple[Answer, ...]
    machine: dict[str, str]
    tick: float
    """The smallest difference that the clock shows [s]."""

    def __repr__(self) -> str:
        best = min((p.error for p in self.points if p.error > 0), default=np.nan)
        done = f"{count(len(self.methods), 'method')}, {count(len(self.points), 'point')}"
        return f"PrecisionStudy({self.scene.name!r}, {done}, smallest error {best:.1e})"

    @property
    def status(self) -> Literal[0, 2]:
        """Exit status: 2 nothing was measured."""
        return 0 if any(point.complete for point in self.points) else 2

    def of(self, method: str) -> tuple[Point, ...]:
        """The points of one method, coarse to fine."""
        return tuple(point for point in self.points if point.method == method)

    def document(self) -> dict[str, Any]:
        """The study as plain data for JSON; what is not known is None."""
        return document(
            scene=self.scene.name,
            budget_seconds=self.budget,
            seconds=self.seconds,
            machine=self.machine,
            clock_seconds=self.tick,
            points=[point.document() for point in self.points],
            methods=[_method(method) for method in self.methods],
            front=[{"method": p.method, "step": p.step, "tolerance": p.tolerance} for p in self.front],
            cheapest=[_answer(answer) for answer in self.cheapest],
        )

    def summary(self) -> Table:
        """The table of the methods, for readers of the file."""
        numbers = ("order", "order_standard_error", "floor", "constant")
        names = [name for name in _METHOD if "seconds" in name or name in numbers]
        return Table(
            name="precision/methods",
            columns={
                "method": [m.method for m in self.methods],
                "condition": [m.condition.name if m.condition else "" for m in self.methods],
                **{name: np.array([getattr(m, name) for m in self.methods], np.float64) for name in names},
            },
            units={name: "s" for name in names if "seconds" in name},
            attributes={
                **{f"machine_{name}": text for name, text in self.machine.items()},
                "budget_seconds": self.budget,
                "clock_seconds": self.tick,
            },
        )


_METHOD = tuple(one.name for one in fields(MethodSummary) if one.name not in ("condition", "expected_floor"))


def _method(method: MethodSummary) -> dict[str, Any]:
    expected = method.expected_floor
    return {
        **{name: getattr(method, name) for name in _METHOD},
        "floor_condition": method.condition,
        "floor_expected": {"steps": expected[0], "error": expected[1]} if expected else None,
    }


def _answer(answer: Answer) -> dict[str, Any]:
    names = ("method", "step", "tolerance", "steps", "max_error", "run_seconds", "force_calls")
    known = answer.point.document() if answer.point else {}
    found = {"error": answer.target, **{name: known.get(name) for name in names}}
    return found | {"interpolated": (answer.point.message or None) if answer.point else None}
