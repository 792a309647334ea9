"""Timings of points, taken in turn, so that a machine that slows down slows all methods alike."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import ceil
from time import get_clock_info, perf_counter

from springcheck import driver
from springcheck.engines.contract import Stopped
from springcheck.errors import SpringcheckError
from springcheck.physics.scene import Scene
from springcheck.studies.precision.fits import Point
from springcheck.studies.precision.sweeps import PLANNED, Sweep, repeats, warm_ups

FEWEST_TICKS = 1000
"""Clock ticks that a timing lasts at least, so that the clock's resolution is a thousandth of it."""

MOST_START_SECONDS = 0.02
"""Seconds that the starts of several short runs in one timing may take."""

READ_TIMINGS = 3
"""Timings of a run with every step read; one where a start is slow."""

MOST_LOOKS = 10_000_000
"""Readings of the clock within which it must advance: those of a second."""

READ_SECONDS = 0.1
"""Longest run that is also timed with every step read: reading costs the same at each step."""


def tick() -> float:
    """Resolution of the clock [s]."""
    seen = []
    for _ in range(100):
        began = perf_counter()
        now = perf_counter()
        for _ in range(MOST_LOOKS):
            if now != began:
                break
            now = perf_counter()
        seen.append(now - began)
        if not now > began:
            raise SpringcheckError("the clock of this machine runs backwards, or not at all")
    return max(min(seen), get_clock_info("perf_counter").resolution)


@dataclass(kw_only=True, eq=False)
class Clock:
    """Timings of one point while they are measured."""

    sweep: Sweep
    scene: Scene
    point: Point
    """The point with its errors, or with the reason why it has none and is not timed."""
    copies: int = 1
    count: int = 0
    runs: list[driver.Bare] = field(default_factory=list)
    reads: list[float] = field(default_factory=list)
    gave_up: str = ""
    spent: float
    """Seconds of all its runs so far."""

    def warm_up(self, shortest: float) -> None:
        """Determine how many runs fit into one timing, and how many timings to take."""
        expected = self.sweep.cost
        if warm_ups(expected + self.sweep.start):
            expected = self._bare().timing.run
        most = ceil(MOST_START_SECONDS / max(self.sweep.start, 1e-9))
        self.copies = max(1, min(64, most, ceil(shortest / max(expected, 1e-9))))
        self.count = repeats(expected + self.sweep.start)

    def turn(self, number: int) -> None:
        """Measure one repeat."""
        self.runs.append(self._bare(copies=self.copies))
        reads = READ_TIMINGS if self.sweep.start < MOST_START_SECONDS else 1
        if number < reads and self.sweep.read <= READ_SECONDS:
            self.reads.append(self._bare(copies=self.copies, read=True).timing.run)

    def _bare(self, *, copies: int = 1, read: bool = False) -> driver.Bare:
        return driver.bare(self.scene, self.sweep.label, copies=copies, read=read, planned=PLANNED)

    @contextmanager
    def spending(self) -> Iterator[None]:
        """Add up the seconds of runs, of which one that stops is the last."""
        began = perf_counter()
        try:
            yield
        except Stopped as stop:
            self.gave_up, self.count = str(stop), 0
        finally:
            self.spent += perf_counter() - began

    @property
    def timed(self) -> Point:
        """The point with its timings."""
        point = replace(self.point, spent_seconds=self.spent)
        if self.gave_up:
            return replace(point, outcome="stopped", message=self.gave_up, accuracy=None)
        if not self.runs:
            return point
        return replace(
            point,
            run_seconds_repeats=tuple(run.timing.run for run in self.runs),
            start_seconds_repeats=tuple(run.timing.start for run in self.runs),
            read_seconds_repeats=tuple(self.reads),
            force_calls=self.runs[0].force_calls,
        )


def take_turns(clocks: list[Clock]) -> None:
    """Warm up, then repeat in turn: A B C A B C."""
    shortest = FEWEST_TICKS * tick()
    for clock in clocks:
        with clock.spending():
            clock.warm_up(shortest)
    for number in range(max((clock.count for clock in clocks), default=0)):
        for clock in clocks:
            if number < clock.count:
                with clock.spending():
                    clock.turn(number)
