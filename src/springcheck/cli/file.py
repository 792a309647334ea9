"""Judging a trajectory that stands in a file, whoever made it, against the law of a scheme."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import checks, schemes, store
from springcheck.errors import IdentificationError, StoreError
from springcheck.formats import States, is_hdf5, read, read_hdf5
from springcheck.identify.files import identify_states, of_arrays
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene
from springcheck.physics.trajectory import Outcome, Trajectory, Verdict
from springcheck.studies import keeper
from springcheck.text.lines import Lines, plain, table
from springcheck.text.wording import count

TIMES = "times were taken as whole numbers of steps from the first frame on"
NOT_JUDGED = "not judged: nothing that applies to these states could tell the scheme from another"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """The verdicts on a file."""

    path: Path
    scene: str
    scheme: str
    frames: int
    notes: tuple[str, ...]
    verdicts: tuple[Verdict, ...]

    @property
    def status(self) -> int:
        """Exit status of these verdicts."""
        return checks.status(self.verdicts)

    @property
    def not_judged(self) -> bool:
        """Whether nothing that applied could tell the scheme from another."""
        return bool(checks.not_judged(self.verdicts))

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        names = ("check", "value", "bound", "unit", "passed", "why", "sees")
        return keeper.document(
            file=self.path,
            scene=self.scene,
            scheme=self.scheme,
            frames=self.frames,
            notes=self.notes,
            not_judged=self.not_judged,
            verdicts=[{name: getattr(v, name) for name in names} for v in self.verdicts],
        )

    def lines(self) -> Lines:
        """The report as text."""
        told = {True: plain("passed"), False: plain("FAILED", "bold red"), None: plain("-")}
        rows = [
            (
                v.check, told[v.passed],
                "" if v.passed is None else f"{v.value:.3g} of {v.bound:.3g} {v.unit}".strip(), v.reason,
            )
            for v in self.verdicts
        ]  # fmt: skip
        frames, scheme = count(self.frames, "frame"), schemes.title(self.scheme)
        head = f"{self.path}: {frames} of {self.scene}, judged as {scheme}"
        return [
            plain(head, "bold"),
            *(plain(f"  {note}") for note in self.notes),
            plain(),
            table(
                ("check", "verdict", "value", "why"), rows, left=("check", "verdict", "value"), prose="why"
            ),
            *([plain(NOT_JUDGED, "bold yellow")] if self.not_judged else ()),
        ]


def judge(
    path: Path,
    *,
    scene: str | Scene,
    scheme: str,
    columns: Sequence[str] = (),
    step: float | None = None,
    trajectory: str | None = None,
) -> Judgement:
    """The verdicts on the trajectory of a file.

    Raises SpringcheckError, in one line, where it cannot be read or is not of the scene.
    """
    found = load_scene(scene) if isinstance(scene, str) else scene
    known = schemes.scheme(scheme)
    states = states_in(path, columns, step, trajectory)
    judged, run, notes = as_trajectory(path, states, found, known.name)
    verdicts = [
        # the run has the scene's times, not the file's
        replace(v, passed=None, why=TIMES) if v.check == "times" and np.any(states.t != run.t) else v
        for v in checks.judge(judged, run)
    ]
    if states.roundoff > 2.0**-53:
        verdicts.append(_shown(judged, run, states))
    return Judgement(
        path=path, scene=found.name, scheme=known.name, frames=len(run.t), notes=notes,
        verdicts=tuple(verdicts),
    )  # fmt: skip


def _shown(scene: Scene, run: Trajectory, states: States) -> Verdict:
    """Whether the states as a whole show another scheme.

    Few digits leave room for many schemes in every single step, as the other checks look at them; the map
    that fits all steps together is known far better.
    """

    def verdict(passed: bool | None, why: str) -> Verdict:
        value, bound = (np.nan, np.nan) if passed is None else (float(not passed), 0.0)
        return Verdict(
            method=run.label, check="identified", value=value, bound=bound, unit="other schemes",
            passed=passed, why=why,
        )  # fmt: skip

    # as they are written: projected on a line they would not show their decimals
    mass = np.repeat(scene.m, states.q.shape[1] // scene.n)
    try:
        found = identify_states(of_arrays(run.label, replace(states, mass=mass)), step=scene.step)
    except (IdentificationError, ArithmeticError, ValueError) as error:
        return verdict(None, f"no scheme can be read from these states: {error}")
    if not (found.fits and found.verdict in ("named", "not told apart")):
        return verdict(None, "no one scheme is read from these states")
    names = {found.scheme, *found.aliases}
    for one in found.candidates:
        names |= {one.scheme, *one.aliases}
    return verdict(run.scheme in names, f"all states together: {found.statement}")


def states_in(
    path: Path, columns: Sequence[str] = (), step: float | None = None, label: str | None = None
) -> States:
    """The one trajectory of a file, or that of this label.  StoreError where there are several or none."""
    if not is_hdf5(path):
        return read(path, columns, step)
    found = _in_hdf5(path, columns)
    if label is None and len(found) == 1:
        return next(iter(found.values()))
    if label not in found:
        raise StoreError(
            f"{path}: holds {len(found)} trajectories; choose by --trajectory: {', '.join(found)}"
        )
    return found[label]


def _in_hdf5(path: Path, columns: Sequence[str]) -> dict[str, States]:
    """Trajectories of a store of ours, of an H5MD file of any program, or of datasets by their names."""
    try:
        own = () if columns else store.summary(path).runs
    except StoreError:
        own = ()
    found: dict[str, States] = {}
    for run in own:
        # one frame more than is looked at in a piece of a very long run
        piece = next(store.windows(path, run.label, run.frames + 1))
        found[run.label] = States(t=piece.t, q=piece.q, p=piece.p, v=None, mass=None)
    if found:
        return found
    if columns or not store.is_h5md(path):
        return read_hdf5(path, columns)
    for name, group in store.read_foreign(path).items():
        found[name] = States(
            t=group.t,
            q=group.q.reshape(len(group.t), -1),
            p=None,
            v=np.reshape(np.asarray(group.v), (len(group.t), -1)),
            mass=group.mass,
            roundoff=max(2.0**-53, group.roundoff),
        )
    return found


def as_trajectory(
    path: Path, states: States, scene: Scene, scheme: str
) -> tuple[Scene, Trajectory, tuple[str, ...]]:
    """States as a trajectory of a scene with the file's grid and start, and notes on what was done to them.

    StoreError where they are not of the scene: another number of particles, other times, another start.
    """
    notes: list[str] = []
    q = states.q
    other = states.p if states.p is not None else np.asarray(states.v)
    if q.shape[1] == 3 * scene.n:
        q, other = _along(path, q, other, scene, notes, max(1e-6, 4 * states.roundoff))
    if q.shape[1] != scene.n:
        raise StoreError(f"{path}: {q.shape[1]} positions a frame, {scene.n} in scene {scene.name}")
    p = other if states.p is not None else other * scene.m
    if len(q) < 2:
        raise StoreError(f"{path}: holds {len(q)} frame; two are needed")
    if not np.isfinite(states.t).all():
        raise StoreError(f"{path}: row {int(np.argmin(np.isfinite(states.t))) + 1} of t is not finite")
    every = round(float(states.t[1] - states.t[0]) / scene.step)
    t = np.arange(len(q), dtype=np.float64) * max(every, 1) * scene.step
    off = np.abs(states.t - states.t[0] - t)
    allowed = 1e-9 * np.abs(t + scene.step) + 2 * states.roundoff * np.abs(states.t)
    if every < 1 or np.any(off > allowed):
        row = int(np.argmax(off > allowed))
        raise StoreError(
            f"{path}: row {row + 1} is at t = {states.t[row]:.12g}; frames lie whole steps of "
            f"{scene.step:g} apart in scene {scene.name}"
        )
    if np.any(states.t != t):
        notes.append(TIMES)
    size = scene.system.norm(q[0] - scene.q, p[0] - scene.p)
    if not size <= max(1e-9, 10 * states.roundoff):
        raise StoreError(
            f"{path}: its first frame is {float(size):.2g} of the amplitude off the start of {scene.name}"
        )
    if size > 0:
        notes.append("the start was taken as it is written in the file")
    if states.roundoff > 2.0**-53:
        notes.append(f"numbers are written to {states.roundoff:.1g}, and judged to that")
    steps = (len(q) - 1) * every
    if steps < scene.steps:
        notes.append(f"ends after {steps:,} of the scene's {scene.steps:,} steps")
    judged = replace(scene, q=q[0].copy(), p=p[0].copy(), steps=steps, every=every, quantities=("q", "p"))
    run = Trajectory(
        label=path.name, scheme=scheme, t=t, q=np.ascontiguousarray(q), p=np.ascontiguousarray(p),
        step=scene.step, every=every, outcome=Outcome(status="complete", step=steps),
        arithmetic=Arithmetic(name="as written", state=states.roundoff),
    )  # fmt: skip
    return judged, run, tuple(notes)


def _along(
    path: Path, q: Floats, other: Floats, scene: Scene, notes: list[str], off: float
) -> tuple[Floats, Floats]:
    """Motions in space (f, 3n) along the one line that they keep to (f, n), but for `off` of their size."""
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
    if np.max(np.abs(positions[0] + scene.q)) < np.max(np.abs(positions[0] - scene.q)):
        line, positions, rest = -line, -positions, -rest
    where = ", ".join(f"{x:.4g}" for x in line)
    notes.append(f"motion along ({where}), at most {beside:.1g} of its size beside it")
    return positions, rest
