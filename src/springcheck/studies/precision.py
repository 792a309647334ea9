"""Error against run time: how much accuracy a method gives for how much work, down to rounding.

Every method of fixed step takes the same duration T in N steps of the double h = T/N, N doubling from the
edge of stability until the error turns up again on its rounding, or the time budget ends.  An adaptive
solver's tolerance falls instead.  What is compared with the true motion and what is timed are separate
runs.  Timed runs record nothing; methods take turns, so that a machine that slows down slows all alike.

The design follows the work-precision diagrams of DiffEqDevTools (SciML): one warm-up, the minimum of the
repeats to quote.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor
from time import get_clock_info, perf_counter

import numpy as np

from springcheck import engines, mechanics, simulate
from springcheck.errors import MethodError
from springcheck.model import Arithmetic, Label, Scene, Stopped
from springcheck.schemes import SCHEMES
from springcheck.studies import fits
from springcheck.studies.accuracy import FRAMES, Accuracy, Errors, Truth, truth
from springcheck.studies.outcome import Answer, MethodSummary, Point, PrecisionStudy, machine

BUDGET = 60.0
"""Seconds that a study takes unless it is told otherwise."""

TARGETS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
"""Errors for which the cheapest way is looked up."""

TOLERANCES = tuple(float(f"{mantissa}e-{e}") for e in range(3, 16) for mantissa in (1, 3) if e > 3 or mantissa < 2)
"""Relative tolerances of adaptive solvers, two a decade, from 1e-3 to 1e-15."""

TICKS = 1000
"""A timing lasts at least so many ticks of the clock, which then blurs it by a thousandth."""

READ_SECONDS = 0.1
"""Longest run that is also timed with every step read: reading costs the same at each step."""

PLANNED = 1_000_000_000
"""Steps that an engine may take to lie before it: a sweep to the floor is worth compiling for."""

Progress = Callable[[float, str], None]
"""Told of the seconds spent and of what comes next."""


@dataclass(kw_only=True, eq=False)
class _Sweep:
    """One method on its way from coarse to fine; the only state that changes while a study runs."""

    label: Label
    scenes: Iterator[Scene]
    next: Scene | None
    points: list[Point]
    arithmetic: Arithmetic
    cost: float = 0.0
    """Seconds of one bare run at the last point."""
    growth: float = 2.0
    """What one point costs, compared with the one before."""
    read: float = 0.0
    first_start: float = 0.0


def study(
    scene: Scene,
    labels: Sequence[Label],
    *,
    budget: float = BUDGET,
    progress: Progress | None = None,
) -> PrecisionStudy:
    """Measure these methods on a scene within about `budget` seconds.

    A method that cannot run, a run that diverges and a sweep that is cut off are points with their
    reason.  Ctrl-C ends the study early; every point that was finished is in what it returns.

    Raises:
        SceneError: the true motion of the scene is not known, or nothing moves in it.
    """
    began = perf_counter()
    known = truth(scene)
    sweeps = [_start(scene, label, known) for label in labels]
    interrupted = False
    try:
        _carry_out(sweeps, known, began, budget, progress)
    except KeyboardInterrupt:
        interrupted = True
    return _put_together(scene, sweeps, known, budget, perf_counter() - began, interrupted)


def _carry_out(
    sweeps: list[_Sweep], known: Truth, began: float, budget: float, progress: Progress | None
) -> None:
    open_sweeps = [sweep for sweep in sweeps if sweep.next is not None]
    while open_sweeps:
        left = budget - (perf_counter() - began)
        ready = _affordable(open_sweeps, left)
        if not ready:
            break
        _level(ready, known, lambda what: progress and progress(perf_counter() - began, what))
        open_sweeps = [sweep for sweep in open_sweeps if sweep.next is not None]
    for sweep in open_sweeps:
        assert sweep.next is not None
        sweep.points.append(
            _blank(sweep.label, sweep.next, "cut off", f"the budget of {budget:g} s ends before it")
        )


def _affordable(sweeps: list[_Sweep], left: float) -> list[_Sweep]:
    """Those whose next point fits into an equal share of what is left; else the cheapest that fits at all.

    A method that waits does not lose its share: when others have reached their floor, it goes on.
    """
    ready = [sweep for sweep in sweeps if _price(sweep) <= left / len(sweeps)]
    if ready:
        return ready
    cheapest = min(sweeps, key=_price)
    return [cheapest] if _price(cheapest) <= left else []


def _repeats(seconds: float) -> int:
    """Timed runs of a point: fewer where one is long, and so averages over more of the machine's noise."""
    return 9 if seconds < 0.02 else 5 if seconds < 0.2 else 3


