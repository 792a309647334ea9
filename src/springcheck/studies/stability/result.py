"""Result of a study of stability: limits, failures, tables, the chart, and the stored form."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck import engines, schemes
from springcheck.errors import MethodError
from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import scheme_of, title
from springcheck.figures.overlay import MOST_LETTERS
from springcheck.figures.views import units, with_unit
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.studies.keeper import document
from springcheck.studies.stability import propagators
from springcheck.studies.stability.longest import fastest, longest
from springcheck.studies.study import Studied
from springcheck.studies.tables import RecordForm
from springcheck.text.lines import Lines, plain, table
from springcheck.text.wording import count, rounded_down

AGREED = 1e-6
"""Relative tolerance of a limit in double precision."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limit:
    """Limit of one method on one spring."""

    method: str
    scheme: str
    limit: float
    """Largest h w with a bounded map, measured on the engine; infinity where there is none."""
    theory: float
    """The limit that the scheme states: 0 never stable, infinity always."""
    exact: float
    """The limit of the scheme's exact map, found by the same search at the engine's rounding."""
    bound: float
    """Largest difference of these limits that rounding explains."""
    h_w: Floats
    """h w of the points drawn (j,)."""
    radius: Floats
    """Measured spectral radius there."""
    radius_predicted: Floats

    @property
    def follows(self) -> bool:
        """Whether the engine's limit is that of its scheme's map."""
        return self.limit == self.exact or abs(self.limit - self.exact) <= self.bound

    @property
    def stated(self) -> bool:
        """Whether the stated limit is that of the scheme's map."""
        return self.theory == self.exact or abs(self.theory - self.exact) <= self.bound

    @property
    def best(self) -> float:
        """The limit in the most digits known: the stated one where everything agrees."""
        return self.theory if self.follows and self.stated else self.limit

    @property
    def line(self) -> str:
        """The limit in words."""
        return f"{self.method}: limit of h w {_steps([self.best])[0]}"


