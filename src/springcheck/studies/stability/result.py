"""Result of a study of stability: plain data, its failures, its text, and its stored forms."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck import engines, schemes
from springcheck.errors import MethodError
from springcheck.physics.exact import has_true_motion
from springcheck.physics.scene import Scene
from springcheck.studies.choose import LeftOut
from springcheck.studies.keeper import document
from springcheck.studies.stability import limits, propagators
from springcheck.studies.stability.limits import Limit
from springcheck.studies.stability.longest import fastest, longest
from springcheck.studies.stability.regions import Region
from springcheck.studies.stability.resonance import Resonance
from springcheck.studies.study import Studied
from springcheck.studies.tables import RecordForm
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, plain, table
from springcheck.text.wording import count, number

GROWTH_AGREES = 1e-6
"""Relative difference allowed between measured and predicted growth in double precision: the decaying
eigenvector's part in the fitted quarter of a run."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Stability(Studied):
    """All measurements, and the methods left out and why; a row of its table is a method's limit."""

    table_of: ClassVar[str] = "methods"

    scene: Scene
    limits: tuple[Limit, ...]
    regions: tuple[Region, ...]
    resonances: tuple[Resonance, ...]

    def __repr__(self) -> str:
        said = f"{len(self.failures)} not where theory puts them" if self.failures else "as theory has them"
        return f"Stability({self.scene.name!r}, {count(len(self.limits), 'limit')}, {said})"

    @property
    def passed(self) -> bool:
        """Whether limits, growth, regions and bands agree with theory, and any was measured."""
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
            if not x.agrees:
                said = f"limit {x.limit:.9g}, theory {x.theory:.9g}, allowed {x.bound:.1e}"
                whose = "; its steps are its scheme's, whose stated limit is wrong" if x.follows else ""
                out.append(f"{x.method}: {said}{whose}")
            if np.isfinite(x.theory):
                # a limit stated too low shows no growth there
                of = x.growth_predicted
                off = abs(x.growth_above / of - 1) if of else abs(x.growth_above)
                if not off <= growth_allowed(x):
                    out.append(
                        f"{x.method}: growth {x.growth_above:.9g} a step, predicted {x.growth_predicted:.9g}"
                    )
            if np.isfinite(x.growth_below) and not x.growth_below <= max(x.growth_below_predicted, 0) + 1e-4:
                out.append(f"{x.method}: grows by {x.growth_below:.3g} a step below its limit")
        wrong = (x for x in self.regions if x.wrong)
        out += [f"{x.method}: {count(x.wrong, 'point')} of the damped plane against theory" for x in wrong]
        out += [f"{x.method}: no point measured" for x in self.regions if x.unmeasured == x.points]
        apart = (y for y in self.resonances if y.bands != y.bands_predicted and not _apart(y) <= 1e-6)
        out += [f"{y.method}: bands {y.bands}, the exact map's {y.bands_predicted}" for y in apart]
        return out

    def refusal(self, found: Limit) -> str:
        """Why a method cannot serve this scene; "" where it can."""
        try:
            return engines.refusal(self.scene, engines.parse(found.method)) or ""
        except MethodError as error:
            return str(error)

    def largest(self, found: Limit) -> float:
        """The largest step of a method on this scene [T]: see `longest`.  NaN where it cannot serve it."""
        if self.refusal(found):
            return np.nan
        label = engines.parse(found.method)
        scheme = schemes.scheme(engines.method(label).scheme)
        if found.agrees:
            return longest(scheme, self.scene)
        # an engine that departs from its scheme's map: its measured limit scales the scheme's step
        own = limits.first_exit(label, propagators.theory)
        own = own if 0 < own < np.inf else found.limit
        here = longest(scheme, self.scene, own)
        return here if own == found.limit else here * found.limit / own

    @property
    def sentences(self) -> list[str]:
        """Results beside the table of limits, in sentences."""
        out = [
            f"{x.method}: stable in {np.count_nonzero(x.stable)} of {x.points} points of the damped plane, "
            f"{x.wrong} against theory{f', {x.unmeasured} not measured' * bool(x.unmeasured)}; "
            f"radii off by up to {x.off:.2f} roundings of the map's entries"
            + ", not counting those of its substeps, which may be larger"
            * (x.off > 1)
            for x in self.regions
        ]
        out += [
            f"{y.method}: {y.grows('h w_fast')}; the exact map agrees to {_apart(y):.1e}"
            for y in self.resonances
        ]
        return out + self.failures

    def lines(self, options: Namespace | None = None) -> Lines:
        largest_steps = [self.largest(x) for x in self.limits]
        out: Lines = [
            plain(f"{self.scene.title}: limits of stability, measured on one step", "bold"),
            *_of_scene(self, largest_steps),
            *resumed(self.resumed, "measurement"),
            plain(),
        ]
        if self.limits:
            rows = []
            for x, largest in zip(self.limits, largest_steps, strict=True):
                off = 0.0 if x.limit == x.theory else abs(x.limit - x.theory)
                predicted = np.nan if np.isnan(x.growth_above) else x.growth_predicted
                cells = (
                    x.method, *(number(y, ".9f", "none") for y in (x.limit, x.theory)), f"{off:.0e}",
                    *(number(y, ".7f") for y in (x.growth_above, predicted)),
                    "none" if largest == 0 else number(largest, ".4g", "any"),
                )  # fmt: skip
                rows.append([plain(cell, "" if x.agrees else "bold red") for cell in cells])
            titles = ("method", "limit h w", "theory", "off", "growth above", "predicted", "largest h here")
            out += [table(titles, rows), plain()]
        out += [plain(line) for line in self.sentences]
        refused = [LeftOut(method=x.method, reason=why) for x in self.limits if (why := self.refusal(x))]
        out += left_out(refused, "No largest step here by")
        out += left_out(self.left_out)
        return out

    def document(self) -> dict[str, Any]:
        """Plain data for JSON (a limit of None: there is none)."""
        return document(
            scene=self.scene.name,
            passed=self.passed,
            fastest=fastest(self.scene),
            h_w=abs(self.scene.step) * fastest(self.scene),
            methods=[
                _named(x, "method", "scheme", "limit", "theory", "bound", "agrees", "growth_above",
                       "growth_predicted", "growth_below")
                | {"points": _points(x), "largest_step": self.largest(x)}
                for x in self.limits
            ],
            regions=[
                {"stable": np.count_nonzero(x.stable)}
                | _named(x, "method", "points", "wrong", "undecided", "unmeasured", "off")
                for x in self.regions
            ],
            resonances=[_named(x, "method", "bands", "bands_predicted") for x in self.resonances],
            left_out=self.left_out,
            failures=self.failures,
        )  # fmt: skip


