"""The checks: each holds one number against one bound, and states the reason of the bound.

A check examines a recorded trajectory, or a piece of one.  Bounds are formulas: roundings counted along one
step, times their growth under the map.  Values and bounds of the rounding checks are in units of one rounding
of what was added up, so that "4.1 of 19" reads: four roundings were seen where nineteen take place.

`record`, `steps`, `motion` and `solver` hold the checks of a trajectory, `experiments` and `laws`
those that need runs of their own; `sight` derives the limit of detection of each, `drag` adds up what single
steps hide.  A check is an object (see `Check`); the two lists here are the only ones.

Prior art: the exact discrete solution of one's own solver (Langtangen & Linge, Finite Difference Computing
with PDEs, 2017); the step defect, taken in extended precision at every step, does not need the solution and
holds for nonlinear scenes too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from springcheck.checks import bath, experiments, laws
from springcheck.checks.bench import Bench, Run
from springcheck.checks.case import Case
from springcheck.checks.check import DECADES, Check, over_pieces, shared
from springcheck.checks.driven import drive
from springcheck.checks.motion import (
    angular_momentum,
    closed_form,
    frequency,
    momentum,
    shadow_energy,
)
from springcheck.checks.record import energies, grid, line, start, times
from springcheck.checks.requires import CONTRACTED
from springcheck.checks.solver import tolerance, tolerance_bound
from springcheck.checks.steps import BLIND, are_differences, arithmetic, bridges, seldom_off, step_defect
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Limits, Trajectory, Verdict
from springcheck.text.wording import DIAGNOSIS, count, few

__all__ = [
    "ALL", "BLIND", "CHECKS", "CONTRACTED", "RANDOM", "DIAGNOSIS", "TELLING", "THOROUGH",
    "Bench", "Case", "Check", "Run", "angular_momentum", "are_differences", "arithmetic", "bridges",
    "cause_of", "closed_form", "energies", "experiments_of", "first_off", "frequency", "judge",
    "judge_thoroughly", "momentum", "not_judged", "shadow_energy", "shared", "start", "status", "step_defect",
    "summary", "tolerance", "tolerance_bound", "worst",
]  # fmt: skip

CHECKS: tuple[Check, ...] = (
    start, times, grid, line, step_defect, arithmetic, closed_form, shadow_energy, frequency, momentum,
    angular_momentum, drive, energies, tolerance,
)  # fmt: skip

THOROUGH: tuple[Check, ...] = (
    experiments.propagator, experiments.determinant, experiments.symplecticity, experiments.reversibility,
    experiments.mirror, experiments.orientation, experiments.repeatability, experiments.company, laws.order,
    laws.order_anharmonic, laws.rounding_bias, laws.rounding_growth, laws.convergence,
)  # fmt: skip

ALL: tuple[Check, ...] = (*CHECKS, *THOROUGH)

RANDOM: tuple[Check, ...] = (start, times, grid, energies, *bath.DRAWN)
"""Checks of a thermostat's trajectory, to which no law of deterministic motion applies."""

TELLING = frozenset(["identified", *(one.name for one in (*ALL, *bath.DRAWN) if one.telling)])
"""Checks that distinguish the scheme that a method claims from others; `identified` is of a file's states."""

MOST_NAMED = 8
"""Most methods or checks that a summary names."""


def not_judged(verdicts: Sequence[Verdict]) -> tuple[str, ...]:
    """Methods with verdicts, none of which is by a check that distinguishes schemes."""
    told = {v.method for v in verdicts if v.passed is not None and v.check in TELLING}
    return tuple(dict.fromkeys(v.method for v in verdicts if v.method not in told))


def status(verdicts: Sequence[Verdict]) -> Literal[0, 1, 2]:
    """Exit status: 0 all passed, 1 some verdict failed, 2 nothing measured, or a method not judged."""
    if any(verdict.passed is False for verdict in verdicts):
        return 1
    return 2 if not_judged(verdicts) or not verdicts else 0


def summary(verdicts: Sequence[Verdict]) -> str:
    """How many verdicts passed, or which failed, in words: the last line of every report."""
    failed = [verdict for verdict in verdicts if verdict.passed is False]
    judged = sum(1 for verdict in verdicts if verdict.passed is not None)
    rest = len(verdicts) - judged
    beside = f", {rest} not applicable" if rest else ""
    if not failed:
        return f"{count(judged, 'verdict')} passed, 0 failed{beside}"
    methods = list(dict.fromkeys(verdict.method for verdict in failed))
    whose = {verdict.method for verdict in verdicts}
    names = methods if len(whose) > 1 else list(dict.fromkeys(verdict.check for verdict in failed))
    return f"{len(failed)} of {judged} failed: {few(names, MOST_NAMED)}{beside}"


