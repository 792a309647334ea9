"""The study of sampling as text: one row a thermostat."""

from __future__ import annotations

from argparse import Namespace

from springcheck.figures.looks import title
from springcheck.studies.sampling.result import Sampled, Sampling
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Lines, Row, plain, table
from springcheck.text.wording import number, seconds

TITLES = ("method", "configurational", "law", "kinetic", "law ", "off", "law  ", "limit", "law   ", "forces",
          "time")  # fmt: skip


def lines(found: Sampling, options: Namespace | None = None) -> Lines:
    """The whole report."""
    out: Lines = [
        plain("How well thermostats sample a spring", "bold"),
        plain("Temperatures over the bath's at h omega = 0.5 and friction 0.4 omega; what k<q2>/kT over 500"),
        plain("steps is off from 1; the largest stable h omega at friction omega.  Each beside its law."),
        *resumed(found.resumed, "method"),
        plain(),
    ]
    rows: list[Row] = []
    for name in dict.fromkeys(x.scheme for x in found.methods):
        rows.append(plain(title(name), "italic"))
        rows += [_row(x) for x in found.methods if x.scheme == name]
    out.append(table(TITLES, rows, left=("method",)))
    out += [
        plain(f"{x.method}: a temperature is not its law's", "bold red") for x in found.methods if x.departs
    ]
    out += left_out(found.left_out)
    return out


def _row(x: Sampled) -> Row:
    at = list(x.friction).index(1.0)
    measured = (
        x.configurational[1], x.configurational_law[1], x.kinetic[1], x.kinetic_law[1], x.off[-1],
        x.off_law[-1], x.limit[at], x.limit_law[at],
    )  # fmt: skip
    return [
        plain("  " + x.method, "bold red" if x.departs else ""),
        *(number(one, ".4f", "none") for one in measured), f"{x.force_calls:.3g}", seconds(x.seconds),
    ]  # fmt: skip
