"""Stored runs of a scene, read in pieces of bounded size, compared and judged."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import numpy as np

from springcheck import checks
from springcheck.checks import compare
from springcheck.physics import exact
from springcheck.physics.arrays import Extended
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import NOT_KNOWN, Comparison, Trajectory, Verdict
from springcheck.studies import keeper
from springcheck.studies.choose import LeftOut
from springcheck.studies.run.result import Report
from springcheck.studies.run.tally import Tally, line

PIECE_NUMBERS = 1 << 16
"""Numbers per array that are judged at a time, so that memory does not grow with the run."""


MOST_PIECES = 16
"""Pieces of a long run that are judged where a closed form determines the motion between them: the first, the
last, and some between at equal distances."""


MOST_NUMBERS = 1 << 24
"""Numbers per array up to which a run without a closed form is judged as a whole: 17 s for many particles,
at 1 us a number, two minutes for a single one.  Of a longer run pieces are judged, and none of these
passes it."""


MOST_ERRORS = 1 << 23
"""Numbers of the exact solution and of the errors of all methods that are gathered for the store, 64 MiB."""


LONG_PIECE = PIECE_NUMBERS // 4
"""Numbers per array in each of them.  Judging takes 8 us a frame, a hundred times as long as making it: two
seconds in all."""


def judge(
    scene: Scene,
    path: Path,
    sources: Mapping[str, Path],
    left: Sequence[LeftOut],
    *,
    resumed: Sequence[str] = (),
    gathered: Exact | None = None,
) -> Report:
    """The report on stored trajectories, read in pieces of bounded size; the exact solution is `gathered`
    where it is known at all of their frames."""
    rows, stride = _pieces(scene, sources)
    judged_frames = dict.fromkeys(sources, 0)
    verdicts: dict[str, list[list[Verdict]]] = {name: [] for name in sources}
    tallies = {name: Tally(scene) for name in sources}
    parts: list[Comparison] = []
    last, failed = dict[str, Trajectory](), dict[str, Trajectory]()
    first = itemgetter(0)
    streams = (_begun(scene, keeper.windows(path, name, rows, stride)) for name, path in sources.items())
    # over the same frames: the last piece of a run that ends early may begin where no other does
    for _, same in groupby(heapq.merge(*streams, key=first), first):
        pieces = {piece.label: piece for _, piece in same}
        known = compare.solution(scene, pieces.values()) if exact.has_true_motion(scene) else None
        if gathered and known and stride == 1:
            gathered.add(known, pieces)
        for name, piece in pieces.items():
            judged_frames[name] += len(piece.t)
            verdicts[name].append(checks.judge(scene, piece, piece=True))
            if any(v.passed is False and v.check in checks.TELLING for v in verdicts[name][-1]):
                failed.setdefault(name, piece)
            tallies[name].add(piece, known)
            last[name] = piece
        parts.append(compare.compare(scene, pieces, known))
    comparison, frames = compare.merge(parts, last), max(judged_frames.values())
    runs = tuple(line(last[name], tallies[name]) for name in sources)
    worst = {name: checks.worst(verdicts[name]) for name in sources}
    if stride > 1:
        worst = {name: _bridged(mine, verdicts[name], frames) for name, mine in worst.items()}
    if failed:
        from springcheck.identify import scenes

        # the cause goes with a verdict that fails among those of all methods as well
        fair = iter(checks.shared([v for mine in worst.values() for v in mine]))
        worst = {name: [next(fair) for _ in mine] for name, mine in worst.items()}
        for name, piece in failed.items():
            worst[name] = checks.explained(scene, piece, worst[name], scenes.diagnosis)
    return Report(
        scene=scene,
        path=path,
        runs=runs,
        left_out=tuple(left),
        verdicts=tuple(v for name in sources for v in worst[name]),
        comparison=comparison,
        same=() if scene.bath else tuple(compare.same_motions(scene, last, comparison)),
        temperatures=tuple(tally.heat.line(name) for name, tally in tallies.items() if tally.heat),
        judged_frames=min(frames, scene.frames) if stride > 1 else scene.frames,
        resumed=tuple(name for name in resumed if name in sources),
    )


class Exact:
    """The exact solution and the errors of all methods, gathered piece by piece."""

    def __init__(self, scene: Scene, labels: Sequence[str]) -> None:
        self._norm = scene.system.norm
        self._fits = scene.frames * (2 * scene.n + 1 + len(labels)) <= MOST_ERRORS
        self._states: list[tuple[np.ndarray, ...]] = []
        self._errors: dict[str, list[np.ndarray]] = {label: [] for label in labels}

    def add(self, known: tuple[Extended, Extended], pieces: Mapping[str, Trajectory]) -> None:
        """Add the exact states at the frames of the longest of these pieces, which follow the last ones."""
        if not self._fits:
            return
        longest = max(pieces.values(), key=lambda piece: len(piece.t))
        # consecutive pieces share a frame
        new = slice(1 if self._states else 0, None)
        self._states.append(tuple(np.asarray(x, np.float64)[new] for x in (longest.t, *known)))
        for label, piece in pieces.items():
            q, p = (x[: len(piece.t)] for x in known)
            error = self._norm(piece.q - q, piece.p - p)
            self._errors[label].append(np.asarray(error, np.float64)[new])

    def solution(self) -> keeper.Solution | None:
        """All of it; None where it is not known, or longer than what is gathered in memory."""
        if not self._states:
            return None
        t, q, p = (np.concatenate(parts) for parts in zip(*self._states, strict=True))
        errors = {label: np.concatenate(parts) for label, parts in self._errors.items() if parts}
        return keeper.Solution(t=t, q=q, p=p, errors=errors)


def _begun(scene: Scene, pieces: Iterable[Trajectory]) -> Iterator[tuple[int, Trajectory]]:
    """Pieces of a run, each with the steps before its first frame."""
    for piece in pieces:
        yield int(checks.Case(trajectory=piece, scene=scene).steps[0]), piece


def _pieces(scene: Scene, sources: Mapping[str, Path]) -> tuple[int, int]:
    """Frames of a piece of the stored runs, and the stride: of so many pieces one is judged."""
    rows = max(2, PIECE_NUMBERS // scene.n)
    if scene.frames - 1 <= MOST_PIECES * rows:
        return rows, 1
    first = (next(keeper.windows(source, name, rows)) for name, source in sources.items())
    # draws are judged in each piece separately
    bridged = scene.bath is not None or all(
        checks.bridges(checks.Case(trajectory=one, scene=scene)) for one in first
    )
    if not bridged and scene.frames * scene.n <= MOST_NUMBERS:
        return rows, 1
    rows = max(2, LONG_PIECE // scene.n)
    return rows, max(1, -(-(scene.frames - 1) // (rows * MOST_PIECES)))


def _bridged(worst: Sequence[Verdict], pieces: Sequence[Sequence[Verdict]], frames: int) -> list[Verdict]:
    """Verdicts on a run of which so many frames were judged: none passes on its motion unless the closed
    form, which covers the motion between pieces, was applied to every piece."""
    closed = [v for piece in pieces for v in piece if v.check == checks.closed_form.name]
    if all(v.passed is not None for v in closed):
        return list(worst)
    why = (
        f"pieces of {frames} frames in all were looked at, and no formula covers the steps between "
        "them: fewer steps, or a larger record.every"
    )
    return [
        replace(v, passed=None, value=np.nan, bound=np.nan, unit="", why=why, sees=NOT_KNOWN)
        if v.passed and v.check in checks.TELLING
        else v
        for v in worst
    ]
