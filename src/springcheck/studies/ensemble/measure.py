"""Ensembles: one scene over many parameters by many methods, in as few runs as the engines allow.

A method of fixed step runs cells of one time grid side by side, without interaction; an adaptive solver,
which would choose one step for all, runs them one by one.  Only numbers of each cell are saved, so that
neither the file nor memory holds trajectories, however many cells there are.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, Unpack

import numpy as np

from springcheck import engines
from springcheck.engines.contract import Label
from springcheck.errors import MethodError, SceneError
from springcheck.physics import exact, scenefile
from springcheck.physics.arrays import Extended, Floats, Integers, Reals
from springcheck.physics.scene import Scene
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import LeftOut, choose
from springcheck.studies.ensemble.result import CELLS, Columns, Ensemble, Tally
from springcheck.studies.ensemble.vary import CHUNK, GRID, Plan, Varied, plan, together
from springcheck.studies.extremes.running import raw
from springcheck.studies.keeper import How, Keeper, Piece

NUMBERS_PER_ARRAY = 1 << 17
"""Numbers per array of a run: memory does not grow with the number of cells."""

OUTCOMES = ("complete", "diverged", "stopped")


def perform(options: Namespace, progress: Progress | None) -> Ensemble:
    """Carry out `springcheck ensemble` and `springcheck run --vary`."""
    scene = scenefile.load_scene(options.scene)
    text = scenefile.text_of(options.scene)
    cells = plan(options.vary, options.samples, options.seed or 0, text=text)
    path = options.output or f"{scene.name}-ensemble.h5"
    return record(scene, cells, path, options.method, **keeper.how(options, progress))


def record(
    scene: Scene, cells: Plan, path: str | Path | None, methods: Sequence[str] = (), **how: Unpack[How]
) -> Ensemble:
    """Run every cell by every method and save its numbers; finished chunks are reused.

    Raises SpringcheckError, before anything is run, where a field cannot be varied or no method can serve.
    """
    if scene.bath:
        raise SceneError(f"scene {scene.name} has a bath: cells of an ensemble are of motion without noise")
    labels, left, _ = choose(scene, methods)
    varied, first = Varied(scene, cells.text), cells.values(0)
    varied.check(first, varied.substitutions(first))
    measure = partial(_measure, scene, cells, labels, left)
    return keeper.study("ensemble", path, labels, measure, repr(cells), scene=scene, **how)


def _measure(
    scene: Scene, cells: Plan, labels: Sequence[Label], left: Sequence[LeftOut], kept: Keeper
) -> Ensemble:
    tallies = {str(label): Tally(method=str(label), smallest={}, largest={}) for label in labels}
    pieces = [
        Piece(
            key=f"{label}/{chunk:06d}",
            what=f"{label}, cells from {chunk * CHUNK}",
            measure=partial(measure, scene, cells, chunk, label),
            form=CELLS,
        )
        for label in labels
        for chunk in cells.chunks
    ]
    held: dict[str, dict[str, Columns]] = {name: {} for name in tallies}
    for piece, found in kept.stream(pieces):
        name, _, chunk = piece.key.rpartition("/")
        tallies[name] = tallies[name].plus(found)
        if kept.path is None:
            held[name][chunk] = found
    return Ensemble(
        scene=scene,
        fields=tuple(axis.field for axis in cells.axes),
        grid=cells.samples is None,
        tallies=tuple(tallies.values()),
        left_out=tuple(left),
        columns={label: _joined([mine[x] for x in sorted(mine)]) for label, mine in held.items() if mine},
    )


def _joined(chunks: Sequence[Columns]) -> Columns:
    """Columns of all of these chunks, in their order."""
    return {name: np.concatenate([one[name] for one in chunks]) for name in chunks[0]}


@keeper.restoring("ensemble")
def stored(kept: keeper.Kept) -> Ensemble:
    """The ensemble that `record` has saved.  StoreError where the file holds none."""
    known = kept.document
    return Ensemble(
        scene=keeper.stored_scene(kept.path),
        fields=tuple(known["fields"]),
        grid=known["grid"],
        tallies=tuple(Tally(**one) for one in known["methods"]),
        left_out=kept.left_out,
        path=kept.path,
    )


def measure(scene: Scene, cells: Plan, chunk: int, label: Label) -> Columns:
    """The numbers of the cells of one chunk by one method."""
    values = cells.values(chunk)
    varied = Varied(scene, cells.text)
    changes = varied.substitutions(values)
    varied.check(values, changes)
    count = len(next(iter(values.values())))
    grid = np.column_stack([x for place, x in changes.items() if place[0] in GRID] or [np.zeros(count)])
    _, group = np.unique(grid, axis=0, return_inverse=True)
    found: dict[str, Any] = {
        "outcome": np.zeros(count, np.int8),
        **{name: np.full(count, np.nan) for name in ("max_error", "energy_drift", "q0", "p0")},
        "steps": np.zeros(count, np.int64),
    }
    for number in range(int(group.max()) + 1):
        mine = np.flatnonzero(group.ravel() == number)
        first = together(scene, changes, mine[:1])
        # all joints of a run are as long as the largest motion needs them
        how = engines.arithmetic(label)
        # what an engine that keeps forces does between frames does not show
        alone = engines.method(label).adaptive or how.joints or (how.stale and first.every > 1)
        size = 1 if alone else max(1, NUMBERS_PER_ARRAY // (first.frames * first.n))
        for start in range(0, len(mine), size):
            _run(scene, changes, mine[start : start + size], label, found)
    return {**values, **found}


def _run(scene: Scene, changes: Any, chosen: np.ndarray, label: Label, found: dict[str, Any]) -> None:
    """Run these cells side by side; where the engine stops, bisect to find the cells that stop it."""
    many = together(scene, changes, chosen)
    try:
        # copies side by side may have what the engine takes once for all of them, as its rate of friction
        if reason := engines.refusal(many, label):
            raise MethodError(reason)
        q, p, stop = raw(many, label)
        stopped = stop is not None
    except MethodError:
        if len(chosen) == 1:
            found["outcome"][chosen] = OUTCOMES.index("stopped")
            return
        # the engine refuses copies of this scene side by side
        q, p, stopped = many.q[None], many.p[None], True
    if stopped and len(chosen) > 1:
        half = len(chosen) // 2
        _run(scene, changes, chosen[:half], label, found)
        _run(scene, changes, chosen[half:], label, found)
        return
    copies = len(chosen)

    def alone(j: int) -> Scene:
        return together(scene, changes, chosen[j : j + 1])

    states = q.reshape(len(q), copies, -1), p.reshape(len(p), copies, -1)
    finite = np.all(np.isfinite(states[0]) & np.isfinite(states[1]), axis=2)
    frames = np.where(finite.all(axis=0), len(q), np.argmin(finite, axis=0))
    found["steps"][chosen] = (frames - 1) * many.every
    found["outcome"][chosen] = np.where(frames == many.frames, 0, 2 if stopped else 1)
    for name, x in zip(("q0", "p0"), states, strict=True):
        found[name][chosen] = x[frames - 1, np.arange(copies), 0]
    with np.errstate(all="ignore"):
        scale = _scales(many, copies, alone)
        drift = np.asarray(_drifts(many, copies, alone, q, p) / scale, np.float64)
        error = _errors(many, copies, alone, q, p, scale)
    held = np.arange(len(q))[:, None] < frames
    drift = np.take_along_axis(drift, np.argmax(np.where(held, np.abs(drift), -1), axis=0)[None], axis=0)[0]
    # a cell with no frame but the start has neither error nor drift
    left = frames > 1
    found["energy_drift"][chosen] = np.where(left, drift, np.nan)
    found["max_error"][chosen] = np.where(left, np.max(np.where(held, error, 0), axis=0), np.nan)
    kept = engines.arithmetic(label).stale
    if kept and copies > 1 and len(q) > 1:
        # a cell that moves so little keeps its forces when it is alone, and not beside one that moves more
        moved = np.max(np.abs(np.diff(states[0], axis=0)), axis=2)
        for j in np.flatnonzero(np.any(moved <= 2 * kept, axis=0)):
            _run(scene, changes, chosen[j : j + 1], label, found)


def _of_copies(values: Reals, copies: int) -> Reals:
    """Sums over the entries of each copy, (f, copies s) -> (f, copies)."""
    return np.asarray(np.sum(values.reshape(len(values), copies, -1), axis=2))


def _energies(
    many: Scene, q: Reals, p: Reals, copies: int, of: Callable[[Reals], Reals] = np.asarray
) -> Reals:
    """Energy of each copy (f, copies), or with another function `of` the potential energy of each term."""
    energy = _of_copies(0.5 * (p * p) / many.m, copies)
    for term in many.terms:
        energy = energy + of(_of_copies(term.energies(q), copies))
    return energy


Alone: TypeAlias = Callable[[int], Scene]
"""Number of a copy -> its scene."""


def _scales(many: Scene, copies: int, alone: Alone) -> Extended:
    """The square of the unit of each copy's `Norm` (copies,): its initial T + |V| unless that is 0."""
    q, p = (x.astype(np.longdouble)[None] for x in (many.q, many.p))
    found = _energies(many, q, p, copies, np.abs)[0]
    for j in np.flatnonzero(found == 0):
        found[j] = alone(int(j)).system.norm.unit ** 2
    return np.asarray(found, np.longdouble)


