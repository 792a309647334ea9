"""Result of a study of stability: limits, failures, the table, and the stored form."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck import engines
from springcheck.errors import MethodError
from springcheck.figures.views import units
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.studies.keeper import document
from springcheck.studies.stability import propagators
from springcheck.studies.stability.longest import fastest, longest
from springcheck.studies.study import Studied
from springcheck.studies.tables import RecordForm
from springcheck.studies.text import left_out, resumed
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


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Stability(Studied):
    """All limits, and the methods left out and why; a row of its table is a method's limit."""

    table_of: ClassVar[str] = "methods"

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

    @property
    def said(self) -> str:
        """The limits in words: how many methods are stable up to which h w."""
        limits = [x.best for x in self.limits]
        never, always = limits.count(0.0), limits.count(np.inf)
        some = sorted({x for x in limits if 0 < x < np.inf})
        parts = [f"{count(limits.count(x), 'method')} up to {rounded_down(x, 4)}" for x in some[:3]]
        parts += [f"{len(some) - 3} other limits"] if len(some) > 3 else []
        parts += [f"{always} always"] if always else []
        return ", ".join([*parts, f"{never} never"] if never else parts)

    def lines(self, options: Namespace | None = None) -> Lines:
        scene, w = self.scene, fastest(self.scene)
        t_unit = units(scene).t
        h_w = f"h w = {abs(scene.step) * w:.4g}, w = {w:.6g} the largest angular frequency"
        rows, beyond = [], []
        for x in self.limits:
            largest = self.largest(x)
            cells = (x.method, *_steps([x.best, x.theory]), *_steps([largest], none="none", every="any"))
            rows.append([plain(cell, "" if x.follows and x.stated else "bold red") for cell in cells])
            beyond += [x.method] if largest < abs(scene.step) else []
        fits = "The scene's step is within the limit of every method." if rows else ""
        warned = f"The scene's step is too long for {', '.join(beyond)}." if beyond else fits
        return [
            plain(f"{scene.title}: limits of stability", "bold"),
            plain(f"Stable on a spring: {self.said}"),
            *resumed(self.resumed, "measurement"),
            plain(),
            table(
                ("method", "limit of h w", "in theory", f"largest step{f' ({t_unit})' * bool(t_unit)}"), rows
            ),
            plain(),
            plain(f"The scene's step h = {scene.step:g} has {h_w}."),
            plain(warned, "bold yellow" if beyond else ""),
            *(
                []
                if scene.system.is_linear
                else [plain("Largest steps are those of small oscillations.", "dim")]
            ),
            *(plain(line, "bold red") for line in self.failures),
            *left_out(self.left_out),
        ]

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


def _steps(values: Iterable[float], none: str = "never stable", every: str = "always stable") -> list[str]:
    words = {0.0: none, np.inf: every}
    return ["-" if np.isnan(x) else words.get(x) or rounded_down(x) for x in values]


LIMITS: RecordForm[Limit] = RecordForm(
    kind=Limit, beginning="stability/limits/", signal="radius", axes=("h_w",),
    auxiliary=("radius_predicted",), log=("h_w", "radius"),
)  # fmt: skip
"""A table for each method."""
