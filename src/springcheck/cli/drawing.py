"""`springcheck plot`: everything in a store that can be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import interrupts, store
from springcheck.cli import inspect
from springcheck.errors import SpringcheckError, plain
from springcheck.figures import folder
from springcheck.studies import STUDIES
from springcheck.text.wording import count

MOST_COORDINATES = 8
"""Coordinates of a file of other programs that are drawn."""


def draw(path: Path, into: Path, **chosen: Any) -> tuple[list[Path], list[str]]:
    """Draw the studies of a store into a folder -> the files, and notes on what they leave out.

    `chosen`: options of a study's figures, as `particle=0`, and only studies that have them are drawn; None
    chooses nothing.  Figures of this store are replaced, and nothing else.  SpringcheckError where there is
    nothing to draw.
    """
    chosen = {name: value for name, value in chosen.items() if value is not None}
    if into.exists() and not into.is_dir():
        raise SpringcheckError(f"{into} is a file: figures need a folder, name another one with -o")
    summary = store.summary(path)
    studies = list(inspect.held(summary))
    if not studies:
        rest = "" if summary.complete else " yet: give the command that writes it again, it goes on"
        raise SpringcheckError(f"{path}: holds no trajectory and no study to draw{rest}")
    drawn = [(study, found) for study, found in studies if chosen.keys() <= set(study.chooses)]
    if not drawn:
        wanted = [study.name for study in STUDIES if chosen.keys() <= set(study.chooses)]
        what = " and ".join(f"--{name}" for name in chosen)
        whose = f"goes with a store of {' or '.join(wanted)}" if wanted else "do not go together"
        held = " and ".join(study.name for study, _ in studies)
        raise SpringcheckError(f"{path}: {what} {whose}, and it holds {held}")
    notes: list[str] = []
    with interrupts.folder() as made:
        written: list[Path] = []
        for study, found in drawn:
            written += study.draw(found, made, look=partial(folder.look, folder=into, path=path), **chosen)
            notes += getattr(found, "notes", ())
        if not written:
            raise SpringcheckError(f"{path}: nothing was measured in its study that can be drawn")
        return folder.put(written, into, path), notes


def draw_foreign(
    path: Path,
    into: Path,
    *,
    particle: int | None = None,
    columns: Sequence[str] = (),
    step: float | None = None,
    trajectory: str | None = None,
) -> tuple[list[Path], list[str]]:
    """Draw the states in a file of any program, as `draw`; `particle` counts coordinates from 0 on."""
    from matplotlib.figure import Figure

    from springcheck.cli.file import states_in
    from springcheck.figures.style import save, style

    found = states_in(path, columns, step, trajectory)
    other, name = (found.p, "p") if found.p is not None else (np.asarray(found.v), "v")
    n = found.q.shape[1]
    if particle is not None and not 0 <= particle < n:
        raise SpringcheckError(f"{path}: --particle {particle}: it has coordinates 0 to {n - 1}")
    moving = np.flatnonzero(np.ptp(found.q, axis=0) > 0)
    chosen = moving[:MOST_COORDINATES] if particle is None else np.array([particle])
    left = len(moving) - len(chosen)
    notes = (
        [f"{count(left, 'moving coordinate')} more, which --particle draws"]
        if particle is None and left
        else []
    )
    with style(), interrupts.folder() as made:
        figure = Figure(figsize=(9.2, 4.2), layout="constrained")
        portrait, motion = figure.subplots(1, 2)
        for i in chosen.tolist() or [0]:
            portrait.plot(found.q[:, i], other[:, i], label=f"coordinate {i}")
            motion.plot(found.t, found.q[:, i])
        portrait.set_xlabel("q")
        portrait.set_ylabel(name)
        portrait.legend()
        motion.set_xlabel("t")
        motion.set_ylabel("q")
        figure.suptitle(plain(f"{path.name}: {count(len(found.t), 'frame')}"))
        return folder.put(save(figure, made, "states"), into, path), notes
