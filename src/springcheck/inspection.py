"""What is in a store, for reading and for drawing, in bounded memory however long its runs are."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.table import Table

from springcheck import store
from springcheck.errors import SpringcheckError, StoreError
from springcheck.physics.scene import Scene
from springcheck.studies import text as report
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.extremes.measure import Atlas
from springcheck.studies.precision import measure as precision
from springcheck.studies.precision.result import PrecisionStudy
from springcheck.studies.run import measure as session
from springcheck.studies.stability import measure as stability
from springcheck.studies.stability.measure import Stability
from springcheck.trajectory import Comparison, Trajectory, Verdict

T = TypeVar("T")

MOST_FRAMES = 4001
"""Frames of one trajectory that are drawn; a longer one is drawn every so many frames, and it is said."""

END_FRAMES = 500
"""Frames at the end of a run whose motion is too fast for that."""

RESOLVED = 0.25
"""Largest way between two drawn frames, as a part of the whole, that still shows the motion: half a radian
of an oscillation.  Beyond, lines between them are chords, and a slow wave is seen that is not there."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """What `springcheck inspect` shows."""

    summary: store.Summary
    verdicts: tuple[Verdict, ...]
    comparison: Comparison | None
    frames: Trajectory | None
    """Some frames of the trajectory asked for, all over its length."""
    stride: int = 1
    studies: Studies


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Studies:
    """The studies in a store; None for what it has not."""

    precision: PrecisionStudy | None
    stability: Stability | None
    extremes: Atlas | None

    @property
    def any(self) -> bool:
        """Whether there is one."""
        return any(found is not None for found in (self.precision, self.stability, self.extremes))


def look(path: Path, *, trajectory: str | None = None, rows: int = 20) -> Found:
    """Read what is in a store.  StoreError where it cannot be read or holds no such trajectory."""
    summary = store.summary(path)
    frames, stride = store.strided(path, trajectory, rows) if trajectory else (None, 1)
    return Found(
        summary=summary,
        # an unfinished run has trajectories beside the file that it will write
        verdicts=store.verdicts(path) if path.is_file() else (),
        comparison=store.comparison(path) if path.is_file() else None,
        frames=frames,
        stride=stride,
        studies=studied(path, summary),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawable:
    """Trajectories to draw: over their whole length, and the part whose motion can be followed."""

    scene: Scene
    runs: dict[str, Trajectory]
    followed: dict[str, Trajectory]
    notes: list[str]
    """What was left out."""


def drawable(path: Path, summary: store.Summary) -> Drawable:
    """Scene and trajectories of a store to draw.  SpringcheckError where it has none."""
    if not summary.runs:
        rest = "" if summary.complete else " yet: give the command that writes it again, it goes on"
        raise SpringcheckError(f"{path}: holds no trajectory and no study to draw{rest}")
    runs: dict[str, Trajectory] = {}
    notes = []
    fast = False
    for run in summary.runs:
        runs[run.label], stride = store.strided(path, run.label, MOST_FRAMES)
        if stride > 1:
            notes.append(f"{run.label}: every {stride}th of {run.frames} frames is drawn")
            fast |= not _shows_motion(runs[run.label])
    followed = runs
    if fast:
        followed = {run.label: store.end(path, run.label, END_FRAMES) for run in summary.runs}
        notes.append(f"position and phase portrait: the last {END_FRAMES} frames, energy: the whole run")
    return Drawable(scene=session.stored_scene(path), runs=runs, followed=followed, notes=notes)


def _shows_motion(run: Trajectory) -> bool:
    """Whether its frames stand close enough to be joined by lines."""
    q = run.q[:, 0] if len(run.q) > 1 else np.zeros(2)
    with np.errstate(over="ignore"):
        return bool(np.max(np.abs(np.diff(q))) <= RESOLVED * np.ptp(q))


def studied(path: Path, summary: store.Summary) -> Studies:
    """The studies of a store, from what it keeps.  StoreError where one of them cannot be read."""

    def kept(name: str) -> bool:
        return name in summary.documents

    try:
        return Studies(
            precision=precision.stored(path, session.stored_scene(path))
            if kept(precision.DOCUMENT)
            else None,
            stability=stability.stored(path, session.stored_scene(path))
            if kept(stability.DOCUMENT)
            else None,
            extremes=extremes.stored(path) if kept(extremes.DOCUMENT) else None,
        )
    except json.JSONDecodeError as error:
        raise StoreError(f"{path}: the document of its study is no JSON: {error}") from error


def lines(found: Found, *, verdicts: bool = False) -> report.Lines:
    """The store as text."""
    summary = found.summary
    out: report.Lines = [report.plain(f"{summary.path}: {summary.size / 1e6:.3g} MB", "bold")]
    if not summary.complete:
        out.append(report.plain("unfinished: the command that writes it has not ended", "bold red"))
    if summary.runs:
        known = summary.runs[0].parameters
        out.append(report.plain(f"  scene {known.get('scene_name')}, units {known.get('units')}"))
        out.append(
            report.plain(
                f"  {known.get('finished')} on {known.get('host')}: {known.get('processor')}, "
                f"{known.get('cores')} cores, {known.get('system')}"
            )
        )
        out.append(
            report.plain(
                f"  python {known.get('python')}, numpy {known.get('numpy')}, "
                f"h5py {known.get('h5py')}, hdf5 {known.get('hdf5')}"
            )
        )
    if summary.runs:
        out.append(_runs(summary))
    for name in summary.tables:
        out.append(report.plain(f"table {name}"))
    if found.verdicts:
        out += [report.plain(), report.plain("Largest value of each check, as a fraction of its bound:")]
        out += report.matrices(found.verdicts)
        out += report.failures(found.verdicts)
        if verdicts:
            out.append(report.verdicts_table(found.verdicts))
    if found.comparison is not None:
        out += [
            report.plain(),
            report.plain("Largest differences, in units of the start:"),
        ]
        out.append(_comparison(found.comparison))
    if found.studies.precision is not None:
        out += [report.plain(), *report.precision_report(found.studies.precision)]
    if found.studies.stability is not None:
        out += [report.plain(), *report.stability_report(found.studies.stability)]
    if found.studies.extremes is not None:
        out += [report.plain(), *report.extremes_report(found.studies.extremes)]
    if found.frames is not None:
        out += [report.plain(), _frames(found.frames, found.stride)]
    return out


def _runs(summary: store.Summary) -> Table:
    table = report.grid()
    for name in ("trajectory", "frames", "n", "outcome", "versions", "sha256"):
        table.add_column(name, justify="right" if name in ("frames", "n") else "left", overflow="fold")
    for run in summary.runs:
        known = run.parameters
        versions = ", ".join(
            f"{key[7:]} {known[key]}"
            for key in known
            if key.startswith("origin.") and key[7:] not in ("engine", "method", "velocity")
        )
        table.add_row(
            report.plain(run.label),
            str(run.frames),
            str(run.n),
            report.plain(str(known.get("outcome", ""))),
            report.plain(versions),
            report.plain(str(known.get("sha256", ""))[:12]),
        )
    return table


def _comparison(comparison: Comparison) -> Table:
    table = report.grid()
    table.add_column("", no_wrap=True)
    for i in range(len(comparison.labels)):
        table.add_column(str(i), justify="right")
    for i, label in enumerate(comparison.labels):
        cells = [_short(x) for x in comparison.max_difference[i]]
        table.add_row(report.plain(f"{i} {label}"), *cells[: i + 1])
    return table


def _short(x: float) -> str:
    if np.isnan(x):
        return "-"
    if x == 0:
        return "0"
    return f"{x:.0e}".replace("e-0", "e-").replace("e+00", "").replace("e+0", "e")


def _frames(run: Trajectory, stride: int) -> Table:
    n = run.q.shape[1]
    shown = min(n, 3)
    title = f"{run.label}" + (f", every {stride}th frame" if stride > 1 else "")
    if n > shown:
        title += f", the first {shown} of {n} particles"
    table = report.grid()
    table.title = title
    table.title_justify = "left"
    table.add_column("t", justify="right")
    for name in ("q", "p"):
        for i in range(shown):
            table.add_column(f"{name}{i}" if n > 1 else name, justify="right")
    for t, q, p in zip(run.t, run.q, run.p, strict=True):
        table.add_row(*(repr(float(x)) for x in (t, *q[:shown], *p[:shown])))
    return table


def document(found: Found) -> dict[str, Any]:
    """The store as plain data for JSON."""
    frames = found.frames
    return {
        "store": str(found.summary.path),
        "bytes": found.summary.size,
        "complete": found.summary.complete,
        "root": {key: _json(value) for key, value in found.summary.root.items()},
        "trajectories": [
            {
                "label": run.label,
                "frames": run.frames,
                "particles": run.n,
                "quantities": list(run.quantities),
                "parameters": {key: _json(value) for key, value in run.parameters.items()},
            }
            for run in found.summary.runs
        ],
        "tables": list(found.summary.tables),
        "studies": {
            name: one
            for name, one in (
                (precision.DOCUMENT, _of(PrecisionStudy.document, found.studies.precision)),
                (stability.DOCUMENT, _of(stability.document, found.studies.stability)),
                (extremes.DOCUMENT, _of(extremes.document, found.studies.extremes)),
            )
            if one is not None
        },
        "verdicts": [session.verdict_document(verdict) for verdict in found.verdicts],
        "trajectory": None
        if frames is None
        else {
            "label": frames.label,
            "stride": found.stride,
            "t": frames.t.tolist(),
            "q": frames.q.tolist(),
            "p": frames.p.tolist(),
        },
    }


def _of(form: Callable[[T], dict[str, Any]], study: T | None) -> dict[str, Any] | None:
    return None if study is None else form(study)


def _json(value: Any) -> Any:
    return session.number(value) if isinstance(value, float) else value
