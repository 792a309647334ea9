"""Which trajectories are the same motion, and how closely: differences of every pair, over all frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from springcheck.checks.case import Case
from springcheck.checks.solver import tolerance_bound
from springcheck.checks.steps import fastest
from springcheck.physics import exact
from springcheck.physics.arrays import Extended, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Comparison, Trajectory

EXACT = "exact"
"""The label of the exact solution among the others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Same:
    """Trajectories that are one motion: no pair of neighbours differs by more than `allowed`."""

    labels: tuple[str, ...]
    difference: float
    allowed: float


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
    if not case.scheme.one_step:
        return tolerance_bound(case)
    if len(trajectory.t) < 2:
        return 0.0
    if case.linear:
        bound, unit = case.growth
        # before the first step there is nothing to round
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            sizes = np.asarray(unit / case.system.norm.unit, np.float64)
            return float(np.max((bound * sizes)[case.steps > 0], initial=0.0))
    # roundings shift the energy, and with it the frequency of an anharmonic motion: steps**2
    steps = float(case.steps[-1])
    rounding = float(np.max(case.system.norm(*case.allowance)))
    return case.roundings * rounding * steps * (1 + steps * fastest(case) * abs(trajectory.step) / 2)


def _telling(scene: Scene, trajectory: Trajectory) -> float:
    """`allowed`, or NaN where it is no small part of the motion: then nothing can be said of it."""
    limit = allowed(scene, trajectory)
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.max(scene.system.norm(trajectory.q - scene.q, trajectory.p - scene.p))
    return limit if np.isfinite(limit) and limit <= 1e-3 * max(float(size), 1.0) else np.nan


def same_motions(scene: Scene, trajectories: Mapping[str, Trajectory], comparison: Comparison) -> list[Same]:
    """Groups of trajectories whose differences rounding and tolerances explain, largest group first."""
    known = 0.0
    if exact.has_true_motion(scene):
        known = max(
            (exact.uncertainty(scene, float(run.t[-1])) for run in trajectories.values()), default=0.0
        )
    limits = {EXACT: known} | {label: _telling(scene, run) for label, run in trajectories.items()}
    labels = comparison.labels
    limit = np.array([limits[label] for label in labels])
    bounds = limit[:, None] + limit[None, :]
    near = comparison.max_difference <= bounds
    groups: list[set[int]] = []
    for i in range(len(labels)):
        joined = [group for group in groups if any(near[i, j] for j in group)]
        groups = [group for group in groups if group not in joined] + [{i}.union(*joined)]
    found = []
    for group in groups:
        if len(group) < 2:
            continue
        members = sorted(group)
        block = np.ix_(members, members)
        found.append(
            Same(
                labels=tuple(labels[i] for i in members),
                difference=float(np.max(comparison.max_difference[block])),
                allowed=float(np.max(bounds[block])),
            )
        )
    return sorted(found, key=lambda same: -len(same.labels))
