"""A sweep of one method from coarse to fine steps, and the scheduler that shares a budget of seconds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import ceil, floor
from time import perf_counter

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label, Method, Stopped
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene
from springcheck.studies.precision import fits
from springcheck.studies.precision.accuracy import MOST_COMPARED_FRAMES, Truth
from springcheck.studies.precision.fits import Place, Point

TOLERANCES = (1e-3, *(float(f"{mantissa}e-{e}") for e in range(4, 17) for mantissa in (3, 1)))
"""Relative tolerances of adaptive solvers, two a decade, from 1e-3 to 1e-16: a solver's response to one
beyond double precision is a row as well."""

RESERVED_SHARE = 0.75
"""Largest part of the remaining time that is reserved for methods that can reach their floor."""

PLANNED = 1_000_000_000
"""Number of steps announced to engines: a sweep to the floor is worth compiling for."""


@dataclass(kw_only=True, eq=False)
class Sweep:
    """The sweep of one method from coarse to fine; the only mutable state of a study."""

    label: Label
    scenes: Iterator[Scene]
    """Scenes of the finer steps that remain to be run."""
    scene: Scene | None = None
    """Scene of the next point, None at the end."""
    points: list[Point] = field(default_factory=list)
    condition: fits.Condition | None = None
    """Growth of rounding in the method."""
    cost: float = 0.0
    """Estimated seconds of one bare run at the next point."""
    start: float = 0.0
    """Seconds of a start."""
    overhead: float = 0.0
    """Seconds that the last point took besides its runs: starts, comparisons, reading."""
    read: float = 0.0
    """Estimated seconds of a run with every step read."""
    first_start: float | None = None
    ahead: dict[Place, Point] = field(default_factory=dict)
    """Points whose errors were measured before they are timed."""

    @property
    def known(self) -> Point | None:
        """The next point, if its errors were measured beforehand; None otherwise."""
        return self.ahead.get(blank(self, "").place)

    @property
    def method(self) -> Method:
        """The engine's declaration of the method."""
        return engines.method(self.label)

    @property
    def complete(self) -> list[Point]:
        """Points with errors."""
        return [point for point in self.points if point.complete]


MOST_STEPS = 2**31
"""Largest number of steps of a point: seconds of the fastest method here, days of the slowest."""


def begin(scene: Scene, label: Label, known: Truth) -> Sweep:
    """A sweep at its coarsest point, or at its end where the method cannot run."""
    method = engines.method(label)
    plain = replace(scene, quantities=("q", "p"))
    limit = schemes.scheme(method.scheme).limit
    sweep = Sweep(
        label=label,
        scenes=by_tolerance(plain) if method.adaptive else by_step(plain, limit, known),
    )
    try:
        if reason := engines.obstacle(scene, label):
            raise MethodError(reason)
        sweep.condition = fits.condition(method, engines.arithmetic(label), known.angle)
        sweep.scene = next(sweep.scenes, None)
        if sweep.scene is None:
            needed = coarsest(known, limit)
            raise MethodError(f"its coarsest run takes {needed:.0e} steps, more than {MOST_STEPS:.0e}")
        began = perf_counter()
        driver.bare(replace(sweep.scene, steps=1), label, planned=PLANNED)
        sweep.first_start = perf_counter() - began
        first = driver.bare(to_time(plain, sweep), label, planned=PLANNED).timing
        sweep.start, sweep.cost = first.start, first.run
    except MethodError as error:
        sweep.scene = None
        sweep.points.append(blank(sweep, fits.CANNOT_RUN, str(error)))
    except Stopped:
        # the run for the errors stops likewise and reports it as a row
        pass
    return sweep


def take(sweep: Sweep, point: Point) -> None:
    """Append a measured point, estimate the cost of the next one from it, and advance to it."""
    sweep.points.append(point)
    if point.run_seconds_repeats:
        *_, before, run = [0.0, *(x.seconds for x in sweep.points if x.run_seconds_repeats)]
        sweep.start = min(point.start_seconds_repeats)
        sweep.overhead = max(0.0, point.spent_seconds - runs(run + sweep.start) * run)
        growth = max(1.2, run / before) if sweep.method.adaptive and before else 2.0
        sweep.cost, sweep.read = growth * run, growth * min(point.read_seconds_repeats, default=np.inf)
    errors = [point.error for point in sweep.complete]
    # while the leading term dominates, a smaller step reduces the error; only rounding can make it grow
    finished = not sweep.method.adaptive and fits.turned(errors) is not None
    sweep.scene = None if finished else next(sweep.scenes, None)


