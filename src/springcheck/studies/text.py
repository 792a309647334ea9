"""Reports as text for a terminal of 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table
from rich.text import Text

from springcheck.schemes import SCHEMES
from springcheck.studies.run.measure import LeftOut, Repeat, Report, Run
from springcheck.trajectory import Verdict

if TYPE_CHECKING:
    from springcheck.identify import Identification
    from springcheck.studies.extremes.measure import Atlas
    from springcheck.studies.faults.measure import FaultReport
    from springcheck.studies.precision.points import Point
    from springcheck.studies.precision.result import MethodSummary, PrecisionStudy
    from springcheck.studies.stability.measure import Stability

Lines = list[Table | Text]


def plain(text: str = "", style: str = "") -> Text:
    """A line of text that is never taken for markup."""
    return Text(text, style=style)


def run_report(report: Report) -> Lines:
    """The whole report of `springcheck run`."""
    out: Lines = [headline(report), plain(), runs_table(report.runs)]
    out.append(plain("error: farthest from the true motion; energy: (H - H0)/|H0| where largest", "dim"))
    out += [
        plain(f"  {run.method}: {run.outcome} after step {run.step}: {run.message}")
        for run in report.runs
        if run.outcome != "complete"
    ]
    out += same_motions(report)
    out += [plain(), plain("Is the engine right?  Largest value of each check, as a fraction of its bound:")]
    out += matrices(report.verdicts)
    out += failures(report.verdicts)
    out += left_out(report.left_out)
    if report.judged_frames < report.scene.frames:
        share = f"{report.judged_frames} of {report.scene.frames} frames"
        out.append(plain(f"Judged on {share}: pieces at equal distances, the first and the last"))
    out += [plain(), summary(report)]
    return out


def headline(report: Report) -> Text:
    """Title, grid and start of a scene."""
    scene = report.scene
    size = "" if scene.n == 1 else f", {scene.n} particles"
    steps = "1 step" if scene.steps == 1 else f"{scene.steps} steps"
    return plain(f"{scene.title}: {steps} of {scene.step:g}{size}", "bold")


def grid() -> Table:
    """A table without lines, as narrow as its words."""
    return Table(box=None, pad_edge=False, padding=(0, 1), show_edge=False, header_style="")


def seconds(value: float) -> str:
    """A time with three digits and its unit."""
    if not np.isfinite(value):
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-9:.0f} ns"


def runs_table(runs: Sequence[Run]) -> Table:
    """One line a method, under the scheme that it runs."""
    table = grid()
    for name in ("method", "error", "energy", "start", "run", "outcome"):
        table.add_column(name, justify="left" if name in ("method", "outcome") else "right", no_wrap=True)
    for scheme in dict.fromkeys(run.scheme for run in runs):
        table.add_row(plain(SCHEMES[scheme].title, "italic"))
        for run in runs:
            if run.scheme != scheme:
                continue
            good = run.outcome == "complete"
            table.add_row(
                plain(f"  {run.method}"),
                _error(run.max_error),
                f"{run.energy_drift:+.1e}",
                seconds(run.timing.start),
                seconds(run.timing.run),
                plain(run.outcome, "" if good else "red"),
            )
    return table


def _error(x: float) -> str:
    """Three digits in eight columns, two where the exponent takes three places."""
    if np.isnan(x):
        return "-"
    return f"{x:.2e}" if x < 1e100 else f"{x:.1e}"


def same_motions(report: Report) -> Lines:
    """Which trajectories are one motion, and how closely."""
    if not report.same:
        return []
    out: Lines = [plain(), plain("The same motion, to rounding or tolerance:")]
    for same in report.same:
        names = " = ".join("true motion" if label == "exact" else label for label in same.labels)
        out.append(plain(f"  {names}"))
        far = f"differ by at most {same.difference:.1e} of the start ({same.allowed:.1e} allowed)"
        out.append(plain(f"    {far if same.difference else 'equal bit for bit'}"))
    return out


SHORT = {
    "step-defect": "step",
    "arithmetic": "arith",
    "closed-form": "closed",
    "shadow-energy": "shadow",
    "frequency": "freq",
    "momentum": "moment",
    "tolerance": "toler",
}


MAP = {"propagator": "matrix", "determinant": "det", "symplecticity": "sympl", "reversibility": "reverse"}
"""Experiments with the one-step map; those whose bound is 0 share the column `exact`."""

LAWS = {
    "order": "order",
    "order-anharmonic": "order, well",
    "rounding-bias": "bias",
    "rounding-growth": "growth",
    "convergence": "tolerance",
}
"""Experiments over many runs."""

EXACT_EXPERIMENTS = frozenset({"mirror", "repeatability"})


def ratio(verdict: Verdict) -> float:
    """Value as a fraction of the bound; infinite where an exact bound is missed."""
    if verdict.value == 0:
        return 0.0
    return verdict.value / verdict.bound if verdict.bound else float("inf")


def matrices(verdicts: Sequence[Verdict]) -> Lines:
    """The checks of the recorded states, and below them the experiments where there are any."""
    tried = MAP.keys() | LAWS.keys() | EXACT_EXPERIMENTS
    out: Lines = [verdict_matrix([v for v in verdicts if v.check not in tried], SHORT)]
    for title, short, exact in (("steps", MAP, EXACT_EXPERIMENTS), ("laws", LAWS, frozenset[str]())):
        mine = [v for v in verdicts if v.check in short or v.check in exact]
        if any(v.passed is not None for v in mine):
            out += [plain(), plain(f"Experiments with {title}, likewise:"), verdict_matrix(mine, short)]
    return out


def verdict_matrix(verdicts: Sequence[Verdict], short: Mapping[str, str]) -> Table:
    """A line a method, a column a check; the checks whose bound is 0 share the column `exact`."""
    checks = [c for c in dict.fromkeys(v.check for v in verdicts) if c in short]
    table = grid()
    table.add_column("method", no_wrap=True)
    shown = [c for c in checks if any(v.check == c and v.passed is not None for v in verdicts)]
    for check in shown:
        table.add_column(short[check], justify="right", no_wrap=True)
    exact = any(v.check not in short for v in verdicts)
    if exact:
        table.add_column("exact", justify="right", no_wrap=True)
    for method in dict.fromkeys(v.method for v in verdicts):
        mine = {v.check: v for v in verdicts if v.method == method}
        cells = [_cell(mine.get(check)) for check in shown]
        rest = [v for name, v in mine.items() if name not in short and v.passed is not None]
        good = sum(1 for v in rest if v.passed)
        if exact:
            cells.append(plain(f"{good}/{len(rest)}", "" if good == len(rest) else "bold red"))
        table.add_row(plain(method), *cells)
    return table


def _cell(verdict: Verdict | None) -> Text:
    if verdict is None or verdict.passed is None:
        return plain("-", "dim")
    value = ratio(verdict)
    text = f"{value:.2f}" if 0.01 <= value < 100 else f"{value:.0e}"
    return plain(text if verdict.passed else text + "!", "" if verdict.passed else "bold red")


def failures(verdicts: Iterable[Verdict]) -> Lines:
    """Every failed verdict with value, bound, ratio and why."""
    out: Lines = []
    for v in verdicts:
        if v.passed is False:
            out.append(plain(f"FAILED {v.method} {v.check}: {verdict_line(v)}", "bold red"))
    return out


def verdict_line(v: Verdict) -> str:
    """Value, bound, ratio and why."""
    if v.passed is None:
        return f"not applicable: {v.why}"
    return f"{v.value:.3g} of {v.bound:.3g} {v.unit} (ratio {ratio(v):.2g}): {v.why}"


def verdicts_table(verdicts: Iterable[Verdict]) -> Table:
    """Every verdict in full."""
    table = grid()
    table.add_column("method")
    table.add_column("check", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    table.add_column("value, bound, ratio, why")
    for v in verdicts:
        word, style = {True: ("passed", ""), False: ("FAILED", "bold red"), None: ("n/a", "dim")}[v.passed]
        table.add_row(plain(v.method), plain(v.check), plain(word, style), plain(verdict_line(v), style))
    return table


IDENTIFIED = {
    "not told apart": "several schemes, which the data cannot tell apart",
    "none": "none (adaptive or unknown)",
    "adaptive": "adaptive solver, no fixed scheme to find",
}
"""What is said where no scheme is named."""


def identification(label: str, found: Identification) -> Lines:
    """What a trajectory says of the scheme that made it."""
    style = "bold" if found.fits or found.verdict == "adaptive" else "bold red"
    recorded = "" if found.stride in (None, 1) else f", {found.stride} steps from frame to frame"
    several = found.candidates if len(found.candidates) > 1 else ()
    rows = [
        ("same map on a spring", ", ".join(found.aliases)),
        ("step", f"{found.step:.9g}{recorded}"),
        ("angular frequency", _numbers(found.omega) if not several else _range([x.omega for x in several])),
        (
            "stiffness",
            _numbers(found.stiffness) if not several else _range([x.stiffness or () for x in several]),
        ),
        ("velocities", _offset(found.velocity_offset)),
        ("determinant of a step", _numbers(found.determinant)),
        ("symplectic defect", f"{found.symplectic_defect:.1e}"),
        ("defect of a step", f"{found.defect_ulp:.3g} ulp: {found.precision}"),
    ]
    misfit = ", but what is stated does not fit" if found.candidates and not found.fits else ""
    said = IDENTIFIED.get(found.verdict, found.scheme)
    out: Lines = [plain(f"{label}: {said}{misfit}", style)]
    if several:
        out += _hanging("  one of: ", "; ".join(found.choice))
    for name, text in rows:
        if text and "nan" not in text:
            out += _hanging(f"  {name + ':':24}", text)
    for note in found.notes:
        out += _hanging("  note: ", note)
    return out


def _hanging(head: str, text: str) -> Lines:
    """Text of 80 columns, its further lines indented as far as its head is long."""
    broken = textwrap.wrap(text, 80 - len(head), break_long_words=False, break_on_hyphens=False)
    return [plain((head if i == 0 else " " * len(head)) + line) for i, line in enumerate(broken)]


def _numbers(values: tuple[float, ...] | None) -> str:
    if not values:
        return ""
    text = ", ".join(f"{x:.12g}" for x in values[:3])
    return text + (f" ... ({len(values)} oscillators)" if len(values) > 3 else "")


def _range(rows: Sequence[tuple[float, ...]]) -> str:
    """The values (s, n) that several schemes give one oscillator, from the least to the largest."""
    values = [f"{x:.9g}" for x in sorted(row[0] for row in rows if len(row) == 1)]
    ends = list(dict.fromkeys([values[0], values[-1]] if values else []))
    return " to ".join(ends)


def _offset(steps: float) -> str:
    if np.isnan(steps):
        return ""
    if steps == 0:
        return "synchronised with the positions"
    return f"{abs(steps):g} of a step {'early' if steps < 0 else 'late'}"


def repeat_line(one: Repeat) -> Text:
    """One line for a repeated trajectory."""
    if one.equal:
        return plain(f"{one.method}: equal bit for bit")
    why = f"; {', '.join(one.changed)}" if one.changed else ""
    return plain(
        f"{one.method}: NOT equal, differs by up to {one.difference:.1e} of the start{why}", "bold red"
    )


def left_out(left: Sequence[LeftOut]) -> Lines:
    """One line for each reason."""
    if not left:
        return []
    reasons: dict[str, list[str]] = {}
    for one in left:
        reasons.setdefault(one.reason, []).append(one.method)
    return [plain(), *(plain(f"Left out {', '.join(names)}: {why}") for why, names in reasons.items())]


def summary(report: Report) -> Text:
    """How many verdicts passed, and where the store is."""
    passed = sum(1 for v in report.verdicts if v.passed)
    failed = sum(1 for v in report.verdicts if v.passed is False)
    skipped = len(report.verdicts) - passed - failed
    taken = f"; taken up from an interrupted run: {', '.join(report.resumed)}" if report.resumed else ""
    return plain(
        f"{passed} verdicts passed, {failed} failed, {skipped} not applicable{taken}\n"
        f"Stored in {report.path}",
        "bold red" if failed else "bold green",
    )


def taken_up(pieces: int, what: str) -> Lines:
    """A line on what an interrupted call had finished, where there was one."""
    return [plain(f"  {pieces} {what} were finished by an interrupted call and taken up")] if pieces else []


def precision_report(study: PrecisionStudy, *, points: bool = False) -> Lines:
    """The whole report of `springcheck precision`; `points` adds every point."""
    scene = study.scene
    done = sum(point.complete for point in study.points)
    out: Lines = [
        plain(f"{scene.title}: error against run time over {scene.steps * scene.step:g} of time", "bold"),
        plain(f"  {done} points in {study.seconds:.0f} s on {study.machine['processor']}"),
        *taken_up(study.taken_up, "points"),
        plain(),
        _precision_methods(study.methods),
    ]
    for method in study.methods:
        expected = method.expected_floor
        if expected and method.condition:
            steps, error = expected
            longer = (
                "" if method.seconds_per_step is None else f", {duration(steps * method.seconds_per_step)}"
            )
            out.append(
                plain(f"  {method.method}: floor expected near {error:.0e}, {steps:.0e} steps{longer} a run")
            )
    rest = [point for point in study.points if not point.complete]
    if rest:
        out += [plain(), plain("Not measured:")]
        out += [plain(f"  {point.method} at {_where(point)}: {_outcome(point)}") for point in rest]
    out += [plain(), plain("The cheapest way to an error (largest, of the start):"), _cheapest(study)]
    if points:
        out += [plain(), _points(study.points)]
    if study.interrupted:
        out.append(plain("Interrupted: every point that was finished is here.", "bold red"))
    return out


def duration(value: float) -> str:
    """Seconds, hours or years, roughly."""
    for unit, size in (("years", 3.156e7), ("days", 86400.0), ("h", 3600.0)):
        if value >= size:
            return f"{value / size:.2g} {unit}"
    return seconds(value)


def _precision_methods(methods: Sequence[MethodSummary]) -> Table:
    table = grid()
    for name in ("method", "order", "floor", "/eps*cond", "step", "step, read", "start"):
        table.add_column(name, justify="left" if name == "method" else "right", no_wrap=True)
    for m in methods:
        order = "-" if m.order is None else f"{m.order:.4f}({m.order_standard_error:.0e})"
        table.add_row(
            plain(m.method),
            order,
            "-" if m.floor is None else f"{m.floor:.1e}",
            "-" if m.floor_ratio is None else f"{m.floor_ratio:.2g}",
            *(
                "-" if value is None else seconds(value)
                for value in (m.seconds_per_step, m.read_seconds_per_step, m.start_seconds)
            ),
        )
    return table


def _cheapest(study: PrecisionStudy) -> Table:
    table = grid()
    for name in ("error", "method", "at", "run", "force calls"):
        table.add_column(name, justify="left" if name == "method" else "right", no_wrap=True)
    for answer in study.cheapest:
        point = answer.point
        if point is None:
            table.add_row(f"{answer.target:.0e}", plain("none reaches it"), "", "", "")
        else:
            table.add_row(
                f"{answer.target:.0e}",
                plain(point.method),
                _where(point),
                seconds(point.seconds),
                str(point.force_calls),
            )
    return table


def _where(point: Point) -> str:
    if point.tolerance is not None:
        return f"tolerance {point.tolerance:.0e}"
    return "-" if point.step is None else f"step {point.step:.3g}"


def _outcome(point: Point) -> str:
    return f"{point.outcome}: {point.message}" if point.message else point.outcome


def _points(points: Sequence[Point]) -> Table:
    table = grid()
    for name in ("method", "at", "error", "end", "phase", "energy", "run", "calls"):
        table.add_column(name, justify="left" if name == "method" else "right", no_wrap=True)
    for point in points:
        found = point.accuracy
        if found is None:
            table.add_row(plain(point.method), _where(point), plain(point.outcome, "red"))
            continue
        table.add_row(
            plain(point.method),
            _where(point).replace("tolerance ", "tol "),
            f"{found.largest:.1e}",
            f"{found.end:.1e}",
            "-" if found.phase is None else f"{found.phase:+.0e}",
            f"{found.energy:.0e}",
            seconds(point.seconds),
            str(point.force_calls),
        )
    return table


def fault_report(found: FaultReport) -> Lines:
    """Every fault with what rejects it and the smallest size that is seen; the right engines' runs."""
    table = grid()
    table.add_column("fault", no_wrap=True)
    table.add_column("size", justify="right", no_wrap=True)
    table.add_column("seen from", justify="right", no_wrap=True)
    table.add_column("rejected by")
    for result in found.results:
        limit = min(result.limits.values(), default=None)
        table.add_row(
            plain(result.name, "bold red" if result.missed_by else ""),
            plain("" if result.size is None else f"{result.size:.0e}"),
            plain("" if limit is None else f"{limit:.1e}"),
            plain(", ".join(result.rejected_by)),
        )
    out: Lines = [table, plain()]
    for result in found.results:
        if result.missed_by:
            out.append(
                plain(f"FAILED {result.name}: not rejected by {', '.join(result.missed_by)}", "bold red")
            )
    clean = found.clean
    out += [plain(f"FALSE ALARM {alarm}", "bold red") for alarm in clean.alarms]
    rejected = sum(bool(result.rejected_by) for result in found.results)
    out.append(
        plain(
            f"{rejected} of {len(found.results)} faults rejected; {clean.runs} clean runs, "
            f"{clean.verdicts} verdicts, {len(clean.alarms)} false alarms"
        )
    )
    return out


