"""Result of the study of sampling: one record for each thermostat, the text and the figure of all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale
from springcheck.figures.looks import title
from springcheck.figures.overlay import share
from springcheck.physics.arrays import Floats
from springcheck.studies.keeper import document
from springcheck.studies.sampling.laws import RATE, curve, limits
from springcheck.studies.study import Studied
from springcheck.studies.tables import RecordForm
from springcheck.text.lines import Lines, Row, plain, table
from springcheck.text.wording import count, number, seconds

TITLES = ("method", "configurational", "law", "kinetic", "law ", "limit", "law  ", "forces", "time")

DROPPED = ("forces", "law  ", "limit", "law ", "kinetic", "time")
"""Columns that a narrow terminal does without, the first one first."""

CAPTION = (
    "Temperatures over the bath's at h omega = 0.5 and friction 0.4 omega; the largest stable h omega at",
    "friction omega, rounded down.  Each with its law.",
)

W_SIGN, SQUARED = "\N{GREEK SMALL LETTER OMEGA}", "\N{SUPERSCRIPT TWO}"

IS_RIGHT = 0.01
"""Relative deviation of a temperature up to which it is called right."""

LINE_H_W = np.linspace(0.02, 1.5, 75)
"""h omega of the lines."""

LINE_FRICTION = np.geomspace(0.03, 10.0, 61)
"""Friction over omega of the lines."""

DEPARTING_ERRORS = 6.0
"""Standard errors from which a measured number contradicts its law: chance 2e-9."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampled:
    """One thermostat on springs.  Numbers without a law, and those of unbounded motion, are NaN."""

    method: str
    scheme: str
    title: str
    turn: Floats
    """h omega, ascending (g,), at friction 0.4 omega."""
    configurational: Floats
    """k <q**2>/kT, measured (g,)."""
    configurational_error: Floats
    configurational_law: Floats
    kinetic: Floats
    """<p**2>/m kT of the momenta as they are stored (g,)."""
    kinetic_error: Floats
    kinetic_law: Floats
    friction: Floats
    """gamma/omega (g,)."""
    limit: Floats
    """The largest h omega of stable steps, by the engine's own map, at each friction (g,)."""
    limit_law: Floats
    """The same of its law: infinite where none is up to 8, NaN where growth is too slow to be resolved."""
    force_calls: float
    """Force evaluations per step."""
    seconds: float
    """Seconds per step and spring, with a thousand side by side."""

    @property
    def departs(self) -> bool:
        """Whether a temperature contradicts its law."""
        with np.errstate(all="ignore"):
            q = np.abs(self.configurational - self.configurational_law) / self.configurational_error
            p = np.abs(self.kinetic - self.kinetic_law) / self.kinetic_error
        return bool(np.any(q > DEPARTING_ERRORS) or np.any(p > DEPARTING_ERRORS))

    @property
    def row(self) -> Row:
        """Its row in the report."""
        at = list(self.friction).index(1.0)
        temperatures = (
            self.configurational[1], self.configurational_law[1], self.kinetic[1], self.kinetic_law[1],
        )  # fmt: skip
        limits = (
            math.floor(x * 1e4) / 1e4 if np.isfinite(x) else x for x in (self.limit[at], self.limit_law[at])
        )
        method = plain("  " + self.method, "bold red" if self.departs else "")
        numbers = (number(one, ".4f", "none") for one in (*temperatures, *limits))
        return [method, *numbers, f"{self.force_calls:.3g}", seconds(self.seconds)]


