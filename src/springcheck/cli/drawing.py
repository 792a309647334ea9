"""`springcheck plot`: everything in a store that can be drawn."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import store
from springcheck.cli import inspect
from springcheck.errors import SpringcheckError
from springcheck.figures import folder
from springcheck.studies import STUDIES
from springcheck.text.wording import count

MOST_COORDINATES = 8
"""Most coordinates that are drawn of another program's file."""

LIKE_SIZES = 2.5
"""Ratio of the ranges of q and p up to which their axes have one scale."""

FEWEST_PERIOD_FRAMES = 12
"""Fewest frames of a period that lines may join."""


def need_matplotlib() -> None:
    """SpringcheckError where matplotlib is missing, or the environment asks for an unknown backend."""
    try:
        import_module("matplotlib")
    except ImportError as error:
        how = "python -m pip install matplotlib"
        raise SpringcheckError(f"figures need matplotlib, which cannot be imported: {how}") from error
    except ValueError as error:
        asked = os.environ.get("MPLBACKEND")
        raise SpringcheckError(
            f"MPLBACKEND={asked!r} names no backend of matplotlib: unset it, or set it to agg"
        ) from error


def draw(path: Path, into: Path, **chosen: Any) -> tuple[list[Path], list[str]]:
    """Draw the studies of a store into a folder -> the files, and notes on what they leave out.

    `chosen`: options of a study's figures, as `particle=0`; only studies that have them are drawn, and None
    is no choice.  Only figures of this store are replaced.  SpringcheckError where there is nothing to draw.
    """
    chosen = {name: value for name, value in chosen.items() if value is not None}
    folder.check((), into, path)
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
    files: dict[str, bytes] = {}
    for study, found in drawn:
        files |= study.drawn(found, partial(folder.check, folder=into, path=path), **chosen)
        notes += getattr(found, "notes", ())
    if not files:
        raise SpringcheckError(f"{path}: nothing was measured in its study that can be drawn")
    return folder.put(files, into, path), notes


def draw_foreign(
    path: Path,
    into: Path,
    *,
    particle: int | None = None,
    columns: Sequence[str] = (),
    step: float | None = None,
    trajectory: str | None = None,
) -> tuple[list[Path], list[str]]:
    """Draw the states in any program's file, as `draw`; `particle` is the index of a coordinate."""
    from springcheck.cli.taken import states_in
    from springcheck.figures import looks, render
    from springcheck.figures.charts import Bank, Chart, Curve, Scale
    from springcheck.figures.motion import periods
    from springcheck.figures.style import drawn, files_of, style
    from springcheck.figures.views import with_unit

    found = states_in(path, columns, step, trajectory)
    other, name = (found.p, "p") if found.p is not None else (np.asarray(found.v), "v")
    n = found.q.shape[1]
    if particle is not None and not 0 <= particle < n:
        raise SpringcheckError(f"{path}: --particle {particle}: it has coordinates 0 to {n - 1}")
    # one with nan moves
    moving = np.flatnonzero(~(np.ptp(found.q, axis=0) == 0))
    chosen = moving[:MOST_COORDINATES] if particle is None else np.array([particle])
    left = len(moving) - len(chosen)
    notes = [*found.notes]
    if particle is None and left:
        notes.append(f"{count(left, 'moving coordinate')} more, which --particle draws")
    chosen = chosen if len(chosen) else np.array([0])
    # with fewer frames in a period lines would be chords
    few = any(len(found.t) < FEWEST_PERIOD_FRAMES * periods(found.q[:, i]) for i in chosen)

    solid = [name for name, look in looks.LOOKS.items() if look.linestyle == looks.SOLID]

    def curves(x: Any, y: Any, *, joined: bool) -> list[Curve]:
        how: Any = {"dots": few, "line": joined or not few}
        return [
            Curve(
                name=f"coordinate {i}", group=solid[i % len(solid)], x=x[:, i % x.shape[1]], y=y[:, i], **how
            )
            for i in chosen.tolist()
        ]

    q, t, y = (Scale(name=with_unit(x, found.units.get(x, ""))) for x in ("q", "t", name))
    with np.errstate(all="ignore"):
        wide, high = np.nanmax(np.ptp(found.q[:, chosen], axis=0)), np.nanmax(np.ptp(other, axis=0))
        # of like sizes a circle is to be seen as one
        equal = bool(1 / LIKE_SIZES < wide / high < LIKE_SIZES)
    orbit = curves(found.q, other, joined=False)
    charts = [
        Chart(title=f"{name} over q.", x=q, y=y, curves=orbit, equal=equal),
        Chart(title="q over time.", x=t, y=q, curves=curves(found.t[:, None], found.q, joined=True)),
    ]
    heading = f"{path.name}{f', {trajectory}' if trajectory else ''}: {count(len(found.t), 'frame')}"
    bad = np.flatnonzero(~np.isfinite(np.hstack([found.q, other])).all(axis=1))
    if len(bad):
        heading += f"; not finite: {count(len(bad), 'frame')}, the first of them frame {bad[0]}"
    bank = Bank(name="states", title="Coordinates", charts=charts, heading=heading, size=(4.4, 3.8))
    folder.check(files_of(bank.name), into, path)
    with style():
        return folder.put(drawn(render.picture(bank), bank.name), into, path), notes
