"""Differences of every pair of trajectories over all frames, and which of them are the same motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal, NamedTuple

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
    """Trajectories of one motion: no two of them differ by more than `allowed`."""

    labels: tuple[str, ...]
    difference: float
    allowed: float
    within: Literal["rounding", "tolerance"] = "rounding"
    """Origin of the allowed difference: rounding alone, or the tolerance of some adaptive solver."""


def solution(scene: Scene, pieces: Collection[Trajectory]) -> tuple[Extended, Extended]:
    """The exact solution q, p (f, n) at the frames of the longest of these pieces, where it is known."""
    longest = max(pieces, key=lambda piece: len(piece.t))
    return exact.true_motion(scene, Case(trajectory=longest, scene=scene).steps, longest.step)


def compare(
    scene: Scene, pieces: Mapping[str, Trajectory], known: tuple[Extended, Extended] | None = None
) -> Comparison:
    """Compare trajectories, or pieces over the same frames, with each other and with the exact solution.

    `known` is the exact solution if it has been computed (`solution`)."""
    norm = scene.system.norm
    states: dict[str, tuple[Extended | Floats, Extended | Floats]] = {}
    if pieces and exact.has_true_motion(scene):
        states[EXACT] = known or solution(scene, pieces.values())
    frames = max((len(piece.t) for piece in pieces.values()), default=0)
    states.update((label, (piece.q, piece.p)) for label, piece in pieces.items())
    labels = tuple(states)
    out = np.zeros((len(labels), len(labels)))
    for i, a in enumerate(labels):
        for j, b in enumerate(labels[:i]):
            (qa, pa), (qb, pb) = states[a], states[b]
            whole = len(qa) == len(qb) == frames
            out[i, j] = out[j, i] = np.max(norm(qa - qb, pa - pb)) if whole else np.nan
    return Comparison(labels=labels, max_difference=out)


def merge(comparisons: Sequence[Comparison], last: Mapping[str, Trajectory]) -> Comparison:
    """The comparison of whole trajectories from those of their pieces, of which `last` has the last ones.
    What ended before another is not compared: NaN."""
    labels, end = comparisons[0].labels, max(run.outcome.step for run in last.values())
    out = np.zeros((len(labels), len(labels)))
    for part in comparisons:
        at = np.ix_(*[[labels.index(label) for label in part.labels]] * 2)
        out[at] = np.maximum(out[at], part.max_difference)
    early = [label in last and last[label].outcome.step < end for label in labels]
    out[early] = out[:, early] = np.nan
    np.fill_diagonal(out, 0)
    return Comparison(labels=labels, max_difference=out)


@np.errstate(all="ignore")
def allowed(scene: Scene, trajectory: Trajectory) -> float:
    """How far rounding, or the tolerance, may take a trajectory from the motion that it represents."""
    case = Case(trajectory=trajectory, scene=scene)
    if not case.scheme.has("one-step"):
        return tolerance_bound(case)
    if len(trajectory.t) < 2:
        return 0.0
    if case.linear:
        bound, unit = case.growth
        # before the first step there is nothing to round
        sizes = np.asarray(unit / case.system.norm.unit, np.float64)
        return float(np.max((bound * sizes)[case.steps > 0], initial=0.0))
    # roundings shift the energy, and with it the frequency of an anharmonic motion: as random ones do where
    # roundings of states walk at random; those of coefficients, made once, shift the phase at each step alike
    steps = float(case.steps[-1])
    rounding = float(np.max(case.system.norm.most(*case.allowance) / case.system.norm.unit))
    turn = fastest(case) * abs(trajectory.step)
    walk = float(case.walk(np.array([steps]), turn)[0]) + DEVIATIONS * steps**1.5 * turn / 2
    return float(rounding * min(case.roundings * steps * (1 + steps * turn / 2), walk))


class _Motion(NamedTuple):
    """A trajectory, and its largest allowed distance from the motion that it represents."""

    case: Case
    limit: float

    @property
    def is_exact(self) -> bool:
        return self.case.trajectory.label == EXACT

    @property
    def is_adaptive(self) -> bool:
        return not self.is_exact and not self.case.scheme.has("one-step")

    def could_be(self, other: _Motion) -> bool:
        """Whether its steps are those of another's scheme, to rounding."""
        run, scheme = self.case.trajectory, other.case.trajectory.scheme
        # the exact solution has no steps: the comparison the other way round decides
        if other.is_exact or run.scheme == scheme or self.is_adaptive or other.is_adaptive:
            return True
        return step_defect(replace(self.case, trajectory=replace(run, scheme=scheme))).passed is True


