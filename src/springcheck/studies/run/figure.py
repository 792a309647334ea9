"""The pictures of the blog, with the engines laid over them: phase portrait, position, energy."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from springcheck import schemes
from springcheck.arrays import Floats, Reals
from springcheck.figures.style import COLOURS, LINES, MARKERS, save, style
from springcheck.physics import exact
from springcheck.physics.scene import Scene
from springcheck.studies.run.result import Stored
from springcheck.trajectory import Trajectory

UNITS = {
    "reduced": ("", "", "", ""),
    "md": (" (nm)", " (u nm/ps)", " (ps)", " (kJ/mol)"),
    "si": (" (m)", " (kg m/s)", " (s)", " (J)"),
}
CIRCUIT = (" (C)", " (Wb)", " (s)", " (J)")


ROOM = 5.0
"""What leaves the true motion by more than this factor leaves the picture: the others would be a line."""

ENERGY_ROOM = 1e3
"""The same for energies."""

FAR = 1e6
"""How many times the room outside a line is drawn to: far enough to leave the picture in its direction."""

DECADES = 100.0
"""Ratio of largest to smallest energy from which the scale is logarithmic."""


def draw(found: Stored, folder: Path) -> list[Path]:
    """Draw the trajectories of a store into a folder; returns the files."""
    shown = found.drawable
    return draw_runs(shown.scene, shown.runs, folder, followed=shown.followed)


def draw_runs(
    scene: Scene,
    runs: Mapping[str, Trajectory],
    folder: Path,
    *,
    followed: Mapping[str, Trajectory] | None = None,
) -> list[Path]:
    """Draw all figures of trajectories into a folder; returns the files (see `pictures`)."""
    if not any(len(run.t) > 1 for run in runs.values()):
        return []
    written = []
    with style():
        for name, picture in pictures(scene, runs, runs if followed is None else followed).items():
            written += save(picture, folder, name)
    return written


def pictures(
    scene: Scene, runs: Mapping[str, Trajectory], followed: Mapping[str, Trajectory]
) -> dict[str, Figure]:
    """The figures by name.  `followed`: the parts of the runs in which the motion itself is shown."""
    usable, parts = (
        _groups({label: run for label, run in found.items() if len(run.t) > 1}) for found in (runs, followed)
    )
    truth = true_motion(scene, _all(parts))
    return {
        "phase-portrait": _phase_portrait(scene, parts, truth),
        "position": _position(scene, parts, truth),
        "energy": _energy(scene, usable),
    }


Group = tuple[str, list[Trajectory]]

Motion = tuple[Floats, Floats, Floats]
"""t (f,) [T], q and p (f, n)."""


def _groups(runs: Mapping[str, Trajectory]) -> list[Group]:
    """Trajectories by scheme: runs of one scheme lie on one another, so they share a colour."""
    found: dict[str, list[Trajectory]] = {}
    for run in runs.values():
        found.setdefault(run.scheme, []).append(run)
    # what follows a colon tells how the scheme goes, too long for a legend
    return [(schemes.title(name).partition(":")[0], members) for name, members in found.items()]


def _all(groups: Sequence[Group]) -> list[Trajectory]:
    return [run for _, members in groups for run in members]


def _units(scene: Scene) -> tuple[str, str, str, str]:
    return CIRCUIT if scene.kind == "circuit" else UNITS[scene.units]


def true_motion(scene: Scene, runs: Sequence[Trajectory]) -> Motion | None:
    """A smooth true motion from the first frame of these runs to the last."""
    if not exact.has_true_motion(scene):
        return None
    times = [np.abs(run.t[[0, -1]]) for run in runs]
    first, last = (round(x / abs(scene.step)) for x in (np.min(times), np.max(times)))
    # some 1500 whole parts of steps, or whole steps
    finer = max(1, -(-1500 // max(1, last - first)))
    steps = np.unique(np.rint(np.linspace(first * finer, last * finer, 1501)).astype(np.int64))
    q, p = exact.true_motion(scene, steps, scene.step / finer)
    return steps * (scene.step / finer), np.asarray(q, np.float64), np.asarray(p, np.float64)


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


def _room(groups: Sequence[Group], pick: Any, truth: Floats | None) -> float:
    """The largest value that is worth showing; that of the middle one of the runs without a truth."""
    largest = [float(np.max(np.abs(pick(run)))) for run in _all(groups)]
    return ROOM * (float(np.median(largest)) if truth is None else float(np.max(np.abs(truth))))


def _within(x: Floats, room: float) -> Floats:
    """Values far outside of the picture brought nearer, for what draws them overflows."""
    return np.clip(x, -FAR * room, FAR * room) if room > 0 else x


def _nearer(q: Floats, p: Floats, q_room: float, p_room: float) -> tuple[Floats, Floats]:
    """The same for states: along the ray from the middle, so that lines leave the picture where they do.

    Two that lie so far outside are not joined (NaN between them): brought nearer, their line would cross the
    picture where that of the states does not.
    """
    if not (q_room > 0 and p_room > 0):
        return _within(q, q_room), _within(p, p_room)
    # in extended precision: 1e300 over a room of 1e-200 overflows
    x, y = (np.asarray(one, np.longdouble) / room for one, room in ((q, q_room), (p, p_room)))
    scale = np.maximum(1, np.maximum(np.abs(x), np.abs(y)) / FAR)
    far = scale > 1
    breaks = 1 + np.flatnonzero(far[1:] & far[:-1])
    near_q, near_p = (np.insert(np.asarray(one / scale, np.float64), breaks, np.nan) for one in (q, p))
    return near_q, near_p


def _title(axes: Axes, text: str) -> None:
    # the legend stands beside the axes, at the height of the title
    axes.set_title(textwrap.fill(text, 56))


def _fit(limits: Sequence[float] | Floats, room: float) -> tuple[float, float]:
    """Limits of an axis, those beyond the room drawn in."""
    low, high = map(float, limits)
    return (max(low, -room), min(high, room)) if room > 0 else (low, high)


def _overlay(axes: Axes, groups: Sequence[Group], pick: Any) -> None:
    for i, (title, members) in enumerate(groups):
        for j, run in enumerate(members):
            x, y = pick(run)
            if j == 0:
                _line(axes, x, y, i, title)
            _marks(axes, x, y, i, j, run.label)


def _phase_portrait(scene: Scene, groups: Sequence[Group], truth: Motion | None) -> Figure:
    q_unit, p_unit, _, _ = _units(scene)
    figure = Figure(figsize=(7.6, 5.2), layout="constrained")
    axes = figure.add_subplot()
    if truth is not None:
        axes.plot(
            truth[1][:, 0], truth[2][:, 0], color="#999999", linewidth=4, alpha=0.6, label="true motion"
        )
    q_room = _room(groups, lambda run: run.q[:, 0], None if truth is None else truth[1][:, 0])
    p_room = _room(groups, lambda run: run.p[:, 0], None if truth is None else truth[2][:, 0])
    _overlay(axes, groups, lambda run: _nearer(run.q[:, 0], run.p[:, 0], q_room, p_room))
    # of the data, not of the axes: equal scales widen limits that are free, and warn of those that are set
    axes.dataLim.intervalx = np.asarray(_fit(axes.dataLim.intervalx, q_room))
    axes.dataLim.intervaly = np.asarray(_fit(axes.dataLim.intervaly, p_room))
    axes.plot(*[[float(x[0])] for x in (scene.q, scene.p)], "k+", markersize=10, label="start")
    axes.set_xlabel(f"{_q(scene)}{q_unit}")
    axes.set_ylabel(f"{_p(scene)}{p_unit}")
    _title(axes, f"{scene.title}: phase portrait{_which(scene)}")
    if scene.units == "reduced":
        axes.set_aspect("equal", adjustable="datalim")
    _legend(figure, axes)
    return figure


def _position(scene: Scene, groups: Sequence[Group], truth: Motion | None) -> Figure:
    q_unit, _, t_unit, _ = _units(scene)
    figure = Figure(figsize=(7.6, 4.2), layout="constrained")
    axes = figure.add_subplot()
    if truth is not None:
        axes.plot(truth[0], truth[1][:, 0], color="#999999", linewidth=4, alpha=0.6, label="true motion")
    room = _room(groups, lambda run: run.q[:, 0], None if truth is None else truth[1][:, 0])
    _overlay(axes, groups, lambda run: (run.t, _within(run.q[:, 0], room)))
    axes.set_ylim(_fit(axes.get_ylim(), room))
    axes.ticklabel_format(axis="x", useOffset=False)
    axes.set_xlabel(f"time t{t_unit}")
    axes.set_ylabel(f"{_q(scene)}{q_unit}")
    _title(axes, f"{scene.title}: {_q(scene).split()[0]}{_which(scene)}")
    _legend(figure, axes)
    return figure


def _energy(scene: Scene, groups: Sequence[Group]) -> Figure:
    """Energy over time, and below it how far it is from that of the true motion on a logarithmic scale.

    Without friction that is the start's; where friction acts and no closed form is known, the start's too,
    and the axis says so.
    """
    _, _, t_unit, e_unit = _units(scene)
    figure = Figure(figsize=(7.6, 6.2), layout="constrained")
    upper, lower = figure.subplots(2, sharex=True)
    start = float(scene.system.energy(scene.q, scene.p))
    unit = abs(start) or 1.0

    damped = scene.system.is_damped
    truth = true_motion(scene, _all(groups)) if damped else None

    def energies(q: Reals, p: Reals) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(scene.system.energy(q, p), np.float64)

    def right(run: Trajectory) -> Floats | float:
        if truth is None:
            return start
        return energies(*exact.true_motion(scene, np.rint(run.t / run.step).astype(np.int64), run.step))

    look: dict[str, Any] = {"color": "#999999", "linewidth": 4, "alpha": 0.6, "label": "true motion"}
    if truth is not None:
        upper.plot(truth[0], energies(*truth[1:]) / unit, **look)
    elif not damped:
        upper.axhline(start / unit, **look)
    _overlay(upper, groups, lambda run: (run.t, _within(energies(run.q, run.p) / unit, ENERGY_ROOM)))
    # below one unit in the last place of the start there is nothing to see
    floor = 2.0**-53
    shown = np.concatenate([energies(run.q, run.p) / unit for run in _all(groups)])
    low, high = _fit(upper.get_ylim(), ENERGY_ROOM)
    if np.min(shown) > 0 and np.max(shown) > DECADES * np.min(shown):
        upper.set_yscale("log")
        low, high = _fit(upper.get_ylim(), ENERGY_ROOM)
        low = max(low, floor)
    upper.set_ylim(low, high)
    upper.set_ylabel("energy / energy of the start" if start else f"energy{e_unit}")
    _title(upper, f"{scene.title}: energy")

    def apart(run: Trajectory) -> Floats:
        # what differs by less than the floor stands on the lower edge
        off = np.abs(energies(run.q, run.p) - right(run)) / unit
        return _within(np.maximum(off, floor), ENERGY_ROOM)

    _overlay(lower, groups, lambda run: (run.t, apart(run)))
    lower.set_yscale("log")
    lower.set_ylim(_fit(lower.get_ylim(), ENERGY_ROOM))
    lower.set_xlabel(f"time t{t_unit}")
    known = "start" if truth is None else "true"
    lower.set_ylabel(f"|energy - {known}|" + (" / start" if start else e_unit))
    _legend(figure, upper)
    return figure


def _q(scene: Scene) -> str:
    return {"particles": "position q", "circuit": "charge q", "rotor": "angle q"}[scene.kind]


def _p(scene: Scene) -> str:
    return {"particles": "momentum p", "circuit": "flux p", "rotor": "angular momentum p"}[scene.kind]


def _which(scene: Scene) -> str:
    return f" (particle 0 of {scene.n})" if scene.n > 1 else ""
