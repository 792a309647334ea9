"""Charts of sampling, in figures and in the report page: laws as lines, engines as marks."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import title
from springcheck.figures.overlay import share
from springcheck.figures.portraits import extremes
from springcheck.studies.sampling.measure import RATE, curve
from springcheck.studies.sampling.result import Sampled, Sampling

W_SIGN = "\N{GREEK SMALL LETTER OMEGA}"
IS_RIGHT = 0.01
"""Relative deviation of a temperature up to which it is called right."""

LINE_H_W = np.linspace(0.02, 1.5, 75)
"""h omega of the lines."""


def banks(study: Sampling) -> list[Bank]:
    """The two temperatures against the step; error against cost; limits of stability."""
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
            curves=[one for x in study.methods for one in _both(x, cost(x) * x.frames, x.off, x.off_law)],
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
        curves=[one for x in shown for one in _both(x, x.friction, x.limit, x.limit_law)],
    )
    found = [
        Bank(name="sampling-temperatures", title="Schemes (lines) and engines (marks)", charts=temperatures,
             heading=_temperatures(study.methods)),
        Bank(name="sampling-costs", title="Methods drawn", charts=costs,
             heading=_costs(study.methods)),
    ]  # fmt: skip
    limit = Bank(name="sampling-limits", title="Methods drawn", charts=[limits],
                 heading=_limits(shown))  # fmt: skip
    return [*found, limit] if shown else found


def _temperatures(methods: Sequence[Sampled]) -> str:
    """How many schemes sample right configurations at the step nearest to h omega = 1, and the worst."""
    i = int(np.argmin(np.abs(methods[0].turn - 1)))
    ends = ((x.scheme, float(x.configurational_law[i]), float(x.configurational[i])) for x in methods)
    off = {title(name): (measured if np.isnan(law) else law) - 1 for name, law, measured in ends}
    right = sum(abs(x) <= IS_RIGHT for x in off.values())
    name, at = max(off, key=lambda name: abs(off[name])), f"h {W_SIGN} = {methods[0].turn[i]:g}"
    said = f"At {at} positions have their temperature to {share(IS_RIGHT)} by {right} of {len(off)} schemes"
    hot = "hot" if off[name] > 0 else "cold"
    return said if right == len(off) else f"{said}; {name} is {share(abs(off[name]))} too {hot}"


def _costs(methods: Sequence[Sampled]) -> str:
    """Errors of the longest runs, of the best method and of the worst."""
    ends = ((x.scheme, float(x.off_law[-1]), float(x.off[-1])) for x in methods)
    off = {title(name): measured if np.isnan(law) else law for name, law, measured in ends}
    after = f"After {methods[0].frames[-1]:.0f} steps of h {W_SIGN} = {methods[0].turn[1]:g}"
    return extremes(off, f"{after} <q\N{SUPERSCRIPT TWO}> is off by {{}}")


def _limits(methods: Sequence[Sampled]) -> str:
    """The largest step that is stable at every friction, of the best scheme and of the worst."""
    least = {title(x.scheme): float(np.nanmin(x.limit_law)) for x in methods}
    low, high = min(least, key=lambda name: least[name]), max(least, key=lambda name: least[name])
    if least[low] >= 0.99 * least[high]:
        return f"Steps are stable up to h {W_SIGN} = {least[high]:.3g} at every friction"
    ends = (f"{least[name]:.3g} by {name}" for name in (low, high))
    return f"At every friction steps are stable up to h {W_SIGN} = {', and up to '.join(ends)}"


def _laws(methods: Sequence[Sampled], of: str) -> list[Curve]:
    """One line for each scheme that has a law."""
    found = dict.fromkeys(one.scheme for one in methods if np.any(np.isfinite(one.configurational_law)))
    return [Curve(name=title(name), group=name, x=LINE_H_W, y=curve(name, LINE_H_W, of)) for name in found]


def _both(one: Sampled, x: np.ndarray, y: np.ndarray, law: np.ndarray) -> list[Curve]:
    """The law of its scheme as a line, and what was measured as marks."""
    line = Curve(name=title(one.scheme), group=one.scheme, x=x, y=law)
    return [line, _marks(one, x, y, law)]


def _marks(one: Sampled, x: np.ndarray, y: np.ndarray, law: np.ndarray) -> Curve:
    notes = [f"law {value!r}" for value in np.asarray(law).tolist()]
    return Curve(name=one.method, group=one.scheme, x=x, y=y, line=False, marks=True, notes=notes)
