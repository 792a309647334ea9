"""Result of the study of faults: plain data, and its text."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from springcheck.studies.keeper import Table, document
from springcheck.studies.study import Studied
from springcheck.studies.tables import Documents
from springcheck.studies.text import resumed
from springcheck.text.lines import Lines, Row, plain, table
from springcheck.text.wording import count


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Verdicts of the checks on one fault."""

    name: str
    about: str
    size: float | None
    rejected_by: tuple[str, ...]
    missed_by: tuple[str, ...]
    """Checks that should have rejected it and did not."""
    limits: dict[str, float]
    """Smallest size that each check rejects."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FaultReport(Studied):
    """The whole study; a row of its table is a fault."""

    table_of: ClassVar[str] = "faults"

    results: tuple[Result, ...]

    def __repr__(self) -> str:
        missed = sum(bool(result.missed_by) for result in self.results)
        return f"FaultReport({count(len(self.results), 'fault')}, {missed} missed)"

    @property
    def status(self) -> Literal[0, 1]:
        """Exit status: 0 where every fault was rejected by all that must reject it."""
        return 1 if any(result.missed_by for result in self.results) else 0

    def lines(self, options: Namespace | None = None) -> Lines:
        """Every fault with what rejects it and the smallest size that is seen."""
        rows: list[Row] = []
        for result in self.results:
            limit = min(result.limits.values(), default=None)
            rows.append(
                (
                    plain(result.name, "bold red" if result.missed_by else ""),
                    "" if result.size is None else f"{result.size:.0e}",
                    "" if limit is None else f"{limit:.1e}",
                    ", ".join(result.rejected_by),
                )
            )
            rows.append(plain(f"  {result.about}", "dim"))
        rejected = sum(bool(result.rejected_by) for result in self.results)
        return [
            *resumed(self.resumed, "piece"),
            table(("fault", "size", "seen from", "rejected by"), rows, left=("fault",), prose="rejected by"),
            plain(),
            *(
                plain(f"FAILED {result.name}: not rejected by {', '.join(result.missed_by)}", "bold red")
                for result in self.results
                if result.missed_by
            ),
            plain(f"{rejected} of {len(self.results)} faults rejected"),
        ]

    def document(self) -> dict[str, Any]:
        """As one JSON document."""
        names = ("name", "about", "size", "rejected_by", "missed_by")
        return document(
            faults=[{name: getattr(result, name) for name in names} for result in self.results],
            limits={result.name: result.limits for result in self.results if result.limits},
        )

    def limits(self) -> Table:
        """The smallest size of each fault that each check rejects, for readers of the file."""
        rows = [(x.name, check, size) for x in self.results for check, size in x.limits.items()]
        fault, check, size = zip(*rows, strict=True) if rows else ((), (), ())
        sizes = np.array(size, np.float64)
        return Table(
            name="faults/limits", columns={"fault": list(fault), "check": list(check), "size": sizes}
        )


RESULTS: Documents[Result] = Documents(kind=Result, beginning="faults/results/", named="")
