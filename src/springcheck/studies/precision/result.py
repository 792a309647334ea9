"""What a study of precision has found: plain data, and the forms in which it is kept."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from springcheck.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.store import Table
from springcheck.studies.precision.accuracy import Accuracy
from springcheck.studies.precision.fits import Condition
from springcheck.studies.precision.points import Point


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodSummary:
    """What the points of one method come to."""

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
    """The same with every step read."""
    start_seconds: float | None
    first_start_seconds: float | None
    """Of the first start in this process, with import and compilation, and its first short run."""

    @property
    def floor_ratio(self) -> float | None:
        """The floor over eps times the condition there."""
        if self.floor is None or self.condition is None or self.floor_steps is None:
            return None
        return self.floor / (self.condition.eps * self.condition.value(self.floor_steps))


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The cheapest point within an error, or None where no method reaches it."""

    target: float
    point: Point | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PrecisionStudy:
    """Everything that a study of precision has found on one scene."""

    scene: Scene
    budget: float
    seconds: float
    interrupted: bool
    points: tuple[Point, ...]
    methods: tuple[MethodSummary, ...]
    front: tuple[Point, ...]
    """Points that no other beats in both error and run time, the fastest first."""
    cheapest: tuple[Answer, ...]
    machine: dict[str, str]
    tick: float
    """The smallest difference that the clock shows [s]."""
    taken_up: int = 0
    """Points that an interrupted call had finished."""

    def of(self, method: str) -> tuple[Point, ...]:
        """The points of one method, coarse to fine."""
        return tuple(point for point in self.points if point.method == method)

    def document(self) -> dict[str, Any]:
        """The study as plain data for JSON; what is not known is None."""
        return {
            "scene": self.scene.name,
            "budget_seconds": self.budget,
            "seconds": self.seconds,
            "interrupted": self.interrupted,
            "machine": self.machine,
            "clock_seconds": self.tick,
            "points": [_point(point) for point in self.points],
            "methods": [_method(method) for method in self.methods],
            "front": [{"method": p.method, "step": p.step, "tolerance": p.tolerance} for p in self.front],
            "cheapest": [_answer(answer) for answer in self.cheapest],
        }

    def tables(self) -> list[Table]:
        """The study for the store: /precision/<label>, and a summary of the methods."""
        named = [summary.method for summary in self.methods]
        return [*(of_points(self.scene, x, self.of(x), self.seconds) for x in named), _summary_table(self)]


def _point(point: Point) -> dict[str, Any]:
    found = point.accuracy
    return {
        "method": point.method,
        "step": point.step,
        "tolerance": point.tolerance,
        "steps": point.steps,
        "max_error": found.largest if found else None,
        "end_error": found.end if found else None,
        "phase_error": found.phase if found else None,
        "energy_error": found.energy if found else None,
        "rounding_error": found.rounding if found else None,
        "run_seconds": min(point.run_repeats, default=None),
        "run_seconds_quartiles": list(point.quartiles) if point.quartiles else None,
        "start_seconds": min(point.start_repeats, default=None),
        "read_seconds": min(point.read_repeats, default=None),
        "force_calls": point.force_calls,
        "outcome": f"{point.outcome}: {point.message}" if point.message else point.outcome,
    }


def _method(method: MethodSummary) -> dict[str, Any]:
    how = method.condition
    return {
        "method": method.method,
        "order": method.order,
        "order_standard_error": method.order_standard_error,
        "order_points": method.order_points,
        "floor": method.floor,
        "floor_steps": method.floor_steps,
        "floor_condition": asdict(how) if how else None,
        "floor_expected": (
            {"steps": method.expected_floor[0], "error": method.expected_floor[1]}
            if method.expected_floor
            else None
        ),
        "seconds_per_step": method.seconds_per_step,
        "seconds_per_force_call": method.seconds_per_force_call,
        "read_seconds_per_step": method.read_seconds_per_step,
        "start_seconds": method.start_seconds,
        "first_start_seconds": method.first_start_seconds,
    }


def _answer(answer: Answer) -> dict[str, Any]:
    point = answer.point
    return {
        "error": answer.target,
        "method": point.method if point else None,
        "step": point.step if point else None,
        "tolerance": point.tolerance if point else None,
        "steps": point.steps if point else None,
        "max_error": point.error if point else None,
        "run_seconds": point.seconds if point else None,
        "force_calls": point.force_calls if point else None,
    }


def _number(x: float | None) -> float:
    return float("nan") if x is None else float(x)


