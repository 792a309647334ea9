"""Limits of stability, damped regions, resonances, and what stiffness costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from springcheck.figures.style import COLOURS, LINES, MARKERS, save, style
from springcheck.studies.stability.costs import Cost
from springcheck.studies.stability.limits import Limit
from springcheck.studies.stability.regions import Region
from springcheck.studies.stability.resonance import Resonance
from springcheck.studies.stability.result import Stability


def draw(study: Stability, folder: Path) -> list[Path]:
    """Draw what was measured into a folder; returns the files."""
    written = []
    with style():
        if study.limits:
            written += save(limits(study.limits), folder, "stability-limits")
        if study.regions:
            written += save(regions(study.regions), folder, "stability-regions")
        if study.resonances:
            written += save(resonances(study.resonances), folder, "stability-resonances")
        if study.costs:
            written += save(costs(study.costs), folder, f"stability-costs-{study.scene.name}")
    return written


def limits(found: Sequence[Limit]) -> Figure:
    """Spectral radius against h w: schemes as lines, engines as marks on them."""
    schemes: dict[str, list[Limit]] = {}
    for limit in found:
        schemes.setdefault(limit.scheme, []).append(limit)
    figure = Figure(figsize=(9.2, 4.6), layout="constrained")
    axes = figure.add_subplot()
    axes.axhline(1.0, color="#888888", linewidth=0.8)
    for i, (scheme, members) in enumerate(schemes.items()):
        colour = COLOURS[i % len(COLOURS)]
        axes.plot(
            members[0].turn, members[0].radius_predicted, color=colour, linestyle=LINES[i % len(LINES)],
            label=scheme.partition(":")[0],
        )  # fmt: skip
        for j, limit in enumerate(members):
            axes.plot(
                limit.turn[(i + j) % 4 :: 4], limit.radius[(i + j) % 4 :: 4], linestyle="none",
                marker=MARKERS[j % len(MARKERS)], markerfacecolor="white", markeredgecolor=colour,
                label=f"   {limit.method}",
            )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("symlog", linthresh=2.0)
    axes.set_ylim(0, 200)
    axes.set_xlim(0.09, 1.1 * max(float(limit.turn[-1]) for limit in found))
    axes.set_yticks([0, 0.5, 1, 1.5, 2, 10, 100], ["0", "0.5", "1", "1.5", "2", "10", "100"])
    ticks = [x for x in (0.1, 0.5, 1, 2, 5, 16, 50) if x < axes.get_xlim()[1]]
    axes.set_xticks(ticks, [f"{x:g}" for x in ticks])
    axes.minorticks_off()
    axes.set_xlabel("step times frequency, $h\\,\\omega$")
    axes.set_ylabel("spectral radius of one step")
    axes.set_title("Stable where the radius is at most 1: schemes (lines), engines' own propagators (marks)")
    handles, names = axes.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside right upper", frameon=False)
    return figure


def regions(found: Sequence[Region]) -> Figure:
    """Where each method is stable in the damped plane, theory's border on top."""
    columns = min(2, len(found))
    rows = -(-len(found) // columns)
    figure = Figure(figsize=(4.3 * columns, 3.4 * rows + 0.5), layout="constrained")
    grid = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
    for axes, region in zip(grid, found, strict=False):
        axes.grid(False)
        axes.pcolormesh(
            region.turn, region.ratio, region.stable, cmap=ListedColormap(["#ffffff", "#9ecae1"]),
            vmin=0, vmax=1, shading="nearest", rasterized=True,
        )  # fmt: skip
        if not region.stable_predicted.all():
            axes.contour(
                region.turn, region.ratio, region.stable_predicted.astype(float), levels=[0.5],
                colors=COLOURS[1], linewidths=1.6,
            )  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.axhline(1.0, color="#777777", linewidth=0.8, linestyle=":")
        axes.set_title(region.method)
        _say(axes, f"{region.points} points, {region.wrong} against theory")
    for j, axes in enumerate(grid):
        # the axis is shared, and the panel below may be missing
        axes.tick_params(labelbottom=j >= len(found) - columns)
        if j >= len(found):
            axes.set_axis_off()
    figure.supxlabel("step times frequency, $h\\,\\omega$", fontsize=9)
    figure.supylabel("damping ratio, $c\\,/\\,2\\sqrt{km}$", fontsize=9)
    figure.suptitle(
        "Blue: measured stable. Line: the border of theory. Dotted: critical damping", fontsize=10
    )
    return figure


def _say(axes: Axes, text: str) -> None:
    axes.text(
        0.03, 0.04, text, transform=axes.transAxes, fontsize=7.5,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5},
    )  # fmt: skip


def resonances(found: Sequence[Resonance]) -> Figure:
    """Growth per step along h w of the fast spring."""
    figure = Figure(figsize=(8.0, 3.8 * len(found)), layout="constrained")
    for axes, one in zip(np.atleast_1d(figure.subplots(len(found), 1)).ravel(), found, strict=True):
        axes.plot(one.turn, one.radius_predicted - 1, color=COLOURS[0], label="the exact map")
        axes.plot(
            one.turn, one.radius - 1, linestyle="none", marker="o", markersize=2.6, color=COLOURS[1],
            label=f"{one.method}, measured",
        )  # fmt: skip
        axes.axvline(np.pi, color="#777777", linestyle=":", linewidth=1)
        top = float(np.max(one.radius_predicted - 1))
        axes.text(np.pi + 0.05, 0.9 * top, "$\\pi$", color="#555555")
        for a, b in one.bands:
            at = (a + b) / 2
            peak = float(np.max(np.where((one.turn >= a) & (one.turn <= b), one.radius - 1, 0)))
            axes.text(
                at, peak + 0.05 * top, f"{a:.4f} to {b:.4f}", ha="right" if at < 4 else "center",
                fontsize=7.5,
            )  # fmt: skip
        axes.set_ylim(-0.05 * top, 1.22 * top)
        axes.set_xlabel("outer step times fast frequency, $h\\,\\omega_{fast}$")
        axes.set_ylabel("growth of one step, $\\rho - 1$")
        axes.set_title(f"{one.scene}: bands in which multiple time steps resonate")
        axes.legend(loc="upper left", frameon=False)
    return figure


def costs(found: Sequence[Cost]) -> Figure:
    """Steps, force calls and error against stiffness."""
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    panels = figure.subplots(1, 3)
    methods = list(dict.fromkeys(cost.method for cost in found))
    for axes, (field, title) in zip(
        panels,
        (
            ("steps", "steps"),
            ("force_calls", "force calls of finished runs"),
            ("error", "error of the slow motion"),
        ),
        strict=True,
    ):
        for i, method in enumerate(methods):
            rows = [cost for cost in found if cost.method == method]
            if field == "force_calls":
                rows = [cost for cost in rows if cost.outcome == "complete"]
            x = [cost.ratio for cost in rows]
            y = np.array([float(getattr(cost, field)) for cost in rows])
            y = np.where((y > 0) & (y < 30 if field == "error" else y > 0), y, np.nan)
            axes.plot(
                x, y, color=COLOURS[i % len(COLOURS)], linestyle=LINES[(i + i // 7) % len(LINES)],
                marker=MARKERS[i % len(MARKERS)], markerfacecolor="white", label=method,
            )  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(title)
        axes.set_xlabel(
            "stiffness ratio" if found[0].family == "two-scales" else "damping ratio, $c\\,/\\,2\\sqrt{km}$"
        )
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside right upper", frameon=False)
    figure.suptitle(f"{found[0].family}: what stiffness costs (steps of unfinished runs are estimates)")
    return figure
