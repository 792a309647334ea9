"""Faults against checks, and how small a fault each check sees, in figures and in the report page."""

from __future__ import annotations

from collections.abc import Sequence

from springcheck.figures.charts import Bank, Chart, Curve, Scale, Tiles
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
    return [
        Bank(name="faults-checks", title="Faults and checks", charts=[chart]),
        *([_limits(results)] if any(one.limits for one in results) else []),
    ]


def _limits(results: Sequence[Result]) -> Bank:
    """A row a fault, a mark for each check that sees it, where it begins to."""
    shown = [one for one in results if one.limits]
    checks = dict.fromkeys(name for one in shown[::-1] for name in one.limits)
    curves = [
        Curve(
            name=name,
            group=name,
            x=[one.limits[name] for one in shown if name in one.limits],
            y=[float(j) for j, one in enumerate(shown) if name in one.limits],
            line=False,
            marks=True,
        )
        for name in checks
    ]
    chart = Chart(
        title="How small a fault is seen: one spring, h \N{GREEK SMALL LETTER OMEGA} = 0.09, 200 steps.",
        x=Scale(name="smallest relative size that the check rejects", log=True),
        y=Scale(name="fault", names=[one.name for one in shown]),
        curves=curves,
    )
    return Bank(name="faults", title="Checks", charts=[chart])


def _kind(one: Result, check: str) -> int:
    return 2 if check in one.missed_by else 0 if check in one.rejected_by else 1


def _said(one: Result, check: str) -> str:
    size = "" if one.size is None else f", size {one.size:.0e}"
    seen = f"; seen from {one.limits[check]:.2g}" if check in one.limits else ""
    return f"{one.about}{size}{seen}"
