"""Charts of sampling, in figures and in the report page: laws as lines, engines as marks."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import title
from springcheck.studies.sampling.measure import RATE, curve
from springcheck.studies.sampling.result import Sampled, Sampling

FINE = np.linspace(0.02, 1.5, 75)
"""h omega of the lines."""


def banks(study: Sampling) -> list[Bank]:
    """The two temperatures against the step; what an error costs; where steps are stable."""
    if not study.methods:
        return []
    turn = Scale(name="step times frequency, h \N{GREEK SMALL LETTER OMEGA}", shown=(0.0, 1.5))
    temperatures = [
        Chart(
            title=f"{said} temperature over the bath's, friction {RATE} \N{GREEK SMALL LETTER OMEGA}",
            short=f"{said}, {formula}", x=turn, y=Scale(name="over that of the bath", shown=(0.4, 1.8)),
            curves=[
                *_laws(study.methods, of),
                *(_marks(x, x.turn, getattr(x, of), getattr(x, f"{of}_law")) for x in study.methods),
            ],
            rules=[Rule(axis="y", at=1.0, look="one")],
        )
        for said, of, formula in (
            ("Configurational", "configurational", "k<q\N{SUPERSCRIPT TWO}>/kT"),
            ("Kinetic", "kinetic", "<p\N{SUPERSCRIPT TWO}>/m kT, of momenta as they are stored"),
        )
    ]  # fmt: skip
    costs = [
        Chart(
            title=f"What <q\N{SUPERSCRIPT TWO}> is off, against {said}", short=f"against {said}",
            x=Scale(name=said, log=True), y=Scale(name="root mean square of k<q\N{SUPERSCRIPT TWO}>/kT - 1",
                                                  log=True),
            curves=[
                part
                for x in study.methods
                for part in (
                    Curve(name=title(x.scheme), group=x.scheme, x=cost(x) * x.frames, y=x.off_law),
                    _marks(x, cost(x) * x.frames, x.off, x.off_law),
                )
            ],
        )
        for said, cost in (
            ("force calls a spring", attrgetter("force_calls")),
            ("seconds a spring, of 1,000 side by side", attrgetter("seconds")),
        )
    ]  # fmt: skip
    shown = [x for x in study.methods if np.any(np.isfinite(x.limit_law) & (x.limit_law > 0))]
    limits = Chart(
        title="The largest stable step against friction: second moments stay bounded below.",
        x=Scale(name="friction \N{GREEK SMALL LETTER GAMMA}/\N{GREEK SMALL LETTER OMEGA}", log=True),
        y=Scale(name="largest h \N{GREEK SMALL LETTER OMEGA}", shown=(0.0, 4.2)),
        curves=[
            part
            for x in shown
            for part in (
                Curve(name=title(x.scheme), group=x.scheme, x=x.friction, y=_finite(x.limit_law)),
                _marks(x, x.friction, _finite(x.limit), x.limit_law),
            )
        ],
    )
    found = [
        Bank(name="sampling-temperatures", title="Schemes (lines) and engines (marks)", charts=temperatures,
             heading="Thermostats on a spring: which temperature is too cold, and from which step on"),
        Bank(name="sampling-costs", title="Methods drawn", charts=costs,
             heading="What an error of <q\N{SUPERSCRIPT TWO}> costs: noise, then the scheme's own bias"),
    ]  # fmt: skip
    limit = Bank(name="sampling-limits", title="Methods drawn", charts=[limits],
                 heading="Stability of thermostats against friction")  # fmt: skip
    return [*found, limit] if shown else found


def _laws(methods: Sequence[Sampled], of: str) -> list[Curve]:
    """One line for each scheme that has a law."""
    found = dict.fromkeys(one.scheme for one in methods if np.any(np.isfinite(one.configurational_law)))
    return [Curve(name=title(name), group=name, x=FINE, y=curve(name, FINE, of)) for name in found]


def _marks(one: Sampled, x: np.ndarray, y: np.ndarray, law: np.ndarray) -> Curve:
    notes = [f"law {value!r}" for value in np.asarray(law).tolist()]
    return Curve(name=one.method, group=one.scheme, x=x, y=y, line=False, marks=True, notes=notes)


def _finite(x: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(x), x, np.nan)
