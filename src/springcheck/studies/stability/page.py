"""Charts of limits, regions and resonances, in figures and in the report page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale, Tiles
from springcheck.figures.looks import scheme_of
from springcheck.figures.naming import labelled
from springcheck.studies.stability.limits import Limit
from springcheck.studies.stability.longest import fastest
from springcheck.studies.stability.regions import Region
from springcheck.studies.stability.resonance import Resonance
from springcheck.studies.stability.result import Stability

TURN_AXIS = "step times frequency, h \N{GREEK SMALL LETTER OMEGA}"


LEAST_SHOWN = 0.05
"""Least h w of a scene that is marked by a line: smaller ones are left of the curves."""


def banks(study: Stability) -> list[Bank]:
    """Charts of the limits, regions and resonances that were measured."""
    found = []
    if study.limits:
        here = abs(study.scene.step) * fastest(study.scene)
        found.append(
            Bank(name="stability-limits", title="Schemes (lines) and methods (marks)",
                 heading=_limits_said(study.limits), charts=[_limits(study.limits, here)])
        )  # fmt: skip
    if study.regions:
        of = f"{study.regions[0].points:,} points each"
        wrong = sum(x.wrong for x in study.regions)
        heading = f"Damped springs, {of}: {wrong} against theory.  The line is critical damping"
        found.append(
            Bank(name="stability-regions", title="Damped springs: where a method is stable", heading=heading,
                 charts=[*map(_region, study.regions)])
        )  # fmt: skip
    if study.resonances:
        found.append(
            Bank(name="stability-resonances", title="Multiple time steps: where they resonate",
                 charts=[*map(_resonance, study.resonances)])
        )  # fmt: skip
    return found


def _limits_said(limits: Sequence[Limit]) -> str:
    """How many methods are stable up to which h w, in a sentence."""
    said = [
        f"{n} never" if x <= 0 else f"{n} always" if not np.isfinite(x) else f"{n} up to {x:.4g}"
        for x, n in sorted(Counter(one.theory for one in limits).items())
    ]
    return f"Stable in h \N{GREEK SMALL LETTER OMEGA}: of {len(limits)} methods {', '.join(said)}"


def _limits(limits: Sequence[Limit], here: float) -> Chart:
    theories: dict[str, Curve] = {}
    measured = []
    for x in limits:
        group, name = scheme_of(x.method), x.scheme.partition(":")[0]
        theories.setdefault(x.scheme, Curve(name=name, group=group, x=x.h_w, y=x.radius_predicted))
        note = f"limit {x.limit:.9g}, theory {x.theory:.9g}"
        notes = [f"theory {y!r}; {note}" for y in x.radius_predicted.tolist()]
        measured.append(
            Curve(name=x.method, group=group, x=x.h_w, y=x.radius, line=False, marks=True, notes=notes)
        )
    edges = sorted({x.theory for x in limits if 0 < x.theory < np.inf})
    rules = [Rule(axis="y", at=1.0, look="one")]
    rules += [Rule(axis="x", at=x, name=f"limit {x:.4g}") for x in edges]
    if here > LEAST_SHOWN:
        rules.append(Rule(axis="x", at=here, name=f"this scene: {here:.3g}", look="here"))
    return labelled(Chart(
        title="Spectral radius of one step, measured on engines' own propagators; bounded up to 1.",
        x=Scale(name=TURN_AXIS, log=True),
        y=Scale(name="spectral radius of one step", log=True, shown=(0.1, 100.0)),
        curves=[*theories.values(), *measured], rules=rules,
    ))  # fmt: skip


KINDS = (
    ("stable, as theory says", "good"),
    ("unstable, as theory says", "refused"),
    ("stable, where theory is not", "limit"),
    ("unstable, where theory is not", "wrong"),
)


def _region(x: Region) -> Chart:
    kinds = np.where(x.stable, np.where(x.stable_predicted, 0, 2), np.where(x.stable_predicted, 3, 1))
    kinds[np.isnan(x.radius)] = -1
    critical = float(np.interp(0.0, np.log(x.damping_ratio), np.arange(len(x.damping_ratio))))
    return Chart(
        title=f"{x.method}: {x.points} points, {x.wrong} against theory, {x.undecided} decided by rounding.",
        x=Scale(name=TURN_AXIS, values=x.h_w.tolist()),
        y=Scale(name="damping ratio, c / 2\N{SQUARE ROOT}(k m)", values=x.damping_ratio.tolist()),
        tiles=Tiles(kinds=KINDS, rows=kinds.tolist()),
        # critical damping, as an index of rows
        rules=[Rule(axis="y", at=critical, look="one")],
        short=f"{x.method}: {x.wrong} against theory",
    )


def _resonance(x: Resonance) -> Chart:
    group = scheme_of(x.method)
    said = x.grows("h \N{GREEK SMALL LETTER OMEGA}")
    return Chart(
        title=f"{x.scene}: {x.method} {'resonates, it ' if x.bands else ''}{said}.",
        x=Scale(name="outer step times fast frequency"),
        y=Scale(name="growth of one step"),
        curves=[
            Curve(name="the exact map", group="exact", x=x.h_w, y=x.radius_predicted - 1),
            Curve(name=x.method, group=group, x=x.h_w, y=x.radius - 1, line=False, marks=True),
        ],
        rules=[Rule(axis="x", at=float(np.pi), name="\N{GREEK SMALL LETTER PI}")],
        short=f"{x.method} {said}",
    )
