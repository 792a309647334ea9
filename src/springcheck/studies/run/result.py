"""Result of a run: plain data."""

from __future__ import annotations

import shlex
from argparse import Namespace
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from springcheck import checks
from springcheck.checks.compare import Same
from springcheck.errors import StoreError
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Comparison, Trajectory, Verdict
from springcheck.studies.choose import LeftOut, left_out
from springcheck.studies.keeper import document, read
from springcheck.studies.run import text
from springcheck.studies.run.tally import MethodRun
from springcheck.studies.study import StudyResult
from springcheck.text.lines import Lines, Text, hanging, plain
from springcheck.text.wording import count

if TYPE_CHECKING:
    from springcheck.bath.heat import Heated
    from springcheck.figures.charts import Bank
    from springcheck.studies.run.drawable import Drawable


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
    """Measured temperatures of every run in a bath, next to those of its scheme."""
    resumed: tuple[str, ...] = ()
    others: tuple[str, ...] = ()
    """Methods that can serve the scene and do not run by default."""
    broke: Mapping[str, str] = field(default_factory=dict)
    """Methods that failed and should have run, and why: the others are stored and judged."""
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
        """Exit status of these verdicts; 2 where a method that should have run failed."""
        return 2 if self.broke else checks.status(self.verdicts)

    @property
    def not_judged(self) -> tuple[str, ...]:
        """Methods for which no check that applied distinguishes schemes: a pass proves nothing."""
        return checks.not_judged(self.verdicts)

    def lines(self, options: Namespace | None = None) -> Lines:
        scene, verdicts = self.scene, self.verdicts
        size = "" if scene.n == 1 else f", {scene.size}"
        out = [
            plain(f"{scene.title}: {scene.stepping}{size}", "bold"),
            *self._summary(),
            plain(),
            *text.methods(scene, self.runs),
            *text.same_motions(self.same),
            *text.temperatures(self.temperatures),
            *text.fractions(verdicts, "Is the engine right?  "),
            *text.failures(v for v in verdicts if v.method not in self.faults),
            *text.faults(self.faults, verdicts),
            *text.beyond(scene, self.runs),
        ]
        if self.judged_frames < scene.frames:
            which = "pieces at equal distances, the first and the last"
            of = f"Judged on {self.judged_frames} of {scene.frames} frames: {which}"
            out.append(plain(f"{of}; error, energy and same motion are of these"))
        out += text.unjudged(verdicts, self.path)
        failed = any(v.passed is False for v in verdicts)
        if (left := checks.not_exercised(scene)) and not failed:
            out += hanging("", left)
        out += self._left(all_of_them=getattr(options, "left_out", False))
        return [*out, *text.in_full(verdicts, options)]

    def banks(self, **chosen: Any) -> list[Bank]:
        from springcheck.studies.run.page import banks

        return banks(self, **chosen)

    def _left(self, *, all_of_them: bool) -> Lines:
        """How many methods did not run, or each of them with its reason."""
        count_of = len(self.left_out) + len(self.others)
        if not all_of_them:
            said = f"{count(count_of, 'method')} left out: --left-out says why, --all runs all that can"
            return [plain(said, "dim")] if count_of else []
        others = [plain(f"Left out {', '.join(self.others)}: not default methods; --all runs them")]
        return [*left_out(self.left_out), *others * bool(self.others)]

    def _summary(self) -> Lines:
        """Counts of the verdicts, the path of the store, and the next command."""
        failed, out = any(v.passed is False for v in self.verdicts), list[Any]()
        taken = f"; resumed from an interrupted run: {', '.join(self.resumed)}" if self.resumed else ""
        look = "bold red" if failed or self.broke else "bold yellow" if self.not_judged else "bold green"
        # standard error has the reasons
        broke = f"; not run: {', '.join(self.broke)}" if self.broke else ""
        out.append(plain(f"{self.counts}{broke}{taken}", look))
        if self.path is not None:
            name = shlex.quote(str(self.path))
            out.append(plain(f"Stored in {self.path}; next: springcheck plot {name}", "dim"))
        return out

    def kept_document(self) -> dict[str, Any]:
        """What a store holds of it beyond trajectories, verdicts and comparison, for `inspect`."""
        names = ("runs", "left_out", "same", "temperatures", "judged_frames", "others", "faults", "broke")
        return document(**{name: getattr(self, name) for name in names})

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


def restored(
    path: Path, scene: Scene, known: Any, verdicts: tuple[Verdict, ...], comparison: Comparison
) -> Report:
    """The report whose `kept_document` this is.  StoreError where a part of it is missing."""
    from springcheck.bath.heat import Heated

    def each(kind: Any, name: str) -> tuple[Any, ...]:
        rows = [{x: nan if y is None else y for x, y in row.items()} for row in known[name]]
        return tuple(
            kind(**{x: tuple(y) if isinstance(y, list) else y for x, y in row.items()}) for row in rows
        )

    try:
        return Report(
            scene=scene, path=path, verdicts=verdicts, comparison=comparison, runs=each(MethodRun, "runs"),
            left_out=each(LeftOut, "left_out"), same=each(Same, "same"), others=tuple(known["others"]),
            temperatures=each(Heated, "temperatures"), judged_frames=known["judged_frames"],
            faults=dict(known["faults"]), broke=dict(known["broke"]),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise StoreError(f"{path}: its report lacks {error}") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeat:
    """A stored trajectory next to its repetition."""

    method: str
    equal: bool
    """Bitwise equal to the numbers in the store."""
    as_written: bool
    """Bitwise equal to the numbers originally written, by their digest."""
    difference: float
    """Largest difference, relative to the initial energy norm; NaN where the two have different frames."""
    changed: tuple[str, ...]
    """Versions that have changed, as ``numpy 2.0.1 -> 2.4.6``."""

    @property
    def said(self) -> Text:
        """Its line in the report."""
        if self.equal:
            return plain(f"{self.method}: equal bit for bit")
        why = f"; {', '.join(self.changed)}" if self.changed else ""
        if self.as_written:
            why = "; equal bit for bit to what was written: the store was changed since"
        return plain(f"{self.method}: NOT equal, differs by up to {self.difference:.1e}{why}", "bold red")


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats(StudyResult):
    """The result of `springcheck run --from`."""

    repeats: tuple[Repeat, ...]

    @property
    def status(self) -> Literal[0, 1]:
        """Exit status: 0 all are equal."""
        return 0 if all(one.equal for one in self.repeats) else 1

    def lines(self, options: Namespace | None = None) -> Lines:
        return [one.said for one in self.repeats]

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
    report: Report | None = None
    """The report of the run; None in a store of an earlier version."""

    @cached_property
    def drawable(self) -> Drawable:
        """The part of its trajectories that is drawn."""
        from springcheck.studies.run.drawable import drawable

        return drawable(self.path)

    @property
    def notes(self) -> list[str]:
        """Notes on what the figures leave out."""
        return self.drawable.notes

    def lines(self, options: Namespace | None = None) -> Lines:
        out: Lines = [] if self.report is None else self.report.lines(options)
        if self.verdicts and self.report is None:
            out += [*text.fractions(self.verdicts), *text.failures(self.verdicts)]
            out += [*text.unjudged(self.verdicts, self.path), *text.in_full(self.verdicts, options)]
        if self.comparison is not None:
            out += [plain(), plain("Largest differences, relative to the initial energy norm:")]
            out.append(text.differences(self.comparison))
        return out

    def banks(self, **chosen: Any) -> list[Bank]:
        from springcheck.studies.run.page import banks

        return banks(self, **chosen)

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return document(verdicts=[one.stated for one in self.verdicts])
