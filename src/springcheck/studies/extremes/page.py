"""The atlas in the report page: every cell with its outcome and its reason."""

from __future__ import annotations

from springcheck.figures.charts import Bank, Chart, Scale, Tiles
from springcheck.studies.extremes.planes import Plane, planes
from springcheck.studies.extremes.result import OUTCOMES, Atlas

SHADES = {
    "right": "good",
    "unstable, as theory says": "wild",
    "engine's limit": "limit",
    "refused": "refused",
    "silently wrong": "wrong",
    "not measured": "refused",
}


def banks(atlas: Atlas) -> list[Bank]:
    """A map for each method of fixed step."""
    charts = [_chart(plane) for plane in planes(atlas.cells)]
    return [Bank(title="Methods drawn", charts=charts)] if charts else []


def _chart(plane: Plane) -> Chart:
    return Chart(
        title=plane.method,
        x=Scale(name="log10 of the force", values=plane.decades),
        y=Scale(name="h \N{GREEK SMALL LETTER OMEGA}", values=plane.turns),
        tiles=Tiles(
            kinds=[(outcome, SHADES[outcome]) for outcome in OUTCOMES],
            rows=[[-1 if x is None else OUTCOMES.index(x.outcome) for x in row] for row in plane.cells],
            notes=[["" if x is None else x.reason for x in row] for row in plane.cells],
        ),
    )