def _price(sweep: _Sweep) -> float:
    """Seconds that the next point will take: one run for the errors, one to warm up, and the repeats."""
    run = sweep.cost * sweep.growth
    return run * (2 + _repeats(run))


def _start(scene: Scene, label: Label, known: Truth) -> _Sweep:
    """A sweep at its coarsest point, or at its end where the method cannot run."""
    method = engines.method(label)
    plain = replace(scene, quantities=("q", "p"))
    sweep = _Sweep(
        label=label,
        scenes=_adaptive(plain) if method.adaptive else _fixed(plain, SCHEMES[method.scheme].limit, known),
        next=None,
        points=[],
        arithmetic=Arithmetic(),
    )
    reason = engines.refusal(scene, label) or engines.absence(label.engine)
    if reason is None:
        try:
            driver = engines.load(label.engine)
            sweep.arithmetic = driver.arithmetic(label)
            sweep.next = next(sweep.scenes)
            began = perf_counter()
            simulate.bare(sweep.next, label, planned=PLANNED)
            sweep.first_start = perf_counter() - began
        except MethodError as error:
            reason = str(error)
        except Stopped:
            # the sweep will meet this again and make a row of it
            reason = None
    if reason is not None:
        sweep.next = None
        sweep.points.append(_blank(label, None, "cannot run", reason))
    return sweep


def coarsest(known: Truth, limit: float) -> int:
    """The fewest steps worth taking: the first below the limit of stability, or h w = 1 without one."""
    angle = abs(known.duration) * known.w
    within = limit if 0 < limit < np.inf else 1.0
    return max(1, floor(angle / within) + 1 if within == limit else ceil(angle))


def _fixed(scene: Scene, limit: float, known: Truth) -> Iterator[Scene]:
    """The scene in ever more steps, read at the same instants from some 4096 steps on."""
    steps, every = coarsest(known, limit), 1
    while steps < 2**31:
        yield replace(scene, step=known.duration / steps, steps=steps, every=every)
        steps *= 2
        every = every * 2 if steps // every > FRAMES else every


