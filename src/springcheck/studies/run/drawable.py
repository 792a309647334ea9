"""Frames of a stored run to draw, in memory that does not grow with its trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from springcheck.physics import memory
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.studies import keeper
from springcheck.text.wording import ordinal

MOST_FRAMES = 4001
"""Most frames of one trajectory that are drawn; a longer one is strided, with a note."""

FEWEST_FRAMES, MOST_NUMBERS = 16, 1 << 22
"""Frames that are drawn for any number of particles, and positions above which frames are left out."""

FIGURE_BYTES, RUN_BYTES = 160, 64
"""Bytes for a frame of one particle: of the exact solution, and of each run."""

END_FRAMES = 500
"""Frames that are drawn of the end of a run whose motion is too fast to draw as a whole."""

RESOLVED_WAY = 0.25
"""Largest displacement between two drawn frames, relative to the range, that still resolves the motion: half
a radian of an oscillation.  Beyond, lines between frames are chords, and aliasing shows a slow wave."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawable:
    """Trajectories to draw: over their whole length, and the part in which the motion is resolved."""

    scene: Scene
    runs: dict[str, Trajectory]
    followed: dict[str, Trajectory]
    notes: list[str]
    """Notes on what was left out."""


def drawable(path: Path, most: int = MOST_FRAMES) -> Drawable:
    """Scene and trajectories of a store to draw, with at most so many frames of each."""
    summary = keeper.summary(path)
    scene = keeper.stored_scene(path)
    frames = max(FEWEST_FRAMES, min(most, MOST_NUMBERS // scene.n))
    memory.need(
        scene.n * min(frames, scene.frames) * (FIGURE_BYTES + RUN_BYTES * len(summary.runs)),
        f"the figures of {scene.n} particles",
        "inspect and report show their numbers",
    )
    runs: dict[str, Trajectory] = {}
    notes = []
    fast = False
    for run in summary.runs:
        runs[run.label], stride = keeper.strided(path, run.label, frames)
        if stride > 1:
            notes.append(f"{run.label}: every {ordinal(stride)} of {run.frames} frames is drawn")
            end = keeper.end(path, run.label, min(END_FRAMES, frames))
            fast |= not _shows_motion(runs[run.label], end, stride)
    followed = runs
    if fast:
        kept, longest = min(END_FRAMES, frames), max(run.frames for run in summary.runs)
        here = {run.label: kept - longest + run.frames for run in summary.runs}
        followed = {label: keeper.end(path, label, count) for label, count in here.items() if count > 1}
        notes.append(f"position and phase portrait: the last {kept} frames, energy: the whole run")
        if gone := sorted({*runs} - {*followed}):
            notes.append(f"position and phase portrait: without {', '.join(gone)}, which ended before")
    return Drawable(scene=scene, runs=runs, followed=followed, notes=notes)


def _shows_motion(run: Trajectory, end: Trajectory, stride: int) -> bool:
    """Whether its frames are close enough to be joined by lines.  Aliasing, a return between two of them, is
    detected by the frames of its end, none of which are left out."""
    with np.errstate(over="ignore"):
        moved, each = (np.max(np.abs(np.diff(one.q[:, 0])), initial=0.0) for one in (run, end))
        return bool(max(moved, stride * each) <= RESOLVED_WAY * np.ptp(run.q[:, 0]))
