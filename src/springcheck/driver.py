"""The driver: run one scene by one method, recorded in chunks, timed, its outcome judged.

The engine only advances.  Clock, chunks, energies, progress and divergence are kept here, alike for all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np

from springcheck import engines, interrupts
from springcheck.bath import THERMOSTATS
from springcheck.bath.catalogue import NO_NORMAL_NUMBERS
from springcheck.engines.contract import Label, Stopped
from springcheck.errors import EngineError, MethodError
from springcheck.physics import memory
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Outcome, Timing, Trajectory

CHUNK = 1 << 16
"""Numbers per array and chunk: 512 KiB, which stays in the cache."""

FIRST, QUICK = 256, 0.1
"""Rows of the first chunk, and the seconds below which the next one is twice as long, and of which twice as
many halve it: a slow engine reports its progress, and notices Ctrl-C, several times a second."""

PIECE, WORK = 1 << 16, 1 << 22
"""Steps, and steps times particles, that an engine of fixed step takes in one call where frames lie further
apart: between two calls a run can be interrupted.  Counts, not times: the numbers of a run must not depend on
the speed of the machine."""

UNTOUCHED = np.array(0x7FF8_0000_5C5C_5C5C).view(np.float64)
"""Fill value of rows before an engine writes them: a NaN that no arithmetic produces."""

Sink: TypeAlias = Callable[[Floats, Floats, Floats, Floats | None], None]
"""Receives recorded frames: t (f,), q and p (f, n), energy and last steps (f,) or None.  The arrays are
reused."""

Progress = Callable[[int], None]
"""Called with the number of steps done since the last call."""

TINY = float(np.finfo(np.float64).smallest_normal)
SUBNORMAL = (
    f"it has decayed below {TINY:.1e}: numbers are subnormal there, with fewer and fewer digits, and a "
    "step takes up to fifty times as long"
)

MOST_SEED = 900_000_000
"""Seeds are 1 to this, which every library accepts: LAMMPS has no larger one, and 0 makes OpenMM draw one."""

GIVEN_DRAWS = "none: drawn by a generator that the caller gave"
"""Stored in place of a seed where a generator was given."""


def checked_seed(seed: int | None) -> int:
    """The given seed, or a random one.  MethodError where it is out of range."""
    if seed is None:
        import secrets

        return 1 + secrets.randbelow(MOST_SEED)
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 1 <= seed <= MOST_SEED:
        raise MethodError(f"seed = {seed!r}: a whole number from 1 to {MOST_SEED} is needed")
    return int(seed)


def play(
    scene: Scene,
    label: Label,
    sink: Sink,
    *,
    progress: Progress | None = None,
    planned: int = 0,
    seed: Any = None,
) -> Trajectory:
    """Run a scene and hand every recorded frame, the start first, to `sink`; returns the run without frames.

    Memory does not grow with the length of the run.  Ctrl-C is no outcome: KeyboardInterrupt passes through.
    `planned` is how many steps the caller will take in all: an engine that compiles decides by them.  A
    random method takes the given seed, or draws one; the run stores it.  A scripted method also takes a
    generator in its place, and then stores no seed.

    Raises:
        MethodError: the method cannot serve the scene, or its engine or platform is not here.
    """
    reason = engines.refusal(scene, label)
    if reason:
        raise MethodError(f"{label}: {reason}")
    method = engines.method(label)
    ahead = scene if method.adaptive else scene.derived(steps=max(scene.steps, planned))
    origin = {}
    if method.generator:
        scripted = hasattr(seed, "standard_normal")
        if scripted and not method.scripted:
            raise MethodError(NO_NORMAL_NUMBERS)
        seed = seed if scripted else checked_seed(seed)
        draws = f"{THERMOSTATS[method.scheme].fresh} per step and particle"
        kept = GIVEN_DRAWS if scripted else str(seed)
        origin = {"seed": kept, "generator": method.generator, "threads": "1", "draws": draws}
    elif seed is not None:
        raise MethodError(f"{label}: it has no noise, and takes no seed")
    began = perf_counter()
    simulation = engines.Started(ahead, label, seed)
    start_seconds = perf_counter() - began
    how, origin = engines.arithmetic(label), {**simulation.origin, **origin}

    rows = max(1, min(CHUNK // scene.n, scene.frames))
    piece = scene.every if method.adaptive else min(scene.every, PIECE, WORK // scene.n or 1)
    whole = piece == scene.every
    # frames further apart than a piece are filled one by one
    ready = min(rows, FIRST, WORK // (piece * scene.n) or 1) if whole else 1
    # an engine that fills nothing must not be taken for one that has
    q, p = np.full((2, rows, scene.n), UNTOUCHED)
    _hand_over(scene, sink, 0, scene.q[None], scene.p[None])
    run_seconds = 0.0
    note = str(getattr(simulation.simulation, "note", ""))
    outcome = Outcome(status="complete", step=scene.steps, message=note)
    frame, calls = 1, 0
    while frame < scene.frames:
        f = min(ready, scene.frames - frame)
        q[f - 1], p[f - 1] = UNTOUCHED, UNTOUCHED
        ended, begun, seconds = _advance(simulation, scene.every, piece, q[:f], p[:f], progress)
        good = ended.step // scene.every
        run_seconds += seconds
        before, calls = calls, simulation.force_calls
        if ended.status == "diverged" and not method.adaptive:
            # steps to the last frame that is kept: every step costs the same, but for a first force
            calls = before - (before - calls) * good // begun
        if whole and seconds < QUICK:
            ready = min(rows, 2 * ready)
        elif seconds > 2 * QUICK:
            ready = max(1, ready // 2)
        if good:
            _hand_over(scene, sink, frame, q[:good], p[:good])
        frame += good
        if ended.status != "complete":
            outcome = replace(ended, step=(frame - 1) * scene.every)
            break
        if 0 < max(np.max(np.abs(q[f - 1])), np.max(np.abs(p[f - 1]))) < TINY:
            outcome = Outcome(status="complete", step=scene.steps, message=SUBNORMAL)
    return Trajectory(
        label=str(label),
        scheme=method.scheme,
        t=np.empty(0),
        q=np.empty((0, scene.n)),
        p=np.empty((0, scene.n)),
        step=scene.step,
        every=scene.every,
        tolerance=scene.tolerance if method.adaptive else None,
        outcome=outcome,
        timing=Timing(start=start_seconds, run=run_seconds),
        force_calls=calls,
        arithmetic=how,
        rebuilds_velocity=method.rebuilds_velocity,
        off_axis=simulation.off_axis,
        origin=origin,
    )


def _advance(
    simulation: engines.Started,
    every: int,
    piece: int,
    q: Floats,
    p: Floats,
    progress: Progress | None,
) -> tuple[Outcome, int, float]:
    """Fill q and p (f, n): how it ended, after how many steps of this call, the rows begun, and the seconds.

    Where a call takes fewer steps than lie between frames there is one row; `progress` is called after each.
    """
    outcome, good, told = Outcome(status="complete", step=0), len(q), 0
    begun = good
    began = perf_counter()
    try:
        for left in range(every, 0, -piece):
            steps = min(left, piece)
            simulation.advance(steps, q, p)
            if interrupts.seen():
                # a library may have swallowed it in a callback
                raise KeyboardInterrupt
            if progress and left > piece:
                progress(steps)
                told += steps
    except Stopped as stop:
        if stop.rows not in range(len(q) + 1):
            raise EngineError(f"{simulation.label}: Stopped after {stop.rows!r} rows of {len(q)}") from stop
        # a row that is filled before its last piece is no frame
        good, begun = stop.rows if left <= piece else 0, min(stop.rows + 1, begun)
        outcome = Outcome(status="stopped", step=0, message=str(stop), fastest=stop.fastest)
    seconds = perf_counter() - began
    finite = np.isfinite(q[:good]).all(axis=1) & np.isfinite(p[:good]).all(axis=1)
    if not finite.all():
        good = int(np.argmin(finite))
        untouched = UNTOUCHED.tobytes() * q.shape[1]
        if unfilled := [name for name, x in (("q", q), ("p", p)) if x[good].tobytes() == untouched]:
            raise EngineError(
                f"{simulation.label} failed: its advance(every, q, p) has left row {good} of "
                f"{' and '.join(unfilled)} as it was; it writes every row into these arrays: q[row] = ..."
            )
        outcome = Outcome(status="diverged", step=0, message="not finite from the next frame on")
    elif outcome.status == "stopped" and "nan" in outcome.message.lower():
        outcome = replace(outcome, status="diverged")
    if progress:
        progress(good * every - told)
    return replace(outcome, step=good * every), begun, seconds


def _hand_over(scene: Scene, sink: Sink, frame: int, q: Floats, p: Floats) -> None:
    t = np.arange(frame, frame + len(q), dtype=np.float64) * scene.every * scene.step
    energy = None
    if "energy" in scene.quantities:
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            energy = np.asarray(scene.system.energy(q, p), dtype=np.float64)
    sink(t, q, p, energy)


class Gather:
    """A sink that keeps everything in memory."""

    def __init__(self, scene: Scene) -> None:
        memory.need(
            scene.frames * (2 * scene.n + 2) * 8,
            f"scene {scene.name}: {scene.frames} frames of {scene.n} particles",
            "raise record.every, or let `springcheck run` stream to a file",
        )
        self._frames = 0
        self._t = np.empty(scene.frames)
        self._q, self._p = np.empty((scene.frames, scene.n)), np.empty((scene.frames, scene.n))
        self._energy = np.empty(scene.frames) if "energy" in scene.quantities else None

    def __call__(self, t: Floats, q: Floats, p: Floats, energy: Floats | None) -> None:
        a, b = self._frames, self._frames + len(t)
        self._t[a:b], self._q[a:b], self._p[a:b] = t, q, p
        if self._energy is not None:
            self._energy[a:b] = energy
        self._frames = b

    def onto(self, run: Trajectory) -> Trajectory:
        """The run with these frames."""
        return replace(run, t=self._t, q=self._q, p=self._p, energy=self._energy).at(slice(self._frames))


def run(
    scene: Scene, method: str | Label, *, progress: Progress | None = None, seed: Any = None
) -> Trajectory:
    """Run a scene by one method and return its trajectory, row 0 the start.

    `method` is a label such as ``"ase:velocity-verlet"`` or ``"openmm:verlet@CPU"``.  A run that
    diverges or stops returns what was finite, and says so in `outcome`.  `seed` is that of a random method,
    drawn where it is left out; the trajectory keeps it in `origin`.

    Raises:
        MethodError: no such method, or it cannot serve the scene, or its engine is not installed.
        SceneError: the trajectory would not fit into memory.
    """
    label = engines.parse(method) if isinstance(method, str) else method
    gather = Gather(scene)
    return gather.onto(play(scene, label, gather, progress=progress, seed=seed))
