"""The atlas of extreme cases: for every method a map of outcomes over force and h w."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from springcheck.figures import overlay
from springcheck.physics.arrays import Floats
from springcheck.studies.extremes.planes import planes
from springcheck.studies.extremes.result import OUTCOMES, Atlas

SHADES = ("#9ecae1", "#fee391", "#d94801", "#bdbdbd", "#000000", "#8c6bb1")
"""Of the outcomes, in their order."""
MOST_ROWS = 12
"""Of h w that are written."""
RARE = "not measured"
"""It stands in the legend only where there is one."""


def pictures(atlas: Atlas) -> dict[str, Figure]:
    """Its one figure by name, none where no method of fixed step was tried."""
    return {"extremes": picture(atlas)} if planes(atlas.cells) else {}


def picture(atlas: Atlas) -> Figure:
    """One panel for each method of fixed step."""
    found = planes(atlas.cells)
    figure, grid, columns = overlay.panels(len(found), 3, (3.7, 0), (2.25, 0.9))
    gaps = False
    for j, (axes, one) in enumerate(zip(grid, found, strict=True)):
        turns, forces = one.turns, one.decades
        plane = np.array(
            [[np.nan if x is None else OUTCOMES.index(x.outcome) for x in row] for row in one.cells]
        )
        plane = np.array([_filled(row) for row in plane])
        gaps |= bool(np.isnan(plane).any())
        axes.grid(False)
        axes.imshow(
            plane, origin="lower", aspect="auto", cmap=ListedColormap(list(SHADES)), vmin=-0.5,
            vmax=len(SHADES) - 0.5, interpolation="nearest",
        )  # fmt: skip
        # every decade, or decades that lie closer about 0
        ticks = range(-200, 201, 100) if len(forces) > 100 else (-200, -50, -20, -10, 0, 10, 20, 50, 200)
        shown = [i for i, force in enumerate(forces) if force in ticks]
        axes.set_xticks(shown, [str(forces[i]) for i in shown], fontsize=7)
        rows_shown = range(0, len(turns), -(-len(turns) // MOST_ROWS))
        axes.set_yticks(
            rows_shown, [f"{turns[i]:.3g}" for i in rows_shown], fontsize=6 if len(rows_shown) > 8 else 7
        )
        axes.set_title(one.method, fontsize=8.5)
        if j % columns == 0:
            axes.set_ylabel("$h\\,\\omega$")
        if j >= len(found) - columns:
            axes.set_xlabel("$\\log_{10}$ force")
    named = [one for one in zip(SHADES, OUTCOMES, strict=True) if one[1] != RARE or atlas.counts()[RARE]]
    handles = [Patch(facecolor=shade, label=name) for shade, name in named]
    if gaps:
        handles.append(Patch(facecolor="white", edgecolor="#bbbbbb", label="not tried"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(6, 2 * columns), frameon=False)
    total = ", ".join(f"{count} {name}" for name, count in atlas.counts().most_common())
    title = textwrap.fill(f"{len(atlas.cells)} extreme cases: {total}", 46 * columns)
    figure.suptitle(title, fontsize=10)
    return figure


def _filled(row: Floats) -> Floats:
    """A row of outcomes (c,), each cell as wide as the distance to the next one that was tried: a coarse grid
    has other forces in every row."""
    tried = np.flatnonzero(np.isfinite(row))
    if len(tried) < 2:
        return row
    apart = np.abs(np.arange(len(row))[:, None] - tried)
    near = np.min(apart, axis=1) <= (np.median(np.diff(tried)) + 1) // 2
    return np.where(near, row[tried[np.argmin(apart, axis=1)]], np.nan)