SAMPLED: RecordForm[Sampled] = RecordForm(
    kind=Sampled, beginning="sampling/", signal="configurational", axes=("turn",),
    line=lambda x: f"{x.method}: configurational temperature {x.configurational[1]:.4f} of the bath's",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Sampling(Studied):
    """The whole study; a row of its table is a thermostat."""

    table_of: ClassVar[str] = "methods"
    forms: ClassVar = {"methods": SAMPLED}

    methods: tuple[Sampled, ...]

    def __repr__(self) -> str:
        apart = sum(x.departs for x in self.methods)
        return f"Sampling({count(len(self.methods), 'thermostat')}, {apart} not as their laws)"

    @property
    def status(self) -> int:
        """Exit status 1: a temperature contradicts its law; 2: nothing was run."""
        return int(any(x.departs for x in self.methods)) if self.methods else 2

    @property
    def title(self) -> str:
        return "How well thermostats sample a spring"

    def answer(self) -> Lines:
        return [plain(self.heading.replace(W_SIGN, "omega"))] if self.methods else []

    def tables(self) -> Lines:
        rows: list[Row] = []
        for name in dict.fromkeys(x.scheme for x in self.methods):
            rows += [plain(title(name), "italic"), *(x.row for x in self.methods if x.scheme == name)]
        apart = [x.method for x in self.methods if x.departs]
        return [
            *map(plain, CAPTION), table(TITLES, rows, drop=DROPPED),
            *(plain(f"{method}: a temperature is not its law's", "bold red") for method in apart),
        ]  # fmt: skip

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return document(methods=self.methods, left_out=self.left_out)

    @property
    def heading(self) -> str:
        """How many schemes sample right configurations at the step nearest to h omega = 1, and the worst."""
        i = int(np.argmin(np.abs(self.methods[0].turn - 1)))
        pairs = (
            (x.scheme, float(x.configurational_law[i]), float(x.configurational[i])) for x in self.methods
        )
        off = {title(name): (measured if np.isnan(law) else law) - 1 for name, law, measured in pairs}
        right, name = sum(abs(x) <= IS_RIGHT for x in off.values()), max(off, key=lambda x: abs(off[x]))
        said = f"At h {W_SIGN} = {self.methods[0].turn[i]:g}, {right} of {len(off)} schemes right to "
        said += share(IS_RIGHT)
        too = "hot" if off[name] > 0 else "cold"
        return said if right == len(off) else f"{said}; {name}: {share(abs(off[name]))} too {too}"

    def banks(self, **chosen: Any) -> list[Bank]:
        """The two temperatures against the step, and the largest stable step against friction."""
        if not self.methods:
            return []
        schemes = list(dict.fromkeys(x.scheme for x in self.methods))
        turn = Scale(name=f"step times frequency, h {W_SIGN}", shown=(0.0, 1.5))
        charts = [
            Chart(
                title=f"{said} temperature over the bath's, friction {RATE} {W_SIGN}",
                short=f"{said}, {formula}", x=turn, y=Scale(name="over that of the bath", shown=(0.6, 1.6)),
                curves=[
                    *_lines(schemes, LINE_H_W, {x: curve(x, LINE_H_W, of) for x in schemes}),
                    *(_marks(x, x.turn, getattr(x, of), getattr(x, f"{of}_law"), getattr(x, f"{of}_error"))
                      for x in self.methods),
                ],
                rules=[Rule(axis="y", at=1.0, look="one")],
            )
            for said, of, formula in (
                ("Configurational", "configurational", f"k<q{SQUARED}>/kT"),
                ("Kinetic", "kinetic", f"<p{SQUARED}>/m kT, of momenta as they are stored"),
            )
        ]  # fmt: skip
        stable = [x for x in self.methods if np.any(np.isfinite(x.limit_law) & (x.limit_law > 0))]
        names = list(dict.fromkeys(x.scheme for x in stable))
        limit = Chart(
            title="Largest stable step against friction", short="largest stable step",
            x=Scale(name=f"friction \N{GREEK SMALL LETTER GAMMA}/{W_SIGN}", log=True),
            y=Scale(name=f"largest h {W_SIGN}", shown=(0.0, 4.2)),
            curves=[
                *_lines(names, LINE_FRICTION, {x: limits(x, LINE_FRICTION) for x in names}),
                *(_marks(x, x.friction, x.limit, x.limit_law)
                  for x in stable if np.any(np.isfinite(x.limit))),
            ],
        )  # fmt: skip
        return [
            Bank(name="sampling", title="Schemes (lines) and engines (marks)", foot=self.heading,
                 heading=self.heading.partition(";")[0], charts=[*charts, *[limit] * bool(stable)])
        ]  # fmt: skip


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
