"""The frames of a stored run that are drawn, in memory that does not grow with its trajectories."""

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
"""Most frames of one trajectory that are drawn; of a longer one every so many, which a note says."""

FEWEST_FRAMES, MOST_NUMBERS = 16, 1 << 22
"""Frames that are drawn however many particles there are, and positions above which frames are left out."""

FIGURE_BYTES, RUN_BYTES = 160, 64
"""Memory for a frame of one particle: of the exact solution, and of each run."""

END_FRAMES = 500
"""Frames that are drawn of the end of a run whose motion is too fast for all of it."""

RESOLVED = 0.25
"""Largest way between two drawn frames, as a part of the whole, that still shows the motion: half a radian
of an oscillation.  Beyond, lines between them are chords, and a slow wave is seen that is not there."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawable:
    """Trajectories to draw: over their whole length, and the part whose motion can be followed."""

    scene: Scene
    runs: dict[str, Trajectory]
    followed: dict[str, Trajectory]
    notes: list[str]
    """What was left out."""


def drawable(path: Path, most: int = MOST_FRAMES) -> Drawable:
    """Scene and trajectories of a store to draw, of each so many frames at the most."""
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
        followed = {run.label: keeper.end(path, run.label, min(END_FRAMES, frames)) for run in summary.runs}
        notes.append(
            f"position and phase portrait: the last {min(END_FRAMES, frames)} frames, energy: the whole run"
        )
    return Drawable(scene=scene, runs=runs, followed=followed, notes=notes)


def _shows_motion(run: Trajectory, end: Trajectory, stride: int) -> bool:
    """Whether its frames stand close enough to be joined by lines: what moves round and back to its place
    between two of them is seen by the frames of its end, none of which are left out."""
    with np.errstate(over="ignore"):
        moved, each = (np.max(np.abs(np.diff(one.q[:, 0])), initial=0.0) for one in (run, end))
        return bool(max(moved, stride * each) <= RESOLVED * np.ptp(run.q[:, 0]))