def _of_scene(study: Stability, largest_steps: Sequence[float]) -> Lines:
    """The scene's fastest motion, its step, and the methods for which it is too long."""
    scene, w = study.scene, fastest(study.scene)
    if not w and not scene.system.is_damped:
        said = " at its start, which says nothing of where it goes"
        if scene.system.is_linear:
            said = ": no step is too long for its stability"
        return [plain(f"  nothing in this scene oscillates{said}")]
    there = ", where its motion is stiffest" if has_true_motion(scene) else ", at its start"
    straight = scene.system.without("drive").is_linear
    where = "" if straight else there
    where += ", without its friction" * bool(scene.system.is_damped)
    here = f"its step h = {scene.step:g} makes h w = {abs(scene.step) * w:.4g}"
    out: Lines = [plain(f"  fastest angular frequency of this scene{where}: w = {w:.6g}; {here}")]
    h = abs(scene.step)
    beyond = [x.method for x, most in zip(study.limits, largest_steps, strict=True) if most < h]
    if beyond:
        out.append(plain(f"  beyond the limit there: {', '.join(beyond)}", "bold yellow"))
    elif any(most >= h for most in largest_steps):
        out.append(plain("  within the limit of every method measured here"))
    if not straight:
        said = "limits of small oscillations there; an anharmonic motion may be lost below them"
        out.append(plain(f"  {said}", "dim"))
    return out


def _named(found: Any, *names: str) -> dict[str, Any]:
    return {name: getattr(found, name) for name in names}


def _points(x: Limit) -> list[dict[str, float]]:
    points = zip(x.h_w, x.radius, x.radius_predicted, strict=True)
    return [{"h_w": a, "radius": b, "radius_predicted": c} for a, b, c in points]


def growth_allowed(limit: Limit) -> float:
    """Relative difference allowed between measured and predicted growth above the limit.

    Growth is the square root of the distance from the limit, so that a limit known to `bound` changes it by
    half of bound over that distance; in double precision it is known far better than `AGREED_LIMIT`.
    """
    if limit.theory in (0.0, np.inf) or limit.bound <= limits.AGREED_LIMIT:
        return GROWTH_AGREES
    return GROWTH_AGREES + 0.5 * limit.bound / (limit.theory * limits.NEAR_LIMIT)


def _apart(x: Resonance) -> float:
    a, b = np.array(x.bands), np.array(x.bands_predicted)
    return float(np.max(np.abs(a - b), initial=0.0)) if a.shape == b.shape else float("nan")


LIMITS: RecordForm[Limit] = RecordForm(
    kind=Limit,
    beginning="stability/limits/",
    signal="radius",
    axes=("h_w",),
    auxiliary=("radius_predicted",),
    log=("h_w", "radius"),
)
REGIONS: RecordForm[Region] = RecordForm(
    kind=Region,
    beginning="stability/regions/",
    signal="radius",
    axes=("log10_damping_ratio", "log10_h_w"),
    auxiliary=("radius_predicted",),
    log=("radius",),
    # H5Web draws every image on evenly spaced axes
    extra=lambda x: {"log10_damping_ratio": np.log10(x.damping_ratio), "log10_h_w": np.log10(x.h_w)},
)
RESONANCES: RecordForm[Resonance] = RecordForm(
    kind=Resonance,
    beginning="stability/resonances/",
    signal="radius",
    axes=("h_w",),
    auxiliary=("radius_predicted",),
)
"""Stored form of each kind of measurement: a table for each method."""
