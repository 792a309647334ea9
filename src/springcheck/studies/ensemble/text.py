"""The report of an ensemble as text."""

from __future__ import annotations

from argparse import Namespace

from springcheck.studies.ensemble.result import CELL_SCALE, Ensemble, Tally
from springcheck.studies.text import left_out, of_energy, resumed
from springcheck.text.lines import Lines, plain, table
from springcheck.text.wording import count


def lines(found: Ensemble, options: Namespace | None = None) -> Lines:
    """One line a method."""
    cells = max((tally.cells for tally in found.tallies), default=0)
    how = "a grid" if found.grid else "random samples"
    rows = [
        (x.method, str(x.cells), str(x.complete), *_span(x, "max_error"), *_span(x, "energy_drift"))
        for x in found.tallies
    ]
    titles = ("method", "cells", "complete", "error from", "to", "energy from", "to")
    out: Lines = [
        plain(f"{found.scene.title}: {count(cells, 'cell')}, {how} over {', '.join(found.fields)}", "bold"),
        *resumed(found.resumed, "chunk"),
        plain(),
        table(titles, rows),
        plain(
            f"error: largest distance from the exact solution; energy: {of_energy(found.scene, CELL_SCALE)}",
            "dim",
        ),
        plain("no cell is judged: `springcheck run SCENE --set FIELD=NUMBER` judges one of them", "dim"),
        *left_out(found.left_out),
    ]
    return out


def _span(tally: Tally, name: str) -> tuple[str, str]:
    if name not in tally.smallest:
        return "-", "-"
    return f"{tally.smallest[name]:.1e}", f"{tally.largest[name]:.1e}"
