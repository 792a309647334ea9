"""Trajectories of a file for identification: our own stores, and H5MD files of any other program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import formats, schemes, store
from springcheck.errors import IdentificationError, MethodError, SpringcheckError, StoreError
from springcheck.formats import columns as columns_of
from springcheck.identify.circle import on_a_circle
from springcheck.identify.record import of_size
from springcheck.identify.report import identify_arrays
from springcheck.identify.result import Identification
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import Floats, Integers

MOST_FRAMES = 20_000
"""Most frames that are identified, from the first on: every step shows the scheme."""

MOST_FAILED, MOST_RANDOM = 1000, 4000
"""Most frames that are identified of a trajectory that has failed, and of one with noise."""

MOST_OSCILLATORS = 16
"""Most moving coordinates that are identified."""

LENGTHS = {"nm": 1.0, "Angstrom": 0.1, "angstrom": 0.1, "A": 0.1, "Å": 0.1, "pm": 1e-3, "m": 1e9, "um": 1e3}
TIMES = {"ps": 1.0, "fs": 1e-3, "ns": 1e3, "s": 1e12, "ms": 1e9, "us": 1e6}
"""Lengths in nm and times in ps, by the names that H5MD files use."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FileStates(formats.States):
    """The states of a trajectory of a file of which some coordinates and frames may be left out."""

    label: str
    adaptive: str = ""
    """The title of the adaptive solver that one of our own stores says made them."""
    whole: Floats | None = None
    """Every coordinate of the file (f, N), those that were left out among them."""
    last: Floats | None = None
    """Unit of the last decimal of velocities (n,), where these were written as momenta."""


def read(
    path: Path, label: str | None = None, columns: Sequence[str] = (), step: float | None = None
) -> list[FileStates]:
    """The trajectories of a file, or the one of this label; `columns` and `step` as in `formats.read`.

    Raises StoreError where the file cannot be read, or has no such trajectory.
    """
    # an unfinished store has its journal beside it and no file yet
    if columns or (path.is_file() and not formats.is_store(path)):
        known = formats.read(path, columns, step, MOST_FRAMES + 1)
        names = list(known)
        found = [of_arrays(name, states) for name, states in known.items() if label in (None, name)]
    else:
        own = store.summary(path).runs
        names = [run.label for run in own]
        found = list(_ours(path, own, label))
    if not found:
        asked = f" {label!r}; it has {', '.join(names)}" if names else " to identify"
        raise StoreError(f"{path}: holds no trajectory{asked}")
    return found


def of_table(frame: Any) -> formats.States:
    """States from the columns of a pandas DataFrame; a named index is a column too."""
    if frame.index.name is not None:
        frame = frame.reset_index()
    columns = {str(name): frame[name] for name in frame.columns if columns_of.kind(str(name)) is not None}
    return columns_of.split(Path("the table"), {name: x.to_numpy(np.float64) for name, x in columns.items()})