def _adaptive(scene: Scene) -> Iterator[Scene]:
    """The scene at ever smaller tolerances, on a time grid fine enough to see its largest error."""
    finer = max(1, FRAMES // scene.steps)
    h = scene.step / finer
    for tolerance in TOLERANCES:
        yield replace(scene, step=h, steps=scene.steps * finer, every=1, tolerance=tolerance)


def _level(sweeps: list[_Sweep], known: Truth, tell: Callable[[str], object]) -> None:
    """The next point of each of these sweeps: errors one by one, then timings in turn."""
    points: list[Point] = []
    for sweep in sweeps:
        assert sweep.next is not None
        tell(f"{sweep.label}, errors")
        points.append(_errors(sweep, sweep.next, known))
    finished = list(zip(sweeps, points, strict=True))
    tell(f"timing {len(sweeps)} methods in turn")
    timed = _timings([(sweep, sweep.next) for sweep, point in finished if sweep.next and point.outcome == "complete"])
    for sweep, point in finished:
        sweep.points.append(replace(point, **timed.get(str(sweep.label), {})))
        runs = timed.get(str(sweep.label), {}).get("run_repeats")
        if runs:
            before, sweep.cost = sweep.cost, min(runs)
            if engines.method(sweep.label).adaptive and before:
                sweep.growth = max(1.2, sweep.cost / before)
        sweep.next = None if _is_finished(sweep) else next(sweep.scenes, None)


def _is_finished(sweep: _Sweep) -> bool:
    """Whether the error has turned up: clearly, or twice."""
    errors = [point.error for point in sweep.points if point.complete]
    best = fits.turned(errors)
    if best is None or engines.method(sweep.label).adaptive:
        return False
    return errors[-1] > 1.5 * errors[best] or best <= len(errors) - 3


def _errors(sweep: _Sweep, scene: Scene, known: Truth) -> Point:
    """Run for the errors."""
    method = engines.method(sweep.label)
    single = sweep.arithmetic.parameters == "single"
    errors = Errors(
        known,
        scene.step,
        scene.every,
        scheme=SCHEMES[method.scheme],
        judged=mechanics.in_single(known.scene) if single else None,
    )
    record = simulate.play(scene, sweep.label, errors, planned=PLANNED)
    outcome = record.outcome
    if outcome.status == "interrupted":
        raise KeyboardInterrupt
    found = errors.result
    if outcome.status != "complete":
        message = f"after {outcome.step} steps: {outcome.message}"
        return replace(_blank(sweep.label, scene, outcome.status, message), force_calls=record.force_calls)
    if not np.isfinite(found.largest):
        return _blank(sweep.label, scene, "diverged", "the error is beyond the range of numbers")
    return replace(
        _blank(sweep.label, scene, "complete", ""), accuracy=found, force_calls=record.force_calls
    )


def _blank(label: Label, scene: Scene | None, outcome: str, message: str) -> Point:
    adaptive = engines.method(label).adaptive
    return Point(
        method=str(label),
        step=None if scene is None or adaptive else scene.step,
        tolerance=scene.tolerance if scene is not None and adaptive else None,
        steps=None if scene is None or adaptive else scene.steps,
        outcome=outcome,
        message=message,
    )


def tick() -> float:
    """The smallest difference that the clock shows [s]."""
    seen = []
    for _ in range(100):
        began = perf_counter()
        now = perf_counter()
        while now == began:
            now = perf_counter()
        seen.append(now - began)
    return max(min(seen), get_clock_info("perf_counter").resolution)


def _timings(level: list[tuple[_Sweep, Scene]]) -> dict[str, dict[str, tuple[float, ...] | int]]:
    """Bare runs, started afresh, in turn between the methods; the first of each only warms up."""
    shortest = TICKS * tick()
    runs: dict[str, list[simulate.Bare]] = {str(sweep.label): [] for sweep, _ in level}
    reads: dict[str, list[float]] = {str(sweep.label): [] for sweep, _ in level}
    waiting = []
    for sweep, scene in level:
        single = simulate.bare(scene, sweep.label, planned=PLANNED)
        seconds = single.timing.run
        copies = max(1, min(64, ceil(shortest / max(seconds, 1e-9))))
        waiting.append((sweep, scene, copies, _repeats(seconds)))
    for turn in range(max((count for *_, count in waiting), default=0)):
        for sweep, scene, copies, count in waiting:
            if turn < count:
                name = str(sweep.label)
                runs[name].append(simulate.bare(scene, sweep.label, copies=copies, planned=PLANNED))
                if turn < 3 and sweep.read * sweep.growth <= READ_SECONDS:
                    read = simulate.bare(scene, sweep.label, copies=copies, read=True, planned=PLANNED)
                    reads[name].append(read.timing.run)
    for sweep, _ in level:
        sweep.read = min(reads[str(sweep.label)], default=np.inf)
    return {
        name: {
            "run_repeats": tuple(run.timing.run for run in found),
            "start_repeats": tuple(run.timing.start for run in found),
            "read_repeats": tuple(reads[name]),
            "force_calls": found[0].force_calls,
        }
        for name, found in runs.items()
    }


def _put_together(
    scene: Scene, sweeps: list[_Sweep], known: Truth, budget: float, seconds: float, interrupted: bool
) -> PrecisionStudy:
    points = tuple(point for sweep in sweeps for point in sweep.points)
    timed = [point for point in points if point.complete and point.run_repeats]
    return PrecisionStudy(
        scene=scene,
        budget=budget,
        seconds=seconds,
        interrupted=interrupted,
        points=points,
        methods=tuple(_summary(sweep, known) for sweep in sweeps),
        front=tuple(fits.front(timed)),
        cheapest=tuple(Answer(target=target, point=fits.cheapest(timed, target)) for target in TARGETS),
        machine=machine({sweep.label.engine for sweep in sweeps}),
        tick=tick(),
    )


def _summary(sweep: _Sweep, known: Truth) -> MethodSummary:
    method = engines.method(sweep.label)
    points = [point for point in sweep.points if point.complete]
    timed = [point for point in points if point.run_repeats]
    fit = None if method.adaptive else fits.order(points)
    best = fits.turned([point.error for point in points])
    how = fits.condition(method, sweep.arithmetic, abs(known.duration) * known.w)
    finest = [point for point in timed if point.steps and timed[-1].steps and 4 * point.steps >= timed[-1].steps]
    crossing = None
    last = points[-1] if points else None
    if best is None and fit and how and last and last.steps and last.rounding:
        crossing = fits.crossing(fit, last.rounding, last.steps, how, known.duration)
    return MethodSummary(
        method=str(sweep.label),
        order=fit.order if fit else None,
        order_standard_error=fit.standard_error if fit else None,
        order_points=fit.points if fit else 0,
        constant=fit.constant if fit else None,
        floor=points[best].error if best is not None else None,
        floor_steps=points[best].steps if best is not None else None,
        condition=how,
        crossing=crossing,
        seconds_per_step=min((p.seconds / p.steps for p in finest if p.steps), default=None),
        seconds_per_force_call=min((p.seconds / p.force_calls for p in timed[-3:] if p.force_calls), default=None),
        read_seconds_per_step=min(
            (min(p.read_repeats) / p.steps for p in timed if p.read_repeats and p.steps), default=None
        ),
        start_seconds=min((min(p.start_repeats) for p in timed if p.start_repeats), default=None),
        first_start_seconds=sweep.first_start or None,
    )
