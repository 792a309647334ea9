"""Judging a trajectory in a file, whoever made it, against the law of a scheme."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import checks, engines, schemes
from springcheck.cli import shown
from springcheck.cli.taken import as_trajectory, states_in
from springcheck.errors import StoreError
from springcheck.formats import States
from springcheck.identify import scenes
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene
from springcheck.physics.trajectory import Trajectory, Verdict
from springcheck.studies import choose, keeper
from springcheck.studies.choose import left_out
from springcheck.text.lines import Lines, Text, plain, table
from springcheck.text.wording import count

COARSE = ("openmm:verlet@CUDA-double", "openmm:verlet@CUDA-mixed", "openmm:verlet@CUDA-single")
"""Methods as whose arithmetic the steps of a failed file are tried."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """The verdicts on a file."""

    path: Path
    scene: str
    scheme: str
    frames: int
    steps: int
    """Steps that the file covers."""
    of_steps: int
    """Steps of the scene."""
    notes: tuple[str, ...]
    verdicts: tuple[Verdict, ...]
    first_off: int = 0
    """The first step that is not the scheme's own; 0 where none is, or it is not known."""
    partial: bool = True
    """Whether a file that covers a part of the scene may pass."""

    @property
    def status(self) -> int:
        found = checks.status(self.verdicts)
        return found or 2 * (not self.partial and self.steps < self.of_steps)

    @property
    def not_judged(self) -> bool:
        """Whether no check that applied distinguishes the scheme from others."""
        return bool(checks.not_judged(self.verdicts))

    def document(self) -> dict[str, Any]:
        names = ("check", "value", "bound", "unit", "passed", "why", "sees")
        own = {x: getattr(self, x) for x in ("scene", "scheme", "frames", "notes", "not_judged")}
        own |= {"judged_steps": self.steps, "scene_steps": self.of_steps}
        verdicts = [{name: getattr(v, name) for name in names} for v in self.verdicts]
        return keeper.document(file=self.path, **own, verdicts=verdicts)

    def lines(self, *, verdicts: bool = False) -> Lines:
        """The answer in the first line, then what failed; every verdict with its reason on request."""
        failed = [v for v in self.verdicts if v.passed is False]
        frames = count(self.frames, "frame")
        out: Lines = [self._answer(), plain(f"{self.path}: {frames} of {self.scene}, {self._share()}", "dim")]
        if failed:
            cause, _, remedy = checks.cause_of(self.verdicts).partition(". What to do: ")
            cause = cause or "no reason that is known here"
            out += [plain(f"Diagnosis: {cause[:1].upper()}{cause[1:].rstrip('.')}.")]
            out += [plain(f"Do: {remedy[:1].upper()}{remedy[1:].rstrip('.')}.")] if remedy else []
        out += [plain(f"Note: {note}", "dim") for note in self.notes]
        if verdicts:
            return [*out, plain(), *self._in_full()]
        if failed:
            rows = [(v.check, f"{v.value:.3g}", f"{v.bound:.3g}", v.unit) for v in failed]
            out += [
                plain(),
                table(("failed check", "value", "bound", "unit"), rows, left=("failed check", "unit")),
            ]
            out += [plain(), plain("--verdicts shows every check with its reason.", "dim")]
        return out

    def _answer(self) -> Text:
        title = schemes.title(self.scheme)
        if self.status == 1:
            since = f", from step {self.first_off:,}" if self.first_off else ""
            return plain(f"FAILED: not {title}{since}.", "bold red")
        if self.not_judged:
            return plain(
                f"NOT JUDGED: no check that applies can tell {title} from other schemes.", "bold yellow"
            )
        if self.status == 2:
            return plain(
                f"NOT PASSED: it is {title} as far as it goes, {self._share()}; --partial accepts that.",
                "bold yellow",
            )
        passed = [v for v in self.verdicts if v.passed]
        sees = [x for v in passed if (x := v.sees.stiffness) is not None]
        seen = f"; smallest detectable stiffness error {min(sees):.1e}" if sees else ""
        return plain(f"PASSED: {title}, by {count(len(passed), 'check')}{seen}.", "bold green")

    def _share(self) -> str:
        """How much of the scene was judged."""
        if self.steps == self.of_steps:
            return f"all {self.of_steps:,} steps"
        return f"{self.steps:,} of {self.of_steps:,} steps"

    def _in_full(self) -> Lines:
        told = {True: plain("passed"), False: plain("FAILED", "bold red")}
        titles = ("check", "verdict", "value", "why")
        rows = [
            (v.check, told[v.passed], f"{v.value:.3g} of {v.bound:.3g} {v.unit}".strip(), v.reason)
            for v in self.verdicts
            if v.passed is not None
        ]
        others = [choose.LeftOut(method=v.check, reason=v.reason) for v in self.verdicts if v.passed is None]
        return [table(titles, rows, left=titles[:3], prose="why"), *left_out(others, "Not applicable:")]


