"""One style for every figure: legible in print and for the colour-blind, as PNG and SVG.

Colours, lines and marks of schemes and engines are in `looks`.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.text import Text

from springcheck.errors import plain
from springcheck.figures.folder import write

LONGEST_LINE = 120
"""Characters of a line of text, and of a file's name."""

DPI = 200.0
"""Resolution of a PNG."""

_RC: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    # times of 1e-4 s as a factor beside the axis: as they are their numbers run into each other
    "axes.formatter.limits": (-3, 5),
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "figure.dpi": 100.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "springcheck",
}


@contextmanager
def style() -> Iterator[None]:
    """Draw inside this context."""
    with mpl.rc_context(_RC):
        yield


def files_of(name: str) -> list[str]:
    """Names of the files of a figure: PNG and SVG."""
    safe = re.sub(r"[^\w-]", "-", name)[:LONGEST_LINE]
    return [f"{safe}.png", f"{safe}.svg"]


def drawn(figure: Figure, name: str) -> dict[str, bytes]:
    """The files of a figure, PNG and SVG, by their names.

    Its texts may come from any file: control characters are escaped, and what is not valid mathtext stays
    text.
    """
    texts = figure.findobj(Text)
    for text in texts:
        text.set_text("\n".join(plain(line, LONGEST_LINE) for line in text.get_text().split("\n")))
    try:
        found = _drawn(figure)
    except ValueError:
        # a title with dollar signs that is not mathtext
        for text in texts:
            text.set_parse_math(False)
        found = _drawn(figure)
    return dict(zip(files_of(name), found, strict=True))


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and SVG; StoreError where the folder cannot be written."""
    return write(drawn(figure, name), folder)


def _drawn(figure: Figure) -> tuple[bytes, bytes]:
    """The figure as PNG, and as SVG of the same layout; `savefig` would draw each twice."""
    png, svg = BytesIO(), BytesIO()
    with warnings.catch_warnings():
        # a title may be in any script: what the font has not is drawn as boxes
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.set_dpi(DPI)
        engine = figure.get_layout_engine()
        if engine and any(axes.get_aspect() != "auto" for axes in figure.axes):
            # a first pass sizes the labels before axes of equal scales are laid out
            for _ in range(2):
                engine.execute(figure)
        FigureCanvasAgg(figure).print_png(png)  # type: ignore[no-untyped-call]
        figure.set_layout_engine("none")
        FigureCanvasSVG(figure).print_svg(svg, metadata={"Date": None})  # type: ignore[no-untyped-call]
    return png.getvalue(), svg.getvalue()
