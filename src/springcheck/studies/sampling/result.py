"""Result of the study of sampling: one record for each thermostat, and the text of all."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from springcheck.figures.looks import title
from springcheck.physics.arrays import Floats
from springcheck.studies import keeper
from springcheck.studies.study import Studied
from springcheck.studies.tables import RecordForm
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, Row, plain, table
from springcheck.text.wording import count, number, seconds

TITLES = ("method", "configurational", "law", "kinetic", "law ", "limit", "law  ", "forces", "time")

CAPTION = (
    "Temperatures over the bath's at h omega = 0.5 and friction 0.4 omega; the largest stable h omega at",
    "friction omega, rounded down.  Each with its law.",
)

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
    kind=Sampled, beginning="sampling/", signal="configurational", axes=("turn",)
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Sampling(Studied):
    """The whole study; a row of its table is a thermostat."""

    table_of: ClassVar[str] = "methods"

    methods: tuple[Sampled, ...]

    def __repr__(self) -> str:
        apart = sum(x.departs for x in self.methods)
        return f"Sampling({count(len(self.methods), 'thermostat')}, {apart} not as their laws)"

    @property
    def status(self) -> int:
        """Exit status 1: a temperature contradicts its law; 2: nothing was run."""
        return int(any(x.departs for x in self.methods)) if self.methods else 2

    def lines(self, options: Namespace | None = None) -> Lines:
        rows: list[Row] = []
        for name in dict.fromkeys(x.scheme for x in self.methods):
            rows += [plain(title(name), "italic"), *(x.row for x in self.methods if x.scheme == name)]
        apart = [x.method for x in self.methods if x.departs]
        return [
            plain("How well thermostats sample a spring", "bold"), *map(plain, CAPTION),
            *resumed(self.resumed, "method"), plain(), table(TITLES, rows, left=("method",)),
            *(plain(f"{method}: a temperature is not its law's", "bold red") for method in apart),
            *left_out(self.left_out),
        ]  # fmt: skip

    def document(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return keeper.document(methods=self.methods, left_out=self.left_out)
