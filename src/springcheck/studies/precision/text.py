"""The report of a study of precision as text."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Sequence

from springcheck.studies.choose import LeftOut
from springcheck.studies.precision.fits import CANNOT_RUN, Fit, Point
from springcheck.studies.precision.result import MethodSummary, PrecisionStudy
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, Row, TextTable, plain, table
from springcheck.text.wording import count, duration, number, seconds


def lines(study: PrecisionStudy, options: Namespace | None = None) -> Lines:
    """The whole report; `--points` adds every point."""
    scene = study.scene
    done = sum(point.complete for point in study.points)
    out: Lines = [
        plain(f"{scene.title}: error against run time over {scene.steps * scene.step:g} of time", "bold"),
        plain(f"  {count(done, 'point')} in {study.seconds:.0f} s on {study.machine['processor']}"),
        *resumed(study.resumed, "point"),
        plain(),
        _methods([x for x in study.methods if {one.outcome for one in x.points} != {CANNOT_RUN}]),
    ]
    for method in study.methods:
        expected = method.expected_floor
        if expected and method.condition:
            steps, error = expected
            each = method.least("run", "steps")
            longer = "" if each is None else f", {duration(steps * each)}"
            out.append(
                plain(f"  {method.method}: floor expected near {error:.0e}, {steps:.0e} steps{longer} a run")
            )
    untimed = sum(point.complete and not point.run_seconds_repeats for point in study.points)
    if untimed:
        out.append(plain(f"  {count(untimed, 'point')} of errors alone: workers measure no times"))
    rest = [point for point in study.points if not point.complete and point.outcome != CANNOT_RUN]
    if rest:
        out += [plain(), plain("Not measured:")]
        out += [plain(f"  {point.method} at {_where(point)}: {point.said}") for point in rest]
    out += [
        plain(),
        plain("The cheapest way to an error (largest, relative to the initial energy norm):"),
        _cheapest(study.cheapest),
    ]
    if getattr(options, "points", False):
        out += [plain(), _points(study.points)]
    unable = [LeftOut(method=x.method, reason=x.message) for x in study.points if x.outcome == CANNOT_RUN]
    out += left_out([*study.left_out, *unable])
    return out


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
