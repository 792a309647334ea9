"""Phase portraits, and positions over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from springcheck.figures import frames, looks, naming
from springcheck.figures.charts import BEGIN, SEPARATRIX, Bank, Chart, Curve, Scale
from springcheck.figures.frames import Frame
from springcheck.figures.motion import Exact, Motion, periods, smooth
from springcheck.figures.overlay import Runs, exact_curve, share
from springcheck.figures.views import State, View, with_unit
from springcheck.physics.arrays import Floats
from springcheck.physics.trajectory import Trajectory

ALIKE = 2.5
"""Ratio of two ranges up to which equal scales on both axes are useful."""

MANY_PERIODS, PERIODS_SHOWN = 14, 6
"""Periods from which the first and the last ones are shown separately, and how many of each."""

CHORD = 0.015
"""Fraction of the axes by which lines between frames may miss the exact solution: beyond, frames are dots."""

JUMP, MANY_POINTS = 0.3, 1000
"""Distance of two points, in half axes, that is a jump in a curve of so many points."""

STEEP, START_SHOWN = 30.0, 3.0
"""Reach, in medians, from which on a motion runs away; and what is shown of it, in reaches of its start."""

MOST_CLOUDS = 12
"""Most schemes in a bath that have a panel of their own."""


def phase_portraits(runs: Runs, shown: Sequence[View], truth: Motion | None, said: str = "") -> Bank:
    """Momentum over position, or what else a view shows: a chart for each; `said` is the finding."""
    charts = [_portrait(runs, view, truth, alone=len(shown) == 1) for view in shown]
    what = "path" if shown[0].what == "path" else "phase portrait"
    planes = len(charts) == 3 and all(chart.equal for chart in charts)
    size = (4.0, 3.6) if planes else _size(charts, *((5.6, 5.2) if len(charts) == 1 else (4.9, 3.4)))
    said = _heading(f"{what}{_of(runs, shown)}{runs.part}", said)
    return runs.bank(what.replace(" ", "-"), charts, said, size, columns=3 if planes else min(2, len(charts)))


def _size(charts: Sequence[Chart], wide: float, most: float) -> tuple[float, float]:
    """Width and height of a panel [in]; with equal scales, no higher than the highest motion."""
    spans = [(np.ptp(one.x.shown), np.ptp(one.y.shown)) for one in charts if one.x.shown and one.y.shown]
    high = max((float(y / x) for x, y in spans), default=1.0)
    return wide, min(most, wide * high + 0.8) if all(one.equal for one in charts) else most


def _heading(what: str, said: str) -> str:
    """The finding, and in brackets what is drawn."""
    return f"{said} ({what})" if said else what


def _of(runs: Runs, shown: Sequence[View]) -> str:
    title = shown[0].title if len(shown) == 1 else ""
    if shown[0].what == "path" and runs.scene.particles > 1:
        title = "particle 0"
    particle, comma, axis = title.partition(",")
    of = f" of {runs.scene.particles}" if title.startswith("particle") else ""
    return f" of {particle}{of}{comma}{axis}" if title else ""


def _portrait(runs: Runs, view: View, truth: Motion | None, *, alone: bool) -> Chart:
    true = None if truth is None else view.pick(truth[1], truth[2])
    picked = {run.label: view.pick(run.q, run.p) for run in runs.every}
    xs, ys = _frames(list(picked.values()), true, view)

    def near(x: Floats, y: Floats) -> State:
        return view.wrapped(*frames.nearer(x, y, xs, ys))

    def when(run: Trajectory) -> int | None:
        x, y = picked[run.label]
        return min((i for i in (xs.leaves(x), ys.leaves(y)) if i is not None), default=None)

    parting = [(x, y) for x, y in view.separatrices(xs.low, xs.high) if _meets(x, y, xs, ys)]
    lines = [
        Curve(name=SEPARATRIX, group=SEPARATRIX, x=x, y=sign * y) for x, y in parting for sign in (1.0, -1.0)
    ]
    if true is not None:
        sparse = _sparse(truth, view, xs, ys)
        lines.append(replace(exact_curve(*_parted(*near(*true), xs, ys)), line=not sparse, dots=sparse))
    dots = _chords(runs.longest, truth, view, xs, ys)
    curves = runs.curves(lambda run: near(*picked[run.label]), dots=dots, timed=not view.turn)
    start = view.pick(runs.scene.q[None], runs.scene.p[None])
    begin = Curve(name="start", group=BEGIN, x=start[0], y=start[1], line=False, marks=True)
    sizes = xs.half, ys.half
    square = view.what in ("path", "mode") or (alone and runs.scene.units == "reduced" and not view.turn)
    # where the motion itself runs away all of them leave
    note = runs.leaving(when) if _steep(picked[runs.every[0].label] if true is None else true) is None else ""
    of = f" of {view.title}" if view.title and view.what != "path" else ""
    return Chart(
        title=f"{view.y_name} over {view.x_name}{of}.".capitalize(),
        short="" if alone else view.title,
        x=xs.axis(view.x_name, view.x_unit),
        y=ys.axis(view.y_name, view.y_unit),
        curves=[*lines, *curves, begin],
        equal=square and (view.what == "path" or max(sizes) <= ALIKE * min(sizes)),
        note=note,
    )


def clouds(runs: Runs, view: View) -> Bank:
    """States in a bath: a panel for each scheme."""
    groups = runs.groups[:MOST_CLOUDS]
    picked = {run.label: view.pick(run.q, run.p) for run in runs.every}
    # one that diverges sets the scale of none
    sizes = sorted(max(float(np.max(np.abs(a))) for a in one) for one in picked.values())
    usual = [one for one in picked.values() if np.max(np.abs(one[0])) <= 100 * (sizes[len(sizes) // 2] or 1)]
    xs, ys = (
        frames.widened(*(float(f([f(one[j]) for one in usual or picked.values()])) for f in (np.min, np.max)))
        for j in (0, 1)
    )
    charts = []
    for group in groups:
        curves = runs.curves(lambda run: picked[run.label], dots=True, groups=[group], alike=False)
        charts.append(
            Chart(
                title=f"States of {group.title}.",
                short=group.title,
                x=xs.axis(view.x_name, view.x_unit),
                y=ys.axis(view.y_name, view.y_unit),
                curves=[replace(one, marks=False) for one in curves],
            )
        )
    left = len(runs.groups) - len(groups)
    more = f"; {left} more are not drawn" if left else ""
    said = f"states by {len(runs.groups)} thermostat{'s' * (len(runs.groups) > 1)}"
    said += more
    said = _heading(f"phase portrait{_of(runs, [view])}", said)
    return runs.bank("phase-portrait", charts, said, (2.6, 2.4), columns=min(4, len(charts)))


def _frames(picked: Sequence[State], true: State | None, view: View) -> tuple[Frame, Frame]:
    """Limits of a phase portrait: a run that goes far in one direction does not set the scale."""
    steep = _steep(picked[0] if true is None else true)
    if steep is not None:
        return steep
    right = (None, None) if true is None else true
    sizes = [frames.frame([one[j] for one in picked], right[j]) for j in (0, 1)]
    near = [one for one in picked if all(its.leaves(one[j]) is None for j, its in enumerate(sizes))]
    x, y = (frames.frame([one[j] for one in near or picked], right[j]) for j in (0, 1))
    clipped = len(near) < len(picked)
    if view.turn:
        # the whole turn, and all of the separatrix
        top = 1.1 * max(float(np.nanmax(y)) for _, y in view.separatrices(-1, 1))
        x, y = Frame(-view.turn / 2, view.turn / 2), Frame(min(y.low, -top), max(y.high, top))
        # rotation is not divergence
        return x, Frame(y.low, y.high, clipped)
    return Frame(x.low, x.high, clipped), Frame(y.low, y.high, clipped)


def _parted(x: Floats, y: Floats, xs: Frame, ys: Frame) -> State:
    """A finely drawn curve without the lines over its jumps, where no state is near."""
    far = np.hypot(np.diff(x) / xs.half, np.diff(y) / ys.half) > JUMP
    at = (1 + np.flatnonzero(far)).tolist() if len(x) > MANY_POINTS else []
    return np.insert(x, at, np.nan), np.insert(y, at, np.nan)


def _meets(x: Floats, y: Floats, xs: Frame, ys: Frame) -> bool:
    """Whether a curve y(x), or its mirror, crosses the axes."""
    inside = (x >= xs.low) & (x <= xs.high) & np.isfinite(y)
    return bool(np.any(inside & ((y <= ys.high) | (-y >= ys.low))))


def _steep(motion: State) -> tuple[Frame, Frame] | None:
    """The visible part of a motion that runs away: its beginning.  None where it does not."""
    size = np.abs(motion[0])
    start, end = float(size[0]), float(np.max(size))
    if not (end > STEEP * max(float(np.median(size)), start) and end == float(size[-1]) and start > 0):
        return None
    last = int(np.argmax(size > START_SHOWN * start))
    # from a little beyond 0 to the last value
    x, y = (sorted((float(one[last]), -0.25 * float(one[last]))) for one in motion)
    return Frame(x[0], x[1], clipped=True), Frame(y[0], y[1], clipped=True)


def _sparse(truth: Motion | None, view: View, *frames: Frame) -> bool:
    """Whether straight lines between points of the exact solution visibly miss it at a tenth of the points.

    The miss is estimated as a quarter of a point's distance from the line between its neighbours."""
    if truth is None or len(truth[0]) < 3:
        return False
    t, *motion = truth[0], *view.pick(truth[1], truth[2])
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    return any(
        float(np.quantile(np.abs(x[1:-1] - x[:-2] - share * (x[2:] - x[:-2])), 0.9)) > 4 * CHORD * its.half
        for x, its in zip(motion, frames, strict=False)
    )


