"""The states of a file as a trajectory of a scene: particles, times, start and digits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import schemes, store
from springcheck.cli import start
from springcheck.errors import StoreError
from springcheck.figures.views import units
from springcheck.formats import States, is_store, moving, read
from springcheck.identify import files
from springcheck.identify.storage import storage
from springcheck.physics.arrays import AS_WRITTEN, Arithmetic, Floats
from springcheck.physics.driven import sums
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Outcome, Trajectory
from springcheck.text.wording import count

SUMS = "times are sums of steps, rounded at each; the drive is judged at these times"
"""What is said where a driven file has such times."""

TIMES = "times were taken as whole numbers of steps from the first frame on"
CLOCK = 2.0**-53
"""Roundoff of a clock."""
SMALLEST_SINGLE = 2.0**-126
"""Smallest normal number of single precision."""


def states_in(
    path: Path, columns: Sequence[str] = (), step: float | None = None, label: str | None = None
) -> States:
    """The only trajectory of a file, or that of this label.  StoreError where there are several or none."""
    found = _recorded(path) if not columns and is_store(path) else read(path, columns, step)
    found = {name: x for name, x in found.items() if x.p is not None or x.v is not None} or {
        name: moving(path, x) for name, x in found.items()
    }
    if label is None and len(found) == 1:
        label = next(iter(found))
    if label not in found:
        raise StoreError(
            f"{path}: trajectories: {len(found)}; choose one by --trajectory: {', '.join(found)}"
        )
    apart = float(np.diff(found[label].t[:2])[0]) if len(found[label].t) > 1 else 0.0
    if step and abs(apart / step - round(apart / step)) > 1e-6:
        raise StoreError(
            f"{path}: --step {step:g} contradicts its times, which are {apart:.6g} apart; leave --step out"
        )
    return found[label]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recorded(States):
    """States of one of our stores, with the engine's declarations."""

    run: Trajectory


def _recorded(path: Path) -> dict[str, States]:
    found: dict[str, States] = {}
    for run in store.summary(path).runs:
        # as a single piece, however long the run
        piece = next(store.windows(path, run.label, run.frames + 1))
        found[run.label] = Recorded(t=piece.t, q=piece.q, p=piece.p, v=None, mass=None, run=piece)
    return found


def as_trajectory(
    path: Path, states: States, scene: Scene, scheme: str
) -> tuple[Scene, Trajectory, tuple[str, ...], dict[str, str]]:
    """States as a trajectory of a scene with the file's grid and start, notes on the changes made, and what
    was taken from the file and is therefore not judged, by the name of the check of the record.

    StoreError where they are not of the scene: another number of particles, other times, another start.
    """
    start.contradicted(path, states, scene)
    notes, taken = [*states.notes, *start.clock(states, scene)], dict[str, str]()
    of = _placed(path, states, scene, notes)
    scene, q, p = of.scene, of.q, of.p
    t, every = _times(path, states, scene, notes, taken)
    _begins(path, states, of, notes, taken)
    _digits(states, notes)
    steps = (len(q) - 1) * every
    if every != scene.every:
        notes.append(f"frames are {count(every, 'step')} apart, {scene.every} in the scene")
    if (steps, every) != (scene.steps, scene.every):
        taken["grid"] = (
            f"the file has {count(len(q), 'frame')}, {count(every, 'step')} apart, and the scene asks for "
            f"{scene.frames}, {scene.every} apart: what is there was judged"
        )
    ours = states.run if isinstance(states, Recorded) else None
    if ours is not None and ours.rebuilds_velocity:
        notes.append("velocities are rebuilt from positions, as its run declared, and judged so")
    kept = ("q", "p") if ours is None or ours.energy is None else ("q", "p", "energy")
    if "energy" in scene.quantities and "energy" not in kept:
        taken["energies"] = "the scene keeps energies, and a column of them is read from a store alone"
    begun: dict[str, Any] = {"q": q[0].copy(), "p": p[0].copy()}
    grid: dict[str, Any] = {"steps": steps, "every": every, "quantities": kept}
    judged = replace(scene, **begun, **grid)
    known: dict[str, Any] = {
        "label": path.name, "scheme": scheme, "t": t, "q": np.ascontiguousarray(q), "step": scene.step,
        "p": np.ascontiguousarray(p), "every": every, "outcome": Outcome(status="complete", step=steps),
    }  # fmt: skip
    if ours is not None:
        run = replace(ours, **known, tolerance=ours.tolerance if ours.scheme == scheme else None)
        return judged, run, tuple(notes), taken
    # a line that is no axis is rounded in each of its coordinates
    off_axis = of.beside if of.beside > 8 * states.roundoff else None
    written = of.halves if np.any(of.halves) else ((), ())
    tolerance = scene.tolerance if schemes.scheme(scheme).has("adaptive") else None
    if tolerance is not None:
        taken["tolerance"] = "the file does not say what tolerance its solver has, nor how many steps it took"
    arithmetic = Arithmetic(name=AS_WRITTEN, state=_unit(states), written=written)
    run = Trajectory(**known, arithmetic=arithmetic, off_axis=off_axis, tolerance=tolerance)
    return judged, run, tuple(notes), taken


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Placed:
    """The states of a file in the coordinates of a scene."""

    scene: Scene
    """With 0 where the file has it."""
    q: Floats
    p: Floats
    halves: Floats
    """Half a unit of the last decimal of q and p (2, n), 0 where decimals are not fixed."""
    beside: float
    """Largest motion along what the scene leaves out, relative to the whole."""
    moved: float
    """Distance of the file's 0 from the scene's along its line [L]."""