LIMITS: RecordForm[Limit] = RecordForm(
    kind=Limit, beginning="stability/limits/", signal="radius", axes=("h_w",),
    auxiliary=("radius_predicted",), log=("h_w", "radius"), line=lambda found: found.line,
)  # fmt: skip
"""A table for each method."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Stability(Studied):
    """All limits, and the methods left out and why; a row of its table is a method's limit."""

    table_of: ClassVar[str] = "methods"
    forms: ClassVar = {"limits": LIMITS}
    piece: ClassVar[str] = "measurement"

    scene: Scene
    limits: tuple[Limit, ...]

    def __repr__(self) -> str:
        said = f"{len(self.failures)} not as in theory" if self.failures else "as in theory"
        return f"Stability({self.scene.name!r}, {count(len(self.limits), 'limit')}, {said})"

    @property
    def passed(self) -> bool:
        """Whether any limit was measured, and all agree with theory."""
        return bool(self.limits) and not self.failures

    @property
    def status(self) -> Literal[0, 1]:
        """Exit status: 0 where `passed`."""
        return 0 if self.passed else 1

    @property
    def failures(self) -> list[str]:
        """Disagreements with theory, one sentence each."""
        out = []
        for x in self.limits:
            if not x.follows:
                out.append(f"{x.method}: limit {x.limit:.9g}, but its scheme's is {x.exact:.9g}")
            if not x.stated:
                out.append(f"{x.method}: its scheme states {x.theory:.9g}, but grows from {x.exact:.9g} on")
        return out

    def largest(self, found: Limit) -> float:
        """The largest step of a method on this scene [T], NaN where it is unknown (see `longest`)."""
        try:
            label = engines.parse(found.method)
            if engines.refusal(self.scene, label):
                return np.nan
        except MethodError:
            return np.nan
        return longest(propagators.scheme_of(label), self.scene, None if found.follows else found.limit)

    def said(self, *, short: bool = False) -> str:
        """Limits, each with its scheme, or in `short` and of several schemes with the number of methods."""
        found: dict[float, list[Limit]] = {}
        for x in sorted(self.limits, key=lambda x: (x.best == 0, x.best)):
            found.setdefault(x.best, []).append(x)
        parts = []
        for limit, some in found.items():
            titles = {title(schemes.scheme(scheme_of(x.method)).name) for x in some}
            who = count(len(some), "method") if len(titles) > 1 else titles.pop()
            named = _steps([limit], "never", "always", 4)[0]
            parts.append(f"{named} ({len(some) if short else who})")
        return ", ".join(parts)

    @property
    def title(self) -> str:
        return f"{self.scene.title}: limits of stability"

    def answer(self) -> Lines:
        return [plain(f"Largest stable h w on a spring: {self.said()}")]

    def tables(self) -> Lines:
        scene, w = self.scene, fastest(self.scene)
        rows, beyond = [], []
        for x in self.limits:
            largest = self.largest(x)
            cells = (x.method, *_steps([x.best, x.theory]), *_steps([largest], none="none", every="any"))
            rows.append([plain(cell, "" if x.follows and x.stated else "bold red") for cell in cells])
            beyond += [x.method] if largest < abs(scene.step) else []
        fits = "It is within the limit of every method." if rows else ""
        warned = f"It is too long for {', '.join(beyond)}." if beyond else fits
        h_w = f"h w = {abs(scene.step) * w:.4g}, w = {w:.6g} the largest angular frequency"
        titles = ("method", "limit of h w", "in theory", with_unit("largest step", units(scene).t))
        small = [plain("Largest steps are those of small oscillations.", "dim")]
        return [
            table(titles, rows),
            plain(),
            plain(f"The scene's step h = {scene.step:g} has {h_w}."),
            plain(warned, "bold yellow" if beyond else ""),
            *small * (not scene.system.is_linear),
            *(plain(line, "bold red") for line in self.failures),
        ]

    def banks(self, **chosen: Any) -> list[Bank]:
        """Spectral radius against h w: a line for each scheme, the measured radii of methods as marks."""
        lines: dict[str, Curve] = {}
        marks = []
        for x in self.limits:
            group, name = scheme_of(x.method), x.scheme.partition(":")[0]
            lines.setdefault(x.scheme, Curve(name=name, group=group, x=x.h_w, y=x.radius_predicted))
            marks.append(Curve(name=x.method, group=group, x=x.h_w, y=x.radius, line=False, marks=True))
        if not marks:
            return []
        edges = sorted({x.best for x in self.limits if 0 < x.best < np.inf})
        rules = [Rule(axis="y", at=1.0, look="one")]
        rules += [Rule(axis="x", at=x, name=f"limit {rounded_down(x, 4)}") for x in edges]
        here = abs(self.scene.step) * fastest(self.scene)
        if here > min(x.h_w[0] for x in self.limits):
            rules.append(Rule(axis="x", at=here, name="this scene", look="here"))
        h_w = "h \N{GREEK SMALL LETTER OMEGA}"
        chart = Chart(
            title="Spectral radius of one step: lines in theory, marks as measured.",
            x=Scale(name=f"step times frequency, {h_w}", log=True),
            y=Scale(name="spectral radius of one step: above 1 it grows", log=True, shown=(0.1, 100.0)),
            curves=[*lines.values(), *marks], rules=rules,
        )  # fmt: skip
        heading = f"Stable {h_w} (methods): {self.said(short=True)}"
        heading = heading if len(heading) <= MOST_LETTERS else f"Stability of {count(len(marks), 'method')}"
        return [
            Bank(name="stability", title="Schemes (lines) and methods (marks)", heading=heading,
                 charts=[chart], foot=f"{self.scene.title}: lines in theory, marks as measured")
        ]  # fmt: skip

    def document(self) -> dict[str, Any]:
        """Plain data for JSON (a limit of None: there is none)."""
        names = ("method", "scheme", "limit", "theory", "exact", "follows", "stated", "h_w", "radius",
                 "radius_predicted")  # fmt: skip
        return document(
            scene=self.scene.name, passed=self.passed, fastest=fastest(self.scene),
            h_w=abs(self.scene.step) * fastest(self.scene),
            methods=[
                {name: getattr(x, name) for name in names} | {"largest_step": self.largest(x)}
                for x in self.limits
            ],
            left_out=self.left_out, failures=self.failures,
        )  # fmt: skip


def _steps(
    values: Iterable[float], none: str = "never stable", every: str = "always stable", digits: int = 8
) -> list[str]:
    words = {0.0: none, np.inf: every}
    return ["-" if np.isnan(x) else words.get(x) or rounded_down(x, digits) for x in values]