def _chords(run: Trajectory, truth: Motion | None, view: View, *frames: Frame) -> bool:
    """Whether frames are so far apart that lines between them visibly miss the exact solution."""
    if truth is None:
        return False
    t, *motion = np.abs(truth[0]), *view.pick(truth[1], truth[2])
    if _sparse(truth, view, *frames):
        # it shows no chord of frames that are as far apart as its own points
        return len(run.t) < 2 * len(t)
    at = np.abs(run.t)
    inside = (t >= at[0]) & (t <= at[-1])
    with np.errstate(all="ignore"):
        missed = [
            float(np.max(np.abs(np.interp(t, at, np.interp(at, t, x)) - x)[inside], initial=0.0)) / its.half
            for x, its in zip(motion, frames, strict=False)
        ]
    return max(missed) > 2 * CHORD


def positions(runs: Runs, shown: Sequence[View], truth: Motion | None, whole: Runs) -> Bank:
    """Positions over time, a row for each view; of many periods the first and the last.

    `whole`: the complete runs, whose errors the title states."""
    spans = _spans(runs, shown, truth)
    charts = [_position(runs, view, truth, span, alone=len(shown) == 1) for view in shown for span in spans]
    parts = "" if len(spans) == 1 else f"; the first and the last {PERIODS_SHOWN} periods"
    few = "; a few periods" if spans[-1][1] < runs.last else ""
    bath = f"one random motion of each method{few}"
    off = _off(whole, shown[0]) if runs.scene.bath is None else bath
    said = _heading(f"{shown[0].what}{_of(runs, shown)}{runs.part}", off) + parts
    size = (7.6 if len(spans) == 1 else 5.0, 3.8 if len(shown) == 1 else 1.9)
    return whole.bank("position", charts, said, size, columns=len(spans))