def _placed(path: Path, states: States, scene: Scene, notes: list[str]) -> _Placed:
    """The states in the scene's coordinates; StoreError where they cannot be placed there."""
    q, beside, moved, halves = states.q, 0.0, 0.0, np.zeros((2, states.q.shape[1]))
    other, rates = (states.p, "momenta") if states.p is not None else (np.asarray(states.v), "velocities")
    for name, values in (("positions", q), (rates, other)):
        good = np.isfinite(values).all(axis=1)
        if not good.all():
            raise StoreError(
                f"{path}: the {name} of row {int(np.argmin(good)) + 1} are not finite numbers; leave out the "
                "frames from there on, and those before it are judged"
            )
    if states.fixed:
        halves[0], halves[1] = states.fixed.q, states.fixed.v
    off = max(1e-6, 4 * states.roundoff)
    if scene.places is not None and q.shape[1] == 3 * scene.particles > scene.n:
        q, other, beside = _in_plane(path, q, other, scene, off)
        halves = halves[:, scene.where]
    elif q.shape[1] == 3 * scene.n:
        far = float(np.max(np.abs(q), initial=0.0))
        q, other, beside, line = _along(path, q, other, scene, notes, off)
        halves = halves.reshape(2, -1, 3) @ np.abs(line)
        if moved := _beside_start(q, scene, off):
            # displaced from 0 by as much as the points are, since they are rounded there
            notes.append(f"positions counted from {moved:.6g} along it, where the scene has its 0")
            terms = tuple(term.shifted(far) if term.bodies == 1 else term for term in scene.terms)
            q, scene = q - moved + far, replace(scene, q=scene.q + far, terms=terms)
            beside /= max(1.0, far / (float(np.ptp(q)) or 1.0))
    if q.shape[1] != scene.n:
        raise StoreError(f"{path}: positions in a frame: {q.shape[1]}, in scene {scene.name}: {scene.n}")
    if len(q) < 2:
        raise StoreError(f"{path}: holds {len(q)} frame; two are needed")
    if states.p is None:
        other, halves[1] = other * scene.m, halves[1] * scene.m
    if states.roundoff >= 2.0**-24 and np.any((np.abs(q) < SMALLEST_SINGLE) & (q != 0)):
        # subnormal numbers of single precision are whole multiples of 2**-149
        halves = np.maximum(halves, [np.full(scene.n, 2.0**-150), 2.0**-150 * scene.m])
    return _Placed(scene=scene, q=q, p=other, halves=halves, beside=beside, moved=moved)


def _times(
    path: Path, states: States, scene: Scene, notes: list[str], taken: dict[str, str]
) -> tuple[Floats, int]:
    """The times of the frames (f,) as whole numbers of steps, and the steps from frame to frame; StoreError
    where they are none."""
    if not np.isfinite(states.t).all():
        raise StoreError(f"{path}: row {int(np.argmin(np.isfinite(states.t))) + 1} of t is not finite")
    apart, own = float(states.t[1] - states.t[0]), units(scene).t
    every = round(apart / scene.step)
    for name, one in files.TIMES.items() if own in files.TIMES else ():
        factor = files.TIMES[own] / one
        if factor != 1 and abs(apart - factor * scene.step * scene.every) <= 1e-6 * apart:
            raise StoreError(
                f"{path}: the times look like {name}: frames lie {apart:.6g} apart, {factor:g} times as far "
                f"as in scene {scene.name}, which has {own}; divide them by {factor:g}"
            )
    t = np.arange(len(states.t), dtype=np.float64) * max(every, 1) * scene.step
    off = np.abs(states.t - states.t[0] - t)
    # of times with fixed decimals the last digit does not grow with them
    # a clock that adds up its steps is off by one rounding of the time at each
    allowed = (2 * states.roundoff + CLOCK * (every * np.arange(len(t)) + 4)) * np.abs(states.t)
    allowed += storage(states.t).quantum(states.t)
    if every < 1 or np.any(off > allowed):
        row = int(np.argmax(off > allowed))
        raise StoreError(
            f"{path}: row {row + 1} is at t = {states.t[row]:.12g}, and {states.t[0] + t[row]:.12g} is due: "
            f"frames lie whole steps of {scene.step:g} apart in scene {scene.name}, as the first two do"
            + "".join(f"; {x}" for x in start.clock(states, scene))
        )
    if (
        scene.system.is_driven
        and np.any(off)
        and np.array_equal(states.t, sums(scene.step, np.arange(len(t)) * every))
    ):
        notes.append(SUMS)
        taken["times"] = f"{SUMS}; they differ from products by up to {np.max(off):.2g}"
        return states.t, every
    if np.any(states.t != t):
        notes.append(TIMES)
        taken["times"] = f"{TIMES}; difference up to {np.max(off):.2g}" if np.any(off) else TIMES
    return t, every


