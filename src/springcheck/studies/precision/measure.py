"""Error against run time: the accuracy of a method for its work, down to rounding.

Every method of fixed step takes the same duration T in N steps of the double h = T/N, N doubling from the
limit of stability until rounding makes the error grow again, or the time budget ends.  An adaptive solver's
tolerance decreases instead.  Without named methods the scene's are measured, and of the methods that need no
library one of every order and kind.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Any, Unpack

import numpy as np

from springcheck import engines, schemes
from springcheck.engines.contract import Label
from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import LeftOut, choose
from springcheck.studies.keeper import How, Keeper
from springcheck.studies.precision import longtime
from springcheck.studies.precision.accuracy import truth
from springcheck.studies.precision.longtime import LongTime
from springcheck.studies.precision.points import CUT_OFF, POINTS
from springcheck.studies.precision.result import PrecisionStudy
from springcheck.studies.precision.sweeping import Sweeping, begin, level

BUDGET = 45.0
"""Default budget of a study [s]."""


def methods(scene: Scene, patterns: Sequence[str]) -> tuple[list[Label], list[LeftOut]]:
    """The methods to measure, and those left out."""
    chosen, left, others = choose(scene, patterns)
    alone = [x for x in chosen if not engines.engine(x.engine).imports]
    known = {_kind(x) for x in alone}
    for label in [] if patterns else map(engines.parse, others):
        library = engines.engine(label.engine).imports or engines.is_brought(label.engine)
        kind = _kind(label)
        if not library and kind[0] and kind not in known:
            known.add(kind)
            alone.append(label)
    return [*alone, *(x for x in chosen if x not in alone)], left


def _kind(label: Label) -> tuple[int, bool, bool]:
    """Order of a plain deterministic scheme (0 of others), whether it is implicit, and symplectic."""
    scheme = schemes.scheme(engines.method(label).scheme)
    other = scheme.has("random") or scheme.has("mixes") or scheme.has("friction")
    plain = scheme.has("one-step") and scheme.has("named") and not other
    return scheme.order if plain else 0, scheme.has("implicit"), scheme.has("symplectic")


def record(
    scene: Scene, labels: Sequence[Label], path: str | Path | None = None, *, budget: float = BUDGET,
    metric: str = "largest", left: Sequence[LeftOut] = (), **how: Unpack[How],
) -> PrecisionStudy:  # fmt: skip
    """Measure these methods on a scene within about `budget` seconds, without imports, compilation and a
    first run of each method, by which the times of its points are estimated.

    A method that cannot run, a run that diverges and a sweep that the budget cuts off are points with their
    reason.  Points that an earlier call has finished are reused, and their time counts for the budget.

    Raises SceneError: the exact solution of the scene is not known, or nothing moves in it.
    """
    measure = partial(_measure, scene, labels, budget, metric, left)
    return keeper.study("precision", path, labels, measure, scene=scene, **how)


def _measure(
    scene: Scene, labels: Sequence[Label], budget: float, metric: str, left: Sequence[LeftOut], kept: Keeper
) -> PrecisionStudy:
    known = truth(scene)
    began = np.inf

    def tell(what: str) -> None:
        if kept.progress:
            kept.progress(min(max(perf_counter() - began, 0.0), budget), budget, what)

    sweeps: list[Sweeping] = []
    for label in labels:
        tell(f"starting {label}")
        sweeps.append(begin(scene, label, known))
        for point in kept.finished(POINTS, str(label)) or ():
            # points that the end of that call cut off are measured by this one
            if point.outcome != CUT_OFF and sweeps[-1].scene is not None:
                sweeps[-1].take(point)
                kept.resumed += 1
        kept.say(sweeps[-1].line(metric))
    spent = sum(sweep.spent for sweep in sweeps)
    # the first run of a method pays for imports and compilation, outside the budget
    began = perf_counter() - spent
    while ready := _ready(sweeps, budget - (perf_counter() - began)):
        now = perf_counter()
        level(ready, known, tell)
        if perf_counter() < now:
            raise SpringcheckError("the clock of this machine runs backwards: nothing can be timed by it")
        for sweep in ready:
            kept.keep(POINTS, str(sweep.label), sweep.points)
            kept.say(sweep.line(metric))
    for sweep in sweeps:
        if sweep.scene is not None:
            sweep.points.append(sweep.point(CUT_OFF, f"the budget of {budget:g} s ends before it"))
        kept.keep(POINTS, str(sweep.label), sweep.points)
    return PrecisionStudy(
        scene=scene, metric=metric, budget=budget, seconds=perf_counter() - began,
        points=tuple(x for sweep in sweeps for x in sweep.points), machine=keeper.origin(labels),
        python_call=_python_call(scene), left_out=tuple(left),
    )  # fmt: skip


def _ready(sweeps: Sequence[Sweeping], seconds: float) -> list[Sweeping]:
    """The sweeps whose next point fits into an equal share of all seconds; what some cannot use is the
    others'."""
    going = [x for x in sweeps if x.scene is not None]
    while going:
        share = (seconds + sum(x.spent for x in going)) / len(going)
        dearest = max(going, key=lambda x: x.spent + x.price)
        if dearest.spent + dearest.price <= share:
            break
        going.remove(dearest)
    return going


def _python_call(scene: Scene) -> float:
    """Least seconds of a force evaluated in Python, as solvers that call back do it."""
    times = []
    for _ in range(200):
        began = perf_counter()
        scene.system.force(scene.q, scene.p)
        times.append(perf_counter() - began)
    return min(times)


def perform(options: Namespace, progress: Progress | None) -> PrecisionStudy | LongTime:
    """Carry out `springcheck precision`."""
    budget = BUDGET if options.budget is None else options.budget
    for name, x in (("budget", budget), ("long", options.long), ("step", options.step)):
        if x is not None and not (isfinite(x) and x > 0):
            raise SpringcheckError(f"--{name} {x}: a number above 0 is needed")
    scene = scenefile.load_scene(options.scene)
    labels, left = methods(scene, options.method)
    how: Any = {
        "budget": budget, "metric": options.metric, "left": left, "force": options.force,
        "progress": progress,
    }  # fmt: skip
    if options.long is None:
        if options.step is not None:
            raise SpringcheckError("--step goes with --long: otherwise steps of every length are measured")
        return record(scene, labels, options.output or f"{scene.name}-precision.h5", **how)
    scene = scene if options.step is None else scene.derived(step=options.step)
    path = options.output or f"{scene.name}-long.h5"
    return longtime.record(scene, labels, path, periods=options.long, **how)
