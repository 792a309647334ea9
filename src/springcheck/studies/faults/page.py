"""Faults against checks in the report page."""

from __future__ import annotations

from springcheck.studies.charts import Bank, Chart, Scale, Tiles
from springcheck.studies.faults.result import FaultReport, Result

KINDS = (
    ("rejected", "good"),
    ("passed, or does not apply", "refused"),
    ("passed, and must be rejected", "wrong"),
)


def banks(found: FaultReport) -> list[Bank]:
    """One map: a row a fault, a column a check that rejects any."""
    results = found.results[::-1]
    checks = list(
        dict.fromkeys(
            name for one in found.results for name in (*one.rejected_by, *one.missed_by, *one.limits)
        )
    )
    if not checks:
        return []
    chart = Chart(
        title="Which check sees which fault, at its size in the table.",
        x=Scale(name="check", names=checks),
        y=Scale(name="fault", names=[one.name for one in results]),
        tiles=Tiles(
            kinds=KINDS,
            rows=[[_kind(one, name) for name in checks] for one in results],
            notes=[[_said(one, name) for name in checks] for one in results],
        ),
    )
    return [Bank(title="Faults and checks", charts=[chart])]


def _kind(one: Result, check: str) -> int:
    return 2 if check in one.missed_by else 0 if check in one.rejected_by else 1


def _said(one: Result, check: str) -> str:
    size = "" if one.size is None else f", size {one.size:.0e}"
    seen = f"; seen from {one.limits[check]:.2g}" if check in one.limits else ""
    return f"{one.about}{size}{seen}"