def _solved(copies: int, alone: Alone, steps: Integers) -> Iterator[tuple[int, Scene, Extended, Extended]]:
    """Copies whose exact solution is known: number, scene, q and p (f, n)."""
    for j in range(copies):
        one = alone(j)
        if exact.has_true_motion(one):
            yield j, one, *exact.true_motion(one, steps, one.step)


def _drifts(many: Scene, copies: int, alone: Alone, q: Floats, p: Floats) -> Reals:
    """H - H0 of each copy (f, copies).  With friction or a drive the energy of the exact solution replaces
    H0, where it is known."""
    energy = _energies(many, q, p, copies)
    least, most = np.finfo(np.float64).smallest_normal / np.finfo(np.float64).eps, np.finfo(np.float64).max
    if not np.all((np.abs(energy) > least) & (np.abs(energy) <= most)):
        # energies overflow or underflow double precision where the states do not
        energy = _energies(many, q.astype(np.longdouble), p.astype(np.longdouble), copies)
    right = np.broadcast_to(energy[0], energy.shape).copy()
    if not many.system.keeps_energy:
        steps = np.arange(len(q)) * many.every
        if many.system.is_separate and many.system.is_linear:
            true = exact.true_motion(many, steps, many.step)
            right = np.asarray(_energies(many, *true, copies), np.float64)
        else:
            for j, one, q_j, p_j in _solved(copies, alone, steps):
                right[:, j] = one.system.energy(q_j, p_j)
    return np.asarray(energy - right)


