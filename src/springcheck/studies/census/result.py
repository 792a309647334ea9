"""Result of the census: one entry for each engine and way to attach a spring.

Its text has one row a method, under the scheme that its states show.
"""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import nan
from typing import Any, ClassVar

import numpy as np

from springcheck.figures.looks import title
from springcheck.physics.arrays import Floats
from springcheck.studies import keeper
from springcheck.studies.census.table import amount
from springcheck.studies.study import Studied
from springcheck.studies.tables import RecordForm
from springcheck.studies.text import left_out, resumed
from springcheck.text.lines import Cell, Lines, Row, hanging, plain, table
from springcheck.text.wording import count, few, number, seconds

TITLES = (
    "method", "amplitude", "det - 1", "velocity", "friction", "limit", "arithmetic", "forces", "time",
    "same bits as"
)  # fmt: skip

HEATED = ("method", "configurational", "kinetic", "velocity", "arithmetic", "forces", "time")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Entry:
    """One method of one engine.  Numbers that the states do not give are NaN, names empty."""

    method: str
    about: str
    """Classes and functions of the library that are called."""
    note: str
    """A caveat that its authors would want, and the thread that asked."""
    version: str
    claimed: str
    """The scheme that the engine declares."""
    found: str
    """The scheme that the states of `spring-uneven` show, or a phrase where they show none."""
    agrees: bool
    """Whether the two have the same map; True where nothing can be compared."""
    substeps: int
    """Steps of the found scheme from one state to the next; 0 where none was found."""
    velocity_offset: float = nan
    """Time of the velocities after that of the positions, in steps."""
    area: float = nan
    """Determinant of the measured one-step map minus 1: 0 where areas are preserved."""
    trace: float = nan
    """Its trace: trace and determinant depend neither on units nor on the time of the velocities."""
    friction: float = nan
    """Friction c/m [1/T] that was not requested; the stiffness is as stated."""
    precision: str
    limit: float = nan
    """Smallest h omega at which the measured map grows; 0: it always does; NaN: unknown, or adaptive."""
    bounded: bool = False
    """Whether no map up to h omega = 4 grows; `limit` is infinity then."""
    thermostat: str = ""
    """Title of the thermostat's scheme; "" without a thermostat."""
    along: str = "x"
    """Axes along which the engine moves particles, by its states, and whether it serves a periodic box."""
    configurational: float = nan
    """k <x**2>/kT where a thermostat is on."""
    configurational_error: float = nan
    """Its standard error."""
    kinetic: float = nan
    """m <v**2>/kT where a thermostat is on."""
    kinetic_error: float = nan
    amplitude: float = nan
    """Amplitude of the blog's spring after its 200 steps; 1 is exact."""
    force_calls: float
    """Force evaluations per step, as counted by springcheck."""
    seconds: float = nan
    """Seconds per step on `spring-uneven`, every state read, with nothing else of the study running."""
    digest: str
    """Digest of the states of the blog's spring: equal for engines that agree bit for bit."""
    q: Floats = field(default_factory=lambda: np.empty(0))
    """The orbit of the blog's spring (f,)."""
    p: Floats = field(default_factory=lambda: np.empty(0))

    @property
    def cells(self) -> list[Cell]:
        """Its row of `TITLES`, without the last one, or with a thermostat of `HEATED`."""
        velocity = "-" if np.isnan(self.velocity_offset) else f"{self.velocity_offset:+.1f} h"
        measured = [
            number(self.amplitude, ".4f"), amount(self.area, 1e-13, "+.2e"), velocity,
            amount(self.friction, 1e-9, "+.2e"), number(self.limit, ".3f", "none"),
        ]  # fmt: skip
        if self.thermostat:
            pairs = (self.configurational, self.configurational_error), (self.kinetic, self.kinetic_error)
            measured = [*(f"{value:.4f} +- {error:.1g}" for value, error in pairs), velocity]
        method = plain("  " + self.method, "" if self.agrees else "bold red")
        return [method, *measured, self.precision, f"{self.force_calls:.3g}", seconds(self.seconds)]


