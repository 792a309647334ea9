"""Runs laid over each other: a curve a motion, marks of its engines, and what explodes cut off.

Right engines of one scheme move alike and share a line; one that failed has its own, in red and on top.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from springcheck.figures import looks
from springcheck.figures.charts import EXACTLY, GUIDE, REJECTED, Chart, Curve, Naming, Scale
from springcheck.figures.views import units, with_unit
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

TRUTH = "exact solution"

EXPLODED, LARGE = 3.0, 6.0
"""How many times as far as the exact solution goes a run that grows may go and still set the scale of a
picture, and one that does not grow."""

GROWS = 1.3
"""Ratio of the second half's reach to the first half's from which a run grows."""

FAR_OFF = 1e6
"""Half widths of a picture that a line is drawn beyond it: far enough to leave it in its direction."""

ROUNDINGS = 1e-9
"""Relative difference of values below which a picture shows them as equal."""

MOST_LEAVING = 4
"""Schemes that are named where they leave a picture."""

MOST_NAMINGS, NAME_HIGH = 9, 0.052
"""Curves that are named where they stand, and the height of a name as a part of the picture's."""

NAME_AWAY, LETTER, NAME_PLACES = 0.03, 0.018, 60
"""Parts of a picture that its name is away from other curves, and that a letter is wide; points at which
there may be room for a name."""


@dataclass(frozen=True, slots=True)
class Group:
    """Runs of one scheme that lie on one another, so that they share a line; or one that failed."""

    scheme: str
    members: tuple[Trajectory, ...]
    failed: bool = False

    @property
    def title(self) -> str:
        """Title of its scheme, or label of the run that is wrong."""
        return self.members[0].label if self.failed else looks.title(self.scheme)


Pick = Callable[[Trajectory], tuple[Floats, Floats]]


class Runs:
    """Trajectories of a scene by their motions; those of a single frame are left out.

    `failed`: labels of the trajectories that some verdict rejects.
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
        self.groups = [Group(name, tuple(members)) for name, members in found.items()]
        # drawn last: on top of all that is right
        self.groups += [Group(run.scheme, (run,), failed=True) for run in wrong]
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

    @property
    def times(self) -> Frame:
        """The range of their times."""
        ends = [float(run.t[i]) for run in self.every for i in (0, -1)]
        return Frame(min(ends), max(ends))

    def time(self, span: Frame | None = None) -> Scale:
        """An axis of time in a readable unit; left out: of all of it."""
        factor, unit = self.time_unit
        return Scale(name=with_unit("time t", unit), factor=factor, shown=(span or self.times).ends)

    @property
    def wrong(self) -> str:
        """Which of them are wrong, to begin a title with; "" where none is."""
        names = [group.title for group in self.groups if group.failed]
        if not names:
            return ""
        more = f" and {len(names) - 2} more" if len(names) > 2 else ""
        return f"{', '.join(names[:2])}{more} {'is' if len(names) == 1 else 'are'} wrong (red); "

    def curves(
        self,
        pick: Pick,
        *,
        dots: bool = False,
        faint: bool = False,
        timed: bool = False,
        groups: Sequence[Group] | None = None,
        alike: bool = True,
    ) -> list[Curve]:
        """A curve of each run, the first of each motion as a line or `dots`.

        `faint`: lines between the dots that are seen to be none of the motion; `timed`: the time of each
        point is said; `alike`: whether runs of one scheme are one motion.
        """
        found = []
        for group in self.groups if groups is None else groups:
            for j, run in enumerate(group.members):
                x, y = pick(run)
                found.append(
                    Curve(
                        name=run.label,
                        group=REJECTED if group.failed else group.scheme,
                        title=("is not " if group.failed else "") + looks.title(group.scheme),
                        x=x,
                        y=y,
                        line=not dots or faint,
                        dots=dots,
                        marks=True,
                        over=alike and j > 0,
                        notes=[f"t {t!r}" for t in run.t[: len(x)].tolist()] if timed else (),
                    )
                )
        return found

    def first(self, curves: Sequence[Curve]) -> Iterable[tuple[str, Curve]]:
        """The title and the first curve of each motion."""
        titles = {run.label: group.title for group in self.groups for run in group.members}
        known = [curve for curve in curves[::-1] if curve.name in titles and not curve.over]
        found = {(titles[curve.name], curve.group): curve for curve in known}
        return [(title, curve) for (title, _), curve in reversed(found.items())]

    def leaving(self, when: Callable[[Trajectory], int | None]) -> str:
        """Which schemes leave a picture for good, and when: at which frame, None where never."""
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
        return "outside: " + ", ".join(said) if said else ""


def exact_curve(x: Floats, y: Floats) -> Curve:
    """The exact solution."""
    return Curve(name=TRUTH, group=EXACTLY, x=x, y=y, title=TRUTH)


@dataclass(frozen=True, slots=True)
class Frame:
    """The part of an axis that a picture shows."""

    low: float
    high: float
    clipped: bool = False
    """Whether some run goes far beyond."""
    log: bool = False
    """Whether decades are of one length."""

    @property
    def centre(self) -> float:
        """Its middle."""
        return self.low / 2 + self.high / 2

    @property
    def half(self) -> float:
        """Half-width."""
        return self.high / 2 - self.low / 2

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end."""
        return self.low, self.high

    def axis(self, name: str, unit: str) -> Scale:
        """Scale of this axis, in a readable unit."""
        factor, readable = looks.prefixed(max(abs(self.low), abs(self.high)), unit)
        return Scale(name=with_unit(name, readable), log=self.log, shown=self.ends, factor=factor)

    @property
    def far(self) -> tuple[float, float]:
        """Ends as far off as lines are drawn."""
        return self.centre - FAR_OFF * self.half, self.centre + FAR_OFF * self.half

    def parts(self, values: Sequence[float] | Floats) -> Floats:
        """Values as parts of the axis: 0 to 1 inside."""
        x, low, high = np.asarray(values, np.float64), self.low, self.high
        with np.errstate(all="ignore"):
            if self.log:
                x, low, high = np.log(x), np.log(low), np.log(high)
            return np.asarray((x - low) / (high - low))

    def leaves(self, values: Floats) -> int | None:
        """The first of the values outside, None where all are inside or nothing was left out."""
        if not self.clipped:
            return None
        outside = (values < self.low) | (values > self.high)
        return int(np.argmax(outside)) if outside.any() else None

    def within(self, values: Floats) -> Floats:
        """Values up to the first one outside, which is brought nearer: far away, drawing it overflows."""
        end = self.leaves(values)
        values = values if end is None else values[: end + 1]
        return np.clip(values, *self.far)


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


