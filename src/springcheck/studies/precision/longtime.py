"""Errors over long times at one step: where a scheme of higher order falls behind.

Each method is run to 100, 1,000, ... periods of the fastest motion.  On linear scenes the motion of its
scheme in exact arithmetic is known; its errors are drawn as a line (the law) next to the measured marks.  The
energy error of a symplectic scheme stays bounded, while one that loses energy loses it at every step.  So
velocity Verlet overtakes RK4 after 18/(h w)**4 steps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations
from pathlib import Path
from typing import Any, ClassVar, Unpack

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label
from springcheck.errors import MethodError, SceneError
from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import scheme_of
from springcheck.figures.naming import at_their_ends
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.studies import keeper
from springcheck.studies.choose import LeftOut
from springcheck.studies.keeper import How, Keeper, Piece, document
from springcheck.studies.precision.accuracy import Errors, Truth, own_motion, truth
from springcheck.studies.precision.result import MOST_SHOWN
from springcheck.studies.study import Studied
from springcheck.studies.tables import RecordForm
from springcheck.text.lines import Lines, plain, table

FIRST_PERIODS, FRAMES = 100.0, 256
"""Length of the first run, and frames of each run that are compared with the exact solution."""

LAW_POINTS, LAW_FRAMES = 60, 48
"""Times at which the law is drawn, and steps from each on of which the largest error counts."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LongRun:
    """Errors of one method at these numbers of periods; the law is that of its scheme in exact arithmetic."""

    method: str
    order: int
    periods: Floats
    error: Floats
    law_steps: Floats
    law: Floats
    why: str
    """Why it ends early, or was not run."""


LONG: RecordForm[LongRun] = RecordForm(
    kind=LongRun, beginning="precision/", signal="error", axes=("periods",), log=("periods", "error"),
    line=lambda x: f"{x.method}: error {x.error[-1]:.1e} after {x.periods[-1]:.0e} periods"
    if len(x.error) else "",
)  # fmt: skip


def record(
    scene: Scene, labels: Sequence[Label], path: str | Path | None = None, *, periods: float = 1e6,
    budget: float = 45.0, metric: str = "largest", left: Sequence[LeftOut] = (), **how: Unpack[How],
) -> LongTime:  # fmt: skip
    """Run these methods over so many periods at the scene's step, each within its share of the budget."""
    known = truth(scene)
    if not known.w or any(x.kind == "friction" for x in scene.terms):
        raise SceneError(f"scene {scene.name}: nothing in it oscillates for long")
    fixed = [x for x in labels if not engines.method(x).adaptive]
    left = [*left, *(LeftOut(method=str(x), reason="it has no fixed step") for x in labels if x not in fixed)]

    def measure(kept: Keeper) -> LongTime:
        pieces = [
            Piece(key=str(x), what=str(x), form=LONG,
                  measure=partial(one, known, x, periods, metric, budget / max(1, len(fixed))))
            for x in fixed
        ]  # fmt: skip
        return LongTime(
            scene=scene, metric=metric, periods=periods, runs=tuple(kept.results(pieces)),
            machine=keeper.origin(labels), left_out=tuple(left),
        )  # fmt: skip

    options = str(periods), metric, str(budget)
    return keeper.study("precision", path, labels, measure, *options, scene=scene, **how)


def one(known: Truth, label: Label, periods: float, metric: str, budget: float) -> LongRun:
    """Run one method over ever longer times, as far as its share of the budget goes."""
    scene, scheme = known.scene, schemes.scheme(engines.method(label).scheme)
    h, decades = scene.step, max(1, round(math.log10(periods / FIRST_PERIODS)) + 1)
    lengths = np.minimum(FIRST_PERIODS * 10.0 ** np.arange(decades), periods)
    period, found, why, spent = 2 * math.pi / known.w, [], "", 0.0
    for many in lengths:
        if 10 * spent > budget:
            why = "the budget ends before"
            break
        every = max(1, round(many * period / abs(h) / FRAMES))
        errors = Errors(known, h, every, scheme=scheme)
        part = replace(scene, steps=every * FRAMES, every=every, quantities=("q", "p"))
        try:
            run = driver.play(part, label, errors, planned=10**9)
        except MethodError as error:
            why = str(error)
            break
        spent = run.timing.run
        if run.outcome.status != "complete":
            why = f"{run.outcome.status} after {run.outcome.step} steps"
            break
        found.append(errors.result.error(metric))
    steps, law = _law(known, scheme, lengths[-1] * period / abs(h), metric)
    return LongRun(
        method=str(label), order=scheme.order, periods=lengths[: len(found)],
        error=np.array(found, np.float64), law_steps=steps, law=law, why=why,
    )  # fmt: skip


