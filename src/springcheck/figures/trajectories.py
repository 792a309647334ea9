"""The pictures of the blog, with the engines laid over them: phase portrait, position, energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from springcheck import exact, mechanics
from springcheck.figures.style import COLOURS, LINES, MARKERS, save, style
from springcheck.model import Floats, Scene, Trajectory
from springcheck.schemes import SCHEMES

UNITS = {
    "reduced": ("", "", "", ""),
    "md": (" (nm)", " (u nm/ps)", " (ps)", " (kJ/mol)"),
    "si": (" (m)", " (kg m/s)", " (s)", " (J)"),
}
CIRCUIT = (" (C)", " (Wb)", " (s)", " (J)")


def draw(scene: Scene, runs: Mapping[str, Trajectory], folder: Path) -> list[Path]:
    """Draw all figures of a store into a folder; returns the files."""
    usable = {label: run for label, run in runs.items() if len(run.t) > 1}
    if not usable:
        return []
    groups = _groups(usable)
    written = []
    with style():
        for name, picture in (
            ("phase-portrait", _phase_portrait),
            ("position", _position),
            ("energy", _energy),
        ):
            written += save(picture(scene, groups), folder, name)
    return written


Group = tuple[str, list[Trajectory]]


def _groups(runs: Mapping[str, Trajectory]) -> list[Group]:
    """Trajectories by scheme: runs of one scheme lie on one another, so they share a colour."""
    found: dict[str, list[Trajectory]] = {}
    for run in runs.values():
        found.setdefault(run.scheme, []).append(run)
    return [(SCHEMES[name].title, members) for name, members in found.items()]


def _units(scene: Scene) -> tuple[str, str, str, str]:
    return CIRCUIT if scene.kind == "circuit" else UNITS[scene.units]


def _truth(scene: Scene, runs: Sequence[Group]) -> tuple[Floats, Floats, Floats] | None:
    """A smooth true motion over the longest run: t (f,), q, p (f, n)."""
    if not exact.has_true_motion(scene):
        return None
    end = max(abs(float(run.t[-1])) for _, members in runs for run in members)
    f = 1500
    h = np.copysign(end / (f - 1), scene.step)
    q, p = exact.true_motion(scene, np.arange(f), h)
    return np.arange(f) * h, np.asarray(q, np.float64), np.asarray(p, np.float64)


def _line(axes: Axes, x: Floats, y: Floats, i: int, label: str) -> None:
    axes.plot(x, y, color=COLOURS[i % len(COLOURS)], linestyle=LINES[i % len(LINES)], label=label)


def _marks(axes: Axes, x: Floats, y: Floats, i: int, j: int, label: str) -> None:
    """An engine on top of its scheme's line: hollow marks, each engine's at other frames."""
    every = max(1, len(x) // 14)
    axes.plot(
        x[j * every // 3 :: every],
        y[j * every // 3 :: every],
        linestyle="none",
        marker=MARKERS[j % len(MARKERS)],
        markerfacecolor="white",
        markeredgecolor=COLOURS[i % len(COLOURS)],
        label=label,
    )


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False)


def _overlay(axes: Axes, groups: Sequence[Group], pick: Any) -> None:
    for i, (title, members) in enumerate(groups):
        for j, run in enumerate(members):
            x, y = pick(run)
            if j == 0:
                _line(axes, x, y, i, title)
            _marks(axes, x, y, i, j, run.label)


def _phase_portrait(scene: Scene, groups: Sequence[Group]) -> Figure:
    q_unit, p_unit, _, _ = _units(scene)
    figure = Figure(figsize=(7.6, 5.2), layout="constrained")
    axes = figure.add_subplot()
    truth = _truth(scene, groups)
    if truth is not None:
        axes.plot(
            truth[1][:, 0], truth[2][:, 0], color="#999999", linewidth=4, alpha=0.6, label="true motion"
        )
    _overlay(axes, groups, lambda run: (run.q[:, 0], run.p[:, 0]))
    axes.plot(*[[float(x[0])] for x in (scene.q, scene.p)], "k+", markersize=10, label="start")
    axes.set_xlabel(f"{_q(scene)}{q_unit}")
    axes.set_ylabel(f"{_p(scene)}{p_unit}")
    axes.set_title(f"{scene.title}: phase portrait{_which(scene)}")
    if scene.units == "reduced":
        axes.set_aspect("equal", adjustable="datalim")
    _legend(figure, axes)
    return figure


def _position(scene: Scene, groups: Sequence[Group]) -> Figure:
    q_unit, _, t_unit, _ = _units(scene)
    figure = Figure(figsize=(7.6, 4.2), layout="constrained")
    axes = figure.add_subplot()
    truth = _truth(scene, groups)
    if truth is not None:
        axes.plot(truth[0], truth[1][:, 0], color="#999999", linewidth=4, alpha=0.6, label="true motion")
    _overlay(axes, groups, lambda run: (run.t, run.q[:, 0]))
    axes.set_xlabel(f"time t{t_unit}")
    axes.set_ylabel(f"{_q(scene)}{q_unit}")
    axes.set_title(f"{scene.title}: {_q(scene).split()[0]}{_which(scene)}")
    _legend(figure, axes)
    return figure


def _energy(scene: Scene, groups: Sequence[Group]) -> Figure:
    """Energy over time, and below it how far it is from the start's on a logarithmic scale."""
    _, _, t_unit, e_unit = _units(scene)
    figure = Figure(figsize=(7.6, 6.2), layout="constrained")
    upper, lower = figure.subplots(2, sharex=True)
    start = float(mechanics.energy(scene, scene.q, scene.p))
    unit = abs(start) or 1.0

    def energies(run: Trajectory) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(mechanics.energy(scene, run.q, run.p), np.float64)

    upper.axhline(start / unit, color="#999999", linewidth=4, alpha=0.6, label="true motion")
    _overlay(upper, groups, lambda run: (run.t, energies(run) / unit))
    low, high = upper.get_ylim()
    if low > 0 and high / low > 20:
        upper.set_yscale("log")
    upper.set_ylabel("energy / energy of the start" if start else f"energy{e_unit}")
    upper.set_title(f"{scene.title}: energy")

    # below one unit in the last place there is nothing to see: such points stand on the lower edge
    floor = 2.0**-53
    _overlay(lower, groups, lambda run: (run.t, np.maximum(np.abs(energies(run) - start) / unit, floor)))
    lower.set_yscale("log")
    lower.set_xlabel(f"time t{t_unit}")
    lower.set_ylabel("|energy - start| / start" if start else f"|energy - start|{e_unit}")
    _legend(figure, upper)
    return figure


def _q(scene: Scene) -> str:
    return {"particles": "position q", "circuit": "charge q", "rotor": "angle q"}[scene.kind]


def _p(scene: Scene) -> str:
    return {"particles": "momentum p", "circuit": "flux p", "rotor": "angular momentum p"}[scene.kind]


def _which(scene: Scene) -> str:
    return f" (particle 0 of {scene.n})" if scene.n > 1 else ""