def _motion(scene: Scene, run: Trajectory) -> _Motion:
    """A trajectory with its limit, NaN where that is no small part of the motion and cannot be compared."""
    limit = allowed(scene, run)
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.max(scene.system.norm(run.q - scene.q, run.p - scene.p))
    small = np.isfinite(limit) and limit <= 1e-3 * max(float(size), 1.0)
    return _Motion(Case(trajectory=run, scene=scene), limit if small else np.nan)


def _exact(scene: Scene, like: Trajectory, ends: Collection[float]) -> _Motion:
    """The exact solution at the frames of another trajectory, with its largest error up to these times."""
    q, p = solution(scene, [like])
    states = {"q": np.asarray(q, np.float64), "p": np.asarray(p, np.float64)}
    plain = {"arithmetic": Arithmetic(), "rebuilds_velocity": False, "energy": None}
    run = replace(like, label=EXACT, scheme=EXACT, **states, **plain)  # type: ignore[arg-type]
    return _Motion(Case(trajectory=run, scene=scene), max(exact.uncertainty(scene, t) for t in ends))


def same_motions(scene: Scene, trajectories: Mapping[str, Trajectory], comparison: Comparison) -> list[Same]:
    """Groups of trajectories of which every two are one motion, largest group first.

    Within rounding: their difference is no larger than rounding allows, and where their schemes differ each
    of them takes the other's steps, to rounding.  Within a tolerance: an adaptive solver is among them, and
    the difference is no larger than its tolerance allows.
    """
    runs = {label: run for label, run in trajectories.items() if len(run.t) > 1}
    motions = {label: _motion(scene, run) for label, run in runs.items()}
    if EXACT in comparison.labels and runs:
        ends = {float(run.t[-1]) for run in runs.values()}
        motions[EXACT] = _exact(scene, next(iter(runs.values())), ends)
    pairs = {
        frozenset({a, b}): (float(comparison.max_difference[i, j]), motions[a].limit + motions[b].limit)
        for (i, a), (j, b) in combinations(enumerate(comparison.labels), 2)
        if a in motions and b in motions
    }

    def is_one(a: str, b: str) -> bool:
        difference, limit = pairs[frozenset({a, b})]
        one, other = motions[a], motions[b]
        return difference <= limit and one.could_be(other) and other.could_be(one)

    found: list[Same] = []
    for within in ("rounding", "tolerance"):
        groups: list[list[str]] = []
        for label in comparison.labels:
            if label not in motions or (within == "rounding" and motions[label].is_adaptive):
                continue
            joined = next((group for group in groups if all(is_one(label, other) for other in group)), None)
            if joined is None:
                groups.append([label])
            else:
                joined.append(label)
        for group in groups:
            adaptive = any(motions[label].is_adaptive for label in group)
            if len(group) > 1 and (within == "rounding" or adaptive):
                both = [pairs[frozenset(pair)] for pair in combinations(group, 2)]
                difference, limit = (max(numbers) for numbers in zip(*both, strict=True))
                found.append(Same(labels=tuple(group), difference=difference, allowed=limit, within=within))
    return sorted(found, key=lambda same: (same.within, -len(same.labels)))