def at_ends(
    named: Iterable[tuple[str, Curve]], xs: Frame, ys: Frame, *, height: float = NAME_HIGH
) -> list[Naming]:
    """Names at the ends of curves over time, beside the picture; of a curve that leaves it, where it leaves.

    They are moved apart as far as a line of text is high.
    """
    ends: list[tuple[float, str, str]] = []
    out: list[Naming] = []
    for text, curve in named:
        u, v = xs.parts(curve.x), ys.parts(curve.y)
        inside = np.flatnonzero((u >= -0.01) & (u <= 1.01) & (v >= -0.01) & (v <= 1.01))
        if not len(inside):
            continue
        last = int(inside[-1])
        if u[last] > 0.9:
            ends.append((float(v[last]), text, curve.group))
        elif not any(
            abs(v[last] - one.y) < height and abs(u[last] - one.x) < LETTER * len(text) for one in out
        ):
            out.append(
                Naming(text=text, group=curve.group, x=float(u[last]) + 0.01, y=min(0.9, float(v[last])))
            )
    ends.sort()
    most = min(MOST_NAMINGS, int(1 / height))
    if len(ends) > most:
        # what is wrong, and the outermost
        inner = [one for one in ends[most // 3 : -(most // 3)] if one[2] != REJECTED]
        ends = [one for one in ends if one not in inner][:most]
    places = [y for y, *_ in ends]
    for _ in range(200):
        for i in range(len(places) - 1):
            short = height - (places[i + 1] - places[i])
            if short > 0:
                places[i] -= short / 2
                places[i + 1] += short / 2
        places = [min(max(y, height * i), 1 - height * (len(places) - 1 - i)) for i, y in enumerate(places)]
    beside = [
        Naming(text=text, group=group, x=1.0, y=y) for y, (_, text, group) in zip(places, ends, strict=True)
    ]
    return [*out[:MOST_NAMINGS], *beside]


def alone(named: Iterable[tuple[str, Curve]], xs: Frame, ys: Frame) -> list[Naming]:
    """Names of the curves that stand apart somewhere, each where it is farthest from all others."""
    points: dict[tuple[str, str], Floats] = {}
    for text, curve in named:
        u, v = xs.parts(curve.x), ys.parts(curve.y)
        inside = (u > 0.02) & (u < 0.98) & (v > 0.03) & (v < 0.95)
        points[text, curve.group] = np.stack([u[inside], v[inside]], axis=1)
    out: list[Naming] = []
    for (text, group), mine in sorted(points.items(), key=lambda x: x[0][1] != REJECTED):
        others = np.concatenate([np.empty((0, 2)), *(x for key, x in points.items() if key != (text, group))])
        best, found = NAME_AWAY, None
        for x, y in mine[:: max(1, len(mine) // NAME_PLACES)].tolist():
            # where its words stand
            at = np.array(
                [[x + s * 0.2 * LETTER * len(text) * (1 if x < 0.6 else -1), y + 0.02] for s in range(6)]
            )
            room = [float(np.min(np.hypot(*(others - place).T), initial=1.0)) for place in at]
            taken = any(abs(y - one.y) < NAME_HIGH and abs(x - one.x) < LETTER * len(text) for one in out)
            if not taken and min(room) > best:
                best, found = min(room), (x, y)
        if found is not None and len(out) < MOST_NAMINGS:
            out.append(Naming(text=text, group=group, x=found[0], y=found[1]))
    return out


def labelled(chart: Chart) -> Chart:
    """A chart with the names of its schemes' curves where they stand apart."""
    firsts: dict[str, Curve] = {}
    for curve in chart.curves:
        if (curve.line or curve.dots) and curve.group not in (EXACTLY, GUIDE) and len(curve.x):
            firsts.setdefault(curve.group, curve)
    sides = []
    for scale, which in ((chart.x, "x"), (chart.y, "y")):
        every = np.concatenate([np.asarray(getattr(one, which), np.float64) for one in chart.curves])
        every = every[np.isfinite(every) & ((every > 0) | (not scale.log))]
        ends = scale.shown or (float(np.min(every)), float(np.max(every)))
        sides.append(Frame(*ends, log=scale.log))
    named = [(looks.title(group), curve) for group, curve in firsts.items()]
    return replace(chart, labels=alone(named, *sides))


def share(x: float) -> str:
    """A part of a whole as it is read: in percent, or as a power of ten."""
    return (
        f"{100 * x:.2g} %" if 5e-4 <= x < 0.995 else f"{100 * x:.0f} %" if 0.995 <= x < 1000 else f"{x:.0e}"
    )