def _law(known: Truth, scheme: schemes.Scheme, most: float, metric: str) -> tuple[Floats, Floats]:
    """Numbers of steps and errors of the scheme's motion in exact arithmetic; none where it is not known."""
    motion = own_motion(known.scene, scheme, known.scene.step)
    if motion is None or metric == "phase":
        return np.zeros(0), np.zeros(0)
    starts = np.unique(np.geomspace(10, most, LAW_POINTS).round())
    largest, found = 0.0, []
    for first in starts:
        steps = int(first) - np.arange(min(LAW_FRAMES, int(first)))[::-1]
        errors = Errors(known, known.scene.step, 1, scheme=scheme, first=int(steps[0]))
        q, p = motion(steps)
        errors(steps.astype(np.float64), q, p)
        # errors at the end are those of the last step, all others the largest so far
        largest = (
            errors.result.error(metric) if metric == "end" else max(largest, errors.result.error(metric))
        )
        found.append(largest)
    return starts, np.array(found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class LongTime(Studied):
    """Errors of methods over long times; a row of its table is a method."""

    table_of: ClassVar[str] = "methods"
    forms: ClassVar = {"runs": LONG}

    scene: Scene
    metric: str
    periods: float
    runs: tuple[LongRun, ...]
    machine: Mapping[str, str]

    @property
    def w(self) -> float:
        """Largest angular frequency [1/T]."""
        return truth(self.scene).w

    @property
    def status(self) -> int:
        """Exit status: 2 nothing was measured."""
        return 0 if any(len(x.error) for x in self.runs) else 2

    @property
    def crossings(self) -> list[tuple[LongRun, LongRun, float]]:
        """Methods of higher order whose error exceeds that of one of lower order, by their laws, with the
        number of steps from which on."""
        out, seen = [], set()
        for a, b in permutations(self.runs, 2):
            both = min(len(a.law), len(b.law))
            if a.order > b.order and both and not np.array_equal(a.law, b.law):
                above = np.flatnonzero(a.law[:both] <= b.law[:both])
                j = int(above[-1]) if len(above) else both
                key = (a.law.tobytes(), b.law.tobytes())
                if j < both - 1 and key not in seen:
                    seen.add(key)
                    x, y = np.log(a.law_steps[j : j + 2]), np.log(a.law[j : j + 2] / b.law[j : j + 2])
                    out.append((a, b, float(np.exp(np.interp(0, y, x)))))
        return out

    @property
    def title(self) -> str:
        of = f"h w = {abs(self.scene.step) * self.w:.4g}"
        return f"{self.scene.title}: errors over {self.periods:.0e} periods at {of}"

    def answer(self) -> Lines:
        """Where higher orders fall behind."""
        out: Lines = []
        for a, b, steps in self.crossings:
            periods = steps * abs(self.scene.step) * self.w / (2 * math.pi)
            said = f"{a.method} (order {a.order}) falls behind {b.method} (order {b.order}) after"
            out.append(plain(f"{said} {steps:,.0f} steps ({periods:,.0f} periods)."))
        return out

    def tables(self) -> Lines:
        """Errors by method and number of periods."""
        lengths: list[float] = max((x.periods.tolist() for x in self.runs), key=len, default=[])
        rows = []
        for x in self.runs:
            cells = [f"{y:.1e}" for y in x.error]
            rows.append((x.method, str(x.order), *cells, *["-"] * (len(lengths) - len(cells))))
        short = ", ".join(f"{x.method} ({x.why})" for x in self.runs if x.why)
        return [
            plain(f"{self.metric.capitalize()} error after so many periods"),
            table(("method", "order", *(f"{x:.0e}" for x in lengths)), rows),
            *[plain(f"Not measured further: {short}.", "dim")] * bool(short),
        ]

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return document(
            scene=self.scene.name, metric=self.metric, periods=self.periods, machine=self.machine,
            methods=self.runs, left_out=self.left_out,
            crossings=[{"method": a.method, "than": b.method, "steps": x} for a, b, x in self.crossings],
        )  # fmt: skip

    def banks(self, **chosen: Any) -> list[Bank]:
        """The law of each scheme as a line, measurements as marks."""
        if not any(len(x.error) for x in self.runs):
            return []
        curves, per = [], self.w * abs(self.scene.step) / (2 * math.pi)
        for x in self.runs:
            group = scheme_of(x.method)
            curves.append(Curve(name=x.method, group=group, x=x.law_steps * per, y=x.law))
            curves.append(Curve(name=x.method, group=group, x=x.periods, y=x.error, line=False, marks=True))
        values = np.concatenate([np.asarray(x.y) for x in curves])
        least, most = float(np.min(values[values > 0])), float(np.nanmax(values))
        rules = []
        heading = f"{self.scene.name}: {self.metric} error over {self.periods:.0e} periods"
        # the highest order, and the first of at most half of it by which it is overtaken
        crossings = sorted(self.crossings, key=lambda x: (-x[0].order, 2 * x[1].order > x[0].order, x[2]))
        if crossings:
            a, b, steps = crossings[0]
            heading = f"{a.method} falls behind {b.method} after {steps:,.0f} steps"
            rules = [Rule(axis="x", at=steps * per, name=f"{steps * per:,.0f} periods", look="here")]
        shown = max(1e-16, 10.0 ** math.floor(math.log10(least))), min(MOST_SHOWN, 2 * most)
        chart = at_their_ends(Chart(
            title="Errors over long times: lines in theory, marks as measured.",
            x=Scale(name="periods", log=True),
            y=Scale(name=f"{self.metric} error", log=True, shown=shown), curves=curves, rules=rules,
        ))  # fmt: skip
        return [Bank(name="precision-long", heading=heading, title="Methods", charts=[chart])]
