"""The figure of sampling: laws as lines, engines as marks with their standard errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import title
from springcheck.figures.overlay import share
from springcheck.physics.arrays import Floats
from springcheck.studies.sampling.measure import RATE, curve, limits
from springcheck.studies.sampling.result import Sampled, Sampling

W_SIGN, SQUARED = "\N{GREEK SMALL LETTER OMEGA}", "\N{SUPERSCRIPT TWO}"

IS_RIGHT = 0.01
"""Relative deviation of a temperature up to which it is called right."""

LINE_H_W = np.linspace(0.02, 1.5, 75)
"""h omega of the lines."""

LINE_FRICTION = np.geomspace(0.03, 10.0, 61)
"""Friction over omega of the lines."""


def banks(study: Sampling) -> list[Bank]:
    """The two temperatures against the step, and the largest stable step against friction."""
    if not study.methods:
        return []
    schemes = list(dict.fromkeys(x.scheme for x in study.methods))
    turn = Scale(name=f"step times frequency, h {W_SIGN}", shown=(0.0, 1.5))
    charts = [
        Chart(
            title=f"{said} temperature over the bath's, friction {RATE} {W_SIGN}", short=f"{said}, {formula}",
            x=turn, y=Scale(name="over that of the bath", shown=(0.6, 1.6)),
            curves=[
                *_lines(schemes, LINE_H_W, {x: curve(x, LINE_H_W, of) for x in schemes}),
                *(_marks(x, x.turn, getattr(x, of), getattr(x, f"{of}_law"), getattr(x, f"{of}_error"))
                  for x in study.methods),
            ],
            rules=[Rule(axis="y", at=1.0, look="one")],
        )
        for said, of, formula in (
            ("Configurational", "configurational", f"k<q{SQUARED}>/kT"),
            ("Kinetic", "kinetic", f"<p{SQUARED}>/m kT, of momenta as they are stored"),
        )
    ]  # fmt: skip
    stable = [x for x in study.methods if np.any(np.isfinite(x.limit_law) & (x.limit_law > 0))]
    names = list(dict.fromkeys(x.scheme for x in stable))
    limit = Chart(
        title="Largest stable step against friction", short="largest stable step",
        x=Scale(name=f"friction \N{GREEK SMALL LETTER GAMMA}/{W_SIGN}", log=True),
        y=Scale(name=f"largest h {W_SIGN}", shown=(0.0, 4.2)),
        curves=[
            *_lines(names, LINE_FRICTION, {x: limits(x, LINE_FRICTION) for x in names}),
            *(_marks(x, x.friction, x.limit, x.limit_law) for x in stable if np.any(np.isfinite(x.limit))),
        ],
    )  # fmt: skip
    return [
        Bank(name="sampling", title="Schemes (lines) and engines (marks)", heading=heading(study.methods),
             charts=[*charts, *[limit] * bool(stable)])
    ]  # fmt: skip


def heading(methods: Sequence[Sampled]) -> str:
    """How many schemes sample right configurations at the step nearest to h omega = 1, and the worst."""
    i = int(np.argmin(np.abs(methods[0].turn - 1)))
    pairs = ((x.scheme, float(x.configurational_law[i]), float(x.configurational[i])) for x in methods)
    off = {title(name): (measured if np.isnan(law) else law) - 1 for name, law, measured in pairs}
    right, name = sum(abs(x) <= IS_RIGHT for x in off.values()), max(off, key=lambda x: abs(off[x]))
    said = f"At h {W_SIGN} = {methods[0].turn[i]:g} the configurational temperature is right to "
    said += f"{share(IS_RIGHT)} in {right} of {len(off)} scheme{'s' * (len(off) > 1)}"
    too = "hot" if off[name] > 0 else "cold"
    return said if right == len(off) else f"{said}; {name} is {share(abs(off[name]))} too {too}"


def _lines(schemes: Sequence[str], x: Floats, laws: dict[str, Floats]) -> list[Curve]:
    """One line for each scheme that has a law."""
    finite = {name: np.where(np.isfinite(laws[name]), laws[name], np.nan) for name in schemes}
    return [
        Curve(name=title(name), group=name, x=x, y=y) for name, y in finite.items() if np.any(np.isfinite(y))
    ]


def _marks(one: Sampled, x: Floats, y: Floats, law: Floats, error: Floats | None = None) -> Curve:
    """What was measured, with bars of two standard errors."""
    notes = [f"law {value!r}" for value in np.asarray(law).tolist()]
    band = None if error is None else (y - 2 * error, y + 2 * error)
    return Curve(name=one.method, group=one.scheme, x=x, y=y, line=False, marks=True, notes=notes, band=band)