ENTRIES: RecordForm[Entry] = RecordForm(kind=Entry, beginning="census/", signal="p", axes=("q",))
"""A table for each method: the orbit, and everything else as attributes."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Census(Studied):
    """The whole study; a row of its table is a method of an engine."""

    table_of: ClassVar[str] = "entries"

    entries: tuple[Entry, ...]
    changes: tuple[str, ...] | None = None
    """Differences from an earlier census; None where none was named."""
    since: str = ""
    """Versions that differ from that census's, old and new."""

    def __repr__(self) -> str:
        engines = {entry.method.partition(":")[0] for entry in self.entries}
        unlike = sum(not entry.agrees for entry in self.entries)
        whose = f"{count(len(self.entries), 'method')} of {count(len(engines), 'engine')}"
        return f"Census({whose}, {unlike} not as declared)"

    @property
    def partners(self) -> Mapping[str, tuple[str, ...]]:
        """For each method the others whose orbits of the blog's spring are bitwise identical."""
        return {
            x.method: tuple(y.method for y in self.entries if y.digest == x.digest and y is not x)
            for x in self.entries
        }

    @property
    def grouped(self) -> Mapping[str, tuple[Entry, ...]]:
        """Entries by the scheme that was found, the most frequent first."""
        found = Counter(entry.found for entry in self.entries)
        return {name: tuple(x for x in self.entries if x.found == name) for name, _ in found.most_common()}

    @property
    def status(self) -> int:
        """Exit status 1: states contradict a declared scheme, or a row has changed; 2: nothing was run."""
        if not self.entries:
            return 2
        return 0 if all(entry.agrees for entry in self.entries) and not self.changes else 1

    def lines(self, options: Namespace | None = None) -> Lines:
        out: Lines = [
            plain("What every engine runs, by its states", "bold"),
            plain("Amplitude: of the blog's spring after 200 steps, exactly 1.  All else: spring-uneven."),
            *resumed(self.resumed, "method"),
            plain(),
        ]
        cold, hot = (_under(self, thermostats=heated) for heated in (False, True))
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
            for x in self.entries
            if not x.agrees
        ]
        versions = {x.method.partition(":")[0]: x.version for x in self.entries}
        out += [plain(), *hanging("Versions: ", "; ".join(dict.fromkeys(versions.values())))]
        notes = dict.fromkeys(f"{x.method}: {x.note}" for x in self.entries if x.note)
        out += [line for note in notes for line in hanging("  note: ", note)]
        if self.changes is not None:
            since = f" ({self.since})" if self.since else ""
            out += [
                plain(),
                plain(f"Changes{since}" if self.changes else f"Nothing has changed{since}", "bold"),
            ]
            out += [line for one in self.changes for line in hanging("  ", one)]
        out += left_out(self.left_out)
        return out

    def document(self) -> dict[str, Any]:
        """Plain data for JSON; the orbits are in the tables of the store."""
        names = [one.name for one in fields(Entry) if one.name not in ("q", "p")]
        partners = self.partners
        rows = [
            {**{name: getattr(x, name) for name in names}, "partners": partners[x.method]}
            for x in self.entries
        ]
        more = {} if self.changes is None else {"changes": self.changes}
        return keeper.document(entries=rows, left_out=self.left_out, **more)


def _under(census: Census, *, thermostats: bool) -> list[Row]:
    """Rows with or without a thermostat, grouped by the scheme that was found."""
    rows: list[Row] = []
    partners = census.partners
    for name, members in census.grouped.items():
        some = [
            [*x.cells, *([] if thermostats else [few(partners[x.method], 2)])]
            for x in members
            if bool(x.thermostat) is thermostats
        ]
        several = name.split(" or ")
        called = few(several, 3, " or ") if len(several) > 1 else title(name)
        rows += [plain(called, "italic"), *some] if some else []
    return rows