def of_arrays(name: str, found: formats.States) -> FileStates:
    """A trajectory from a file's arrays, cut to the frames and coordinates that are used."""
    kept = slice(MOST_FRAMES)
    speed = next((x for x in (found.p, found.v) if x is not None), np.zeros_like(found.q))
    notes = [*found.notes]
    if len(found.t) > MOST_FRAMES:
        notes.append(f"the first {MOST_FRAMES} frames were looked at")
    p, v, mass = found.p, found.v, found.mass
    # one for each where velocities are momenta over masses, whose decimals the numbers do not show
    last = 2 * found.fixed.v if found.fixed and np.ndim(found.fixed.v) else None
    if v is not None and found.units:
        v = v * _velocity_factor(found.units, notes)
    which, remarks = chosen(found.q[kept], speed[kept], notes)
    if mass is not None and len(mass) != found.q.shape[1]:
        mass = np.repeat(mass, found.q.shape[1] // len(mass))
    p, v = (None if x is None else x[kept][:, which] for x in (p, v))
    return FileStates(
        label=name, t=found.t[kept], q=found.q[kept][:, which], p=p, v=v, notes=remarks, whole=found.q[kept],
        mass=None if mass is None else mass[which], roundoff=found.roundoff,
        last=None if last is None else last[which],
    )  # fmt: skip


def _ours(path: Path, runs: Sequence[store.Run], wanted: str | None) -> Iterator[FileStates]:
    scene = scenes.parse(store.scene_text(path), name=path.stem, where=f"{path} (scene)")
    for run in runs:
        if wanted in (None, run.label):
            piece = next(store.windows(path, run.label, MOST_FRAMES))
            kept = len(piece.t)
            notes = (f"the first {kept} of {run.frames} frames were looked at",) * (kept < run.frames)
            states = formats.States(t=piece.t, q=piece.q, p=piece.p, v=None, mass=scene.m, notes=notes)
            # a scene without rods has none to be seen
            yield replace(of_arrays(run.label, states), whole=None, adaptive=_adaptive(run))


def _adaptive(run: store.Run) -> str:
    try:
        scheme = schemes.scheme(str(run.parameters.get("scheme", "")))
    except MethodError:
        # the scheme is one of an engine that is not installed here
        return ""
    return scheme.title if scheme.has("adaptive") else ""


def _velocity_factor(units: Mapping[str, str], notes: list[str]) -> float:
    """Conversion factor of velocities to units of q over t, where the file names units that differ."""
    q, t, v = units.get("q", ""), units.get("t", ""), units.get("v", "")
    length, _, time = v.partition(" ")
    time = time.removesuffix("-1").removesuffix("^-1")
    if q == length and t == time:
        return 1.0
    if q in LENGTHS and length in LENGTHS and t in TIMES and time in TIMES:
        return LENGTHS[length] / LENGTHS[q] * TIMES[t] / TIMES[time]
    if q or t or v:
        notes.append(f"units of position {q!r}, time {t!r} and velocity {v!r} are taken as consistent")
    return 1.0


def chosen(q: Floats, p: Floats, notes: list[str]) -> tuple[Integers, tuple[str, ...]]:
    """Indices of the coordinates that move, `MOST_OSCILLATORS` at most, and notes with what is left out."""
    moving = np.flatnonzero((np.ptp(q, axis=0) > 0) | (np.ptp(p, axis=0) > 0))
    more = [f"{MOST_OSCILLATORS} of {len(moving)} moving coordinates were looked at"]
    chosen = moving[:MOST_OSCILLATORS] if len(moving) else np.arange(min(1, q.shape[1]))
    return np.asarray(chosen), (*notes, *(more if len(moving) > MOST_OSCILLATORS else []))


def titled(file: Path | str, label: str) -> str:
    """Name of a trajectory: its file, and its label where the file has several."""
    return str(file) if label == Path(file).name else f"{file}, {label}"


def identify_file(
    path: Path, trajectory: str | None, columns: Sequence[str], stated: Mapping[str, float | None]
) -> dict[str, Identification]:
    """Identify the trajectories of a file, by label; `stated` holds the command's mass, stiffness, friction
    and step.  Raises SpringcheckError, which names the trajectory."""
    given = {name: value for name, value in stated.items() if value is not None}
    for name, value in given.items():
        of_size(f"--{name}", value, zero=name in ("stiffness", "friction"))
    found = {}
    for states in read(path, trajectory, columns, given.get("step")):
        try:
            told = identify_states(states, **given)
            found[states.label] = of_springs(told, states.whole, stated="stiffness" in given)
        except SpringcheckError as error:
            raise type(error)(f"{titled(path, states.label)}: {error}") from error
        except (ArithmeticError, ValueError) as error:
            numbers = ", ".join(f"--{name} {value:g}" for name, value in given.items()) or "its numbers"
            raise IdentificationError(
                f"{titled(path, states.label)}: nothing can be worked out with {numbers}: {error}"
            ) from error
    return found


def of_springs(told: Identification, q: Floats | None, *, stated: bool) -> Identification:
    """The identification of states with positions q (f, N), which reports positions on a circle, as on a rod,
    unless springs are `stated` and fit.  Raises IdentificationError."""
    if told.verdict != "none" or q is None:
        return told
    with np.errstate(all="ignore"):
        said = on_a_circle(q)
    if said:
        raise IdentificationError(f"{said}; constraints are not part of springcheck")
    return told


def identify_states(
    states: FileStates, *, mass: float | None = None, stiffness: float | None = None,
    friction: float | None = None, step: float | None = None,
) -> Identification:  # fmt: skip
    """Identify the states of a file; a stated mass overrides the file's.  Raises IdentificationError."""
    m = states.mass if mass is None else np.full(states.q.shape[1], mass)
    last = None if states.p is not None else states.last
    found = identify_arrays(
        states.t, states.q, states.p, v=states.v, mass=m, stiffness=stiffness, friction=friction, step=step,
        last=last,
    )  # fmt: skip
    if states.adaptive and found.verdict == "none":
        why = f"made by {states.adaptive}: an adaptive solver has no fixed scheme to find"
        return replace(found, verdict="adaptive", statement=why, explanations=(), notes=(*states.notes, why))
    return replace(found, notes=(*states.notes, *_of_the_mass(states, m), *found.notes))


def _of_the_mass(states: FileStates, m: Floats | None) -> tuple[str, ...]:
    """Note on the file's mass, or that of momenta over velocities, where it is not the stated one (n,)."""
    if states.mass is not None and m is not None and np.any(states.mass != m):
        i = int(np.argmax(states.mass != m))
        return (f"the file has mass {states.mass[i]:.6g}, and the stated one, {m[i]:.6g}, was taken",)
    if states.p is None or states.v is None or not np.any(states.v):
        return ()
    i = int(np.argmax(np.max(np.abs(states.v), axis=0)))
    p, v = states.p[:, i], states.v[:, i]
    seen = float(p @ v / (v @ v))
    if m is None:
        return (f"the mass {seen:.6g} was taken from momenta over velocities",)
    if abs(seen - m[i]) <= max(1e-6, 10 * states.roundoff) * abs(m[i]):
        return ()
    return (
        f"momenta over velocities are {seen:.6g}, and the mass is stated as {m[i]:.6g}: the velocities were "
        "taken, and the momenta left out",
    )
