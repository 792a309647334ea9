"""Measuring the points of sweeps: errors and timings in separate runs, timings of all methods in turn.

Methods take turns, so that a machine that slows down slows all alike.  One warm-up, and the minimum of the
repeats is quoted, as in the work-precision diagrams of DiffEqDevTools (SciML).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, floor
from time import perf_counter

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label, Method, Stopped
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene
from springcheck.studies.precision import bare, fits
from springcheck.studies.precision.accuracy import MOST_COMPARED_FRAMES, Errors, Truth
from springcheck.studies.precision.points import CANNOT_RUN, TARGETS, Point
from springcheck.text.wording import count, seconds

TOLERANCES = (1e-3, *(float(f"{mantissa}e-{e}") for e in range(4, 17) for mantissa in (3, 1)))
"""Relative tolerances of adaptive solvers, two a decade, from 1e-3 to 1e-16: a solver's response to one
beyond double precision is a row as well."""

PLANNED = 1_000_000_000
"""Number of steps announced to engines: a sweep to the floor is worth compiling for."""

MOST_STEPS = 2**31
"""Largest number of steps of a point: seconds of the fastest method here, days of the slowest."""

SHORTEST, MOST_START_SECONDS, MOST_COPIES = 1e-4, 0.02, 64
"""Seconds that a timing lasts at least, a thousand ticks of a coarse clock; those that the starts of several
short runs in one timing may take; and most of these runs."""

STABLE = 1.02
"""Ratio within which the two last repeats have not improved on the minimum: no further one is needed."""


@dataclass(kw_only=True, eq=False)
class Sweeping:
    """The sweep of one method while it is measured."""

    label: Label
    scenes: Iterator[Scene]
    """Scenes of the finer steps that remain to be run."""
    scene: Scene | None = None
    """Scene of the next point, None at the end."""
    points: list[Point] = field(default_factory=list)
    run: float = 0.0
    """Estimated seconds of one bare run at the next point."""
    start: float = 0.0
    """Seconds of a start."""

    @property
    def method(self) -> Method:
        """The engine's declaration of the method."""
        return engines.method(self.label)

    @property
    def price(self) -> float:
        """Estimated seconds for the next point: one run for the errors, a warm-up, and the repeats."""
        return (2 + repeats(self.run)) * (self.run + self.start)

    @property
    def spent(self) -> float:
        """Seconds that its points took."""
        return sum(point.spent_seconds for point in self.points)

    def point(self, outcome: str, message: str = "") -> Point:
        """The next point, with nothing measured."""
        scene, adaptive = self.scene, self.method.adaptive
        step, steps = (None, None) if scene is None or adaptive else (scene.step, scene.steps)
        return Point(
            method=str(self.label), step=step, steps=steps,
            tolerance=scene.tolerance if scene is not None and adaptive else None,
            outcome=outcome, message=message,
        )  # fmt: skip

    def line(self, metric: str) -> str:
        """What is newly known: the time of its first run, or the smallest of `TARGETS` that was reached."""
        if not self.points:
            steps = count(self.scene.steps, "step") if self.scene else ""
            return f"{self.label}: {steps} in {seconds(self.run)}" if self.run and steps else ""
        *before, last = [x.error(metric) for x in self.points]
        reached = [x for x in TARGETS if last <= x < min(before, default=np.inf)]
        if not reached:
            return ""
        took = f"in {seconds(self.points[-1].seconds)}, {self.points[-1].force_calls} force calls"
        return f"{self.label}: {metric} error {reached[-1]:.0e} {took}"

    def take(self, point: Point) -> None:
        """Append a measured point, estimate the cost of the next one from it, and advance to it."""
        before = self.points[-1].seconds if self.points else np.nan
        self.points.append(point)
        if point.run_seconds_repeats:
            growth = max(1.2, point.seconds / before) if self.method.adaptive and before > 0 else 2.0
            self.run, self.start = growth * point.seconds, point.start_seconds or 0.0
        errors = [x.error("largest") for x in self.points if x.complete]
        # while the leading term dominates, a smaller step reduces the error; only rounding can make it grow
        finished = not self.method.adaptive and fits.turned(errors) is not None
        self.scene = None if finished else next(self.scenes, None)


