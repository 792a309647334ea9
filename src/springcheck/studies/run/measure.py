"""The main job: a scene by all its methods, stored as it goes, compared and judged."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

import numpy as np

from springcheck import checks, compare, engines, simulate, store
from springcheck.arrays import Floats
from springcheck.engines.contract import Label
from springcheck.errors import MethodError, StoreError
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.scene import Scene
from springcheck.provenance import command
from springcheck.trajectory import Comparison, Timing, Trajectory, Verdict

PIECE = 1 << 16
"""Numbers per array that are judged at a time, so that memory does not grow with the run."""

MOST_PIECES = 16
"""Pieces of a long run that are judged: the first, the last, and some between at equal distances."""

LONG_PIECE = PIECE // 4
"""Numbers per array in each of them.  Judging takes 8 us a frame, a hundred times as long as making it: two
seconds in all.  A slip between two pieces shows in the closed form of every piece after it, however short."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One line of the report."""

    method: str
    scheme: str
    outcome: str
    step: int
    message: str
    max_error: float
    """Largest distance from the true motion (`Norm`); NaN where that is not known."""
    energy_drift: float
    """(H - H0) / |H0| where it is largest, > 0 where energy is gained; absolute for H0 = 0."""
    timing: Timing
    force_calls: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """A method that was not run, or a part of a scene's report that was not made, and why."""

    method: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Everything that `springcheck run` says."""

    scene: Scene
    path: Path
    runs: tuple[Run, ...]
    left_out: tuple[LeftOut, ...]
    verdicts: tuple[Verdict, ...]
    comparison: Comparison
    same: tuple[compare.Same, ...]
    judged_frames: int
    """Frames of each run that were judged: all of them, unless the run is very long."""
    resumed: tuple[str, ...] = ()

    @property
    def status(self) -> Literal[0, 1, 2]:
        """Exit status: 0 all passed, 1 some verdict failed, 2 nothing was measured."""
        judged = [verdict.passed for verdict in self.verdicts if verdict.passed is not None]
        if not judged:
            return 2
        return 0 if all(judged) else 1


def choose(scene: Scene, patterns: Sequence[str]) -> tuple[list[Label], list[LeftOut]]:
    """Methods that can serve a scene, of those that the patterns (or the scene) name, and those left out.

    Raises MethodError when a method that is named in full cannot run: it was asked for.
    """
    named = tuple(patterns) or scene.include
    chosen: list[Label] = []
    left: list[LeftOut] = []
    try:
        matched = engines.match(named)
    except MethodError as error:
        if patterns:
            raise
        raise MethodError(f"methods.include of scene {scene.name}: {error}") from error
    for label in matched:
        reason = engines.refusal(scene, label) or engines.absence(label.engine)
        if reason is None:
            chosen.append(label)
        elif str(label) in patterns:
            raise MethodError(f"{label} cannot run scene {scene.name}: {reason}")
        else:
            left.append(LeftOut(method=str(label), reason=reason))
    if not chosen:
        raise MethodError(f"no method can serve scene {scene.name}: {left[0].reason}")
    return chosen, left


Started = Callable[[Label, int], simulate.Progress | None]
"""Told of each run before it starts, with its number of steps; returns where its progress goes."""


def run(
    scene: Scene,
    path: str | Path,
    *,
    methods: Sequence[str] = (),
    force: bool = False,
    thorough: bool = False,
    started: Started | None = None,
) -> Report:
    """Run, compare, store, judge.  Work that an interrupted call has stored is taken up.

    `thorough` adds the experiments, whose runs are made on the side and not stored.

    Raises SpringcheckError for everything that a user can mend; what is finished then stays in the
    journal, and an existing file stays as it was.
    """
    path = Path(path)
    labels, left = choose(scene, methods)
    with store.open_new(path, command("run", labels, scene.text), force=force) as journal:
        resumed = journal.finished()
        store.room(path, store.size(scene) * (len(labels) - len(resumed)))
        for label in tuple(labels):
            if str(label) in resumed:
                continue
            progress = started(label, scene.steps) if started else None
            try:
                with journal.draft(str(label), scene) as draft:
                    record = simulate.play(scene, label, draft.append, progress=progress)
                    empty = np.empty(0)
                    whole = simulate.trajectory(record, empty, empty, empty, None)
                    draft.finish(store.attributes(whole))
            except MethodError as error:
                # what only shows as an engine starts; a method that was asked for by name must not go missing
                if str(label) in methods or len(labels) == 1:
                    raise
                labels.remove(label)
                left.append(LeftOut(method=str(label), reason=str(error)))
        names = tuple(str(label) for label in labels)
        sources = journal.sources()
        report = judge(scene, path, {name: sources[name] for name in names}, left, resumed=resumed)
        if thorough:
            report = replace(report, verdicts=(*report.verdicts, *_experiments(scene, labels, started)))
        journal.commit(scene, comparison=report.comparison, verdicts=report.verdicts)
    return report


def _experiments(scene: Scene, labels: Sequence[Label], started: Started | None) -> list[Verdict]:
    """The verdicts of the experiments with every method."""
    found: list[Verdict] = []
    for label in labels:
        progress = started(label, len(checks.THOROUGH)) if started else None
        found += checks.judge_thoroughly(scene, str(label), simulate.run, progress=progress)
    return found


def judge(
    scene: Scene,
    path: Path,
    sources: Mapping[str, Path],
    left: Sequence[LeftOut],
    *,
    resumed: Sequence[str] = (),
) -> Report:
    """The report on stored trajectories, read in pieces of bounded size."""
    rows = max(2, PIECE // scene.n)
    if scene.frames - 1 > MOST_PIECES * rows:
        rows = max(2, LONG_PIECE // scene.n)
    pieces_in_all = -(-(scene.frames - 1) // rows)
    stride = max(1, -(-pieces_in_all // MOST_PIECES))
    judged_frames = 0
    verdicts: dict[str, list[list[Verdict]]] = {name: [] for name in sources}
    tallies = {name: _Tally(scene) for name in sources}
    parts: list[Comparison] = []
    last: dict[str, Trajectory] = {}
    streams = {name: store.windows(source, name, rows, stride) for name, source in sources.items()}
    for pieces in _together(streams):
        judged_frames += max(len(piece.t) for piece in pieces.values())
        for name, piece in pieces.items():
            verdicts[name].append(checks.judge(scene, piece))
            tallies[name].add(piece)
            last[name] = piece
        if len(pieces) == len(sources):
            parts.append(compare.compare(scene, pieces))
        else:
            parts.append(_incomplete(parts[-1]))
    comparison = compare.merge(parts)
    runs = tuple(_line(last[name], tallies[name]) for name in sources)
    return Report(
        scene=scene,
        path=path,
        runs=runs,
        left_out=tuple(left),
        verdicts=tuple(v for name in sources for v in checks.worst(verdicts[name])),
        comparison=comparison,
        same=tuple(compare.same_motions(scene, last, comparison)),
        judged_frames=min(judged_frames, scene.frames),
        resumed=tuple(name for name in resumed if name in sources),
    )


def _together(streams: Mapping[str, Iterator[Trajectory]]) -> Iterator[dict[str, Trajectory]]:
    """Windows of several trajectories over the same frames; those that have ended are left out."""
    while True:
        pieces = {
            name: piece for name, stream in streams.items() if (piece := next(stream, None)) is not None
        }
        if not pieces:
            return
        yield pieces


def _incomplete(before: Comparison) -> Comparison:
    """Where some run has ended early nothing more can be said of the pairs."""
    return replace(before, max_difference=np.full_like(before.max_difference, np.nan))


class _Tally:
    """Error and energy over all pieces of a trajectory."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._norm = scene.system.norm
        self._known = exact.has_true_motion(scene)
        self._start = float(scene.system.energy(scene.q, scene.p))
        self.error = 0.0 if self._known else np.nan
        self.drift = 0.0

    def add(self, piece: Trajectory) -> None:
        """Take a piece into account."""
        scene = self._scene
        if self._known:
            steps = checks.Case(trajectory=piece, scene=scene).steps
            q, p = exact.true_motion(scene, steps, piece.step)
            # not max(), which leaves out what is no number
            here = np.max(self._norm(piece.q - q, piece.p - p))
            self.error = float(np.maximum(self.error, here))
        with np.errstate(over="ignore", invalid="ignore"):
            off: Floats = np.asarray(scene.system.energy(piece.q, piece.p), np.float64) - self._start
        worst = float(off[np.argmax(np.abs(off))]) / (abs(self._start) or 1.0)
        if not abs(worst) <= abs(self.drift) and not np.isnan(self.drift):
            self.drift = worst


