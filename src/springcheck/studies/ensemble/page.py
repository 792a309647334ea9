"""Error and energy over the field that was varied, in the report page."""

from __future__ import annotations

import numpy as np

from springcheck.figures.looks import scheme_of
from springcheck.studies.charts import Bank, Chart, Curve, Scale
from springcheck.studies.ensemble.measure import columns
from springcheck.studies.ensemble.result import Ensemble

SHOWN = {"max_error": "largest error, of the start", "energy_drift": "|H - H0| / |H0| where largest"}


def banks(found: Ensemble) -> list[Bank]:
    """Charts over one field; of several fields the table alone."""
    if found.path is None or len(found.fields) != 1:
        return []
    over = found.fields[0]
    cells = {x.method: columns(found.path, x.method) for x in found.tallies if x.complete}
    log = all(np.min(x[over]) > 0 and np.max(x[over]) > 30 * np.min(x[over]) for x in cells.values())
    charts = []
    for name, title in SHOWN.items():
        curves = []
        for method, x in cells.items():
            order = np.argsort(x[over])
            value = np.abs(x[name][order])
            if np.any(value > 0):
                group = scheme_of(method)
                curves.append(Curve(name=method, group=group, x=x[over][order], y=value, marks=True))
        if curves:
            charts.append(
                Chart(
                    title=f"{title}, over {over}.",
                    x=Scale(name=over, log=log),
                    y=Scale(name=title, log=True),
                    curves=curves,
                )
            )
    return [Bank(title="Methods drawn", charts=charts)] if charts else []
