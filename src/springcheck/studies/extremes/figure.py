"""The atlas of extreme cases: for every method a map of outcomes over force and h w."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from springcheck.figures.style import save, style
from springcheck.studies.extremes.judging import Cell
from springcheck.studies.extremes.result import Atlas

OUTCOMES = ("right", "unstable, as theory says", "engine's limit", "refused", "silently wrong")
SHADES = ("#9ecae1", "#fee391", "#d94801", "#bdbdbd", "#000000")


def draw(atlas: Atlas, folder: Path) -> list[Path]:
    """Draw the atlas into a folder; returns the files, none where no method of fixed step was tried."""
    if not _planes(atlas):
        return []
    with style():
        return save(picture(atlas), folder, "extremes")


def picture(atlas: Atlas) -> Figure:
    """One panel for each method of fixed step."""
    planes = _planes(atlas)
    columns = min(3, len(planes))
    rows = -(-len(planes) // columns)
    figure = Figure(figsize=(3.7 * columns, 2.25 * rows + 0.9), layout="constrained")
    grid = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    gaps = False
    for j, (axes, (method, cells)) in enumerate(zip(grid, planes.items(), strict=False)):
        turns = sorted({round(float(np.log10(c.parameters["h_w"])), 3) for c in cells})
        forces = sorted({_decade(c.parameters) for c in cells})
        plane = np.full((len(turns), len(forces)), np.nan)
        for cell in cells:
            row = turns.index(round(float(np.log10(cell.parameters["h_w"])), 3))
            plane[row, forces.index(_decade(cell.parameters))] = OUTCOMES.index(cell.outcome)
        gaps |= bool(np.isnan(plane).any())
        axes.grid(False)
        axes.imshow(
            plane, origin="lower", aspect="auto", cmap=ListedColormap(list(SHADES)), vmin=-0.5, vmax=4.5,
            interpolation="nearest",
        )  # fmt: skip
        shown = [i for i, force in enumerate(forces) if force in (-200, -50, -20, -10, 0, 10, 20, 50, 200)]
        axes.set_xticks(shown, [str(forces[i]) for i in shown], fontsize=7)
        axes.set_yticks(
            range(len(turns)), [f"{10**turn:.3g}" for turn in turns], fontsize=6 if len(turns) > 8 else 7
        )
        axes.set_title(method, fontsize=8.5)
        if j % columns == 0:
            axes.set_ylabel("$h\\,\\omega$")
        if j >= len(planes) - columns:
            axes.set_xlabel("$\\log_{10}$ force")
    for axes in grid[len(planes) :]:
        axes.set_axis_off()
    handles = [Patch(facecolor=shade, label=name) for shade, name in zip(SHADES, OUTCOMES, strict=True)]
    if gaps:
        handles.append(Patch(facecolor="white", edgecolor="#bbbbbb", label="not tried"))
    figure.legend(handles=handles, loc="outside lower center", ncols=min(6, 2 * columns), frameon=False)
    total = ", ".join(f"{count} {name}" for name, count in atlas.counts().most_common())
    title = textwrap.fill(f"{len(atlas.cells)} extreme cases: {total}", 46 * columns)
    figure.suptitle(title, fontsize=10)
    return figure


def _planes(atlas: Atlas) -> dict[str, list[Cell]]:
    """The cells of force and h w by method; a solver, whose step is its own, has no such plane."""
    planes = {
        method: [cell for cell in atlas.cells if cell.method == method and cell.block == "force"]
        for method in dict.fromkeys(cell.method for cell in atlas.cells)
    }
    return {
        method: cells
        for method, cells in planes.items()
        if len({c.parameters["h"] for c in cells}) == 1 and len({c.parameters["k"] for c in cells}) > 1
    }


def _decade(parameters: dict[str, float]) -> int:
    return int(np.round(np.log10(parameters["k"]) + np.log10(parameters["q"])))