def begin(scene: Scene, label: Label, known: Truth) -> Sweeping:
    """A sweep at its coarsest point, or at its end where the method cannot run."""
    method, plain = engines.method(label), replace(scene, quantities=("q", "p"))
    limit = schemes.scheme(method.scheme).limit
    scenes = by_tolerance(plain) if method.adaptive else by_step(plain, limit, known)
    sweep = Sweeping(label=label, scenes=scenes)
    try:
        if reason := engines.obstacle(scene, label):
            raise MethodError(reason)
        sweep.scene = next(scenes, None)
        if sweep.scene is None:
            needed = coarsest(known, limit)
            raise MethodError(f"its coarsest run takes {needed:.0e} steps, more than {MOST_STEPS:.0e}")
        # the first run imports and compiles
        bare.measure(replace(sweep.scene, steps=1), label, planned=PLANNED)
        first = bare.measure(timed_scene(plain, sweep), label, planned=PLANNED).timing
        sweep.start, sweep.run = first.start, first.run
    except MethodError as error:
        sweep.scene = None
        sweep.points.append(sweep.point(CANNOT_RUN, str(error)))
    except Stopped:
        # the run for the errors stops likewise and reports it as a row
        pass
    return sweep


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
    for tolerance in TOLERANCES:
        yield replace(scene, step=scene.step / finer, steps=scene.steps * finer, every=1, tolerance=tolerance)


def timed_scene(scene: Scene, sweep: Sweeping) -> Scene:
    """The run that is timed at a point: an adaptive solver's on the scene's own time grid, or the point's."""
    assert sweep.scene is not None
    return replace(scene, tolerance=sweep.scene.tolerance) if sweep.method.adaptive else sweep.scene


def errors(sweep: Sweeping, known: Truth) -> Point:
    """Measure the errors of the next point."""
    scene = sweep.scene
    assert scene is not None
    single = engines.arithmetic(sweep.label).parameters == "single"
    judged = known.scene.system.in_single if single else known.scene
    scheme = schemes.scheme(sweep.method.scheme)
    found = Errors(known, scene.step, scene.every, scheme=scheme, judged=judged)
    began = perf_counter()
    run = driver.play(scene, sweep.label, found, planned=PLANNED)
    took, outcome = perf_counter() - began, run.outcome
    if outcome.status != "complete":
        message = f"after {count(outcome.step, 'step')}: {outcome.message}"
        point = replace(sweep.point(outcome.status, message), force_calls=run.force_calls)
    elif not (np.isfinite(found.result.max_error) and np.isfinite(found.result.energy_error)):
        point = sweep.point("diverged", "the error is beyond the range of numbers")
    else:
        point = replace(sweep.point("complete"), accuracy=found.result, force_calls=run.force_calls)
    return replace(point, spent_seconds=took)


def repeats(seconds: float) -> int:
    """Most timed runs: fewer where one is long, which averages over the machine's noise."""
    return 9 if seconds < 0.02 else 5 if seconds < 0.1 else 3 if seconds < 1 else 2


def level(sweeps: Sequence[Sweeping], known: Truth, tell: Callable[[str], None]) -> None:
    """Measure the next point of each of these sweeps: errors one by one, then timings in turn, A B C A B C,
    until the minimum of each is stable."""
    points, costs = [], []
    for sweep in sweeps:
        tell(f"{sweep.label}, errors")
        points.append(errors(sweep, known))
    tell(f"timing {count(len(sweeps), 'method')} in turn")
    timings: list[list[bare.Bare]] = [[] for _ in sweeps]
    going = [j for j, point in enumerate(points) if point.complete]
    scenes = [timed_scene(known.scene, sweep) for sweep in sweeps]
    for number in range(1 + repeats(0)):
        for j in list(going):
            sweep, run = sweeps[j], sweeps[j].run
            most = ceil(MOST_START_SECONDS / max(sweep.start, 1e-9))
            copies = max(1, min(MOST_COPIES, most, ceil(SHORTEST / max(run, 1e-9))))
            if number == 0 and run > 0.1:
                # a long run is warm after its first thousandth, and the run for the errors before
                continue
            began = perf_counter()
            try:
                cost = bare.measure(scenes[j], sweep.label, copies=copies, planned=PLANNED)
            except Stopped as stop:
                points[j] = replace(sweep.point("stopped", str(stop)), spent_seconds=points[j].spent_seconds)
                going.remove(j)
                continue
            took = perf_counter() - began
            points[j] = replace(points[j], spent_seconds=points[j].spent_seconds + took)
            timings[j] += [cost] if number else []
            runs = [x.timing.run for x in timings[j]]
            stable = len(runs) > 2 and min(runs[:-2]) <= STABLE * min(runs)
            if stable or len(runs) >= repeats(run):
                going.remove(j)
    for sweep, point, found in zip(sweeps, points, timings, strict=True):
        costs = [x.timing.run for x in found] if point.complete else []
        starts = [x.timing.start for x in found]
        calls = found[0].force_calls if found and point.complete else point.force_calls
        sweep.take(replace(
            point, run_seconds_repeats=tuple(costs), start_seconds=min(starts, default=None),
            force_calls=calls,
        ))  # fmt: skip
