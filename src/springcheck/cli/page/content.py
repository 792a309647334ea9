"""Contents of a report on a store and its studies: plain data, in memory that does not grow with its runs."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import checks, schemes, store
from springcheck.cli import inspect
from springcheck.cli.page import given
from springcheck.errors import SpringcheckError
from springcheck.figures import charts
from springcheck.figures.charts import Bank
from springcheck.figures.charts import plain as charts_as_data
from springcheck.figures.views import MOST_PANELS
from springcheck.physics import scenefile
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Verdict
from springcheck.store import Damage, Summary
from springcheck.studies.run.drawable import drawable
from springcheck.studies.run.page import banks
from springcheck.studies.run.result import Stored
from springcheck.text.lines import Lines, TextTable
from springcheck.text.wording import DIAGNOSIS


def sections(summary: Summary) -> tuple[list[dict[str, Any]], dict[str, Any], Stored | None, Lines]:
    """The studies of a store other than trajectories, the data of all their charts by name, its run, and the
    tables of the run as `inspect` prints them."""
    found: list[dict[str, Any]] = []
    data: dict[str, Any] = {}
    run, tables = None, Lines()
    for study, result in inspect.held(summary):
        lines = study.lines(result, path=summary.path)
        blocks = [line for line in lines if isinstance(line, TextTable) or str(line).strip()]
        if isinstance(result, Stored):
            run = result
            # what is above its first table stands in the page's head
            first = next((i for i, line in enumerate(blocks) if isinstance(line, TextTable)), len(blocks))
            tables = blocks[first:]
            continue
        mine = {f"{study.name}-{i}": charts.plain(bank) for i, bank in enumerate(result.banks())}
        data |= mine
        title = study.about[:1].upper() + study.about[1:]
        found.append({"name": study.name, "title": title, "blocks": blocks, "banks": list(mine)})
    return found, data, run, tables


PAGE_NUMBERS = 12_000
"""Most doubles in a page, at about 20 bytes each; longer data are strided."""
FEWEST_SHOWN = 50
"""Frames of each trajectory that are always included."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Passed:
    """The verdicts of one method."""

    method: str
    scheme: str
    verdicts: tuple[Verdict, ...]

    @property
    def found(self) -> str:
        """The diagnosis, the first check that failed, and why."""
        first = next((v for v in self.verdicts if v.passed is False), None)
        if first is None:
            return ""
        why, _, shown = first.why.partition(DIAGNOSIS)
        return (
            f"{self.method}: {shown}. {first.check}: {why}"
            if shown
            else f"{self.method} {first.check}: {why}"
        )

    def count(self, passed: bool | None) -> int:
        """Number of verdicts that passed, failed, or did not apply."""
        return sum(1 for verdict in self.verdicts if verdict.passed is passed)

    @property
    def judged(self) -> bool:
        """Whether a check that distinguishes schemes applied, or any failed."""
        return bool(self.count(False) or (self.verdicts and not checks.not_judged(self.verdicts)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """Data for the template."""

    title: str
    scene: Scene | None
    """None where a study has scenes of its own."""
    scene_text: str
    known: Mapping[str, Any]
    """Versions and machine, by name."""
    sections: Sequence[Mapping[str, Any]]
    """Of each study name and title, its text as lines and tables, the names of its charts in the data."""
    summary: Summary
    not_trusted: tuple[Damage, ...]
    methods: tuple[Passed, ...]
    result: Lines
    """Tables of the run, as `inspect` prints them."""
    stride: int
    """Stride of the stored frames in the page."""
    data: Mapping[str, Any]
    """Data for the scripts; non-finite numbers are spelled as in JavaScript."""

    @property
    def summary_line(self) -> str:
        """How many verdicts passed, or which failed."""
        return checks.summary([verdict for one in self.methods for verdict in one.verdicts])

    @property
    def finding(self) -> str:
        """Heading of its first chart, or else its title."""
        banks = iter(self.data["banks"].values())
        found = str(self.data["banks"].get("motion", next(banks, {})).get("foot", ""))
        return found.partition(" (phase portrait")[0] or self.title

    @property
    def not_exercised(self) -> str:
        """Features that a pass does not cover; empty for a study without a scene."""
        return checks.not_exercised(self.scene) if self.scene and self.methods else ""

    @property
    def failed(self) -> tuple[Passed, ...]:
        return tuple(one for one in self.methods if one.count(False))

    @property
    def name(self) -> str:
        """Name of the store, quoted for a shell."""
        return shlex.quote(self.summary.path.name)


def gather(path: Path, doubts: Sequence[Damage] | None = None) -> Content:
    """The contents of a report; `doubts` as far as known.  SpringcheckError without trajectory and study."""
    summary = store.summary(path)
    studies, banks, run, result = sections(summary)
    if not summary.runs and not studies:
        rest = "" if summary.complete else " yet: give the command that writes it again, it goes on"
        raise SpringcheckError(f"{path}: holds no trajectory and no study to report{rest}")
    text = store.scene_text(path) if "scene" in summary.root else ""
    name = str(summary.root.get("scene_name") or path.stem)
    scene = scenefile.parse(text, name=name, where=str(path)) if text else None
    rows = 2 + 2 * min(MOST_PANELS, scene.n if scene else 1)
    most = max(FEWEST_SHOWN, PAGE_NUMBERS // (rows * max(1, len(summary.runs))))
    pieces = {one.label: store.strided(path, one.label, most) for one in summary.runs}
    verdicts = run.verdicts if run else ()
    wrong = {verdict.method for verdict in verdicts if verdict.passed is False}
    if run and summary.runs and (motion := _motion(run, most)):
        banks["motion"] = motion
    return Content(
        title=scene.title if scene else path.name,
        scene=scene,
        scene_text=text,
        known=_known(summary),
        sections=studies,
        summary=summary,
        not_trusted=tuple(store.doubts(path) if doubts is None else doubts),
        # failures come first
        methods=tuple(sorted(_methods(summary, verdicts), key=lambda one: not one.count(False))),
        result=result,
        stride=max((stride for _, stride in pieces.values()), default=1),
        data=given.to_scripts(scene if summary.runs else None, [piece for piece, _ in pieces.values()], wrong)
        | {"banks": banks},
    )


def _motion(run: Stored, most: int) -> dict[str, Any] | None:
    """The charts that `plot` draws of a run, with the first engine of each scheme visible."""
    shown = drawable(run.path, most)
    found = banks(run, shown=shown, points=most)
    if not found:
        return None
    curves = [curve for bank in found for chart in bank.charts for curve in chart.curves]
    kept = {x.tobytes() for run in shown.runs.values() for x in (run.t, *run.q.T, *run.p.T)}

    def few(x: Sequence[float] | Floats) -> Sequence[float] | Floats:
        """Numbers that are not the file's own are written with seven digits."""
        return x if np.asarray(x).tobytes() in kept else [float(f"{value:.7g}") for value in x]

    # in a bath the temperature is the main result: its chart comes before the clouds of states
    found.sort(key=lambda bank: bank.name != "temperature")
    charts = [
        replace(
            chart,
            # what is said of modes is of the last, the fastest
            title=f"{bank.foot or bank.heading}. " * (chart is bank.charts[-(bank.name == "modes")])
            + chart.title,
            curves=[replace(curve, x=few(curve.x), y=few(curve.y)) for curve in chart.curves],
        )
        for bank in found
        for chart in bank.charts
    ]
    on = [curve.name for curve in curves if not curve.over] + [chart.title for chart in charts]
    return charts_as_data(
        Bank(
            title="Methods drawn",
            heading=found[0].heading,
            foot=found[0].foot,
            charts=charts,
            on=list(dict.fromkeys(on)),
        )
    )


def _known(summary: Summary) -> dict[str, Any]:
    """Versions and machine of the trajectories, or of the first study that records them."""
    if summary.runs:
        return dict(summary.runs[0].parameters)
    for name in summary.documents:
        document = store.decoded(summary.path, name)
        if isinstance(document, dict) and isinstance(machine := document.get("machine"), dict):
            return machine
    return {}


def _methods(summary: Summary, verdicts: Sequence[Verdict]) -> Iterator[Passed]:
    titles = {run.label: schemes.title(str(run.parameters.get("scheme", ""))) for run in summary.runs}
    for label in dict.fromkeys((*titles, *(verdict.method for verdict in verdicts))):
        mine = tuple(verdict for verdict in verdicts if verdict.method == label)
        yield Passed(method=label, scheme=titles.get(label, ""), verdicts=mine)
