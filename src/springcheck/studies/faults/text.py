"""The report of the negative controls as text."""

from __future__ import annotations

from argparse import Namespace

from springcheck.studies.faults.result import FaultReport
from springcheck.studies.text import resumed
from springcheck.text.lines import Lines, Row, plain, table


def lines(found: FaultReport, options: Namespace | None = None) -> Lines:
    """Every fault with what rejects it and the smallest size that is seen."""
    rows: list[Row] = []
    for result in found.results:
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
    rejected = sum(bool(result.rejected_by) for result in found.results)
    out: Lines = [
        *resumed(found.resumed, "piece"),
        table(("fault", "size", "seen from", "rejected by"), rows, left=("fault",), prose="rejected by"),
        plain(),
        *(
            plain(f"FAILED {result.name}: not rejected by {', '.join(result.missed_by)}", "bold red")
            for result in found.results
            if result.missed_by
        ),
        plain(f"{rejected} of {len(found.results)} faults rejected"),
    ]
    return out
