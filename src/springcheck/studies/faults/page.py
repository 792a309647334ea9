"""Faults against checks, and how small a fault each check sees, in figures and in the report page."""

from __future__ import annotations

from collections.abc import Sequence

from springcheck.figures.charts import Bank, Chart, Curve, Naming, Scale, Tiles
from springcheck.figures.frames import Frame
from springcheck.studies.faults.result import FaultReport, Result

KINDS = (
    ("rejected", "good"),
    ("passed, or does not apply", "refused"),
    ("passed, and must be rejected", "wrong"),
)


ROOM_FOR_NAMES = 1e6
"""Factor on the largest size to which the axis extends: names of checks stand beyond all marks."""

ROWS_OF_A_MAP, MAPS_BESIDE = 60, 3
"""Most faults in one map, and the number of maps, side by side, of more."""


def banks(found: FaultReport) -> list[Bank]:
    """Maps: a row a fault, a column a check that rejects any; and how small a fault each check sees."""
    checks = _checks(found.results)
    if not checks:
        return []
    size = -(-len(found.results) // (MAPS_BESIDE if len(found.results) > ROWS_OF_A_MAP else 1))
    parts = [found.results[i : i + size] for i in range(0, len(found.results), size)]
    many = len(parts) > 1
    return [
        Bank(
            name="faults-checks", title="Faults and checks", charts=[_map(part, many=many) for part in parts],
            heading=_heading(found, len(checks)), columns=len(parts),
            size=(4.9, 0.165 * size + 2.0) if many else None,
        ),
        *([_limits(found.results[::-1])] if any(one.limits for one in found.results) else []),
    ]  # fmt: skip


def _checks(results: Sequence[Result]) -> list[str]:
    """The checks that reject any of these faults, or should."""
    return list(
        dict.fromkeys(name for one in results for name in (*one.rejected_by, *one.missed_by, *one.limits))
    )


def _map(part: Sequence[Result], *, many: bool) -> Chart:
    """Some of the faults, the first one above, and the checks that reject any of them."""
    checks, results = _checks(part), part[::-1]
    of = f": {part[0].name} to {part[-1].name}" if many else ""
    return Chart(
        title=f"Which check sees which fault, at its size in the table{of}.",
        x=Scale(name="check", names=checks),
        y=Scale(name="fault", names=[one.name for one in results]),
        tiles=Tiles(
            kinds=KINDS,
            rows=[
                [2 if x in one.missed_by else 0 if x in one.rejected_by else 1 for x in checks]
                for one in results
            ],
            notes=[[_said(one, name) for name in checks] for one in results],
        ),
    )


def _heading(found: FaultReport, checks: int) -> str:
    missed = [one.name for one in found.results if one.missed_by or not one.rejected_by]
    said = "each is rejected" if not missed else f"{len(missed)} are missed, {missed[0]} first"
    return f"{len(found.results)} engines broken on purpose: {said}; {checks} checks"


def _limits(results: Sequence[Result]) -> Bank:
    """A row for each fault, a mark at the detection limit of each check; the most sensitive one is named."""
    shown = [one for one in results if one.limits]
    rows = [
        [(size, float(j), name) for name, size in sorted(one.limits.items(), key=lambda x: x[1])]
        for j, one in enumerate(shown)
    ]
    first, others = [row[0] for row in rows], [x for row in rows for x in row[1:]]
    ys = Frame(-0.5, len(shown) - 0.5)
    curves = [
        Curve(
            name=name, group=name, x=[x for x, *_ in some], y=[y for _, y, _ in some], line=False, marks=True,
            notes=[check for *_, check in some],
        )
        for name, some in (("its sharpest check", first), ("other checks", others)) if some
    ]  # fmt: skip
    least, most = (f(x for x, *_ in [*first, *others]) for f in (min, max))
    chart = Chart(
        title="How small a fault is seen, each on its own scene, and by which check first.",
        x=Scale(
            name="smallest relative size that the check rejects", log=True,
            shown=(least / 3, most * ROOM_FOR_NAMES),
        ),
        y=Scale(name="fault", names=[one.name for one in shown], shown=ys.ends),
        curves=curves,
        labels=[
            Naming(text=check, group=curves[0].name, x=0.99, y=float(v) - 0.009)
            for (*_, check), v in zip(first, ys.parts([y for _, y, _ in first]), strict=True)
        ],
    )  # fmt: skip
    middle = sorted(x for x, *_ in first)[len(first) // 2]
    heading = f"Half of {len(shown)} faults are seen from {middle:.0e} on, each on a scene of its own"
    return Bank(name="faults", title="Checks", charts=[chart], heading=heading)


def _said(one: Result, check: str) -> str:
    size = "" if one.size is None else f", size {one.size:.0e}"
    seen = f"; seen from {one.limits[check]:.2g}" if check in one.limits else ""
    return f"{one.about}{size}{seen}"
