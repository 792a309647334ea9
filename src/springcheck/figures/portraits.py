"""Phase portraits, and positions over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from springcheck.figures import looks, overlay
from springcheck.figures.motion import Motion, periods, smooth
from springcheck.figures.overlay import TRUTH, Frame, Runs
from springcheck.figures.views import State, View, with_unit
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

EQUAL = 2.5
"""Ratio of two ranges up to which equal scales on both axes help."""

PERIODS, SHOWN = 14, 6
"""Periods from which the first and the last ones are shown separately, and how many of each."""

FRAMES = 7
"""Frames of a period below which lines between them are chords: they are drawn as dots."""

STEEP, START = 30.0, 8.0
"""How many times its median a motion that runs away reaches; of its start, what is shown of it."""

SEPARATRIX = Line2D([], [], color="#666666", linewidth=0.9, linestyle=(0, (2, 2)), label="separatrix")
_BEGIN = Line2D([], [], color="k", linestyle="none", marker="+", markersize=9, label="start")


def phase_portraits(
    runs: Runs, shown: Sequence[View], truth: Motion | None, *, what: str = "phase portrait"
) -> Figure:
    """Momentum over position, or what else a view shows: a panel for each."""
    width, height = ((7.8, 0), (5.2, 0)) if len(shown) == 1 else ((4.9, 0), (3.4, 0.4))
    figure, grid, _ = overlay.panels(len(shown), 2, width, height)
    crossed = []
    for axes, view in zip(grid, shown, strict=True):
        crossed.append(_phase_portrait(axes, runs, view, truth))
        if len(shown) > 1:
            axes.set_title(view.title, fontsize=9, loc="left")
        if view.what == "path":
            axes.set_aspect("equal", adjustable="box")
        elif len(shown) == 1 and runs.scene.units == "reduced" and not view.turn:
            _equal(axes)
    overlay.heading(figure, _title(runs.scene, what, shown))
    runs.legend(figure, *([SEPARATRIX] if any(crossed) else []), _BEGIN, truth=truth is not None)
    return figure


def _title(scene: Scene, what: str, shown: Sequence[View]) -> str:
    if len(shown) > 1 or not shown[0].title:
        return f"{scene.title}: {what}"
    of = f" of {scene.n}" if shown[0].title.startswith("particle") else ""
    return f"{scene.title}: {what} of {shown[0].title}{of}"


def _equal(axes: Axes) -> None:
    width, height = (abs(b - a) for a, b in (axes.get_xlim(), axes.get_ylim()))
    if max(width, height) <= EQUAL * min(width, height):
        axes.set_aspect("equal", adjustable="box")


def _phase_portrait(axes: Axes, runs: Runs, view: View, truth: Motion | None) -> bool:
    """One panel; returns whether it shows a separatrix."""
    true = None if truth is None else view.pick(truth[1], truth[2])
    picked = {run.label: view.pick(run.q, run.p) for run in runs.every}
    xs, ys = _frames(list(picked.values()), true, view)
    dx, x_unit = looks.prefixed(max(abs(xs.low), abs(xs.high)), view.x_unit)
    dy, y_unit = looks.prefixed(max(abs(ys.low), abs(ys.high)), view.y_unit)

    def near(x: Floats, y: Floats) -> State:
        x, y = view.wrapped(*overlay.nearer(x, y, xs, ys))
        return dx * x, dy * y

    curves = [(x, y) for x, y in view.separatrices(xs.low, xs.high) if _meets(x, y, xs, ys)]
    for x, y in curves:
        for sign in (1, -1):
            axes.plot(
                dx * x, sign * dy * y, color="#666666", linewidth=0.9, linestyle=(0, (2, 2)), zorder=1.5,
                label="separatrix",
            )  # fmt: skip
    if true is not None:
        axes.plot(*near(*true), **TRUTH)
    runs.draw(axes, lambda run: near(*picked[run.label]), joined=_joined(runs, true))
    axes.plot(*near(*view.pick(runs.scene.q[None], runs.scene.p[None])), "k+", markersize=10, zorder=4)
    axes.set_xlim(dx * xs.low, dx * xs.high)
    axes.set_ylim(dy * ys.low, dy * ys.high)
    if view.turn:
        axes.set_xticks([-1, -0.5, 0, 0.5, 1])
    axes.set_xlabel(with_unit(view.x_name, x_unit))
    axes.set_ylabel(with_unit(view.y_name, y_unit))

    def when(run: Trajectory) -> int | None:
        x, y = picked[run.label]
        return min((i for i in (xs.leaves(x), ys.leaves(y)) if i is not None), default=None)

    # where the motion itself runs away all of them leave
    if _steep(picked, true) is None:
        runs.note(axes, when)
    return bool(curves)


def _frames(picked: Sequence[State], true: State | None, view: View) -> tuple[Frame, Frame]:
    """What a phase portrait shows: a run that goes far in one direction sets the scale of neither."""
    steep = _steep({str(i): one for i, one in enumerate(picked)}, true)
    if steep is not None:
        return steep
    sizes = [overlay.frame([one[j] for one in picked], None if true is None else true[j]) for j in (0, 1)]
    near = [one for one in picked if all(its.leaves(one[j]) is None for j, its in enumerate(sizes))]
    x, y = (
        overlay.frame([one[j] for one in near or picked], None if true is None else true[j]) for j in (0, 1)
    )
    clipped = len(near) < len(picked)
    if view.turn:
        # the whole turn, and all of the separatrix
        top = 1.1 * max(float(np.nanmax(y)) for _, y in view.separatrices(-1, 1))
        x, y = Frame(-view.turn / 2, view.turn / 2), Frame(min(y.low, -top), max(y.high, top))
        # round and round is not away
        return x, Frame(y.low, y.high, clipped)
    return Frame(x.low, x.high, clipped), Frame(y.low, y.high, clipped)


def _meets(x: Floats, y: Floats, xs: Frame, ys: Frame) -> bool:
    """Whether a curve y(x), or its mirror, runs through the picture."""
    inside = (x >= xs.low) & (x <= xs.high) & np.isfinite(y)
    return bool(np.any(inside & ((y <= ys.high) | (-y >= ys.low))))


def _steep(picked: Mapping[str, State], true: State | None) -> tuple[Frame, Frame] | None:
    """What is shown of a motion that runs away: its beginning.  None where it does not."""
    x, y = true if true is not None else next(iter(picked.values()))
    size = np.abs(x)
    start, end = float(size[0]), float(np.max(size))
    if not (end > STEEP * max(float(np.median(size)), start) and end == float(size[-1]) and start > 0):
        return None
    last = int(np.argmax(size > START * start))
    return tuple(_beginning(one[: last + 1]) for one in (x, y))  # type: ignore[return-value]


def _beginning(x: Floats) -> Frame:
    """From a little behind 0 to the last value."""
    edges = float(x[-1]), -0.25 * float(x[-1])
    return Frame(min(edges), max(edges), True)


def _joined(runs: Runs, true: State | None) -> bool:
    """Whether frames stand so close that a line between them follows the motion."""
    if true is None:
        return True
    return len(runs.longest.t) >= FRAMES * periods(true[0])


def positions(runs: Runs, shown: Sequence[View], truth: Motion | None) -> Figure:
    """Positions over time: a row for each view; of many periods the first and the last."""
    rows = len(shown)
    spans = _spans(runs, shown, truth)
    size = (8.2 if len(spans) == 1 else 10.6, 4.2 if rows == 1 else 1.75 * rows + 1)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, len(spans), squeeze=False, sharex="col", sharey="row")
    _, unit = runs.time_unit
    for row, view in zip(grid, shown, strict=True):
        for axes, span in zip(row, spans, strict=True):
            unit_x = _position(axes, runs, view, truth, span)
        row[0].set_ylabel(with_unit(view.x_name, unit_x))
        if rows > 1:
            row[0].set_title(view.title, fontsize=9, loc="left")
    for axes in grid[-1]:
        axes.set_xlabel(with_unit("time t", unit))
    parts = "" if len(spans) == 1 else f" (the first and the last {SHOWN} periods)"
    overlay.heading(figure, _title(runs.scene, shown[0].what, shown) + parts, 66 if len(spans) == 1 else 90)
    runs.legend(figure, truth=truth is not None)
    return figure


def _spans(runs: Runs, shown: Sequence[View], truth: Motion | None) -> list[tuple[float, float]]:
    """The times that are shown: all, or the first and the last periods of many."""
    first, last = (float(f([f(np.abs(run.t)) for run in runs.every])) for f in (np.min, np.max))
    if truth is None:
        return [(first, last)]
    count = max(periods(view.pick(truth[1], truth[2])[0]) for view in shown)
    if count <= PERIODS:
        return [(first, last)]
    length = SHOWN * (last - first) / count
    return [(first, first + length), (last - length, last)]


def _position(axes: Axes, runs: Runs, view: View, truth: Motion | None, span: tuple[float, float]) -> str:
    """One panel; returns the unit of its axis."""
    true = None if truth is None else view.pick(truth[1], truth[2])
    states = {run.label: view.pick(run.q, run.p) for run in runs.every}
    picked = {label: x for label, (x, _) in states.items()}
    steep = _steep(states, true) is not None
    ys = overlay.frame(list(picked.values()), None if true is None else true[0])
    dt, _ = runs.time_unit
    dy, unit = looks.prefixed(max(abs(ys.low), abs(ys.high)), view.x_unit)

    def cut(run: Trajectory) -> State:
        here = (np.abs(run.t) >= span[0]) & (np.abs(run.t) <= span[1])
        return dt * run.t[here], dy * ys.within(picked[run.label])[here]

    # a part of many periods needs a finer line than all of them
    fine = smooth(runs.scene, *span)
    if fine is not None:
        axes.plot(dt * fine[0], dy * ys.within(view.pick(fine[1], fine[2])[0]), **TRUTH)
    runs.draw(axes, cut, joined=_joined(runs, true), faint=True)
    axes.set_ylim(dy * ys.low, dy * ys.high)
    if steep:
        _logarithmic(axes, dy, [*picked.values(), *([] if true is None else [true[0]])], ys)
    axes.ticklabel_format(axis="x", useOffset=False)
    if span[0] == 0:
        runs.note(axes, lambda run: ys.leaves(picked[run.label]))
    return unit


def _logarithmic(axes: Axes, dy: float, found: Sequence[Floats], ys: Frame) -> None:
    """The scale of a motion that runs away."""
    inside = [x for x in found if ys.leaves(x) is None]
    least = min(float(np.min(np.abs(x))) for x in inside)
    if all(np.min(x) > 0 for x in inside):
        axes.set_yscale("log")
        axes.set_ylim(dy * least / 2, 2 * dy * ys.high)
    else:
        axes.set_yscale("symlog", linthresh=dy * float(np.abs(inside[0][0])) or 1.0)