def explained(
    scene: Scene,
    run: Trajectory,
    verdicts: Sequence[Verdict],
    shown: Callable[[Scene, Trajectory, int, bool], str],
) -> list[Verdict]:
    """The verdicts, the first failed one with its cause appended, by the states around its first step off.

    `shown(scene, run, frame, few)` is that sentence, "" where the states show nothing; if few steps are wrong
    it is of these alone.
    """
    first = next((v for v in verdicts if v.passed is False and v.check in TELLING), None)
    if first is None:
        return list(verdicts)
    frame, few = seldom_off(Case(trajectory=run, scene=scene))
    with np.errstate(all="ignore"):
        said = shown(scene, run, frame, bool(few)) or few
    why = f"{first.why}{DIAGNOSIS}{said}" if said else first.why
    return [replace(v, why=why) if v is first else v for v in verdicts]


def first_off(scene: Scene, run: Trajectory) -> int:
    """The number of the first step of a run that is not the scheme's own; 0 where none is."""
    case = Case(trajectory=run, scene=scene)
    frame = seldom_off(case)[0]
    return int(case.steps[frame - 1]) + 1 if frame else 0


def cause_of(verdicts: Sequence[Verdict]) -> str:
    """What the states show to be the cause of a failure; "" where that is unknown, or nothing failed."""
    return next((v.why.partition(DIAGNOSIS)[2] for v in verdicts if DIAGNOSIS in v.why), "")


def experiments_of(scene: Scene) -> tuple[Check, ...]:
    """The experiments with a method of this scene: in a bath those with the seeds of a random one."""
    if not scene.bath:
        return THOROUGH
    from springcheck.checks.seeds import SEEDED

    return SEEDED


def judge_thoroughly(
    scene: Scene, label: str, run: Callable[..., Trajectory], experiments: Sequence[Check] | None = None, *,
    seed: int = 0, progress: Callable[[int], None] | None = None,
) -> list[Verdict]:  # fmt: skip
    """Every experiment with a method, whose runs `run(scene, label)` carries out.

    In a bath it is `run(scene, label, seed=)`, with `seed` and others.  `progress(1)` is called after each
    experiment; one that the method cannot serve (MethodError) does not apply.
    """
    if scene.bath:
        from springcheck.checks.seeds import Seeded

        bench: Any = Seeded(scene=scene, label=label, seed=seed, play=run)
    else:
        bench = Bench(scene=scene, label=label, run=run)
    verdicts = []
    for experiment in experiments_of(scene) if experiments is None else experiments:
        verdicts.append(experiment(bench))
        if progress:
            progress(1)
    return shared(verdicts)


def judge(
    scene: Scene, trajectory: Trajectory, checks: Sequence[Check] | None = None, *, piece: bool = False
) -> list[Verdict]:
    """Verdicts of all checks on a trajectory of this scene, or on a piece that may begin after the start.

    Checks that do not apply are included, `passed` None.  By default they follow from the scheme's kind.
    """
    case = Case(trajectory=trajectory, scene=scene, piece=piece)
    if (random := case.law.has("random")) and scene.bath is None:
        raise MethodError(
            f"{trajectory.scheme} needs a heat bath, and scene {scene.name} has none: add [bath] to it"
        )
    return shared([one(case) for one in ((RANDOM if random else CHECKS) if checks is None else checks)])


def not_exercised(scene: Scene) -> str:
    """Features of an engine that this scene does not exercise, so that a pass proves nothing of them.

    Empty for circuits.
    """
    if scene.kind != "particles":
        return ""
    system = scene.system
    pulled = np.abs(scene.p) + np.abs(system.force_of(scene.terms)(scene.q, scene.p)) + scene.thermal > 0
    for term in scene.terms:
        # a particle at rest without a force at the start may be driven later, as by the heat of a bath
        if term.kind == "drive":
            pulled[np.concatenate(term.particles)] = True
    moved = np.bincount(scene.all_places[pulled] % 3, minlength=3)
    missing = [axis for axis, number in zip("xyz", moved, strict=True) if not number]
    facts = {
        f"ax{'e' if len(missing) > 1 else 'i'}s {' and '.join(missing)}": not missing,
        "friction": bool(system.is_damped or scene.bath),
        "drives": system.is_driven,
    }
    names = [name for name, is_so in facts.items() if not is_so]
    return f"Not exercised here: {', '.join(names)}" if names else ""


def worst(pieces: Sequence[Sequence[Verdict]]) -> list[Verdict]:
    """The worst verdict of each check, among those on the pieces of one trajectory."""
    out: list[Verdict] = []
    for same in zip(*pieces, strict=True):
        judged = [verdict for verdict in same if verdict.passed is not None]
        if not judged:
            out.append(same[0])
            continue
        verdict = max(judged, key=_badness)
        sees = Limits.least(one.sees for one in judged)
        # name the first failure, and the size of the worst
        failed = [one for one in judged if one.passed is False]
        why = (failed or [verdict])[0].why
        if len(failed) > 1:
            # the first sentence counts the frames of its own piece alone
            why += f"; of {len(judged)} pieces of the run {len(failed)} fail"
        if verdict.unit == DECADES:
            verdict = over_pieces(replace(verdict, why=why), judged)
            why = verdict.why
        out.append(replace(verdict, why=why, sees=sees))
    return out


def _badness(verdict: Verdict) -> tuple[bool, float]:
    ratio = verdict.value / verdict.bound if verdict.bound else verdict.value
    return (not verdict.passed, ratio if np.isfinite(ratio) else np.inf)
