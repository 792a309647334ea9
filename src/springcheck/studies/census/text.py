"""The census as text: one row a method, under the scheme that its states show."""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from springcheck.figures.looks import title
from springcheck.studies.census.result import Census, Entry
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, Row, hanging, plain, table
from springcheck.text.wording import few, seconds

TITLES = (
    "method", "amplitude", "det - 1", "velocity", "friction", "limit", "arithmetic", "forces", "time",
    "same bits as"
)  # fmt: skip


def lines(census: Census, options: Namespace | None = None) -> Lines:
    """The whole report."""
    out: Lines = [
        plain("What every engine runs, by its states", "bold"),
        plain("Amplitude: of the blog's spring after 200 steps, exactly 1.  All else: spring-uneven."),
        *resumed(census.resumed, "method"),
        plain(),
    ]
    rows: list[Row] = []
    partners = census.partners
    for name, members in census.grouped.items():
        rows.append(plain(title(name), "italic"))
        rows += [_row(x, partners[x.method]) for x in members]
    out.append(table(TITLES, rows, left=("method", "arithmetic"), prose=TITLES[-1]))
    out += [
        plain(f"{x.method} is declared as {title(x.claimed)}; its states show {title(x.found)}")
        for x in census.entries
        if not x.agrees
    ]
    versions = {x.method.partition(":")[0]: x.version for x in census.entries}
    out += [plain(), *hanging("Versions: ", "; ".join(dict.fromkeys(versions.values())))]
    notes = dict.fromkeys(f"{x.method}: {x.note}" for x in census.entries if x.note)
    out += [line for note in notes for line in hanging("  note: ", note)]
    if census.changes is not None:
        since = f" ({census.since})" if census.since else ""
        out += [
            plain(),
            plain(f"Changes{since}" if census.changes else f"Nothing has changed{since}", "bold"),
        ]
        out += [line for one in census.changes for line in hanging("  ", one)]
    out += left_out(census.left_out)
    return out


def _row(x: Entry, partners: tuple[str, ...]) -> Row:
    return [
        plain("  " + x.method, "" if x.agrees else "bold red"),
        f"{x.amplitude:.4f}",
        _number(x.area, 1e-13),
        "-" if np.isnan(x.velocity_offset) else f"{x.velocity_offset:+.1f} h",
        _number(x.friction, 1e-9),
        "-" if np.isnan(x.limit) else "none" if np.isinf(x.limit) else f"{x.limit:.3f}",
        x.precision,
        f"{x.force_calls:.3g}",
        seconds(x.seconds),
        few(partners, 2),
    ]


def _number(x: float, least: float) -> str:
    if np.isnan(x):
        return "-"
    return "0" if abs(x) < least else f"{x:+.2e}"
