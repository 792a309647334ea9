"""The part of an axis that a chart shows: the exact solution, and what does not go far beyond it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from springcheck.figures import looks
from springcheck.figures.charts import Scale
from springcheck.figures.views import with_unit
from springcheck.physics.arrays import Floats

EXPLODED, LARGE = 3.0, 6.0
"""Multiple of the exact solution's reach up to which a growing run sets the scale of a chart, and any other
run."""

GROWS = 1.3
"""Ratio of the second half's reach to the first half's from which a run grows."""

FAR_OFF = 1e6
"""Half-widths beyond a chart to which a line is drawn: far enough to leave it in its direction."""

ROUNDINGS = 1e-9
"""Relative difference of values below which a picture shows them as equal."""


@dataclass(frozen=True, slots=True)
class Frame:
    """The part of an axis that a chart shows."""

    low: float
    high: float
    clipped: bool = False
    """Whether some run goes far beyond."""
    log: bool = False
    """Whether the axis is logarithmic."""

    @property
    def centre(self) -> float:
        return self.low / 2 + self.high / 2

    @property
    def half(self) -> float:
        return self.high / 2 - self.low / 2

    @property
    def ends(self) -> tuple[float, float]:
        return self.low, self.high

    def axis(self, name: str, unit: str) -> Scale:
        """Scale of this axis, in a readable unit."""
        factor, readable = looks.prefixed(max(abs(self.low), abs(self.high)), unit)
        return Scale(name=with_unit(name, readable), log=self.log, shown=self.ends, factor=factor)

    @property
    def far(self) -> tuple[float, float]:
        """Limits to which lines are drawn beyond the axis."""
        return self.centre - FAR_OFF * self.half, self.centre + FAR_OFF * self.half

    def parts(self, values: Sequence[float] | Floats) -> Floats:
        """Values as fractions of the axis: 0 to 1 inside."""
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
        """Values up to the first one outside, which is clipped: far away, drawing it overflows."""
        end = self.leaves(values)
        values = values if end is None else values[: end + 1]
        return np.clip(values, *self.far)


def frame(runs: Sequence[Floats], truth: Floats | None, *, far: float | None = None) -> Frame:
    """What to show: the exact solution and every run that does not go far beyond it.

    Without an exact solution the median of the runs takes its place.  `far`: how far beyond the exact
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
    """A frame around values, with a margin; values that differ by roundings alone count as one."""
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
    """States up to the first one outside, clipped along the ray from the centre if it is far away."""
    ends = [i for i in (a.leaves(x), b.leaves(y)) if i is not None]
    if not ends:
        return x, y
    x, y = x[: min(ends) + 1], y[: min(ends) + 1]
    # in extended precision: 1e300 over a half width of 1e-200 overflows
    u, v = ((np.asarray(one, np.longdouble) - its.centre) / its.half for one, its in ((x, a), (y, b)))
    scale = np.maximum(1, np.maximum(np.abs(u), np.abs(v)) / FAR_OFF)
    return tuple(np.asarray(w / scale * its.half + its.centre, np.float64) for w, its in ((u, a), (v, b)))  # type: ignore[return-value]
