"""Limits of stability, damped regions, resonances, and what stiffness costs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from springcheck.figures import looks, overlay
from springcheck.studies.stability.costs import Cost
from springcheck.studies.stability.limits import Limit
from springcheck.studies.stability.regions import Region
from springcheck.studies.stability.resonance import Resonance
from springcheck.studies.stability.result import Stability, fastest

ROOM = 30.0
"""Errors above this say nothing."""


def pictures(study: Stability) -> dict[str, Figure]:
    """Figures of what was measured, by name."""
    out = {}
    if study.limits:
        out["stability-limits"] = limits(study.limits, abs(study.scene.step) * fastest(study.scene))
    if study.regions:
        out["stability-regions"] = regions(study.regions)
    if study.resonances:
        out["stability-resonances"] = resonances(study.resonances)
    if study.costs:
        out[f"stability-costs-{study.scene.name}"] = costs(study.costs)
    return out


def limits(found: Sequence[Limit], fastest: float | None = None) -> Figure:
    """Spectral radius against h w: schemes as lines, engines as marks on them.

    `fastest`: h times the fastest angular frequency of a scene, marked.
    """
    figure = Figure(figsize=(9.2, 4.8), layout="constrained")
    axes = figure.add_subplot()
    axes.axhspan(0, 1, color="#f2f2f2", zorder=0)
    axes.axhline(1.0, color="#888888", linewidth=0.8)
    groups = looks.by_scheme(limit.method for limit in found)
    members = {name: [one for one in found if one.method in labels] for name, labels in groups.items()}
    for i, (name, mine) in enumerate(members.items()):
        look = looks.look(name)
        axes.plot(
            mine[0].h_w, mine[0].radius_predicted, color=look.color, linestyle=look.linestyle, label=name
        )  # fmt: skip
        for j, limit in enumerate(mine):
            axes.plot(
                limit.h_w[(i + j) % 4 :: 4], limit.radius[(i + j) % 4 :: 4], linestyle="none",
                marker=looks.mark(looks.engine(limit.method))[0], markerfacecolor="white",
                markeredgecolor=look.color, label=limit.method,
            )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("symlog", linthresh=2.0)
    axes.set_ylim(0, 200)
    axes.set_xlim(0.09, 1.1 * max(float(limit.h_w[-1]) for limit in found))
    axes.set_yticks([0, 0.5, 1, 1.5, 2, 10, 100], ["0", "0.5", "1", "1.5", "2", "10", "100"])
    ticks = [x for x in (0.1, 0.5, 1, 2, 5, 16, 50) if x < axes.get_xlim()[1]]
    axes.set_xticks(ticks, [f"{x:g}" for x in ticks])
    axes.minorticks_off()
    axes.set_xlabel("step times frequency, $h\\,\\omega$")
    axes.set_ylabel("spectral radius of one step")
    if fastest is not None and axes.get_xlim()[0] < fastest < axes.get_xlim()[1]:
        axes.axvline(fastest, color="#555555", linewidth=0.9, linestyle=(0, (1, 2)))
        axes.annotate(f" this scene: {fastest:.3g}", (fastest, 150), fontsize=7.5, color="#555555", va="top")
    overlay.heading(figure, "Stable where the radius of one step is at most 1 (grey)")
    overlay.scheme_legend(figure, groups)
    return figure


def regions(found: Sequence[Region]) -> Figure:
    """Where each method is stable in the damped plane, theory's border on top."""
    figure, grid, columns = overlay.panels(len(found), 2, (4.3, 0), (3.4, 0.5), shared="xy")
    for j, (axes, region) in enumerate(zip(grid, found, strict=True)):
        axes.grid(False)
        axes.pcolormesh(
            region.h_w, region.damping_ratio, region.stable, cmap=ListedColormap(["#ffffff", "#9ecae1"]),
            vmin=0, vmax=1, shading="nearest", rasterized=True,
        )  # fmt: skip
        if not region.stable_predicted.all():
            axes.contour(
                region.h_w, region.damping_ratio, region.stable_predicted.astype(float), levels=[0.5],
                colors="#D55E00", linewidths=1.6,
            )  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.axhline(1.0, color="#777777", linewidth=0.8, linestyle=":")
        axes.set_title(region.method)
        _say(axes, f"{region.points} points, {region.wrong} against theory")
        # the axis is shared, and the panel below may be missing
        axes.tick_params(labelbottom=j >= len(found) - columns)
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
    figure, grid, _ = overlay.panels(len(found), 1, (8.0, 0), (3.8, 0))
    for axes, one in zip(grid, found, strict=True):
        axes.plot(
            one.h_w, one.radius_predicted - 1, color="#b3b3b3", linewidth=3, label="the exact map"
        )  # fmt: skip
        axes.plot(
            one.h_w, one.radius - 1, linestyle="none", marker="o", markersize=2.2,
            color=looks.look(looks.scheme_of(one.method)).color, label=f"{one.method}, measured",
        )  # fmt: skip
        axes.axvline(np.pi, color="#777777", linestyle=":", linewidth=1)
        top = float(np.max(one.radius_predicted - 1))
        axes.text(np.pi + 0.05, 0.9 * top, "$\\pi$", color="#555555")
        for a, b in one.bands:
            at = (a + b) / 2
            peak = float(np.max(np.where((one.h_w >= a) & (one.h_w <= b), one.radius - 1, 0)))
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
    """Steps, force calls and error against stiffness; hollow where a run was too long to be finished."""
    figure = Figure(figsize=(11.4, 4.4), layout="constrained")
    groups = looks.by_scheme(dict.fromkeys(cost.method for cost in found))
    panels = (("steps", "steps"), ("force_calls", "force calls"), ("error", "error of the slow motion"))
    for axes, (field, title) in zip(figure.subplots(1, 3), panels, strict=True):
        for scheme, methods in groups.items():
            mine = [[cost for cost in found if cost.method == method] for method in methods]
            # the line goes through the one that was run to its end most often
            finished = [sum(cost.outcome == "complete" for cost in rows) for rows in mine]
            for j, rows in enumerate(mine):
                _cost(axes, rows, field, scheme, j == int(np.argmax(finished)))
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(title, loc="left")
        axes.set_xlabel(
            "stiffness ratio" if found[0].family == "two-scales" else "damping ratio, $c\\,/\\,2\\sqrt{km}$"
        )
    overlay.heading(
        figure,
        f"{found[0].family}: what stiffness costs (hollow: runs too long to be finished, estimated)",
        110,
    )
    overlay.scheme_legend(figure, groups)
    return figure


def _cost(axes: Axes, rows: Sequence[Cost], field: str, scheme: str, line: bool) -> None:
    """One method's numbers: the first of a scheme as a line, all as marks."""
    look = looks.look(scheme)
    done = np.array([cost.outcome == "complete" for cost in rows])
    x = np.array([cost.ratio for cost in rows])
    y = np.array([float(getattr(cost, field)) for cost in rows])
    # an error above the size of the motion, and force calls of a part of a run, say nothing
    seen = (y > 0) & (y < ROOM if field == "error" else done | (field == "steps"))
    if line:
        axes.plot(x[seen], y[seen], color=look.color, linestyle=look.linestyle)
    for full in (True, False):
        some = seen & (done == full)
        axes.plot(
            x[some], y[some], linestyle="none", marker=looks.mark(looks.engine(rows[0].method))[0],
            markeredgecolor=look.color, markerfacecolor=look.color if full else "white", markersize=4.5,
        )  # fmt: skip