def _shown(path: Path, states: States, scene: Scene) -> schemes.Scheme:
    """The one scheme that the states of a file show.  StoreError where they show several, or none."""
    schemes.bring(schemes.UNKNOWN)
    judged, run, _, _ = as_trajectory(path, states, scene, schemes.UNKNOWN.name)
    found = scenes.of_scene(judged, run)
    if found.scheme is None or not found.fits:
        raise StoreError(f"{path}: {found.statement}; state by --scheme what it should be")
    return schemes.scheme(found.scheme)


def _rounded_as(run: Trajectory, label: str) -> Trajectory:
    """The run of a program that rounds as this method does, its numbers as coarse as they are written."""
    how = engines.arithmetic(engines.parse(label))
    state, written = max(how.state, run.arithmetic.state), run.arithmetic.written
    return replace(run, arithmetic=replace(how, state=state, written=written))


def judge(
    path: Path,
    *,
    scene: str | Scene,
    scheme: str | None = None,
    columns: Sequence[str] = (),
    step: float | None = None,
    trajectory: str | None = None,
    differences: bool = False,
    arithmetic: str | None = None,
    partial: bool = True,
) -> Judgement:
    """Verdicts on the trajectory of a file.

    Without a `scheme` it is judged by the one that its states show.
    `differences` says that its velocities are differences of positions, which round by eps q/h;
    `arithmetic` names a method whose program rounds as that of the file; without `partial` a file that covers
    a part of the scene's steps does not pass.  SpringcheckError where it is unreadable or not of the scene.
    """
    found = load_scene(scene) if isinstance(scene, str) else scene
    if scheme is not None and scheme not in schemes.known():
        engines.names()  # those that are not asked for have schemes of their own
    known = schemes.scheme(scheme) if scheme is not None else None
    states = states_in(path, columns, step, trajectory)
    if known is None:
        known = _shown(path, states, found)
    judged, run, notes, taken = as_trajectory(path, states, found, known.name)
    if scheme is None:
        notes += (f"its states show {known.title} ({known.name}), and it is judged by that",)
    if differences:
        run = replace(run, rebuilds_velocity=True)
        notes += ("velocities were judged as differences of positions, as stated",)
    if arithmetic is not None:
        run = _rounded_as(run, arithmetic)
        notes += (
            f"judged with the arithmetic of {arithmetic}, as stated: {str(run.arithmetic) or 'double'}",
        )
    verdicts = [
        replace(v, passed=None, value=np.nan, bound=np.nan, why=taken[v.check]) if v.check in taken else v
        for v in checks.explained(judged, run, checks.judge(judged, run), scenes.diagnosis)
    ]
    if states.roundoff > 2.0**-53 or known.flow:
        verdicts.append(shown.other_scheme(judged, run, states))
    wrong = any(v.passed is False and v.check in checks.TELLING for v in verdicts)
    if wrong and arithmetic is None and run.arithmetic.is_double and not checks.cause_of(verdicts):
        rounded = ((label, checks.Case(trajectory=_rounded_as(run, label), scene=judged)) for label in COARSE)
        if label := next((label for label, case in rounded if checks.step_defect(case).passed), ""):
            notes += (f"every step is right in the arithmetic of {label}: --arithmetic {label} judges it so",)
    if wrong and checks.are_differences(checks.Case(trajectory=run, scene=judged)):
        notes += ("velocities are differences of the positions, which keep eps q/h of them: --differences",)
    return Judgement(
        path=path, scene=found.name, scheme=known.name, frames=len(run.t), notes=notes,
        verdicts=tuple(verdicts), steps=judged.steps, of_steps=found.steps, partial=partial,
        first_off=checks.first_off(judged, run) if wrong else 0,
    )  # fmt: skip