def _errors(many: Scene, copies: int, alone: Alone, q: Floats, p: Floats, scale: Extended) -> Floats:
    """Distance of each copy from its exact solution, relative to the initial energy norm (f, copies), the
    root of the `scale`; NaN where that is unknown."""
    steps, system = np.arange(len(q)) * many.every, many.system
    if not (system.is_separate and system.is_linear) or system.free_groups:
        error = np.full((len(q), copies), np.nan)
        for j, one, true_q, true_p in _solved(copies, alone, steps):
            here = slice(j * one.n, (j + 1) * one.n)
            off = one.system.norm(q[:, here] - true_q, p[:, here] - true_p)
            error[:, j] = np.maximum(off, exact.uncertainty(one, float(steps[-1]) * one.step))
        return error
    true_q, true_p = exact.true_motion(many, steps, many.step)
    solution, m = system.solution, many.m.astype(np.longdouble)
    assert solution is not None
    known_q, known_p = solution.doubt(float(steps[-1]) * many.step)
    # errors below the uncertainty of the exact solution are not reported
    dq, dp = (
        np.where(x == 0, 0, np.maximum(np.abs(x), y))
        for x, y in ((q - true_q, known_q), (p - true_p, known_p))
    )
    size = _of_copies(0.5 * (dp * dp) / m, copies)
    for term in many.terms:
        du = term.stretch(dq)
        size = size + 0.5 * _of_copies(term.rigidity * du * du, copies)
    return np.asarray(np.where(size == 0, 0, np.sqrt(size) / np.sqrt(scale)), np.float64)
