"""Error against run time: the accuracy of a method for its work, down to rounding.

Every method of fixed step takes the same duration T in N steps of the double h = T/N, N doubling from the
limit of stability until rounding makes the error grow again, or the time budget ends.  An adaptive solver's
tolerance decreases instead.  Errors and times are measured in separate runs.  Timed runs record nothing;
methods take turns, so that a machine that slows down slows all alike.  The design follows the work-precision
diagrams of DiffEqDevTools (SciML): one warm-up, and the minimum of the repeats is quoted.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Unpack

import numpy as np

from springcheck import driver, engines
from springcheck.engines.contract import Label
from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.schemes import scheme
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import LeftOut, choose
from springcheck.studies.keeper import How, Keeper
from springcheck.studies.precision import fits
from springcheck.studies.precision.accuracy import Errors, Truth, truth
from springcheck.studies.precision.fits import POINTS, Point, points_of
from springcheck.studies.precision.result import MethodSummary, PrecisionStudy
from springcheck.studies.precision.sweeps import PLANNED, Sweep, begin, blank, fitting, price, take, to_time
from springcheck.studies.precision.timing import Clock, take_turns, tick
from springcheck.text.wording import count, duration

BUDGET = 75.0
"""Default budget of a study [s]."""

CUT_OFF = "cut off"
"""Outcome of the first point for which the budget did not suffice."""


def record(
    scene: Scene,
    labels: Sequence[Label],
    path: str | Path | None = None,
    *,
    budget: float = BUDGET,
    left: Sequence[LeftOut] = (),
    **how: Unpack[How],
) -> PrecisionStudy:
    """Measure these methods on a scene within about `budget` seconds, without imports, compilation and a
    first run of each method, by which the times of its points are estimated.

    A method that cannot run, a run that diverges and a sweep that the budget cuts off are points with their
    reason; methods `left` out are listed beside them.  A store has a table /precision/<label> for each
    method, saved point by point.  Points that an earlier call has finished are reused, and their time counts
    for the budget.

    Raises:
        SceneError: the exact solution of the scene is not known, or nothing moves in it.
    """
    measure = partial(_measure, scene, labels, budget, left)
    return keeper.study("precision", path, labels, measure, scene=scene, **how)


def _measure(
    scene: Scene, labels: Sequence[Label], budget: float, left: Sequence[LeftOut], kept: Keeper
) -> PrecisionStudy:
    known, form = truth(scene), points_of(scene)
    sweeps = [begin(scene, label, known) for label in labels]
    able = _open(sweeps)
    before = [_resume(sweep, kept) for sweep in able]
    kept.resumed = sum(len(sweep.points) for sweep in able)
    spent = max(before, default=0.0)
    if kept.team.workers > 1:
        spent += _errors_first(scene, able, kept, budget, spent)
    # the first method that needs an import or a compilation pays for it, outside its points
    began = perf_counter() - spent

    def tell(what: str) -> None:
        if kept.progress:
            kept.progress(min(perf_counter() - began, budget), budget, what)

    while ready := fitting(_open(sweeps), known, budget - (perf_counter() - began)):
        now = perf_counter()
        _level(ready, known, tell)
        if perf_counter() < now:
            raise SpringcheckError("the clock of this machine runs backwards: nothing can be timed by it")
        for sweep in ready:
            kept.keep(form, str(sweep.label), sweep.points, study_seconds=perf_counter() - began)
    for sweep in _open(sweeps):
        while sweep.scene is not None and sweep.known is not None:
            # its time could not be measured
            take(sweep, sweep.known)
    for sweep in _open(sweeps):
        ends = f"the budget of {budget:g} s ends before it, which takes about {duration(price(sweep))}"
        sweep.points.append(blank(sweep, CUT_OFF, ends))
    seconds = perf_counter() - began
    for sweep in sweeps:
        kept.keep(form, str(sweep.label), sweep.points, study_seconds=seconds)
    found = PrecisionStudy(
        scene=scene,
        methods=tuple(
            MethodSummary(
                method=str(x.label), points=tuple(x.points), duration=known.duration,
                condition=x.condition, first_start_seconds=x.first_start,
            )
            for x in sweeps
        ),
        budget=budget,
        seconds=seconds,
        machine=keeper.origin([sweep.label for sweep in sweeps]),
        tick=tick(),
        left_out=tuple(left),
    )  # fmt: skip
    kept.add(found.summary())
    return found


def _errors_first(scene: Scene, sweeps: list[Sweep], kept: Keeper, budget: float, before: float) -> float:
    """Measure the errors of these sweeps on the workers, within half of the budget -> seconds that each took.

    Workers measure no run times.  They have ended when this returns, so that times are measured with no other
    process of the study running.
    """
    left = [x for x in sweeps if x.scene is not None and x.known is None]
    share = budget / 2 * kept.team.workers / max(1, len(left))
    spent = 0.0
    parts = [partial(errors_ahead, scene, sweep.label, sweep.points, share) for sweep in left]
    with closing(kept.carried_out(parts)) as measured:
        for j, points in measured:
            sweep = left[j]
            sweep.ahead.update({x.place: x for x in points})
            spent += sum(point.spent_seconds for point in points) / kept.team.workers
            both, took = [*sweep.points, *points], before + spent
            kept.keep(points_of(scene), str(sweep.label), both, study_seconds=took)
            if kept.progress:
                kept.progress(min(before + spent, budget), budget, f"{sweep.label}, errors")
    return spent


def errors_ahead(scene: Scene, label: Label, done: Sequence[Point], seconds: float) -> list[Point]:
    """Points of a method after those that are done, with errors and without times."""
    known = truth(scene)
    sweep = begin(scene, label, known)
    for point in done:
        if sweep.scene is not None:
            take(sweep, point)
    found: list[Point] = []
    began = last = perf_counter()
    while sweep.scene is not None:
        point = replace(_errors(sweep, known), spent_seconds=perf_counter() - last)
        found.append(point)
        take(sweep, point)
        now = perf_counter()
        # the next one has twice as many steps
        if not point.complete or now - began + 2 * (now - last) > seconds:
            break
        last = now
    return found


def _resume(sweep: Sweep, kept: Keeper) -> float:
    """Resume a sweep from the points of an earlier call -> the seconds that these had taken."""
    points = kept.finished(POINTS, str(sweep.label))
    if points is None:
        return 0.0
    for point in points:
        if point.complete and not point.run_seconds_repeats:
            sweep.ahead[point.place] = point
        # points that the end of that call cut off are measured by this one
        elif point.outcome != CUT_OFF:
            take(sweep, point)
    return float(kept.attribute(POINTS, str(sweep.label), "study_seconds"))


def perform(options: Namespace, progress: Progress | None) -> PrecisionStudy:
    """Carry out `springcheck precision`."""
    budget = BUDGET if options.budget is None else options.budget
    if not (isfinite(budget) and budget > 0):
        raise SpringcheckError(f"--budget {budget}: a number of seconds above 0 is needed")
    scene = scenefile.load_scene(options.scene)
    labels, left, _ = choose(scene, options.method)
    path = options.output or f"{scene.name}-precision.h5"
    return record(scene, labels, path, budget=budget, left=left, **keeper.how(options, progress))


def _open(sweeps: list[Sweep]) -> list[Sweep]:
    return [sweep for sweep in sweeps if sweep.scene is not None]


def _level(sweeps: list[Sweep], known: Truth, tell: Callable[[str], None]) -> None:
    """Measure the next point of each of these sweeps: errors one by one, then timings in turn."""
    clocks: list[Clock] = []
    for sweep in sweeps:
        tell(f"{sweep.label}, errors")
        began = perf_counter()
        point = sweep.known or _errors(sweep, known)
        spent = perf_counter() - began
        clocks.append(Clock(sweep=sweep, scene=to_time(known.scene, sweep), point=point, spent=spent))
    tell(f"timing {count(len(sweeps), 'method')} in turn")
    take_turns([clock for clock in clocks if clock.point.complete])
    for clock in clocks:
        take(clock.sweep, clock.timed)


def _errors(sweep: Sweep, known: Truth) -> Point:
    """Measure the errors of the next point."""
    scene = sweep.scene
    assert scene is not None
    single = engines.arithmetic(sweep.label).parameters == "single"
    judged = known.scene.system.in_single if single else known.scene
    errors = Errors(known, scene.step, scene.every, scheme=scheme(sweep.method.scheme), judged=judged)
    record = driver.play(scene, sweep.label, errors, planned=PLANNED)
    outcome = record.outcome
    if outcome.status != "complete":
        message = f"after {count(outcome.step, 'step')}: {outcome.message}"
        return replace(blank(sweep, outcome.status, message), force_calls=record.force_calls)
    found = errors.result
    if not (np.isfinite(found.max_error) and np.isfinite(found.energy_error)):
        return blank(sweep, "diverged", "the error is beyond the range of numbers")
    return replace(blank(sweep, "complete"), accuracy=found, force_calls=record.force_calls)


@keeper.restoring("precision")
def stored(kept: keeper.Kept) -> PrecisionStudy:
    """The study that `record` has saved.  StoreError where the file holds none."""
    scene, known = keeper.stored_scene(kept.path), kept.document
    methods = [
        MethodSummary(
            method=one["method"],
            points=tuple(kept.found(POINTS, one["method"])),
            duration=scene.step * scene.steps,
            condition=fits.Condition(**how) if (how := one["floor_condition"]) else None,
            first_start_seconds=one["first_start_seconds"],
        )
        for one in known["methods"]
    ]
    return PrecisionStudy(
        scene=scene,
        methods=tuple(methods),
        budget=known["budget_seconds"],
        seconds=known["seconds"],
        machine=known["machine"],
        tick=known["clock_seconds"],
    )
