"""The checks: one function each, one number against one bound, and the bound's reason.

A check looks at a recorded trajectory, or at a piece of one.  The first line of its docstring is its
sentence in the report.  Bounds are formulas: roundings counted along one step, times what the map can
make of them.  Values and bounds of the rounding checks are in units of one rounding of what was added
up, so that "4.1 of 19" reads: four roundings were seen where nineteen take place.

`recorded` holds the checks of a trajectory, `experiments` those that need runs of their own.

Prior art: the exact discrete solution of one's own solver (Langtangen & Linge, Finite Difference
Computing with PDEs, 2017); the step defect, taken in extended precision at every step, does not need
the solution and holds for nonlinear scenes too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from springcheck.checks.bench import Bench, Run
from springcheck.checks.case import Case
from springcheck.checks.experiments import (
    determinant,
    mirror,
    propagator,
    repeatability,
    reversibility,
    symplecticity,
)
from springcheck.checks.laws import convergence, order, order_anharmonic, rounding_bias, rounding_growth
from springcheck.checks.recorded import (
    CONTRACTED,
    arithmetic,
    closed_form,
    energies,
    fastest,
    frequency,
    growth_bound,
    line,
    momentum,
    shadow_energy,
    start,
    step_defect,
    times,
    tolerance,
    tolerance_bound,
)
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene
from springcheck.trajectory import Trajectory, Verdict

__all__ = [
    "CHECKS",
    "CONTRACTED",
    "THOROUGH",
    "Bench",
    "Case",
    "Check",
    "Experiment",
    "Run",
    "fastest",
    "growth_bound",
    "judge",
    "judge_thoroughly",
    "name",
    "tolerance_bound",
    "worst",
]

Check: TypeAlias = Callable[[Case], Verdict]
Experiment: TypeAlias = Callable[[Bench], Verdict]

CHECKS: tuple[Check, ...] = (
    start,
    times,
    line,
    step_defect,
    arithmetic,
    closed_form,
    shadow_energy,
    frequency,
    momentum,
    energies,
    tolerance,
)


THOROUGH: tuple[Experiment, ...] = (
    propagator,
    determinant,
    symplecticity,
    reversibility,
    mirror,
    repeatability,
    order,
    order_anharmonic,
    rounding_bias,
    rounding_growth,
    convergence,
)


def name(check: Check | Experiment) -> str:
    """What a check is called in a report."""
    return check.__name__.replace("_", "-")


def judge_thoroughly(
    scene: Scene,
    label: str,
    run: Run,
    experiments: Sequence[Experiment] = THOROUGH,
    *,
    progress: Callable[[int], None] | None = None,
) -> list[Verdict]:
    """Every experiment with a method, which `run(scene, label)` carries out on scenes made here.

    `progress(1)` is called after each experiment.

    An experiment whose scene the method cannot serve (`run` raises MethodError) does not apply.
    """
    bench = Bench(scene=scene, label=label, run=run)
    verdicts = []
    for experiment in experiments:
        try:
            verdicts.append(experiment(bench))
        except MethodError as error:
            verdicts.append(bench.not_applicable(name(experiment), str(error)))
        if progress:
            progress(1)
    return verdicts


def judge(scene: Scene, trajectory: Trajectory, checks: Sequence[Check] = CHECKS) -> list[Verdict]:
    """Every check of a trajectory of this scene; what does not apply is among them, `passed` None."""
    case = Case(trajectory=trajectory, scene=scene)
    return [check(case) for check in checks]


def worst(pieces: Sequence[Sequence[Verdict]]) -> list[Verdict]:
    """Of the verdicts on the pieces of one trajectory, the worst of each check."""
    out: list[Verdict] = []
    for same in zip(*pieces, strict=True):
        judged = [verdict for verdict in same if verdict.passed is not None]
        out.append(max(judged, key=_badness) if judged else same[0])
    return out


def _badness(verdict: Verdict) -> tuple[bool, float]:
    ratio = verdict.value / verdict.bound if verdict.bound else verdict.value
    return (not verdict.passed, ratio if np.isfinite(ratio) else np.inf)
