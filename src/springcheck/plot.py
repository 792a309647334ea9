"""`springcheck plot`: everything in a store that can be drawn."""

from __future__ import annotations

from pathlib import Path

from springcheck import inspect, store
from springcheck.errors import SpringcheckError


def draw(path: Path, folder: Path) -> tuple[list[Path], list[str]]:
    """Draw the studies of a store into a folder -> the files, and notes on what they leave out.

    SpringcheckError where there is nothing to draw.
    """
    summary = store.summary(path)
    studies = list(inspect.held(summary))
    if not studies:
        rest = "" if summary.complete else " yet: give the command that writes it again, it goes on"
        raise SpringcheckError(f"{path}: holds no trajectory and no study to draw{rest}")
    written: list[Path] = []
    notes: list[str] = []
    for study, found in studies:
        written += study.draw(found, folder)
        notes += getattr(found, "notes", ())
    if not written:
        raise SpringcheckError(f"{path}: nothing was measured in its study that can be drawn")
    return written, notes