def coarsest(known: Truth, limit: float) -> int:
    """Number of steps of the coarsest point: the least with h w below the limit of stability, or without a
    limit with h w <= 1."""
    if 0 < limit < np.inf:
        return max(1, floor(known.angle / limit) + 1)
    return max(1, ceil(known.angle))


def by_step(scene: Scene, limit: float, known: Truth) -> Iterator[Scene]:
    """The scene with ever more steps, read at the same instants from some 4096 steps on."""
    steps, every = coarsest(known, limit), 1
    while steps < MOST_STEPS:
        yield replace(scene, step=known.duration / steps, steps=steps, every=every)
        steps *= 2
        every = every * 2 if steps // every > MOST_COMPARED_FRAMES else every


def by_tolerance(scene: Scene) -> Iterator[Scene]:
    """The scene at ever smaller tolerances, on a time grid that resolves its largest error."""
    finer = max(1, MOST_COMPARED_FRAMES // scene.steps)
    h = scene.step / finer
    for tolerance in TOLERANCES:
        yield replace(scene, step=h, steps=scene.steps * finer, every=1, tolerance=tolerance)


def fitting(sweeps: list[Sweep], known: Truth, left: float) -> list[Sweep]:
    """The sweeps whose next point fits into the seconds left; where none does, the cheapest if that fits.

    Seconds are reserved for the methods that can reach their floor; the others share the rest equally.  A
    sweep that waits resumes when others have finished.
    """
    needs = sorted((_need(sweep, known.duration), i) for i, sweep in enumerate(sweeps))
    aside, reserved = set(), 0.0
    for need, i in needs:
        if reserved + need <= RESERVED_SHARE * left:
            aside.add(i)
            reserved += need
    share = (left - reserved) / max(1, len(sweeps) - len(aside))
    ready = [
        sweep
        for i, sweep in enumerate(sweeps)
        if (i in aside and price(sweep) <= left) or price(sweep) <= share
    ]
    if ready or not sweeps:
        return ready
    cheapest = min(sweeps, key=price)
    return [cheapest] if price(cheapest) <= left else []


def _need(sweep: Sweep, duration: float) -> float:
    """Seconds until a method of fixed step has passed its floor; infinite while these cannot be estimated."""
    points = sweep.complete
    fit = fits.order(points, sweep.condition) if not sweep.method.adaptive else None
    if fit is None or sweep.condition is None:
        return np.inf
    steps, _ = fits.expected_floor(points, fit, sweep.condition, duration)
    run, last, total = sweep.cost, float(points[-1].steps or 1), 0.0
    while last < 1.2 * steps:
        total += _seconds(sweep, run)
        run, last = 2 * run, 2 * last
    return total


def runs(seconds: float) -> int:
    """Number of runs for a point of which one takes so many seconds: errors, warm-up and repeats."""
    return 1 + warm_ups(seconds) + repeats(seconds)


def repeats(seconds: float) -> int:
    """Number of timed runs: fewer where one is long, which averages over the machine's noise."""
    return 9 if seconds < 0.02 else 5 if seconds < 0.1 else 3 if seconds < 1 else 2


def warm_ups(seconds: float) -> int:
    """Number of warm-up runs: a long run is warm after its first thousandth, and the errors' run before."""
    return 1 if seconds < 0.1 else 0


def _seconds(sweep: Sweep, run: float) -> float:
    """Seconds for a point of which one bare run takes so many."""
    return sweep.overhead + run * runs(run + sweep.start)


def price(sweep: Sweep) -> float:
    """Seconds for the next point."""
    return _seconds(sweep, sweep.cost)


def to_time(scene: Scene, sweep: Sweep) -> Scene:
    """The run that is timed at a point: an adaptive solver's on the scene's own time grid, or the point's."""
    assert sweep.scene is not None
    if sweep.method.adaptive:
        return replace(scene, tolerance=sweep.scene.tolerance)
    return sweep.scene


def blank(sweep: Sweep, outcome: str, message: str = "") -> Point:
    """The sweep's next point, with nothing measured."""
    scene, adaptive = sweep.scene, sweep.method.adaptive
    return Point(
        method=str(sweep.label),
        step=None if scene is None or adaptive else scene.step,
        tolerance=scene.tolerance if scene is not None and adaptive else None,
        steps=None if scene is None or adaptive else scene.steps,
        outcome=outcome,
        message=message,
    )
