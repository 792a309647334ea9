"""Runs laid over each other: a line a motion, marks of its engines, one legend, what explodes clipped.

Right engines of one scheme move alike and share a line; one that failed has its own, in red and on top.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from springcheck.figures import looks
from springcheck.figures.views import units
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

TRUTH: dict[str, Any] = {
    "color": "#b3b3b3",
    "linewidth": 4.0,
    "alpha": 0.7,
    "label": "exact solution",
    "zorder": 1,
}

EXPLODED, LARGE = 3.0, 6.0
"""How many times as far as the exact solution goes a run that grows may go and still set the scale of a
picture, and one that does not grow."""

GROWS = 1.3
"""Ratio of the second half's reach to the first half's from which a run grows."""

FAR_OFF = 1e6
"""Half widths of a picture that a line is drawn beyond it: far enough to leave it in its direction."""

ROUNDINGS = 1e-9
"""Relative difference of values below which a picture shows them as equal."""

MOST_MARKS, MARKS, FEWEST_MARKS = 11, 66, 4
"""Of a run, on a picture, and of each run however many there are."""

GOLDEN = 0.618
"""Multiples of it, modulo 1, stand far from one another, however many: there runs have their marks."""

MOST_LEAVING = 4
"""Schemes that are named where they leave a picture."""


@dataclass(frozen=True, slots=True)
class Group:
    """Runs of one scheme that lie on one another, so that they share a line; or one that failed."""

    scheme: str
    members: tuple[Trajectory, ...]
    look: looks.Look
    failed: bool = False

    @property
    def title(self) -> str:
        """Of its scheme, or of the run that is wrong."""
        return f"FAILED: {self.members[0].label}" if self.failed else looks.title(self.scheme)

    @property
    def legend(self) -> str:
        """Its title, and whose marks are on its line."""
        if self.failed:
            mark = looks.mark(looks.engine(self.members[0].label))[1]
            return f"{self.title}\n{mark} {textwrap.fill('is not ' + looks.title(self.scheme), 30)}"
        return f"{self.title}\n{looks.members([run.label for run in self.members])}"


Pick = Callable[[Trajectory], tuple[Floats, Floats]]


class Runs:
    """Trajectories of a scene by their motions; what has but its start is left out.

    `failed`: labels of those that some verdict rejects.
    """

    def __init__(self, scene: Scene, runs: Mapping[str, Trajectory], failed: Collection[str] = ()) -> None:
        self.scene = scene
        found: dict[str, list[Trajectory]] = {}
        wrong: list[Trajectory] = []
        for label, run in runs.items():
            if len(run.t) > 1 and label in failed:
                wrong.append(run)
            elif len(run.t) > 1:
                found.setdefault(run.scheme, []).append(run)
        self.groups = [Group(name, tuple(members), looks.look(name)) for name, members in found.items()]
        # drawn last: on top of all that is right
        self.groups += [
            Group(run.scheme, (run,), looks.failed(j), failed=True) for j, run in enumerate(wrong)
        ]
        self.every = [run for group in self.groups for run in group.members]

    @property
    def longest(self) -> Trajectory:
        """The one with the most frames."""
        return max(self.every, key=lambda run: len(run.t))

    @property
    def time_unit(self) -> tuple[float, str]:
        """Factor and unit of a readable axis of time."""
        last = max(abs(float(run.t[-1])) for run in self.every)
        return looks.prefixed(last, units(self.scene).t)

    def draw(self, axes: Axes, pick: Pick, *, joined: bool = True, faint: bool = False) -> None:
        """The first run of each motion as a line (`joined`) or dots, and marks of every engine.

        `faint`: lines between the dots that are seen to be none of the motion.
        """
        drawn, most = 0, min(MOST_MARKS, max(FEWEST_MARKS, MARKS // len(self.every)))
        for group in self.groups:
            color, high = group.look.color, int(group.failed)
            for j, run in enumerate(group.members):
                x, y = pick(run)
                line: dict[str, Any] = {"color": color, "label": group.title, "zorder": 2 + 1.2 * high}
                if j == 0 and joined:
                    axes.plot(x, y, linestyle=group.look.linestyle, linewidth=1.3 + 0.7 * high, **line)
                elif j == 0:
                    axes.plot(x, y, ".", markersize=3 + 2 * high, **line)
                    if faint:
                        axes.plot(x, y, color=color, linewidth=0.7, alpha=0.4, zorder=1.5)
                _marks(axes, x, y, group, drawn * GOLDEN % 1, run.label, most)
                drawn += 1

    def note(self, axes: Axes, when: Callable[[Trajectory], int | None]) -> None:
        """Say above a picture which schemes leave it for good, and when: at which frame, None where never."""
        factor, unit = self.time_unit
        firsts = {group.title: group.members[0] for group in self.groups}
        frames = {name: when(run) for name, run in firsts.items()}
        said = [
            f"{name} at {factor * abs(float(firsts[name].t[i])):.3g} {unit}".rstrip()
            for name, i in frames.items()
            if i is not None
        ]
        if len(said) > MOST_LEAVING:
            said = [*said[: MOST_LEAVING - 1], f"{len(said) - MOST_LEAVING + 1} more"]
        if said:
            text = "outside: " + ", ".join(said)
            axes.set_title(textwrap.fill(text, 76), loc="right", fontsize=7.5, color="#555555")

    def legend(self, figure: Figure, *extra: Line2D, truth: bool = False) -> None:
        """One entry for each scheme, with the marks of its engines; first the `truth`, and `extra` lines."""
        first = [Line2D([], [], **{name: TRUTH[name] for name in ("color", "linewidth", "label")})]
        entries = [(group.look, group.legend) for group in self.groups]
        # what is wrong comes first
        entries.sort(key=lambda entry: not entry[1].startswith("FAILED"))
        _legend(figure, entries, *(first if truth else []), *extra)


def _marks(axes: Axes, x: Floats, y: Floats, group: Group, share: float, label: str, most: int) -> None:
    """Marks of an engine, at the `most`; each run's a share of their distance behind those of the first."""
    apart = max(1, len(x) // most)
    first = round(share * apart) % apart
    axes.plot(
        x[first::apart],
        y[first::apart],
        linestyle="none",
        marker=looks.mark(looks.engine(label))[0],
        markersize=4.2,
        markerfacecolor="white",
        markeredgecolor=group.look.color,
        markeredgewidth=0.9,
        label=label,
        zorder=3 + group.failed,
    )


def scheme_legend(figure: Figure, methods: Mapping[str, Sequence[str]], *extra: Line2D) -> None:
    """One entry for each scheme, with the marks of the engines of its methods; `extra` lines first."""
    entries = [
        (looks.look(scheme), f"{looks.title(scheme)}\n{looks.members(labels)}")
        for scheme, labels in methods.items()
    ]
    _legend(figure, entries, *extra)


def _legend(figure: Figure, entries: Sequence[tuple[looks.Look, str]], *extra: Line2D) -> None:
    lines = [Line2D([], [], color=x.color, linestyle=x.linestyle, label=label) for x, label in entries]
    figure.legend(
        handles=[*extra, *lines], loc="outside right upper", frameon=False, labelspacing=0.7, handlelength=2.6
    )


@dataclass(frozen=True, slots=True)
class Frame:
    """The part of an axis that a picture shows."""

    low: float
    high: float
    clipped: bool = False
    """Whether some run goes far beyond."""

    @property
    def centre(self) -> float:
        """Its middle."""
        return self.low / 2 + self.high / 2

    @property
    def half(self) -> float:
        """From its middle to its edge."""
        return self.high / 2 - self.low / 2

    def leaves(self, values: Floats) -> int | None:
        """The first of the values outside, None where all are inside or nothing was left out."""
        if not self.clipped:
            return None
        outside = (values < self.low) | (values > self.high)
        return int(np.argmax(outside)) if outside.any() else None

    def within(self, values: Floats) -> Floats:
        """Values up to the first one outside, which is brought nearer: far away, drawing it overflows."""
        end = self.leaves(values)
        near = np.clip(values, self.centre - FAR_OFF * self.half, self.centre + FAR_OFF * self.half)
        return near if end is None else np.where(np.arange(len(near)) <= end, near, np.nan)


def frame(runs: Sequence[Floats], truth: Floats | None, *, far: float | None = None) -> Frame:
    """What to show: the exact solution and every run that does not go far beyond it.

    Without an exact solution far is measured by the middle one of the runs.  `far`: how far beyond the exact
    solution any run may go.
    """
    spans = [(float(np.min(x)), float(np.max(x))) for x in runs]
    if truth is not None and np.isfinite(truth).all():
        low, high = float(np.min(truth)), float(np.max(truth))
    else:
        low, high = sorted(spans, key=lambda x: x[1] - x[0])[(len(spans) - 1) // 2]
    centre, half = low / 2 + high / 2, high / 2 - low / 2
    if half == 0:
        half = abs(centre) or 1e-300
    near = [
        (a, b)
        for x, (a, b) in zip(runs, spans, strict=True)
        if max(b - centre, centre - a) <= half * (far or (EXPLODED if _grows(x - centre) else LARGE))
    ]
    low, high = min([low, *(a for a, _ in near)]), max([high, *(b for _, b in near)])
    clipped = len(near) < len(spans)
    return widened(low, high, 0.2 if clipped else 0.06, clipped=clipped)


def widened(low: float, high: float, margin: float = 0.06, *, clipped: bool = False) -> Frame:
    """A frame around values, some room about them; what differs by roundings alone is one value."""
    size = max(abs(low), abs(high))
    edge = margin * (high - low) if high - low > ROUNDINGS * size else 0.1 * size or 1.0
    return Frame(low - edge, high + edge, clipped)


def _grows(x: Floats) -> bool:
    """Whether a run reaches further in its second half than in its first one."""
    with np.errstate(over="ignore"):
        size = np.abs(x)
    middle = (len(x) + 1) // 2
    return bool(np.max(size[middle:], initial=0) > GROWS * np.max(size[:middle]))


def nearer(x: Floats, y: Floats, a: Frame, b: Frame) -> tuple[Floats, Floats]:
    """States up to the first one outside, brought nearer along the ray from the middle if it is far away."""
    ends = [i for i in (a.leaves(x), b.leaves(y)) if i is not None]
    if not ends:
        return x, y
    x, y = x[: min(ends) + 1], y[: min(ends) + 1]
    # in extended precision: 1e300 over a half width of 1e-200 overflows
    u, v = (
        (np.asarray(one, np.longdouble) - its.centre) / its.half for one, its in ((x, a), (y, b))
    )  # fmt: skip
    scale = np.maximum(1, np.maximum(np.abs(u), np.abs(v)) / FAR_OFF)
    return tuple(np.asarray(w / scale * its.half + its.centre, np.float64) for w, its in ((u, a), (v, b)))  # type: ignore[return-value]


def heading(figure: Figure, text: str, width: int = 66) -> None:
    """A title over all axes of a figure, broken where the legend begins."""
    figure.suptitle(textwrap.fill(text, width), x=0.02, ha="left", fontsize=10)


def panels(
    count: int, most: int, width: tuple[float, float], height: tuple[float, float], *, shared: str = ""
) -> tuple[Figure, list[Axes], int]:
    """A figure of so many panels, and how many of them stand beside each other, at the `most`.

    `width` and `height` of a panel, and of what the figure has besides [in]; `shared`: of x, y or both.
    """
    columns = min(most, count)
    rows = -(-count // columns)
    size = width[0] * columns + width[1], height[0] * rows + height[1]
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex="x" in shared, sharey="y" in shared).ravel()
    for axes in grid[count:]:
        axes.set_axis_off()
    return figure, list(grid[:count]), columns
