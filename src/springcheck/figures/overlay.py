"""Runs in one chart: a curve for each motion with the marks of its engines, ending where it leaves the axes.

Engines of one scheme that pass share a line; one that failed has its own, in red and on top.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

from springcheck.figures import looks, naming
from springcheck.figures.charts import EXACTLY, REJECTED, Bank, Chart, Curve, Scale
from springcheck.figures.frames import Frame
from springcheck.figures.views import units, with_unit
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.schemes import UNKNOWN

TRUTH = "exact solution"

MOST_LETTERS = 60
"""Most characters of a figure's title; the rest of what is said stands in its small print."""

MOST_LEAVING = 4
"""Schemes that are named where they leave the axes."""


@dataclass(frozen=True, slots=True)
class Group:
    """Runs of one scheme that coincide, so that they share a line; or one that failed."""

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

    `failed`: labels of the trajectories that some verdict rejects; `errors`: the largest error of each over
    all its frames, drawn or not, as far as it is known.
    """

    def __init__(
        self, scene: Scene, runs: Mapping[str, Trajectory], failed: Collection[str] = (),
        errors: Mapping[str, float] | None = None,
    ) -> None:  # fmt: skip
        self.scene, self.errors = scene, errors or {}
        found: dict[str, list[Trajectory]] = {}
        wrong: list[Trajectory] = []
        for label, run in runs.items():
            if len(run.t) > 1 and label in failed:
                wrong.append(run)
            elif len(run.t) > 1:
                # methods of no known scheme are not of one
                named = run.scheme not in ("", UNKNOWN.name)
                found.setdefault(run.scheme if named else label, []).append(run)
        self.groups = [Group(name, tuple(members)) for name, members in found.items()]
        # drawn last: on top of all that is right
        self.groups += [Group(run.scheme, (run,), failed=True) for run in wrong]
        self.every = [run for group in self.groups for run in group.members]

    @property
    def longest(self) -> Trajectory:
        return max(self.every, key=lambda run: len(run.t))

    @property
    def last(self) -> float:
        """The longest time from the start [T]."""
        return max(abs(float(run.t[-1])) for run in self.every)

    @property
    def time_unit(self) -> tuple[float, str]:
        """Factor and unit of a readable axis of time."""
        return looks.prefixed(self.last, units(self.scene).t)

    def time(self, span: tuple[float, float] | None = None) -> Scale:
        """An axis of time in a readable unit, from one time to another; left out: of all of it."""
        factor, unit = self.time_unit
        ends = [float(run.t[i]) for run in self.every for i in (0, -1)]
        return Scale(name=with_unit("time t", unit), factor=factor, shown=span or (min(ends), max(ends)))

    @property
    def part(self) -> str:
        """From when on they are shown, where that is not from the start on."""
        first, (factor, unit) = min((float(run.t[0]) for run in self.every), key=abs), self.time_unit
        return f", from t = {factor * first:.6g} {unit}".rstrip() + " on" if first else ""

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
                        title=("claims " if group.failed else "") + looks.title(run.scheme),
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

    def over_time(
        self,
        found: Mapping[str, Floats],
        ys: Frame,
        *,
        title: str,
        name: str,
        lines: Sequence[Curve] = (),
        short: str = "",
        span: tuple[float, float] | None = None,
        alike: bool = True,
        height: float = naming.NAME_HIGH,
    ) -> Chart:
        """A number of each run (f,), by its label, over time: each curve ends where it leaves the frame.

        `lines`: what is drawn below them; `height`: of a name at the end of a curve.
        """

        def inside(run: Trajectory) -> tuple[Floats, Floats]:
            y = ys.within(found[run.label])
            return run.t[: len(y)], y

        chart = Chart(
            title=title,
            short=short,
            x=self.time(span),
            y=Scale(name=name, log=ys.log, shown=ys.ends),
            curves=[*lines, *self.curves(inside, alike=alike)],
            note=self.leaving(lambda run: ys.leaves(found[run.label])),
        )
        return naming.at_ends(chart, height=height)

    def bank(
        self, name: str, charts: Sequence[Chart], said: str, size: tuple[float, float], *, columns: int = 1
    ) -> Bank:
        """The charts of a figure, under what is said of them."""
        # of a long run every so many frames, between which it may be further off
        thinned = not self.errors and any(run.every > self.scene.every for run in self.every)
        few = thinned and "largest" in said
        whole = f"{self.wrong}{said}{' (of the frames drawn)' * few}"
        return Bank(
            name=name, title="Methods drawn", charts=charts, size=size, columns=columns,
            heading=short(whole) or f"{self.scene.title}: {name.replace('-', ' ')}"[:MOST_LETTERS],
            foot=f"{self.scene.title}: {whole}",
        )  # fmt: skip

    def leaving(self, when: Callable[[Trajectory], int | None]) -> str:
        """Which schemes leave the axes for good, and at which frame, None where they do not."""
        factor, unit = self.time_unit
        firsts = {group.title: group.members[0] for group in self.groups}
        found = [(name, run.t, when(run)) for name, run in firsts.items()]
        said = [
            f"{name} {'at' if i or not t[0] else 'before'} {factor * t[i]:.3g} {unit}".rstrip()
            for name, t, i in found
            if i is not None
        ]
        if len(said) > MOST_LEAVING:
            said = [*said[: MOST_LEAVING - 1], f"{len(said) - MOST_LEAVING + 1} more"]
        return "outside: " + ", ".join(said) if said else ""


def short(said: str) -> str:
    """The first findings of a sentence, as many as a title holds; "" where not even one fits."""
    out = ""
    for whole in said.partition(" (phase")[0].split("; "):
        part = whole
        if not out and len(whole) > MOST_LETTERS:
            # without whose the numbers are
            part = re.sub(r" \((?:[^()]|\([^()]*\))*\)", "", whole)
        longer = f"{out}; {part}" if out else part
        if len(longer) > MOST_LETTERS:
            break
        out = longer
    return out[:1].upper() + out[1:] if ":" not in out.split(" ")[0] else out


def exact_curve(x: Floats, y: Floats) -> Curve:
    """The exact solution."""
    return Curve(name=TRUTH, group=EXACTLY, x=x, y=y, title=TRUTH)


def share(x: float) -> str:
    """A fraction in a readable form: in percent, as a power of ten, or in times."""
    if not 5e-4 <= x < 1000:
        return f"{x:,.0f} times" if 1000 <= x < 1e6 else f"{x:.0e}" if x else "0"
    return f"{100 * x:.2g} %" if x < 0.995 else f"{100 * x:.0f} %"