def _line(piece: Trajectory, tally: _Tally) -> Run:
    return Run(
        method=piece.label,
        scheme=piece.scheme,
        outcome=piece.outcome.status,
        step=piece.outcome.step,
        message=piece.outcome.message,
        max_error=tally.error,
        energy_drift=tally.drift,
        timing=piece.timing,
        force_calls=piece.force_calls,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeat:
    """A stored trajectory beside its repetition."""

    method: str
    equal: bool
    """Bit for bit, by the digests."""
    difference: float
    """Largest, in units of the start; NaN where the two do not have the same frames."""
    changed: tuple[str, ...]
    """Versions that are not what they were, as ``numpy 2.0.1 -> 2.4.6``."""


def repeat(path: Path, *, methods: Sequence[str] = (), started: Started | None = None) -> list[Repeat]:
    """Run every trajectory of a store again, and say whether the numbers are the same bit for bit.

    `methods` are globs of labels.  Raises SpringcheckError where the file or an engine cannot be used.
    """
    stored = {run.label: run for run in store.summary(path).runs}
    chosen = [label for label in stored if not methods or any(fnmatchcase(label, m) for m in methods)]
    if not stored:
        raise StoreError(f"{path}: holds no trajectory to run again")
    if not chosen:
        raise StoreError(f"{path}: holds no trajectory {' or '.join(methods)}; it has {', '.join(stored)}")
    scene = stored_scene(path)
    found = []
    beside = path.absolute().parent
    # where there was room for the store there is room for its repetition, unless it is kept read-only
    place = beside if os.access(beside, os.W_OK) else None
    with tempfile.TemporaryDirectory(dir=place, prefix=".springcheck-") as folder:
        again = Path(folder) / "again.h5"
        with store.open_new(again, "repeat") as journal:
            for name in chosen:
                before = stored[name].parameters
                label = engines.parse(name)
                kept = ("q", "p", "energy") if "energy" in stored[name].quantities else ("q", "p")
                mine = replace(scene, quantities=kept)
                progress = started(label, scene.steps) if started else None
                with journal.draft(name, mine) as draft:
                    record = simulate.play(mine, label, draft.append, progress=progress)
                    empty = np.empty(0)
                    digest = draft.finish(
                        store.attributes(simulate.trajectory(record, empty, empty, empty, None))
                    )
                source = journal.sources()[name]
                found.append(
                    Repeat(
                        method=name,
                        equal=digest == before["sha256"],
                        difference=_difference(scene, path, source, name),
                        changed=tuple(
                            f"{key} {before.get('origin.' + key)} -> {value}"
                            for key, value in record.origin.items()
                            if before.get("origin." + key) != value
                        ),
                    )
                )
    return found


def _difference(scene: Scene, one: Path, other: Path, label: str) -> float:
    norm = scene.system.norm
    worst = 0.0
    rows = max(2, PIECE // scene.n)
    for a, b in zip_longest(store.windows(one, label, rows), store.windows(other, label, rows)):
        if a is None or b is None or len(a.t) != len(b.t):
            return float("nan")
        worst = float(np.maximum(worst, np.max(norm(a.q - b.q, a.p - b.p))))
    return worst


def stored_scene(path: Path) -> Scene:
    """The scene of a store, parsed from the text that it keeps."""
    name = str(store.summary(path).root.get("scene_name", path.stem))
    return scenes.parse(store.scene_text(path), name=name, where=f"{path} (scene)")


def document(report: Report) -> dict[str, Any]:
    """The report as plain data for JSON; what is not a finite number is None."""
    return {
        "scene": report.scene.name,
        "store": str(report.path),
        "runs": [
            {
                "method": run.method,
                "scheme": run.scheme,
                "outcome": run.outcome,
                "steps": run.step,
                "max_error": number(run.max_error),
                "energy_drift": number(run.energy_drift),
                "start_seconds": number(run.timing.start),
                "run_seconds": number(run.timing.run),
                "force_calls": run.force_calls,
            }
            for run in report.runs
        ],
        "judged_frames": report.judged_frames,
        "left_out": [{"method": left.method, "reason": left.reason} for left in report.left_out],
        "verdicts": [verdict_document(verdict) for verdict in report.verdicts],
        "comparison": {
            "labels": list(report.comparison.labels),
            "max_difference": [[number(x) for x in row] for row in report.comparison.max_difference.tolist()],
        },
        "same_motion": [
            {"labels": list(same.labels), "difference": same.difference, "allowed": number(same.allowed)}
            for same in report.same
        ],
    }


def repeat_document(found: Sequence[Repeat]) -> dict[str, Any]:
    """Repetitions as plain data for JSON."""
    return {
        "repeats": [
            {
                "method": one.method,
                "equal": one.equal,
                "difference": number(one.difference),
                "changed": list(one.changed),
            }
            for one in found
        ]
    }


def verdict_document(verdict: Verdict) -> dict[str, Any]:
    """A verdict as plain data for JSON."""
    return {
        "method": verdict.method,
        "check": verdict.check,
        "value": number(verdict.value),
        "bound": number(verdict.bound),
        "unit": verdict.unit,
        "passed": verdict.passed,
        "why": verdict.why,
    }


def number(x: float) -> float | None:
    """A finite number, or None: JSON has no infinity."""
    return float(x) if np.isfinite(x) else None


def read(path: str | Path) -> dict[str, Trajectory]:
    """The trajectories of a store by label.  StoreError where it cannot be read."""
    found = store.read(path)
    if not found:
        raise StoreError(f"{path}: holds no trajectories")
    return found
