"""One style for every figure: legible in print and for the colour-blind, as PNG and SVG.

Colours are those of Okabe & Ito (2008), told apart by people with any colour vision; line style and
marker change with the colour, so that a grey print can be read too.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from springcheck.errors import StoreError

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LINES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")

_RC: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "figure.dpi": 100.0,
    "savefig.dpi": 200.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "springcheck",
}


@contextmanager
def style() -> Iterator[None]:
    """Draw inside this context."""
    with mpl.rc_context(_RC):
        yield


def look(i: int) -> dict[str, Any]:
    """Colour and line style of the i-th line."""
    return {"color": COLOURS[i % len(COLOURS)], "linestyle": LINES[i % len(LINES)]}


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and SVG; StoreError where the folder cannot be written."""
    if folder.exists() and not folder.is_dir():
        raise StoreError(f"{folder} is a file: figures need a folder, name another one with -o")
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for ending in ("png", "svg"):
            path = folder / f"{name}.{ending}"
            figure.savefig(path, metadata={"Date": None} if ending == "svg" else None)
            written.append(path)
    except OSError as error:
        raise StoreError(f"{folder}: figures cannot be written: {error.strerror or error}") from error
    return written
