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
    """One line of the report."""

    method: str
    scheme: str
    outcome: str
    steps: int
    """Steps that were taken."""
    message: str
    max_error: float
    """Largest distance from the exact solution (`Norm`); NaN where that is not known."""
    error_below: bool
    """Whether the error is only known to be below `max_error`: the exact solution is no better known."""
    energy_drift: float
    """(H - H0) / |H0| where it is largest, > 0 where energy is gained; absolute for H0 = 0.  With friction
    H - H of the exact solution in the place of H - H0, where that is known."""
    start_seconds: float
    run_seconds: float
    force_calls: int


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Report(StudyResult):
    """Everything that `springcheck run` says."""

    table_of: ClassVar[str] = "runs"
    scene: Scene
    path: Path | None
    """Where it was stored; None where nothing was asked to be kept."""
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
    """Methods that could have served the scene and were not among those that run by default."""
    broke: Mapping[str, str] = field(default_factory=dict)
    """Methods that were asked for and failed, and why: then nothing is stored."""
    faults: Mapping[str, str] = field(default_factory=dict)
    """The fault of each run of an engine that is broken on purpose."""

    trajectories: Mapping[str, Trajectory] = field(default_factory=dict)
    """Where nothing was kept on disk: the runs by label."""

    def __repr__(self) -> str:
        kept = f"; {str(self.path)!r}" if self.path else ""
        return f"Report({self.scene.name!r}, {count(len(self.runs), 'method')}: {self.counts}{kept})"

    def __getitem__(self, label: str) -> Trajectory:
        """The trajectory of a method, from memory or from its store.  KeyError where there is none."""
        return (read(self.path) if self.path else self.trajectories)[label]

    @property
    def drawable(self) -> Drawable:
        """Its trajectories, as far as they are drawn."""
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
        """Exit status of these verdicts; 2 where a method that was asked for failed."""
        return 2 if self.broke else checks.status(self.verdicts)

    @property
    def not_judged(self) -> tuple[str, ...]:
        """Methods whose scheme no check that applied could tell from another: a pass proves nothing."""
        return checks.not_judged(self.verdicts)

    def document(self) -> dict[str, Any]:
        """The report as plain data for JSON."""
        return document(
            scene=self.scene.name,
            store=self.path,
            runs=self.runs,
            judged_frames=self.judged_frames,
            left_out=self.left_out,
            verdicts=self.verdicts,
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
    """Bit for bit the numbers that the store holds."""
    as_written: bool
    """Bit for bit those that it held when it was written, by their digest."""
    difference: float
    """Largest, relative to the initial energy norm; NaN where the two do not have the same frames."""
    changed: tuple[str, ...]
    """Versions that are not what they were, as ``numpy 2.0.1 -> 2.4.6``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats(StudyResult):
    """Everything that `springcheck run --from` says."""

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
        """Its trajectories, as far as they are drawn."""
        from springcheck.studies.run.drawable import drawable

        return drawable(self.path)

    @property
    def notes(self) -> list[str]:
        """What a picture leaves out."""
        return self.drawable.notes

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return document(verdicts=self.verdicts)