def _off(runs: Runs, view: View) -> str:
    """Largest error of the best and of the worst, as parts of the exact solution's peak-to-peak range."""
    exact = Exact(runs.scene)
    if not exact.known:
        return ""
    found = {}
    for group in runs.groups:
        both = [(view.pick(run.q, run.p)[0], view.pick(*exact.at(run))[0]) for run in group.members]
        with np.errstate(all="ignore"):
            each = [np.max(np.abs(x - true)) / (np.ptp(true) or 1.0) for x, true in both]
            found[group.title] = float(np.max(each))
    return extremes(found, f"largest {view.what} error {{}} of the range")


def extremes(found: Mapping[str, float], text: str, *, beyond: float = 10.0) -> str:
    """A text with the smallest and the largest number, and whose they are; what is beyond has left."""
    stay = {name: x for name, x in found.items() if x <= beyond}
    left = [name for name in found if name not in stay]
    gone = f"{left[0]} leaves" if len(left) == 1 else f"{len(left)} of {len(found)} leave"
    if not stay:
        return f"{gone} the chart" if left else ""
    small, large = min(stay, key=lambda x: stay[x]), max(stay, key=lambda x: stay[x])
    numbers = f"{share(stay[small])} ({small})"
    numbers += f" to {share(stay[large])} ({large})" if share(stay[large]) != share(stay[small]) else ""
    return text.format(numbers) + (f"; {gone} the chart" if left else "")


