"""The chart of limits: spectral radius against h w."""

from __future__ import annotations

import numpy as np

from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import scheme_of
from springcheck.figures.naming import labelled
from springcheck.studies.stability.longest import fastest
from springcheck.studies.stability.result import Stability
from springcheck.text.wording import rounded_down


def banks(study: Stability) -> list[Bank]:
    """One chart: a line for each scheme, the measured spectral radii of methods as marks."""
    lines: dict[str, Curve] = {}
    marks = []
    for x in study.limits:
        group, name = scheme_of(x.method), x.scheme.partition(":")[0]
        lines.setdefault(x.scheme, Curve(name=name, group=group, x=x.h_w, y=x.radius_predicted))
        marks.append(Curve(name=x.method, group=group, x=x.h_w, y=x.radius, line=False, marks=True))
    if not marks:
        return []
    edges = sorted({x.best for x in study.limits if 0 < x.best < np.inf})
    rules = [Rule(axis="y", at=1.0, look="one", name="growing above")]
    rules += [Rule(axis="x", at=x, name=f"limit {rounded_down(x, 4)}") for x in edges]
    here = abs(study.scene.step) * fastest(study.scene)
    if here > min(x.h_w[0] for x in study.limits):
        rules.append(Rule(axis="x", at=here, name="this scene", look="here"))
    chart = labelled(Chart(
        title="Spectral radius of one step: lines in theory, marks as measured.",
        x=Scale(name="step times frequency, h \N{GREEK SMALL LETTER OMEGA}", log=True),
        y=Scale(name="spectral radius of one step", log=True, shown=(0.1, 100.0)),
        curves=[*lines.values(), *marks], rules=rules,
    ))  # fmt: skip
    heading = f"Stable up to h \N{GREEK SMALL LETTER OMEGA}: {study.said.replace('up to ', '')}"
    return [
        Bank(name="stability", title="Schemes (lines) and methods (marks)", heading=heading, charts=[chart])
    ]