def _begins(path: Path, states: States, of: _Placed, notes: list[str], taken: dict[str, str]) -> None:
    """Note a first frame that differs from the scene's start; StoreError where it is another one."""
    scene, q, p = of.scene, of.q, of.p
    size = scene.system.norm(q[0] - scene.q, p[0] - scene.p)
    # far from 0 the rounding of a coordinate is larger relative to the amplitude
    both = zip((q[0], p[0]), of.halves, strict=True)
    rounded = scene.system.norm.most(*(states.roundoff * np.abs(x) + half for x, half in both))
    if not size <= max(1e-9, 10 * states.roundoff) and not 0 < size * scene.system.norm.unit <= 2 * rounded:
        raise StoreError(
            f"{path}: its first frame is {float(size):.2g} of the amplitude off the start of {scene.name}: "
            + start.differs(scene, states, q[0], p[0])
        )
    if size > 0 or of.moved:
        taken["start"] = f"the start was taken as it is written in the file, {size:.2g} of the amplitude off"
        notes += [taken["start"]] if size > 0 else []


def _unit(states: States) -> float:
    """Unit roundoff to which the numbers of a file are judged, but for fixed decimals."""
    return states.fixed.beside if states.fixed else states.roundoff


def _digits(states: States, notes: list[str]) -> None:
    """Note the digits of the numbers."""
    if states.fixed:
        rates = "momenta" if states.p is not None else "velocities"
        halves_of = {"positions": states.fixed.q, rates: states.fixed.v}
        sizes = {name: f"{np.max(x):.1g}" for name, x in halves_of.items() if np.any(x)}
        of, each = (" and ".join(words) for words in (sizes, sizes.values()))
        notes += [f"{of} are rounded to decimals, by up to {each}, and judged to that"] * bool(sizes)
    if (unit := _unit(states)) > 2.0**-53:
        notes.append(f"numbers are written to {unit:.1g}, and judged to that")


def _in_plane(path: Path, q: Floats, other: Floats, scene: Scene, off: float) -> tuple[Floats, Floats, float]:
    """The scene's coordinates (f, n) of motions in space (f, 3 particles), and the largest motion along the
    axes that it leaves out, relative to the whole."""
    left = scene.elsewhere
    beside = max(float(np.max(np.abs(x[:, left])) / (np.max(np.abs(x)) or 1.0)) for x in (q - q[0], other))
    if not beside <= off:
        raise StoreError(
            f"{path}: {beside:.2g} of the motion is along axes that scene {scene.name} leaves out"
        )
    return q[:, scene.where], other[:, scene.where], beside


def _beside_start(q: Floats, scene: Scene, off: float) -> float:
    """Displacement of several particles (f, n) along their line from the scene's start; 0 where there is
    none, or their distances are not the scene's."""
    apart = q[0] - scene.q
    moved, size = float(np.mean(apart)), float(np.ptp(scene.q))
    alike = scene.n > 1 and np.ptp(apart) <= off * size < abs(moved)
    return moved if alike else 0.0


def _along(
    path: Path, q: Floats, other: Floats, scene: Scene, notes: list[str], off: float
) -> tuple[Floats, Floats, float, Floats]:
    """Motions in space (f, 3n) projected onto their common line (f, n), which they may leave by `off` of
    their size; the distance from it relative to their size; and its direction (3,)."""
    r, rates = q.reshape(len(q), -1, 3), other.reshape(len(q), -1, 3)
    moved = (r - r[0]).reshape(-1, 3)
    _, sizes, axes = np.linalg.svd(moved, full_matrices=False)
    if sizes[0] == 0:
        raise StoreError(f"{path}: nothing moves")
    line = axes[0]
    positions, rest = r @ line, rates @ line
    beside = max(
        float(np.abs(x - np.multiply.outer(x @ line, line)).max() / (np.abs(x @ line).max() or 1.0))
        for x in (r - r[0], rates)
    )
    if not beside <= off:
        raise StoreError(f"{path}: the motion is not along one line, but {beside:.2g} of its size off it")
    # orientation by the differences of positions, which do not depend on the origin
    several = np.ptp(scene.q) > 0
    here, there = (x - np.mean(x) * several for x in (positions[0], scene.q))
    if np.max(np.abs(here + there)) < np.max(np.abs(here - there)):
        line, positions, rest = -line, -positions, -rest
    where = ", ".join(f"{x:.4g}" for x in line)
    notes.append(f"motion along ({where}), off-axis motion at most {beside:.1g} of it")
    # across a line that is no axis the roundings of all frames add up
    return positions, rest, beside / (len(r) if np.max(np.abs(line)) < 1 - off else 1), line
