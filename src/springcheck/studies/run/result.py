"""Result of a run: plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from springcheck import checks
from springcheck.checks.compare import Same
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Comparison, Trajectory, Verdict
from springcheck.studies.choose import LeftOut
from springcheck.studies.keeper import document, read
from springcheck.studies.study import StudyResult
from springcheck.text.wording import count

if TYPE_CHECKING:
    from springcheck.studies.run.drawable import Drawable
    from springcheck.thermal.heat import Heated

FAULT = "fault"
"""Engine name in the labels of engines broken on purpose."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodRun:
    """One row of the report."""

    method: str
    scheme: str
    outcome: str
    steps: int
    """Steps that were taken."""
    message: str
    max_error: float
    """Largest distance from the exact solution (`Norm`); NaN where that is unknown."""
    error_below: bool
    """Whether `max_error` is only an upper bound: the uncertainty of the exact solution."""
    energy_drift: float
    """H - H0 over the scene's `energy_scale` where it is largest, > 0 where energy is gained.  With friction
    or a drive the exact solution's H replaces H0, where it is known."""
    start_seconds: float
    run_seconds: float
    force_calls: int


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Report(StudyResult):
    """The result of `springcheck run`."""

    table_of: ClassVar[str] = "runs"
    scene: Scene
    path: Path | None
    """Path of the store; None without one."""
    runs: tuple[MethodRun, ...]
    left_out: tuple[LeftOut, ...]
    verdicts: tuple[Verdict, ...]
    comparison: Comparison
    same: tuple[Same, ...]
    judged_frames: int
    """Frames of each run that were judged: all of them, unless the run is very long."""
    temperatures: tuple[Heated, ...] = ()
    """Measured temperatures of every run in a bath, beside those of its scheme."""
    resumed: tuple[str, ...] = ()
    others: tuple[str, ...] = ()
    """Methods that can serve the scene and do not run by default."""
    broke: Mapping[str, str] = field(default_factory=dict)
    """Methods that were requested and failed, and why: then nothing is stored."""
    faults: Mapping[str, str] = field(default_factory=dict)
    """The fault of each run of an engine that is broken on purpose."""

    trajectories: Mapping[str, Trajectory] = field(default_factory=dict)
    """Runs by label, of a report without a store."""

    def __repr__(self) -> str:
        kept = f"; {str(self.path)!r}" if self.path else ""
        return f"Report({self.scene.name!r}, {count(len(self.runs), 'method')}: {self.counts}{kept})"

    def __getitem__(self, label: str) -> Trajectory:
        """The trajectory of a method, from memory or from its store.  KeyError where there is none."""
        return (read(self.path) if self.path else self.trajectories)[label]

    @property
    def drawable(self) -> Drawable:
        """The part of its trajectories that is drawn."""
        from springcheck.studies.run.drawable import Drawable, drawable

        if self.path is not None:
            return drawable(self.path)
        runs = dict(self.trajectories)
        return Drawable(scene=self.scene, runs=runs, followed=runs, notes=[])

    @property
    def counts(self) -> str:
        """How many verdicts passed and failed, in words."""
        return checks.summary(self.verdicts)

    @property
    def status(self) -> Literal[0, 1, 2]:
        """Exit status of these verdicts; 2 where a method that was requested failed."""
        return 2 if self.broke else checks.status(self.verdicts)

    @property
    def not_judged(self) -> tuple[str, ...]:
        """Methods for which no check that applied distinguishes schemes: a pass proves nothing."""
        return checks.not_judged(self.verdicts)

    def document(self) -> dict[str, Any]:
        """The report as plain data for JSON."""
        return document(
            scene=self.scene.name,
            store=self.path,
            runs=self.runs,
            judged_frames=self.judged_frames,
            left_out=self.left_out,
            verdicts=[one.stated for one in self.verdicts],
            not_judged=self.not_judged,
            comparison=self.comparison,
            same_motion=self.same,
            faults=dict(self.faults),
            broke=dict(self.broke),
            others=self.others,
            **({"temperatures": self.temperatures} if self.temperatures else {}),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeat:
    """A stored trajectory beside its repetition."""

    method: str
    equal: bool
    """Bitwise equal to the numbers in the store."""
    as_written: bool
    """Bitwise equal to the numbers originally written, by their digest."""
    difference: float
    """Largest difference, relative to the initial energy norm; NaN where the two have different frames."""
    changed: tuple[str, ...]
    """Versions that have changed, as ``numpy 2.0.1 -> 2.4.6``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats(StudyResult):
    """The result of `springcheck run --from`."""

    repeats: tuple[Repeat, ...]

    @property
    def status(self) -> Literal[0, 1]:
        """Exit status: 0 all are equal."""
        return 0 if all(one.equal for one in self.repeats) else 1

    def document(self) -> dict[str, Any]:
        """Repetitions as plain data for JSON."""
        return document(repeats=self.repeats)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stored(StudyResult):
    """The stored data of a run."""

    path: Path
    verdicts: tuple[Verdict, ...]
    comparison: Comparison | None
    status: int = 0

    @cached_property
    def drawable(self) -> Drawable:
        """The part of its trajectories that is drawn."""
        from springcheck.studies.run.drawable import drawable

        return drawable(self.path)

    @property
    def notes(self) -> list[str]:
        """Notes on what the figures leave out."""
        return self.drawable.notes

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return document(verdicts=[one.stated for one in self.verdicts])
