"""The report of a study of stability as text."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from springcheck.studies.stability.result import Stability
from springcheck.studies.text import left_out, taken_up
from springcheck.text import Lines, plain, table


def lines(study: Stability, options: Namespace | None = None) -> Lines:
    """The whole report."""
    out: Lines = [
        plain(f"{study.scene.title}: limits of stability, measured on one step", "bold"),
        *taken_up(study.taken_up, "measurements"),
        plain(),
    ]
    if study.limits:
        rows = []
        for x in study.limits:
            off = 0.0 if x.limit == x.theory else abs(x.limit - x.theory)
            places = [("none" if np.isinf(y) else f"{y:.9f}") for y in (x.limit, x.theory)]
            grown = [
                "-" if np.isnan(x.growth_above) else f"{y:.7f}" for y in (x.growth_above, x.growth_predicted)
            ]
            style = "" if x.agrees else "bold red"
            rows.append([plain(cell, style) for cell in (x.method, *places, f"{off:.0e}", *grown)])
        out += [table(("method", "limit h w", "theory", "off", "growth above", "predicted"), rows), plain()]
    if study.costs:
        costs = [
            (
                x.method, f"{x.ratio:.0e}", str(x.steps), str(x.rejected), str(x.force_calls),
                "-" if np.isnan(x.error) else f"{x.error:.1e}", x.outcome.partition(":")[0],
            )
            for x in study.costs
        ]  # fmt: skip
        titles = ("method", "ratio", "steps", "rejected", "force calls", "error", "outcome")
        out += [table(titles, costs, left=("method", "outcome")), plain()]
    out += [plain(line) for line in study.sentences]
    out += left_out(study.left_out)
    return [*out, plain(f"Stored in {study.path}")] if study.path else out
