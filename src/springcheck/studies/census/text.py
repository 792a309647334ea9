"""The census as text: one row a method, under the scheme that its states show."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable

import numpy as np

from springcheck.figures.looks import title
from springcheck.studies.census.result import Census, Entry
from springcheck.studies.census.table import amount
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Cell, Lines, Row, hanging, plain, table
from springcheck.text.wording import few, number, seconds

TITLES = (
    "method", "amplitude", "det - 1", "velocity", "friction", "limit", "arithmetic", "forces", "time",
    "same bits as"
)  # fmt: skip

HEATED = ("method", "configurational", "kinetic", "velocity", "arithmetic", "forces", "time")


def lines(census: Census, options: Namespace | None = None) -> Lines:
    """The whole report."""
    out: Lines = [
        plain("What every engine runs, by its states", "bold"),
        plain("Amplitude: of the blog's spring after 200 steps, exactly 1.  All else: spring-uneven."),
        *resumed(census.resumed, "method"),
        plain(),
    ]
    partners = census.partners
    cold = _under(census, False, lambda x: [*_cold(x), few(partners[x.method], 2)])
    hot = _under(census, True, _heated)
    if cold:
        out.append(table(TITLES, cold, left=("method", "arithmetic"), prose=TITLES[-1]))
    if hot:
        out += [
            *([plain()] if cold else []),
            plain("Temperatures over that of the bath, by springs of h omega = 0.5 and gamma h = 0.4:"),
            table(HEATED, hot, left=("method", "arithmetic")),
        ]
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


def _under(census: Census, thermostats: bool, row: Callable[[Entry], Row]) -> list[Row]:
    """Rows with or without a thermostat, grouped by the scheme that was found."""
    rows: list[Row] = []
    for name, members in census.grouped.items():
        some = [row(x) for x in members if bool(x.thermostat) is thermostats]
        several = name.split(" or ")
        called = few(several, 3, " or ") if len(several) > 1 else title(name)
        rows += [plain(called, "italic"), *some] if some else []
    return rows


def _heated(x: Entry) -> list[Cell]:
    temperatures = (x.configurational, x.configurational_error), (x.kinetic, x.kinetic_error)
    return _row(x, *(f"{value:.4f} +- {error:.1g}" for value, error in temperatures), _velocity(x))


def _cold(x: Entry) -> list[Cell]:
    amplitude, area = number(x.amplitude, ".4f"), amount(x.area, 1e-13, "+.2e")
    friction, limit = amount(x.friction, 1e-9, "+.2e"), number(x.limit, ".3f", "none")
    return _row(x, amplitude, area, _velocity(x), friction, limit)


def _velocity(x: Entry) -> str:
    return "-" if np.isnan(x.velocity_offset) else f"{x.velocity_offset:+.1f} h"


def _row(x: Entry, *measured: str) -> list[Cell]:
    method = plain("  " + x.method, "" if x.agrees else "bold red")
    return [method, *measured, x.precision, f"{x.force_calls:.3g}", seconds(x.seconds)]