def _spans(runs: Runs, shown: Sequence[View], truth: Motion | None) -> list[tuple[float, float]]:
    """The times that are shown: all, or the first and the last periods of many."""
    first, last = min(float(np.min(np.abs(run.t))) for run in runs.every), runs.last
    motion = truth[1:] if truth is not None else (runs.longest.q, runs.longest.p)
    turns = max(periods(view.pick(*motion)[0]) for view in shown)
    if turns <= MANY_PERIODS:
        return [(first, last)]
    length = PERIODS_SHOWN * (last - first) / turns
    # in a bath all parts are alike
    return [(first, first + length), (last - length, last)][: 1 if runs.scene.bath else 2]


def _position(
    runs: Runs, view: View, truth: Motion | None, span: tuple[float, float], *, alone: bool
) -> Chart:
    true = None if truth is None else view.pick(truth[1], truth[2])
    picked = {run.label: view.pick(run.q, run.p)[0] for run in runs.every}
    first = runs.every[0]
    steep = _steep(view.pick(first.q, first.p) if true is None else true) is not None
    ys = frames.frame(list(picked.values()), None if true is None else true[0])
    dy, unit_x = looks.prefixed(max(abs(ys.low), abs(ys.high)), view.x_unit)
    of = np.abs if steep else np.asarray

    def cut(run: Trajectory) -> State:
        y = ys.within(picked[run.label])
        t = np.abs(run.t[: len(y)])
        here = (t >= span[0]) & (t <= span[1])
        return run.t[: len(y)][here], of(y[here])

    lines = []
    # a part of many periods needs a finer line than all of them
    fine = smooth(runs.scene, *span, *([] if truth is None else [len(truth[0])]))
    if fine is not None:
        y = ys.within(view.pick(fine[1], fine[2])[0])
        lines.append(exact_curve(fine[0][: len(y)], of(y)))
    dots = _chords(runs.longest, fine, view, ys)
    curves = runs.curves(cut, dots=dots, faint=True)
    if steep:
        inside = [np.abs(x) for x in picked.values() if ys.leaves(x) is None]
        least = min((float(np.min(x[x > 0], initial=ys.high)) for x in inside), default=ys.high / 10)
        ys = Frame(least / 2, 2 * ys.high, ys.clipped, log=True)
    last = span[1] if runs.longest.step > 0 else -span[1]
    name = with_unit(view.x_name, unit_x)
    chart = Chart(
        title=f"{view.x_name}{f' of {view.title}' if view.title else ''} over time.".capitalize(),
        short="" if alone else view.title,
        x=runs.time((min(span[0], last), max(span[0], last))),
        y=Scale(name=f"|{name}|" if steep else name, log=steep, shown=ys.ends, factor=dy),
        curves=[*lines, *curves],
        note=runs.leaving(lambda run: ys.leaves(picked[run.label])) if span[0] == 0 else "",
    )
    if (alone or span[0] == 0) and span[1] == runs.last:
        return naming.at_ends(chart, height=naming.NAME_HIGH * (1 if alone else 2))
    return chart