def stability_report(study: Stability) -> Lines:
    """The whole report of `springcheck stability`."""
    from springcheck.studies.stability import measure as stability

    out: Lines = [
        plain(f"{study.scene.title}: limits of stability, measured on one step", "bold"),
        *taken_up(study.taken_up, "measurements"),
        plain(),
    ]
    if study.limits:
        table = grid()
        for title in ("method", "limit h w", "theory", "off", "growth above", "predicted"):
            table.add_column(title, justify="left" if title == "method" else "right")
        for x in study.limits:
            off = 0.0 if x.limit == x.theory else abs(x.limit - x.theory)
            grown = (
                ("-", "-")
                if np.isnan(x.growth_above)
                else (f"{x.growth_above:.7f}", f"{x.growth_predicted:.7f}")
            )
            limit = "none" if np.isinf(x.limit) else f"{x.limit:.9f}"
            theory = "none" if np.isinf(x.theory) else f"{x.theory:.9f}"
            table.add_row(x.method, limit, theory, f"{off:.0e}", *grown, style="" if x.agrees else "bold red")
        out += [table, plain()]
    if study.costs:
        table = grid()
        for title in ("method", "ratio", "steps", "rejected", "force calls", "error", "outcome"):
            table.add_column(title, justify="left" if title in ("method", "outcome") else "right")
        for cost in study.costs:
            error = "-" if np.isnan(cost.error) else f"{cost.error:.1e}"
            table.add_row(
                cost.method, f"{cost.ratio:.0e}", str(cost.steps), str(cost.rejected),
                str(cost.force_calls), error, cost.outcome.partition(":")[0],
            )  # fmt: skip
        out += [table, plain()]
    out += [plain(line) for line in stability.sentences(study)]
    return out


def extremes_report(atlas: Atlas) -> Lines:
    """The whole report of `springcheck extremes`."""
    outcomes = ("right", "unstable, as theory says", "engine's limit", "refused", "silently wrong")
    table = grid()
    for title in ("method", "cells", "right", "unstable", "limit", "refused", "wrong"):
        table.add_column(title, justify="left" if title == "method" else "right")
    for method in dict.fromkeys(cell.method for cell in atlas.cells):
        counts = atlas.counts(method)
        table.add_row(method, str(sum(counts.values())), *(str(counts[outcome]) for outcome in outcomes))
    out: Lines = [
        plain(f"{len(atlas.cells)} extreme cases", "bold"),
        *taken_up(atlas.taken_up, "tables of cells"),
        plain(),
        table,
        plain(),
    ]
    out += [plain(window.sentence) for window in atlas.windows]
    wrong = atlas.wrong
    out += [
        plain(f"silently wrong: {cell.method} {cell.parameters}: {cell.reason}", "bold red")
        for cell in wrong[:20]
    ]
    verdict = f"{len(wrong)} cells silently wrong" if wrong else "no cell is silently wrong"
    return [*out, plain(verdict, "bold red" if wrong else "bold green")]
