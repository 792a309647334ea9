"""The report of the atlas of extreme cases as text."""

from __future__ import annotations

from argparse import Namespace

from springcheck.studies.extremes.result import Atlas
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, plain, table
from springcheck.text.wording import count

SHORT = {
    "right": "right",
    "unstable, as theory says": "unstable",
    "engine's limit": "limit",
    "silently wrong": "wrong",
}
"""Outcomes, and the titles of their columns."""


def lines(atlas: Atlas, options: Namespace | None = None) -> Lines:
    """The whole report."""
    rows = []
    for method in dict.fromkeys(cell.method for cell in atlas.cells):
        counts = atlas.counts(method)
        rows.append((method, str(sum(counts.values())), *(str(counts[outcome]) for outcome in SHORT)))
    wrong = atlas.wrong
    verdict = f"{count(len(wrong), 'cell')} silently wrong" if wrong else "no cell is silently wrong"
    out: Lines = [
        plain(f"{len(atlas.cells)} extreme cases", "bold"),
        *resumed(atlas.resumed, "table"),
        plain(),
        table(("method", "cells", *SHORT.values()), rows),
        plain(),
        *(plain(window.sentence) for window in atlas.windows),
        *(
            plain(f"silently wrong: {cell.method} {cell.parameters}: {cell.reason}", "bold red")
            for cell in wrong[:20]
        ),
        plain(verdict, "bold red" if wrong else "bold green"),
        *left_out(atlas.left_out),
    ]
    return out
