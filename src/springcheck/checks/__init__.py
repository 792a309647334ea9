"""The checks: each holds one number against one bound, and gives the bound's reason.

A check looks at a recorded trajectory, or at a piece of one.  Bounds are formulas: roundings counted along
one step, times what the map can make of them.  Values and bounds of the rounding checks are in units of one
rounding of what was added up, so that "4.1 of 19" reads: four roundings were seen where nineteen take
place.

`record`, `steps`, `motion` and `solver` hold the checks of a trajectory, `experiments` and `laws` those
that need runs of their own; `sight` says of each what it would have seen, `drag` adds up what single steps
hide.  A check is an object (see `Check`); the two lists here are the only ones.

Prior art: the exact discrete solution of one's own solver (Langtangen & Linge, Finite Difference
Computing with PDEs, 2017); the step defect, taken in extended precision at every step, does not need
the solution and holds for nonlinear scenes too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, TypeAlias

import numpy as np

from springcheck.checks import check, experiments, laws
from springcheck.checks.bench import Bench, Run
from springcheck.checks.case import Case
from springcheck.checks.motion import closed_form, frequency, momentum, shadow_energy
from springcheck.checks.record import energies, grid, line, start, times
from springcheck.checks.solver import tolerance, tolerance_bound
from springcheck.checks.steps import CONTRACTED, arithmetic, first_off, step_defect
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Limits, Trajectory, Verdict

__all__ = [
    "ALL", "CHECKS", "CONTRACTED", "TELLING", "THOROUGH", "Bench", "Case", "Check", "Experiment", "Run",
    "arithmetic", "closed_form", "energies", "first_off", "frequency", "judge",
    "judge_thoroughly", "momentum", "not_judged", "shadow_energy", "start", "status", "step_defect",
    "tolerance", "tolerance_bound", "worst",
]  # fmt: skip

Check: TypeAlias = check.Check[Case]
Experiment: TypeAlias = check.Check[Bench]

CHECKS: tuple[Check, ...] = (
    start,
    times,
    grid,
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
    experiments.propagator,
    experiments.determinant,
    experiments.symplecticity,
    experiments.reversibility,
    experiments.mirror,
    experiments.repeatability,
    experiments.company,
    laws.order,
    laws.order_anharmonic,
    laws.rounding_bias,
    laws.rounding_growth,
    laws.convergence,
)

ALL: tuple[check.Check[Any], ...] = (*CHECKS, *THOROUGH)


_TELLING = [one.name for one in ALL if one.family in ("motion", "map", "law") and one is not momentum]
TELLING = frozenset(["identified", *_TELLING])
"""Checks that tell the scheme that a method claims from another one; `identified` is of a file's states."""


def not_judged(verdicts: Sequence[Verdict]) -> tuple[str, ...]:
    """Methods of which there are verdicts, but none by a check that tells one scheme from another."""
    told = {v.method for v in verdicts if v.passed is not None and v.check in TELLING}
    return tuple(dict.fromkeys(v.method for v in verdicts if v.method not in told))


def status(verdicts: Sequence[Verdict]) -> Literal[0, 1, 2]:
    """Exit status: 0 all passed, 1 some verdict failed, 2 nothing measured, or a method not judged."""
    if any(verdict.passed is False for verdict in verdicts):
        return 1
    return 2 if not_judged(verdicts) or not verdicts else 0


def judge_thoroughly(
    scene: Scene,
    label: str,
    run: Run,
    experiments: Sequence[Experiment] = THOROUGH,
    *,
    progress: Callable[[int], None] | None = None,
) -> list[Verdict]:
    """Every experiment with a method, which `run(scene, label)` carries out on scenes made here.

    `progress(1)` is called after each; one that the method cannot serve (MethodError) does not apply.
    """
    bench = Bench(scene=scene, label=label, run=run)
    verdicts = []
    for experiment in experiments:
        try:
            verdicts.append(experiment(bench))
        except MethodError as error:
            verdicts.append(check.verdict(label, experiment.name, str(error)))
        if progress:
            progress(1)
    return verdicts


def judge(
    scene: Scene, trajectory: Trajectory, checks: Sequence[Check] = CHECKS, *, piece: bool = False
) -> list[Verdict]:
    """Every check of a trajectory of this scene, or of a piece of one, which may begin after the start.

    What does not apply is among them, `passed` None.
    """
    case = Case(trajectory=trajectory, scene=scene, piece=piece)
    return [check(case) for check in checks]


def worst(pieces: Sequence[Sequence[Verdict]]) -> list[Verdict]:
    """Of the verdicts on the pieces of one trajectory, the worst of each check."""
    out: list[Verdict] = []
    for same in zip(*pieces, strict=True):
        judged = [verdict for verdict in same if verdict.passed is not None]
        if not judged:
            out.append(same[0])
            continue
        verdict = max(judged, key=_badness)
        sees = Limits.least(one.sees for one in judged)
        # where it fails first is what is looked for, and how badly at the worst
        failed = next((one for one in judged if one.passed is False), verdict)
        out.append(replace(verdict, why=failed.why, sees=sees))
    return out


def _badness(verdict: Verdict) -> tuple[bool, float]:
    ratio = verdict.value / verdict.bound if verdict.bound else verdict.value
    return (not verdict.passed, ratio if np.isfinite(ratio) else np.inf)