def _repeats(points: Iterable[tuple[float, ...]]) -> Floats:
    """Repeats of every point (points, most repeats), NaN where a point has fewer."""
    rows = list(points)
    out = np.full((len(rows), max([1, *map(len, rows)])), np.nan)
    for row, values in zip(out, rows, strict=True):
        row[: len(values)] = values
    return out


def table_name(method: str) -> str:
    """Where the points of a method are kept."""
    return f"precision/{method}"


_NUMBERS = ("step", "tolerance", "max_error", "end_error", "phase_error", "energy_error", "rounding_error")


def of_points(scene: Scene, method: str, points: Sequence[Point], seconds: float) -> Table:
    """The points of one method; unknown numbers are NaN and unknown counts -1.

    `seconds`: what the study had taken by then.
    """
    documents = [_point(point) for point in points]
    time = {"reduced": "1", "md": "ps", "si": "s"}[scene.units]
    return Table(
        name=table_name(method),
        columns={
            **{name: np.array([_number(d[name]) for d in documents]) for name in _NUMBERS},
            **{
                name: np.array([-1 if d[name] is None else d[name] for d in documents], dtype=np.int64)
                for name in ("steps", "force_calls")
            },
            "run_seconds": np.array([_number(d["run_seconds"]) for d in documents]),
            "run_seconds_repeats": _repeats(p.run_repeats for p in points),
            "start_seconds_repeats": _repeats(p.start_repeats for p in points),
            "read_seconds_repeats": _repeats(p.read_repeats for p in points),
            "spent_seconds": np.array([p.spent for p in points]),
            "outcome": [p.outcome for p in points],
            "message": [p.message for p in points],
        },
        units={
            "step": time,
            "phase_error": "rad",
            "run_seconds": "s",
            "run_seconds_repeats": "s",
            "start_seconds_repeats": "s",
            "read_seconds_repeats": "s",
            "spent_seconds": "s",
        },
        attributes={
            "about": "error against run time; errors in units of the start; -1 and NaN: not known",
            "study_seconds": seconds,
        },
        signal="max_error",
        axes=("run_seconds",),
        log=("run_seconds", "max_error"),
    )


def to_points(table: Table) -> tuple[list[Point], float]:
    """The points of such a table, and the seconds that the study had taken by then."""
    columns = {name: np.asarray(column) for name, column in table.columns.items()}

    def known(name: str, row: int) -> float | None:
        x = float(columns[name][row])
        return None if np.isnan(x) else x

    def count(name: str, row: int) -> int | None:
        x = int(columns[name][row])
        return None if x < 0 else x

    def repeats(name: str, row: int) -> tuple[float, ...]:
        x = columns[f"{name}_seconds_repeats"][row]
        return tuple(x[~np.isnan(x)].tolist())

    def accuracy(row: int) -> Accuracy | None:
        if columns["outcome"][row] != "complete":
            return None
        return Accuracy(
            largest=float(columns["max_error"][row]),
            end=float(columns["end_error"][row]),
            phase=known("phase_error", row),
            energy=float(columns["energy_error"][row]),
            rounding=known("rounding_error", row),
        )

    points = [
        Point(
            method=table.name.removeprefix(table_name("")),
            step=known("step", row),
            tolerance=known("tolerance", row),
            steps=count("steps", row),
            outcome=str(columns["outcome"][row]),
            message=str(columns["message"][row]),
            accuracy=accuracy(row),
            run_repeats=repeats("run", row),
            start_repeats=repeats("start", row),
            read_repeats=repeats("read", row),
            force_calls=count("force_calls", row),
            spent=float(columns["spent_seconds"][row]),
        )
        for row in range(len(columns["outcome"]))
    ]
    return points, float(table.attributes["study_seconds"])


def _summary_table(study: PrecisionStudy) -> Table:
    documents = [_method(method) for method in study.methods]
    names = (
        "order",
        "order_standard_error",
        "floor",
        "seconds_per_step",
        "seconds_per_force_call",
        "read_seconds_per_step",
        "start_seconds",
        "first_start_seconds",
    )
    return Table(
        name="precision/methods",
        columns={
            "method": [d["method"] for d in documents],
            **{name: np.array([_number(d[name]) for d in documents]) for name in names},
            "constant": np.array([_number(m.constant) for m in study.methods]),
            "condition": [m.condition.name if m.condition else "" for m in study.methods],
        },
        units={name: "s" for name in names if "seconds" in name},
        attributes={
            **{f"machine_{name}": text for name, text in study.machine.items()},
            "budget_seconds": study.budget,
            "interrupted": study.interrupted,
            "clock_seconds": study.tick,
        },
    )
