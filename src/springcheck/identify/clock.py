"""The interval between frames, from times that are rounded, accumulated, or written with few digits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from springcheck.errors import IdentificationError
from springcheck.identify.storage import ROUNDING, Storage, single_of, storages
from springcheck.physics.arrays import Extended, Floats

FEWEST_STATES = 5
"""Four pairs of frames leave one degree of freedom for each row of the map, which has three unknowns."""

MOST_ADDED = 100
"""Most steps to a frame for which an accumulated clock, t += h, is tried."""

SHORT_STEP = 9
"""Most significant decimal digits of a step that somebody typed."""


class UnevenError(IdentificationError):
    """Times that are not one interval apart, but for their rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Clock:
    """The interval between frames [T] and its uncertainty."""

    interval: np.longdouble
    jitter: float
    """Relative uncertainty of the interval."""
    quantum: float
    """Rounding of the times, in intervals."""
    unlike: float
    """The part of it that steps may have, in intervals: decimals are those of a file."""
    deviations: Extended | None
    """Relative deviation (f - 1,) of each interval from the mean, where double precision shows it."""


def clock_of(t: Floats) -> Clock:
    """The clock of times (f,).  Raises IdentificationError where their interval is not constant."""
    wide = t.astype(np.longdouble)
    span = wide[-1] - wide[0]
    interval = span / (len(t) - 1)
    if interval == 0:
        raise IdentificationError("all times are equal: the interval between the states is unknown")
    off = np.abs(np.diff(wide) - interval)
    worst = int(np.argmax(off))
    even = float(np.max(np.spacing(np.abs(t))))
    forms = storages(t)
    # 0.5, 1.0, 1.5 are multiples of a round step, not times that were cut to one decimal, and those of a
    # float32 clock are not text: the finest of the grids that the times lie on explains them
    single = single_of(t) or (forms[0].name == "single" and single_of(t, SHORT_STEP))
    coarser = [Storage(name="single"), *forms] if single else forms
    grids = [even, *(float(np.max(x.quantum(t))) for x in coarser)]
    texts = grids[-len(forms) :] if forms[0].name.startswith("text") else []
    # an interval is the difference of two rounded times; an accumulated clock rounds once more in every step.
    # A cut is by the last digit at most, and times one digit apart are not cut: a frame is there twice
    quantum = next((
        x for x in grids
        if off[worst] <= (1.5 if x in texts else 4) * x and (x not in texts or abs(interval / x - 1) >= 0.1)
    ), None)  # fmt: skip
    if quantum is None:
        quantum = next((x for x in grids[: 1 + single] if off[worst] <= (4 + MOST_ADDED / 2) * x), None)
    if quantum is None:
        each = np.diff(wide)
        change = np.abs(np.diff(each))
        # of changes there and back, which roundings alone tell apart, the first
        at = int(np.argmax(change >= np.max(change) - 4 * even))
        raise UnevenError(
            f"the states are not at a constant interval: frames {at + 1} and {at + 2} are "
            f"{float(each[at + 1]):.9g} apart, and the two before them {float(each[at]):.9g}; "
            "give a part of the trajectory with one interval"
        )
    jitter = quantum / abs(float(span)) + ROUNDING
    if single and quantum == even and float(f"{interval:.{SHORT_STEP}g}") != interval:
        # a step of single precision has even multiples too, and was rounded to it with its times
        jitter += 2.0**-24
    binary = quantum in grids[: 1 + single]
    mean, line = interval, wide - wide[0] - np.arange(len(t)) * interval
    # a sum of steps, each rounded: its mean is off by as much as they differ
    width = np.float32 if quantum > even else np.float64
    step = _added(t, interval, quantum, width) if binary and not _even(t, interval, width) else None
    if step is not None:
        interval = step
        jitter += float(abs(interval / mean - 1)) + (2.0**-24 if quantum != even else 0.0)
    elif binary and float(np.max(np.abs(line))) > 2 * quantum:
        jitter += float(off[worst] / abs(mean))
    elif quantum != even:
        # a program's step is a short decimal, and a coarse clock leaves room for it; what was written may
        # have been a sum of steps, each of which rounds by half an ulp
        room = jitter + (len(t) - 1) * even / 2 / abs(float(span))
        near = (float(f"{float(interval):.{digits}g}") for digits in range(1, 8))
        close = (x for x in near if abs(x / float(interval) - 1) <= room)
        interval = np.longdouble(next(close, float(interval)))
        jitter += float(abs(interval / mean - 1))
    deviations = None
    if quantum == even and float(off[worst]) > 2 * ROUNDING * abs(float(interval)):
        deviations = np.asarray(np.diff(wide) / interval - 1)
    size = abs(float(interval))
    return Clock(
        interval=interval, jitter=jitter, quantum=quantum / size, deviations=deviations,
        unlike=(quantum if binary else even) / size,
    )  # fmt: skip


Width: TypeAlias = type[np.floating[Any]]
"""Floating-point type of a clock."""


def _even(t: Floats, interval: np.longdouble, width: Width) -> bool:
    """Whether the times are multiples of a step, each rounded once."""
    n, times = np.arange(len(t)), t.astype(width)
    steps = (float(interval), float(t[1] - t[0]), float(f"{float(interval):.{SHORT_STEP}g}"))
    return any(np.array_equal((t[0] + n * h).astype(width), times) for h in steps)


def _added(t: Floats, interval: np.longdouble, quantum: float, width: Width) -> np.longdouble | None:
    """Interval of a clock t += h that gives t, rounded to `quantum` [T], to the last bit; or None."""
    times = t.astype(width)
    for steps, h in _steps(t, float(interval), quantum):
        summed = np.full(steps * (len(t) - 1) + 1, h, width)
        summed[0] = t[0]
        # the first frames refute most
        if all(
            np.array_equal(np.cumsum(summed[: n * steps + 1])[::steps], times[: n + 1])
            for n in (2, len(t) - 1)
        ):
            return np.longdouble(h) * steps
    return None


def _steps(t: Floats, interval: float, quantum: float) -> Iterator[tuple[int, float]]:
    """Steps per frame and step h of which the times may be sums: from t = 0 t[1], or a short decimal."""
    if t[0] == 0:
        yield 1, float(t[1])
    for steps in range(1, MOST_ADDED + 1):
        # each of them rounds by half a quantum at most
        room = steps * quantum / 2
        short = (float(f"{interval / steps:.{digits}g}") for digits in range(1, SHORT_STEP + 1))
        yield from ((steps, h) for h in short if abs(h * steps - interval) <= room)
