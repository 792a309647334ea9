"""Which trajectories are the same motion, and how closely: differences of every pair, over all frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np

from springcheck.checks.case import Case
from springcheck.checks.solver import tolerance_bound
from springcheck.checks.steps import fastest, step_defect
from springcheck.checks.stretch import DEVIATIONS
from springcheck.physics import exact
from springcheck.physics.arrays import Arithmetic, Extended, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Comparison, Trajectory

EXACT = "exact"
"""The label of the exact solution among the others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Same:
    """Trajectories that are one motion: no two of them differ by more than `allowed`."""

    labels: tuple[str, ...]
    difference: float
    allowed: float
    within: Literal["rounding", "tolerance"] = "rounding"
    """What allows it: rounding alone, or the tolerance of some adaptive solver among them."""


def compare(scene: Scene, pieces: Mapping[str, Trajectory]) -> Comparison:
    """Compare trajectories, or pieces of them over the same frames, with each other and the exact one."""
    norm = scene.system.norm
    states: dict[str, tuple[Extended | Floats, Extended | Floats]] = {}
    longest = max(pieces.values(), key=lambda piece: len(piece.t), default=None)
    if longest is not None and exact.has_true_motion(scene):
        steps = Case(trajectory=longest, scene=scene).steps
        states[EXACT] = exact.true_motion(scene, steps, longest.step)
    frames = len(longest.t) if longest is not None else 0
    states.update((label, (piece.q, piece.p)) for label, piece in pieces.items())
    labels = tuple(states)
    out = np.zeros((len(labels), len(labels)))
    for i, a in enumerate(labels):
        for j, b in enumerate(labels[:i]):
            (qa, pa), (qb, pb) = states[a], states[b]
            whole = len(qa) == len(qb) == frames
            out[i, j] = out[j, i] = np.max(norm(qa - qb, pa - pb)) if whole else np.nan
    return Comparison(labels=labels, max_difference=out)


def merge(comparisons: Sequence[Comparison]) -> Comparison:
    """The comparison of whole trajectories from those of their pieces."""
    worst = np.max([comparison.max_difference for comparison in comparisons], axis=0)
    return Comparison(labels=comparisons[0].labels, max_difference=np.asarray(worst))


def allowed(scene: Scene, trajectory: Trajectory) -> float:
    """How far rounding, or the tolerance, may take a trajectory from the motion that it stands for."""
    case = Case(trajectory=trajectory, scene=scene)
    if not case.scheme.has("one-step"):
        return tolerance_bound(case)
    if len(trajectory.t) < 2:
        return 0.0
    if case.linear:
        bound, unit = case.growth
        # before the first step there is nothing to round
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            sizes = np.asarray(unit / case.system.norm.unit, np.float64)
            return float(np.max((bound * sizes)[case.steps > 0], initial=0.0))
    # roundings shift the energy, and with it the frequency of an anharmonic motion: as random ones do where
    # they walk, and coefficients, which are rounded once, turn the phase at every step alike
    steps = float(case.steps[-1])
    rounding = float(np.max(case.system.norm.most(*case.allowance) / case.system.norm.unit))
    turn = fastest(case) * abs(trajectory.step)
    walk = float(case.walk(np.array([steps]), turn)[0]) + DEVIATIONS * steps**1.5 * turn / 2
    return float(rounding * min(case.roundings * steps * (1 + steps * turn / 2), walk))


def _telling(scene: Scene, trajectory: Trajectory) -> float:
    """`allowed`, or NaN where it is no small part of the motion: then nothing can be said of it."""
    limit = allowed(scene, trajectory)
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.max(scene.system.norm(trajectory.q - scene.q, trajectory.p - scene.p))
    return limit if np.isfinite(limit) and limit <= 1e-3 * max(float(size), 1.0) else np.nan


def same_motions(scene: Scene, trajectories: Mapping[str, Trajectory], comparison: Comparison) -> list[Same]:
    """Groups of trajectories of which every two are one motion, largest group first.

    Within rounding: their difference is no larger than rounding allows, and where their schemes differ each
    of them takes the other's steps, to rounding.  Within a tolerance: an adaptive solver is among them, and
    the difference is no larger than its tolerance allows.
    """
    runs = {label: run for label, run in trajectories.items() if len(run.t) > 1}
    limits = {label: _telling(scene, run) for label, run in runs.items()}
    if EXACT in comparison.labels and runs:
        known = max(exact.uncertainty(scene, float(run.t[-1])) for run in runs.values())
        runs[EXACT], limits[EXACT] = _exact(scene, next(iter(runs.values()))), known
    loose = {label for label, run in runs.items() if _is_adaptive(scene, run)}
    found: list[Same] = []
    for within in ("rounding", "tolerance"):
        groups: list[list[str]] = []
        for label in comparison.labels:
            if label not in runs or (within == "rounding" and label in loose):
                continue
            joined = [
                group
                for group in groups
                if all(_is_near(scene, runs, limits, comparison, (label, other)) for other in group)
            ]
            if joined:
                joined[0].append(label)
            else:
                groups.append([label])
        chosen = [
            group for group in groups if len(group) > 1 and (within == "rounding" or loose & set(group))
        ]
        found += [_same(group, within, limits, comparison) for group in chosen]
    return sorted(found, key=lambda same: (same.within, -len(same.labels)))


def _is_adaptive(scene: Scene, run: Trajectory) -> bool:
    return run.label != EXACT and not Case(trajectory=run, scene=scene).scheme.has("one-step")


def _exact(scene: Scene, like: Trajectory) -> Trajectory:
    """The exact solution at the frames of another trajectory."""
    q, p = exact.true_motion(scene, Case(trajectory=like, scene=scene).steps, like.step)
    states = {"q": np.asarray(q, np.float64), "p": np.asarray(p, np.float64)}
    plain = {"arithmetic": Arithmetic(), "rebuilds_velocity": False, "energy": None}
    return replace(like, label=EXACT, scheme=EXACT, **states, **plain)  # type: ignore[arg-type]


def _is_near(
    scene: Scene,
    runs: Mapping[str, Trajectory],
    limits: Mapping[str, float],
    comparison: Comparison,
    pair: tuple[str, str],
) -> bool:
    """Whether two trajectories are one motion."""
    if not _difference(comparison, pair) <= limits[pair[0]] + limits[pair[1]]:
        return False
    one, other = (runs[label] for label in pair)
    if one.scheme == other.scheme or any(_is_adaptive(scene, run) for run in (one, other)):
        return True
    return _takes_steps_of(scene, one, other) and _takes_steps_of(scene, other, one)


def _takes_steps_of(scene: Scene, run: Trajectory, other: Trajectory) -> bool:
    """Whether a trajectory could be one of another's scheme."""
    if other.label == EXACT:
        # the exact solution has no steps of its own; the other way round says it all
        return True
    told = step_defect(Case(trajectory=replace(run, scheme=other.scheme), scene=scene))
    return told.passed is True


def _difference(comparison: Comparison, pair: tuple[str, str]) -> float:
    i, j = (comparison.labels.index(label) for label in pair)
    return float(comparison.max_difference[i, j])


def _same(
    group: Sequence[str],
    within: Literal["rounding", "tolerance"],
    limits: Mapping[str, float],
    comparison: Comparison,
) -> Same:
    pairs = list(combinations(group, 2))
    return Same(
        labels=tuple(group),
        difference=max(_difference(comparison, pair) for pair in pairs),
        allowed=max(limits[a] + limits[b] for a, b in pairs),
        within=within,
    )
